//! How fast training is, and how fast this core could do it.
//!
//! Owns the measuring of a few iterations and the floor under them: the physics alone on the same
//! steps, and the [operations] of the networks' passes at the rate of the best product. Knows
//! nothing of how this is shown. Start at [`measure`].
//!
//! Ratios are taken by CPU time, which other work on the machine does not stretch (it still takes
//! caches and clock rate away); on an idle machine the wall clock says the same.

mod clock;
mod rate;

use std::{collections::BTreeMap, io};

use serde::{Serialize, Serializer};

pub use crate::algo::operations::Shapes;
use crate::{
    algo::{Learner, OnPolicy, SegmentEnd, operations},
    demo::Demonstration,
    env::EnvError,
    plan::RunSpec,
    record::{self, Checkpoint, RecordError},
    rng::Stream,
    train::{TrainError, build, rollout::Rollout},
};
use clock::{Seconds, timed};
pub use rate::Rate;

/// Errors of a measurement.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Training failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// The physics failed.
    #[error(transparent)]
    Env(#[from] EnvError),
    /// The algorithm has no iterations.
    #[error("`{0}` takes no training steps in the environment, so there is nothing to measure")]
    NoRollouts(&'static str),
    /// The checkpoint could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// There is no room for the checkpoint.
    #[error("cannot make a temporary folder: {0}")]
    Folder(#[from] io::Error),
}

/// The speed of training and where its time goes, over all iterations but the first.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// The environment.
    pub env: String,
    /// The algorithm.
    pub algorithm: &'static str,
    /// The sizes that decide how much there is to do.
    pub shapes: Shapes,
    /// The measured iterations, without the first one, which warms up.
    pub iterations: u64,
    /// Environment steps of these iterations.
    pub env_steps: u64,
    /// Seconds of these iterations by the wall clock, recording included.
    pub seconds: f64,
    /// CPU seconds of these iterations.
    pub cpu_seconds: f64,
    /// Environment steps a second.
    pub steps_per_s: f64,
    /// Environment steps a second of CPU time.
    pub steps_per_cpu_s: f64,
    /// Speed relative to the floor's, by CPU time; 1 is at the floor.
    pub floor_ratio: f64,
    /// Where `seconds` went.
    pub phases: Parts,
    /// The fastest that it could be.
    pub floor: Floor,
    /// How often each case of the dual occurred; empty without a dual.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub cases: BTreeMap<String, u64>,
    /// Products of conjugate gradient; absent if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cg_iterations: Option<u64>,
    /// The processor's [class](record::cpu_class).
    pub cpu_class: String,
}

/// The floor of the same iterations.
#[derive(Debug, Clone, Serialize)]
pub struct Floor {
    /// Environment steps a second of CPU time.
    pub steps_per_cpu_s: f64,
    /// CPU seconds of the same steps' physics alone, resets included.
    pub physics_seconds: f64,
    /// CPU seconds of the operations at the rate of the best product.
    pub product_seconds: f64,
    /// Floating-point operations, by part.
    pub operations: Parts,
    /// The best product.
    #[serde(flatten)]
    pub rate: Rate,
}

/// Numbers by name, in the order in which they first came.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parts(Vec<(String, f64)>);

impl Parts {
    fn add(&mut self, name: &str, number: f64) {
        match self.0.iter_mut().find(|(known, _)| known == name) {
            Some((_, sum)) => *sum += number,
            None => self.0.push((name.to_owned(), number)),
        }
    }

    /// The names and numbers, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, number)| (name.as_str(), *number))
    }

    /// The sum of all.
    pub fn sum(&self) -> f64 {
        self.iter().map(|(_, number)| number).sum()
    }
}

impl Serialize for Parts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter())
    }
}

/// Trains as `spec` says for one iteration to warm up and `iterations` more, on one core.
/// Evaluations are left out. Recording counts with the checkpoint's share of the time.
///
/// # Errors
///
/// Training fails, the algorithm takes no steps, or a checkpoint cannot be written.
pub fn measure(spec: &RunSpec, iterations: u64) -> Result<Measured, BenchError> {
    let Learner::OnPolicy(mut algorithm) = build::learner(spec, &mut build::cloned, &mut || {})?
    else {
        return Err(BenchError::NoRollouts(spec.algorithm_name()));
    };
    let shapes = shapes(spec, algorithm.as_ref())?;
    let mut rollout = Rollout::new(build::tasks(spec, shapes.environments)?, spec.seed);
    // The floor has environments of its own, so that its replay does not disturb the rollout.
    let mut bare = Rollout::new(build::tasks(spec, shapes.environments)?, spec.seed);
    let mut updates = spec.seed.stream(Stream::Update, 0);
    let (mut spent, mut physics, mut rate) =
        (Seconds::default(), Seconds::default(), Rate::default());
    let (mut phases, mut operations) = (Parts::default(), Parts::default());
    let (mut cases, mut cg_iterations) = (BTreeMap::new(), None);
    for iteration in 0..=iterations {
        let state = rollout.save();
        let (collected, collecting) =
            timed(|| rollout.collect(algorithm.agent_mut(), shapes.rollout / shapes.environments));
        let collected = collected?;
        let (update, updating) = timed(|| algorithm.update(&collected.batch, &mut updates));
        let update = update.map_err(|source| TrainError::Algo { iteration, source })?;
        bare.restore(state)?;
        let (replayed, replaying) = timed(|| bare.replay(&collected.batch));
        replayed?;
        rate.measure();
        if iteration == 0 {
            continue;
        }
        spent += collecting;
        spent += updating;
        physics += replaying;
        let stepping = collected.physics.as_secs_f64();
        phases.add("physics", stepping);
        phases.add(
            "inference and rest of the rollout",
            collecting.wall - stepping,
        );
        for (part, seconds) in &update.seconds {
            phases.add(part, *seconds);
        }
        let known: f64 = update.seconds.iter().map(|(_, seconds)| seconds).sum();
        phases.add("rest of the update", updating.wall - known);
        let cut = |end: &SegmentEnd| matches!(end, SegmentEnd::Bootstrapped { .. });
        let cuts = collected
            .batch
            .segments
            .iter()
            .filter(|segment| cut(&segment.end))
            .count();
        for (part, number) in operations::of_iteration(&spec.algorithm, &shapes, cuts, &update) {
            operations.add(part, number);
        }
        cg_iterations = update
            .cg_iterations
            .map(|more| cg_iterations.unwrap_or(0) + more)
            .or(cg_iterations);
        if let Some(case) = update.case {
            *cases.entry(case).or_default() += 1;
        }
    }

    let checkpoint = checkpoint_seconds(algorithm.as_ref(), &rollout)?;
    let every = spec.checkpoint.every_seconds.get();
    // One checkpoint is written in each interval, so this is its share of the time.
    let recording = Seconds {
        wall: checkpoint.wall * spent.wall / every,
        cpu: checkpoint.cpu * spent.cpu / every,
    };
    spent += recording;
    phases.add("recording", recording.wall);

    let env_steps = iterations * shapes.rollout as u64;
    let product_seconds = operations.sum() / rate.flops_per_s;
    let floor_seconds = physics.cpu + product_seconds;
    Ok(Measured {
        env: spec.env.to_string(),
        algorithm: spec.algorithm_name(),
        shapes,
        iterations,
        env_steps,
        seconds: spent.wall,
        cpu_seconds: spent.cpu,
        steps_per_s: env_steps as f64 / spent.wall,
        steps_per_cpu_s: env_steps as f64 / spent.cpu,
        floor_ratio: floor_seconds / spent.cpu,
        phases,
        floor: Floor {
            steps_per_cpu_s: env_steps as f64 / floor_seconds,
            physics_seconds: physics.cpu,
            product_seconds,
            operations,
            rate,
        },
        cases,
        cg_iterations,
        cpu_class: record::cpu_class(),
    })
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

/// How long one checkpoint takes.
fn checkpoint_seconds(algorithm: &dyn OnPolicy, rollout: &Rollout) -> Result<Seconds, BenchError> {
    let folder = tempfile::tempdir()?;
    let (written, seconds) = timed(|| {
        let state = postcard::to_stdvec(&(algorithm.save(), rollout.save()))
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
