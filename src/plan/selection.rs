//! Matches runs with selections.

use std::{collections::BTreeSet, path::Path};

use toml::Value;

use super::{
    DEMONSTRATIONS, RunSpec, Selection, Values,
    id::{among, short},
};
use crate::spec::{Key, Parameter};

impl Selection {
    /// Whether this selection includes `run`. Numbers are compared as numbers: `1e-3` is 0.001.
    pub fn matches(&self, run: &RunSpec) -> bool {
        self.matches_values(&run.values())
    }

    /// As [`matches`](Self::matches), for a run whose values are known.
    pub fn matches_values(&self, run: &Values) -> bool {
        let listed = |(key, values): &(Key, Vec<Value>)| {
            run.get(key)
                .is_some_and(|value| values.iter().any(|listed| same(key, &value, listed)))
        };
        self.wanted.iter().all(listed) && !self.unwanted.iter().any(listed)
    }
}

fn same(key: &Key, value: &Value, wanted: &Value) -> bool {
    equal(value, wanted)
        || wanted
            .as_str()
            .is_some_and(|wanted| called(key, value, wanted))
}

/// Whether both are the same value; 1 and 1.0 are, alone or inside a list or table.
fn equal(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| equal(one, other))
        }
        (Value::Table(one), Value::Table(other)) => {
            let has = |(key, one): (&String, &Value)| {
                other.get(key).is_some_and(|other| equal(one, other))
            };
            one.len() == other.len() && one.iter().all(has)
        }
        _ => match (number(one), number(other)) {
            (Some(one), Some(other)) => one == other,
            _ => one == other,
        },
    }
}

/// Whether the names of runs write `value` as `wanted`.
fn called(key: &Key, value: &Value, wanted: &str) -> bool {
    match value {
        Value::String(path) if is_of_files(key) => {
            let whole = Path::new(path).with_extension("");
            whole.ends_with(wanted) || among(Path::new(path), &BTreeSet::new()) == wanted
        }
        _ => short(value) == wanted,
    }
}

/// Whether the values of `key` are files.
fn is_of_files(key: &Key) -> bool {
    matches!(key, Key::Parameter(Parameter::Setting(key)) if key == DEMONSTRATIONS)
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|integer| integer as f64))
}

#[cfg(test)]
mod tests {
    use super::{super::tests::planned, *};

    #[test]
    fn what_cannot_be_meant_names_the_nearest() {
        for (text, message) in [
            (
                "env=Hoper-v2",
                "unknown env `Hoper-v2` in a selection; the nearest known one is `Hopper-v2`",
            ),
            (
                "algorithm=mcp",
                "unknown algorithm `mcp` in a selection; the nearest known one is `mcpo`",
            ),
            (
                "epsilom=0",
                "unknown key `epsilom` in a selection; the nearest known one is `epsilon`",
            ),
            (
                "epsilom!=0",
                "unknown key `epsilom` in a selection; the nearest known one is `epsilon`",
            ),
            ("mcpo", "`mcpo` is not of the form KEY=VALUE or KEY!=VALUE"),
            ("", "`` is not of the form KEY=VALUE or KEY!=VALUE"),
        ] {
            assert_eq!(Selection::parse(text).expect_err(text).to_string(), message);
        }
    }

    #[test]
    fn runs_are_selected_by_any_of_their_values() {
        let runs = planned(
            "[[matrix]]\nseed = [0, 1]\nenv = ['Hopper-v2', 'InvertedPendulum-v2']\n\
             algorithm = ['mcpo', 'ppo']\n\
             d = [1e-3, 1e-2]\n",
        );
        for (text, count) in [
            ("env=Hopper-v2", 6),
            ("env=Pendulum-v2", 6),
            ("env=Hopper-v2,env=InvertedPendulum-v2", 12),
            ("d=0.001", 4),
            ("d=1e-3, algorithm=mcpo", 4),
            ("d=1e-3,algorithm=ppo", 0),
            ("d!=1e-3", 8),
            ("d!=1e-3,d!=1e-2", 4),
            ("d != 1e-3, algorithm = mcpo", 4),
            ("seed!=0,d=1e-3", 2),
            ("mcpo.d=0.01,seed=1", 2),
            ("seed=1", 6),
            ("seed=2", 0),
            ("mmd.samples=demo_states", 8),
            ("mmd.samples=rollout", 0),
            ("ppo.normalize_advantages=true", 4),
            ("budget.env_steps=100_000", 12),
            ("budget.env_steps=1e5", 12),
            ("network.hidden=300x400", 12),
            ("network.hidden=[300, 400]", 12),
            ("network.hidden=[300,400],seed=1", 6),
            ("mmd.bandwidth={fixed=1}", 8),
            ("mmd.bandwidth={ fixed = 2.0 }", 0),
            ("reward=sparse2-1-milestone", 6),
        ] {
            let selection = Selection::parse(text).expect(text);
            assert_eq!(
                runs.iter().filter(|run| selection.matches(run)).count(),
                count,
                "{text}"
            );
        }
    }
}
