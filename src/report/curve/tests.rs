use super::*;
use crate::{report::fixture, spec::Drawing};

fn figure(y: &str, log_y: bool) -> Figure {
    let returns = Figure::returns("f", "t".into());
    Figure {
        y: Drawing::Of(Measure::parse(y).expect("a column")),
        series: vec!["d".into()],
        reference: Some(Reference::Table3),
        log_y,
        ..returns
    }
}

fn curves(figure: &Figure, runs: &[Run]) -> CurveData {
    let runs: Vec<&Run> = runs.iter().collect();
    CurveData::new(
        figure,
        figure.y.measure().expect("curves"),
        &runs,
        &Identities::new(&runs),
    )
}

fn close(left: f64, right: f64) -> bool {
    (left - right).abs() <= 1e-9 * right.abs().max(1.0)
}

#[test]
fn a_column_that_was_not_recorded_has_no_points() {
    let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0)
        .finished(&[(10, &[1.0])])
        .progress("mmd", &[(10, 0.5)]);
    let data = curves(&figure("cloning_loss", false), &[run]);
    let curve = data.panels[0].curves[0].as_ref().expect("planned");
    assert_eq!(
        (curve.seeds, curve.points.len(), curve.left_out),
        (1, 0, LeftOut::default())
    );
}

#[test]
fn a_value_that_cannot_be_drawn_breaks_the_curve_and_keeps_its_seed() {
    for bad in [f64::NAN, f64::INFINITY] {
        let runs = [0, 1].map(|seed| {
            let middle = if seed == 0 { bad } else { 2.0 };
            let returns: [(u64, &[f64]); 4] =
                [(10, &[1.0]), (20, &[3.0]), (30, &[middle]), (40, &[9.0])];
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, seed).finished(&returns)
        });
        let data = curves(&figure("return", false), &runs);
        let curve = data.panels[0].curves[0].as_ref().expect("a curve");
        let stretches: Vec<Vec<f64>> = curve
            .stretches()
            .map(|points| points.iter().map(|point| point.env_steps).collect())
            .collect();
        assert_eq!(stretches, [vec![10.0, 20.0], vec![40.0]]);
        assert_eq!(
            (curve.seeds, curve.left_out),
            (
                2,
                LeftOut {
                    not_finite: 1,
                    ..LeftOut::default()
                }
            )
        );
    }
}

#[test]
fn a_point_where_a_seed_has_no_evaluation_is_left_out_and_counted() {
    let runs = [
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[
            (10, &[1.0]),
            (20, &[3.0]),
            (30, &[9.0]),
        ]),
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1).finished(&[(10, &[2.0]), (30, &[11.0])]),
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 2).failed("diverged"),
    ];
    let data = curves(&figure("return", false), &runs);
    let curve = data.panels[0].curves[0].as_ref().expect("a curve");
    assert_eq!(
        curve
            .points
            .iter()
            .map(|point| (point.env_steps, point.mean))
            .collect::<Vec<_>>(),
        [(10.0, 1.5), (30.0, 10.0)]
    );
    assert_eq!(
        (curve.seeds, curve.planned, curve.left_out),
        (
            2,
            3,
            LeftOut {
                absent: 1,
                ..LeftOut::default()
            }
        )
    );
    assert_eq!(
        curve.stretches().count(),
        1,
        "what was not measured is no gap"
    );
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
    let (half, band) = (
        4.302652729749464 * 2.0 / 3f64.sqrt(),
        curve.points[0].band.expect("a band"),
    );
    assert!(
        close(curve.points[0].mean, 3.0) && close(band.0, 3.0 - half) && close(band.1, 3.0 + half),
        "{band:?}"
    );
    assert_eq!(curve.paper, Some(1897.69));
}

#[test]
fn the_line_of_the_demonstration_is_that_of_the_runs_not_the_papers() {
    let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0)
        .finished(&[(10, &[1.0])])
        .progress("kl", &[(10, 1.0)]);
    let demo = |y, run: &Run| curves(&figure(y, false), std::slice::from_ref(run)).panels[0].demo;
    assert_eq!(demo("return", &run), None, "it is not recorded");
    let run = run.demonstrated(Some("a"), Some(974.5));
    assert_eq!(
        (demo("return", &run), demo("kl", &run)),
        (Some(974.5), None)
    );
}

#[test]
fn the_band_of_two_seeds_is_their_range() {
    let runs = [
        fixture::ppo("Hopper-v2", 0).finished(&[(10, &[7.0])]),
        fixture::ppo("Hopper-v2", 1).finished(&[(10, &[4.0, 6.0])]),
    ];
    let data = curves(&figure("return", false), &runs);
    let curve = data.panels[0].curves[0].as_ref().expect("a curve");
    assert_eq!(
        curve.points,
        [Point {
            env_steps: 10.0,
            mean: 6.0,
            band: Some((5.0, 7.0))
        }]
    );
}

#[test]
fn one_seed_has_no_band() {
    let runs = [fixture::ppo("Hopper-v2", 0).finished(&[(10, &[4.0, 6.0])])];
    let data = curves(&figure("return", false), &runs);
    let curve = data.panels[0].curves[0].as_ref().expect("a curve");
    assert_eq!(
        curve.points,
        [Point {
            env_steps: 10.0,
            mean: 5.0,
            band: None
        }]
    );
}

#[test]
fn on_a_log_axis_the_mean_is_geometric_and_nothing_below_zero_counts() {
    let runs = [
        fixture::mcpo("Hopper-v2", 1e-4, 0.0, 0)
            .finished(&[])
            .progress("mmd", &[(10, 1e-2), (20, 1e-3)]),
        fixture::mcpo("Hopper-v2", 1e-4, 0.0, 1)
            .finished(&[])
            .progress("mmd", &[(10, 1e-4), (20, -1e-9)]),
    ];
    let data = curves(&figure("mmd", true), &runs);
    let curve = data.panels[0].curves[0].as_ref().expect("a curve");
    assert_eq!(
        (
            curve.points.len(),
            curve.left_out.not_positive,
            curve.gaps.as_slice()
        ),
        (1, 1, &[20.0][..])
    );
    assert!(close(curve.points[0].mean, 1e-3));
}

#[test]
fn many_iterations_are_averaged_in_bins() {
    let rows: Vec<(u64, f64)> = (1..=480).map(|row| (row * 10, row as f64)).collect();
    let run = fixture::mcpo("Hopper-v2", 1e-4, 0.0, 0)
        .finished(&[])
        .progress("kl", &rows);
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
    let series: Vec<&str> = data
        .series
        .iter()
        .map(|label| label.text.as_str())
        .collect();
    assert_eq!(series, ["MCPO, d = 10⁻⁴", "PPO"]);
    assert_eq!(
        data.panels
            .iter()
            .map(|panel| panel.title.as_str())
            .collect::<Vec<_>>(),
        ["Hopper-v2", "Ant-v2"]
    );
    assert!(data.panels[0].curves[1].is_none());
    let ppo = data.panels[1].curves[1].as_ref().expect("planned");
    assert_eq!((ppo.seeds, ppo.planned, ppo.points.len()), (0, 1, 0));
}

#[test]
fn seeds_under_way_are_averaged_as_far_as_all_that_are_drawn_have_come() {
    let folder = tempfile::tempdir().expect("a folder");
    let returns: [(u64, &[f64]); 3] = [(20, &[1.0]), (40, &[2.0]), (60, &[3.0])];
    let at = |seed, steps| {
        fixture::ppo("Hopper-v2", seed)
            .finished(&returns)
            .progress("kl", &[(20, 0.1), (steps, 0.2)])
    };
    fixture::record(&at(0, 100), folder.path());
    fixture::record_under_way(&at(1, 70), folder.path());
    fixture::record_under_way(&at(2, 50), folder.path());
    fixture::record_under_way(&at(3, 5), folder.path());
    let plan: Vec<_> = (0..5)
        .map(|seed| fixture::ppo("Hopper-v2", seed).spec)
        .collect();
    let runs = crate::report::load(&plan, folder.path(), progress::COLUMNS)
        .expect("good ids")
        .runs;
    let data = curves(
        &Figure {
            series: vec!["algorithm".into()],
            ..figure("return", false)
        },
        &runs,
    );
    let curve = data.panels[0].curves[0].as_ref().expect("a curve");
    // 3 seeds to 50 steps make more than 1 to 100, 2 to 70 or 4 to 5.
    assert_eq!(
        (curve.seeds, curve.under_way),
        (3, Some(UnderWay { steps: 50, of: 100 }))
    );
    assert_eq!(
        curve
            .points
            .iter()
            .map(|point| point.env_steps)
            .collect::<Vec<_>>(),
        [20.0, 40.0]
    );
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
        let keys = vec!["d".into(), "epsilon".into()];
        let data = curves(
            &Figure {
                panels,
                series: keys,
                ..figure("return", false)
            },
            &runs,
        );
        let drawn = |panel: &Panel| panel.curves.iter().flatten().count();
        data.panels
            .iter()
            .map(|panel| (panel.title.clone(), drawn(panel)))
            .collect::<Vec<_>>()
    };
    let selections = Panels::Selections(vec!["epsilon=0".into(), "d=0.001".into()]);
    assert_eq!(
        titles_and_curves(selections),
        [("ε = 0".to_owned(), 2), ("d = 10⁻³".to_owned(), 2)]
    );
    let axis = Panels::Axis("d".into());
    assert_eq!(
        titles_and_curves(axis),
        [("d = 1".to_owned(), 1), ("d = 10⁻³".to_owned(), 2)]
    );
}
