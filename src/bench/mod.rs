//! How fast training is, and how fast this core could do it.
//!
//! Owns the measuring of a few iterations and the floor under them: the physics alone on the same
//! steps, and the [work](crate::algo::operations) of the networks' passes, their products at the
//! rate of the best product and their tanh at the rate of tanh in the nearest cache. So what is
//! left above the floor is what could be gained. Knows nothing of how this is shown. Start at
//! [`measure`].
//!
//! Ratios are taken by CPU time, which other work on the machine does not stretch (it still takes
//! caches and clock rate away); on an idle machine the wall clock says the same.

mod clock;
mod parts;
mod rate;
mod sums;
mod training;

use std::{collections::BTreeMap, io};

use serde::Serialize;

pub use crate::algo::operations::Shapes;
use crate::{
    env::EnvError,
    plan::RunSpec,
    record::{self, RecordError},
    train::TrainError,
};
pub use parts::Parts;
pub use rate::Rate;
use sums::Sums;
use training::Training;

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
    /// CPU seconds: the physics, the products and tanh.
    pub cpu_seconds: f64,
    /// CPU seconds of the same steps' physics alone, resets included.
    pub physics_seconds: f64,
    /// CPU seconds of the products at the rate of the best product.
    pub product_seconds: f64,
    /// CPU seconds of tanh at its best rate.
    pub tanh_seconds: f64,
    /// Floating-point operations of the products, by part.
    pub operations: Parts,
    /// Values of tanh, by part.
    pub tanhs: Parts,
    /// The best rates.
    #[serde(flatten)]
    pub rate: Rate,
}

impl Floor {
    /// The floor of `env_steps` steps, whose work is in `sums`, at this `rate`.
    fn new(env_steps: u64, sums: &Sums, rate: Rate) -> Self {
        let physics_seconds = sums.physics.cpu;
        let product_seconds = sums.operations.sum() / rate.flops_per_s;
        let tanh_seconds = sums.tanhs.sum() / rate.tanhs_per_s;
        let cpu_seconds = physics_seconds + product_seconds + tanh_seconds;
        Self {
            steps_per_cpu_s: env_steps as f64 / cpu_seconds,
            cpu_seconds,
            physics_seconds,
            product_seconds,
            tanh_seconds,
            operations: sums.operations.clone(),
            tanhs: sums.tanhs.clone(),
            rate,
        }
    }
}

/// Trains as `spec` says for one iteration to warm up and `iterations` more, on one core.
/// Evaluations are left out. Recording counts with the checkpoint's share of the time.
///
/// # Errors
///
/// Training fails, the algorithm takes no steps, or a checkpoint cannot be written.
pub fn measure(spec: &RunSpec, iterations: u64) -> Result<Measured, BenchError> {
    let mut training = Training::new(spec)?;
    let shapes = training.shapes().clone();
    let (mut rate, mut sums) = (Rate::default(), Sums::default());
    for index in 0..=iterations {
        let iteration = training.iteration(index)?;
        // The best of many timings counts, so they are spread over the whole measurement.
        rate.measure();
        if index > 0 {
            sums.add(iteration, spec, &shapes);
        }
    }
    let every = spec.checkpoint.every_seconds.get();
    sums.add_recording(training.checkpoint_seconds()?, every);

    let env_steps = iterations * shapes.rollout as u64;
    let floor = Floor::new(env_steps, &sums, rate);
    Ok(Measured {
        env: spec.env.to_string(),
        algorithm: spec.algorithm_name(),
        shapes,
        iterations,
        env_steps,
        seconds: sums.spent.wall,
        cpu_seconds: sums.spent.cpu,
        steps_per_s: env_steps as f64 / sums.spent.wall,
        steps_per_cpu_s: env_steps as f64 / sums.spent.cpu,
        floor_ratio: floor.cpu_seconds / sums.spent.cpu,
        phases: sums.phases,
        floor,
        cases: sums.cases,
        cg_iterations: sums.cg_iterations,
        cpu_class: record::cpu_class(),
    })
}
