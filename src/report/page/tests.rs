//! What the page must keep to whatever it shows; how it is used, `tests/report/browse.py` tries in
//! a browser.

use super::*;
use crate::{
    measured::Measure,
    plan,
    report::{
        curve::{Curve, CurveData, Panel, Point},
        figure::PALETTE,
        identity::Identities,
    },
    spec::{self, Overrides},
};

fn experiment(text: &str) -> ExperimentSpec {
    let whole = format!("name = \"made-up\"\ndescription = \"d\"\nbudget.env_steps = 4096\n{text}");
    spec::parse(Path::new("made-up.toml"), &whole, &Overrides::default()).expect("a valid file")
}

const MATRIX: &str = "[[matrix]]\nseed = [0, 1]\nenv = [\"Hopper-v2\"]\n\
    algorithm = [\"mcpo\", \"ppo\"]\n\
    [[figures]]\nname = \"f\"\ntitle = \"F\"\ny = \"return\"\nseries = [\"algorithm\"]\n";

/// The page of `runs`, each curve with so many points where that is said.
fn page(runs: &[Run], points: Option<u64>) -> String {
    let spec = experiment(MATRIX);
    let all: Vec<&Run> = runs.iter().collect();
    let mut data = CurveData::new(
        &spec.figures[0],
        Measure::Return,
        &all,
        &Identities::new(&all),
    );
    for curve in data
        .panels
        .iter_mut()
        .flat_map(|panel| panel.curves.iter_mut().flatten())
    {
        let (Some(points), Some(&point)) = (points, curve.points.first()) else {
            continue;
        };
        curve.points = (0..points)
            .map(|n| super::super::Point {
                env_steps: n as f64,
                ..point
            })
            .collect();
    }
    let shows = Shows::Curves(Box::new(data));
    let figure = Figure {
        name: "f",
        title: "F",
        caption: String::new(),
        shows,
        files: vec![".svg"],
    };
    html(&Contents {
        spec: &spec,
        home: Path::new("nowhere/made-up"),
        command: "mcpo-run report made-up.toml".to_owned(),
        state: &["4 of 4 runs finished.".to_owned()],
        runs,
        claims: None,
        tables: Vec::new(),
        settings: Vec::new(),
        statistics: None,
        figures: vec![figure],
    })
}

fn runs() -> Vec<Run> {
    let plan = plan::plan(&experiment(MATRIX)).expect("a plan");
    let finished =
        |spec| Run::new(spec, State::Missing).finished(&[(50, &[-0.25]), (100, &[1234.5678])]);
    plan.into_iter().map(finished).collect()
}

#[test]
fn nothing_but_the_head_says_what_the_page_may_do() {
    let page = page(&runs(), None);
    assert_eq!(page.matches("Content-Security-Policy").count(), 1);
    assert!(page.contains("default-src 'none'"), "{page}");
    let (markup, _) = page.split_once("<script").expect("a script");
    let (_, markup) = markup.split_once("</style>").expect("a style");
    for refused in [
        " style=", " onclick", " onload", "http://", "https://", "url(",
    ] {
        assert!(
            !markup.contains(refused),
            "the policy refuses {refused}: {markup}"
        );
    }
}

#[test]
fn the_numbers_beside_a_figure_have_five_digits_and_are_whole_json() {
    let page = page(&runs(), None);
    let (_, json) = page.split_once("id=\"data\">").expect("data");
    let (json, _) = json.split_once("</script>").expect("it ends");
    let data: serde_json::Value = serde_json::from_str(json).expect("JSON");
    let curve = &data[0]["panels"][0]["curves"][0];
    assert_eq!(curve["mean"], serde_json::json!([-0.25, 1234.6]));
    assert_eq!(
        curve["seeds"],
        serde_json::json!([[0, [-0.25, 1234.6]], [1, [-0.25, 1234.6]]]),
        "{curve}"
    );
}

#[test]
fn a_page_stays_small_whatever_is_drawn() {
    let (few, many) = (page(&runs(), Some(100)), page(&runs(), Some(400_000)));
    assert!(!few.contains("points of each curve"));
    assert!(
        many.contains("Here, one of "),
        "it is said that points are left out"
    );
    assert!(many.len() < 5_000_000, "{} bytes", many.len());
}

#[test]
fn a_paper_s_value_far_from_the_curves_is_an_arrow_and_none_stands_beside_nothing() {
    let point = |env_steps: f64, mean: f64| Point {
        env_steps,
        mean,
        band: None,
    };
    let mut curve = Curve {
        points: vec![point(0.0, 100.0), point(1.0, 300.0)],
        seeds: 5,
        planned: 5,
        paper: Some(-5477.0),
        ..Curve::default()
    };
    let shown = |curve: &Curve| {
        let panel = Panel {
            title: "Ant-v2".into(),
            curves: vec![Some(curve.clone())],
            demo: None,
        };
        let data = CurveData {
            looks: vec![0],
            panels: vec![panel],
            ..CurveData::default()
        };
        figure::panel_html(&data, 0, &data.panels[0], 1)
    };
    assert!(shown(&curve).contains("paper-beyond"));
    curve.paper = Some(250.0);
    let within = shown(&curve);
    assert!(within.contains("paper-value") && !within.contains("paper-beyond"));
    curve.points.clear();
    curve.paper = Some(-5477.0);
    let empty = shown(&curve);
    assert!(empty.contains("nothing to draw yet") && !empty.contains("class=\"paper-"));
}

#[test]
fn every_state_has_its_mark_and_its_row() {
    let mut runs = runs();
    runs[1] = Run::new(runs[1].spec.clone(), State::Missing).failed("a < b & `code`");
    runs[2] = Run::new(
        runs[2].spec.clone(),
        State::Differs {
            changes: vec!["mcpo.d: 1 -> 2".to_owned()],
        },
    );
    runs[3] = Run::new(runs[3].spec.clone(), State::Missing);
    let page = page(&runs, None);
    for told in [
        "✓</span> 1 finished",
        "✕</span> 1 failed",
        "≠</span> 1 left out",
        "·</span> 1 to do",
    ] {
        assert!(page.contains(told), "{told}: {page}");
    }
    assert!(
        page.contains("<p>a &lt; b &amp; <code>code</code></p>"),
        "{page}"
    );
    assert!(
        (0..4).all(|n| page.contains(&format!("href=\"#r{n}\""))
            && page.contains(&format!("<tr id=\"r{n}\"")))
    );
}

/// A series has the same colour on the page as in the other files.
#[test]
fn the_colours_are_the_figures() {
    let light = STYLE.split("@media").next().expect("a style");
    for (look, [red, green, blue]) in PALETTE.iter().enumerate() {
        let rule = format!(".c{look} {{ --c: #{red:02x}{green:02x}{blue:02x}; }}");
        assert!(light.contains(&rule), "{rule}");
    }
}
