//! Which runs a selection means.

use toml::Value;

use super::{RunSpec, Selection, id::short};

impl Selection {
    /// Whether `run` is meant. Numbers are compared as numbers: `1e-3` is 0.001.
    pub fn matches(&self, run: &RunSpec) -> bool {
        self.wanted.iter().all(|(key, values)| match run.value(key) {
            Some(value) => values.iter().any(|wanted| same(key, &value, wanted)),
            None => false,
        })
    }
}

fn same(key: &str, value: &Value, wanted: &Value) -> bool {
    match (number(value), number(wanted)) {
        (Some(value), Some(wanted)) => value == wanted,
        _ => value == wanted || wanted.as_str().is_some_and(|wanted| short(key, value) == wanted),
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64))
}
