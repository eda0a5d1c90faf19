//! Learning from a discriminator's reward beside the task's, which POfD and GAIL share.
//!
//! Owns one iteration of it: one update of the discriminator, new rewards for the batch, one update
//! of the policy. Knows nothing of how the policy is updated. Start at [`Adversarial`].

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    discriminator::{self, Discriminator},
    operations::{Counter, Operations},
    revision::Part,
};
use crate::{quantity::Count, rng::Rng};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "adversarial",
    revision: 1,
    uses: &[&discriminator::PART],
};

/// An algorithm whose rewards are `task r - imitation log D(s, a)`.
pub struct Adversarial {
    /// Tells the agent's samples from the demonstration's.
    pub discriminator: Discriminator,
    /// Weight of the task's own reward.
    pub task: f64,
    /// Weight of the discriminator's reward.
    pub imitation: f64,
    /// The algorithm that improves the policy on these rewards.
    pub inner: Box<dyn OnPolicy>,
}

impl Adversarial {
    /// The rewards `[n]` that the policy trains on in `batch`.
    pub(super) fn rewards(&mut self, batch: &Batch) -> Vec<f64> {
        let imitation = self.discriminator.imitation_rewards(batch);
        batch
            .rewards
            .iter()
            .zip(imitation)
            .map(|(r, imitation)| self.task * r + self.imitation * imitation)
            .collect()
    }
}

impl OnPolicy for Adversarial {
    fn agent(&self) -> &Agent {
        self.inner.agent()
    }

    fn agent_mut(&mut self) -> &mut Agent {
        self.inner.agent_mut()
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let loss = self
            .discriminator
            .update(batch, &self.inner.agent().normalizer)?;
        let relabelled = Batch {
            rewards: self.rewards(batch),
            ..batch.clone()
        };
        Ok(Update {
            discriminator_loss: Some(loss),
            ..self.inner.update(&relabelled, rng)?
        })
    }

    fn save(&self) -> Vec<u8> {
        super::to_bytes(&(self.discriminator.save(), self.inner.save()))
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        let (discriminator, inner): (Vec<u8>, Vec<u8>) =
            super::from_bytes("the adversarial method", state)?;
        self.discriminator.restore(&discriminator)?;
        self.inner.restore(&inner)
    }
}

/// The work of an update: the discriminator's, the rewards, and the policy's own, `inner`.
pub(super) fn operations(
    updates: Count,
    inner: Vec<Operations>,
    counter: &Counter<'_>,
) -> Vec<Operations> {
    let Counter {
        n,
        m,
        discriminator,
        ..
    } = counter;
    let updates = updates.get() as f64 * (n + m) * discriminator.forward_and_vjp();
    [
        vec![("discriminator", updates + *n * discriminator.forward())],
        inner,
    ]
    .concat()
}
