//! One panel: its axes, and the curves in them.

use super::{
    axes::{Axes, drawn_singles, x_scale, x_ticks, y_scale},
    beside::{self, Beside},
    look::{self, BAND, Look},
    picture::{Anchor, Shape, text_width},
    style::{BLACK, GREY, LIGHT, Sheet},
    ticks::Tick,
    words::{fit, text},
};
use crate::report::curve::{Curve, CurveData, Panel, Point};

/// The place of a panel on the page. It includes everything that belongs to the panel but the name
/// of the x axis, which hangs below.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Its left edge.
    pub left: f64,
    /// Its upper edge.
    pub top: f64,
    /// Its width.
    pub width: f64,
    /// Its height.
    pub height: f64,
    /// Room for the labels of the y axis.
    pub labels: f64,
    /// Room for the paper's values, to the right of the axes.
    pub gutter: f64,
    /// Whether the x axis is named.
    pub x_label: bool,
}

/// Points of the page that a line leads through.
type Path = Vec<(f64, f64)>;

/// The width for the paper's values to the right of the axes, at the screen's size.
pub const GUTTER: f64 = 16.0;

/// The height above the axes of a panel, for its title.
fn head(sheet: &Sheet) -> f64 {
    1.64 * sheet.text
}

/// The height below the axes of a panel, for the labels of their ticks.
fn foot(sheet: &Sheet) -> f64 {
    1.1 * sheet.tick + sheet.scaled(10.0)
}

/// The height that the name of the x axis takes below a panel.
pub fn below(sheet: &Sheet) -> f64 {
    1.4 * sheet.text
}

/// The height of a panel whose axes are `axes` high.
pub fn height(sheet: &Sheet, axes: f64) -> f64 {
    head(sheet) + axes + foot(sheet)
}

/// The room that the labels of a panel's y axis take.
pub fn label_width(data: &CurveData, panel: &Panel, sheet: &Sheet, height: f64) -> f64 {
    let ticks = y_scale(data, panel).ticks(wanted(sheet, height));
    ticks
        .iter()
        .map(|tick| text_width(&tick.label, sheet.tick))
        .fold(sheet.scaled(12.0), f64::max)
}

/// The number of labels to aim for on the y axis of a panel of `height`.
fn wanted(sheet: &Sheet, height: f64) -> usize {
    ((height - head(sheet) - foot(sheet)) / (2.3 * sheet.tick)) as usize
}

/// The shapes of `panel`, under `title`, in `frame`.
pub fn draw(
    data: &CurveData,
    panel: &Panel,
    title: &str,
    sheet: &Sheet,
    frame: Frame,
) -> Vec<Shape> {
    let curves: Vec<(usize, &Curve)> = panel
        .curves
        .iter()
        .enumerate()
        .filter_map(|(index, curve)| Some((index, curve.as_ref()?)))
        .collect();
    // On whole points, so that all frames' lines look alike.
    let axes = Axes {
        left: (frame.left + frame.labels + sheet.scaled(10.0)).round(),
        right: (frame.left + frame.width - frame.gutter - sheet.scaled(8.0)).round(),
        top: (frame.top + head(sheet)).round(),
        bottom: (frame.top + frame.height - foot(sheet)).round(),
        x: x_scale(data, panel),
        y: y_scale(data, panel),
    };
    let mut shapes = Vec::new();
    let middle = (axes.left + axes.right) / 2.0;
    // The title is centred over the axes, so the nearer edge of the frame limits its width.
    let room =
        2.0 * (middle - frame.left).min(frame.left + frame.width - middle) - sheet.scaled(4.0);
    let at = (middle, axes.top - sheet.scaled(5.0));
    shapes.push(Shape::Text(text(
        &fit(title, sheet.text, room),
        at,
        Anchor::Middle,
        sheet.text,
        BLACK,
    )));
    // Without points there is no range either, so no ticks that would tell of one.
    if curves.iter().all(|(_, curve)| curve.points.is_empty()) {
        let at = (middle, (axes.top + axes.bottom) / 2.0);
        shapes.push(Shape::Text(text(
            &why_empty(data, &curves),
            at,
            Anchor::Middle,
            sheet.text,
            GREY,
        )));
    } else {
        let x_ticks = x_ticks(
            data,
            &axes.x,
            ((axes.right - axes.left) / (4.7 * sheet.tick)) as usize,
        );
        shapes.extend(grid(
            sheet,
            &axes,
            &x_ticks,
            &axes.y.ticks(wanted(sheet, frame.height)),
        ));
        shapes.extend(lines(data, panel, sheet, &axes));
    }
    // After the curves, whose ends would cover it.
    shapes.extend(outline(sheet, &axes));
    if frame.x_label {
        let at = (
            middle,
            axes.bottom + 1.1 * sheet.tick + sheet.scaled(2.0) + 1.35 * sheet.text,
        );
        shapes.push(Shape::Text(text(
            data.across.label(),
            at,
            Anchor::Middle,
            sheet.text,
            BLACK,
        )));
    }
    shapes
}

/// Why a panel has no curve, from what its curves left out.
fn why_empty(data: &CurveData, curves: &[(usize, &Curve)]) -> String {
    let any = |count: fn(&Curve) -> usize| curves.iter().any(|(_, curve)| count(curve) > 0);
    match () {
        () if !any(|curve| curve.seeds) => "no finished run".to_owned(),
        () if any(|curve| curve.left_out.not_positive) => "nothing above 0".to_owned(),
        () if any(|curve| curve.left_out.not_finite) => "no finite number".to_owned(),
        () if any(|curve| curve.left_out.absent) => "no point of all seeds".to_owned(),
        () => format!("no value of {}", data.y),
    }
}

fn grid(sheet: &Sheet, axes: &Axes, x_ticks: &[Tick], y_ticks: &[Tick]) -> Vec<Shape> {
    let mut shapes = Vec::new();
    let mut line = |points: [(f64, f64); 2], color| {
        shapes.push(Shape::Line {
            points: points.to_vec(),
            width: sheet.frame,
            color,
        });
    };
    let (long, short, gap) = (sheet.scaled(3.0), sheet.scaled(2.0), sheet.scaled(5.0));
    for tick in y_ticks {
        let y = axes.height_of(tick.at);
        // Ticks without a label get a short mark alone: more lines would hide the curves.
        if tick.label.is_empty() {
            line([(axes.left, y), (axes.left + short, y)], BLACK);
        } else {
            line([(axes.left, y), (axes.right, y)], LIGHT);
            line([(axes.left - long, y), (axes.left, y)], BLACK);
        }
    }
    for tick in x_ticks {
        let x = axes.across(tick.at);
        line([(x, axes.bottom), (x, axes.bottom + long)], BLACK);
    }
    for tick in y_ticks.iter().filter(|tick| !tick.label.is_empty()) {
        // Digits are about 0.72 em high, so this puts their middle at the tick.
        let at = (axes.left - gap, axes.height_of(tick.at) + 0.36 * sheet.tick);
        shapes.push(Shape::Text(text(
            &tick.label,
            at,
            Anchor::End,
            sheet.tick,
            BLACK,
        )));
    }
    for tick in x_ticks {
        let at = (
            axes.across(tick.at),
            axes.bottom + sheet.scaled(4.0) + sheet.tick,
        );
        shapes.push(Shape::Text(text(
            &tick.label,
            at,
            Anchor::Middle,
            sheet.tick,
            BLACK,
        )));
    }
    shapes
}

fn outline(sheet: &Sheet, axes: &Axes) -> [Shape; 1] {
    let Axes {
        left,
        right,
        top,
        bottom,
        ..
    } = *axes;
    // Once around and a little further, so that the starting corner is joined too.
    let points = vec![
        (left, top),
        (right, top),
        (right, bottom),
        (left, bottom),
        (left, top),
        (right, top),
    ];
    [Shape::Line {
        points,
        width: 1.1 * sheet.frame,
        color: BLACK,
    }]
}

/// All lines of a panel, from the back to the front: bands, single seeds, what was smoothed, the
/// demonstration, tolerances, curves, markers, the paper's values.
fn lines(data: &CurveData, panel: &Panel, sheet: &Sheet, axes: &Axes) -> Vec<Shape> {
    let looks = data.looks.iter().zip(&panel.curves);
    let curves: Vec<(usize, &Curve)> = looks
        .filter_map(|(&look, curve)| Some((look, curve.as_ref()?)))
        .collect();
    let mut shapes = Vec::new();
    for (look, curve) in &curves {
        shapes.extend(band(*look, curve, axes));
    }
    for (look, curve) in &curves {
        shapes.extend(faint(data, *look, curve, sheet, axes));
    }
    if let Some(demo) = panel.demo {
        let y = axes.height_of(demo);
        shapes.extend(Look::Demo.line(sheet, &[(axes.left, y), (axes.right, y)], GREY));
    }
    for (look, curve) in curves.iter().filter(|(_, curve)| curve.tolerance.len() > 1) {
        let points: Vec<_> = curve
            .tolerance
            .iter()
            .map(|point| axes.at(*point))
            .collect();
        shapes.extend(Look::Tolerance.line(sheet, &points, look::color(*look)));
    }
    let count = markers(axes);
    let paths: Vec<(usize, Vec<Path>)> = curves
        .iter()
        .map(|(look, curve)| (*look, stretches(curve, axes, count)))
        .collect();
    for (look, stretch) in paths
        .iter()
        .flat_map(|(look, path)| path.iter().map(move |stretch| (*look, stretch)))
    {
        match stretch.as_slice() {
            // One point makes no line.
            [alone] => shapes.push(look::dot(sheet, look, *alone)),
            _ => shapes.extend(Look::Series(look).line(sheet, stretch, BLACK)),
        }
    }
    // All lines come before all markers, so that none crosses a marker.
    for (turn, (look, path)) in paths.iter().enumerate() {
        // A marker must not stand in a gap, where the curve has no line.
        let drawn = |at: &(f64, f64)| {
            let over =
                |stretch: &Path| Some(stretch.first()?.0 <= at.0 && at.0 <= stretch.last()?.0);
            path.iter().any(|stretch| over(stretch) == Some(true))
        };
        let marks = marked(&path.concat(), count, turn as f64 / paths.len() as f64);
        shapes.extend(
            marks
                .into_iter()
                .filter(drawn)
                .flat_map(|at| look::marker(sheet, *look, at)),
        );
    }
    let places = beside::places(&axes.y, beside::values(panel));
    for (look, place) in data.looks.iter().zip(places) {
        if let Some(place) = place {
            shapes.extend(paper(*look, place, sheet, axes));
        }
    }
    shapes
}

/// One of the paper's values: a dash at its height, or an arrow at the end of the axis.
fn paper(look: usize, place: Beside, sheet: &Sheet, axes: &Axes) -> Vec<Shape> {
    let (from, to) = (
        axes.right + sheet.scaled(2.0),
        axes.right + sheet.scaled(GUTTER),
    );
    let color = look::color(look);
    // Each arrow points outwards from `end`, and stands further inwards than the one before.
    let arrow = |end: f64, inwards: f64, turn: usize| {
        let (middle, size) = ((from + to) / 2.0, sheet.scaled(3.5));
        let tip = end + inwards * 1.9 * size * turn as f64;
        let base = tip + inwards * 1.6 * size;
        vec![Shape::Area {
            points: vec![(middle, tip), (middle - size, base), (middle + size, base)],
            color,
            opacity: 1.0,
        }]
    };
    match place {
        Beside::Within(value) => {
            let y = axes.height_of(value);
            Look::Paper.line(sheet, &[(from, y), (to, y)], color)
        }
        Beside::Above(turn) => arrow(axes.top, 1.0, turn),
        Beside::Below(turn) => arrow(axes.bottom, -1.0, turn),
    }
}

/// The number of markers on a curve: enough to recognise it, too few to hide it.
fn markers(axes: &Axes) -> usize {
    if axes.right - axes.left < 120.0 { 2 } else { 3 }
}

/// The lines of single seeds, and of the mean before smoothing.
fn faint(data: &CurveData, look: usize, curve: &Curve, sheet: &Sheet, axes: &Axes) -> Vec<Shape> {
    let stretches = drawn_singles(data, curve)
        .chain([&curve.raw])
        .flat_map(|line| {
            line.chunk_by(|left, right| !curve.gap_between(left.0, right.0))
                .filter(|stretch| stretch.len() > 1)
        });
    let line = |stretch: &[(f64, f64)]| Shape::Line {
        points: stretch.iter().map(|point| axes.at(*point)).collect(),
        width: 0.5 * sheet.curve,
        color: look::faint(look),
    };
    stretches.map(line).collect()
}

/// The lines of a curve: its stretches between gaps. A method that does not train gets a level line
/// from side to side, with more points than markers.
fn stretches(curve: &Curve, axes: &Axes, markers: usize) -> Vec<Path> {
    if let Some(level) = curve.level() {
        let (y, width) = (axes.height_of(level.mean), axes.right - axes.left);
        let x = |index: usize| axes.left + width * index as f64 / (markers + 1) as f64;
        return vec![(0..=markers + 1).map(|index| (x(index), y)).collect()];
    }
    let at = |points: &[Point]| {
        points
            .iter()
            .map(|point| axes.at((point.env_steps, point.mean)))
            .collect()
    };
    curve.stretches().map(at).collect()
}

/// The band of a curve; an error bar where a stretch of it is one point.
fn band(look: usize, curve: &Curve, axes: &Axes) -> Vec<Shape> {
    let color = look::color(look);
    // A method that does not train has one value, whose band spans the whole width.
    if let Some((low, high)) = curve.level().and_then(|level| level.band) {
        let (low, high) = (axes.height_of(low), axes.height_of(high));
        let points = vec![
            (axes.left, low),
            (axes.right, low),
            (axes.right, high),
            (axes.left, high),
        ];
        return vec![Shape::Area {
            points,
            color,
            opacity: BAND,
        }];
    }
    let of_stretch = |points: &[Point]| {
        let ends = points.iter().filter_map(|point| {
            let (low, high) = point.band?;
            Some((
                axes.at((point.env_steps, low)),
                axes.at((point.env_steps, high)),
            ))
        });
        let ends: Vec<_> = ends.collect();
        match ends.as_slice() {
            [] => None,
            [(low, high)] => Some(Shape::Line {
                points: vec![*low, *high],
                width: 1.0,
                color,
            }),
            _ => {
                let points = ends
                    .iter()
                    .map(|end| end.0)
                    // There along the lower ends and back along the upper ones, which closes the
                    // outline.
                    .chain(ends.iter().rev().map(|end| end.1))
                    .collect();
                Some(Shape::Area {
                    points,
                    color,
                    opacity: BAND,
                })
            }
        }
    };
    curve.stretches().filter_map(of_stretch).collect()
}

/// The places of a curve's markers: every point of a short curve, otherwise `count` places evenly
/// along x. They are moved on by `shift` (0 to 1) of their distance, so that the markers of several
/// curves do not hide each other.
fn marked(path: &[(f64, f64)], count: usize, shift: f64) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (path.first(), path.last()) else {
        return Vec::new();
    };
    if path.len() <= count {
        return path.to_vec();
    }
    let mark = |index: usize| {
        let x = first.0 + (last.0 - first.0) * (index as f64 + 0.15 + 0.7 * shift) / count as f64;
        let ends = path.windows(2).find(|ends| ends[1].0 >= x)?;
        let share = (x - ends[0].0) / (ends[1].0 - ends[0].0);
        Some((x, ends[0].1 + share * (ends[1].1 - ends[0].1)))
    };
    (0..count).filter_map(mark).collect()
}
