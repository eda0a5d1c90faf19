//! From a list of runs to recorded results: which runs are due, in which order, in how many processes.
//!
//! Owns the queue, the worker processes and what they tell, retries, signals and the display of progress. Knows nothing of
//! TOML or of what training does inside: a run is a [`Job`](event::Job) whose process tells [`Event`](event::Event)s. Start at
//! [`campaign::run`]; [`preflight`] is what must hold before it, [`worker`] the other end of the pipe.

pub mod campaign;
pub mod cost;
pub mod event;
pub mod local;
pub mod preflight;
pub mod progress;
pub mod state;
pub mod stop;
pub mod worker;

use std::{io, time::Duration};

use event::{Job, Message};

/// Where jobs run: processes on this machine, or a cluster's. Jobs are told apart by a number of the caller's.
pub trait Executor {
    /// Starts a job.
    ///
    /// Errors: no process can be started.
    fn start(&mut self, number: usize, job: &Job) -> io::Result<()>;

    /// The next thing that a job tells, within `timeout`. The last message of every job is [`Message::Exited`].
    fn wait(&mut self, timeout: Duration) -> Option<(usize, Message)>;

    /// Asks a job to write a checkpoint and leave.
    fn stop(&mut self, number: usize);

    /// Ends a job at once.
    fn kill(&mut self, number: usize);
}
