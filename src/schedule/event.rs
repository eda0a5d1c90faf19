//! The messages between the program and its worker processes: JSON through pipes, one line each.

use std::{
    ffi::OsString,
    io::{self, Write},
};

use serde::{Deserialize, Serialize};

use crate::record::Stamp;

/// A worker's job, the only line that it reads. When its stdin ends, it writes a checkpoint and
/// exits. So a worker whose parent dies, however that happens, stops too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// The folder of all results, whose name need not be text.
    pub results: OsString,
    /// The run: its specification and its fingerprint.
    pub stamp: Stamp,
    /// Whether `log.txt` holds every iteration.
    pub verbose: bool,
    /// Threads that share the run's work, which does not change its numbers.
    pub threads: usize,
}

/// A message from a worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// The worker holds the run's claim, and trains.
    Began {
        /// The environment steps of the checkpoint that it continues from; 0 for a new run.
        from_env_steps: u64,
    },
    /// An iteration ended.
    Iteration {
        /// Environment steps so far.
        env_steps: u64,
        /// Mean training return of the episodes that ended in it.
        training_return: Option<f64>,
    },
    /// The worker is alive although no iteration ended: it evaluates, learns from the
    /// demonstration, or waits for another run that does.
    Alive,
    /// An evaluation ended.
    Evaluation {
        /// Environment steps so far.
        env_steps: u64,
        /// Mean dense return.
        dense_return: f64,
        /// Whether it was the last.
        last: bool,
    },
    /// A warning for the user, which is no reason to stop.
    Warned {
        /// The warning, in a sentence.
        text: String,
    },
    /// Everything is recorded.
    Finished,
    /// The worker was asked to stop, and left a checkpoint.
    Stopped,
    /// Another process works on this run.
    Claimed,
    /// The run failed.
    Failed {
        /// The cause, in a sentence.
        error: String,
    },
}

/// A message of an [`Executor`](super::Executor) about a job.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// The worker sent an event.
    Event(Event),
    /// Its process ended.
    Exited {
        /// How it ended, in words: `exit code 101`, `killed by signal 9 (SIGKILL)`.
        how: String,
        /// The last lines that it wrote to stderr.
        stderr: Vec<String>,
    },
}

impl Event {
    /// Sends the event to the program that started this worker; returns whether anybody listens.
    pub(super) fn tell(&self) -> bool {
        let Ok(mut line) = serde_json::to_vec(self) else {
            return false;
        };
        line.push(b'\n');
        let mut stdout = io::stdout().lock();
        stdout
            .write_all(&line)
            .and_then(|()| stdout.flush())
            .is_ok()
    }
}
