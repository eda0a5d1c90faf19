//! The axes of a matrix as a reader sees them: which runs belong together, and what to call them.
//!
//! Owns the grouping of runs by the values of axes, and the labels of those values. Knows nothing
//! of what the runs measured. Start at [`group`].

use std::collections::{BTreeSet, HashMap};

use super::recorded::Run;
use crate::{
    env::EnvId,
    spec::{Algorithm, Key, Parameter, Selection},
};

/// Runs that agree on all keys of a grouping; they differ in their seeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Group<'a> {
    /// The value of each key; `None` where the runs do not have that axis, or each has its
    /// environment's default.
    pub values: Vec<Option<toml::Value>>,
    /// The runs, in the plan's order.
    pub runs: Vec<&'a Run>,
}

/// Groups `runs` by the values of `keys`, in the order in which the groups first appear.
///
/// A default that differs between environments, such as Table 2's `d`, counts as one value where a
/// group spans environments.
pub fn group<'a>(runs: &[&'a Run], keys: &[Key]) -> Vec<Group<'a>> {
    let across = !keys.contains(&Key::Env);
    let by_env: Vec<bool> = keys
        .iter()
        .map(|key| across && default_goes_by_environment(runs, key))
        .collect();
    let mut groups: Vec<Group<'a>> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    for &run in runs {
        let value = |(key, by_env): (&Key, &bool)| {
            run.value(key).filter(|_| !by_env || run.departs_in(key))
        };
        let values: Vec<_> = keys.iter().zip(&by_env).map(value).collect();
        match known.get(&format!("{values:?}")) {
            Some(&index) => groups[index].runs.push(run),
            None => {
                known.insert(format!("{values:?}"), groups.len());
                groups.push(Group {
                    values,
                    runs: vec![run],
                });
            }
        }
    }
    groups
}

/// Whether `key` has several defaults among `runs` besides values that were chosen, none of which
/// is a default itself.
fn default_goes_by_environment(runs: &[&Run], key: &Key) -> bool {
    let (chosen, defaults): (Vec<&Run>, Vec<&Run>) =
        runs.iter().copied().partition(|run| run.departs_in(key));
    let values = |runs: &[&Run]| {
        runs.iter()
            .filter_map(|run| Some(run.value(key)?.to_string()))
            .collect::<BTreeSet<_>>()
    };
    let defaults = values(&defaults);
    *key != Key::Algorithm
        && !chosen.is_empty()
        && defaults.len() > 1
        && defaults.is_disjoint(&values(&chosen))
}

/// The axes, other than the seed and `keys`, in which runs with the same `keys` still differ.
///
/// Runs that differ in more than their seed are never averaged: these axes have to become keys too.
/// The algorithm is always among them where it varies, since another axis would not name a group of
/// an algorithm without that axis.
pub fn hidden_axes(runs: &[&Run], keys: &[Key]) -> Vec<Key> {
    let axes: BTreeSet<&String> = runs.iter().flat_map(|run| run.spec.axes.keys()).collect();
    let axes = axes.into_iter().filter_map(|name| Key::parse(name));
    let candidates = [Key::Env, Key::Algorithm].into_iter().chain(axes);
    let mut hidden: Vec<Key> = Vec::new();
    for candidate in candidates.filter(|key| *key != Key::Seed && !keys.contains(key)) {
        let known: Vec<Key> = match candidate {
            Key::Algorithm => Vec::new(),
            _ => keys.iter().chain(&hidden).cloned().collect(),
        };
        let varies = group(runs, &known).iter().any(|group| {
            let first = group.runs[0].value(&candidate);
            group.runs.iter().any(|run| run.value(&candidate) != first)
        });
        if varies {
            hidden.push(candidate);
        }
    }
    hidden
}

/// The name of a column or a curve, and the values behind it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Label {
    /// The name as a reader sees it.
    pub text: String,
    /// The value of each key, for programs; `None` where the runs do not have that axis.
    pub values: Vec<Option<toml::Value>>,
}

/// One label per group, made of the keys whose values tell the groups apart (`MCPO`, `d = 10⁻³, ε =
/// 0`).
pub fn labels(keys: &[Key], groups: &[Group<'_>]) -> Vec<Label> {
    let tells_apart = |index: usize| {
        groups
            .iter()
            .any(|group| group.values[index] != groups[0].values[index])
    };
    let mut shown: Vec<usize> = (0..keys.len())
        .filter(|&index| tells_apart(index))
        .collect();
    if shown.is_empty() {
        shown = (0..keys.len().min(1)).collect();
    }
    let texts = value_labels(groups).into_iter().map(|texts| {
        let part = |index: usize| {
            let text = texts[index].as_ref()?;
            Some(match &keys[index] {
                Key::Algorithm | Key::Env => display_name(text).to_owned(),
                key => format!("{} = {text}", key_label(key)),
            })
        };
        let parts: Vec<String> = shown.iter().filter_map(|&index| part(index)).collect();
        if parts.is_empty() {
            (0..keys.len())
                .find_map(part)
                .unwrap_or("default".to_owned())
        } else {
            parts.join(", ")
        }
    });
    texts
        .zip(groups)
        .map(|(text, group)| Label {
            text,
            values: group.values.clone(),
        })
        .collect()
}

/// Labels for the values of each group; all values of one key are written in one notation.
pub fn value_labels(groups: &[Group<'_>]) -> Vec<Vec<Option<String>>> {
    let keys = groups.first().map_or(0, |group| group.values.len());
    let notations: Vec<Notation> = (0..keys)
        .map(|key| Notation::of(groups.iter().filter_map(|group| group.values[key].as_ref())))
        .collect();
    let label = |group: &Group<'_>| {
        let values = group.values.iter().zip(&notations);
        values
            .map(|(value, notation)| Some(notation.label(value.as_ref()?)))
            .collect()
    };
    groups.iter().map(label).collect()
}

/// The label of axis `key`: the paper's symbol, or the last part of its path in words.
pub fn key_label(key: &Key) -> String {
    match key {
        Key::Env => "environment".to_owned(),
        Key::Parameter(parameter) => parameter_label(parameter),
        Key::Algorithm | Key::Seed => key.last_part().to_owned(),
    }
}

/// The label of a setting or hyperparameter, as [`key_label`] gives it for an axis.
pub fn parameter_label(parameter: &Parameter) -> String {
    match parameter {
        Parameter::Shared(key) if key == "epsilon" => "ε".to_owned(),
        Parameter::Setting(key) if key == "reward" => "sparsification".to_owned(),
        _ => parameter.last_part().replace('_', " "),
    }
}

/// The common traits of the runs of `selection`, in words: `ε = 0`, `MCPO or PPO, d = 10⁻³`, `not
/// PPO, d ≠ 10⁻³`.
pub fn selection_label(selection: &Selection) -> String {
    let part = |(key, values): &(Key, Vec<toml::Value>), not: &str, sign: &str| {
        let notation = Notation::of(values);
        let names: Vec<String> = values
            .iter()
            .map(|value| display_name(&notation.label(value)).to_owned())
            .collect();
        match key {
            Key::Algorithm | Key::Env => format!("{not}{}", names.join(" or ")),
            key => format!("{} {sign} {}", key_label(key), names.join(" or ")),
        }
    };
    let wanted = selection.wanted.iter().map(|one| part(one, "", "="));
    let unwanted = selection.unwanted.iter().map(|one| part(one, "not ", "≠"));
    wanted.chain(unwanted).collect::<Vec<_>>().join(", ")
}

/// The paper's name of the environment with Gym id `gym`: `Pendulum-v2` for `InvertedPendulum-v2`;
/// other text as it is.
pub fn paper_name(gym: &str) -> &str {
    gym.parse::<EnvId>().map_or(gym, |env| env.paper_name())
}

/// The paper's name of the environment without its version, as the paper's text has it.
pub fn paper_family(gym: &str) -> &str {
    let name = paper_name(gym);
    if gym.parse::<EnvId>().is_ok() {
        name.split_once("-v").map_or(name, |(family, _)| family)
    } else {
        name
    }
}

/// How the numbers of one axis are written: all in the same way, so that `0.1` does not stand
/// beside `10⁻³`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Notation {
    /// Plain digits: `0.1`, `15`.
    Digits,
    /// Powers of ten: `10⁻³`, `2·10⁻³`; `1` and `2.5`, which have no power.
    Powers,
}

impl Notation {
    /// The notation for `values`: digits where all of them are short that way.
    pub fn of<'a>(values: impl IntoIterator<Item = &'a toml::Value>) -> Self {
        let few = |number: f64| number == 0.0 || (0.01..1e5).contains(&number.abs());
        let all = values
            .into_iter()
            .all(|value| value.as_float().is_none_or(few));
        if all { Self::Digits } else { Self::Powers }
    }

    /// The label of `value`; numbers are in the shortest form that reads back.
    pub fn label(self, value: &toml::Value) -> String {
        match value {
            toml::Value::Float(number) => self.number(*number),
            toml::Value::Integer(number) => number.to_string().replace('-', "−"),
            toml::Value::String(text) => kind_name(text),
            // A table with one value beside its kind, such as `{ fixed = 1.0 }`.
            toml::Value::Table(table) if table.len() == 1 => {
                let (kind, value) = table.iter().next().expect("it has one");
                format!("{} {}", kind_name(kind), self.label(value))
            }
            // A table of several values, each with its name, such as `{ distance = 5.0, mode =
            // "milestone" }`.
            toml::Value::Table(table) => table
                .iter()
                .map(|(name, value)| format!("{name} {}", self.label(value)))
                .collect::<Vec<_>>()
                .join(", "),
            other => other.to_string(),
        }
    }

    fn number(self, number: f64) -> String {
        let scientific = format!("{number:e}");
        let (mantissa, exponent) = match (self, scientific.split_once('e')) {
            (Self::Powers, Some((mantissa, exponent))) if exponent != "0" => (mantissa, exponent),
            _ => return number.to_string().replace('-', "−"),
        };
        let power = format!("10{}", superscript(exponent));
        match mantissa {
            "1" => power,
            "-1" => format!("−{power}"),
            _ => format!("{}·{power}", mantissa.replace('-', "−")),
        }
    }
}

/// The paper's spelling of a kind of sparse reward; other kinds as they are.
fn kind_name(kind: &str) -> String {
    if kind.starts_with("sparse") {
        kind.to_uppercase()
    } else {
        kind.to_owned()
    }
}

/// The paper's spelling of an algorithm's name; any other name as it is.
pub fn display_name(name: &str) -> &str {
    Algorithm::label(name).unwrap_or(name)
}

/// `digits` (with an optional minus) raised.
pub fn superscript(digits: &str) -> String {
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        other => other,
    };
    digits.chars().map(raised).collect()
}

#[cfg(test)]
mod tests;
