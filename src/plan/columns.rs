//! The axes of an experiment as columns of its tables.
//!
//! Every run of an experiment has the same columns, of the types of their keys, whether its block varies them or not; so that
//! all tables of an experiment can be scanned as one. Start at [`RunSpec::axis_columns`].

use std::collections::BTreeMap;

use toml::Value;

use super::{ALWAYS, RunSpec, id::short};
use crate::spec::{ExperimentSpec, Kind, Parameter};

/// A run's value of an axis, of the type of its column; `None` where the run has no such thing.
#[derive(Debug, Clone, PartialEq)]
pub enum AxisValue {
    /// Of a column of numbers.
    Number(Option<f64>),
    /// Of a column of whole numbers.
    Whole(Option<i64>),
    /// Of a column of truth values.
    Truth(Option<bool>),
    /// Of a column of words: choices and lists as in the names of runs.
    Text(Option<String>),
}

/// The axes of `spec`, in order, each once. Those that every table has as columns of their own are not among them, unless they
/// have values that these cannot hold: a tolerance that is a share.
pub(super) fn keys(spec: &ExperimentSpec) -> Vec<String> {
    let mut keys: Vec<String> = Vec::new();
    for (key, values) in spec.matrix.iter().flat_map(|block| &block.axes) {
        let is_told = ALWAYS.contains(&key.as_str()) && !values.iter().any(Value::is_table);
        if !keys.contains(key) && !is_told {
            keys.push(key.clone());
        }
    }
    keys.sort_unstable();
    keys
}

impl RunSpec {
    /// The axes of its whole experiment, `d` and `epsilon` apart where they are numbers, with this run's values.
    pub fn axis_columns(&self) -> BTreeMap<String, AxisValue> {
        self.columns.iter().filter_map(|key| Some((key.clone(), self.axis_value(key)?))).collect()
    }

    fn axis_value(&self, key: &str) -> Option<AxisValue> {
        // An axis of demonstrations is told by what tells its files apart.
        let value = self.axes.get(key).cloned().or_else(|| self.value(key));
        Some(match Parameter::find(key)?.kind() {
            Kind::Number => AxisValue::Number(value.and_then(|value| match value {
                Value::Integer(number) => Some(number as f64),
                other => other.as_float(),
            })),
            Kind::Whole => AxisValue::Whole(value.and_then(|value| value.as_integer())),
            Kind::Truth => AxisValue::Truth(value.and_then(|value| value.as_bool())),
            Kind::Text => AxisValue::Text(value.map(|value| short(&value))),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{super::tests::planned, *};

    #[test]
    fn every_run_has_the_columns_of_its_whole_experiment() {
        let runs = planned(
            "[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['mcpo', 'ppo']\nd = [0.5]\n'mcpo.max_kl' = [0.01]\n\
             'rollout.steps' = [2048]\n\
             [[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['ppo']\n'ppo.normalize_advantages' = [false]\n\
             reward = ['dense']\n",
        );
        let columns: Vec<_> = runs.iter().map(RunSpec::axis_columns).collect();
        let text = |text: &str| AxisValue::Text(Some(text.to_owned()));
        let expected = |max_kl, steps, normalize, reward: &str| {
            BTreeMap::from([
                ("mcpo.max_kl".to_owned(), AxisValue::Number(max_kl)),
                ("ppo.normalize_advantages".to_owned(), AxisValue::Truth(normalize)),
                ("reward".to_owned(), text(reward)),
                ("rollout.steps".to_owned(), AxisValue::Whole(Some(steps))),
            ])
        };
        let sparse = short(&runs[0].value("reward").expect("every run has one"));
        assert_eq!(columns[0], expected(Some(0.01), 2048, None, &sparse));
        assert_eq!(columns[1], expected(None, 2048, Some(true), &sparse));
        assert_eq!(columns[2], expected(None, 4096, Some(false), "dense"), "what its block does not vary is told too");
    }

    #[test]
    fn a_tolerance_that_is_a_share_is_told() {
        let runs = planned(
            "[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['mcpo']\nd = [0.5, { relative = 0.01 }]\nepsilon = [0]\n",
        );
        let told: Vec<_> = runs.iter().map(|run| run.axis_columns()["d"].clone()).collect();
        assert_eq!(told, ["0.5", "relative-0.01"].map(|text| AxisValue::Text(Some(text.to_owned()))));
        assert_eq!((runs[0].d(), runs[1].d(), runs[0].axis_columns().len()), (Some(0.5), None, 1));
    }
}
