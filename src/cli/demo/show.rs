//! `mcpo-run demo show FILE...`.

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, bail};

use super::{super::print, mmd_of_doing_nothing, rewards::Rewards, size, summary, traces};
use crate::{demo::Demonstration, record::write_atomically};

/// The arguments of `demo show`.
#[derive(Debug, clap::Args)]
pub struct ShowArguments {
    /// The demonstrations (*.parquet); for several, one line each
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Draw returns and actions over the steps into this file
    #[arg(long, value_name = "PNG")]
    out: Option<PathBuf>,
}

/// Prints the demonstration's facts, and draws it; of several, prints a table.
pub fn run(arguments: &ShowArguments) -> anyhow::Result<ExitCode> {
    let file = match arguments.files.as_slice() {
        [file] => file,
        _ if arguments.out.is_some() => bail!("`--out` draws one demonstration"),
        files => {
            print(&table(files)?)?;
            return Ok(ExitCode::SUCCESS);
        }
    };
    let demonstration = Demonstration::read(file)?;
    let rewards = Rewards::of(&demonstration, file)?;
    print(&facts(&demonstration, rewards.as_ref()))?;
    if let Some(out) = &arguments.out {
        let name = file
            .file_name()
            .map(|name| name.to_string_lossy())
            .unwrap_or_default();
        let png = traces::picture(&name, &demonstration, rewards.as_ref())
            .png()
            .context("cannot draw the demonstration")?;
        write_atomically(out, &png)?;
        print(&format!("drawn in {}\n", out.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A Markdown table of the demonstrations in `files`, with the numbers that decide how tight a
/// tolerance is.
fn table(files: &[PathBuf]) -> anyhow::Result<String> {
    let mut text = "| file | episodes | steps | return | action rms | D of doing nothing |\n\
                    |---|---:|---:|---:|---:|---:|\n"
        .to_owned();
    for file in files {
        let demonstration = Demonstration::read(file)?;
        let rewards = Rewards::of(&demonstration, file)?;
        let episodes = demonstration.episode_starts.len();
        let earned = rewards.map_or_else(
            || "not recorded".to_owned(),
            |rewards| {
                format!(
                    "{:.1}",
                    rewards.values.iter().sum::<f64>() / episodes as f64
                )
            },
        );
        text += &format!(
            "| {} | {episodes} | {} | {earned} | {:.3} | {:.1e} |\n",
            file.display(),
            demonstration.len(),
            demonstration.action_rms(),
            mmd_of_doing_nothing(&demonstration),
        );
    }
    Ok(text)
}

/// The facts of `demonstration`, as text.
fn facts(demonstration: &Demonstration, rewards: Option<&Rewards>) -> String {
    let lengths: Vec<f64> = demonstration
        .episodes()
        .map(|steps| steps.len() as f64)
        .collect();
    let ended = |flags: &[bool]| flags.iter().filter(|&&flag| flag).count();
    let range = |numbers: &[f64]| {
        let (least, most) = numbers
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
                (a.min(x), b.max(x))
            });
        format!("from {least:.4} to {most:.4}")
    };
    let rows = [
        ("size", size(demonstration)),
        ("length", summary(&lengths)),
        (
            "return",
            rewards.map_or_else(
                || "not recorded".to_owned(),
                |rewards| {
                    format!(
                        "{}, {}",
                        summary(&demonstration.sums(&rewards.values)),
                        rewards.source
                    )
                },
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
        (
            "actions",
            format!(
                "{}, rms {:.3}",
                range(demonstration.actions.as_slice()),
                demonstration.action_rms()
            ),
        ),
        (
            "doing nothing",
            format!(
                "MMD^2 {:.1e} at its states, with sigma 1: d is a share of it",
                mmd_of_doing_nothing(demonstration)
            ),
        ),
        (
            "poses",
            if demonstration.poses.is_some() {
                "recorded"
            } else {
                "not recorded; it cannot be replayed"
            }
            .to_owned(),
        ),
    ];
    // The recorder chose the keys of the provenance, so they are listed as they are.
    let provenance = demonstration
        .provenance
        .iter()
        .map(|(key, value)| (key.as_str(), value.clone()));
    rows.into_iter()
        .chain(provenance)
        .map(|(key, value)| format!("{key:<14} {value}\n"))
        .collect()
}
