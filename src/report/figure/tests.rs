//! What every figure holds to.

use super::{
    axes::y_scale,
    picture::{Anchor, Shape, Text, text_width},
    *,
};
use crate::report::{
    axis::Label,
    curve::{Curve, LeftOut, Panel, Point, UnderWay},
};

/// A curve of `values` with bands.
fn curve(values: &[f64]) -> Curve {
    let points = values.iter().zip(1..).map(|(&mean, step)| {
        let band = Some((mean - 0.1 * mean.abs(), mean + 0.1 * mean.abs()));
        Point {
            env_steps: f64::from(step) * 1e5,
            mean,
            band,
        }
    });
    Curve {
        points: points.collect(),
        seeds: 5,
        planned: 5,
        paper: Some(values[0]),
        ..Curve::default()
    }
}

fn figure(panels: Vec<Panel>, series: usize, name: &str, log_y: bool) -> CurveData {
    let label = |index| Label {
        text: format!("{name} {index}"),
        values: vec![],
    };
    let series: Vec<Label> = (0..series).map(label).collect();
    CurveData {
        title: "A title of a figure".into(),
        y_label: "return (dense reward)".into(),
        log_y,
        y: "return".into(),
        looks: (0..series.len()).collect(),
        series,
        panels,
        ..CurveData::default()
    }
}

fn panel(title: &str, curves: Vec<Option<Curve>>) -> Panel {
    Panel {
        title: title.into(),
        curves,
        demo: Some(500.0),
    }
}

/// Left, right, top and bottom of everything that is written.
fn boxes(picture: &Picture) -> Vec<(String, [f64; 4])> {
    let place = |text: &Text| {
        let width = text_width(&text.text, text.size);
        let start = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        let (x, y) = text.at;
        let (up, down) = (0.73 * text.size, 0.2 * text.size);
        match text.upwards {
            false => [x + start, x + start + width, y - up, y + down],
            true => [x - up, x + down, y - start - width, y - start],
        }
    };
    let texts = picture.shapes.iter().filter_map(|shape| match shape {
        Shape::Text(text) => Some((text.text.clone(), place(text))),
        Shape::Line { .. } | Shape::Area { .. } => None,
    });
    texts.collect()
}

/// Everything lies on the page, and no text on another.
fn check(data: &CurveData) {
    let picture = draw(data);
    let boxes = boxes(&picture);
    for (index, (text, [left, right, top, bottom])) in boxes.iter().enumerate() {
        let inside =
            *left >= 0.0 && *right <= picture.width && *top >= 0.0 && *bottom <= picture.height;
        assert!(inside, "`{text}` leaves the page");
        for (other, [l, r, t, b]) in &boxes[..index] {
            let apart = left >= r || l >= right || top >= b || t >= bottom;
            assert!(apart, "`{text}` lies on `{other}`");
        }
    }
    for shape in &picture.shapes {
        let (Shape::Line { points, .. } | Shape::Area { points, .. }) = shape else {
            continue;
        };
        for (x, y) in points {
            let inside = (0.0..=picture.width).contains(x) && (0.0..=picture.height).contains(y);
            assert!(inside, "a line leaves the page at ({x}, {y})");
        }
    }
}

#[test]
fn nothing_is_clipped_or_written_over_whatever_the_numbers() {
    let values: [&[f64]; 5] = [
        &[0.0, -2.5e6, -9e6],
        &[1e-3, 4e-3, 2e-3],
        &[1e9, 4e10, 2e9],
        &[1000.0, 1000.0],
        &[-0.5],
    ];
    let widths = [None, Some(3.25), Some(5.5), Some(7.0)];
    for (panels, width) in (1..=7).flat_map(|panels: usize| widths.map(|width| (panels, width))) {
        let panels = (0..panels).map(|index| {
            let curves = (0..7)
                .map(|series| (series != 3).then(|| curve(values[(index + series) % 5])))
                .collect();
            panel("InvertedDoublePendulum-v2", curves)
        });
        check(&CurveData {
            width,
            ..figure(panels.collect(), 7, "a method", false)
        });
    }
}

#[test]
fn curves_that_were_meant_to_have_fewer_seeds_lack_none() {
    let (few, mut many) = (curve(&[1.0, 2.0]), curve(&[1.0, 2.0]));
    (many.seeds, many.planned) = (15, 15);
    let panels = vec![
        panel("Hopper-v2", vec![Some(few)]),
        panel("Ant-v2", vec![Some(many)]),
    ];
    let told = notes(&figure(panels, 1, "MCPO", false));
    assert!(
        told.means.starts_with("Mean over 5 to 15 seeds;") && told.inside.is_empty(),
        "{}",
        told.all()
    );
}

#[test]
fn seeds_that_are_finished_are_counted_not_planned_ones() {
    let short = || {
        Some(Curve {
            seeds: 2,
            ..curve(&[1.0, 2.0])
        })
    };
    let told = notes(&figure(
        vec![panel("Hopper-v2", vec![short(), short()])],
        2,
        "MCPO",
        false,
    ))
    .all();
    let expected = "Mean over 2 seeds; shaded: from one to the other. Each curve: 2 of 5 seeds.";
    assert_eq!(told, expected);
    let told = notes(&figure(
        vec![panel("Hopper-v2", vec![short(), Some(curve(&[1.0]))])],
        2,
        "MCPO",
        false,
    ))
    .all();
    assert!(
        told.starts_with("Mean over 2 to 5 seeds;")
            && told.contains("MCPO 0, Hopper-v2 (2 of 5 seeds)"),
        "{told}"
    );
}

#[test]
fn a_series_that_lacks_the_same_in_all_panels_is_named_once() {
    let short = |seeds| {
        Some(Curve {
            seeds,
            ..curve(&[1.0, 2.0])
        })
    };
    let panels = vec![
        panel("Hopper-v2", vec![short(0), short(3)]),
        panel("Ant-v2", vec![short(0), short(4)]),
    ];
    let told = notes(&figure(panels, 2, "method", false)).inside;
    let expected = "Not complete: method 0 (0 of 5 seeds); method 1, Hopper-v2 (3 of 5 seeds); \
                    method 1, Ant-v2 (4 of 5 seeds).";
    assert_eq!(told, expected);
}

#[test]
fn long_names_are_broken_or_cut() {
    let name =
        "penalty, samples = rollout, bandwidth = median heuristic, estimator = u, weight = 100";
    let long = "AnEnvironmentWithANameThatIsLongerThanAnyPanelIsWideAndThenSome-v2";
    let mut data = figure(
        vec![panel(long, vec![Some(curve(&[1.0, 2.0])); 9])],
        9,
        name,
        false,
    );
    data.title = "much too long a title ".repeat(9);
    check(&data);
}

#[test]
fn legends_of_any_length_stay_apart() {
    let name =
        "a very long name of a series that does not fit into one line of a legend, whatever \
         the size "
            .repeat(3);
    let data = figure(
        vec![panel("Ant-v2", vec![Some(curve(&[1.0, 2.0])); 16])],
        16,
        &name,
        false,
    );
    check(&data);
    let written: Vec<String> = boxes(&draw(&data))
        .into_iter()
        .map(|(text, _)| text)
        .collect();
    for index in 0..16 {
        assert!(
            written
                .iter()
                .any(|line| line.ends_with(&format!(" {index}"))),
            "{index}: {written:?}"
        );
    }
}

#[test]
fn titles_of_any_script_are_one_line_and_what_the_font_lacks_is_told() {
    let mut data = figure(
        vec![panel("Ant-v2", vec![Some(curve(&[1.0, 2.0]))])],
        1,
        "MCPO",
        false,
    );
    data.title = "学习\tcurve\nof \u{1b} Ü".into();
    let picture = draw(&data);
    assert_eq!(
        picture.without_glyph().into_iter().collect::<String>(),
        "习学"
    );
    let written: Vec<String> = boxes(&picture).into_iter().map(|(text, _)| text).collect();
    assert_eq!(written[0], "学习 curve of \\u{1b} Ü");
}

#[test]
fn a_panel_without_curves_says_why() {
    let written = |left_out, seeds| {
        let empty = Curve {
            planned: 5,
            seeds,
            left_out,
            ..Curve::default()
        };
        let mut data = figure(vec![panel("Hopper-v2", vec![Some(empty)])], 1, "MCPO", true);
        data.y = "nu".into();
        check(&data);
        boxes(&draw(&data))
            .into_iter()
            .map(|(text, _)| text)
            .collect::<Vec<_>>()
            .join("\n")
    };
    let none = LeftOut::default();
    assert!(written(none, 0).contains("\nno finished run\n"));
    assert!(
        written(none, 5).contains("\nno value of nu\n")
            && !written(none, 5).contains("no finished run")
    );
    assert!(
        written(
            LeftOut {
                not_positive: 3,
                ..none
            },
            5
        )
        .contains("\nnothing above 0\n")
    );
    assert!(
        written(
            LeftOut {
                not_finite: 3,
                ..none
            },
            5
        )
        .contains("\nno finite number\n")
    );
    let text = written(LeftOut { absent: 3, ..none }, 5);
    assert!(
        text.contains("\nno point of all seeds\n")
            && text.contains("a seed has none there: Hopper-v2 (3)"),
        "{text}"
    );
}

#[test]
fn a_gap_is_not_bridged() {
    let mut broken = curve(&[1.0, 2.0, 3.0, 4.0, 5.0]);
    broken.gaps = vec![2.5e5];
    let data = figure(
        vec![panel("Hopper-v2", vec![Some(broken)])],
        1,
        "MCPO",
        false,
    );
    let crosses = |shape: &Shape| match shape {
        Shape::Line { points, color, .. } if *color == look::color(0) && points.len() > 1 => points
            .first()
            .zip(points.last())
            .map(|(first, last)| last.0 - first.0),
        _ => None,
    };
    let picture = draw(&data);
    let mut lengths: Vec<f64> = picture.shapes.iter().filter_map(crosses).collect();
    lengths.sort_by(f64::total_cmp);
    let whole = picture.width;
    assert!(
        lengths.iter().all(|length| *length < 0.5 * whole),
        "{lengths:?}"
    );
}

#[test]
fn what_does_not_train_is_a_level_line() {
    let mut level = Curve {
        points: vec![Point {
            env_steps: 0.0,
            mean: 1.5,
            band: Some((1.0, 2.0)),
        }],
        ..curve(&[1.0])
    };
    level.paper = None;
    let data = figure(
        vec![panel(
            "Hopper-v2",
            vec![Some(curve(&[1.0, 2.0])), Some(level)],
        )],
        2,
        "method",
        false,
    );
    check(&data);
    let dashes = draw(&data)
        .shapes
        .into_iter()
        .filter_map(|shape| match shape {
            Shape::Line { points, color, .. } if color == look::color(1) => {
                Some((points.first()?.0, points.last()?.0))
            }
            _ => None,
        });
    let (left, right) = dashes.fold((f64::INFINITY, 0.0), |ends: (f64, f64), dash| {
        (ends.0.min(dash.0), ends.1.max(dash.1))
    });
    assert!(right - left > 300.0, "it does not cross the panel");
}

#[test]
fn five_decades_and_zeros_fit_a_logarithmic_axis() {
    let mut falling = curve(&[1.0, 1e-2, 1e-4, 1e-5]);
    falling.paper = None;
    falling.tolerance = vec![(1e5, 1e-3), (4e5, 1e-3)];
    falling.points[3].band = Some((0.0, 1e-4));
    let mut data = figure(
        vec![panel("HalfCheetah-v2", vec![Some(falling)])],
        1,
        "MCPO",
        true,
    );
    data.panels[0].demo = None;
    check(&data);
    let written: Vec<String> = boxes(&draw(&data))
        .into_iter()
        .map(|(text, _)| text)
        .collect();
    assert!(written.contains(&"10⁻³".to_owned()), "{written:?}");
}

#[test]
fn a_panel_without_finished_runs_says_so_and_missing_seeds_are_named() {
    let (empty, mut short) = (
        Curve {
            planned: 5,
            ..Curve::default()
        },
        curve(&[1.0, 2.0]),
    );
    short.seeds = 4;
    let panels = vec![
        panel("Hopper-v2", vec![Some(empty)]),
        panel("Ant-v2", vec![Some(short)]),
    ];
    let data = figure(panels, 1, "MCPO", false);
    check(&data);
    let written: Vec<String> = boxes(&draw(&data))
        .into_iter()
        .map(|(text, _)| text)
        .collect();
    assert!(
        written.contains(&"no finished run".to_owned()),
        "{written:?}"
    );
    assert!(
        written
            .iter()
            .any(|text| text.contains("Not complete: Ant-v2 (4 of 5 seeds)")),
        "{written:?}"
    );
}

#[test]
fn the_legend_lies_outside_the_axes() {
    let data = figure(
        vec![panel("Hopper-v2", vec![Some(curve(&[1.0, 2.0])); 3])],
        3,
        "method",
        false,
    );
    let boxes = boxes(&draw(&data));
    let top = |wanted: &str| {
        boxes
            .iter()
            .find(|(text, _)| text == wanted)
            .map(|(_, at)| at[2])
            .expect("written")
    };
    assert!(top("method 0") > top("environment steps"));
}

#[test]
fn the_same_data_gives_the_same_picture() {
    let data = figure(
        vec![panel("Hopper-v2", vec![Some(curve(&[1.0, 2.0, 0.5]))])],
        1,
        "MCPO",
        false,
    );
    let (one, other) = (draw(&data), draw(&data));
    assert!(one.png().expect("encoded") == other.png().expect("encoded"));
    let svg = one.svg().expect("text");
    assert_eq!(svg, other.svg().expect("text"));
    assert!(
        svg.starts_with("<svg width=\"400pt\"") && svg.contains(">\nenvironment steps"),
        "{}",
        &svg[..200]
    );
}

#[test]
fn in_print_text_is_readable_the_width_is_what_was_asked_for_and_the_caption_has_the_rest() {
    let mut short = curve(&[1.0, 2.0]);
    short.under_way = Some(UnderWay {
        steps: 400_000,
        of: 1_000_000,
    });
    short.seeds = 3;
    let panels = ["HalfCheetah-v2", "InvertedDoublePendulum-v2"]
        .map(|env| panel(env, vec![Some(short.clone()); 2]));
    let data = CurveData {
        width: Some(3.25),
        ..figure(panels.into(), 2, "MCPO", false)
    };
    let picture = draw(&data);
    assert_eq!((picture.width, picture.dpi), (234.0, 300));
    let written: Vec<String> = boxes(&picture).into_iter().map(|(text, _)| text).collect();
    assert!(
        written.contains(&"(b) DoublePendulum".to_owned()) && !written.contains(&data.title),
        "{written:?}"
    );
    assert!(
        written
            .iter()
            .any(|line| line == "Each curve: 3 of 5 seeds, to 400k of 1M steps."),
        "{written:?}"
    );
    assert!(
        !written.iter().any(|line| line.contains("Student")),
        "{written:?}"
    );
    let sizes = picture.shapes.iter().filter_map(|shape| match shape {
        Shape::Text(text) => Some(text.size),
        Shape::Line { .. } | Shape::Area { .. } => None,
    });
    assert!(sizes.fold(f64::INFINITY, f64::min) >= 7.0);
    let png = picture.png().expect("encoded");
    // 300 pixels to an inch are 11,811 to a metre, twice and in metres (1).
    let resolution = [
        b"pHYs".as_slice(),
        &11_811_u32.to_be_bytes(),
        &11_811_u32.to_be_bytes(),
        &[1],
    ]
    .concat();
    assert!(
        png.windows(resolution.len())
            .any(|window| window == resolution),
        "the PNG does not say its resolution"
    );
    assert_eq!(
        png[16..20],
        975_u32.to_be_bytes(),
        "3.25 inches of 300 pixels"
    );
}

#[test]
fn a_curve_has_two_or_three_markers() {
    let long: Vec<f64> = (0..60).map(f64::from).collect();
    for width in [None, Some(3.25), Some(7.0)] {
        let data = figure(
            vec![panel("Hopper-v2", vec![Some(curve(&long))])],
            1,
            "MCPO",
            false,
        );
        let picture = draw(&CurveData { width, ..data });
        // Each marker is two areas; so is the legend's, and the band is one.
        let areas = picture
            .shapes
            .iter()
            .filter(|shape| matches!(shape, Shape::Area { .. }))
            .count();
        assert!([7, 9].contains(&areas), "{areas} areas at {width:?}");
    }
}

#[test]
fn a_paper_s_value_far_from_the_curves_is_an_arrow_and_a_note() {
    let mut far = curve(&[100.0, 200.0, 300.0]);
    far.paper = Some(-5477.0);
    let panels = vec![panel("Ant-v2", vec![Some(far)])];
    let data = figure(panels, 1, "MCPO", false);
    check(&data);
    let scale = y_scale(&data, &data.panels[0]);
    assert!(scale.low > -100.0, "{scale:?}");
    let arrows = draw(&data)
        .shapes
        .into_iter()
        .filter(|shape| matches!(shape, Shape::Area { points, .. } if points.len() == 3))
        .count();
    assert_eq!(arrows, 1);
    let said = "Arrows, for the paper's values beyond an axis: Ant-v2 (−5477).";
    assert_eq!(notes(&data).inside, said);
}

#[test]
fn the_axis_of_a_flat_curve_reaches_the_paper_s_value() {
    let mut flat = curve(&[100.0, 100.0]);
    flat.paper = Some(3000.0);
    let mut flat = panel("Hopper-v2", vec![Some(flat)]);
    flat.demo = None;
    let data = figure(vec![flat], 1, "MCPO", false);
    assert!(y_scale(&data, &data.panels[0]).high > 3000.0);
    assert_eq!(notes(&data).inside, "");
}
