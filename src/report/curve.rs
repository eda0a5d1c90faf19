//! Learning curves as numbers, before anything is drawn.
//!
//! Owns the mean and interval over seeds at each point. Knows nothing of pixels or files. Start at [`CurveData::new`].
//!
//! A seed's value at a point is the mean over that evaluation's episodes, or over the iterations of a bin of `progress`.
//! Seeds are the samples of the interval, never episodes. A point exists only where every finished seed of its series
//! has a value, so that a curve never jumps because a seed is missing; what was left out for that is counted. Where a value
//! cannot be drawn (it is no finite number, or not above 0 on a logarithmic axis) the curve has a gap.

use std::collections::BTreeMap;

use crate::{spec::Figure, stats::t_interval};

use super::{
    axis::{self, Label},
    counterpart::Counterpart,
    recorded::{Recording, Run, demonstrated_return},
};

/// A column of `progress.parquet` is averaged in this many bins when it has more iterations.
const BINS: usize = 240;

/// Seeds below which a band is their range: the t interval of two is 12.7 standard errors wide, and hides the figure.
pub const SEEDS_FOR_BAND: usize = 3;

/// The confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// One figure.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveData {
    /// Above the panels.
    pub title: String,
    /// What the y axis shows, with its unit.
    pub y_label: String,
    /// Whether the y axis is logarithmic; then means and intervals are of log10, and the mean is geometric.
    pub log_y: bool,
    /// The column that is drawn, as the file names it.
    pub y: String,
    /// What curves are told apart by: the keys of the series' values.
    pub keys: Vec<String>,
    /// The legend, in order; a curve's index is the same in all panels.
    pub series: Vec<Label>,
    /// One panel an environment.
    pub panels: Vec<Panel>,
}

/// The curves of one environment.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The environment.
    pub title: String,
    /// One entry a series; `None` where the matrix has no such run.
    pub curves: Vec<Option<Curve>>,
    /// The return of the demonstration that the runs learned from, for figures of returns.
    pub demo: Option<f64>,
}

/// One series in one panel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// In ascending order of environment steps.
    pub points: Vec<Point>,
    /// Finished runs behind every point.
    pub seeds: usize,
    /// Runs that the plan has.
    pub planned: usize,
    /// Environment steps at which the curve is broken.
    pub gaps: Vec<f64>,
    /// Points that do not exist, and why.
    pub left_out: LeftOut,
    /// The paper's return at the end of training.
    pub paper: Option<f64>,
    /// The tolerance d_k over environment steps, for figures of the MMD.
    pub tolerance: Vec<(f64, f64)>,
}

/// Points that a curve does not have, by the first reason that holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// A finished seed's value is no finite number; a gap.
    pub not_finite: usize,
    /// A finished seed's value is not above 0, on a logarithmic axis; a gap.
    pub not_positive: usize,
    /// A finished seed has no value there.
    pub absent: usize,
}

/// One point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Environment steps of training.
    pub env_steps: f64,
    /// Mean over the seeds.
    pub mean: f64,
    /// 95 % Student t interval of the mean from three seeds on; of two, from the one to the other; `None` for one.
    pub band: Option<(f64, f64)>,
}

impl CurveData {
    /// The curves of `figure` over `runs`, which are those that its `only` selects, in the plan's order.
    pub fn new(figure: &Figure, runs: &[&Run]) -> Self {
        let y = match figure.y.as_str() {
            "d" => "d_k", // the tolerance in force; the column `d` is the key, where it starts
            y => y,
        };
        let mut keys: Vec<String> = figure.series.iter().filter(|key| *key != "env").cloned().collect();
        let with_env: Vec<String> = keys.iter().cloned().chain(["env".to_owned()]).collect();
        keys.extend(axis::hidden_axes(runs, &with_env));
        keys.sort_by_key(|key| key != "algorithm"); // it names a curve best
        let series = axis::group(runs, &keys);
        let ablates = keys.iter().any(|key| key == "d" || key == "epsilon");
        let panels = axis::group(runs, &["env".to_owned()]).into_iter().map(|panel| {
            let env = panel.runs[0].spec.env.name();
            let curve = |series: &axis::Group<'_>| {
                let runs: Vec<&Run> = series.runs.iter().copied().filter(|run| run.spec.env.name() == env).collect();
                (!runs.is_empty()).then(|| Curve::new(y, figure.log_y, &runs, ablates))
            };
            Panel {
                title: env.to_owned(),
                curves: series.iter().map(curve).collect(),
                demo: demonstrated_return(&panel.runs).filter(|_| y == "return"),
            }
        });
        Self {
            title: figure.title.clone(),
            y_label: y_label(y),
            log_y: figure.log_y,
            y: figure.y.clone(),
            series: axis::labels(&keys, &series),
            panels: panels.collect(),
            keys,
        }
    }
}

impl Curve {
    fn new(y: &str, log: bool, runs: &[&Run], ablates: bool) -> Self {
        let finished: Vec<&Recording> = runs.iter().filter_map(|run| run.recording()).collect();
        let seeds: Vec<_> = finished.iter().map(|recording| seed_values(recording, y)).collect();
        let OverSeeds { points, gaps, left_out } = OverSeeds::new(&seeds, log);
        let paper = match y {
            "return" => Counterpart::of(runs, ablates).value.map(|value| value.mean),
            _ => None,
        };
        let tolerance = match y {
            "mmd" | "mmd_after" => {
                let seeds: Vec<_> = finished.iter().map(|recording| seed_values(recording, "d_k")).collect();
                OverSeeds::new(&seeds, log).points.iter().map(|point| (point.env_steps, point.mean)).collect()
            }
            _ => Vec::new(),
        };
        Self { points, gaps, left_out, seeds: finished.len(), planned: runs.len(), paper, tolerance }
    }

    /// The points between gaps, in order.
    pub fn stretches(&self) -> impl Iterator<Item = &[Point]> {
        self.points.chunk_by(|left, right| !self.gaps.iter().any(|gap| (left.env_steps..right.env_steps).contains(gap)))
    }

    /// The value of what takes no steps of training, and has one value at all of them.
    pub fn level(&self) -> Option<&Point> {
        match self.points.as_slice() {
            [point] if point.env_steps == 0.0 => Some(point),
            _ => None,
        }
    }
}

/// One seed's values over environment steps.
pub fn seed_values(recording: &Recording, y: &str) -> Vec<(u64, f64)> {
    if y == "return" {
        let mut evaluations: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        for episode in &recording.evaluations {
            evaluations.entry(episode.env_steps).or_default().push(episode.dense_return);
        }
        return evaluations.into_iter().map(|(env_steps, returns)| (env_steps, mean(&returns))).collect();
    }
    let (Some(steps), Some(column)) = (recording.progress.get("env_steps"), recording.progress.get(y)) else {
        return Vec::new();
    };
    let rows = steps.iter().zip(column).filter_map(|(&steps, &value)| Some((steps? as u64, value?)));
    if steps.len() <= BINS {
        return rows.collect();
    }
    let end = steps.iter().flatten().fold(0.0, |end: f64, &steps| end.max(steps));
    let width = ((end / BINS as f64).ceil() as u64).max(1);
    let mut bins: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for (steps, value) in rows {
        bins.entry(steps.saturating_sub(1) / width).or_default().push(value);
    }
    bins.into_iter().map(|(bin, values)| (bin * width + width / 2, mean(&values))).collect()
}

/// The points at which all seeds have a value, and what becomes of the others.
struct OverSeeds {
    points: Vec<Point>,
    gaps: Vec<f64>,
    left_out: LeftOut,
}

impl OverSeeds {
    /// With `log`, statistics are of log10, and a value that is not positive cannot be drawn.
    fn new(seeds: &[Vec<(u64, f64)>], log: bool) -> Self {
        let mut values: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        for &(env_steps, value) in seeds.iter().flatten() {
            values.entry(env_steps).or_default().push(value);
        }
        let mut all = Self { points: Vec::new(), gaps: Vec::new(), left_out: LeftOut::default() };
        for (env_steps, mut samples) in values {
            let env_steps = env_steps as f64;
            if log && samples.iter().any(|&value| value <= 0.0) {
                all.left_out.not_positive += 1;
                all.gaps.push(env_steps);
                continue;
            }
            if log {
                samples.iter_mut().for_each(|value| *value = value.log10());
            }
            // The sum too: finite numbers can have an infinite one.
            if !samples.iter().sum::<f64>().is_finite() {
                all.left_out.not_finite += 1;
                all.gaps.push(env_steps);
            } else if samples.len() < seeds.len() {
                all.left_out.absent += 1;
            } else {
                all.points.extend(point(env_steps, &samples, log));
            }
        }
        all
    }
}

/// The mean of `samples`, one a seed, with its band; back from log10 with `log`.
fn point(env_steps: f64, samples: &[f64], log: bool) -> Option<Point> {
    let back = |value: f64| if log { 10_f64.powf(value) } else { value };
    let interval = t_interval(samples, CONFIDENCE)?;
    let (low, high) = match samples.len() < SEEDS_FOR_BAND {
        true => samples.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x))),
        false => (interval.low, interval.high),
    };
    let band = (samples.len() > 1).then(|| (back(low), back(high)));
    Some(Point { env_steps, mean: back(interval.mean), band })
}

fn y_label(y: &str) -> String {
    match y {
        "return" => "return (dense reward)".to_owned(),
        "training_return" => "return (training reward)".to_owned(),
        "dense_return" => "return while training (dense reward)".to_owned(),
        "mmd" | "mmd_after" => "MMD² to the demonstration".to_owned(),
        "kl" => "KL of the update (nats)".to_owned(),
        "entropy" => "entropy (nats)".to_owned(),
        "d_k" => "tolerance d".to_owned(),
        "episode_length" => "episode length (steps)".to_owned(),
        "rollout_seconds" => "rollout (s)".to_owned(),
        "update_seconds" => "update (s)".to_owned(),
        other => other.replace('_', " "),
    }
}

/// The arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    fn figure(y: &str, log_y: bool) -> Figure {
        Figure { name: "f".into(), title: "t".into(), y: y.into(), series: vec!["d".into()], only: None, log_y }
    }

    fn curves(figure: &Figure, runs: &[Run]) -> CurveData {
        CurveData::new(figure, &runs.iter().collect::<Vec<_>>())
    }

    fn close(left: f64, right: f64) -> bool {
        (left - right).abs() <= 1e-9 * right.abs().max(1.0)
    }

    #[test]
    fn a_column_that_was_not_recorded_has_no_points() {
        let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(10, &[1.0])]).progress("mmd", &[(10, 0.5)]);
        let data = curves(&figure("cloning_loss", false), &[run]);
        let curve = data.panels[0].curves[0].as_ref().expect("planned");
        assert_eq!((curve.seeds, curve.points.len(), curve.left_out), (1, 0, LeftOut::default()));
    }

    #[test]
    fn a_value_that_cannot_be_drawn_breaks_the_curve_and_keeps_its_seed() {
        for bad in [f64::NAN, f64::INFINITY] {
            let runs = [0, 1].map(|seed| {
                let middle = if seed == 0 { bad } else { 2.0 };
                let returns: [(u64, &[f64]); 4] = [(10, &[1.0]), (20, &[3.0]), (30, &[middle]), (40, &[9.0])];
                fixture::mcpo("Hopper-v2", 1e-4, 1e-3, seed).finished(&returns)
            });
            let data = curves(&figure("return", false), &runs);
            let curve = data.panels[0].curves[0].as_ref().expect("a curve");
            let stretches: Vec<Vec<f64>> =
                curve.stretches().map(|points| points.iter().map(|point| point.env_steps).collect()).collect();
            assert_eq!(stretches, [vec![10.0, 20.0], vec![40.0]]);
            assert_eq!((curve.seeds, curve.left_out), (2, LeftOut { not_finite: 1, ..LeftOut::default() }));
        }
    }

    #[test]
    fn a_point_where_a_seed_has_no_evaluation_is_left_out_and_counted() {
        let runs = [
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(10, &[1.0]), (20, &[3.0]), (30, &[9.0])]),
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1).finished(&[(10, &[2.0]), (30, &[11.0])]),
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 2).failed("diverged"),
        ];
        let data = curves(&figure("return", false), &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        assert_eq!(
            curve.points.iter().map(|point| (point.env_steps, point.mean)).collect::<Vec<_>>(),
            [(10.0, 1.5), (30.0, 10.0)]
        );
        assert_eq!((curve.seeds, curve.planned, curve.left_out), (2, 3, LeftOut { absent: 1, ..LeftOut::default() }));
        assert_eq!(curve.stretches().count(), 1, "what was not measured is no gap");
    }

    #[test]
    fn seeds_are_the_samples_and_episodes_are_averaged_first() {
        let runs = [
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(10, &[0.0, 2.0])]),
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1).finished(&[(10, &[3.0, 3.0])]),
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 2).finished(&[(10, &[4.0, 6.0])]),
        ];
        let data = curves(&figure("return", false), &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        // Samples 1, 3 and 5: mean 3, standard error 2 / sqrt(3), and t(0.975, 2) = 4.302652730.
        let (half, band) = (4.302652729749464 * 2.0 / 3f64.sqrt(), curve.points[0].band.expect("a band"));
        assert!(close(curve.points[0].mean, 3.0) && close(band.0, 3.0 - half) && close(band.1, 3.0 + half), "{band:?}");
        assert_eq!(curve.paper, Some(1897.69));
    }

    #[test]
    fn the_line_of_the_demonstration_is_that_of_the_runs_not_the_papers() {
        let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(10, &[1.0])]).progress("kl", &[(10, 1.0)]);
        let demo = |y, run: &Run| curves(&figure(y, false), std::slice::from_ref(run)).panels[0].demo;
        assert_eq!(demo("return", &run), None, "it is not recorded");
        let run = run.demonstrated(Some("a"), Some(974.5));
        assert_eq!((demo("return", &run), demo("kl", &run)), (Some(974.5), None));
    }

    #[test]
    fn the_band_of_two_seeds_is_their_range() {
        let runs = [
            fixture::ppo("Hopper-v2", 0).finished(&[(10, &[7.0])]),
            fixture::ppo("Hopper-v2", 1).finished(&[(10, &[4.0, 6.0])]),
        ];
        let data = curves(&figure("return", false), &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        assert_eq!(curve.points, [Point { env_steps: 10.0, mean: 6.0, band: Some((5.0, 7.0)) }]);
    }

    #[test]
    fn one_seed_has_no_band() {
        let runs = [fixture::ppo("Hopper-v2", 0).finished(&[(10, &[4.0, 6.0])])];
        let data = curves(&figure("return", false), &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        assert_eq!(curve.points, [Point { env_steps: 10.0, mean: 5.0, band: None }]);
    }

    #[test]
    fn on_a_log_axis_the_mean_is_geometric_and_nothing_below_zero_counts() {
        let runs = [
            fixture::mcpo("Hopper-v2", 1e-4, 0.0, 0).finished(&[]).progress("mmd", &[(10, 1e-2), (20, 1e-3)]),
            fixture::mcpo("Hopper-v2", 1e-4, 0.0, 1).finished(&[]).progress("mmd", &[(10, 1e-4), (20, -1e-9)]),
        ];
        let data = curves(&figure("mmd", true), &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        assert_eq!((curve.points.len(), curve.left_out.not_positive, curve.gaps.as_slice()), (1, 1, &[20.0][..]));
        assert!(close(curve.points[0].mean, 1e-3));
    }

    #[test]
    fn many_iterations_are_averaged_in_bins() {
        let rows: Vec<(u64, f64)> = (1..=480).map(|row| (row * 10, row as f64)).collect();
        let run = fixture::mcpo("Hopper-v2", 1e-4, 0.0, 0).finished(&[]).progress("kl", &rows);
        let data = curves(&figure("kl", false), &[run]);
        let points = &data.panels[0].curves[0].as_ref().expect("a curve").points;
        assert_eq!(points.len(), 240);
        // The first bin of 20 steps holds rows 1 and 2.
        assert_eq!((points[0].env_steps, points[0].mean), (10.0, 1.5));
        assert_eq!((points[239].env_steps, points[239].mean), (4790.0, 479.5));
    }

    #[test]
    fn series_are_the_same_in_all_panels_and_absent_where_there_is_no_run() {
        let runs = [
            fixture::mcpo("Hopper-v2", 1e-4, 0.0, 0).finished(&[(10, &[1.0])]),
            fixture::mcpo("Ant-v2", 1e-4, 0.0, 0).finished(&[(10, &[1.0])]),
            fixture::ppo("Ant-v2", 0),
        ];
        let data = curves(&figure("return", false), &runs);
        let series: Vec<&str> = data.series.iter().map(|label| label.text.as_str()).collect();
        assert_eq!(series, ["MCPO, d = 10⁻⁴", "PPO"]);
        assert_eq!(data.panels.iter().map(|panel| panel.title.as_str()).collect::<Vec<_>>(), ["Hopper-v2", "Ant-v2"]);
        assert!(data.panels[0].curves[1].is_none());
        let ppo = data.panels[1].curves[1].as_ref().expect("planned");
        assert_eq!((ppo.seeds, ppo.planned, ppo.points.len()), (0, 1, 0));
    }
}
