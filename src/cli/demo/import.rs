//! `mcpo-run demo import FILE --env ENV --out DEMO.parquet`.

use std::{path::PathBuf, process::ExitCode};

use super::{super::print, not_over, size, summary};
use crate::{
    demo::import::{Imported, import, recomputed_rewards},
    env::EnvId,
};

/// The arguments of `demo import`.
#[derive(Debug, clap::Args)]
pub struct ImportArguments {
    /// The file: a pickle of the authors' code, Parquet, or .npz
    file: PathBuf,
    /// The environment, such as Hopper-v2, or robot.toml:NAME for a robot of one's own
    #[arg(long, value_name = "ENV", value_parser = super::super::environment::environment)]
    env: EnvId,
    /// The demonstration to write
    #[arg(long, value_name = "DEMO.parquet")]
    out: PathBuf,
    /// Replace the demonstration if it already exists
    #[arg(long)]
    force: bool,
}

/// Imports the file, and prints its contents and whatever was lost.
pub fn run(arguments: &ImportArguments) -> anyhow::Result<ExitCode> {
    let (path, env) = (&arguments.file, arguments.env);
    not_over(&arguments.out, arguments.force)?;
    let Imported {
        mut demonstration,
        losses,
        warnings,
    } = import(path, env)?;
    let recomputed = demonstration.sums(&recomputed_rewards(&demonstration, path, env)?);
    let recorded = demonstration.returns();
    let earned: f64 = recorded.as_ref().unwrap_or(&recomputed).iter().sum();
    let mean = earned / demonstration.episode_starts.len() as f64;
    demonstration.provenance.retain(|(key, _)| key != "return");
    demonstration
        .provenance
        .push(("return".into(), mean.to_string()));
    demonstration.write(&arguments.out)?;
    let mut text = format!("{} of {env}: {}\n", path.display(), size(&demonstration));
    if let Some(returns) = recorded {
        text += &format!("return, as recorded: {}\n", summary(&returns));
    }
    text += &format!(
        "return, from observations and actions: {}\n",
        summary(&recomputed)
    );
    for loss in losses {
        text += &format!("lost: {loss}\n");
    }
    for warning in warnings {
        text += &format!("warning: {warning}\n");
    }
    text += &format!("written to {}\n", arguments.out.display());
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}
