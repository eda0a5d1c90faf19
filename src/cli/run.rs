//! `mcpo-run run PATH...`, which is `mcpo-run PATH...`.

use std::{collections::BTreeSet, path::Path, process::ExitCode, time::Duration};

use anyhow::Context;

use super::{
    chosen::Chosen, complain, demo::counted, duration, plan, recompute::NO_PROGRAM, report,
};
use crate::{
    plan::RunSpec,
    report::Scope,
    schedule::{
        campaign::{HANG_TIMEOUT, Options, Summary},
        cost::CostModel,
        local::{self, physical_cores},
        preflight,
        progress::{Progress, Style, clock, thousands},
        shard::Shard,
        state::{Planned, unfinished},
        stop::{INTERRUPTED, StopRequest},
    },
};

/// The arguments of `run`.
#[derive(Debug, clap::Args)]
pub struct RunArguments {
    #[command(flatten)]
    chosen: Chosen,
    /// Runs at a time, one process each [default: the physical cores divided by the threads of each
    /// run]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Threads that share the work of each run, without changing its numbers [default: 1; where
    /// fewer runs than `--jobs` are left, those that start share the rest]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Retry a failed run up to K times, each time from its last checkpoint
    #[arg(long, value_name = "K", default_value_t = 0)]
    retries: u32,
    /// Stop everything at the first failure
    #[arg(long)]
    fail_fast: bool,
    /// Set aside (rename) what was recorded with other settings or is damaged, and start again
    #[arg(long)]
    fresh: bool,
    /// Kill a run that makes no progress for this many seconds
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = HANG_TIMEOUT.as_secs(),
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    hang_timeout: u64,
    /// Run only part K of N, as each of N machines does with its own K from 1 to N, and write no
    /// report
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// After this time, such as 2h or 1h30m, let the runs under way write a checkpoint, and exit as
    /// interrupted
    #[arg(long, value_name = "TIME", value_parser = duration::parse)]
    max_time: Option<Duration>,
    /// Show what would be run, and stop
    #[arg(long)]
    dry_run: bool,
    /// Show only failures
    #[arg(long, short, conflicts_with = "verbose")]
    quiet: bool,
    /// Show evaluations, and log every iteration
    #[arg(long, short)]
    verbose: bool,
}

impl RunArguments {
    /// How the runs are to be started.
    fn options(&self) -> Options {
        let threads = self.threads.map(usize::from);
        // More threads than cores would only wait for each other.
        let jobs = self.jobs.map_or_else(
            || (physical_cores() / threads.unwrap_or(1)).max(1),
            usize::from,
        );
        Options {
            jobs,
            threads,
            retries: self.retries,
            fail_fast: self.fail_fast,
            hang_timeout: Duration::from_secs(self.hang_timeout),
            verbose: self.verbose,
        }
    }
}

/// Runs the missing runs, then writes the reports.
pub fn run(arguments: &RunArguments) -> anyhow::Result<ExitCode> {
    let chosen = &arguments.chosen;
    let specs = chosen.load()?;
    let mut planned = chosen.planned(&specs)?;
    if let Some(shard) = arguments.shard {
        planned = shard.of(planned);
    }
    if arguments.dry_run {
        return plan::show(&specs, &planned, false);
    }
    // From here on, a signal stops cleanly.
    let mut stop = StopRequest::on_signals().context("cannot listen for signals")?;
    if let Some(time) = arguments.max_time {
        stop = stop.or_after(time);
    }
    let summary = run_missing(arguments, &planned, &stop)?;
    // A stop that came after everything had ended does not count.
    if summary.interrupted && summary.left > 0 {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    let all_is_well = summary.failed.is_empty() && summary.left == 0;
    // Other machines run the other parts, so there is no whole report to write yet.
    if arguments.shard.is_some() {
        return Ok(if all_is_well {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        });
    }
    // The report covers the whole file: `--only` selects what to run, and earlier runs still belong
    // to it.
    let scope = Scope {
        axis: chosen.axis.clone(),
        set: chosen.set.clone(),
        ..Scope::default()
    };
    let written = report::write(&specs, &chosen.results, &scope, arguments.quiet)
        .context("the runs are recorded, but not their report");
    if all_is_well {
        return written.map(|_| ExitCode::SUCCESS);
    }
    // Runs that failed decide the exit code, whatever becomes of the report.
    if let Err(error) = written {
        complain(&error);
    }
    Ok(ExitCode::FAILURE)
}

/// Runs those of the `planned` runs that have not finished, until all have ended or `stop` asks.
fn run_missing(
    arguments: &RunArguments,
    planned: &[Planned],
    stop: &StopRequest,
) -> anyhow::Result<Summary> {
    let results = &arguments.chosen.results;
    let states = preflight::prepare(planned, results, arguments.fresh)?;
    let due: Vec<Planned> = unfinished(planned, &states)
        .map(|(run, _)| run.clone())
        .collect();
    if due.is_empty() {
        return Ok(Summary::default());
    }
    let options = arguments.options();
    let costs = CostModel::of(planned, &states);
    let left: Vec<f64> = unfinished(planned, &states)
        .map(|(run, state)| plan::seconds_of(run, state, &costs))
        .collect();
    let seconds = left.iter().sum();
    let style = Style::choose(arguments.quiet);
    let mut progress = Progress::new(style, arguments.verbose, left);
    progress.say(&greeting(planned, &due, options.jobs, seconds, results));
    let summary =
        local::run(&due, results, options, &costs, stop, &mut progress).context(NO_PROGRAM)?;
    progress.say(&farewell(planned.len(), due.len(), &summary));
    Ok(summary)
}

/// The first screen: the runs to start, and the place of their results.
fn greeting(
    planned: &[Planned],
    due: &[Planned],
    jobs: usize,
    seconds: f64,
    results: &Path,
) -> String {
    let names = |of: fn(&RunSpec) -> String| {
        due.iter()
            .map(|run| of(&run.spec))
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect::<Vec<_>>()
            .join(", ")
    };
    let experiments = names(|spec| spec.experiment.clone());
    let steps: u64 = due.iter().map(|run| run.spec.trained_steps()).sum();
    let before = planned.len() - due.len();
    let before = if before > 0 {
        format!(", {before} finished before")
    } else {
        String::new()
    };
    format!(
        "{experiments}: {} to do{before}; {} on {}; {} steps in all\n\
         {jobs} at a time, about {}; results in {}",
        counted(due.len(), "run"),
        names(|spec| spec.algorithm_name().to_owned()),
        names(|spec| spec.env.to_string()),
        thousands(steps as f64),
        clock(seconds / jobs.min(due.len()) as f64),
        results.display(),
    )
}

/// The last line: how the runs ended.
fn farewell(planned: usize, due: usize, summary: &Summary) -> String {
    let finished = planned - due + summary.finished;
    let failed = summary.failed.len();
    let failed = if failed > 0 {
        format!(", {failed} failed")
    } else {
        String::new()
    };
    let left = match (summary.left, summary.interrupted) {
        (0, _) => String::new(),
        (left, true) => {
            format!(", {left} interrupted or not begun; the same command resumes from here")
        }
        (left, false) => {
            format!(", {left} stopped or not begun; the same command resumes from here")
        }
    };
    format!("{finished} of {planned} runs finished{failed}{left}")
}
