//! Figures on the page: panels as SVG, and beside them the numbers that the script shows.
//!
//! Coordinates are tenths of a pixel, whole numbers, relative from point to point. A page of very
//! many curves shows every second, third ... point of each, so that it stays small; the files
//! beside it hold all of them.

use std::collections::BTreeSet;

use super::{
    Figure, Shows,
    parts::{files, prose},
    table,
};
use crate::{
    escape,
    report::{
        curve::{Across, Curve, CurveData, Panel, Point},
        figure::{
            axes::{Axes, x_scale, x_ticks, y_scale},
            beside::{self, Beside},
            look,
            picture::text_width,
            ticks::Tick,
        },
        text::{Grid, alone},
    },
};

/// About how many numbers a page holds; each takes at most 10 bytes in the figure and the data.
const NUMBERS: usize = 250_000;
/// The size of text.
const TEXT: f64 = 110.0;
/// The radius of a marker.
const MARK: f64 = 34.0;
/// The number of markers on a curve.
const MARKS: usize = 3;
/// Room for the paper's values, to the right of the axes.
const GUTTER: f64 = 140.0;

/// All figures.
pub fn body(figures: &[Figure<'_>]) -> String {
    let stride = stride(figures);
    let all = figures.iter().enumerate().map(|(index, figure)| {
        let (shown, ends) = match &figure.shows {
            Shows::Picture(svg) => (format!("<div class=\"paper\">{svg}</div>\n"), String::new()),
            Shows::Curves(data) => (curves(data, stride), ends(data, figure.title)),
        };
        let thinned = match (&figure.shows, stride) {
            (Shows::Curves(_), 2..) => format!(" Here, one of {stride} points of each curve."),
            _ => String::new(),
        };
        let extensions: Vec<&str> = figure.files.clone();
        format!(
            "<figure id=\"{name}\" data-figure=\"{index}\">\n<h3>{title}</h3>\n\
             {shown}<figcaption>{caption}{thinned}</figcaption>\n\
             {ends}{files}</figure>\n",
            name = escape::html(figure.name),
            title = prose(figure.title),
            caption = prose(&figure.caption),
            files = files(figure.name, &extensions),
        )
    });
    let body: String = all.collect();
    if body.is_empty() {
        body
    } else {
        marks(figures) + &body
    }
}

/// The stride between shown points: one in this many is shown.
pub fn stride(figures: &[Figure<'_>]) -> usize {
    let numbers = |curve: &Curve| curve.points.len() * (6 + curve.singles.len());
    all_curves(figures)
        .map(numbers)
        .sum::<usize>()
        .div_ceil(NUMBERS)
        .max(1)
}

fn all_curves<'a>(figures: &'a [Figure<'_>]) -> impl Iterator<Item = &'a Curve> {
    figures
        .iter()
        .filter_map(curves_of)
        .flat_map(|data| &data.panels)
        .flat_map(|panel| panel.curves.iter().flatten())
}

/// The curves of a figure; `None` where it is a picture.
pub fn curves_of<'a>(figure: &'a Figure<'_>) -> Option<&'a CurveData> {
    match &figure.shows {
        Shows::Curves(data) => Some(data.as_ref()),
        Shows::Picture(_) => None,
    }
}

/// The markers of all looks, to be used by name.
fn marks(figures: &[Figure<'_>]) -> String {
    let looks: BTreeSet<usize> = figures
        .iter()
        .filter_map(curves_of)
        .flat_map(|data| data.looks.clone())
        .collect();
    let mark = |look: &usize| {
        let corners = look::outline(*look)
            .into_iter()
            .map(|(x, y)| (x * MARK, y * MARK));
        format!("<path id=\"mark-{look}\" d=\"{}z\"/>", path(corners))
    };
    let marks: String = looks.iter().map(mark).collect();
    format!(
        "<svg class=\"marks\" width=\"0\" height=\"0\" aria-hidden=\"true\"><defs>{marks}</defs>\
         </svg>\n"
    )
}

/// The classes that give a series its colour and dashes.
pub fn class(look: usize) -> String {
    format!("c{} p{}", look % 12, look::pattern(look))
}

/// The legend and the panels.
fn curves(data: &CurveData, stride: usize) -> String {
    let (columns, ..) = size(data);
    let panels: String = data
        .panels
        .iter()
        .enumerate()
        .map(|(index, panel)| panel_html(data, index, panel, stride))
        .collect();
    format!(
        "<div class=\"legend\" role=\"group\" aria-label=\"Series\">\n{}</div>\n\
         <div class=\"switches\" hidden></div>\n\
         <div class=\"panels {columns}\">\n{panels}</div>\n\
         <p class=\"reader\" aria-live=\"polite\"></p>\n",
        legend(data)
    )
}

/// How panels stand beside each other, and the width and height of each.
fn size(data: &CurveData) -> (&'static str, f64, f64) {
    match data.panels.len() {
        1 => ("one", 5600.0, 3400.0),
        2 | 4 => ("two", 4800.0, 3000.0),
        _ => ("three", 3600.0, 2600.0),
    }
}

/// A switch for each series, and a key to the other lines.
fn legend(data: &CurveData) -> String {
    let series = data.series.iter().zip(&data.looks).enumerate().map(|(index, (label, &look))| {
        format!(
            "<button type=\"button\" class=\"key\" aria-pressed=\"true\" data-series=\"{index}\">\
             <svg class=\"sample\" viewBox=\"0 0 300 120\" aria-hidden=\"true\"><g class=\"{}\">\
             <path class=\"mean\" d=\"M0 60h300\"/><use href=\"#mark-{look}\" x=\"150\" y=\"60\"/>\
             </g></svg>{}</button>\n",
            class(look),
            prose(&label.text)
        )
    });
    let curves = || {
        data.panels
            .iter()
            .flat_map(|panel| panel.curves.iter().flatten())
    };
    let others = [
        (
            "paper",
            "the paper, after training",
            curves().any(|curve| curve.paper.is_some()),
        ),
        (
            "demo",
            "the demonstration",
            data.panels.iter().any(|panel| panel.demo.is_some()),
        ),
        (
            "tolerance",
            "tolerance d of the same colour’s curve",
            curves().any(|curve| !curve.tolerance.is_empty()),
        ),
    ];
    let others = others
        .into_iter()
        .filter(|(_, _, shown)| *shown)
        .map(|(class, name, _)| {
            format!(
                "<span class=\"key\"><svg class=\"sample\" viewBox=\"0 0 300 120\" \
                 aria-hidden=\"true\"><path class=\"{class}\" d=\"M0 60h300\"/>\
                 </svg>{name}</span>\n"
            )
        });
    series.chain(others).collect()
}

/// The axes of `panel`.
pub fn axes(data: &CurveData, panel: &Panel) -> Axes {
    let (_, width, height) = size(data);
    let (x, y) = (x_scale(data, panel), y_scale(data, panel));
    let labels = y
        .ticks(5)
        .iter()
        .map(|tick| text_width(&tick.label, TEXT))
        .fold(150.0, f64::max);
    let paper = panel
        .curves
        .iter()
        .flatten()
        .any(|curve| curve.paper.is_some());
    let right = width - if paper { GUTTER } else { 60.0 };
    Axes {
        left: (labels + 70.0).round(),
        right,
        top: 200.0,
        bottom: height - 390.0,
        x,
        y,
    }
}

/// A panel: its title, its axes and its curves.
pub fn panel_html(data: &CurveData, index: usize, panel: &Panel, stride: usize) -> String {
    let (_, width, height) = size(data);
    let axes = axes(data, panel);
    let named = panel.curves.iter().zip(&data.looks).enumerate();
    let drawn: Vec<(usize, usize, &Curve)> = named
        .filter_map(|(series, (curve, look))| Some((series, *look, curve.as_ref()?)))
        .collect();
    let turns = drawn.len();
    let papers = beside::places(&axes.y, beside::values(panel));
    let lines = drawn
        .iter()
        .enumerate()
        .map(|(turn, &(series, look, curve))| {
            // Markers of several curves are shifted, so that none hides another.
            let shift = (turn as f64 + 0.5) / turns as f64;
            format!(
                "<g class=\"series {}\" data-series=\"{series}\">{}{}</g>",
                class(look),
                line(curve, look, &axes, stride, shift),
                papers[series].map_or(String::new(), |place| paper_value(place, &axes))
            )
        });
    let (title, y_label) = (prose(&panel.title), escape::html(&data.y_label));
    let demo = panel.demo.map_or(String::new(), |demo| {
        format!(
            "<path class=\"demo\" d=\"M{} {:.0}H{}\"/>",
            axes.left,
            axes.height_of(demo),
            axes.right
        )
    });
    let empty = if drawn.iter().all(|(_, _, curve)| curve.points.is_empty()) {
        let (x, y) = (
            (axes.left + axes.right) / 2.0,
            (axes.top + axes.bottom) / 2.0,
        );
        format!("<text class=\"middle\" x=\"{x:.0}\" y=\"{y:.0}\">nothing to draw yet</text>")
    } else {
        String::new()
    };
    format!(
        "<div class=\"panel\"><h4>{title}</h4>\n\
         <svg viewBox=\"0 0 {width} {height}\" data-panel=\"{index}\" tabindex=\"0\" role=\"img\" \
         aria-label=\"{title}: {y_label} over {x_label}. Arrow keys read values.\">\
         <text x=\"0\" y=\"{TEXT}\">{y_label}</text>{grid}{demo}{lines}{empty}\
         <text class=\"end\" x=\"{right}\" y=\"{under:.0}\">{x_label}</text></svg></div>\n",
        grid = grid(data, &axes),
        lines = lines.collect::<String>(),
        right = axes.right,
        x_label = data.across.label(),
        under = height - 40.0,
    )
}

fn grid(data: &CurveData, axes: &Axes) -> String {
    let Axes {
        left,
        right,
        top,
        bottom,
        ..
    } = *axes;
    let y_mark = |tick: &Tick| {
        let y = axes.height_of(tick.at);
        let text = &tick.label;
        format!(
            "<path class=\"rule\" d=\"M{left} {y:.0}H{right}\"/>\
             <text class=\"end\" x=\"{:.0}\" y=\"{:.0}\">{text}</text>",
            left - 50.0,
            y + 38.0
        )
    };
    let x_mark = |tick: &Tick| {
        let x = axes.across(tick.at);
        format!(
            "<path class=\"axis\" d=\"M{x:.0} {bottom}v35\"/>\
             <text class=\"middle\" x=\"{x:.0}\" y=\"{:.0}\">{}</text>",
            bottom + 150.0,
            tick.label
        )
    };
    let rules: String = axes
        .y
        .ticks(5)
        .iter()
        .filter(|tick| !tick.label.is_empty())
        .map(y_mark)
        .collect();
    let wanted = ((right - left) / (5.0 * TEXT)) as usize;
    let marks: String = x_ticks(data, &axes.x, wanted).iter().map(x_mark).collect();
    format!("{rules}{marks}<path class=\"axis\" d=\"M{left} {top}V{bottom}H{right}\"/>")
}

/// A curve: its band, its mean, its markers.
fn line(curve: &Curve, look: usize, axes: &Axes, stride: usize, shift: f64) -> String {
    let mut drawn = String::new();
    // Later shapes cover earlier ones, so the tolerance and the band come before the mean.
    if curve.tolerance.len() > 1 {
        let points = thinned(&curve.tolerance, stride).map(|point| axes.at(*point));
        drawn.push_str(&format!(
            "<path class=\"tolerance\" d=\"{}\"/>",
            path(points)
        ));
    }
    // A method that does not train has one value, drawn from side to side.
    if let Some(level) = curve.level() {
        let y = axes.height_of(level.mean);
        if let Some((low, high)) = level.band {
            let (low, high) = (axes.height_of(low), axes.height_of(high));
            drawn.push_str(&format!(
                "<path class=\"band\" d=\"M{} {low:.0}H{}V{high:.0}H{}z\"/>",
                axes.left, axes.right, axes.left
            ));
        }
        drawn.push_str(&format!(
            "<path class=\"mean\" d=\"M{} {y:.0}H{}\"/>",
            axes.left, axes.right
        ));
        drawn.push_str(&mark(
            look,
            (axes.left + shift * (axes.right - axes.left), y),
        ));
    } else {
        for stretch in curve.stretches() {
            let points: Vec<&Point> = thinned(stretch, stride).collect();
            let ends = |end: fn((f64, f64)) -> f64| {
                let ends = points
                    .iter()
                    .filter_map(move |point| Some(axes.at((point.env_steps, end(point.band?)))));
                ends.collect::<Vec<_>>()
            };
            let (low, high) = (ends(|band| band.0), ends(|band| band.1));
            if !low.is_empty() {
                let around = low.into_iter().chain(high.into_iter().rev());
                drawn.push_str(&format!("<path class=\"band\" d=\"{}z\"/>", path(around)));
            }
            let means: Vec<(f64, f64)> = points
                .iter()
                .map(|point| axes.at((point.env_steps, point.mean)))
                .collect();
            match means.as_slice() {
                // A path of one point cannot be seen.
                [alone] => drawn.push_str(&mark(look, *alone)),
                _ => drawn.push_str(&format!(
                    "<path class=\"mean\" d=\"{}\"/>",
                    path(means.into_iter())
                )),
            }
        }
        let last = curve.points.len().saturating_sub(1) as f64;
        let marked = (0..MARKS).filter_map(|n| {
            curve
                .points
                .get(((n as f64 + shift) / MARKS as f64 * last) as usize)
        });
        let marks: String = marked
            .map(|point| mark(look, axes.at((point.env_steps, point.mean))))
            .collect();
        drawn.push_str(&marks);
    }
    drawn
}

/// One of the paper's values beside the axes: a dash at its height, or an arrow at the axis' end.
fn paper_value(place: Beside, axes: &Axes) -> String {
    let (from, middle) = (axes.right + 20.0, axes.right + 75.0);
    // Each arrow points outwards from `end`, and stands further inwards than the one before.
    let arrow = |end: f64, inwards: f64, turn: usize| {
        let (tip, height) = (end + inwards * 108.0 * turn as f64, inwards * 90.0);
        format!("<path class=\"paper-beyond\" d=\"M{middle} {tip:.0}l-50 {height}h100z\"/>")
    };
    match place {
        Beside::Within(value) => {
            let y = axes.height_of(value);
            format!("<path class=\"paper-value\" d=\"M{from} {y:.0}h110\"/>")
        }
        Beside::Above(turn) => arrow(axes.top, 1.0, turn),
        Beside::Below(turn) => arrow(axes.bottom, -1.0, turn),
    }
}

fn mark(look: usize, (x, y): (f64, f64)) -> String {
    format!("<use href=\"#mark-{look}\" x=\"{x:.0}\" y=\"{y:.0}\"/>")
}

/// Every `stride`-th item, and always the last one.
pub fn thinned<T>(all: &[T], stride: usize) -> impl Iterator<Item = &T> {
    all.iter()
        .enumerate()
        .filter(move |(index, _)| index % stride == 0 || index + 1 == all.len())
        .map(|(_, one)| one)
}

/// A line through points, from each to the next.
fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut text = String::new();
    let mut before = None;
    for (x, y) in points.map(|(x, y)| (x.round() as i64, y.round() as i64)) {
        let (dx, dy) = match before {
            None => (x, y),
            Some((x0, y0)) => (x - x0, y - y0),
        };
        text.push_str(match before {
            None => "M",
            Some(_) if !text.contains('l') => "l",
            Some(_) if dx < 0 => "",
            Some(_) => " ",
        });
        text.push_str(&if dy < 0 {
            format!("{dx}{dy}")
        } else {
            format!("{dx} {dy}")
        });
        before = Some((x, y));
    }
    text
}

/// The last value of each curve, for readers who cannot see the figure.
fn ends(data: &CurveData, title: &str) -> String {
    let row = |panel: &Panel, name: &str, curve: &Curve| {
        let end = curve.points.last()?;
        let band = end.band.map_or(String::new(), |(low, high)| {
            format!("{} to {}", short(low), short(high))
        });
        let (steps, seeds) = (
            alone(end.env_steps),
            format!("{} of {}", curve.seeds, curve.planned),
        );
        Some(vec![
            panel.title.clone(),
            name.to_owned(),
            steps,
            short(end.mean),
            band,
            seeds,
        ])
    };
    let rows = data.panels.iter().flat_map(|panel| {
        let named = data.series.iter().zip(&panel.curves);
        named.filter_map(move |(label, curve)| row(panel, &label.text, curve.as_ref()?))
    });
    let at = if data.across == Across::Steps {
        "at step"
    } else {
        "at"
    };
    let headers = ["panel", "series", at, "mean", "band", "seeds"]
        .map(str::to_owned)
        .to_vec();
    let grid = Grid {
        headers,
        rows: rows.collect(),
        names: 2,
        numeric: vec![false, false, true, true, true, true],
    };
    format!(
        "<details class=\"more\"><summary>The end of each curve, as a table</summary>\n\
         {}</details>\n",
        table::html(&grid, title, true)
    )
}

/// A value of any size in few characters.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 | 0.01..1e6 => alone(value),
        _ => format!("{value:.2e}").replace('-', "−"),
    }
}
