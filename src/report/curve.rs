//! Learning curves as numbers, before anything is drawn.
//!
//! Owns which runs make which curve in which panel. Knows nothing of pixels or files; the mean over
//! seeds is `over_seeds`'. Start at [`CurveData::new`].

use std::collections::BTreeSet;

use super::{
    amount,
    axis::{self, Label},
    identity::Identities,
    over_seeds::{Averaging, OverSeeds, Seed, columns_of, drawn},
    paper_value::PaperSide,
    recorded::{Run, demonstrated_return},
};
use crate::{
    measured::{Column, Iteration, Measure, progress},
    spec::{Band, Figure, Key, Panels, Reference, Selection},
};

/// The confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// One figure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveData {
    /// The title above the panels.
    pub title: String,
    /// The quantity on the x axis.
    pub across: Across,
    /// The label of the y axis, with its unit.
    pub y_label: String,
    /// Whether the y axis is logarithmic. If so, means and intervals are of log10, which makes the
    /// mean geometric.
    pub log_y: bool,
    /// The column that is drawn, as the file names it.
    pub y: String,
    /// The key that distinguishes panels: an axis, or `panel` where they are selections.
    pub panel_key: String,
    /// The keys that distinguish curves: those of the series' values.
    pub keys: Vec<Key>,
    /// The legend, in order; a curve's index is the same in all panels.
    pub series: Vec<Label>,
    /// How each series looks: its place among all looks.
    pub looks: Vec<usize>,
    /// The panels, in order.
    pub panels: Vec<Panel>,
    /// How the spread of the seeds is drawn.
    pub band: Band,
    /// Environment steps over which each seed is averaged.
    pub smooth: Option<u64>,
    /// The width in print, inches; for the screen when absent.
    pub width: Option<f64>,
    /// The text of its caption, where that is not the usual one of learning curves.
    pub caption: Option<String>,
}

/// The quantity on an x axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Across {
    /// Environment steps of training, from 0.
    #[default]
    Steps,
    /// Normalised scores, between these two.
    Scores(f64, f64),
}

impl Across {
    /// The label of the axis.
    pub fn label(self) -> &'static str {
        match self {
            Self::Steps => "environment steps",
            Self::Scores(..) => "normalised return",
        }
    }
}

/// The curves of one panel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    /// The environment, or another value that all of its runs share.
    pub title: String,
    /// One entry per series; `None` where the matrix has no such run.
    pub curves: Vec<Option<Curve>>,
    /// The return of the demonstration that the runs learned from, for figures of returns.
    pub demo: Option<f64>,
}

/// One series in one panel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// In ascending order of environment steps.
    pub points: Vec<Point>,
    /// The means before smoothing; empty where nothing is smoothed.
    pub raw: Vec<(f64, f64)>,
    /// Each seed's own values at the points.
    pub singles: Vec<Single>,
    /// The number of runs behind every point.
    pub seeds: usize,
    /// The number of runs in the plan.
    pub planned: usize,
    /// How far the drawn runs have come, where one of them has not ended.
    pub under_way: Option<UnderWay>,
    /// Environment steps at which the curve is broken.
    pub gaps: Vec<f64>,
    /// The number of points that are missing, by reason.
    pub left_out: LeftOut,
    /// The paper's return at the end of training.
    pub paper: Option<f64>,
    /// The tolerance d_k over environment steps, for figures of the MMD.
    pub tolerance: Vec<(f64, f64)>,
}

/// One seed of a curve.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Single {
    /// The run's seed.
    pub seed: u64,
    /// Its values over environment steps.
    pub points: Vec<(f64, f64)>,
}

/// How far a curve goes while some of its runs have not ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnderWay {
    /// Environment steps that all of its runs have reached.
    pub steps: u64,
    /// The budget of its runs, environment steps.
    pub of: u64,
}

/// The number of points that a curve lacks, by the first reason that applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// A seed's value is no finite number; a gap.
    pub not_finite: usize,
    /// A seed's value is not above 0, on a logarithmic axis; a gap.
    pub not_positive: usize,
    /// A seed has no value there.
    pub absent: usize,
}

/// One point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Environment steps of training, or another quantity of the x axis.
    pub env_steps: f64,
    /// Mean over the seeds.
    pub mean: f64,
    /// The ends of its band, as [`Band`] says; `None` for one seed.
    pub band: Option<(f64, f64)>,
}

impl CurveData {
    /// The curves of `y` over `runs`, as `figure` asks for them. `runs` are those that its `only`
    /// selects, in the plan's order.
    pub fn new(figure: &Figure, y: Measure, runs: &[&Run], identities: &Identities) -> Self {
        let panel_axes: Vec<Key> = match &figure.panels {
            Panels::Axis(axis) => vec![axis.clone()],
            Panels::Selections(_) => Vec::new(),
        };
        let mut keys: Vec<Key> = figure
            .series
            .iter()
            .filter(|key| !panel_axes.contains(key))
            .cloned()
            .collect();
        let panels = panels(&figure.panels, runs);
        // Runs that differ in more than their seed are never averaged, so other axes become keys
        // too.
        for (_, inside) in &panels {
            keys.extend(axis::hidden_axes(
                inside,
                &[keys.as_slice(), &panel_axes].concat(),
            ));
        }
        keys.sort_by_key(|key| *key != Key::Algorithm); // it names a curve best
        if keys.is_empty() {
            keys.push(Key::Algorithm); // a curve alone has a name too
        }
        // The groups span all panels, so that a curve has the same index in each.
        let series = axis::group(runs, &keys);
        let panels = panels.into_iter().map(|(title, runs)| {
            let inside: BTreeSet<&str> = runs.iter().map(|run| run.spec.id.as_str()).collect();
            let curve = |series: &axis::Group<'_>| {
                let within = |run: &&Run| inside.contains(run.spec.id.as_str());
                let runs: Vec<&Run> = series.runs.iter().copied().filter(within).collect();
                (!runs.is_empty()).then(|| Curve::new(y, figure, &runs))
            };
            Panel {
                title,
                curves: series.iter().map(curve).collect(),
                demo: demonstrated_return(&runs).filter(|_| y == Measure::Return),
            }
        });
        let panels = panels.collect();
        Self {
            title: figure.title.clone(),
            y_label: y.label(),
            log_y: figure.log_y,
            y: y.name().to_owned(),
            panel_key: panel_axes
                .first()
                .map_or_else(|| "panel".to_owned(), Key::to_string),
            series: axis::labels(&keys, &series),
            looks: identities.looks(series.iter().map(|series| series.runs[0])),
            panels,
            keys,
            band: figure.band,
            smooth: figure.smooth.map(|steps| steps.get()),
            width: figure.width.map(|width| width.inches()),
            across: Across::Steps,
            caption: None,
        }
    }
}

/// The titles of the panels of `runs`, and the runs in each.
fn panels<'a>(panels: &Panels, runs: &[&'a Run]) -> Vec<(String, Vec<&'a Run>)> {
    match panels {
        Panels::Axis(axis) => {
            let keys = std::slice::from_ref(axis);
            let groups = axis::group(runs, keys);
            let titles = axis::labels(keys, &groups);
            titles
                .into_iter()
                .zip(groups)
                .map(|(title, group)| (title.text, group.runs))
                .collect()
        }
        Panels::Selections(selections) => {
            let panel = |selection: &Selection| {
                let within = runs.iter().copied().filter(|run| run.is_in(selection));
                (axis::selection_label(selection), within.collect())
            };
            selections.iter().map(panel).collect()
        }
    }
}

impl Curve {
    fn new(y: Measure, figure: &Figure, runs: &[&Run]) -> Self {
        let all: Vec<Seed<'_>> = runs.iter().filter_map(|run| Seed::of(run)).collect();
        let seeds = drawn(&all);
        let averaging = Averaging {
            log: figure.log_y,
            band: figure.band,
            smooth: figure.smooth.map_or(0, |steps| steps.get()),
        };
        let OverSeeds {
            points,
            raw,
            singles,
            gaps,
            left_out,
        } = OverSeeds::new(&seeds, y, averaging);
        let paper = match (y, figure.reference) {
            (Measure::Return, Some(reference)) => {
                PaperSide::of(runs, reference == Reference::Table5)
                    .value
                    .map(|value| value.mean)
            }
            _ => None,
        };
        let tolerance = if is_bounded(y) {
            // The limit is shown as it was in force, so it is not smoothed. Only its mean is drawn,
            // so its band may be the cheapest.
            let plain = Averaging {
                smooth: 0,
                band: Band::T,
                ..averaging
            };
            let all = OverSeeds::new(&seeds, Measure::Column(&progress::TOLERANCE), plain).points;
            all.iter()
                .map(|point| (point.env_steps, point.mean))
                .collect()
        } else {
            Vec::new()
        };
        // All seeds are averaged as far as the slowest has come.
        let under_way = seeds.iter().filter_map(|seed| seed.under_way).min();
        let of = runs
            .iter()
            .map(|run| run.spec.budget.env_steps.get())
            .max()
            .unwrap_or(0);
        Self {
            points,
            raw,
            singles,
            gaps,
            left_out,
            seeds: seeds.len(),
            planned: runs.len(),
            under_way: under_way.map(|steps| UnderWay { steps, of }),
            paper,
            tolerance,
        }
    }

    /// The points between gaps, in order.
    pub fn stretches(&self) -> impl Iterator<Item = &[Point]> {
        self.points
            .chunk_by(|left, right| !self.gap_between(left.env_steps, right.env_steps))
    }

    /// Whether the curve has a gap from `left` on and before `right`.
    pub fn gap_between(&self, left: f64, right: f64) -> bool {
        self.gaps.iter().any(|gap| (left..right).contains(gap))
    }

    /// The one value of a method that does not train, which holds at every step.
    pub fn level(&self) -> Option<&Point> {
        match self.points.as_slice() {
            [point] if point.env_steps == 0.0 => Some(point),
            _ => None,
        }
    }

    /// The seeds and steps that the curve still lacks, as `3 of 5 seeds, to 400k of 1M steps`;
    /// `None` where it is whole.
    pub fn lacking(&self) -> Option<String> {
        let seeds = (self.seeds < self.planned)
            .then(|| format!("{} of {} seeds", self.seeds, self.planned));
        let steps = self.under_way.map(|UnderWay { steps, of }| {
            format!("to {} of {} steps", amount::steps(steps), amount::steps(of))
        });
        let parts: Vec<String> = seeds.into_iter().chain(steps).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

/// Whether MCPO bounds `y` by its tolerance, which is then drawn beside it.
fn is_bounded(y: Measure) -> bool {
    y.is(&progress::MMD) || y.is(&progress::MMD_AFTER)
}

/// The columns of progress that curves of `y` need.
pub fn columns(y: Measure) -> Vec<&'static Column<Iteration>> {
    let tolerance = is_bounded(y).then_some(&progress::TOLERANCE);
    columns_of(y).into_iter().chain(tolerance).collect()
}

/// The arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests;
