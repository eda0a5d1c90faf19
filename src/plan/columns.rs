//! The axes of an experiment as columns of its tables.
//!
//! Every run of an experiment has the same columns, of the types of their keys, whether its block
//! varies them or not; so that all tables of an experiment can be scanned as one. Start at
//! [`RunSpec::axis_columns`].

use std::collections::BTreeMap;

use toml::Value;

use super::{ALWAYS, RunSpec, id::short};
use crate::spec::{Axis, ExperimentSpec, Kind, Parameter};

/// A run's value of an axis, of the type of its column; `None` if the run has no such key.
#[derive(Debug, Clone, PartialEq)]
pub enum AxisValue {
    /// A value in a column of numbers.
    Number(Option<f64>),
    /// A value in a column of whole numbers.
    Whole(Option<i64>),
    /// A value in a column of truth values.
    Truth(Option<bool>),
    /// A value in a column of words: choices and lists, as in the names of runs.
    Text(Option<String>),
}

/// The axes of `spec`, in order, each once, without those that every table has as columns of their
/// own.
/// Where a number may also be given in another form, as a tolerance may be a share, that form has a
/// column beside the number's: `d.relative`.
pub(super) fn keys(spec: &ExperimentSpec) -> Vec<String> {
    let mut keys: Vec<String> = Vec::new();
    for Axis { parameter, values } in spec.matrix.iter().flat_map(|block| &block.axes) {
        let (key, is_text) = (parameter.to_string(), parameter.kind() == Kind::Text);
        let forms = values
            .iter()
            .filter(|_| !is_text)
            .filter_map(Value::as_table)
            .flat_map(toml::Table::keys);
        let own = Some(key.clone()).filter(|key| !ALWAYS.contains(&key.as_str()));
        for key in own
            .into_iter()
            .chain(forms.map(|form| format!("{key}.{form}")))
        {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
    }
    keys.sort_unstable();
    keys
}

impl RunSpec {
    /// This run's values of the axes of the whole experiment, without `d` and `epsilon`.
    pub fn axis_columns(&self) -> BTreeMap<String, AxisValue> {
        self.columns
            .iter()
            .filter_map(|key| Some((key.clone(), self.axis_value(key)?)))
            .collect()
    }

    fn axis_value(&self, key: &str) -> Option<AxisValue> {
        // An axis of demonstrations shows the part of their names that tells the files apart.
        let value = self.axes.get(key).cloned().or_else(|| self.value(key));
        let Some(parameter) = Parameter::find(key) else {
            let (outer, form) = key.rsplit_once('.')?;
            return Some(AxisValue::Number(
                self.value(outer).and_then(|value| number(value.get(form)?)),
            ));
        };
        Some(match parameter.kind() {
            Kind::Number => AxisValue::Number(value.as_ref().and_then(number)),
            Kind::Whole => AxisValue::Whole(value.and_then(|value| value.as_integer())),
            Kind::Truth => AxisValue::Truth(value.and_then(|value| value.as_bool())),
            Kind::Text => AxisValue::Text(value.map(|value| short(&value))),
        })
    }
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|number| number as f64))
}

#[cfg(test)]
mod tests {
    use super::{super::tests::planned, *};

    #[test]
    fn every_run_has_the_columns_of_its_whole_experiment() {
        let runs = planned(
            "[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['mcpo', 'ppo']\nd = [0.5]\n\
             'mcpo.max_kl' = [0.01]\n\
             'rollout.steps' = [2048]\n\
             [[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['ppo']\n\
             'ppo.normalize_advantages' = [false]\n\
             reward = ['dense']\n",
        );
        let columns: Vec<_> = runs.iter().map(RunSpec::axis_columns).collect();
        let text = |text: &str| AxisValue::Text(Some(text.to_owned()));
        let expected = |max_kl, steps, normalize, reward: &str| {
            BTreeMap::from([
                ("mcpo.max_kl".to_owned(), AxisValue::Number(max_kl)),
                (
                    "ppo.normalize_advantages".to_owned(),
                    AxisValue::Truth(normalize),
                ),
                ("reward".to_owned(), text(reward)),
                ("rollout.steps".to_owned(), AxisValue::Whole(Some(steps))),
            ])
        };
        let sparse = short(&runs[0].value("reward").expect("every run has one"));
        assert_eq!(columns[0], expected(Some(0.01), 2048, None, &sparse));
        assert_eq!(columns[1], expected(None, 2048, Some(true), &sparse));
        assert_eq!(
            columns[2],
            expected(None, 4096, Some(false), "dense"),
            "what its block does not vary is told too"
        );
    }

    #[test]
    fn a_tolerance_that_is_a_share_is_told() {
        let runs = planned(
            "[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['mcpo']\n\
             d = [0.5, { relative = 0.01 }]\nepsilon = [0]\n",
        );
        let told: Vec<_> = runs
            .iter()
            .map(|run| (run.d(), run.axis_columns()))
            .collect();
        let share = |share| BTreeMap::from([("d.relative".to_owned(), AxisValue::Number(share))]);
        assert_eq!(told, [(Some(0.5), share(None)), (None, share(Some(0.01)))]);
    }
}
