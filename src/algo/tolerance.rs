//! The tolerance d, as a number or as a share of the MMD^2 of doing nothing.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser::SerializeMap};

use crate::quantity::Positive;

/// The greatest distance of a policy from the demonstration; written `d = 1e-3` or
/// `d = { relative = 0.02 }`.
///
/// MMD^2 has the scale of the demonstration's actions: of the paper's tolerances, 1e-2 is half of
/// the MMD^2 of doing nothing in Walker2d, and twenty times as much in InvertedPendulum. A share
/// means the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// This MMD^2.
    Absolute(Positive),
    /// This share of the MMD^2 of the mean action 0 at the demonstration's states.
    Relative(Positive),
}

impl Tolerance {
    /// The bound on MMD^2; `of_nothing` gives the MMD^2 of doing nothing.
    pub fn bound(self, of_nothing: impl FnOnce() -> f64) -> f64 {
        match self {
            Self::Absolute(d) => d.get(),
            Self::Relative(share) => share.get() * of_nothing(),
        }
    }
}

const RELATIVE: &str = "relative";

impl Serialize for Tolerance {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Absolute(d) => d.serialize(serializer),
            Self::Relative(share) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry(RELATIVE, share)?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for Tolerance {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

struct Written;

impl<'de> de::Visitor<'de> for Written {
    type Value = Tolerance;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number above 0 or `{ relative = SHARE }`")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Tolerance, E> {
        Positive::try_from(value)
            .map(Tolerance::Absolute)
            .map_err(|error| error.refusal())
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Tolerance, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Tolerance, E> {
        self.visit_f64(value as f64)
    }

    fn visit_map<A: de::MapAccess<'de>>(self, mut map: A) -> Result<Tolerance, A::Error> {
        match map.next_key::<String>()? {
            Some(key) if key == RELATIVE => {}
            // TOML gives a date as a map with one private key.
            Some(key) if key.starts_with("$__") => {
                return Err(de::Error::invalid_type(de::Unexpected::Map, &self));
            }
            Some(key) => return Err(de::Error::unknown_field(&key, &[RELATIVE])),
            None => return Err(de::Error::missing_field(RELATIVE)),
        }
        let share = map.next_value()?;
        match map.next_key::<String>()? {
            Some(key) => Err(de::Error::unknown_field(&key, &[RELATIVE])),
            None => Ok(Tolerance::Relative(share)),
        }
    }
}

impl schemars::JsonSchema for Tolerance {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Tolerance".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let positive = generator.subschema_for::<Positive>();
        schemars::json_schema!({
            "oneOf": [
                positive,
                {
                    "type": "object",
                    "properties": { RELATIVE: positive },
                    "required": [RELATIVE],
                    "additionalProperties": false,
                },
            ],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::constant;

    fn read(text: &str) -> Result<Tolerance, toml::de::Error> {
        let table: toml::Table = toml::from_str(text)?;
        table["d"].clone().try_into()
    }

    #[test]
    fn what_is_no_tolerance_is_refused_with_what_is_one() {
        for (text, told) in [
            ("d = 0", "a finite number above 0"),
            ("d = -1e-3", "a finite number above 0"),
            ("d = { relative = 0.0 }", "a finite number above 0"),
            (
                "d = 'small'",
                "expected a number above 0 or `{ relative = SHARE }`",
            ),
            (
                "d = { absolute = 1 }",
                "unknown field `absolute`, expected `relative`",
            ),
            ("d = { relative = 1, more = 2 }", "unknown field `more`"),
            ("d = {}", "missing field `relative`"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.message().contains(told), "{text}: {error}");
        }
    }

    #[test]
    fn it_is_read_as_it_is_written() {
        for (text, tolerance) in [
            ("d = 0.001\n", Tolerance::Absolute(constant(1e-3))),
            (
                "[d]\nrelative = 0.02\n",
                Tolerance::Relative(constant(0.02)),
            ),
        ] {
            assert_eq!(read(text), Ok(tolerance));
            let table = toml::Table::from_iter([(
                "d".to_owned(),
                toml::Value::try_from(tolerance).expect("a value"),
            )]);
            assert_eq!(toml::to_string(&table).as_deref(), Ok(text));
            let json = serde_json::to_string(&tolerance).expect("a value");
            assert_eq!(
                serde_json::from_str::<Tolerance>(&json).ok(),
                Some(tolerance),
                "{json}"
            );
        }
        assert_eq!(read("d = 1"), Ok(Tolerance::Absolute(constant(1.0))));
        assert_eq!(Tolerance::Relative(constant(0.5)).bound(|| 4e-2), 2e-2);
        assert_eq!(
            Tolerance::Absolute(constant(0.5)).bound(|| unreachable!("not needed")),
            0.5
        );
    }
}
