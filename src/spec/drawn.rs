//! How a figure is drawn: its panels, its width, its bands.

use std::fmt;

use super::{Key, Selection, named::named};
use crate::fit::objection;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{Error, SeqAccess, Unexpected, Visitor, value::SeqAccessDeserializer},
};

/// The panels of a figure.
#[derive(Debug, Clone, PartialEq)]
pub enum Panels {
    /// Each value of this axis.
    Axis(Key),
    /// Each of these selections, as for `--only`; a run may be in several.
    Selections(Vec<Selection>),
}

impl Default for Panels {
    fn default() -> Self {
        Self::Axis(Key::Env)
    }
}

impl Panels {
    const EXPECTED: &str = "an axis, or a list of selections";
}

impl Serialize for Panels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Axis(axis) => axis.serialize(serializer),
            Self::Selections(selections) => selections.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Panels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;

        impl<'de> Visitor<'de> for OneOrMany {
            type Value = Panels;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str(Panels::EXPECTED)
            }

            fn visit_str<E: Error>(self, axis: &str) -> Result<Panels, E> {
                named(axis).map(Panels::Axis)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, selections: A) -> Result<Panels, A::Error> {
                let selections =
                    Vec::<Selection>::deserialize(SeqAccessDeserializer::new(selections))?;
                match selections.is_empty() {
                    true => Err(A::Error::custom("a figure needs at least one panel")),
                    false => Ok(Panels::Selections(selections)),
                }
            }
        }

        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Panels {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Panels".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string" },
            { "type": "array", "minItems": 1, "items": { "type": "string" } },
        ] })
    }
}

/// The printed width of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Width {
    /// One column of two: 3.25 inches.
    Column,
    /// A text of one column: 5.5 inches.
    Text,
    /// Both columns of two: 7 inches.
    Full,
    /// This many inches.
    Inches(f64),
}

impl Width {
    const NAMED: [(&str, Self); 3] = [
        ("column", Self::Column),
        ("text", Self::Text),
        ("full", Self::Full),
    ];
    const NARROWEST: f64 = 2.0;
    const WIDEST: f64 = 20.0;
    const EXPECTED: &str = "`column`, `text`, `full`, or inches from 2 to 20";

    /// The width in inches.
    pub const fn inches(self) -> f64 {
        match self {
            Self::Column => 3.25,
            Self::Text => 5.5,
            Self::Full => 7.0,
            Self::Inches(inches) => inches,
        }
    }
}

impl Serialize for Width {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (self, Self::NAMED.iter().find(|(_, width)| width == self)) {
            (_, Some((name, _))) => serializer.serialize_str(name),
            (width, None) => serializer.serialize_f64(width.inches()),
        }
    }
}

impl<'de> Deserialize<'de> for Width {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrNumber;

        impl Visitor<'_> for NameOrNumber {
            type Value = Width;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str(Width::EXPECTED)
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Width, E> {
                let known = Width::NAMED.iter().find(|(known, _)| *known == name);
                let unknown = || {
                    let message = format!("unknown width `{name}`");
                    let expected = format!("expected {}", Width::EXPECTED);
                    E::custom(objection(&message, Some(&expected)))
                };
                known.map(|(_, width)| *width).ok_or_else(unknown)
            }

            fn visit_f64<E: Error>(self, inches: f64) -> Result<Width, E> {
                match (Width::NARROWEST..=Width::WIDEST).contains(&inches) {
                    true => Ok(Width::Inches(inches)),
                    false => Err(E::invalid_value(Unexpected::Float(inches), &self)),
                }
            }

            fn visit_i64<E: Error>(self, inches: i64) -> Result<Width, E> {
                self.visit_f64(inches as f64)
            }
        }

        deserializer.deserialize_any(NameOrNumber)
    }
}

impl JsonSchema for Width {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Width".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "enum": Self::NAMED.map(|(name, _)| name) },
            { "type": "number", "minimum": Self::NARROWEST, "maximum": Self::WIDEST },
        ] })
    }
}

/// What is drawn of a curve's seeds, beside their mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Band {
    /// The 95 % Student t interval of the mean; of two seeds, their range.
    #[default]
    T,
    /// One standard deviation of the seeds to each side.
    Std,
    /// The 95 % bootstrap interval of the mean, which is too narrow for few seeds.
    Bootstrap,
    /// No band, but a thin line for each seed.
    Seeds,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit;

    fn width(text: &str) -> Result<Width, String> {
        let table: toml::Table = toml::from_str(&format!("x = {text}")).expect("TOML");
        fit::read(table["x"].clone()).map_err(|mistake| mistake.to_string())
    }

    #[test]
    fn a_width_is_a_name_or_inches_within_reason() {
        for (text, inches) in [
            ("'column'", 3.25),
            ("'text'", 5.5),
            ("'full'", 7.0),
            ("6.1", 6.1),
            ("4", 4.0),
        ] {
            assert_eq!(width(text).map(Width::inches), Ok(inches), "{text}");
        }
        for (text, error) in [
            ("'wide'", "unknown width `wide`"),
            ("0.5", "0.5 is out of range"),
            ("nan", "NaN is out"),
        ] {
            assert!(
                width(text).expect_err(text).starts_with(error),
                "{text}: {:?}",
                width(text)
            );
        }
    }
}
