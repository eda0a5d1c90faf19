//! The training loop of every algorithm that learns from its own rollouts.

use std::{mem, time::Instant};

use serde::{Deserialize, Serialize};

use super::{
    Ending, Flow, Iteration, RunSink, TrainError, build,
    evaluate::{self, Actor, Evaluation},
    rollout::{Episode, Rollout, RolloutState},
};
use crate::{
    algo::OnPolicy,
    env::Task,
    plan::RunSpec,
    rng::{Rng, Stream},
};

/// A run under way.
struct Training<'a> {
    spec: &'a RunSpec,
    algorithm: Box<dyn OnPolicy>,
    rollout: Rollout,
    evaluation_tasks: Vec<Task>,
    progress: Progress,
}

/// A run's progress, beside its agent and environments.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Progress {
    iteration: u64,
    env_steps: u64,
    /// The number of evaluations so far, during training.
    evaluations: u32,
    /// Whether the policy is evaluated before training goes on; if the budget ends here, it does
    /// not go on.
    evaluation_due: bool,
    updates: Rng,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    progress: Progress,
    algorithm: Vec<u8>,
    rollout: RolloutState,
}

/// Trains `algorithm` on `spec` from its start or from `checkpoint`.
/// The checkpoint may be the last of a run with a smaller budget: no step before the budget's end
/// depends on the budget.
///
/// # Errors
///
/// The checkpoint is of another run, the physics failed, training diverged, or the sink failed.
pub fn run(
    spec: &RunSpec,
    algorithm: Box<dyn OnPolicy>,
    checkpoint: Option<&[u8]>,
    sink: &mut dyn RunSink,
) -> Result<Ending, TrainError> {
    let mut training = Training::new(spec, algorithm)?;
    if let Some(bytes) = checkpoint {
        training.restore(bytes)?;
    }
    while training.progress.env_steps < spec.budget.env_steps.get() {
        if training.iterate(sink)? == Flow::Stop {
            return Ok(Ending::Stopped);
        }
    }
    training.evaluate(sink, true)?;
    sink.policy(
        training.progress.env_steps,
        true,
        training.algorithm.agent(),
    )?;
    Ok(Ending::Finished)
}

impl<'a> Training<'a> {
    fn new(spec: &'a RunSpec, algorithm: Box<dyn OnPolicy>) -> Result<Self, TrainError> {
        let environments = spec.rollout.environments.size();
        Ok(Self {
            spec,
            algorithm,
            rollout: Rollout::new(build::tasks(spec, environments)?, spec.seed),
            evaluation_tasks: build::tasks(spec, environments)?,
            progress: Progress {
                iteration: 0,
                env_steps: 0,
                evaluations: 0,
                evaluation_due: true,
                updates: spec.seed.stream(Stream::Update, 0),
            },
        })
    }

    /// Runs the evaluation that is due, one rollout and one update.
    fn iterate(&mut self, sink: &mut dyn RunSink) -> Result<Flow, TrainError> {
        // Not when it became due: at the end of the budget the last evaluation takes its place, and
        // a run that is extended later still makes it up here.
        if mem::take(&mut self.progress.evaluation_due) {
            self.evaluate(sink, false)?;
        }
        let spec = self.spec;
        let environments = spec.rollout.environments.size();
        let began = Instant::now();
        let collected = self.rollout.collect(
            self.algorithm.agent_mut(),
            spec.rollout.steps.size() / environments,
        )?;
        let rollout_seconds = began.elapsed().as_secs_f64();
        // A watcher waits for a sign, and the update will take long too.
        sink.alive();

        let before = self.progress.env_steps;
        self.progress.iteration += 1;
        self.progress.env_steps += collected.batch.len() as u64;
        let iteration = self.progress.iteration;
        let began = Instant::now();
        let update = self
            .algorithm
            .update(&collected.batch, &mut self.progress.updates)
            .map_err(|source| TrainError::Algo { iteration, source })?;
        let update_seconds = began.elapsed().as_secs_f64();

        let after = self.progress.env_steps;
        // A rollout may pass several multiples of the interval; that counts once.
        let due = |every: u64| before / every < after / every;
        self.progress.evaluation_due = due(spec.evaluation.every.get());
        if spec
            .checkpoint
            .keep_policy_every
            .is_some_and(|every| due(every.get()))
        {
            sink.policy(after, false, self.algorithm.agent())?;
        }
        // Where no episode ended, there is no mean, rather than one of 0.
        let mean = |of: fn(&Episode) -> f64| {
            let n = collected.episodes.len();
            (n > 0).then(|| collected.episodes.iter().map(of).sum::<f64>() / n as f64)
        };
        let row = Iteration {
            iteration,
            env_steps: after,
            episodes: collected.episodes.len() as u64,
            dense_return: mean(|episode| episode.dense_return),
            training_return: mean(|episode| episode.training_return),
            episode_length: mean(|episode| episode.length as f64),
            update,
            physics_seconds: collected.physics.as_secs_f64(),
            rollout_seconds,
            update_seconds,
        };
        Ok(sink.iteration(&row, &|| self.save())?)
    }

    fn evaluate(&mut self, sink: &mut dyn RunSink, last: bool) -> Result<(), TrainError> {
        let evaluation = &self.spec.evaluation;
        let (count, index) = if last {
            (evaluation.final_episodes, evaluate::LAST)
        } else {
            self.progress.evaluations += 1;
            (evaluation.episodes, self.progress.evaluations - 1)
        };
        let actor = &mut Actor::MeanAction(self.algorithm.agent());
        let (seed, env_steps) = (self.spec.seed, self.progress.env_steps);
        let due = Evaluation {
            seed,
            index,
            env_steps,
            count: count.get(),
            last,
        };
        let episodes =
            evaluate::evaluation(actor, &mut self.evaluation_tasks, due, &mut || sink.alive())?;
        Ok(sink.evaluation(&episodes)?)
    }

    fn save(&self) -> Vec<u8> {
        let saved = Saved {
            progress: self.progress.clone(),
            algorithm: self.algorithm.save(),
            rollout: self.rollout.save(),
        };
        postcard::to_stdvec(&saved).expect("numbers and vectors always serialise")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), TrainError> {
        let saved: Saved = postcard::from_bytes(bytes)
            .map_err(|error| TrainError::Checkpoint(error.to_string()))?;
        self.algorithm
            .restore(&saved.algorithm)
            .map_err(|error| TrainError::Checkpoint(error.to_string()))?;
        self.rollout.restore(saved.rollout)?;
        self.progress = saved.progress;
        Ok(())
    }
}
