//! `mcpo-run demo show FILE`.

use std::{path::PathBuf, process::ExitCode};

use super::{super::print, size, summary};
use crate::demo::Demonstration;

/// Which file.
#[derive(Debug, clap::Args)]
pub struct ShowArguments {
    /// The demonstration (*.parquet)
    file: PathBuf,
}

/// Prints the demonstration's facts.
pub fn run(arguments: &ShowArguments) -> anyhow::Result<ExitCode> {
    let demonstration = Demonstration::read(&arguments.file)?;
    print(&facts(&demonstration))?;
    Ok(ExitCode::SUCCESS)
}

/// What there is to say of `demonstration`.
fn facts(demonstration: &Demonstration) -> String {
    let lengths: Vec<f64> = demonstration.episodes().map(|steps| steps.len() as f64).collect();
    let ended = |flags: &[bool]| flags.iter().filter(|&&flag| flag).count();
    let range = |numbers: &[f64]| {
        let (least, most) = numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
        format!("from {least:.4} to {most:.4}")
    };
    let rows = [
        ("size", size(demonstration)),
        ("length", summary(&lengths)),
        ("return", demonstration.returns().map_or_else(|| "not recorded".to_owned(), |returns| summary(&returns))),
        (
            "ends",
            format!(
                "{} terminated, {} cut by a time limit",
                ended(&demonstration.terminated),
                ended(&demonstration.truncated)
            ),
        ),
        ("observations", range(demonstration.observations.as_slice())),
        ("actions", range(demonstration.actions.as_slice())),
        (
            "poses",
            if demonstration.poses.is_some() { "recorded" } else { "not recorded; it cannot be replayed" }.to_owned(),
        ),
    ];
    let provenance = demonstration.provenance.iter().map(|(key, value)| (key.as_str(), value.clone()));
    rows.into_iter().chain(provenance).map(|(key, value)| format!("{key:<14} {value}\n")).collect()
}
