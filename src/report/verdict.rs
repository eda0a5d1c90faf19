//! Whether a printed value is reproduced.
//!
//! Owns the test of one cell and the correction over many. Knows nothing of runs or tables: it is
//! given one value a seed. Start at
//! [`Comparison::new`] and [`settle`].
//!
//! # The verdict
//!
//! The paper prints the return of one policy, the best of five seeds', over 50 episodes. So what is
//! compared is the **expected best of five** seeds, ours less the paper's; the paper's is known
//! only from that one draw. [`best_of`](crate::stats::best_of) derives the exact interval for it
//! under two assumptions: seeds are normal, and the paper's deviate from each other as ours do (it
//! does not print that deviation). It prints the deviation over episodes, whose standard error is
//! the least that its value can have; where our deviation is smaller than that, the rest is added.
//!
//! The margin is `reference.toml`'s share of the paper's Expert - Random in the environment. Two
//! one-sided tests at 5 % (Schuirmann, 1987; Lakens, 2017), which is to say the 90 % interval, give
//! **reproduced** where it lies within the margin. **Better** or **worse** is what lies beyond the
//! margin: twice the smaller of the two p values, after Holm's correction over all cells of the
//! report, is at most 5 %; so at most one report in twenty of perfect reproductions has such a
//! cell. Everything else is **inconclusive**, with the number of seeds that would decide it if they
//! went on like these; there may be none, since the paper's value stays one draw.
//!
//! Runs that failed are counted a second time, each at the Random policy's return. A verdict holds
//! where both ways give it.

use crate::stats::{
    best_of::{PublishedBest, Samples, expected_best},
    holm,
};

use super::{
    amount,
    reference::{PaperValue, Scale},
};

/// With fewer seeds, a verdict would mean nothing.
pub const SEEDS_FOR_VERDICT: usize = 3;

/// The error rate of a verdict.
pub const ALPHA: f64 = 0.05;

/// The largest number of needed seeds that is reported exactly.
const MOST_SEEDS: usize = 1000;

/// The verdict on our value, judged by the paper's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The difference is within the margin.
    Reproduced,
    /// Ours is above the paper's by more than the margin.
    Better,
    /// Ours is below the paper's by more than the margin.
    Worse,
    /// The seeds decide none of these; with what would decide it.
    Inconclusive(String),
    /// There are too few seeds or steps; with the reason.
    NotComparable(String),
}

impl Verdict {
    /// The verdict in words.
    pub fn text(&self) -> String {
        match self {
            Self::Reproduced => "reproduced".to_owned(),
            Self::Better => "better".to_owned(),
            Self::Worse => "worse".to_owned(),
            Self::Inconclusive(reason) => format!("inconclusive: {reason}"),
            Self::NotComparable(reason) => format!("not comparable: {reason}"),
        }
    }
}

/// The comparison of the expected best of five seeds: ours less the paper's.
///
/// Its `p` is valid once all cells of the report are settled.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Our expected best of five, for any distribution of seeds; absent for fewer than five.
    pub expected_best: Option<f64>,
    /// The margin: the difference that counts as none.
    pub margin: f64,
    /// The p value of better or worse, corrected over the cells of the report.
    pub p: f64,
    paper: PublishedBest,
    /// The samples without the failed runs and, where there are any, those with them.
    ways: Vec<Samples>,
    failed: usize,
}

impl Comparison {
    /// Compares seeds of these `values`, and `failed` ones beside them, with the paper's; `None`
    /// for fewer than two values.
    pub fn new(values: &[f64], failed: usize, paper: PaperValue, scale: Scale) -> Option<Self> {
        let worst = [values, &vec![scale.random; failed]].concat();
        let counted = if failed > 0 {
            vec![values, &worst]
        } else {
            vec![values]
        };
        let ways = counted
            .into_iter()
            .map(Samples::of)
            .collect::<Option<Vec<Samples>>>()?;
        let printed = paper.std / PaperValue::EPISODES.sqrt();
        let error = (printed.powi(2) - ways[0].deviation.powi(2))
            .max(0.0)
            .sqrt();
        let paper = PublishedBest {
            k: PaperValue::SEEDS as i32,
            value: paper.mean,
            error,
        };
        let (expected_best, margin) = (expected_best(values, PaperValue::SEEDS), scale.margin());
        Some(Self {
            expected_best,
            margin,
            p: 1.0,
            paper,
            ways,
            failed,
        })
    }

    /// The difference's 90 % interval, over both ways to count runs that failed.
    pub fn interval(&self) -> (f64, f64) {
        let intervals = self
            .ways
            .iter()
            .map(|way| self.paper.interval(*way, 1.0 - 2.0 * ALPHA));
        intervals.fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(low, high), interval| (low.min(interval.0), high.max(interval.1)),
        )
    }

    /// The p value of better or worse for this cell alone, and the one of the two that it belongs
    /// to.
    fn beyond(&self) -> (f64, Verdict) {
        let greatest = |p: fn(&Self, Samples) -> f64| {
            self.ways
                .iter()
                .map(|way| p(self, *way))
                .fold(0.0, f64::max)
        };
        let (worse, better) = (greatest(Self::not_worse), greatest(Self::not_better));
        let (p, verdict) = if worse < better {
            (worse, Verdict::Worse)
        } else {
            (better, Verdict::Better)
        };
        ((2.0 * p).min(1.0), verdict)
    }

    /// The p value of the hypothesis that ours is not worse by more than the margin.
    fn not_worse(&self, ours: Samples) -> f64 {
        1.0 - self.paper.confidence_below(ours, -self.margin)
    }

    /// The p value of the hypothesis that ours is not better by more than the margin.
    fn not_better(&self, ours: Samples) -> f64 {
        self.paper.confidence_below(ours, self.margin)
    }

    /// The p value of the hypothesis that the difference is not within the margin.
    fn not_within(&self, ours: Samples) -> f64 {
        (1.0 - self.not_worse(ours)).max(1.0 - self.not_better(ours))
    }

    /// The verdict on this cell, one of `family`, once its p value is corrected.
    fn verdict(&self, family: usize) -> Verdict {
        if self.ways.iter().all(|way| self.not_within(*way) <= ALPHA) {
            Verdict::Reproduced
        } else if self.p <= ALPHA {
            self.beyond().1
        } else {
            Verdict::Inconclusive(self.what_would_decide(family))
        }
    }

    fn what_would_decide(&self, family: usize) -> String {
        let ends: Vec<Option<(usize, Verdict)>> = self
            .ways
            .iter()
            .map(|way| self.seeds_needed(*way, family))
            .collect();
        let Some(ends) = ends.into_iter().collect::<Option<Vec<(usize, Verdict)>>>() else {
            return "no number of seeds would decide: the paper's value is one draw".to_owned();
        };
        if ends.iter().any(|end| end.1 != ends[0].1) {
            return format!("{} would decide", amount::count(self.failed, "failed run"));
        }
        match ends.iter().map(|end| end.0).max() {
            Some(seeds) if seeds <= MOST_SEEDS => format!("{seeds} seeds would decide"),
            _ => format!("more than {MOST_SEEDS} seeds would be needed"),
        }
    }

    /// The number of seeds with the same mean and deviation that would decide, and the verdict
    /// then; `None` where no number would.
    fn seeds_needed(&self, ours: Samples, family: usize) -> Option<(usize, Verdict)> {
        let decided = |n: usize| {
            let (more, alpha) = (Samples { n, ..ours }, ALPHA / 2.0 / family as f64);
            match () {
                () if self.not_within(more) <= ALPHA => Some(Verdict::Reproduced),
                () if self.not_worse(more) <= alpha => Some(Verdict::Worse),
                () if self.not_better(more) <= alpha => Some(Verdict::Better),
                () => None,
            }
        };
        let without_end = 1_000_000;
        let verdict = decided(without_end)?;
        let (mut too_few, mut enough) = (ours.n, MOST_SEEDS + 1);
        if decided(MOST_SEEDS).is_none() {
            return Some((enough, verdict));
        }
        while enough - too_few > 1 {
            let middle = (too_few + enough) / 2;
            let side = if decided(middle).is_some() {
                &mut enough
            } else {
                &mut too_few
            };
            *side = middle;
        }
        Some((enough, verdict))
    }
}

/// Corrects the p values of `cells`, which are all that a report compares, and returns their
/// verdicts.
pub fn settle(cells: &mut [&mut Comparison]) -> Vec<Verdict> {
    correct(cells);
    cells.iter().map(|cell| cell.verdict(cells.len())).collect()
}

fn correct(cells: &mut [&mut Comparison]) {
    let alone: Vec<f64> = cells.iter().map(|cell| cell.beyond().0).collect();
    cells
        .iter_mut()
        .zip(holm(&alone))
        .for_each(|(cell, p)| cell.p = p);
}

#[cfg(test)]
mod simulation;

#[cfg(test)]
mod tests;
