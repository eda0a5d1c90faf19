//! The sink of a worker: keeps the measurements of training, writes checkpoints, and reports the
//! run's progress.

use std::{
    fs, process,
    time::{Duration, Instant},
};

use serde_json::Value;
use tracing::{debug, info};

use super::{event::Event, stop::StopRequest};
use crate::{
    algo::{Agent, pretraining::Pretraining},
    plan::RunSpec,
    record::{
        Attempt, Checkpoint, Claim, Heartbeat, Manifest, Outcome, RecordError, RunPaths,
        TableDigests, now, policy, pretrained::pretrained, rows,
    },
    train::{EvaluationEpisode, Flow, Iteration, RunSink, SinkError, TrainError, build},
};

/// The least time between two heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);

/// A run being recorded.
pub(super) struct Recorder<'a> {
    spec: &'a RunSpec,
    paths: RunPaths,
    /// The claim on the run, held until the recorder is dropped.
    claim: Claim,
    stop: StopRequest,
    manifest: Manifest,
    /// The rows so far, and the other contents of the last checkpoint.
    recorded: Checkpoint,
    from_env_steps: u64,
    seconds_before: f64,
    began: Instant,
    last_checkpoint: Instant,
    last_heartbeat: Option<Instant>,
    last_alive: Instant,
    last_return: Option<f64>,
}

impl<'a> Recorder<'a> {
    /// Begins an attempt that continues from `recorded`.
    ///
    /// # Errors
    ///
    /// The manifest cannot be written.
    pub fn begin(
        spec: &'a RunSpec,
        paths: RunPaths,
        claim: Claim,
        stop: StopRequest,
        mut manifest: Manifest,
        recorded: Checkpoint,
    ) -> Result<Self, RecordError> {
        let from_env_steps = recorded.env_steps();
        manifest.attempts.push(Attempt {
            began: now(),
            ended: None,
            host: manifest
                .stamp
                .origin
                .as_ref()
                .map_or_else(String::new, |origin| origin.host.clone()),
            process: process::id(),
            from_env_steps,
            cpu_class: manifest.stamp.build.cpu_class.clone(),
            libm: manifest.stamp.build.libm.clone(),
            error: None,
        });
        // The log comes first, so that a run that is seen to have begun has a log that says so.
        info!(
            "{} begins at {from_env_steps} of {} steps",
            spec.id,
            spec.trained_steps()
        );
        manifest.write(&RunPaths::manifest(&paths.partial))?;
        Event::Began { from_env_steps }.tell();
        Ok(Self {
            spec,
            paths,
            claim,
            stop,
            manifest,
            seconds_before: recorded.seconds,
            recorded,
            from_env_steps,
            began: Instant::now(),
            last_checkpoint: Instant::now(),
            last_heartbeat: None,
            last_alive: Instant::now(),
            last_return: None,
        })
    }

    /// Finds the cloned agents that runs of these results share; trains and keeps those that are
    /// missing.
    pub fn clones(
        &self,
    ) -> impl FnMut(&Pretraining<'_>, &mut dyn FnMut()) -> Result<Agent, TrainError> + use<> {
        let folder = self.paths.pretrained.clone();
        let build = self.manifest.stamp.build.clone();
        move |start, alive| {
            pretrained(
                &folder,
                &start.key(),
                build.machine(),
                &mut |alive| build::cloned(start, alive),
                alive,
            )
        }
    }

    /// Writes the tables and the manifest, and puts the run into its final place.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn finish(mut self) -> Result<Event, RecordError> {
        self.refuse_what_is_anothers()?;
        let folder = &self.paths.partial;
        let keys = rows::Keys::from(self.spec);
        let stamp = &self.manifest.stamp;
        rows::write_progress(
            &RunPaths::progress(folder),
            &keys,
            stamp,
            &self.recorded.iterations,
        )?;
        rows::write_evaluations(
            &RunPaths::evaluations(folder),
            &keys,
            stamp,
            &self.recorded.evaluations,
        )?;
        self.manifest.tables = Some(TableDigests::of(folder)?);
        self.manifest.env_steps = self.recorded.env_steps();
        self.manifest.seconds = self.seconds();
        self.manifest.outcome = Outcome::Finished;
        self.manifest.end_attempt(None);
        info!(
            "finished after {} steps and {:.0} s",
            self.manifest.env_steps, self.manifest.seconds
        );
        self.paths.close(&self.manifest)?;
        Ok(Event::Finished)
    }

    /// Ends the attempt; its checkpoint is written.
    ///
    /// # Errors
    ///
    /// The manifest cannot be written.
    pub fn stop(mut self) -> Result<Event, RecordError> {
        info!(
            "stopped after {} steps; a checkpoint is kept",
            self.recorded.env_steps()
        );
        self.manifest.end_attempt(None);
        self.manifest
            .write(&RunPaths::manifest(&self.paths.partial))?;
        Ok(Event::Stopped)
    }

    /// # Errors
    ///
    /// Another machine has taken the run up, since this process stood still for too long.
    fn refuse_what_is_anothers(&self) -> Result<(), RecordError> {
        match self.claim.is_lost() {
            true => Err(RecordError::Lost {
                path: self.paths.partial.clone(),
            }),
            false => Ok(()),
        }
    }

    fn seconds(&self) -> f64 {
        self.seconds_before + self.began.elapsed().as_secs_f64()
    }

    fn heartbeat(&mut self) -> Result<(), RecordError> {
        if self
            .last_heartbeat
            .is_some_and(|last| last.elapsed() < HEARTBEAT)
        {
            return Ok(());
        }
        self.last_heartbeat = Some(Instant::now());
        let env_steps = self.recorded.env_steps();
        let steps_per_second =
            (env_steps - self.from_env_steps) as f64 / self.began.elapsed().as_secs_f64();
        Heartbeat {
            env_steps,
            steps_per_second,
            training_return: self.last_return,
            written: now(),
        }
        .write(&RunPaths::heartbeat(&self.paths.partial))
    }

    fn checkpoint(&mut self, state: &dyn Fn() -> Vec<u8>) -> Result<(), RecordError> {
        self.refuse_what_is_anothers()?;
        self.recorded.state = state();
        self.recorded.seconds = self.seconds();
        self.recorded.write(
            &RunPaths::checkpoint(&self.paths.partial),
            &self.manifest.stamp.fingerprint,
        )?;
        self.last_checkpoint = Instant::now();
        Ok(())
    }
}

impl RunSink for Recorder<'_> {
    fn iteration(
        &mut self,
        row: &Iteration,
        state: &dyn Fn() -> Vec<u8>,
    ) -> Result<Flow, SinkError> {
        debug!("{}", told(row));
        self.last_return = row.training_return.or(self.last_return);
        self.recorded.iterations.push(row.clone());
        self.heartbeat().map_err(sink_error)?;
        let heard = Event::Iteration {
            env_steps: row.env_steps,
            training_return: row.training_return,
        }
        .tell();
        let stop = self.stop.is_made() || !heard;
        // The last checkpoint is kept, so that the run can be extended from it.
        let ends = row.env_steps >= self.spec.budget.env_steps.get();
        if stop
            || ends
            || self.last_checkpoint.elapsed().as_secs_f64()
                >= self.spec.checkpoint.every_seconds.get()
        {
            self.checkpoint(state).map_err(sink_error)?;
        }
        Ok(if stop { Flow::Stop } else { Flow::Continue })
    }

    fn evaluation(&mut self, episodes: &[EvaluationEpisode]) -> Result<(), SinkError> {
        self.recorded.evaluations.extend_from_slice(episodes);
        let Some(first) = episodes.first() else {
            return Ok(());
        };
        let dense_return =
            episodes.iter().map(|row| row.dense_return).sum::<f64>() / episodes.len() as f64;
        info!(
            "evaluated after {} steps: return {dense_return:.2}",
            first.env_steps
        );
        Event::Evaluation {
            env_steps: first.env_steps,
            dense_return,
            last: first.last,
        }
        .tell();
        Ok(())
    }

    fn policy(&mut self, env_steps: u64, last: bool, agent: &Agent) -> Result<(), SinkError> {
        let folder = &self.paths.partial;
        let path = if last {
            RunPaths::policy(folder)
        } else {
            RunPaths::kept_policy(folder, env_steps)
        };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|error| {
                SinkError(format!("cannot create {}: {error}", folder.display()))
            })?;
        }
        policy::write(&path, agent, &self.manifest.stamp).map_err(sink_error)?;
        if last {
            self.manifest.policy = Some(policy::digest(&path).map_err(sink_error)?);
        }
        Ok(())
    }

    fn alive(&mut self) {
        signs_of_life(&mut self.last_alive);
    }
}

/// Reports that this process is alive, unless it did so within the last heartbeat.
fn signs_of_life(last: &mut Instant) {
    if last.elapsed() >= HEARTBEAT {
        *last = Instant::now();
        Event::Alive.tell();
    }
}

/// The values that an iteration has, as `name value`.
fn told(row: &Iteration) -> String {
    fn add(name: &str, value: &Value, told: &mut Vec<String>) {
        match value {
            Value::Object(fields) => fields
                .iter()
                .for_each(|(name, value)| add(name, value, told)),
            // Null is a number that the algorithm does not have, an array the parts of its seconds.
            Value::Null | Value::Array(_) => {}
            value => told.push(format!("{name} {value}")),
        }
    }
    let mut quantities = Vec::new();
    add(
        "",
        &serde_json::to_value(row).unwrap_or_default(),
        &mut quantities,
    );
    quantities.join(", ")
}

fn sink_error(error: RecordError) -> SinkError {
    SinkError(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::rows::tests::iteration;

    #[test]
    fn a_log_tells_what_there_is_in_words() {
        let told = told(&iteration(1));
        assert!(
            told.contains("env_steps 100, ") && told.contains("kl 0.30000000000000004"),
            "{told}"
        );
        assert!(
            !told.contains("null") && !told.contains("training_return"),
            "{told}"
        );
    }
}
