//! The sums over the measured iterations.

use std::collections::BTreeMap;

use super::{clock::Seconds, parts::Parts, training::Iteration};
use crate::{
    algo::operations::{self, Shapes},
    plan::RunSpec,
};

/// The sums over the iterations so far.
#[derive(Default)]
pub struct Sums {
    /// The time of training.
    pub spent: Seconds,
    /// The time of the same steps' physics alone.
    pub physics: Seconds,
    /// Where `spent.wall` went, seconds.
    pub phases: Parts,
    /// Floating-point operations of products, by part.
    pub operations: Parts,
    /// Values of tanh, by part.
    pub tanhs: Parts,
    /// How often each case of the dual occurred.
    pub cases: BTreeMap<String, u64>,
    /// Products of conjugate gradient; `None` if there are none.
    pub cg_iterations: Option<u64>,
}

impl Sums {
    /// Adds one `iteration` of `spec`, whose networks have these `shapes`.
    pub fn add(&mut self, iteration: Iteration, spec: &RunSpec, shapes: &Shapes) {
        let Iteration {
            collecting,
            stepping,
            updating,
            replaying,
            cuts,
            update,
        } = iteration;
        self.spent += collecting;
        self.spent += updating;
        self.physics += replaying;

        self.phases.add("physics", stepping);
        let inference = collecting.wall - stepping;
        self.phases
            .add("inference and rest of the rollout", inference);
        for (part, seconds) in &update.seconds {
            self.phases.add(part, *seconds);
        }
        let known: f64 = update.seconds.iter().map(|(_, seconds)| seconds).sum();
        self.phases.add("rest of the update", updating.wall - known);

        for (part, work) in operations::of_iteration(&spec.algorithm, shapes, cuts, &update) {
            self.operations.add(part, work.products);
            self.tanhs.add(part, work.tanhs);
        }
        if let Some(more) = update.cg_iterations {
            *self.cg_iterations.get_or_insert_default() += more;
        }
        if let Some(case) = update.case {
            *self.cases.entry(case).or_default() += 1;
        }
    }

    /// Adds the share of recording, where one checkpoint takes `checkpoint` and one is written
    /// `every` so many seconds.
    pub fn add_recording(&mut self, checkpoint: Seconds, every: f64) {
        let recording = Seconds {
            wall: checkpoint.wall * self.spent.wall / every,
            cpu: checkpoint.cpu * self.spent.cpu / every,
        };
        self.spent += recording;
        self.phases.add("recording", recording.wall);
    }
}
