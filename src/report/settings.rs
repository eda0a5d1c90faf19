//! Tables of settings, from the resolved specifications.
//!
//! Owns which values are shared and which differ by algorithm or environment. Knows nothing of
//! returns. Start at [`SettingsData::new`].

use std::collections::BTreeSet;

use super::{axis, recorded::Run};
use crate::{
    env::EnvId,
    spec::{Key, SettingsTable, Shown},
};

/// One table of settings.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingsData {
    /// The title above the table.
    pub title: String,
    /// The headers of the columns.
    pub headers: Vec<String>,
    /// The rows, each with one cell per header.
    pub rows: Vec<Vec<String>>,
    /// The number of leading columns that name a row.
    pub names: usize,
    /// Notes for the reader, a sentence each.
    pub notes: Vec<String>,
}

impl SettingsData {
    /// Builds `table` for `runs`, which are those that its `only` selects. With rows, there is one
    /// column per parameter. Without, there is one row per parameter: a single one where all
    /// algorithms that have it agree, and otherwise one per algorithm.
    pub fn new(table: &SettingsTable, runs: &[&Run]) -> Self {
        let (names, headers, rows) = if table.rows.is_empty() {
            let headers = ["method", "parameter", "value"].map(str::to_owned).to_vec();
            (
                2,
                headers,
                table
                    .show
                    .iter()
                    .flat_map(|shown| by_algorithm(shown, runs))
                    .collect(),
            )
        } else {
            // Runs of one row may still differ in what is shown; `said` then tells each value.
            let groups = axis::group(runs, &table.rows);
            let labels = axis::value_labels(&groups);
            let row = |(group, labels): (&axis::Group<'_>, Vec<Option<String>>)| {
                let names = labels.into_iter().map(|label| {
                    let label = label.unwrap_or_default();
                    axis::display_name(&label).to_owned()
                });
                names
                    .chain(table.show.iter().map(|shown| said(shown, &group.runs)))
                    .collect()
            };
            let keys = table
                .rows
                .iter()
                .map(axis::key_label)
                .chain(table.show.iter().map(label));
            (
                table.rows.len(),
                keys.collect(),
                groups.iter().zip(labels).map(row).collect(),
            )
        };
        let title = table.title.clone();
        Self {
            title,
            headers,
            rows,
            names,
            notes: vec!["From the specifications of the runs, as resolved.".to_owned()],
        }
    }
}

/// The label of a parameter for a reader.
fn label(shown: &Shown) -> String {
    match shown {
        Shown::Parameter(parameter) => axis::parameter_label(parameter),
        Shown::Observations | Shown::Actions | Shown::Trajectories => shown.to_string(),
    }
}

/// The rows of one parameter, by method.
fn by_algorithm(shown: &Shown, runs: &[&Run]) -> Vec<Vec<String>> {
    let groups = axis::group(runs, &[Key::Algorithm]);
    let told = groups.iter().filter_map(|group| {
        let text = said(shown, &group.runs);
        (!text.is_empty()).then(|| {
            (
                axis::display_name(group.runs[0].spec.algorithm_name()).to_owned(),
                text,
            )
        })
    });
    let told: Vec<(String, String)> = told.collect();
    let row = |method: &str, value: &str| vec![method.to_owned(), label(shown), value.to_owned()];
    match told.as_slice() {
        [(_, first), others @ ..]
            if !others.is_empty() && others.iter().all(|(_, text)| text == first) =>
        {
            vec![row("shared", first)]
        }
        _ => told
            .iter()
            .map(|(method, text)| row(method, text))
            .collect(),
    }
}

/// The value of `shown` in `runs`: the one that most environments have, followed by the others in
/// brackets; empty where no run has one.
fn said(shown: &Shown, runs: &[&Run]) -> String {
    let mut by_value: Vec<(String, BTreeSet<EnvId>)> = Vec::new();
    let values: Vec<(EnvId, toml::Value)> = runs
        .iter()
        .filter_map(|run| Some((run.spec.env, value(shown, run)?)))
        .collect();
    let notation = axis::Notation::of(values.iter().map(|(_, value)| value));
    for (env, value) in &values {
        let text = notation.label(value);
        match by_value.iter_mut().find(|(known, _)| *known == text) {
            Some((_, envs)) => {
                envs.insert(*env);
            }
            None => by_value.push((text, [*env].into())),
        }
    }
    // The sort is stable: of equals the first stays first.
    by_value.sort_by_key(|(_, envs)| std::cmp::Reverse(envs.len()));
    let mut values = by_value.iter();
    let Some((most, _)) = values.next() else {
        return String::new();
    };
    let others: Vec<String> = values
        .map(|(text, envs)| {
            let envs: Vec<&str> = envs.iter().map(|env| env.name()).collect();
            format!("{text} in {}", envs.join(", "))
        })
        .collect();
    if others.is_empty() {
        most.clone()
    } else {
        format!("{most} ({})", others.join("; "))
    }
}

/// The value of a parameter, or of a property of the environment or the recorded demonstration.
fn value(shown: &Shown, run: &Run) -> Option<toml::Value> {
    let count = |count: usize| toml::Value::Integer(count as i64);
    match shown {
        Shown::Observations => Some(count(run.spec.env.spaces()?.observation_dim)),
        Shown::Actions => Some(count(run.spec.env.spaces()?.action_dim)),
        Shown::Trajectories => Some(count(run.recording()?.demonstrated.as_ref()?.episodes)),
        Shown::Parameter(parameter) => run.value(&Key::Parameter(parameter.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    fn data(rows: &[&str], show: &[&str], runs: &[Run]) -> SettingsData {
        let rows = rows.iter().map(|row| Key::from(*row)).collect();
        let show = show.iter().map(|shown| Shown::from(*shown)).collect();
        let table = SettingsTable {
            name: "t".into(),
            title: "T".into(),
            rows,
            show,
            only: None,
        };
        SettingsData::new(&table, &runs.iter().collect::<Vec<_>>())
    }

    /// Table 2's row of HalfCheetah and of Walker2d, as the paper prints them.
    #[test]
    fn table_2_is_a_row_an_environment() {
        let run = |env: &str| fixture::run("mcpo", &format!("env = [\"{env}\"]\nseed = [0]"));
        let runs = [run("HalfCheetah-v2"), run("Walker2d-v2")];
        let data = data(
            &["env"],
            &["observations", "actions", "max_steps", "d", "epsilon"],
            &runs,
        );
        assert_eq!(
            data.headers,
            [
                "environment",
                "observations",
                "actions",
                "max steps",
                "d",
                "ε"
            ]
        );
        assert_eq!(
            data.rows[0],
            ["HalfCheetah-v2", "17", "6", "1000", "10⁻³", "10⁻³"]
        );
        assert_eq!(
            data.rows[1],
            ["Walker2d-v2", "17", "6", "1000", "0.01", "10⁻³"]
        );
    }

    /// Table 1, from the same: what all have once, POfD's weight with its exceptions.
    #[test]
    fn table_1_is_a_row_a_parameter() {
        let run = |algorithm, env: &str| {
            fixture::run(algorithm, &format!("env = [\"{env}\"]\nseed = [0]"))
        };
        let envs = ["Hopper-v2", "Ant-v2", "HalfCheetah-v2"];
        let runs: Vec<Run> = envs
            .iter()
            .flat_map(|env| ["pofd", "ppo", "mcpo"].map(|name| run(name, env)))
            .collect();
        let data = data(
            &[],
            &["network.hidden", "ppo.clip", "mcpo.max_kl", "pofd.weight"],
            &runs,
        );
        assert_eq!(data.rows[0], ["shared", "hidden", "[300, 400]"]);
        assert!(
            data.rows
                .iter()
                .any(|row| row[0] == "PPO" && row[1] == "clip" && row[2] == "0.2"),
            "{:?}",
            data.rows
        );
        assert!(
            data.rows
                .iter()
                .any(|row| row[0] == "MCPO" && row[2] == "5·10⁻³"),
            "{:?}",
            data.rows
        );
    }
}
