//! Learning curves as numbers, before anything is drawn.
//!
//! Owns which runs make which curve in which panel. Knows nothing of pixels or files; the mean over seeds is `over_seeds`'. Start
//! at [`CurveData::new`].

use std::collections::BTreeSet;

use crate::spec::{Band, Figure, Panels};

use super::{
    ReportError,
    axis::{self, Label},
    counterpart::Counterpart,
    identity::Identities,
    notes,
    over_seeds::{Averaging, OverSeeds, Seed, drawn},
    recorded::{Run, demonstrated_return},
};
use crate::plan::Selection;

/// The confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// One figure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurveData {
    /// Above the panels.
    pub title: String,
    /// What the y axis shows, with its unit.
    pub y_label: String,
    /// Whether the y axis is logarithmic; then means and intervals are of log10, and the mean is geometric.
    pub log_y: bool,
    /// The column that is drawn, as the file names it.
    pub y: String,
    /// What panels are told apart by: an axis, or `panel` where they are selections.
    pub panel_key: String,
    /// What curves are told apart by: the keys of the series' values.
    pub keys: Vec<String>,
    /// The legend, in order; a curve's index is the same in all panels.
    pub series: Vec<Label>,
    /// How each series looks: its place among all looks.
    pub looks: Vec<usize>,
    /// The panels, in order.
    pub panels: Vec<Panel>,
    /// What is drawn of the seeds.
    pub band: Band,
    /// Environment steps over which each seed is averaged.
    pub smooth: Option<u64>,
    /// The width in print, inches; for the screen when absent.
    pub width: Option<f64>,
}

/// The curves of one panel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    /// The environment, or another value that all of its runs share.
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
    /// The means before they were smoothed; empty where nothing is.
    pub raw: Vec<(f64, f64)>,
    /// Each seed's own values at the points, where they are asked for.
    pub singles: Vec<Vec<(f64, f64)>>,
    /// Runs behind every point.
    pub seeds: usize,
    /// Runs that the plan has.
    pub planned: usize,
    /// How far the runs that are drawn have come, where one of them has not ended.
    pub under_way: Option<UnderWay>,
    /// Environment steps at which the curve is broken.
    pub gaps: Vec<f64>,
    /// Points that do not exist, and why.
    pub left_out: LeftOut,
    /// The paper's return at the end of training.
    pub paper: Option<f64>,
    /// The tolerance d_k over environment steps, for figures of the MMD.
    pub tolerance: Vec<(f64, f64)>,
}

/// How far a curve goes whose runs have not all ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnderWay {
    /// Environment steps that all of its runs have taken.
    pub steps: u64,
    /// Environment steps that they are to take.
    pub of: u64,
}

/// Points that a curve does not have, by the first reason that holds.
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
    /// Environment steps of training.
    pub env_steps: f64,
    /// Mean over the seeds.
    pub mean: f64,
    /// The ends of its band, as [`Band`] says; `None` for one seed.
    pub band: Option<(f64, f64)>,
}

impl CurveData {
    /// The curves of `figure` over `runs`, which are those that its `only` selects, in the plan's order.
    ///
    /// Errors: a panel's selection cannot be understood.
    pub fn new(figure: &Figure, runs: &[&Run], identities: &Identities) -> Result<Self, ReportError> {
        let y = match figure.y.as_str() {
            "d" => "d_k", // the tolerance in force; the column `d` is the key, where it starts
            y => y,
        };
        let panel_axes: Vec<String> = match &figure.panels {
            Panels::Axis(axis) => vec![axis.clone()],
            Panels::Selections(_) => Vec::new(),
        };
        let mut keys: Vec<String> = figure.series.iter().filter(|key| !panel_axes.contains(key)).cloned().collect();
        keys.extend(axis::hidden_axes(runs, &[keys.as_slice(), &panel_axes].concat()));
        keys.sort_by_key(|key| key != "algorithm"); // it names a curve best
        if keys.is_empty() {
            keys.push("algorithm".to_owned()); // a curve alone has a name too
        }
        let series = axis::group(runs, &keys);
        let panels = panels(&figure.panels, runs)?.into_iter().map(|(title, runs)| {
            let inside: BTreeSet<&str> = runs.iter().map(|run| run.spec.id.as_str()).collect();
            let curve = |series: &axis::Group<'_>| {
                let within = |run: &&Run| inside.contains(run.spec.id.as_str());
                let runs: Vec<&Run> = series.runs.iter().copied().filter(within).collect();
                (!runs.is_empty()).then(|| Curve::new(y, figure, &runs))
            };
            Panel {
                title,
                curves: series.iter().map(curve).collect(),
                demo: demonstrated_return(&runs).filter(|_| y == "return"),
            }
        });
        let panels = panels.collect();
        Ok(Self {
            title: figure.title.clone(),
            y_label: y_label(y),
            log_y: figure.log_y,
            y: figure.y.clone(),
            panel_key: panel_axes.first().map_or("panel", String::as_str).to_owned(),
            series: axis::labels(&keys, &series),
            looks: identities.looks(series.iter().map(|series| series.runs[0])),
            panels,
            keys,
            band: figure.band,
            smooth: figure.smooth.map(|steps| steps.get()),
            width: figure.width.map(|width| width.inches()),
        })
    }
}

/// The titles of the panels of `runs`, and the runs in each.
fn panels<'a>(panels: &Panels, runs: &[&'a Run]) -> Result<Vec<(String, Vec<&'a Run>)>, ReportError> {
    match panels {
        Panels::Axis(axis) => {
            let keys = std::slice::from_ref(axis);
            let groups = axis::group(runs, keys);
            let titles = axis::labels(keys, &groups);
            Ok(titles.into_iter().zip(groups).map(|(title, group)| (title.text, group.runs)).collect())
        }
        Panels::Selections(texts) => {
            let panel = |text: &String| {
                let selection = Selection::parse(text)?;
                let within = runs.iter().copied().filter(|run| selection.matches(&run.spec));
                Ok((axis::selection_label(&selection), within.collect()))
            };
            texts.iter().map(panel).collect()
        }
    }
}

impl Curve {
    fn new(y: &str, figure: &Figure, runs: &[&Run]) -> Self {
        let all: Vec<Seed<'_>> = runs.iter().filter_map(|run| Seed::of(run)).collect();
        let seeds = drawn(&all);
        let averaging =
            Averaging { log: figure.log_y, band: figure.band, smooth: figure.smooth.map_or(0, |steps| steps.get()) };
        let OverSeeds { points, raw, singles, gaps, left_out } = OverSeeds::new(&seeds, y, averaging);
        let paper = match (y, figure.reference.as_deref()) {
            ("return", Some(reference)) => Counterpart::of(runs, reference == "table5").value.map(|value| value.mean),
            _ => None,
        };
        let tolerance = match y {
            "mmd" | "mmd_after" => {
                let plain = Averaging { smooth: 0, band: Band::T, ..averaging };
                let all = OverSeeds::new(&seeds, "d_k", plain).points;
                all.iter().map(|point| (point.env_steps, point.mean)).collect()
            }
            _ => Vec::new(),
        };
        let under_way = seeds.iter().filter_map(|seed| seed.under_way).min();
        let of = runs.iter().map(|run| run.spec.budget.env_steps.get()).max().unwrap_or(0);
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
        self.points.chunk_by(|left, right| !self.gap_between(left.env_steps, right.env_steps))
    }

    /// Whether the curve is broken from `left` on before `right`.
    pub fn gap_between(&self, left: f64, right: f64) -> bool {
        self.gaps.iter().any(|gap| (left..right).contains(gap))
    }

    /// The value of what takes no steps of training, and has one value at all of them.
    pub fn level(&self) -> Option<&Point> {
        match self.points.as_slice() {
            [point] if point.env_steps == 0.0 => Some(point),
            _ => None,
        }
    }

    /// `3 of 5 seeds, to 400k of 1M steps`, of a curve that lacks seeds or steps.
    pub fn lacking(&self) -> Option<String> {
        let seeds = (self.seeds < self.planned).then(|| format!("{} of {} seeds", self.seeds, self.planned));
        let steps = self
            .under_way
            .map(|UnderWay { steps, of }| format!("to {} of {} steps", notes::steps(steps), notes::steps(of)));
        let parts: Vec<String> = seeds.into_iter().chain(steps).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }
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
        let returns = Figure::returns("f", "t".into());
        Figure { y: y.into(), series: vec!["d".into()], reference: Some("table3".into()), log_y, ..returns }
    }

    fn curves(figure: &Figure, runs: &[Run]) -> CurveData {
        let runs: Vec<&Run> = runs.iter().collect();
        CurveData::new(figure, &runs, &Identities::new(&runs)).expect("selections that are understood")
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

    #[test]
    fn seeds_under_way_are_averaged_as_far_as_all_that_are_drawn_have_come() {
        let folder = tempfile::tempdir().expect("a folder");
        let returns: [(u64, &[f64]); 3] = [(20, &[1.0]), (40, &[2.0]), (60, &[3.0])];
        let at =
            |seed, steps| fixture::ppo("Hopper-v2", seed).finished(&returns).progress("kl", &[(20, 0.1), (steps, 0.2)]);
        fixture::record(&at(0, 100), folder.path());
        fixture::record_under_way(&at(1, 70), folder.path());
        fixture::record_under_way(&at(2, 50), folder.path());
        fixture::record_under_way(&at(3, 5), folder.path());
        let plan: Vec<_> = (0..5).map(|seed| fixture::ppo("Hopper-v2", seed).spec).collect();
        let runs = crate::report::load(&plan, folder.path(), true).expect("good ids").runs;
        let data = curves(&Figure { series: vec!["algorithm".into()], ..figure("return", false) }, &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        // 3 seeds to 50 steps make more than 1 to 100, 2 to 70 or 4 to 5.
        assert_eq!((curve.seeds, curve.under_way), (3, Some(UnderWay { steps: 50, of: 100 })));
        assert_eq!(curve.points.iter().map(|point| point.env_steps).collect::<Vec<_>>(), [20.0, 40.0]);
        assert_eq!(
            (curve.left_out, curve.lacking().as_deref()),
            (LeftOut::default(), Some("3 of 5 seeds, to 50 of 100 steps"))
        );
    }

    #[test]
    fn panels_are_values_of_an_axis_or_selections_which_may_share_runs() {
        let run = |d, epsilon| fixture::mcpo("HalfCheetah-v2", d, epsilon, 0).finished(&[(10, &[1.0])]);
        let runs = [run(1.0, 0.0), run(1e-3, 0.0), run(1e-3, 1e-3)];
        let titles_and_curves = |panels| {
            let keys = vec!["d".to_owned(), "epsilon".to_owned()];
            let data = curves(&Figure { panels, series: keys, ..figure("return", false) }, &runs);
            let drawn = |panel: &Panel| panel.curves.iter().flatten().count();
            data.panels.iter().map(|panel| (panel.title.clone(), drawn(panel))).collect::<Vec<_>>()
        };
        let selections = Panels::Selections(vec!["epsilon=0".into(), "d=0.001".into()]);
        assert_eq!(titles_and_curves(selections), [("ε = 0".to_owned(), 2), ("d = 10⁻³".to_owned(), 2)]);
        let axis = Panels::Axis("d".to_owned());
        assert_eq!(titles_and_curves(axis), [("d = 1".to_owned(), 1), ("d = 10⁻³".to_owned(), 2)]);
    }
}
