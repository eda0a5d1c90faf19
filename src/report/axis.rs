//! The axes of a matrix as a reader sees them: which runs belong together, and what to call them.
//!
//! Owns the grouping of runs by the values of axes, and the labels of those values. Knows nothing of what the runs
//! measured. Start at [`group`].

use super::recorded::Run;

/// Runs that agree on all keys of a grouping; they differ in their seeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Group<'a> {
    /// The value of each key; `None` where the runs do not have that axis.
    pub values: Vec<Option<toml::Value>>,
    /// The runs, in the plan's order.
    pub runs: Vec<&'a Run>,
}

/// Groups `runs` by the values of `keys`, in the order in which the groups first appear.
pub fn group<'a>(runs: &[&'a Run], keys: &[String]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for &run in runs {
        let values: Vec<_> = keys.iter().map(|key| run.spec.value(key)).collect();
        match groups.iter_mut().find(|group| group.values == values) {
            Some(group) => group.runs.push(run),
            None => groups.push(Group { values, runs: vec![run] }),
        }
    }
    groups
}

/// The axes, other than the seed and `keys`, in which runs differ that agree on `keys`.
///
/// Runs that differ in more than their seed are never averaged: these axes have to become keys too. The algorithm is one
/// wherever there are several, since the others alone would not name a group that does not have them.
pub fn hidden_axes(runs: &[&Run], keys: &[String]) -> Vec<String> {
    let mut candidates: Vec<String> = vec!["env".into(), "algorithm".into()];
    candidates.extend(runs.iter().flat_map(|run| run.spec.axes.keys().cloned()));
    candidates.retain(|key| key != "seed" && !keys.contains(key));
    let mut hidden: Vec<String> = Vec::new();
    for candidate in candidates {
        let known: Vec<String> = match candidate.as_str() {
            "algorithm" => Vec::new(),
            _ => keys.iter().chain(&hidden).cloned().collect(),
        };
        let varies = group(runs, &known).iter().any(|group| {
            let first = group.runs[0].spec.value(&candidate);
            group.runs.iter().any(|run| run.spec.value(&candidate) != first)
        });
        if varies {
            hidden.push(candidate);
        }
    }
    hidden
}

/// One label a group, from those keys whose value tells the groups apart (`MCPO`, `d = 10⁻³, ε = 0`).
pub fn labels(keys: &[String], groups: &[Group<'_>]) -> Vec<String> {
    let tells_apart = |index: usize| groups.iter().any(|group| group.values[index] != groups[0].values[index]);
    let mut shown: Vec<usize> = (0..keys.len()).filter(|&index| tells_apart(index)).collect();
    if shown.is_empty() {
        shown = (0..keys.len().min(1)).collect();
    }
    let label = |group: &Group<'_>| {
        let parts = shown.iter().filter_map(|&index| {
            let text = value_label(group.values[index].as_ref()?);
            Some(match keys[index].as_str() {
                "algorithm" | "env" => display_name(&text).to_owned(),
                key => format!("{} = {text}", key_label(key)),
            })
        });
        parts.collect::<Vec<_>>().join(", ")
    };
    groups.iter().map(label).collect()
}

/// What to call axis `key`: the paper's symbol, or the last part of its path in words.
pub fn key_label(key: &str) -> String {
    match key {
        "epsilon" => "ε".to_owned(),
        "env" => "environment".to_owned(),
        _ => key.rsplit('.').next().unwrap_or(key).replace('_', " "),
    }
}

/// What to call a value: powers of ten as such, other numbers in the shortest form that reads back.
pub fn value_label(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(number) => number_label(*number),
        toml::Value::Integer(number) => number.to_string(),
        toml::Value::String(text) => text.clone(),
        // What has one value beside its kind, such as `{ fixed = 1.0 }`.
        toml::Value::Table(table) if table.len() == 1 => {
            let (kind, value) = table.iter().next().expect("it has one");
            format!("{kind} {}", value_label(value))
        }
        other => other.to_string(),
    }
}

/// The paper's spelling of an algorithm's name; the name itself where the paper has none.
pub fn display_name(name: &str) -> &str {
    match name {
        "pretraining" => "Pre-training",
        "pofd" => "POfD",
        "mcpo" => "MCPO",
        "expert" => "Expert",
        "random" => "Random",
        "ppo" => "PPO",
        "mmd_il" => "MMD-IL",
        "trpo" => "TRPO",
        "gail" => "GAIL",
        "bc" => "BC",
        "penalty" => "Penalty",
        other => other,
    }
}

/// `0.1`, `15`, `10⁻³`, `2·10⁻³`: digits where they are few, else a power of ten.
pub fn number_label(number: f64) -> String {
    if number == 0.0 || (0.01..1e5).contains(&number.abs()) {
        return number.to_string().replace('-', "−");
    }
    let scientific = format!("{number:e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let power = format!("10{}", superscript(exponent));
    match mantissa {
        "1" => power,
        "-1" => format!("−{power}"),
        _ => format!("{}·{power}", mantissa.replace('-', "−")),
    }
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
mod tests {
    use super::*;
    use crate::report::fixture;

    #[test]
    fn a_value_beside_its_kind_reads_as_words() {
        let value: toml::Table = toml::from_str("bandwidth = { fixed = 1.0 }").expect("TOML");
        assert_eq!(value_label(&value["bandwidth"]), "fixed 1");
    }

    #[test]
    fn runs_that_differ_in_more_than_the_seed_are_told_apart() {
        let runs = [
            fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0),
            fixture::mcpo("HalfCheetah-v2", 1e-3, 0.0, 0),
            fixture::ppo("HalfCheetah-v2", 0),
        ];
        let runs: Vec<&Run> = runs.iter().collect();
        assert_eq!(hidden_axes(&runs, &["env".into()]), ["algorithm", "d"]);
        assert_eq!(hidden_axes(&runs, &["env".into(), "algorithm".into(), "d".into()]), [""; 0]);
    }

    #[test]
    fn an_axis_bound_to_the_environment_is_not_hidden_within_one() {
        let runs = [fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0), fixture::mcpo("Ant-v2", 1e-5, 1e-3, 0)];
        let runs: Vec<&Run> = runs.iter().collect();
        assert_eq!(hidden_axes(&runs, &["env".into()]), [""; 0]);
    }

    #[test]
    fn groups_keep_the_order_of_the_plan_and_collect_seeds() {
        let runs = [
            fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0),
            fixture::mcpo("HalfCheetah-v2", 1e-6, 0.0, 0),
            fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 1),
        ];
        let runs: Vec<&Run> = runs.iter().collect();
        let keys = ["d".to_owned(), "epsilon".to_owned()];
        let groups = group(&runs, &keys);
        assert_eq!(groups.iter().map(|group| group.runs.len()).collect::<Vec<_>>(), [2, 1]);
        assert_eq!(labels(&keys, &groups), ["d = 1", "d = 10⁻⁶"]);
    }

    #[test]
    fn labels_leave_out_an_axis_that_a_run_does_not_have() {
        let runs = [fixture::mcpo("Ant-v2", 1e-5, 1e-3, 0), fixture::ppo("Ant-v2", 0)];
        let runs: Vec<&Run> = runs.iter().collect();
        let keys = ["algorithm".to_owned(), "epsilon".to_owned()];
        assert_eq!(labels(&keys, &group(&runs, &keys)), ["MCPO, ε = 10⁻³", "PPO"]);
        let only_env = ["env".to_owned()];
        assert_eq!(labels(&only_env, &group(&runs, &only_env)), ["Ant-v2"]);
    }

    #[test]
    fn numbers_are_short_and_exact() {
        let text: Vec<_> = [0.0, 1.0, 0.1, 1e-3, 2e-3, -1e-6, 15.0, 1e6, 0.05].map(number_label).into();
        assert_eq!(text, ["0", "1", "0.1", "10⁻³", "2·10⁻³", "−10⁻⁶", "15", "10⁶", "0.05"]);
    }
}
