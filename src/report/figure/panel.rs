//! One panel: its axes, and the curves in them.

use super::{
    fit,
    picture::{Anchor, Shape, text_width},
    style::{self, BAND, BLACK, GREY, LIGHT, Look, SIZE, TICK_SIZE},
    text,
    ticks::{Scale, Tick},
};
use crate::report::curve::{Curve, CurveData, Panel, Point};

/// Where a panel lies on the page, everything that belongs to it included but the name of the x axis, which hangs below.
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

/// The inside of the axes, and what they show.
struct Axes {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x: Scale,
    y: Scale,
}

impl Axes {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let across = self.left + self.x.fraction(x) * (self.right - self.left);
        (across, self.height_of(y))
    }

    /// The y of a value; at the frame where it lies outside.
    fn height_of(&self, y: f64) -> f64 {
        let height = self.bottom - self.y.fraction(y) * (self.bottom - self.top);
        // A logarithm of 0 or less is at the bottom.
        if height.is_nan() { self.bottom } else { height.clamp(self.top, self.bottom) }
    }
}

/// Points of the page that a line leads through.
type Path = Vec<(f64, f64)>;

/// Distance of the markers of a curve.
const MARKER_DISTANCE: f64 = 50.0;
/// The dashes of the paper's values, to the right of the axes.
pub const GUTTER: f64 = 16.0;
/// What a panel has above and below its axes.
const HEAD: f64 = 18.0;
const FOOT: f64 = 24.0;

/// The room that the labels of a panel's y axis take.
pub fn label_width(data: &CurveData, panel: &Panel, height: f64) -> f64 {
    let ticks = y_scale(data, panel).ticks(wanted(height));
    ticks.iter().map(|tick| text_width(&tick.label, TICK_SIZE)).fold(12.0, f64::max)
}

/// Labels of the y axis in a panel of `height`, about.
fn wanted(height: f64) -> usize {
    ((height - HEAD - FOOT) / 26.0) as usize
}

/// The shapes of `panel` in `frame`.
pub fn draw(data: &CurveData, panel: &Panel, frame: Frame) -> Vec<Shape> {
    let curves: Vec<(usize, &Curve)> =
        panel.curves.iter().enumerate().filter_map(|(index, curve)| Some((index, curve.as_ref()?))).collect();
    let end = curves.iter().flat_map(|(_, curve)| &curve.points).map(|point| point.env_steps).fold(0.0, f64::max);
    // On whole points, so that all frames' lines look alike.
    let axes = Axes {
        left: (frame.left + frame.labels + 10.0).round(),
        right: (frame.left + frame.width - frame.gutter - 8.0).round(),
        top: (frame.top + HEAD).round(),
        bottom: (frame.top + frame.height - FOOT).round(),
        x: Scale { low: 0.0, high: if end > 0.0 { end * 1.02 } else { 1.0 }, log: false },
        y: y_scale(data, panel),
    };
    let mut shapes = Vec::new();
    let middle = (axes.left + axes.right) / 2.0;
    let title = fit(&panel.title, SIZE, 2.0 * (middle - frame.left).min(frame.left + frame.width - middle) - 4.0);
    shapes.push(Shape::Text(text(&title, (middle, axes.top - 5.0), Anchor::Middle, SIZE, BLACK)));
    if curves.iter().all(|(_, curve)| curve.points.is_empty()) {
        let at = (middle, (axes.top + axes.bottom) / 2.0);
        shapes.push(Shape::Text(text(&why_empty(data, &curves), at, Anchor::Middle, SIZE, GREY)));
    } else {
        let x_ticks = axes.x.step_ticks(((axes.right - axes.left) / 45.0) as usize);
        shapes.extend(grid(&axes, &x_ticks, &axes.y.ticks(wanted(frame.height))));
        shapes.extend(lines(panel, &curves, &axes));
    }
    shapes.extend(outline(&axes));
    if frame.x_label {
        let at = (middle, axes.bottom + TICK_SIZE * 1.3 + SIZE * 1.35);
        shapes.push(Shape::Text(text("environment steps", at, Anchor::Middle, SIZE, BLACK)));
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

/// All means and references lie inside; bands count as far as half that extent beyond it, since the interval of two seeds
/// would else leave nothing of the curves.
fn y_scale(data: &CurveData, panel: &Panel) -> Scale {
    let curves = || panel.curves.iter().flatten();
    let values = curves()
        .flat_map(|curve| {
            let means = curve.points.iter().map(|point| point.mean);
            means.chain(curve.paper).chain(curve.tolerance.iter().map(|point| point.1))
        })
        .chain(panel.demo);
    let inner = Scale::around(values, data.log_y);
    let bands = curves().flat_map(|curve| &curve.points).filter_map(|point| point.band);
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for band in bands {
        low = low.min(inner.fraction(band.0).max(-0.5));
        high = high.max(inner.fraction(band.1).min(1.5));
    }
    inner.stretched(low, high)
}

fn grid(axes: &Axes, x_ticks: &[Tick], y_ticks: &[Tick]) -> Vec<Shape> {
    let mut shapes = Vec::new();
    let mut line = |points: [(f64, f64); 2], color| {
        shapes.push(Shape::Line { points: points.to_vec(), width: 0.6, color });
    };
    for tick in y_ticks {
        let y = axes.height_of(tick.at);
        if tick.label.is_empty() {
            line([(axes.left, y), (axes.left + 2.0, y)], BLACK);
        } else {
            line([(axes.left, y), (axes.right, y)], LIGHT);
            line([(axes.left - 3.0, y), (axes.left, y)], BLACK);
        }
    }
    for tick in x_ticks {
        let x = axes.at(tick.at, 0.0).0;
        line([(x, axes.bottom), (x, axes.bottom + 3.0)], BLACK);
    }
    for tick in y_ticks.iter().filter(|tick| !tick.label.is_empty()) {
        let at = (axes.left - 5.0, axes.height_of(tick.at) + 0.36 * TICK_SIZE);
        shapes.push(Shape::Text(text(&tick.label, at, Anchor::End, TICK_SIZE, BLACK)));
    }
    for tick in x_ticks {
        let at = (axes.at(tick.at, 0.0).0, axes.bottom + 4.0 + TICK_SIZE);
        shapes.push(Shape::Text(text(&tick.label, at, Anchor::Middle, TICK_SIZE, BLACK)));
    }
    shapes
}

fn outline(axes: &Axes) -> [Shape; 1] {
    let Axes { left, right, top, bottom, .. } = *axes;
    // Once around and a little further, so that the corner where it begins is a joint too.
    let points = vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top), (right, top)];
    [Shape::Line { points, width: 0.75, color: BLACK }]
}

/// From the back to the front: bands, the demonstration, tolerances, curves, markers, the paper's values.
fn lines(panel: &Panel, curves: &[(usize, &Curve)], axes: &Axes) -> Vec<Shape> {
    let mut shapes = Vec::new();
    for (index, curve) in curves {
        shapes.extend(band(*index, curve, axes));
    }
    if let Some(demo) = panel.demo {
        let y = axes.height_of(demo);
        shapes.extend(Look::Demo.line(&[(axes.left, y), (axes.right, y)], GREY));
    }
    for (index, curve) in curves.iter().filter(|(_, curve)| curve.tolerance.len() > 1) {
        let points: Vec<_> = curve.tolerance.iter().map(|&(x, y)| axes.at(x, y)).collect();
        shapes.extend(Look::Tolerance.line(&points, style::color(*index)));
    }
    let count = ((axes.right - axes.left) / MARKER_DISTANCE) as usize;
    let paths: Vec<(usize, Vec<Path>)> =
        curves.iter().map(|(index, curve)| (*index, stretches(curve, axes, count))).collect();
    for (index, stretch) in paths.iter().flat_map(|(index, path)| path.iter().map(move |stretch| (*index, stretch))) {
        match stretch.as_slice() {
            [alone] => shapes.push(style::dot(index, *alone)),
            _ => shapes.extend(Look::Series(index).line(stretch, BLACK)),
        }
    }
    for (turn, (index, path)) in paths.iter().enumerate() {
        let drawn = |at: &(f64, f64)| {
            let over = |stretch: &Path| Some(stretch.first()?.0 <= at.0 && at.0 <= stretch.last()?.0);
            path.iter().any(|stretch| over(stretch) == Some(true))
        };
        let marks = marked(&path.concat(), count, turn as f64 / paths.len() as f64);
        shapes.extend(marks.into_iter().filter(drawn).flat_map(|at| style::marker(*index, at)));
    }
    for (index, curve) in curves {
        if let Some(paper) = curve.paper {
            let y = axes.height_of(paper);
            shapes.extend(Look::Paper.line(&[(axes.right + 2.0, y), (axes.right + GUTTER, y)], style::color(*index)));
        }
    }
    shapes
}

/// The lines of a curve: its stretches between gaps; of one that does not train, a level line from side to side, of more
/// points than it gets markers.
fn stretches(curve: &Curve, axes: &Axes, markers: usize) -> Vec<Path> {
    if let Some(level) = curve.level() {
        let (y, width) = (axes.height_of(level.mean), axes.right - axes.left);
        let x = |index: usize| axes.left + width * index as f64 / (markers + 1) as f64;
        return vec![(0..=markers + 1).map(|index| (x(index), y)).collect()];
    }
    let at = |points: &[Point]| points.iter().map(|point| axes.at(point.env_steps, point.mean)).collect();
    curve.stretches().map(at).collect()
}

/// The band of a curve; an error bar where a stretch of it is one point.
fn band(index: usize, curve: &Curve, axes: &Axes) -> Vec<Shape> {
    let color = style::color(index);
    if let Some((low, high)) = curve.level().and_then(|level| level.band) {
        let (low, high) = (axes.height_of(low), axes.height_of(high));
        let points = vec![(axes.left, low), (axes.right, low), (axes.right, high), (axes.left, high)];
        return vec![Shape::Area { points, color, opacity: BAND }];
    }
    let of_stretch = |points: &[Point]| {
        let ends = points.iter().filter_map(|point| {
            let (low, high) = point.band?;
            Some((axes.at(point.env_steps, low), axes.at(point.env_steps, high)))
        });
        let ends: Vec<_> = ends.collect();
        match ends.as_slice() {
            [] => None,
            [(low, high)] => Some(Shape::Line { points: vec![*low, *high], width: 1.0, color }),
            _ => {
                let points = ends.iter().map(|end| end.0).chain(ends.iter().rev().map(|end| end.1)).collect();
                Some(Shape::Area { points, color, opacity: BAND })
            }
        }
    };
    curve.stretches().filter_map(of_stretch).collect()
}

/// Where a curve's markers stand: at every point of a short curve, else `count` evenly along x, `shift` (0 to 1) of their
/// distance on, so that the markers of several curves do not hide each other.
fn marked(path: &[(f64, f64)], count: usize, shift: f64) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (path.first(), path.last()) else { return Vec::new() };
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
