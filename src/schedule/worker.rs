//! The worker process: reads a job from stdin, trains and records the run, and tells events on
//! stdout.

use std::{
    cmp::Ordering,
    fs::{self, OpenOptions},
    io::{self, BufRead, Read},
    mem,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Mutex,
    thread,
    time::Duration,
};

use tracing::{Level, error, warn};
use tracing_subscriber::{filter::filter_fn, layer::SubscriberExt};

use super::{
    event::{Event, Job},
    recorder::Recorder,
    state::{LastState, Planned},
    stop::{INTERRUPTED, StopRequest},
};
use crate::{
    arithmetic::threads,
    demo::{DemoError, Demonstration},
    intake::{self, Links},
    plan::RunSpec,
    record::{Checkpoint, Claim, Manifest, Outcome, RecordError, RunPaths, Stamp, io_error, now},
    train::{self, Ending, TrainError},
};

/// Errors of a worker.
#[derive(Debug, thiserror::Error)]
enum WorkerError {
    #[error("cannot read the job: {0}")]
    Job(String),
    #[error("cannot set up the worker: {0}")]
    SetUp(#[source] io::Error),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(
        "{} was recorded by another specification (fingerprint {found}; this one has {expected})",
        folder.display()
    )]
    AnotherRun {
        folder: PathBuf,
        found: String,
        expected: String,
    },
    #[error("{} holds a run that is longer than this one: {} steps are recorded", .0.display(), .1)]
    Longer(PathBuf, u64),
    #[error(transparent)]
    Demonstration(#[from] DemoError),
    #[error("{} is not the demonstration that it was when the program was called", .0.display())]
    AnotherDemonstration(PathBuf),
}

/// Does the job that it reads from stdin.
pub fn run() -> ExitCode {
    let (event, code) = match work() {
        Ok(Event::Stopped) => (Event::Stopped, ExitCode::from(INTERRUPTED)),
        Ok(event) => (event, ExitCode::SUCCESS),
        Err(failure) => {
            error!("{failure}");
            (
                Event::Failed {
                    error: failure.to_string(),
                },
                ExitCode::FAILURE,
            )
        }
    };
    event.tell();
    code
}

fn work() -> Result<Event, WorkerError> {
    // This sets the name for `top` and `killall`, which call a program that was started through
    // /proc `exe`. Other systems have no such file.
    let _ = fs::write("/proc/self/comm", env!("CARGO_PKG_NAME"));
    let stop = StopRequest::on_signals().map_err(WorkerError::SetUp)?;
    let job = read_job(&stop)?;
    let spec: RunSpec = serde_json::from_value(job.stamp.spec.clone())
        .map_err(|error| WorkerError::Job(error.to_string()))?;
    let paths = RunPaths::new(job.results.as_ref(), &spec.experiment, &spec.id)?;
    let mut run = Planned {
        spec,
        paths,
        stamp: job.stamp,
    };
    let Some(claim) = Claim::take(&run.paths)? else {
        return Ok(Event::Claimed);
    };
    run.paths.settle()?;
    let ended = run.paths.ended()?;
    if let Some(ended) = &ended {
        refuse_another(&run.paths.complete, ended, &run.stamp)?;
        if ended.outcome == Outcome::Finished {
            match run.spec.trained_steps().cmp(&ended.env_steps) {
                Ordering::Equal => return Ok(Event::Finished),
                Ordering::Less => {
                    return Err(WorkerError::Longer(run.paths.complete, ended.env_steps));
                }
                Ordering::Greater => {}
            }
        }
    }
    // The demonstration's file may have changed since the run was planned.
    if let Some((path, digest)) = run
        .spec
        .demonstration
        .as_ref()
        .zip(run.stamp.demonstration.as_ref())
        && Demonstration::digest(path)? != *digest
    {
        return Err(WorkerError::AnotherDemonstration(path.clone()));
    }
    run.paths.open()?;
    start_log(&run.paths, job.verbose)?;
    let mut recorded = last_state(&run)?;
    // A finished run that is to be extended continues its own manifest.
    let manifest = match Manifest::read(&RunPaths::manifest(&run.paths.partial))?.or(ended) {
        Some(found) => {
            refuse_another(&run.paths.partial, &found, &run.stamp)?;
            // A run without a checkpoint starts again, and is evaluated as is asked for now.
            if recorded.env_steps() > 0 {
                run.keep_evaluating_as(&found.stamp);
            }
            found.taken_up(run.stamp)
        }
        None => Manifest::new(run.stamp),
    };
    let state = Some(mem::take(&mut recorded.state)).filter(|state| !state.is_empty());
    threads::set(job.threads);
    let mut recorder = Recorder::begin(&run.spec, run.paths, claim, stop, manifest, recorded)?;
    let mut clones = recorder.clones();
    Ok(
        match train::run_with(&run.spec, &mut clones, state.as_deref(), &mut recorder)? {
            Ending::Finished => recorder.finish()?,
            Ending::Stopped => recorder.stop()?,
        },
    )
}

/// The checkpoint that `run` continues from, empty for a new run. A damaged checkpoint is set
/// aside, with a warning.
fn last_state(run: &Planned) -> Result<Checkpoint, WorkerError> {
    let LastState {
        checkpoint,
        damaged,
    } = run.last_state()?;
    for error in damaged {
        let RecordError::Damaged { path, .. } = &error else {
            continue;
        };
        let aside = path.with_extension("damaged");
        fs::rename(path, &aside).map_err(io_error("rename", path))?;
        let text = format!(
            "{error}; it is kept as {}, and the run resumes from what remains",
            aside.display()
        );
        warn!("{text}");
        Event::Warned { text }.tell();
    }
    let checkpoint = checkpoint.unwrap_or_default();
    if checkpoint.env_steps() > run.spec.trained_steps() {
        return Err(WorkerError::Longer(
            run.paths.partial.clone(),
            checkpoint.env_steps(),
        ));
    }
    Ok(checkpoint)
}

/// The job on stdin's first line. When stdin ends after it, a stop is asked for.
fn read_job(stop: &StopRequest) -> Result<Job, WorkerError> {
    let mut line = String::new();
    io::stdin()
        .lock()
        .read_line(&mut line)
        .map_err(|error| WorkerError::Job(error.to_string()))?;
    let job = serde_json::from_str(&line).map_err(|error| WorkerError::Job(error.to_string()))?;
    let stop = stop.clone();
    let watch_parent = move || {
        // The end of stdin is the message, however it comes about.
        let _ = io::stdin().lock().read_to_end(&mut Vec::new());
        stop.make();
        leave_with_parent();
    };
    thread::Builder::new()
        .name("parent".to_owned())
        .spawn(watch_parent)
        .map_err(WorkerError::SetUp)?;
    Ok(job)
}

/// The pause between two checks of the parent.
const LOOK: Duration = Duration::from_millis(200);

/// Ends this process as soon as the parent, which has asked for a stop, exits without waiting for
/// it, as it does after a second Ctrl-C. If the parent is already gone, its death was the request
/// to stop, and the checkpoint is written in full.
#[cfg(unix)]
fn leave_with_parent() {
    use std::os::unix::process::parent_id;
    let init = 1;
    let parent = parent_id();
    thread::sleep(LOOK);
    if parent == init || parent_id() != parent {
        return;
    }
    while parent_id() == parent {
        thread::sleep(LOOK);
    }
    signal_hook::low_level::exit(INTERRUPTED.into());
}

#[cfg(not(unix))]
fn leave_with_parent() {}

fn refuse_another(folder: &Path, found: &Manifest, stamp: &Stamp) -> Result<(), WorkerError> {
    if found.stamp.fingerprint == stamp.fingerprint {
        return Ok(());
    }
    let (found, expected) = (found.stamp.fingerprint.clone(), stamp.fingerprint.clone());
    Err(WorkerError::AnotherRun {
        folder: folder.to_owned(),
        found,
        expected,
    })
}

/// The prefix of the log targets of this program's own messages.
const OWN: &str = "mcpo_run";

/// Sends log messages to `log.txt`. Debug messages of other crates, such as the physics engine, are
/// dropped, since they matter only to their authors.
fn start_log(paths: &RunPaths, verbose: bool) -> Result<(), WorkerError> {
    let log = RunPaths::log(&paths.partial);
    let log = intake::open(
        &log,
        Links::Refuse,
        OpenOptions::new().create(true).append(true),
    );
    let subscriber = tracing_subscriber::fmt()
        .with_writer(Mutex::new(log.map_err(WorkerError::SetUp)?))
        .with_ansi(false)
        .with_target(false)
        .with_timer(Clock)
        .with_max_level(if verbose { Level::DEBUG } else { Level::INFO })
        .finish()
        .with(filter_fn(|metadata| {
            *metadata.level() <= Level::INFO || metadata.target().starts_with(OWN)
        }));
    tracing::subscriber::set_global_default(subscriber)
        .map_err(|error| WorkerError::SetUp(io::Error::other(error)))
}

/// Timestamps of the log, in the manifest's format.
struct Clock;

impl tracing_subscriber::fmt::time::FormatTime for Clock {
    fn format_time(
        &self,
        writer: &mut tracing_subscriber::fmt::format::Writer<'_>,
    ) -> std::fmt::Result {
        writer.write_str(&now())
    }
}
