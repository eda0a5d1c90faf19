//! One curve from the values of its seeds.
//!
//! Owns which seeds are drawn, the mean and band over them at each point, and the smoothing. Knows
//! nothing of matrices or pixels. Start at [`OverSeeds::new`].
//!
//! A seed's value at a point is the mean over that evaluation's episodes, or over the iterations of
//! a bin of `progress`. Seeds are the samples of a band, never episodes. A point exists only where
//! every seed of its curve has a value, so that a curve never jumps because a seed is missing; what
//! was left out for that is counted. Where a value cannot be drawn (it is no finite number, or not
//! above 0 on a logarithmic axis) the curve has a gap.
//!
//! While runs are under way, the seeds that have come farthest are drawn, as many as make seeds
//! times steps the largest. Their values do not count. The curve ends where the slowest drawn seed
//! is.

use std::collections::BTreeMap;

use super::{
    curve::{CONFIDENCE, LeftOut, Point, Single, mean},
    recorded::{Recording, Run, State},
};
use crate::{
    measured::{Column, Iteration, Measure, progress},
    rng::{Seed as RngSeed, Stream},
    spec::Band,
    stats::{Bootstrap, t_interval},
};

/// A column of `progress.parquet` is averaged in this many bins when it has more iterations.
const BINS: usize = 240;

/// Below this many seeds, the band shows their range instead of a t interval: the t interval of two
/// seeds is 12.7 standard errors to each side, and would hide the figure.
pub const SEEDS_FOR_T: usize = 3;

/// Resamples behind a bootstrap band: its ends move by less than a line is broad.
const RESAMPLES: usize = 2_000;

/// One seed's recorded results.
#[derive(Debug, Clone, Copy)]
pub struct Seed<'a> {
    number: u64,
    recording: &'a Recording,
    /// Environment steps that it has taken, or was to take if it ended.
    reach: u64,
    /// Environment steps that a run under way has taken; `None` for a run that has ended.
    pub under_way: Option<u64>,
}

impl<'a> Seed<'a> {
    /// The recorded results of `run`; `None` where there is nothing to draw.
    pub fn of(run: &'a Run) -> Option<Self> {
        let (number, whole) = (run.spec.seed.0, run.spec.budget.env_steps.get());
        match (&run.state, &run.under_way) {
            (State::Finished(recording), _) => Some(Self {
                number,
                recording,
                reach: whole,
                under_way: None,
            }),
            (State::Missing, Some(so_far)) if so_far.env_steps > 0 => {
                let steps = so_far.env_steps.min(whole);
                Some(Self {
                    number,
                    recording: &so_far.recording,
                    reach: steps,
                    under_way: Some(steps),
                })
            }
            (State::Missing | State::Failed { .. } | State::Differs { .. }, _) => None,
        }
    }

    /// The last environment steps at which a run that has not ended can have a value of `y`: for
    /// returns, its last evaluation.
    fn end(&self, y: Measure) -> Option<u64> {
        let evaluated = || {
            self.recording
                .evaluations
                .iter()
                .map(|episode| episode.env_steps)
                .max()
                .unwrap_or(0)
        };
        self.under_way.map(|steps| {
            if y == Measure::Return {
                steps.min(evaluated())
            } else {
                steps
            }
        })
    }
}

/// The seeds of `all` that are drawn, in their order: as many as make seeds times steps the
/// largest, or the larger number where two are equal.
pub fn drawn<'a>(all: &[Seed<'a>]) -> Vec<Seed<'a>> {
    let mut reaches: Vec<u64> = all.iter().map(|seed| seed.reach).collect();
    reaches.sort_unstable_by(|left, right| right.cmp(left));
    let area = |(index, reach): (usize, &u64)| (index as u64 + 1).saturating_mul(*reach);
    let best = reaches.iter().enumerate().max_by_key(|&seed| area(seed)); // the last of equals
    let least = best.map_or(0, |(_, reach)| *reach);
    all.iter()
        .filter(|seed| seed.reach >= least)
        .copied()
        .collect()
}

/// How seeds become a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Averaging {
    /// Whether statistics are of log10; then a value that is not positive cannot be drawn.
    pub log: bool,
    /// How the spread of the seeds is shown beside their mean.
    pub band: Band,
    /// Environment steps over which each seed is averaged; 0 for none.
    pub smooth: u64,
}

impl Averaging {
    fn drawable(self, value: f64) -> bool {
        value.is_finite() && !(self.log && value <= 0.0)
    }

    fn there(self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }

    fn back(self, value: f64) -> f64 {
        if self.log { 10_f64.powf(value) } else { value }
    }
}

/// A curve: the points at which all seeds have a value, and counts of the others.
#[derive(Debug, Default)]
pub struct OverSeeds {
    /// In ascending order of environment steps.
    pub points: Vec<Point>,
    /// The means before smoothing; empty where nothing is smoothed.
    pub raw: Vec<(f64, f64)>,
    /// Each seed's values at the points.
    pub singles: Vec<Single>,
    /// Environment steps at which the curve is broken.
    pub gaps: Vec<f64>,
    /// The number of points that are missing, by reason.
    pub left_out: LeftOut,
}

impl OverSeeds {
    /// The curve of `y` over `seeds`, up to the steps that all of them have reached.
    pub fn new(seeds: &[Seed<'_>], y: Measure, averaging: Averaging) -> Self {
        let end = seeds
            .iter()
            .filter_map(|seed| seed.end(y))
            .min()
            .unwrap_or(u64::MAX);
        let bins = Bins::of(seeds.iter().map(|seed| seed.recording), y);
        let raw: Vec<Vec<(u64, f64)>> = seeds
            .iter()
            .map(|seed| values(seed.recording, y, bins, end))
            .collect();
        // By environment steps: each seed's value as it is, and its value smoothed on the scale of
        // the statistics.
        let mut points: BTreeMap<u64, Vec<(f64, f64)>> = BTreeMap::new();
        for seed in &raw {
            for (&(env_steps, value), smooth) in seed.iter().zip(smoothed(seed, averaging)) {
                points.entry(env_steps).or_default().push((value, smooth));
            }
        }
        let single = |seed: &Seed<'_>| Single {
            seed: seed.number,
            points: Vec::new(),
        };
        let mut all = Self {
            singles: seeds.iter().map(single).collect(),
            ..Self::default()
        };
        for (env_steps, samples) in points {
            all.point(env_steps, &samples, seeds.len(), averaging);
        }
        all
    }

    fn point(
        &mut self,
        env_steps: u64,
        samples: &[(f64, f64)],
        seeds: usize,
        averaging: Averaging,
    ) {
        let x = env_steps as f64;
        // Asked first: its logarithm is not finite either, which would be told as another reason.
        if averaging.log && samples.iter().any(|&(value, _)| value <= 0.0) {
            self.left_out.not_positive += 1;
            self.gaps.push(x);
            return;
        }
        let raw: Vec<f64> = samples
            .iter()
            .map(|&(value, _)| averaging.there(value))
            .collect();
        let smooth: Vec<f64> = samples.iter().map(|&(_, smooth)| smooth).collect();
        // The sum is checked too: finite numbers can have an infinite one.
        if !raw.iter().sum::<f64>().is_finite() {
            self.left_out.not_finite += 1;
            self.gaps.push(x);
        // A mean over fewer seeds would jump where one of them has no value.
        } else if samples.len() < seeds {
            self.left_out.absent += 1;
        } else {
            let mean_of_seeds = mean(&smooth);
            let ends = band(&smooth, mean_of_seeds, averaging.band, env_steps);
            let band = ends.map(|(low, high)| (averaging.back(low), averaging.back(high)));
            self.points.push(Point {
                env_steps: x,
                mean: averaging.back(mean_of_seeds),
                band,
            });
            if averaging.smooth > 0 {
                self.raw.push((x, averaging.back(mean(&raw))));
            }
            for (single, &value) in self.singles.iter_mut().zip(&smooth) {
                single.points.push((x, averaging.back(value)));
            }
        }
    }
}

/// The ends of the band of `samples`, one per seed, around their mean `center`; `None` for one
/// seed, and where no band is asked for.
fn band(samples: &[f64], center: f64, band: Band, env_steps: u64) -> Option<(f64, f64)> {
    if samples.len() < 2 {
        return None;
    }
    match band {
        Band::T if samples.len() < SEEDS_FOR_T => Some(
            samples
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
                    (a.min(x), b.max(x))
                }),
        ),
        Band::T => t_interval(samples, CONFIDENCE).map(|interval| (interval.low, interval.high)),
        Band::Std => {
            let squares: f64 = samples.iter().map(|x| (x - center).powi(2)).sum();
            let std = (squares / (samples.len() as f64 - 1.0)).sqrt();
            Some((center - std, center + std))
        }
        Band::Bootstrap => {
            let bootstrap = Bootstrap {
                resamples: RESAMPLES,
                confidence: CONFIDENCE,
            };
            // The seed gives a point the same numbers whatever else is drawn.
            let mut rng = RngSeed(env_steps).stream(Stream::Bootstrap, 0);
            let of_resample = |strata: &[Vec<f64>]| vec![mean(&strata[0])];
            bootstrap
                .estimate(&[samples], &mut rng, of_resample)?
                .first()
                .map(|estimate| (estimate.low, estimate.high))
        }
        Band::Seeds => None,
    }
}

/// The bins in which all seeds of a curve are averaged, so that their points meet.
#[derive(Debug, Clone, Copy)]
struct Bins {
    /// The width of a bin, environment steps; 0 where every iteration is a point.
    width: u64,
}

impl Bins {
    fn of<'a>(recordings: impl Iterator<Item = &'a Recording>, y: Measure) -> Self {
        let columns = recordings.filter(|_| y != Measure::Return);
        let columns = columns.filter_map(|recording| recording.progress.get(&progress::ENV_STEPS));
        let longest = columns
            .max_by_key(|steps| steps.len())
            .filter(|steps| steps.len() > BINS);
        let end = longest
            .into_iter()
            .flatten()
            .flatten()
            .fold(0.0, |end: f64, &steps| end.max(steps));
        Self {
            width: (end / BINS as f64).ceil() as u64,
        }
    }
}

/// The columns of progress that the values of `y` are made from.
pub fn columns_of(y: Measure) -> Vec<&'static Column<Iteration>> {
    match y {
        Measure::Return => Vec::new(),
        Measure::Column(column) => vec![&progress::ENV_STEPS, column],
    }
}

/// One seed's values of `y` over environment steps.
pub fn seed_values(recording: &Recording, y: Measure) -> Vec<(u64, f64)> {
    values(
        recording,
        y,
        Bins::of(std::iter::once(recording), y),
        u64::MAX,
    )
}

/// One seed's values of `y` without averaging: one per iteration, or one mean per evaluation.
pub fn values_of(recording: &Recording, y: Measure) -> Vec<(u64, f64)> {
    values(recording, y, Bins { width: 0 }, u64::MAX)
}

/// One seed's values of `y` in the bins that all seeds share, up to `end`.
fn values(recording: &Recording, y: Measure, bins: Bins, end: u64) -> Vec<(u64, f64)> {
    let Measure::Column(column) = y else {
        let mut evaluations: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        for episode in recording
            .evaluations
            .iter()
            .filter(|episode| episode.env_steps <= end)
        {
            evaluations
                .entry(episode.env_steps)
                .or_default()
                .push(episode.dense_return);
        }
        return evaluations
            .into_iter()
            .map(|(env_steps, returns)| (env_steps, mean(&returns)))
            .collect();
    };
    let progress = &recording.progress;
    let (Some(steps), Some(column)) = (progress.get(&progress::ENV_STEPS), progress.get(column))
    else {
        return Vec::new();
    };
    let rows = steps
        .iter()
        .zip(column)
        .filter_map(|(&steps, &value)| Some((steps? as u64, value?)));
    if bins.width == 0 {
        return rows.filter(|&(steps, _)| steps <= end).collect();
    }
    let mut binned: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    // Bins include their upper end, so that the last step of a budget does not open another bin.
    for (steps, value) in rows {
        binned
            .entry(steps.saturating_sub(1) / bins.width)
            .or_default()
            .push(value);
    }
    // A bin that is not full yet does not count.
    let full = binned
        .into_iter()
        .filter(|(bin, _)| end == u64::MAX || (bin + 1).saturating_mul(bins.width) <= end);
    full.map(|(bin, values)| (bin * bins.width + bins.width / 2, mean(&values)))
        .collect()
}

/// One seed's values on the scale of the statistics, each replaced by the mean of those around it.
/// The window reaches equally far to both sides, up to `smooth`: less far at the ends, and never
/// across a value that cannot be drawn.
fn smoothed(seed: &[(u64, f64)], averaging: Averaging) -> Vec<f64> {
    let half = averaging.smooth / 2;
    let stretches =
        seed.chunk_by(|left, right| averaging.drawable(left.1) && averaging.drawable(right.1));
    stretches
        .flat_map(|stretch| {
            let (first, last) = (stretch[0].0, stretch[stretch.len() - 1].0);
            stretch.iter().map(move |&(x, _)| {
                let reach = half.min(x - first).min(last - x);
                let near = stretch
                    .iter()
                    .skip_while(|point| point.0 < x - reach)
                    .take_while(|point| point.0 <= x + reach);
                let near: Vec<f64> = near.map(|point| averaging.there(point.1)).collect();
                mean(&near)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests;
