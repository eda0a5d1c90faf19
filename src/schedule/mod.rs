//! From a list of runs to recorded results: the runs that are due, their order, and their
//! processes.
//!
//! Owns the queue, the worker processes and their messages, retries, signals and the display of
//! progress. Knows nothing of TOML or of what training does inside: a run is a [`Job`](event::Job)
//! whose process sends [`Event`](event::Event)s. Start at [`campaign::run`]; [`preflight`] is what
//! must hold before it, [`worker`] the other end of the pipe.

pub mod campaign;
pub mod cost;
pub mod element;
pub mod event;
mod failure;
pub mod local;
pub mod preflight;
pub mod progress;
mod recorder;
pub mod shard;
pub mod slurm;
pub mod state;
pub mod stop;
pub mod submission;
pub mod worker;

use std::{io, time::Duration};

use event::{Job, Message};

/// The place where jobs run, such as processes on this machine. The caller gives each job a number.
pub trait Executor {
    /// Starts a job.
    ///
    /// # Errors
    ///
    /// No process can be started.
    fn start(&mut self, number: usize, job: &Job) -> io::Result<()>;

    /// The next message of any job, within `timeout`. The last message of every job is
    /// [`Message::Exited`].
    fn wait(&mut self, timeout: Duration) -> Option<(usize, Message)>;

    /// Asks a job to write a checkpoint and exit.
    fn stop(&mut self, number: usize);

    /// Ends a job at once.
    fn kill(&mut self, number: usize);
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::Path;

    use super::state::Planned;
    use crate::{
        plan::{self, RunSpec},
        record::{Build, RunPaths, Stamp},
        spec::{self, Overrides},
    };

    /// A small run of its own, told apart by `name` and `seed`.
    pub(crate) fn spec(name: &str, seed: u64) -> RunSpec {
        let text = format!(
            "name = {name:?}\nbudget.env_steps = 1024\nrollout.steps = 256\nnetwork.hidden = [8]\n\
             algorithms.ppo.minibatch = 64\n\
             [[matrix]]\nseed = [{seed}]\nenv = [\"InvertedPendulum-v2\"]\nalgorithm = [\"ppo\"]\n"
        );
        let spec =
            spec::parse(Path::new("test.toml"), &text, &Overrides::default()).expect("a matrix");
        plan::plan(&spec).expect("a plan").remove(0)
    }

    /// The same with its places under `results`.
    pub(crate) fn planned(results: &Path, name: &str, seed: u64) -> Planned {
        let spec = spec(name, seed);
        let stamp = Stamp {
            spec: serde_json::to_value(&spec).expect("JSON"),
            fingerprint: format!("{name}-{seed}"),
            demonstration: None,
            demonstrated: None,
            build: Build::current(serde_json::Value::Null),
            origin: None,
        };
        let paths = RunPaths::new(results, &spec.experiment, &spec.id).expect("a good id");
        Planned { spec, paths, stamp }
    }
}
