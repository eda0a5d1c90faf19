//! Selections of runs: `env=Hopper-v2,algorithm=mcpo,d!=0.001`.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::{
    Algorithm, Key,
    arguments::{pieces, value as parsed},
    named::Named,
    names::nearest_label,
};
use crate::{
    env::{EnvError, EnvId},
    fit::objection,
    measured::Measure,
};

/// Runs selected by the values of their axes and parameters.
/// All keys must match; a key given twice must match one of its values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// The text as it was written.
    text: String,
    /// Keys with the values that they may have.
    pub(crate) wanted: Vec<(Key, Vec<toml::Value>)>,
    /// Keys with the values that they may not have; a run without the key is not excluded.
    pub(crate) unwanted: Vec<(Key, Vec<toml::Value>)>,
}

/// A selection that cannot be understood.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SelectionError {
    /// A piece is neither `KEY=VALUE` nor `KEY!=VALUE`.
    #[error("`{0}` is not of the form KEY=VALUE or KEY!=VALUE")]
    Form(String),
    /// No run has such a key.
    #[error("unknown key `{key}` in a selection; {known}")]
    Key {
        /// The key as it was given.
        key: String,
        /// The known keys, for the message.
        known: String,
    },
    /// There is no such environment or algorithm.
    #[error("unknown {key} `{value}` in a selection; {known}")]
    Value {
        /// `env` or `algorithm`.
        key: String,
        /// The value as it was given.
        value: String,
        /// The known names, for the message.
        known: String,
    },
}

impl Selection {
    /// The runs that `text` (`KEY=VALUE,KEY!=VALUE...`) means.
    ///
    /// # Errors
    ///
    /// A piece has another form, or names a key, environment or algorithm that does not exist.
    pub fn parse(text: &str) -> Result<Self, SelectionError> {
        let mut selection = Self {
            text: text.to_owned(),
            ..Self::default()
        };
        for piece in pieces(text) {
            let (key, value) = piece
                .split_once('=')
                .ok_or_else(|| SelectionError::Form(piece.into()))?;
            let (key, list) = match key.strip_suffix('!') {
                Some(key) => (key, &mut selection.unwanted),
                None => (key, &mut selection.wanted),
            };
            let (key, value) = (key.trim().trim_matches('"'), value.trim());
            let key = Key::parse(key).ok_or_else(|| unknown(key))?;
            let value = meaning(&key, value)?;
            match list.iter_mut().find(|(known, _)| *known == key) {
                Some((_, values)) => values.push(value),
                None => list.push((key, vec![value])),
            }
        }
        Ok(selection)
    }
}

/// The error that no run has the key `name`.
fn unknown(name: &str) -> SelectionError {
    let keys = Key::known();
    let known = if Measure::parse(name).is_ok() {
        "it is recorded during a run, and runs are selected by what was set before".to_owned()
    } else {
        nearest_label("one", name, keys.iter().map(String::as_str)).unwrap_or_default()
    };
    SelectionError::Key {
        key: name.to_owned(),
        known,
    }
}

/// The TOML value that `value` stands for under `key`.
fn meaning(key: &Key, value: &str) -> Result<toml::Value, SelectionError> {
    let unknown = |known: String| SelectionError::Value {
        key: key.to_string(),
        value: value.to_owned(),
        known,
    };
    let text = match key {
        Key::Env => {
            let env = value.parse::<EnvId>().map_err(|error| match error {
                EnvError::UnknownEnvironment { known, .. } => unknown(known),
                other => unknown(other.to_string()),
            })?;
            env.name().to_owned()
        }
        Key::Algorithm if Algorithm::names().any(|name| name == value) => value.to_owned(),
        Key::Algorithm => {
            return Err(unknown(
                nearest_label("one", value, Algorithm::names()).unwrap_or_default(),
            ));
        }
        Key::Seed | Key::Parameter(_) => return Ok(parsed(value)),
    };
    Ok(toml::Value::String(text))
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Serialize for Selection {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for Selection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let parsed = Self::parse(&String::deserialize(deserializer)?);
        parsed.map_err(|error| D::Error::custom(objection(&error.to_string(), None)))
    }
}

impl schemars::JsonSchema for Selection {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Selection".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "type": "string" })
    }
}

#[cfg(test)]
impl From<&str> for Selection {
    fn from(text: &str) -> Self {
        Self::parse(text).expect("a selection")
    }
}
