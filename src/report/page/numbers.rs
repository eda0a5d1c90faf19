//! The numbers beside the figures, which the script shows under the pointer: five digits of each.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::{
    Figure,
    figure::{axes, class, curves_of, stride, thinned},
};
use crate::report::curve::{Across, Curve, CurveData, Point, Single};

/// The numbers of all figures, as JSON, for the script.
pub fn data(figures: &[Figure<'_>]) -> String {
    let stride = stride(figures);
    let all = figures
        .iter()
        .map(|figure| curves_of(figure).map_or(Value::Null, |data| numbers(data, stride)));
    Value::Array(all.collect()).to_string()
}

fn numbers(data: &CurveData, stride: usize) -> Value {
    let panels = data.panels.iter().map(|panel| {
        let axes = axes(data, panel);
        let curves = panel
            .curves
            .iter()
            .enumerate()
            .filter_map(|(series, curve)| Some((series, curve.as_ref()?)));
        let curves: Vec<Value> = curves
            .map(|(series, curve)| of_curve(series, curve, stride))
            .collect();
        json!({
            "title": panel.title,
            "box": [axes.left, axes.right, axes.top, axes.bottom],
            "x": [axes.x.low, axes.x.high],
            "y": [axes.y.low, axes.y.high],
            "curves": curves,
        })
    });
    let series: Vec<Value> = data
        .series
        .iter()
        .zip(&data.looks)
        .map(|(label, look)| json!({"name": label.text, "class": class(*look)}))
        .collect();
    let unit = if data.across == Across::Steps {
        "steps"
    } else {
        data.across.label()
    };
    json!({"unit": unit, "log": data.log_y, "series": series, "panels": panels.collect::<Vec<_>>()})
}

fn of_curve(series: usize, curve: &Curve, stride: usize) -> Value {
    let points: Vec<&Point> = curve
        .stretches()
        .flat_map(|stretch| thinned(stretch, stride))
        .collect();
    let starts = points.windows(2).enumerate();
    let breaks: Vec<usize> = starts
        .filter(|(_, pair)| curve.gap_between(pair[0].env_steps, pair[1].env_steps))
        .map(|(index, _)| index + 1)
        .collect();
    let kept: BTreeSet<u64> = points.iter().map(|point| point.env_steps as u64).collect();
    let single = |single: &Single| {
        let values = single
            .points
            .iter()
            .filter(|(x, _)| kept.contains(&(*x as u64)))
            .map(|(_, y)| digits(*y));
        json!([single.seed, values.collect::<Vec<_>>()])
    };
    let end = |end: fn((f64, f64)) -> f64| {
        points
            .iter()
            .map(|point| point.band.map(|band| digits(end(band))))
            .collect()
    };
    let (low, high): (Vec<Option<Value>>, Vec<Option<Value>>) =
        (end(|band| band.0), end(|band| band.1));
    json!({
        "series": series,
        "x": points.iter().map(|point| whole(point.env_steps)).collect::<Vec<_>>(),
        "mean": points.iter().map(|point| digits(point.mean)).collect::<Vec<_>>(),
        "low": low,
        "high": high,
        "seeds": curve.singles.iter().map(single).collect::<Vec<_>>(),
        "breaks": breaks,
        "level": curve.level().is_some(),
    })
}

/// Five digits of a number; those of a whole one without a point.
fn digits(value: f64) -> Value {
    whole(format!("{value:.4e}").parse().unwrap_or(f64::NAN))
}

/// A number, without a point where it needs none.
fn whole(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < 1e15 {
        json!(value as i64)
    } else {
        json!(value)
    }
}
