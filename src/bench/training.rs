//! Training whose iterations are timed, part by part.

use super::{
    BenchError,
    clock::{Seconds, timed},
};
use crate::{
    algo::{Learner, OnPolicy, SegmentEnd, Update, operations::Shapes},
    demo::Demonstration,
    plan::RunSpec,
    record::Checkpoint,
    rng::{Rng, Stream},
    train::{TrainError, build, rollout::Rollout},
};

/// The training of a run, without its evaluations.
pub struct Training {
    algorithm: Box<dyn OnPolicy>,
    shapes: Shapes,
    rollout: Rollout,
    /// The floor has environments of its own, so that its replay does not disturb the rollout.
    bare: Rollout,
    updates: Rng,
}

/// One iteration, and the time that it took.
pub struct Iteration {
    /// The time of the rollout.
    pub collecting: Seconds,
    /// Seconds of the rollout in the environments, by the wall clock.
    pub stepping: f64,
    /// The time of the update.
    pub updating: Seconds,
    /// The time of the same steps' physics alone.
    pub replaying: Seconds,
    /// The number of segments that were cut, each of which needs the value of its next state.
    pub cuts: usize,
    /// The record of the update.
    pub update: Update,
}

impl Training {
    /// The training of `spec` at its start.
    ///
    /// # Errors
    ///
    /// Training cannot begin, or the algorithm takes no steps.
    pub fn new(spec: &RunSpec) -> Result<Self, BenchError> {
        let Learner::OnPolicy(algorithm) = build::learner(spec, &mut build::cloned, &mut || {})?
        else {
            return Err(BenchError::NoRollouts(spec.algorithm_name()));
        };
        let shapes = shapes(spec, algorithm.as_ref())?;
        let rollout = || -> Result<Rollout, BenchError> {
            let tasks = build::tasks(spec, shapes.environments)?;
            Ok(Rollout::new(tasks, spec.seed))
        };
        Ok(Self {
            rollout: rollout()?,
            bare: rollout()?,
            updates: spec.seed.stream(Stream::Update, 0),
            algorithm,
            shapes,
        })
    }

    /// The sizes that decide how much there is to do.
    pub fn shapes(&self) -> &Shapes {
        &self.shapes
    }

    /// Trains for one iteration, number `index`, and steps the physics through it once more.
    ///
    /// # Errors
    ///
    /// The physics or the update fails.
    pub fn iteration(&mut self, index: u64) -> Result<Iteration, BenchError> {
        let start = self.rollout.save();
        let steps = self.shapes.rollout / self.shapes.environments;
        let (collected, collecting) =
            timed(|| self.rollout.collect(self.algorithm.agent_mut(), steps));
        let collected = collected?;
        let batch = &collected.batch;
        let (update, updating) = timed(|| self.algorithm.update(batch, &mut self.updates));
        let update = update.map_err(|source| TrainError::Algo {
            iteration: index,
            source,
        })?;
        self.bare.restore(start)?;
        let (replayed, replaying) = timed(|| self.bare.replay(batch));
        replayed?;
        let cut = |end: &SegmentEnd| matches!(end, SegmentEnd::Bootstrapped { .. });
        Ok(Iteration {
            collecting,
            stepping: collected.physics.as_secs_f64(),
            updating,
            replaying,
            cuts: batch.segments.iter().filter(|s| cut(&s.end)).count(),
            update,
        })
    }

    /// How long one checkpoint takes.
    ///
    /// # Errors
    ///
    /// The checkpoint cannot be written.
    pub fn checkpoint_seconds(&self) -> Result<Seconds, BenchError> {
        let folder = tempfile::tempdir()?;
        let (written, seconds) = timed(|| {
            let state = postcard::to_stdvec(&(self.algorithm.save(), self.rollout.save()))
                .expect("numbers always serialise");
            Checkpoint {
                state,
                ..Checkpoint::default()
            }
            .write(&folder.path().join("checkpoint"), "bench")
        });
        written?;
        Ok(seconds)
    }
}

fn shapes(spec: &RunSpec, algorithm: &dyn OnPolicy) -> Result<Shapes, TrainError> {
    let demonstration = match &spec.demonstration {
        Some(path) => Demonstration::read_for(path, spec.env)?.actions.ncols(),
        None => 0,
    };
    let agent = algorithm.agent();
    Ok(Shapes {
        observation: agent.policy.mean().widths()[0],
        action: agent.policy.log_std().len(),
        hidden: agent.hidden().to_vec(),
        environments: spec.rollout.environments.size(),
        rollout: spec.rollout.steps.size(),
        demonstration,
    })
}
