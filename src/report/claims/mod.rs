//! The claims of a file, judged by the recorded runs.
//!
//! Owns which runs stand on either side of a claim, environment by environment and setting by
//! setting. How a number comes from a run is `measure`'s, how numbers are judged is `judge`'s;
//! knows nothing of Markdown or LaTeX. Start at [`ClaimsData::new`].

mod judge;
pub mod measure;

use std::collections::BTreeSet;

use super::{
    amount,
    axis::{self, Group},
    notes,
    recorded::{Run, State, demonstrated_return},
    reference,
    verdict::SEEDS_FOR_VERDICT,
};
use crate::{
    env::EnvId,
    measured::Measure,
    spec::{Claim, Environments, Key, Relation, Selection, Versus},
    stats::{Interval, share_above},
};
use judge::{Judged, Part, judge};

/// The claims of an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimsData {
    /// Claim by claim, in the file's order; one row per environment and setting.
    pub rows: Vec<ClaimRow>,
    /// Notes on how to read the numbers, a sentence each.
    pub notes: Vec<String>,
}

/// A claim in one environment, or over several.
#[derive(Debug, Clone, PartialEq)]
pub struct ClaimRow {
    /// The claim, as the file has it.
    pub claim: Claim,
    /// The environment; `None` over several.
    pub env: Option<String>,
    /// The number of environments that the row covers.
    pub environments: usize,
    /// The setting that distinguishes this row from the claim's other rows; empty where there is
    /// none.
    pub setting: String,
    /// The difference, or the share for `kept`, with its 95 % interval.
    pub difference: Option<Interval>,
    /// The value that the difference is compared with: 0, or the margin in the unit of
    /// `difference`.
    pub limit: f64,
    /// The share of pairs of seeds in which the claim's subject is above the other side; ties count
    /// half.
    pub improvement: Option<f64>,
    /// Seeds of the claim's subject.
    pub seeds: Count,
    /// Seeds of the side that it is compared with; `None` for a level.
    pub than: Option<Count>,
    /// The p values of the claim's opposite and of the claim, corrected over its rows.
    pub p: Option<(f64, f64)>,
    /// The verdict of this row.
    pub verdict: ClaimVerdict,
}

/// How many seeds there are of one side.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Count {
    /// Seeds that have a number.
    pub found: usize,
    /// Seeds in the plan.
    pub planned: usize,
}

/// The verdict on a claim.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// The runs confirm the claim.
    Holds,
    /// The runs contradict the claim.
    Contradicted,
    /// The runs decide neither; with the reason, unless it lies in the numbers themselves.
    Inconclusive(Option<Unjudged>),
}

/// The ways in which the runs give no numbers to judge.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unjudged {
    /// None is selected.
    #[error("the file has no such runs")]
    NoRuns,
    /// The other side is of several settings, which cannot be averaged.
    #[error("the runs that they are compared with differ in {}", listed(.0))]
    Differ(Vec<Key>),
    /// Too few seeds have a number.
    #[error("{} in {env}; {SEEDS_FOR_VERDICT} are needed", amount::count(*found, "seed"))]
    FewSeeds {
        /// The number of seeds that have one.
        found: usize,
        /// The environment.
        env: EnvId,
    },
    /// The runs ended, and recorded no such numbers: their algorithm has none.
    #[error("{algorithm} records no {on} in {env}")]
    NotRecorded {
        /// The algorithm.
        algorithm: &'static str,
        /// The quantity that the claim compares.
        on: &'static str,
        /// The environment.
        env: EnvId,
    },
    /// The demonstration's return is unknown, or there are several.
    #[error("the return of the demonstration in {0} is not recorded, or not of one")]
    NoDemonstratedReturn(EnvId),
}

fn listed(keys: &[Key]) -> String {
    let names: Vec<String> = keys.iter().map(Key::to_string).collect();
    names.join(", ")
}

impl ClaimVerdict {
    /// The verdict in words.
    pub fn text(&self) -> String {
        match self {
            Self::Holds => "holds".to_owned(),
            Self::Contradicted => "contradicted".to_owned(),
            Self::Inconclusive(None) => "inconclusive".to_owned(),
            Self::Inconclusive(Some(reason)) => format!("inconclusive: {reason}"),
        }
    }
}

impl ClaimsData {
    /// Judges the `claims` of a file by `runs`, which are in the plan's order.
    pub fn new(claims: &[Claim], runs: &[Run]) -> Self {
        let rows: Vec<ClaimRow> = claims.iter().flat_map(|claim| rows(claim, runs)).collect();
        let notes = notes::of_claims(&rows);
        Self { rows, notes }
    }

    /// The claims, each with its rows.
    pub fn by_claim(&self) -> impl Iterator<Item = &[ClaimRow]> {
        self.rows
            .chunk_by(|one, other| one.claim.name == other.claim.name)
    }
}

/// The runs of a row: of one environment, or of several.
struct Row<'a> {
    env: Option<String>,
    setting: String,
    /// One entry per environment.
    sides: Vec<Sides<'a>>,
}

/// The runs of one environment on either side of a claim.
struct Sides<'a> {
    of: Vec<&'a Run>,
    /// The runs that they are compared with; none for a level.
    than: Vec<&'a Run>,
}

fn rows(claim: &Claim, runs: &[Run]) -> Vec<ClaimRow> {
    let meant = |selection: &Selection| -> Vec<&Run> {
        let both = |run: &&Run| {
            run.is_in(selection) && claim.only.as_ref().is_none_or(|only| run.is_in(only))
        };
        runs.iter().filter(both).collect()
    };
    let than = match &claim.than {
        None | Some(Versus::Demonstration) => Vec::new(),
        Some(Versus::Runs(selection)) => meant(selection),
    };
    // No run is compared with itself: one that matches both selections counts on the other side.
    let opposite: BTreeSet<&str> = than.iter().map(|run| run.spec.id.as_str()).collect();
    let mut of = meant(&claim.of);
    of.retain(|run| !opposite.contains(run.spec.id.as_str()));

    let compares_runs = matches!(claim.than, Some(Versus::Runs(_)));
    let keys = axis::hidden_axes(&of, &[Key::Env]);
    let settings = axis::group(&of, &keys);
    let labels = axis::labels(&keys, &settings);
    let mut made: Vec<Row<'_>> = Vec::new();
    for (setting, label) in settings.iter().zip(labels) {
        let setting_text = if settings.len() > 1 {
            label.text
        } else {
            String::new()
        };
        let by_env = axis::group(&setting.runs, &[Key::Env]);
        let sides = by_env.into_iter().map(|Group { runs, .. }| {
            let env = runs[0].spec.env;
            let others: Vec<&Run> = than
                .iter()
                .copied()
                .filter(|run| run.spec.env == env)
                .collect();
            Sides {
                of: runs,
                than: others,
            }
        });
        // An environment without runs to compare with cannot be judged.
        let sides: Vec<_> = sides
            .filter(|sides| !compares_runs || !sides.than.is_empty())
            .collect();
        match claim.environments {
            Environments::Overall if !sides.is_empty() => made.push(Row {
                env: None,
                setting: setting_text,
                sides,
            }),
            Environments::Overall => {}
            Environments::Each => made.extend(sides.into_iter().map(|side| Row {
                env: Some(side.of[0].spec.env.name().to_owned()),
                setting: setting_text.clone(),
                sides: vec![side],
            })),
        }
    }
    // A claim without any runs still gets a row, so that it is not overlooked.
    if made.is_empty() {
        made.push(Row {
            env: None,
            setting: String::new(),
            sides: Vec::new(),
        });
    }
    verdicts(claim, made)
}

/// The rows of one claim, whose verdicts allow for each other.
fn verdicts(claim: &Claim, rows: Vec<Row<'_>>) -> Vec<ClaimRow> {
    let parts: Vec<Result<Vec<Part>, Unjudged>> =
        rows.iter().map(|row| parts(claim, &row.sides)).collect();
    let judged: Vec<Option<Judged>> = parts
        .iter()
        .map(|parts| judge(claim, parts.as_ref().ok()?))
        .collect();
    // Holm's correction needs all rows, so p values come before verdicts.
    let p = judge::corrected(&judged);
    let made = rows
        .into_iter()
        .zip(parts)
        .zip(judged.into_iter().zip(p))
        .map(|((row, parts), (judged, p))| {
            let verdict = match (&parts, p) {
                (Err(reason), _) => ClaimVerdict::Inconclusive(Some(reason.clone())),
                (Ok(_), Some((opposite, _))) if opposite <= judge::ALPHA => ClaimVerdict::Holds,
                (Ok(_), Some((_, itself))) if itself <= judge::ALPHA => ClaimVerdict::Contradicted,
                (Ok(_), _) => ClaimVerdict::Inconclusive(None),
            };
            let count = |runs: Vec<&Run>| Count {
                found: runs
                    .iter()
                    .filter(|run| measure::of(run, claim).is_some())
                    .count(),
                planned: runs.len(),
            };
            let of = row
                .sides
                .iter()
                .flat_map(|sides| sides.of.iter().copied())
                .collect();
            let than: Vec<&Run> = row
                .sides
                .iter()
                .flat_map(|sides| sides.than.iter().copied())
                .collect();
            let improvement = parts.as_ref().ok().map(|parts| improvement(parts));
            ClaimRow {
                claim: claim.clone(),
                env: row.env.clone(),
                environments: row.sides.len(),
                setting: row.setting.clone(),
                difference: judged.as_ref().map(|judged| judged.interval),
                limit: judged.map_or(0.0, |judged| judged.limit),
                // The share of pairs compares two sides, and a constraint that is kept has one.
                improvement: improvement.filter(|_| claim.is != Relation::Kept),
                seeds: count(of),
                than: (!than.is_empty()).then(|| count(than)),
                p,
                verdict,
            }
        });
    made.collect()
}

/// The mean over environments of the share of pairs in which the first side is above the second.
fn improvement(parts: &[Part]) -> f64 {
    let share = |part: &Part| match &part.than {
        Some(than) => share_above(&part.of, than),
        None => share_above(&part.of, &[part.level]),
    };
    parts.iter().map(share).sum::<f64>() / parts.len() as f64
}

/// The numbers of either side, one part per environment; or the reason why there are none to judge.
fn parts(claim: &Claim, sides: &[Sides<'_>]) -> Result<Vec<Part>, Unjudged> {
    if sides.is_empty() {
        return Err(Unjudged::NoRuns);
    }
    sides
        .iter()
        .map(|sides| part(claim, &sides.of, &sides.than))
        .collect()
}

fn part(claim: &Claim, of: &[&Run], than: &[&Run]) -> Result<Part, Unjudged> {
    let env = of[0].spec.env;
    // The other side is one sample, so its runs may differ in their seed alone.
    let differing = axis::hidden_axes(than, &[Key::Env]);
    if !differing.is_empty() {
        return Err(Unjudged::Differ(differing));
    }
    // Only returns have a scale of the paper's.
    let scale = (claim.is != Relation::Kept && claim.on == Measure::Return)
        .then(|| reference::scale(env.name()))
        .flatten();
    let enough = |runs: &[&Run]| {
        let values: Vec<f64> = runs
            .iter()
            .filter_map(|run| measure::of(run, claim))
            .collect();
        // Returns are recorded by all; one that is missing is no finite number.
        let ended = runs
            .iter()
            .find(|run| run.recording().is_some() && claim.on != Measure::Return);
        match (values.len(), ended) {
            (0, Some(run)) => Err(Unjudged::NotRecorded {
                algorithm: run.spec.algorithm_name(),
                on: claim.on.name(),
                env,
            }),
            (found, _) if found < SEEDS_FOR_VERDICT => Err(Unjudged::FewSeeds { found, env }),
            _ => Ok(values),
        }
    };
    let level = match &claim.than {
        Some(Versus::Demonstration) => {
            demonstrated_return(of).ok_or(Unjudged::NoDemonstratedReturn(env))?
        }
        Some(Versus::Runs(_)) | None => 0.0,
    };
    Ok(Part {
        of: enough(of)?,
        than: if than.is_empty() {
            None
        } else {
            Some(enough(than)?)
        },
        level,
        failed: (failed(of), failed(than)),
        scale,
    })
}

fn failed(runs: &[&Run]) -> usize {
    runs.iter()
        .filter(|run| matches!(run.state, State::Failed { .. }))
        .count()
}

#[cfg(test)]
mod tests;
