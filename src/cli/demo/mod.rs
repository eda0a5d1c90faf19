//! `mcpo-run demo collect|import|verify|show`.

mod collect;
mod import;
mod rewards;
mod show;
mod traces;
mod verify;

use std::{path::Path, process::ExitCode};

use anyhow::ensure;

use crate::{
    demo::{Bandwidth, Demonstration, Estimator},
    quantity::constant,
};

/// The subcommands of `demo`.
#[derive(Debug, clap::Subcommand)]
pub enum DemoCommand {
    /// Take demonstrations from the policies that runs kept during training
    ///
    /// For each environment, plays the kept policies' mean actions from a few initial states, and
    /// writes one episode as that environment's demonstration: of those whose dense return is
    /// within 1 % of the paper's, and whose policy's mean return is within 20 % of it, the one
    /// whose length, rms of actions and MMD^2 to doing nothing are the most like those of the
    /// authors' demonstration. Where no policy's mean is that near, the one whose policy's mean is
    /// nearest; where no return is within 1 %, or a return is asked for, the one with the nearest
    /// return.
    Collect(collect::CollectArguments),
    /// Read a demonstration from elsewhere and write it in this program's format
    ///
    /// The file may be a pickle of the authors' code (compressed by bzip2 or not), Parquet, or .npz
    /// with arrays such as observations and actions. Prints its length, its return as far as
    /// observations and actions give it, and what was lost. No code in the file is run.
    Import(import::ImportArguments),
    /// Replay a demonstration and compare
    ///
    /// Puts the environment into each episode's first pose, takes the recorded actions, and prints
    /// the greatest deviations of observation, reward and end. Exits with 4 where one is over the
    /// tolerance.
    Verify(verify::VerifyArguments),
    /// Print a demonstration's facts, and draw its returns and actions; for several, print a table
    ///
    /// Beside length and return: the rms of the actions, and MMD^2 to the policy that does nothing,
    /// by which a tolerance d can be chosen.
    Show(show::ShowArguments),
}

/// Runs a subcommand of `demo`.
pub fn run(command: DemoCommand) -> anyhow::Result<ExitCode> {
    match command {
        DemoCommand::Collect(arguments) => collect::run(&arguments),
        DemoCommand::Import(arguments) => import::run(&arguments),
        DemoCommand::Verify(arguments) => verify::run(&arguments),
        DemoCommand::Show(arguments) => show::run(&arguments),
    }
}

/// Refuses to replace an existing file, unless `force` is set.
fn not_over(file: &Path, force: bool) -> anyhow::Result<()> {
    let told = "already exists; `--force` replaces it, another `--out` leaves it alone";
    ensure!(force || !file.exists(), "{} {told}", file.display());
    Ok(())
}

/// The size of a demonstration, as `3 episodes, 1200 steps; observations of 11 numbers, actions of
/// 3`.
fn size(demonstration: &Demonstration) -> String {
    let episodes = demonstration.episode_starts.len();
    format!(
        "{}, {}; observations of {}, actions of {}",
        counted(episodes, "episode"),
        counted(demonstration.len(), "step"),
        counted(demonstration.observations.nrows(), "number"),
        counted(demonstration.actions.nrows(), "number"),
    )
}

/// D of the policy that does nothing, as `mcpo` measures it by default.
fn mmd_of_doing_nothing(demonstration: &Demonstration) -> f64 {
    demonstration.mmd_of_doing_nothing(Bandwidth::Fixed(constant(1.0)), Estimator::V)
}

/// A count with its noun in the right number: `1 episode`, `2 episodes`.
pub(super) fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// A few values in full, or the mean and range of many.
fn summary(values: &[f64]) -> String {
    if values.len() <= 5 {
        return values
            .iter()
            .map(|value| format!("{value:.4}"))
            .collect::<Vec<_>>()
            .join(", ");
    }
    let (least, most) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
            (a.min(x), b.max(x))
        });
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    format!("{mean:.4} in the mean, from {least:.4} to {most:.4}")
}
