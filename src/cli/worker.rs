//! `mcpo-run worker`: what other commands start.

use std::{env, path::PathBuf, process::ExitCode};

use anyhow::Context;

use super::complain;
use crate::schedule::{
    element::{self, Ended},
    slurm,
    stop::{INTERRUPTED, StopRequest},
    worker,
};

/// The arguments of `worker`.
#[derive(Debug, clap::Args)]
pub struct WorkerArguments {
    /// A frozen plan; without it, the job is on stdin
    #[arg(long, value_name = "FILE", requires = "index")]
    manifest: Option<PathBuf>,
    /// The element of the plan, counted from 0
    #[arg(long, value_name = "N", requires = "manifest")]
    index: Option<usize>,
}

/// Does the job that stdin or the frozen plan holds.
pub fn run(arguments: &WorkerArguments) -> anyhow::Result<ExitCode> {
    let Some((plan, index)) = arguments.manifest.as_deref().zip(arguments.index) else {
        return Ok(worker::run());
    };
    let stop = StopRequest::on_signals().context("cannot listen for signals")?;
    let ended = element::run(plan, index, &stop)?;
    if ended.summary.left > 0 && ended.summary.interrupted {
        if stop.is_warning() {
            resume_later(&ended);
        }
        return Ok(ExitCode::from(INTERRUPTED));
    }
    let all_is_well = ended.summary.failed.is_empty() && ended.summary.left == 0;
    Ok(if all_is_well {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Has the cluster start this element again because its time is nearly up. It does so only if some
/// run made progress, since it would otherwise repeat for ever.
fn resume_later(ended: &Ended) {
    let variable = |name| env::var(name).ok();
    let Some((job, index)) = variable("SLURM_ARRAY_JOB_ID").zip(variable("SLURM_ARRAY_TASK_ID"))
    else {
        return;
    };
    let requeued = match ended.is_farther {
        true => slurm::requeue(&format!("{job}_{index}"))
            .context("this element cannot be started again"),
        false => Err(anyhow::anyhow!(
            "no run got any farther: this element needs a longer time limit"
        )),
    };
    if let Err(error) = requeued {
        complain(&error);
    }
}
