//! The canonical form of a run: everything that decides its numbers, as text that outlives the
//! types it came from.
//!
//! Owns which keys count and how values are written. A key has one line, `mcpo.max_kl = 0.005`, in
//! the keys' order. Numbers are written by value, whether a type holds them as whole or not; an
//! absent value has no line. Fingerprints are digests of this text: whoever changes it voids every
//! recorded run. Start at [`canonical`].

use std::collections::BTreeMap;

use serde_json::Value;

use super::RunSpec;
use crate::spec::Algorithm;

/// Keys that are no settings: names, places, and the input of reports.
const NAMES: [&str; 5] = ["experiment", "id", "axes", "columns", "demonstration"];
/// Settings that cannot change training: its length, how it is watched, and what is kept of it.
const WATCHING: [&str; 3] = ["budget", "evaluation", "checkpoint"];

/// Settings that are newer than some recorded runs, each with its neutral value, under which
/// nothing changes, as JSON.
/// Hyperparameters that are newer stand in their [algorithms'
/// definitions](crate::spec::Algorithm::later).
///
/// A run with the neutral value has the fingerprint that it had before the key was there, and a
/// record that does not name the key is read as if it had that value. So a new setting needs a line
/// here, and voids only the runs that set it otherwise.
const LATER: &[(&str, &str)] = &[];

/// All keys that are newer than some recorded runs, each with its neutral value.
fn later() -> Vec<(String, &'static str)> {
    let settings = LATER
        .iter()
        .map(|(key, neutral)| ((*key).to_owned(), *neutral));
    settings.chain(Algorithm::later()).collect()
}

/// The values that decide the numbers of `run`, by key.
pub(super) fn canonical(run: &RunSpec) -> BTreeMap<String, String> {
    without_neutral(decisive(&all(run)), &later())
}

/// Every setting and hyperparameter of `run`, by key, without names and places.
pub(super) fn all(run: &RunSpec) -> BTreeMap<String, String> {
    let mut lines = BTreeMap::from([(
        "algorithm".to_owned(),
        format!("{:?}", run.algorithm_name()),
    )]);
    let Ok(Value::Object(fields)) = serde_json::to_value(run) else {
        unreachable!("a run is a table")
    };
    for (name, value) in fields
        .into_iter()
        .filter(|(name, _)| !NAMES.contains(&name.as_str()))
    {
        match name.as_str() {
            // Hyperparameters are named as in a matrix: `mcpo.d`.
            "algorithm" => flatten(String::new(), &value, &mut lines),
            // A user's robot counts with its name and its table; a digest stands for its model,
            // wherever that lies.
            "env" if value.is_object() => {
                flatten(name, &value["name"], &mut lines);
                flatten("env".to_owned(), &value["robot"], &mut lines);
            }
            _ => flatten(name, &value, &mut lines),
        }
    }
    lines
}

/// The `lines` that can change training.
fn decisive(lines: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    let decides = |key: &str| !WATCHING.contains(&key.split('.').next().unwrap_or(key));
    lines
        .iter()
        .filter(|(key, _)| decides(key))
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect()
}

/// `lines` without those of neutral values.
fn without_neutral(
    mut lines: BTreeMap<String, String>,
    later: &[(String, &str)],
) -> BTreeMap<String, String> {
    for (key, neutral) in later {
        let mut neutrals = BTreeMap::new();
        flatten(key.clone(), &json(neutral), &mut neutrals);
        if neutrals
            .iter()
            .all(|(key, value)| lines.get(key) == Some(value))
        {
            neutrals.keys().for_each(|key| drop(lines.remove(key)));
        }
    }
    lines
}

/// The run in `spec`, which is a stamp's, even an older program's.
///
/// # Errors
///
/// It is no run, or of a program whose runs this one cannot read.
pub fn recorded(spec: &Value) -> Result<RunSpec, serde_json::Error> {
    serde_json::from_value(with_later(spec.clone(), &later()))
}

/// `spec` with the neutral values of the settings that its program did not know yet.
fn with_later(mut spec: Value, later: &[(String, &str)]) -> Value {
    for (key, neutral) in later {
        let (place, name) = match key.rsplit_once('.') {
            Some((table, name)) => (format!("/{}", table.replace('.', "/")), name),
            None => (String::new(), key.as_str()),
        };
        let places = if place.is_empty() {
            vec![place]
        } else {
            vec![format!("/algorithm{place}"), place]
        };
        let table = places.iter().find(|place| spec.pointer(place).is_some());
        if let Some(Value::Object(table)) = table.and_then(|place| spec.pointer_mut(place)) {
            table.entry(name).or_insert_with(|| json(neutral));
        }
    }
    spec
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("values in the table of later keys are JSON")
}

/// Adds the lines of `value`, whose key is `key`.
fn flatten(key: String, value: &Value, lines: &mut BTreeMap<String, String>) {
    lines.extend(leaves(key, value).map(|(key, leaf)| (key, text(leaf))));
}

/// The values within `value`, whose key is `key`, by their dotted keys; absent ones are left out.
pub(crate) fn leaves(
    key: String,
    value: &Value,
) -> Box<dyn Iterator<Item = (String, &Value)> + '_> {
    match value {
        Value::Object(fields) => Box::new(fields.iter().flat_map(move |(name, value)| {
            let key = if key.is_empty() {
                name.clone()
            } else {
                format!("{key}.{name}")
            };
            leaves(key, value)
        })),
        Value::Null => Box::new(std::iter::empty()),
        leaf => Box::new(std::iter::once((key, leaf))),
    }
}

/// A value as text: `0.005`, `5` for five whether whole or not, `0` for negative zero, `true`,
/// `"rollout"`, `[300, 400]`.
fn text(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => {
            // The shortest digits that parse to the same number, never with an exponent.
            let number = number
                .as_f64()
                .filter(|number| *number != 0.0)
                .unwrap_or(0.0);
            number.to_string()
        }
        Value::Array(values) => format!(
            "[{}]",
            values.iter().map(text).collect::<Vec<_>>().join(", ")
        ),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn lines(value: &Value) -> BTreeMap<String, String> {
        let mut lines = BTreeMap::new();
        flatten(String::new(), value, &mut lines);
        lines
    }

    #[test]
    fn numbers_are_written_by_value() {
        let written = |value| text(&value);
        assert_eq!(written(json!(5)), written(json!(5.0)));
        assert_eq!(written(json!(0.0)), written(json!(-0.0)));
        assert_eq!(
            [
                written(json!(5e-3)),
                written(json!(1e-7)),
                written(json!(1e21))
            ],
            ["0.005", "0.0000001", "1000000000000000000000"]
        );
        assert_ne!(written(json!(0.1 + 0.2)), written(json!(0.3)));
        assert_eq!(written(json!(u64::MAX)), "18446744073709551615");
        assert_eq!(written(json!([300, 400.5])), "[300, 400.5]");
        assert_ne!(written(json!("1")), written(json!(1)));
    }

    #[test]
    fn a_later_key_counts_only_where_it_changes_something() {
        let later = [
            ("mcpo.corrections".to_owned(), "0"),
            ("mcpo.depth".to_owned(), r#"{ "share": 1.0 }"#),
        ];
        let before = json!({ "mcpo": { "d": 0.5 } });
        let neutral = json!({ "mcpo": { "d": 0.5, "corrections": 0.0, "depth": { "share": 1 } } });
        let other = json!({ "mcpo": { "d": 0.5, "corrections": 3, "depth": { "share": 0.5 } } });
        assert_eq!(without_neutral(lines(&neutral), &later), lines(&before));
        assert_eq!(without_neutral(lines(&other), &later), lines(&other));
        assert_eq!(without_neutral(lines(&before), &later), lines(&before));
    }

    #[test]
    fn a_record_that_does_not_know_a_later_key_is_read_with_its_neutral_value() {
        let later = [
            ("mcpo.corrections".to_owned(), "0"),
            ("rollout.order".to_owned(), "\"time\""),
        ];
        let spec = json!({ "algorithm": { "mcpo": { "d": 0.5 } }, "rollout": { "steps": 8 } });
        let read = with_later(spec, &later);
        assert_eq!(read["algorithm"]["mcpo"]["corrections"], json!(0));
        assert_eq!(read["rollout"]["order"], json!("time"));
        let other = json!({ "algorithm": { "ppo": {} }, "rollout": { "order": "space" } });
        assert_eq!(with_later(other.clone(), &later), other);
    }

    #[test]
    fn every_later_key_is_one_that_some_run_has() {
        let named = |key: &str| crate::spec::Parameter::find(key).is_some();
        for (key, neutral) in later() {
            json(neutral);
            assert!(named(&key), "{key}");
        }
    }
}
