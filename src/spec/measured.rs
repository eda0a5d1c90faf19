//! How a file names what is drawn and compared: `y` of a figure and `on` of a claim.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::names::nearest_label;
use crate::{
    fit::objection,
    measured::{Measure, UnknownMeasure},
};

/// The content of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drawing {
    /// One step of MCPO, as in the paper's Figure 1, which needs no run.
    Step,
    /// Learning curves of this quantity.
    Of(Measure),
}

impl Drawing {
    /// The name of [`Drawing::Step`].
    const STEP: &str = "step";

    /// The quantity of its curves; `None` if it has none.
    pub fn measure(self) -> Option<Measure> {
        match self {
            Self::Step => None,
            Self::Of(measure) => Some(measure),
        }
    }

    /// Every name that a file can give.
    pub(super) fn names() -> impl Iterator<Item = &'static str> {
        Measure::names().chain([Self::STEP])
    }
}

impl Serialize for Drawing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(match self {
            Self::Step => Self::STEP,
            Self::Of(measure) => measure.name(),
        })
    }
}

impl<'de> Deserialize<'de> for Drawing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        if name == Self::STEP {
            return Ok(Self::Step);
        }
        let wrong = |error| D::Error::custom(refusal(&error, "y", "a figure draws", Self::names()));
        Measure::parse(&name).map(Self::Of).map_err(wrong)
    }
}

impl JsonSchema for Drawing {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Drawing".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string" })
    }
}

/// Writes a measure as its name.
pub(super) fn serialize<S: Serializer>(
    measure: &Measure,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(measure.name())
}

/// Reads the measure of a claim.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Measure, D::Error> {
    let wrong = |error| {
        D::Error::custom(refusal(
            &error,
            "column",
            "a claim is about",
            Measure::names(),
        ))
    };
    Measure::parse(&String::deserialize(deserializer)?).map_err(wrong)
}

/// The message about a name that is not allowed for `what`.
fn refusal(
    error: &UnknownMeasure,
    what: &str,
    takes: &str,
    names: impl Iterator<Item = &'static str>,
) -> String {
    match error {
        UnknownMeasure::Words(name) => {
            objection(&format!("`{name}` holds words; {takes} numbers"), None)
        }
        UnknownMeasure::NoColumn(name) => objection(
            &format!("unknown {what} `{name}`"),
            nearest_label(what, name, names).as_deref(),
        ),
    }
}
