//! The verdicts on made-up papers, whose truth is known.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::rng::{Rng, Seed, Stream};

/// Expert - Random is 1, so the margin is 0.1.
const SCALE: Scale = Scale {
    random: 0.0,
    distance: 1.0,
};

/// Where a process of returns lies, and how its seeds deviate.
#[derive(Clone, Copy)]
struct Process {
    mean: f64,
    deviation: f64,
}

impl Process {
    fn draw(self, count: usize, rng: &mut Rng) -> Vec<f64> {
        let one = |rng: &mut Rng| -> f64 { StandardNormal.sample(rng) };
        (0..count)
            .map(|_| self.mean + self.deviation * one(rng))
            .collect()
    }

    /// The value that the paper prints of it: the best of five, whose episodes deviate as much as
    /// seeds do.
    fn printed(self, rng: &mut Rng) -> PaperValue {
        let best = self
            .draw(PaperValue::SEEDS, rng)
            .into_iter()
            .fold(f64::NEG_INFINITY, f64::max);
        PaperValue {
            mean: best,
            std: self.deviation,
        }
    }
}

fn rng(seed: u64) -> Rng {
    Seed(seed).stream(Stream::Bootstrap, 0)
}

/// The share of `tables` reports of `cells` cells in which some cell is better or worse, where ours
/// is the paper's process.
fn refuted(deviation: f64, seeds: usize, cells: usize, tables: u64) -> f64 {
    let process = Process {
        mean: 0.5,
        deviation,
    };
    let is_refuted = |table: u64| {
        let mut rng = rng(table);
        let mut made: Vec<Comparison> = (0..cells)
            .map(|_| {
                let printed = process.printed(&mut rng);
                Comparison::new(&process.draw(seeds, &mut rng), 0, printed, SCALE)
                    .expect("enough seeds")
            })
            .collect();
        let mut cells: Vec<&mut Comparison> = made.iter_mut().collect();
        correct(&mut cells);
        cells.iter().any(|cell| cell.p <= ALPHA)
    };
    (0..tables).filter(|table| is_refuted(*table)).count() as f64 / tables as f64
}

/// How often the first-order bound of 5 % may be passed by chance: three standard errors of a share
/// of `trials`.
fn by_chance(share: f64, trials: u64) -> f64 {
    3.0 * (share * (1.0 - share) / trials as f64).sqrt()
}

#[test]
fn a_perfect_reproduction_of_a_table_is_refuted_in_one_of_twenty_at_most() {
    // A margin far below the seeds' deviation is the hardest case: then it excuses nothing.
    for seeds in [3, 5, 10] {
        let share = refuted(1000.0, seeds, 21, 300);
        assert!(
            share <= ALPHA + by_chance(ALPHA, 300),
            "{seeds} seeds: {share}"
        );
        assert!(share > 0.0, "{seeds} seeds: the test has no power at all");
    }
    // As seeds deviate in practice, the margin makes it rarer still.
    assert_eq!(refuted(0.05, 5, 21, 100), 0.0);
}

/// By the derivation, worse is said where `(P - margin - m) / S` is beyond the quantile at 97.5 %
/// of its distribution at the margin, which is `P(4 - margin / sigma + M - Z / sqrt(n) >= q W)`;
/// both by `scipy.integrate.quad`.
#[test]
fn a_method_four_deviations_worse_is_called_so_as_often_as_derived() {
    for (seeds, deviation, derived) in [(5, 0.1, 0.46202), (5, 1.0, 0.65382), (10, 0.1, 0.80162)] {
        let trials = 1500;
        let theirs = Process {
            mean: 0.5,
            deviation,
        };
        let ours = Process {
            mean: 0.5 - 4.0 * deviation,
            deviation,
        };
        let mut rng = rng(7);
        let worse = |rng: &mut Rng| {
            let printed = theirs.printed(rng);
            let mut cell =
                Comparison::new(&ours.draw(seeds, rng), 0, printed, SCALE).expect("enough seeds");
            correct(&mut [&mut cell]);
            cell.p <= ALPHA && cell.beyond().1 == Verdict::Worse
        };
        let share = (0..trials).filter(|_| worse(&mut rng)).count() as f64 / trials as f64;
        assert!(
            (share - derived).abs() <= by_chance(derived, trials),
            "{seeds} seeds: {share}, not {derived}"
        );
    }
}

#[test]
fn the_interval_holds_the_truth_nine_times_in_ten() {
    let process = Process {
        mean: 0.5,
        deviation: 1.0,
    };
    for seeds in [3, 5] {
        let mut rng = rng(11);
        let trials = 1000;
        let holds = |rng: &mut Rng| {
            let printed = PaperValue {
                std: 0.0,
                ..process.printed(rng)
            };
            let cell = Comparison::new(&process.draw(seeds, rng), 0, printed, SCALE)
                .expect("enough seeds");
            let (low, high) = cell.interval();
            low <= 0.0 && 0.0 <= high
        };
        let share = (0..trials).filter(|_| holds(&mut rng)).count() as f64 / trials as f64;
        assert!(
            (share - 0.9).abs() <= by_chance(0.9, trials),
            "{seeds} seeds: {share}"
        );
    }
}
