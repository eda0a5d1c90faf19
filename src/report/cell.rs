//! One cell of a table of returns: the runs of one row and column as numbers.
//!
//! Owns our mean with its interval, the best seed, the paper's value, and what keeps both from
//! being compared. Knows nothing of the table around it. Start at [`Cell::new`].

use std::collections::BTreeSet;

use super::{
    amount,
    curve::{CONFIDENCE, mean},
    paper_value::PaperSide,
    recorded::{Run, State},
    reference::{self, PaperValue},
    verdict::{Comparison, SEEDS_FOR_VERDICT, Verdict},
};
use crate::{
    spec::Reference,
    stats::{Interval, t_interval},
};

/// One row of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The label of each row key's value; empty where the runs do not have that axis.
    pub labels: Vec<String>,
    /// The value of each row key.
    pub values: Vec<Option<toml::Value>>,
    /// The return of the demonstration that the row's runs learned from, where the row is one
    /// environment.
    pub demo: Option<f64>,
    /// The return of the paper's demonstration, where the table is compared with one of the
    /// paper's.
    pub paper_demo: Option<f64>,
    /// One per column; `None` where the matrix has no such run.
    pub cells: Vec<Option<Cell>>,
}

/// One cell: the runs of one row and column.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Mean over the finished seeds of their final evaluation's mean dense return, with its t
    /// interval.
    pub ours: Option<Interval>,
    /// The values of the finished seeds, each with its seed.
    pub values: Vec<(u64, f64)>,
    /// Finished seeds with a final evaluation.
    pub seeds: usize,
    /// Seeds that the plan has.
    pub planned: usize,
    /// The seed with the highest mean.
    pub best: Option<Best>,
    /// The paper's value.
    pub paper: Option<PaperValue>,
    /// The parameters that differ from the paper's, because of which its value is not shown here.
    pub departures: BTreeSet<String>,
    /// Ours less the paper's, where they can be compared.
    pub comparison: Option<Comparison>,
    /// The verdict of the comparison; `None` where there is nothing to compare.
    pub verdict: Option<Verdict>,
    /// Environment steps of the shortest run.
    pub env_steps: u64,
}

/// The paper's way of evaluating: the best seed's policy alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// The best seed.
    pub seed: u64,
    /// Mean dense return over its final episodes.
    pub mean: f64,
    /// Sample standard deviation over these episodes; NaN for one episode.
    pub std: f64,
    /// Number of these episodes.
    pub episodes: usize,
}

impl Cell {
    /// The cell of `runs`, beside the paper's `reference`.
    pub fn new(reference: Option<Reference>, runs: &[&Run]) -> Self {
        let seeds: Vec<(u64, Vec<f64>)> = runs
            .iter()
            .filter_map(|run| Some((run.spec.seed.0, run.recording()?.final_returns())))
            .filter(|(_, returns)| !returns.is_empty())
            .collect();
        let means: Vec<f64> = seeds.iter().map(|(_, returns)| mean(returns)).collect();
        let best = seeds
            .iter()
            .zip(&means)
            .max_by(|left, right| left.1.total_cmp(right.1));
        let best = best.map(|((seed, returns), &mean)| Best {
            seed: *seed,
            mean,
            std: (returns.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
                / (returns.len() as f64 - 1.0))
                .sqrt(),
            episodes: returns.len(),
        });
        let ours = t_interval(&means, CONFIDENCE);
        let PaperSide {
            value: paper,
            departures,
        } = match reference {
            Some(reference) => PaperSide::of(runs, reference == Reference::Table5),
            None => PaperSide::default(),
        };
        // The shortest run decides whether the paper's length is reached.
        let env_steps = runs
            .iter()
            .map(|run| run.spec.budget.env_steps.get())
            .min()
            .unwrap_or(0);
        let needed = reference::assumed_budget(&runs[0].spec);
        // Only the first obstacle is named: without seeds, the length does not matter.
        let reason = match ours {
            None => Some("no finished run".to_owned()),
            Some(_) if seeds.len() < SEEDS_FOR_VERDICT => Some(format!(
                "{}; {SEEDS_FOR_VERDICT} are needed",
                amount::count(seeds.len(), "seed")
            )),
            Some(_) if env_steps < needed => Some(format!(
                "{} of {} steps",
                amount::steps(env_steps),
                amount::steps(needed)
            )),
            Some(_) => None,
        };
        // Failed runs count a second time, at the random policy's return.
        let failed = runs
            .iter()
            .filter(|run| matches!(run.state, State::Failed { .. }))
            .count();
        let comparison = paper
            .filter(|_| reason.is_none())
            .zip(reference::scale(runs[0].spec.env.name()));
        let comparison =
            comparison.and_then(|(paper, scale)| Comparison::new(&means, failed, paper, scale));
        let verdict = reason
            .filter(|_| paper.is_some())
            .map(Verdict::NotComparable);
        let values = seeds.iter().map(|(seed, _)| *seed).zip(means).collect();
        let (seeds, planned) = (seeds.len(), runs.len());
        Self {
            ours,
            values,
            seeds,
            planned,
            best,
            paper,
            departures,
            comparison,
            verdict,
            env_steps,
        }
    }
}
