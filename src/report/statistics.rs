//! One number for many environments: for each method, the summaries that Agarwal et al. (2021)
//! recommend.
//!
//! Owns how returns become scores, and which runs are a method's. The summaries themselves are
//! [`stats`](crate::stats)'. Start at
//! [`StatisticsData::new`].
//!
//! A score is a return where the paper's Random has 0 and its Expert 1, environment by environment.
//! A run that failed has score 0. Only environments in which every method has a finished run count,
//! so that all methods are summed up over the same. Each summary has a stratified bootstrap
//! interval, which is too narrow for few seeds; a note says by how much.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    axis::{self, Label},
    claims::measure,
    curve::{Across, Curve, CurveData, Panel, Point, mean},
    identity::Identities,
    over_seeds::seed_values,
    recorded::{Run, State},
    reference,
};
use crate::{
    env::EnvId,
    measured::Measure,
    rng::{Rng, Seed, Stream},
    spec::{Band, Key},
    stats::{Aggregates, Bootstrap, Estimate, performance_profile, probability_of_improvement},
};

/// The score whose first evaluation times a method's training.
pub const HALF: f64 = 0.5;

/// Resamples behind an interval of an aggregate, and behind one of a curve's points.
pub const RESAMPLES: usize = 5_000;
const RESAMPLES_OF_CURVES: usize = 2_000;

/// Points of a profile.
const THRESHOLDS: usize = 101;

/// The summaries of an experiment over its environments.
#[derive(Debug, Clone, PartialEq)]
pub struct StatisticsData {
    /// The keys that distinguish the methods.
    pub keys: Vec<Key>,
    /// The methods with a score, in the plan's order.
    pub methods: Vec<Method>,
    /// The index of the method that the others are compared with.
    pub base: usize,
    /// The shares of scores above each threshold, as a figure.
    pub profile: CurveData,
    /// Notes on how to read the numbers, a sentence each.
    pub notes: Vec<String>,
}

/// One method: an algorithm with its settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// The method's label.
    pub label: Label,
    /// The number of environments in which it has a score.
    pub environments: usize,
    /// The number of its scores over all environments.
    pub scores: usize,
    /// Aggregates of its scores after training.
    pub aggregates: Aggregates,
    /// The mean over environments of the area under its learning curves, over their length.
    pub area: Option<f64>,
    /// The median over runs of the share of the budget after which a score of one half was first
    /// evaluated; infinite where most runs never reached it.
    pub half: f64,
    /// The probability that the base's score is above this method's; `None` for the base itself,
    /// and where they share no environment.
    pub below_base: Option<Estimate>,
}

/// The scores of a method, environment by environment.
type Scores = BTreeMap<EnvId, Vec<f64>>;

/// A method's label, its look, its scores, and the runs behind them.
type Found<'a> = (Label, usize, Scores, Vec<&'a Run>);

impl StatisticsData {
    /// The summaries of `runs`; `None` where fewer than two environments have a finished run of
    /// every method that has any.
    pub fn new(runs: &[Run], identities: &Identities) -> Option<Self> {
        // Scores need the paper's Random and Expert, so other environments do not count.
        let known: Vec<&Run> = runs
            .iter()
            .filter(|run| reference::scale(run.spec.env.name()).is_some())
            .collect();
        let keys = axis::hidden_axes(&known, &[Key::Env, Key::Algorithm]);
        let keys = [vec![Key::Algorithm], keys].concat();
        let groups = axis::group(&known, &keys);
        let labels = axis::labels(&keys, &groups);
        let looks = identities.looks(groups.iter().map(|group| group.runs[0]));
        let mut found: Vec<Found<'_>> = groups
            .into_iter()
            .zip(labels)
            .zip(looks)
            .map(|((group, label), look)| (label, look, scores(&group.runs), group.runs))
            .filter(|(_, _, scores, _)| !scores.is_empty())
            .collect();
        let (environments, left_out): (Vec<EnvId>, Vec<EnvId>) = found
            .iter()
            .flat_map(|(_, _, scores, _)| scores.keys().copied())
            .collect::<BTreeSet<_>>()
            .into_iter()
            .partition(|env| {
                found
                    .iter()
                    .all(|(_, _, scores, _)| scores.contains_key(env))
            });
        if environments.len() < 2 {
            return None;
        }
        for (_, _, scores, runs) in &mut found {
            // Aggregates over different environments could not be compared.
            scores.retain(|env, _| environments.contains(env));
            runs.retain(|run| environments.contains(&run.spec.env));
        }
        let base = found
            .iter()
            .position(|(_, look, ..)| *look == 0)
            .unwrap_or(0);
        let of_base = &found[base].2;
        let methods = found
            .iter()
            .enumerate()
            .map(|(index, (label, _, scores, runs))| {
                let below_base = (index != base)
                    .then(|| improvement(of_base, scores))
                    .flatten();
                Method::new(label.clone(), runs, scores, below_base)
            });
        let methods: Vec<Method> = methods.collect::<Option<_>>()?;
        let profile = profile(&found, &keys);
        let notes = notes(&methods, base, [&environments, &left_out], &found);
        Some(Self {
            keys,
            methods,
            base,
            profile,
            notes,
        })
    }
}

impl Method {
    fn new(
        label: Label,
        runs: &[&Run],
        scores: &Scores,
        below_base: Option<Estimate>,
    ) -> Option<Self> {
        let tasks: Vec<&[f64]> = scores.values().map(Vec::as_slice).collect();
        let bootstrap = Bootstrap {
            resamples: RESAMPLES,
            ..Bootstrap::default()
        };
        let areas: Vec<f64> = scores.keys().filter_map(|env| area(runs, *env)).collect();
        let mut halves: Vec<f64> = runs.iter().filter_map(|run| half(run)).collect();
        halves.sort_by(f64::total_cmp);
        Some(Self {
            label,
            environments: scores.len(),
            scores: scores.values().map(Vec::len).sum(),
            aggregates: Aggregates::of(&tasks, &bootstrap, &mut rng())?,
            area: (areas.len() == scores.len()).then(|| mean(&areas)),
            half: halves
                .get(halves.len() / 2)
                .copied()
                .unwrap_or(f64::INFINITY),
            below_base,
        })
    }
}

/// A fresh generator, so that a method gets the same numbers whatever else is summarised.
fn rng() -> Rng {
    Seed(0).stream(Stream::Bootstrap, 0)
}

/// A return as a score.
pub fn score(env: EnvId, value: f64) -> Option<f64> {
    let scale = reference::scale(env.name())?;
    Some((value - scale.random) / scale.distance)
}

/// One score per run that has ended, in the environments where at least one finished.
fn scores(runs: &[&Run]) -> Scores {
    let mut scores = Scores::new();
    for run in runs.iter().filter(|run| run.recording().is_some()) {
        scores.entry(run.spec.env).or_default();
    }
    for run in runs {
        let score = match &run.state {
            State::Finished(recording) => score(run.spec.env, mean(&recording.final_returns())),
            State::Failed { .. } => Some(0.0),
            State::Missing | State::Differs { .. } => None,
        };
        if let (Some(score), Some(scores)) = (score, scores.get_mut(&run.spec.env)) {
            scores.push(score);
        }
    }
    scores
}

/// The mean over the finished runs in `env` of the area under their curves of scores; `None`
/// without any.
fn area(runs: &[&Run], env: EnvId) -> Option<f64> {
    let finished = runs.iter().filter(|run| run.spec.env == env);
    let areas = finished.filter_map(|run| {
        score(
            env,
            measure::area(&seed_values(run.recording()?, Measure::Return))?,
        )
    });
    let areas: Vec<f64> = areas.collect();
    (!areas.is_empty()).then(|| mean(&areas))
}

/// The share of its budget after which a run was first evaluated with [`HALF`]; infinite where it
/// never was, or where the run failed.
fn half(run: &Run) -> Option<f64> {
    let recording = match &run.state {
        State::Finished(recording) => recording,
        State::Failed { .. } => return Some(f64::INFINITY),
        State::Missing | State::Differs { .. } => return None,
    };
    let values = seed_values(recording, Measure::Return);
    let first = values
        .iter()
        .find(|(_, value)| score(run.spec.env, *value).is_some_and(|score| score >= HALF));
    let budget = run.spec.budget.env_steps.get() as f64;
    Some(first.map_or(f64::INFINITY, |(steps, _)| *steps as f64 / budget))
}

/// The probability that a score of `ours` is above one of `theirs`, over the environments that both
/// have.
fn improvement(ours: &Scores, theirs: &Scores) -> Option<Estimate> {
    let both = ours
        .iter()
        .filter_map(|(env, ours)| Some((ours.as_slice(), theirs.get(env)?.as_slice())));
    let (ours, theirs): (Vec<&[f64]>, Vec<&[f64]>) = both.unzip();
    let bootstrap = Bootstrap {
        resamples: RESAMPLES,
        ..Bootstrap::default()
    };
    probability_of_improvement(&ours, &theirs, &bootstrap, &mut rng())
}

/// The performance profile of each method.
fn profile(found: &[Found<'_>], keys: &[Key]) -> CurveData {
    let all = || {
        found
            .iter()
            .flat_map(|(_, _, scores, _)| scores.values().flatten())
    };
    let quarter = |end: f64| (4.0 * end).round() / 4.0;
    // A few extreme scores must not stretch the axis, so it ends at -1 and 2 at the latest.
    let low = quarter((4.0 * all().copied().fold(0.0, f64::min)).floor() / 4.0).max(-1.0);
    let high = quarter((4.0 * all().copied().fold(1.0, f64::max)).ceil() / 4.0).min(2.0);
    let threshold = |index: usize| low + (high - low) * index as f64 / (THRESHOLDS - 1) as f64;
    let thresholds: Vec<f64> = (0..THRESHOLDS).map(threshold).collect();
    let bootstrap = Bootstrap {
        resamples: RESAMPLES_OF_CURVES,
        ..Bootstrap::default()
    };
    let curve = |scores: &Scores| {
        let tasks: Vec<&[f64]> = scores.values().map(Vec::as_slice).collect();
        let shares = performance_profile(&tasks, &thresholds, &bootstrap, &mut rng())?;
        let points = thresholds
            .iter()
            .zip(shares)
            // A point's x is called env_steps, along this axis of scores too.
            .map(|(&env_steps, share)| Point {
                env_steps,
                mean: share.value,
                band: Some((share.low, share.high)),
            });
        let seeds = tasks.iter().map(|task| task.len()).min().unwrap_or(0);
        Some(Curve {
            points: points.collect(),
            seeds,
            planned: seeds,
            ..Curve::default()
        })
    };
    CurveData {
        title: "Performance profiles".to_owned(),
        across: Across::Scores(low, high),
        y_label: "share of runs above it".to_owned(),
        y: "share".to_owned(),
        panel_key: "panel".to_owned(),
        keys: keys.to_vec(),
        series: found.iter().map(|(label, ..)| label.clone()).collect(),
        looks: found.iter().map(|(_, look, ..)| *look).collect(),
        panels: vec![Panel {
            title: "All environments".to_owned(),
            curves: found
                .iter()
                .map(|(_, _, scores, _)| curve(scores))
                .collect(),
            demo: None,
        }],
        band: Band::Bootstrap,
        caption: Some(
            "The share of runs whose normalised return is above a threshold, the mean over \
             environments; shaded: pointwise 95 % bootstrap interval, which is too narrow for few \
             seeds."
                .to_owned(),
        ),
        ..CurveData::default()
    }
}

fn notes(
    methods: &[Method],
    base: usize,
    environments: [&[EnvId]; 2],
    found: &[Found<'_>],
) -> Vec<String> {
    let [counted, left_out] = environments.map(|some| {
        some.iter()
            .map(|env| env.name())
            .collect::<Vec<_>>()
            .join(", ")
    });
    let mut notes = vec![
        format!(
            "Scores: dense returns of the final evaluation, of which the paper's Random has 0 and \
             its Expert 1; over {counted}."
        ),
        "IQM: the mean of the middle half of all runs' scores. Median and mean: over environments, \
         of their means over seeds. Gap: by how much scores are short of 1. Area: under the \
         learning curve, over its length. Half: the median share of the budget after which a run \
         was first evaluated with half of what the Expert gains on Random."
            .to_owned(),
    ];
    if methods.len() > 1 {
        notes.push(format!(
            "Above: the probability that a run of {} has a higher score than one of the method's.",
            methods[base].label.text
        ));
    }
    let fewest = found
        .iter()
        .flat_map(|(_, _, scores, _)| scores.values().map(Vec::len))
        .min()
        .unwrap_or(0);
    notes.push(format!(
        "In brackets: the 95 % stratified percentile bootstrap interval ({RESAMPLES} resamples). \
         It is too narrow for few seeds (the fewest here: {fewest}): of normal samples it holds \
         the mean over many environments 89 % of the time with 3 seeds in each and 92 % with 5, \
         and in one environment 75 % and 84 %."
    ));
    if !left_out.is_empty() {
        notes.push(format!(
            "Left out, since not every method here has a finished run there: {left_out}."
        ));
    }
    let failed = |run: &&&Run| matches!(run.state, State::Failed { .. });
    match found
        .iter()
        .flat_map(|(.., runs)| runs.iter())
        .filter(failed)
        .count()
    {
        0 => {}
        // A run that failed has no return, and counts as one of the paper's Random.
        count => notes.push(format!("Runs that failed have score 0: {count}.")),
    }
    notes
}

#[cfg(test)]
mod tests;
