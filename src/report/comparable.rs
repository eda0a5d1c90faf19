//! Which recorded runs may stand in one report: those of one specification, and of the file's.
//!
//! Owns that rule. Knows nothing of means or files. Start at [`changes`] and [`tell_apart`].
//!
//! A run that was recorded under another specification than the file's is left out, and the
//! difference is reported. The file alone does not decide three things. There, runs are compared
//! with each other, so that old results can be reported anywhere:
//!
//! - the **budget**: a run can be continued to a greater one, so a smaller campaign is reported
//!   before it is. Where some runs of an environment have the file's budget, those with another are
//!   left out; where all of them share one other budget, they are kept, with a remark;
//! - the **demonstration**'s content: of the runs that learned from one path, those are kept whose
//!   file had the most common content;
//! - the **versions** of what computes numbers: of an algorithm's runs in an environment, those are
//!   kept that the most common versions computed. The model of a user's robot is the file's to
//!   decide, as the robot's table is.

use std::collections::BTreeMap;

use super::recorded::{Recording, Run, State};
use crate::plan::{self, RunSpec};

/// The reported difference where a specification cannot be read.
pub const FORMAT: &str = "the specification's format";

const BUDGET: &str = "budget.env_steps";

/// The differences between a run as it was `recorded` and as it is `planned`, as `key: recorded ->
/// planned`. The budget does not count. Where it differs, the evaluations do not count either,
/// since their distance follows from it.
pub fn changes(recorded: &RunSpec, planned: &RunSpec) -> Vec<String> {
    let another_budget = recorded.budget != planned.budget;
    let counts = |change: &String| {
        let key = key(change);
        key != BUDGET && !(another_budget && key.starts_with("evaluation."))
    };
    let changes = plan::differences(recorded, planned)
        .into_iter()
        .filter(counts);
    changes
        .map(|change| {
            change
                .strip_prefix("algorithm.")
                .map(str::to_owned)
                .unwrap_or(change)
        })
        .collect()
}

/// The key that a change is of.
pub fn key(change: &str) -> &str {
    change.split(": ").next().unwrap_or(change)
}

/// Marks those of `runs` (one per planned run) that may not stand beside the others, and returns
/// remarks on those that may.
pub fn tell_apart(plan: &[RunSpec], runs: &mut [Run]) -> Vec<String> {
    let mut remarks = budgets(plan, runs);
    most_common(
        runs,
        |run, recording| {
            Some((
                format!("{} {:?}", run.spec.env, run.spec.demonstration),
                recording.demonstration.clone()?,
            ))
        },
        |recorded, common| {
            vec![format!(
                "demonstration: {} -> {}",
                digest(recorded),
                digest(common)
            )]
        },
    );
    most_common(
        runs,
        |run, recording| {
            Some((
                format!("{} {}", run.spec.env, run.spec.algorithm_name()),
                recording.versions.to_string(),
            ))
        },
        versions,
    );
    remarks.extend(under_way(runs));
    remarks
}

/// Drops the progress of each run under way that may not stand beside the first drawn run of its
/// environment and algorithm, which is a finished one if there is any.
fn under_way(runs: &mut [Run]) -> Option<String> {
    let of = |run: &Run| {
        let recording = run
            .recording()
            .or(run.under_way.as_ref().map(|so_far| &so_far.recording))?;
        Some((recording.demonstration.clone(), recording.versions.clone()))
    };
    let key = |run: &Run| {
        (
            run.spec.env.name(),
            run.spec.algorithm_name().to_owned(),
            run.spec.demonstration.clone(),
        )
    };
    let mut first: Vec<(_, _)> = Vec::new();
    let finished = runs.iter().filter(|run| run.recording().is_some());
    for run in finished.chain(runs.iter().filter(|run| run.under_way.is_some())) {
        if !first.iter().any(|(known, _)| *known == key(run)) {
            first.push((key(run), of(run)));
        }
    }
    let mut let_go = Vec::new();
    for run in runs.iter_mut().filter(|run| run.under_way.is_some()) {
        let known = first.iter().find(|(known, _)| *known == key(run));
        if known.is_some_and(|(_, first)| *first != of(run)) {
            run.under_way = None;
            let_go.push(run.spec.id.clone());
        }
    }
    let reason = "Under way with another demonstration or other versions than those beside them, \
        and not drawn";
    (!let_go.is_empty()).then(|| format!("{reason}: {}.", let_go.join(", ")))
}

/// The first digits of a digest.
fn digest(text: &str) -> String {
    text.chars().take(8).collect()
}

/// Leaves out the runs whose budget is not the file's, unless all runs of their environment share
/// one other budget.
fn budgets(plan: &[RunSpec], runs: &mut [Run]) -> Vec<String> {
    let mut pairs: BTreeMap<&str, Vec<(usize, u64, u64)>> = BTreeMap::new();
    for (index, (run, planned)) in runs.iter().zip(plan).enumerate() {
        if run.recording().is_some() {
            let (recorded, wanted) = (
                run.spec.budget.env_steps.get(),
                planned.budget.env_steps.get(),
            );
            pairs
                .entry(planned.env.name())
                .or_default()
                .push((index, recorded, wanted));
        }
    }
    let mut remarks = Vec::new();
    for (env, pairs) in pairs {
        let (_, recorded, wanted) = pairs[0];
        if pairs
            .iter()
            .all(|pair| (pair.1, pair.2) == (recorded, wanted))
        {
            if recorded != wanted {
                remarks.push(format!(
                    "All runs in {env} were recorded with another `{BUDGET}`: \
                     {recorded} -> {wanted}."
                ));
            }
            continue;
        }
        for (index, recorded, wanted) in pairs.into_iter().filter(|pair| pair.1 != pair.2) {
            let changes = vec![format!("{BUDGET}: {recorded} -> {wanted}")];
            let trace = runs[index].trace.take();
            runs[index] = Run::new(plan[index].clone(), State::Differs { changes });
            runs[index].trace = trace;
        }
    }
    remarks
}

/// Leaves out, in each group, the finished runs whose trait is not the most common one (the first
/// run's where two are equally common). `group_and_trait` returns a run's group and trait,
/// `changes` the differences between two traits.
fn most_common(
    runs: &mut [Run],
    group_and_trait: impl Fn(&Run, &Recording) -> Option<(String, String)>,
    changes: impl Fn(&str, &str) -> Vec<String>,
) {
    let found: Vec<Option<(String, String)>> = runs
        .iter()
        .map(|run| group_and_trait(run, run.recording()?))
        .collect();
    let mut counts: BTreeMap<&str, Vec<(&str, usize)>> = BTreeMap::new();
    for (group, own) in found.iter().flatten() {
        let traits = counts.entry(group).or_default();
        match traits.iter_mut().find(|(known, _)| known == own) {
            Some((_, count)) => *count += 1,
            None => traits.push((own, 1)),
        }
    }
    for (run, found) in runs.iter_mut().zip(&found) {
        let Some((group, own)) = found else { continue };
        let most = counts[group.as_str()]
            .iter()
            .rev()
            .max_by_key(|(_, count)| *count);
        if let Some((common, _)) = most.filter(|(common, _)| common != own) {
            run.state = State::Differs {
                changes: changes(own, common),
            };
        }
    }
}

/// The differences between two sets of versions, which are given as JSON.
fn versions(recorded: &str, common: &str) -> Vec<String> {
    let read = |text: &str| -> BTreeMap<String, String> {
        let versions = serde_json::from_str(text).unwrap_or_default();
        plan::leaves("versions".to_owned(), &versions)
            .map(|(key, leaf)| (key, leaf.to_string()))
            .collect()
    };
    plan::changes(&read(recorded), &read(common))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::report::{fixture, recorded::load};

    fn run(seed: u64) -> Run {
        fixture::ppo("Hopper-v2", seed).finished(&[(100, &[1.0])])
    }

    /// What is left out of `recorded`, by its place, where the file says `planned`; and the
    /// remarks.
    fn left_out(recorded: &[Run], planned: &[Run]) -> (Vec<(usize, Vec<String>)>, Vec<String>) {
        let folder = tempfile::tempdir().expect("a folder");
        recorded
            .iter()
            .for_each(|run| fixture::record(run, folder.path()));
        let plan: Vec<RunSpec> = planned.iter().map(|run| run.spec.clone()).collect();
        let loaded = load(&plan, folder.path(), &[]).expect("good ids");
        let differing = loaded
            .runs
            .into_iter()
            .enumerate()
            .filter_map(|(index, run)| match run.state {
                State::Differs { changes } => Some((index, changes)),
                State::Finished(_) => None,
                other => panic!("run {index}: {other:?}"),
            });
        (differing.collect(), loaded.remarks)
    }

    #[test]
    fn what_the_file_no_longer_says_is_left_out_with_the_key_old_and_new() {
        let mut edited = [run(0), run(1)];
        for run in &mut edited {
            let axes = format!(
                "env = [\"Hopper-v2\"]\nseed = [{}]\n\"ppo.clip\" = [0.9]",
                run.spec.seed.0
            );
            let (id, axes) = (run.spec.id.clone(), fixture::run("ppo", &axes));
            *run = Run::new(RunSpec { id, ..axes.spec }, State::Missing);
        }
        let (out, remarks) = left_out(&[run(0), run(1)], &edited);
        let change = vec!["ppo.clip: 0.2 -> 0.9".to_owned()];
        assert_eq!(
            (out, remarks),
            (vec![(0, change.clone()), (1, change)], vec![])
        );
    }

    #[test]
    fn another_budget_is_left_out_unless_all_have_it() {
        let (out, remarks) = left_out(&[run(0), run(1).budget(50)], &[run(0), run(1)]);
        assert_eq!(
            (out, remarks),
            (
                vec![(1, vec!["budget.env_steps: 50 -> 100".to_owned()])],
                vec![]
            )
        );
        let (out, remarks) = left_out(&[run(0).budget(50), run(1).budget(50)], &[run(0), run(1)]);
        let all = "All runs in Hopper-v2 were recorded with another `budget.env_steps`: 50 -> 100.";
        assert_eq!((out, remarks), (vec![], vec![all.to_owned()]));
        let (out, _) = left_out(&[run(0).budget(50), run(1).budget(70)], &[run(0), run(1)]);
        assert_eq!(
            out.len(),
            2,
            "neither is the file's, and they are not alike"
        );
        let mut coarse = run(0).budget(50);
        coarse.spec.evaluation.every = crate::quantity::constant(7);
        assert!(
            left_out(&[coarse], &[run(0)]).0.is_empty(),
            "the distance of evaluations follows the budget"
        );
        let ant = || fixture::ppo("Ant-v2", 0).finished(&[(100, &[1.0])]);
        let (out, remarks) = left_out(&[run(0), ant().budget(50)], &[run(0), ant()]);
        assert!(
            out.is_empty() && remarks.len() == 1,
            "one environment, one budget: {out:?}"
        );
    }

    #[test]
    fn another_demonstration_or_another_program_is_left_out() {
        let learned = |seed, digest| {
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, seed)
                .finished(&[(100, &[1.0])])
                .demonstrated(Some(digest), None)
        };
        let runs = [
            learned(0, "0123456789ab"),
            learned(1, "fedcba987654"),
            learned(2, "fedcba987654"),
            run(0),
        ];
        let (out, _) = left_out(&runs, &runs);
        assert_eq!(
            out,
            [(0, vec!["demonstration: 01234567 -> fedcba98".to_owned()])]
        );

        let by = |run: Run, revision| {
            run.by(json!({ "revisions": { "ppo": revision }, "mujoco": "3.17.0" }))
        };
        let runs = [by(run(0), 4), by(run(1), 5), by(run(2), 5)];
        let (out, _) = left_out(&runs, &runs);
        assert_eq!(
            out,
            [(0, vec!["versions.revisions.ppo: 4 -> 5".to_owned()])]
        );
        let other = by(
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(100, &[1.0])]),
            9,
        );
        let runs = [by(run(0), 4), other, by(run(1), 4)];
        assert_eq!(
            left_out(&runs, &runs).0,
            [],
            "another algorithm has revisions of its own"
        );
    }
}
