//! `mcpo-run demo show FILE`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context;

use super::{super::print, size, summary, traces};
use crate::{
    demo::{Demonstration, import::recomputed_rewards},
    record::write_atomically,
};

/// Which file.
#[derive(Debug, clap::Args)]
pub struct ShowArguments {
    /// The demonstration (*.parquet)
    file: PathBuf,
    /// Draw returns and actions over the steps into this file
    #[arg(long, value_name = "PNG")]
    out: Option<PathBuf>,
}

/// Prints the demonstration's facts, and draws it.
pub fn run(arguments: &ShowArguments) -> anyhow::Result<ExitCode> {
    let demonstration = Demonstration::read(&arguments.file)?;
    let rewards = rewards(&demonstration, &arguments.file)?;
    print(&facts(&demonstration, rewards.as_ref()))?;
    if let Some(out) = &arguments.out {
        let name = arguments.file.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        let png =
            traces::picture(&name, &demonstration, rewards.as_ref()).png().context("cannot draw the demonstration")?;
        write_atomically(out, &png)?;
        print(&format!("drawn in {}\n", out.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Dense rewards, and where they are from.
pub struct Rewards {
    /// One a step.
    pub values: Vec<f64>,
    /// `as recorded`, or what they were computed from.
    pub source: &'static str,
}

/// The recorded rewards; else those that observations and actions tell, if it is known of which environment they are.
fn rewards(demonstration: &Demonstration, path: &Path) -> anyhow::Result<Option<Rewards>> {
    if let Some(values) = demonstration.rewards.clone() {
        return Ok(Some(Rewards { values, source: "as recorded" }));
    }
    let env = demonstration.provenance.iter().find(|(key, _)| key == "env").and_then(|(_, name)| name.parse().ok());
    env.map(|env| {
        let values = recomputed_rewards(demonstration, path, env)?;
        Ok(Rewards { values, source: "from observations and actions" })
    })
    .transpose()
}

/// What there is to say of `demonstration`.
fn facts(demonstration: &Demonstration, rewards: Option<&Rewards>) -> String {
    let lengths: Vec<f64> = demonstration.episodes().map(|steps| steps.len() as f64).collect();
    let ended = |flags: &[bool]| flags.iter().filter(|&&flag| flag).count();
    let range = |numbers: &[f64]| {
        let (least, most) = numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
        format!("from {least:.4} to {most:.4}")
    };
    let rows = [
        ("size", size(demonstration)),
        ("length", summary(&lengths)),
        (
            "return",
            rewards.map_or_else(
                || "not recorded".to_owned(),
                |rewards| format!("{}, {}", summary(&demonstration.sums(&rewards.values)), rewards.source),
            ),
        ),
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
