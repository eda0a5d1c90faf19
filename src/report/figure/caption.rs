//! The text of a figure's caption about its curves.

use std::collections::BTreeSet;

use super::{
    axes::y_scale,
    beside::{self, Beside},
};
use crate::{
    report::{
        amount,
        curve::{Curve, CurveData, LeftOut},
        over_seeds::SEEDS_FOR_T,
        text::alone,
    },
    spec::Band,
};

/// Notes on the curves: their seeds and bands, what is lacking, and what lies beyond the axes.
pub struct Notes {
    /// The meaning of curves and bands, for the caption.
    pub means: String,
    /// What the figure itself must say: the seeds and steps that are lacking, and the paper's
    /// values that its axes do not reach; empty where there is nothing.
    pub inside: String,
}

impl Notes {
    /// Both notes in one line.
    pub fn all(&self) -> String {
        [self.means.as_str(), &self.inside]
            .iter()
            .filter(|part| !part.is_empty())
            .copied()
            .collect::<Vec<_>>()
            .join(" ")
    }
}

/// The notes of `data`.
pub fn notes(data: &CurveData) -> Notes {
    if let Some(caption) = &data.caption {
        return Notes {
            means: caption.clone(),
            inside: String::new(),
        };
    }
    let curves: Vec<(&str, &str, &Curve)> = data
        .panels
        .iter()
        // A panel without any seeds says so itself.
        .filter(|panel| panel.curves.iter().flatten().any(|curve| curve.seeds > 0))
        .flat_map(|panel| {
            let named = data.series.iter().zip(&panel.curves);
            named.filter_map(|(name, curve)| {
                Some((panel.title.as_str(), name.text.as_str(), curve.as_ref()?))
            })
        })
        .collect();
    if curves.is_empty() {
        return Notes {
            means: String::new(),
            inside: String::new(),
        };
    }
    let drawn = || {
        curves
            .iter()
            .map(|(_, _, curve)| curve.seeds)
            // Curves without a seed would make the fewest 0.
            .filter(|seeds| *seeds > 0)
    };
    let (fewest, most) = (drawn().min().unwrap_or(0), drawn().max().unwrap_or(0));
    let mut means = vec![seeds(data, fewest, most)];
    means.extend(data.smooth.map(|steps| {
        format!(
            "Smoothed over {} steps, the unsmoothed mean behind.",
            amount::steps(steps)
        )
    }));
    let name = |env: &str, series: &str| {
        if data.series.len() > 1 {
            format!("{series}, {env}")
        } else {
            env.to_owned()
        }
    };
    // A series that lacks the same in all of its panels is named once.
    let same_everywhere = |series: &str| {
        let mut of: BTreeSet<Option<String>> = BTreeSet::new();
        let panels = curves.iter().filter(|(_, other, _)| *other == series);
        panels
            .map(|(_, _, curve)| of.insert(curve.lacking()))
            .count()
            > 1
            && of.len() == 1
    };
    let mut lacking: Vec<String> = Vec::new();
    for (panel, series, curve) in &curves {
        let Some(text) = curve.lacking() else {
            continue;
        };
        let name = if same_everywhere(series) {
            (*series).to_owned()
        } else {
            name(panel, series)
        };
        let entry = format!("{name} ({text})");
        // Such a series comes by once for each of its panels.
        if !lacking.contains(&entry) {
            lacking.push(entry);
        }
    }
    // If all curves lack the same, one sentence says it for all of them.
    let kinds: BTreeSet<Option<String>> =
        curves.iter().map(|(_, _, curve)| curve.lacking()).collect();
    let mut notes = Vec::new();
    match kinds.first() {
        _ if lacking.is_empty() => {}
        // None sorts first, so the first kind is a text only where no curve is whole.
        Some(Some(all)) if kinds.len() == 1 && curves.len() > 1 => {
            notes.push(format!("Each curve: {all}."))
        }
        _ => notes.push(format!("Not complete: {}.", shorten(&lacking))),
    }
    let mut left_out = |reason: &str, count: fn(&LeftOut) -> usize| {
        let of: Vec<String> = curves
            .iter()
            .filter(|(_, _, curve)| count(&curve.left_out) > 0)
            .map(|(env, series, curve)| {
                format!("{} ({})", name(env, series), count(&curve.left_out))
            })
            .collect();
        if !of.is_empty() {
            notes.push(format!("{reason}: {}.", shorten(&of)));
        }
    };
    left_out(
        "Gaps where a seed's value is no finite number",
        |left_out| left_out.not_finite,
    );
    left_out(
        "Gaps where a seed's value is not above 0, which this axis cannot show",
        |left_out| left_out.not_positive,
    );
    left_out(
        "Points left out because a seed has none there",
        |left_out| left_out.absent,
    );
    let beyond = beyond(data, name);
    if !beyond.is_empty() {
        notes.push(format!(
            "Arrows, for the paper's values beyond an axis: {}.",
            beyond.join("; ")
        ));
    }
    Notes {
        means: means.join(" "),
        inside: notes.join(" "),
    }
}

/// The paper's values that the axes do not reach, each with the `name` of its panel and series.
fn beyond(data: &CurveData, name: impl Fn(&str, &str) -> String) -> Vec<String> {
    let mut told = Vec::new();
    for panel in &data.panels {
        let places = beside::places(&y_scale(data, panel), beside::values(panel));
        let values = beside::values(panel).zip(places);
        for (series, (value, place)) in data.series.iter().zip(values) {
            if let (Some(value), Some(Beside::Above(_) | Beside::Below(_))) = (value, place) {
                let name = name(&panel.title, &series.text);
                told.push(format!("{name} ({})", alone(value)));
            }
        }
    }
    told
}

/// The number of seeds behind a curve, and the meaning of shaded areas and thin lines.
fn seeds(data: &CurveData, fewest: usize, most: usize) -> String {
    let kind = if data.log_y { "Geometric mean" } else { "Mean" };
    let few = fewest < SEEDS_FOR_T;
    let beside = match data.band {
        Band::T if most < SEEDS_FOR_T => "shaded: from one to the other",
        Band::T if few => {
            "shaded: 95 % Student t interval, of two seeds their range, cut at the frame"
        }
        Band::T => "shaded: 95 % Student t interval, cut at the frame",
        Band::Std => "shaded: one standard deviation of the seeds to each side, cut at the frame",
        Band::Bootstrap => {
            "shaded: 95 % bootstrap interval of the mean, which is too narrow for few seeds"
        }
        Band::Seeds => "thin: each seed",
    };
    match most {
        0 | 1 => "One seed a curve.".to_owned(),
        _ if fewest < most => format!("{kind} over {fewest} to {most} seeds; {beside}."),
        _ => format!("{kind} over {most} seeds; {beside}."),
    }
}

/// The first few entries of a list, and the number of the others.
fn shorten(list: &[String]) -> String {
    const SHOWN: usize = 6;
    let shown = list[..list.len().min(SHOWN)].join("; ");
    if list.len() > SHOWN {
        format!("{shown}; and {} more", list.len() - SHOWN)
    } else {
        shown
    }
}
