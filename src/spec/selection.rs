//! Which runs are meant: `env=Hopper-v2,algorithm=mcpo,d!=0.001`.

use super::{
    Algorithm, Parameter,
    check::BLOCK_KEYS,
    names::nearest_label,
    source::{pieces, value as parsed},
};
use crate::env::EnvId;

/// Runs by the values of their axes and parameters. Different keys must all match; of one key given twice, one value.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// Keys with the values that they may have.
    pub(crate) wanted: Vec<(String, Vec<toml::Value>)>,
    /// Keys with the values that they may not have; a run without the key has none of them.
    pub(crate) unwanted: Vec<(String, Vec<toml::Value>)>,
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
        /// As it was given.
        key: String,
        /// What is known instead.
        known: String,
    },
    /// There is no such environment or algorithm.
    #[error("unknown {key} `{value}` in a selection; {known}")]
    Value {
        /// `env` or `algorithm`.
        key: String,
        /// As it was given.
        value: String,
        /// What is known instead.
        known: String,
    },
}

impl Selection {
    /// The runs that `text` (`KEY=VALUE,KEY!=VALUE...`) means.
    ///
    /// Errors: a piece has another form, or names a key, environment or algorithm that does not exist.
    pub fn parse(text: &str) -> Result<Self, SelectionError> {
        let mut selection = Self::default();
        for piece in pieces(text) {
            let (key, value) = piece.split_once('=').ok_or_else(|| SelectionError::Form(piece.into()))?;
            let (key, list) = match key.strip_suffix('!') {
                Some(key) => (key, &mut selection.unwanted),
                None => (key, &mut selection.wanted),
            };
            let (key, value) = (key.trim().trim_matches('"'), value.trim());
            let value = meaning(key, value)?;
            match list.iter_mut().find(|(known, _)| known == key) {
                Some((_, values)) => values.push(value),
                None => list.push((key.into(), vec![value])),
            }
        }
        Ok(selection)
    }
}

/// What `value` means for `key`.
fn meaning(key: &str, value: &str) -> Result<toml::Value, SelectionError> {
    let unknown = |known: String| SelectionError::Value { key: key.into(), value: value.into(), known };
    let text = match key {
        "env" => {
            let env: EnvId = value.parse().map_err(|_| unknown(EnvId::known_instead(value)))?;
            env.name().to_owned()
        }
        "algorithm" if Algorithm::names().any(|name| name == value) => value.to_owned(),
        "algorithm" => {
            return Err(unknown(nearest_label("one", value, Algorithm::names()).unwrap_or_default()));
        }
        _ if key == "seed" || Parameter::find(key).is_some() => {
            return Ok(parsed(value));
        }
        _ => {
            let names = Parameter::names();
            let known = BLOCK_KEYS.into_iter().chain(names.iter().map(String::as_str));
            let known = nearest_label("one", key, known).unwrap_or_default();
            return Err(SelectionError::Key { key: key.into(), known });
        }
    };
    Ok(toml::Value::String(text))
}
