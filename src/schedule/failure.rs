//! The record of a failure that the failed process could not write itself.

use std::{
    fs::OpenOptions,
    io::{Read, Seek, SeekFrom, Write},
    path::Path,
};

use super::state::Planned;
use crate::{
    intake::{self, Links},
    record::{Claim, Manifest, Outcome, RecordError, RunPaths},
};

/// The number of last lines of `log.txt`, and as many of stderr, that go into `run.json`.
const TAIL_LINES: usize = 20;
/// The size of the end of `log.txt` that is searched for them, bytes.
const TAIL_BYTES: u64 = 16 << 10;

/// The reason why a process ended without a final event: how it ended, and the first line of its
/// message on stderr.
pub(super) fn cause(how: &str, stderr: &[String]) -> String {
    // A panic prints its place and its message on two lines; a failed allocation prints more lines
    // after its message.
    let panic = stderr.iter().position(|line| line.contains("panicked at"));
    let memory = stderr
        .iter()
        .find(|line| line.starts_with("memory allocation of"));
    let said = match panic {
        Some(place) => stderr.get(place + 1).or(stderr.get(place)),
        None => memory.or(stderr.iter().rev().find(|line| !line.trim().is_empty())),
    };
    match said {
        Some(line) => format!("its process {}: {}", phrase(how), line.trim()),
        None => format!("its process {}", phrase(how)),
    }
}

/// `exit code 3` as part of a sentence.
fn phrase(how: &str) -> String {
    if how.starts_with("exit code") {
        format!("ended with {how}")
    } else {
        how.replacen("killed", "was killed", 1)
    }
}

/// The record of a run whose process has died.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// The run has failed; or the record is another run's, which is left as it is.
    Failed,
    /// The run had finished.
    Finished,
    /// Another process has claimed the run since, and records its outcome.
    TakenUp,
}

/// Writes into a run's manifest that an attempt ended in `error`. If that was the `last` attempt,
/// the run has failed, and is put into its final place. `env_steps` are those that the attempt
/// reached, absent where it did not begin. Writes nothing if the run had finished, or if another
/// process has claimed it.
///
/// # Errors
///
/// The disk refuses.
pub(super) fn record(
    run: &Planned,
    error: &str,
    stderr: &[String],
    env_steps: Option<u64>,
    last: bool,
) -> Result<Found, RecordError> {
    let paths = &run.paths;
    let Some(_claim) = Claim::take(paths)? else {
        return Ok(Found::TakenUp);
    };
    paths.settle()?;
    let mut shorter = None;
    match paths.ended()? {
        Some(ended) if ended.stamp.fingerprint != run.stamp.fingerprint => {
            return Ok(Found::Failed);
        }
        Some(ended) if run.is_done(&ended) => return Ok(Found::Finished),
        // A finished, shorter run was to be extended. If it is already longer than planned, another
        // process has extended it.
        Some(ended) if ended.outcome == Outcome::Finished => {
            if ended.env_steps > run.spec.trained_steps() {
                return Ok(Found::Failed);
            }
            shorter = Some(ended);
        }
        // An attempt that begins moves away what lies in the run's place, so this was put there
        // later.
        Some(_) if env_steps.is_some() => return Ok(Found::TakenUp),
        _ => {}
    }
    paths.open()?;
    let path = RunPaths::manifest(&paths.partial);
    let mut manifest = match Manifest::read(&path)?
        .or(shorter.map(|shorter| shorter.taken_up(run.stamp.clone())))
    {
        Some(manifest) if manifest.stamp.fingerprint != run.stamp.fingerprint => {
            return Ok(Found::Failed);
        }
        found => found.unwrap_or_else(|| Manifest::new(run.stamp.clone())),
    };
    let log = RunPaths::log(&paths.partial);
    let mut log_tail = tail(&log);
    log_tail.extend(
        stderr
            .iter()
            .rev()
            .take(TAIL_LINES)
            .rev()
            .map(|line| format!("stderr: {line}")),
    );
    // The log is for people; a run's failure does not depend on it.
    let appended = intake::open(
        &log,
        Links::Refuse,
        OpenOptions::new().create(true).append(true),
    );
    let _ = appended.and_then(|mut log| {
        stderr
            .iter()
            .try_for_each(|line| writeln!(log, "stderr: {line}"))?;
        writeln!(log, "failed: {error}")
    });
    manifest.end_attempt(Some(error.to_owned()));
    manifest.env_steps = env_steps.unwrap_or(manifest.env_steps);
    if last {
        manifest.outcome = Outcome::Failed {
            error: error.to_owned(),
            log_tail,
        };
        paths.close(&manifest)?;
    } else {
        manifest.write(&path)?;
    }
    Ok(Found::Failed)
}

/// The last lines of a log; none where it cannot be read.
fn tail(path: &Path) -> Vec<String> {
    let read = || -> std::io::Result<Vec<u8>> {
        let mut file = intake::open(path, Links::Refuse, OpenOptions::new().read(true))?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES)))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let bytes = read().unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    lines
        .iter()
        .skip(lines.len().saturating_sub(TAIL_LINES))
        .map(|line| (*line).to_owned())
        .collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{
        record::Stamp,
        schedule::{state::RunState, tests::planned},
    };

    #[test]
    fn the_cause_is_what_the_process_said_last() {
        let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
        let panic = lines(
            "thread 'main' panicked at src/x.rs:1:2:\nindex out of bounds\n\
             note: run with RUST_BACKTRACE=1",
        );
        assert_eq!(
            cause("panicked (exit code 101)", &panic),
            "its process panicked (exit code 101): index out of bounds"
        );
        assert_eq!(
            cause("killed by signal 9 (SIGKILL)", &[]),
            "its process was killed by signal 9 (SIGKILL)"
        );
        assert_eq!(
            cause("exit code 3", &lines("first\nlast\n\n")),
            "its process ended with exit code 3: last"
        );
        let memory = lines(
            "memory allocation of 8 bytes failed\nstack backtrace:\nskipping backtrace printing",
        );
        assert_eq!(
            cause("exit code 3", &memory),
            "its process ended with exit code 3: memory allocation of 8 bytes failed"
        );
    }

    #[test]
    fn a_failure_is_recorded_in_the_runs_place_and_keeps_its_checkpoint() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = planned(folder.path(), "a", 0);
        run.paths.open().expect("made");
        for file in [RunPaths::checkpoint, RunPaths::progress] {
            fs::write(file(&run.paths.partial), "x").expect("written");
        }
        let many: String = (0..100).map(|n| format!("line {n}\n")).collect();
        fs::write(RunPaths::log(&run.paths.partial), many).expect("written");
        record(&run, "boom", &["abort".to_owned()], Some(7), false).expect("recorded");
        assert!(
            run.paths.ended().expect("readable").is_none(),
            "it was to be tried again"
        );
        record(&run, "boom", &["abort".to_owned()], Some(7), true).expect("recorded");
        let manifest = run.paths.ended().expect("readable").expect("there");
        let Outcome::Failed { error, log_tail } = &manifest.outcome else {
            panic!("{:?}", manifest.outcome)
        };
        assert_eq!((error.as_str(), manifest.env_steps), ("boom", 7));
        assert_eq!(log_tail.last().map(String::as_str), Some("stderr: abort"));
        assert!(
            log_tail.contains(&"line 99".to_owned()) && log_tail.len() <= 2 * TAIL_LINES,
            "{log_tail:?}"
        );
        assert!(RunPaths::checkpoint(&run.paths.complete).exists());
        assert!(
            !RunPaths::progress(&run.paths.complete).exists(),
            "half a run would be scanned"
        );
        assert!(!run.paths.partial.exists());
    }

    #[test]
    fn a_failure_is_not_recorded_over_somebody_elses_work() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = planned(folder.path(), "a", 0);
        let claim = Claim::take(&run.paths).expect("made").expect("free");
        assert_eq!(
            record(&run, "boom", &[], None, true).ok(),
            Some(Found::TakenUp)
        );
        assert!(!run.paths.complete.exists());
        drop(claim);
        let theirs = |outcome| {
            run.paths.open().expect("made");
            let env_steps = run.spec.trained_steps();
            let theirs = Manifest {
                outcome,
                env_steps,
                ..Manifest::new(run.stamp.clone())
            };
            run.paths.close(&theirs).expect("closed");
            theirs
        };
        let failed = theirs(Outcome::Failed {
            error: "theirs".to_owned(),
            log_tail: Vec::new(),
        });
        assert_eq!(
            record(&run, "boom", &[], Some(7), true).ok(),
            Some(Found::TakenUp)
        );
        let other = Planned {
            stamp: Stamp {
                fingerprint: "other".to_owned(),
                ..run.stamp.clone()
            },
            ..run.clone()
        };
        assert_eq!(
            record(&other, "boom", &[], None, true).ok(),
            Some(Found::Failed)
        );
        assert_eq!(
            run.paths.ended().expect("readable"),
            Some(failed),
            "another run's record was touched"
        );
        let finished = theirs(Outcome::Finished);
        assert_eq!(
            record(&run, "boom", &[], Some(7), true).ok(),
            Some(Found::Finished)
        );
        assert_eq!(
            record(&other, "boom", &[], Some(7), true).ok(),
            Some(Found::Failed)
        );
        assert_eq!(run.paths.ended().expect("readable"), Some(finished));
    }

    #[test]
    fn the_failure_of_a_longer_run_leaves_the_shorter_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut run = planned(folder.path(), "a", 0);
        run.paths.open().expect("made");
        let shorter = Manifest {
            outcome: Outcome::Finished,
            env_steps: 1024,
            ..Manifest::new(run.stamp.clone())
        };
        run.paths.close(&shorter).expect("closed");
        run.spec.budget.env_steps = crate::quantity::constant(4096);
        assert_eq!(
            record(&run, "boom", &[], Some(2048), true).ok(),
            Some(Found::Failed)
        );
        assert_eq!(run.paths.ended().expect("readable"), Some(shorter));
        let failed = Manifest::read(&RunPaths::manifest(&run.paths.partial))
            .expect("readable")
            .expect("there");
        assert_eq!((failed.error(), failed.env_steps), (Some("boom"), 2048));
        assert!(matches!(run.state(), Ok(RunState::Failed(_))));
        run.spec.budget.env_steps = crate::quantity::constant(256);
        assert_eq!(
            record(&run, "boom", &[], None, true).ok(),
            Some(Found::Failed),
            "it is longer than that"
        );
    }
}
