//! Evaluations as CSV, and the numbers of a figure as JSON.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::method;
use crate::{
    escape,
    measured::{evaluations, progress},
    report::{
        curve::{Across, Curve, CurveData},
        recorded::Run,
        text::{number, value, written},
    },
};

/// Every evaluation episode of the finished runs, one per row after the run's keys.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn evaluations(runs: &[Run]) -> Result<Vec<u8>, csv::Error> {
    // Every row has all axes, empty where its run lacks one, so that all rows have one length.
    let axes: BTreeSet<&str> = runs
        .iter()
        .flat_map(|run| run.spec.axes.keys())
        .map(String::as_str)
        .collect();
    let first = ["env", "algorithm", "method", "seed"];
    let last = [
        evaluations::ENV_STEPS.name,
        evaluations::LAST.name,
        evaluations::DENSE_RETURN.name,
    ];
    let headers: Vec<&str> = first
        .into_iter()
        .chain(axes.iter().copied())
        .chain(last)
        .collect();
    let of_run = |run: &Run| {
        let spec = &run.spec;
        let (env, algorithm) = (spec.env.name().to_owned(), spec.algorithm_name().to_owned());
        let keys = [
            env,
            algorithm,
            escape::csv(method(run)),
            spec.seed.0.to_string(),
        ];
        let keys: Vec<String> = keys
            .into_iter()
            .chain(
                axes.iter()
                    .map(|axis| value(&spec.axes.get(*axis).cloned())),
            )
            .collect();
        let episodes = run
            .recording()
            .map(|recording| recording.evaluations.clone())
            .unwrap_or_default();
        episodes.into_iter().map(move |episode| {
            let own = [
                episode.env_steps.to_string(),
                episode.last.to_string(),
                number(Some(episode.dense_return)),
            ];
            [keys.clone(), own.to_vec()].concat()
        })
    };
    written(&headers, runs.iter().flat_map(of_run))
}

/// The numbers of a figure in full precision: panel by panel, series by series.
pub fn figure(data: &CurveData) -> Value {
    let x = if data.across == Across::Steps {
        progress::ENV_STEPS.name
    } else {
        "normalised_return"
    };
    let of_curve = |name: &str, curve: &Curve| {
        let singles = curve.singles.iter().map(|single| {
            let points = single
                .points
                .iter()
                .map(|point| point.1)
                .collect::<Vec<_>>();
            (single.seed.to_string(), json!(points))
        });
        json!({
            "series": name,
            x: curve.points.iter().map(|point| point.env_steps).collect::<Vec<_>>(),
            "mean": curve.points.iter().map(|point| point.mean).collect::<Vec<_>>(),
            "low": curve
                .points
                .iter()
                .map(|point| point.band.map(|band| band.0))
                .collect::<Vec<_>>(),
            "high": curve
                .points
                .iter()
                .map(|point| point.band.map(|band| band.1))
                .collect::<Vec<_>>(),
            "seeds": singles.collect::<serde_json::Map<_, _>>(),
            "planned_seeds": curve.planned,
            "gaps": curve.gaps,
            "paper": curve.paper,
            "tolerance": curve.tolerance,
        })
    };
    let panels = data.panels.iter().map(|panel| {
        let named = data.series.iter().zip(&panel.curves);
        let curves: Vec<Value> = named
            .filter_map(|(label, curve)| Some(of_curve(&label.text, curve.as_ref()?)))
            .collect();
        json!({"panel": panel.title, "demonstration": panel.demo, "curves": curves})
    });
    let band = match data.band {
        crate::spec::Band::T => "95 % Student t interval",
        crate::spec::Band::Std => "one standard deviation to each side",
        crate::spec::Band::Bootstrap => "95 % bootstrap interval",
        crate::spec::Band::Seeds => "none",
    };
    json!({
        "title": data.title,
        "y": data.y,
        // On a logarithmic axis, the statistics are of logarithms.
        "mean": if data.log_y { "geometric" } else { "arithmetic" },
        "low_and_high": band,
        "panels": panels.collect::<Vec<_>>(),
    })
}
