//! `mcpo-run demo collect|import|verify|show`.

use std::process::ExitCode;

/// What to do with demonstrations.
#[derive(Debug, clap::Subcommand)]
pub enum DemoCommand {}

/// Does it.
pub fn run(command: DemoCommand) -> anyhow::Result<ExitCode> {
    match command {}
}
