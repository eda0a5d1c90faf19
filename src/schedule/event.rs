//! What goes through the pipes between the program and its worker processes: JSON, one line each.

use std::{
    ffi::OsString,
    io::{self, Write},
};

use serde::{Deserialize, Serialize};

use crate::record::Stamp;

/// What a worker is to do; the only line that it reads. When its stdin ends, it writes a checkpoint
/// and leaves: so a worker whose parent dies, however it dies, stops too.
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

/// What a worker tells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// It holds the run's claim, and trains.
    Began {
        /// The environment steps of the checkpoint that it goes on from; 0 when it begins anew.
        from_env_steps: u64,
    },
    /// An iteration ended.
    Iteration {
        /// Environment steps so far.
        env_steps: u64,
        /// Mean training return of the episodes that ended in it.
        training_return: Option<f64>,
    },
    /// It works, though no iteration ended: it evaluates, learns from the demonstration, or waits
    /// for another run that does.
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
    /// Something that whoever watches should know, and that is no reason to stop.
    Warned {
        /// In a sentence.
        text: String,
    },
    /// Everything is recorded.
    Finished,
    /// It was asked to stop, and left a checkpoint.
    Stopped,
    /// Another process works on this run.
    Claimed,
    /// It gave up.
    Failed {
        /// The cause, in a sentence.
        error: String,
    },
}

/// What an [`Executor`](super::Executor) passes on about a job.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// The worker told something.
    Event(Event),
    /// Its process ended.
    Exited {
        /// How, in words: `exit code 101`, `killed by signal 9 (SIGKILL)`.
        how: String,
        /// The last lines that it wrote to stderr.
        stderr: Vec<String>,
    },
}

impl Event {
    /// Tells it to the program that started this worker; gives whether anybody listens.
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
