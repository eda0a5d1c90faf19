//! POfD (Kang et al., 2018): the task's reward plus a discriminator's, `r - weight log D(s, a)`.
//!
//! Owns how its parts go together. Knows nothing of the discriminator's or the policy's update.
//! Start at [`pofd`].
//!
//! As in the paper's Algorithm 1: one update of the discriminator, new rewards, one update of the
//! policy. The appendix does not say which policy update; PPO is what its other first-order rows
//! use. The printed algorithm's misprints, `r(a, b)` and the sign of the entropy's gradient, are
//! not followed.

use serde::{Deserialize, Serialize};

use super::{
    Agent, OnPolicy,
    adversarial::{self, Adversarial},
    definition::{About, Definition},
    discriminator::{self, Discriminator},
    operations::{Counter, Operations},
    ppo::{self, Ppo},
    revision::Part,
    trpo::{self, Trpo},
};
use crate::{
    demo::Demonstration,
    env::EnvId,
    quantity::{NonNegative, constant},
    rng::Seed,
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "pofd",
    revision: 1,
    uses: &[
        &adversarial::PART,
        &discriminator::PART,
        &ppo::PART,
        &trpo::PART,
    ],
};

/// POfD as an algorithm of the catalogue.
pub static POFD: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        ..About::new("pofd", "POfD", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| {
        start
            .imitate(|agent, demonstration, seed| pofd(hyperparameters, agent, demonstration, seed))
    },
    operations: |h, counter| {
        let inner = h.policy_update.operations(&h.ppo, &h.trpo, counter);
        adversarial::operations(h.discriminator.updates, inner, counter)
    },
};

/// POfD's hyperparameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// lambda_1, the weight of the discriminator's reward.
    pub weight: NonNegative,
    /// How the discriminator learns.
    pub discriminator: discriminator::Hyperparameters,
    /// Which update improves the policy.
    pub policy_update: PolicyUpdate,
    /// PPO's part; its `entropy_weight` is POfD's lambda_2.
    pub ppo: ppo::Hyperparameters,
    /// TRPO's part.
    pub trpo: trpo::Hyperparameters,
}

/// The update that improves the policy on the new rewards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PolicyUpdate {
    /// PPO.
    Ppo,
    /// TRPO.
    Trpo,
}

impl Hyperparameters {
    /// The defaults for `env`: Table 1's weight is 0.1, and 0.01 for HalfCheetah and Walker2d.
    pub fn for_env(env: EnvId) -> Self {
        let weight = if matches!(env, EnvId::HalfCheetah | EnvId::Walker2d) {
            0.01
        } else {
            0.1
        };
        Self {
            weight: constant(weight),
            discriminator: discriminator::Hyperparameters::default(),
            policy_update: PolicyUpdate::Ppo,
            ppo: ppo::Hyperparameters::for_env(env),
            trpo: trpo::Hyperparameters::for_env(env),
        }
    }
}

impl PolicyUpdate {
    /// The update, from `agent` on.
    pub(super) fn start(
        self,
        ppo: ppo::Hyperparameters,
        trpo: trpo::Hyperparameters,
        agent: Agent,
    ) -> Box<dyn OnPolicy> {
        match self {
            Self::Ppo => Box::new(Ppo::new(ppo, agent)),
            Self::Trpo => Box::new(Trpo::new(trpo, agent)),
        }
    }

    /// The work of the update.
    pub(super) fn operations(
        self,
        ppo: &ppo::Hyperparameters,
        trpo: &trpo::Hyperparameters,
        counter: &Counter<'_>,
    ) -> Vec<Operations> {
        match self {
            Self::Ppo => ppo::operations(ppo, counter),
            Self::Trpo => trpo::operations(trpo, counter),
        }
    }
}

/// POfD from `agent` on, against `demonstration`.
pub fn pofd(
    hyperparameters: Hyperparameters,
    agent: Agent,
    demonstration: &Demonstration,
    seed: Seed,
) -> Adversarial {
    let Hyperparameters {
        weight,
        discriminator,
        policy_update,
        ppo,
        trpo,
    } = hyperparameters;
    Adversarial {
        discriminator: Discriminator::new(discriminator, demonstration, agent.hidden(), seed),
        task: 1.0,
        imitation: weight.get(),
        inner: policy_update.start(ppo, trpo, agent),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{algo::one_step, rng::Stream};

    fn sparse(s: f64, a: f64) -> f64 {
        f64::from((a - s - 3.5).abs() < 0.3)
    }

    fn score(weight: f64, policy_update: PolicyUpdate) -> f64 {
        let mut hyperparameters = Hyperparameters::for_env(EnvId::Hopper);
        hyperparameters.weight = constant(weight);
        hyperparameters.policy_update = policy_update;
        hyperparameters.discriminator.learning_rate = constant(1e-2);
        hyperparameters.ppo.learning_rate = constant(3e-3);
        hyperparameters.ppo.minibatch = constant(128);
        hyperparameters.trpo.region.max_kl = constant(2e-2);
        hyperparameters.trpo.critic.learning_rate = constant(1e-2);
        hyperparameters.trpo.critic.minibatch = constant(128);
        let demonstration = one_step::demonstration(100, |s| s + 3.4);
        let mut pofd = pofd(
            hyperparameters,
            one_step::agent(0.5),
            &demonstration,
            Seed(0),
        );
        let mut rng = Seed(0).stream(Stream::Update, 0);
        for _ in 0..120 {
            let batch = one_step::batch(pofd.agent(), 512, sparse, &mut rng);
            pofd.update(&batch, &mut rng).expect("finite");
        }
        one_step::score(pofd.agent(), sparse)
    }

    #[test]
    fn the_discriminator_leads_to_a_reward_that_is_not_found_without_it() {
        for policy_update in [PolicyUpdate::Ppo, PolicyUpdate::Trpo] {
            let (with, without) = (score(0.1, policy_update), score(0.0, policy_update));
            assert!(
                with > 0.5 && without == 0.0,
                "{policy_update:?}: {with} with it, {without} without"
            );
        }
    }
}
