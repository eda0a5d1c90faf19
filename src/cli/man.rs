//! `mcpo-run man [COMMAND]`.

use std::process::ExitCode;

use anyhow::Context;

use super::{definition, print};

/// The arguments of `man`.
#[derive(Debug, clap::Args)]
pub struct ManArguments {
    /// The command; the whole program when absent
    command: Option<String>,
}

/// Prints the manual page.
pub fn run(arguments: &ManArguments) -> anyhow::Result<ExitCode> {
    let mut whole = definition();
    whole.build(); // names the subcommands `mcpo-run-plan` and so on
    let command = match &arguments.command {
        None => whole,
        Some(name) => whole
            .find_subcommand(name)
            .cloned()
            .with_context(|| format!("there is no command `{name}`"))?,
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(command).render(&mut text)?;
    print(&String::from_utf8_lossy(&text))?;
    Ok(ExitCode::SUCCESS)
}
