//! GAIL (Ho and Ermon, 2016): the discriminator's reward alone, `-log D(s, a)`.
//!
//! Owns how its parts go together: POfD without the task's reward. Knows nothing of the
//! discriminator's or the policy's update. Start at [`gail`].

use serde::{Deserialize, Serialize};

use super::{
    Agent,
    adversarial::{self, Adversarial},
    definition::{About, Definition},
    discriminator::{self, Discriminator},
    pofd::PolicyUpdate,
    ppo,
    revision::Part,
    trpo,
};
use crate::{demo::Demonstration, env::EnvId, rng::Seed};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "gail",
    revision: 1,
    uses: &[
        &adversarial::PART,
        &discriminator::PART,
        &ppo::PART,
        &trpo::PART,
    ],
};

/// GAIL as an algorithm of the catalogue.
pub static GAIL: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        ..About::new("gail", "GAIL", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| {
        start
            .imitate(|agent, demonstration, seed| gail(hyperparameters, agent, demonstration, seed))
    },
    operations: |h, counter| {
        let inner = h.policy_update.operations(&h.ppo, &h.trpo, counter);
        adversarial::operations(h.discriminator.updates, inner, counter)
    },
};

/// GAIL's hyperparameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// How the discriminator learns.
    pub discriminator: discriminator::Hyperparameters,
    /// Which update improves the policy.
    pub policy_update: PolicyUpdate,
    /// PPO's part.
    pub ppo: ppo::Hyperparameters,
    /// TRPO's part.
    pub trpo: trpo::Hyperparameters,
}

impl Hyperparameters {
    /// The defaults for `env`; TRPO, as in GAIL's own paper.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            discriminator: discriminator::Hyperparameters::default(),
            policy_update: PolicyUpdate::Trpo,
            ppo: ppo::Hyperparameters::for_env(env),
            trpo: trpo::Hyperparameters::for_env(env),
        }
    }
}

/// GAIL from `agent` on, against `demonstration`.
pub fn gail(
    hyperparameters: Hyperparameters,
    agent: Agent,
    demonstration: &Demonstration,
    seed: Seed,
) -> Adversarial {
    let Hyperparameters {
        discriminator,
        policy_update,
        ppo,
        trpo,
    } = hyperparameters;
    Adversarial {
        discriminator: Discriminator::new(discriminator, demonstration, agent.hidden(), seed),
        task: 0.0,
        imitation: 1.0,
        inner: policy_update.start(ppo, trpo, agent),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::{OnPolicy, one_step},
        quantity::constant,
        rng::Stream,
    };

    /// The mean distance from the demonstration's action after training with the discriminator's
    /// reward times `imitation`.
    fn distance(imitation: f64) -> f64 {
        let mut hyperparameters = Hyperparameters::for_env(EnvId::Hopper);
        hyperparameters.discriminator.learning_rate = constant(1e-2);
        hyperparameters.trpo.region.max_kl = constant(2e-2);
        hyperparameters.trpo.critic.learning_rate = constant(1e-2);
        hyperparameters.trpo.critic.minibatch = constant(128);
        let demonstration = one_step::demonstration(100, |s| s + 1.0);
        let mut gail = gail(
            hyperparameters,
            one_step::agent(0.5),
            &demonstration,
            Seed(0),
        );
        gail.imitation *= imitation;
        let mut rng = Seed(0).stream(Stream::Update, 0);
        for _ in 0..150 {
            let batch = one_step::batch(gail.agent(), 512, |_, a| -a, &mut rng);
            gail.update(&batch, &mut rng).expect("finite");
        }
        one_step::score(gail.agent(), |s, a| (a - s - 1.0).abs())
    }

    #[test]
    fn it_imitates_though_the_task_pays_for_the_opposite() {
        let (with, without) = (distance(1.0), distance(0.0));
        assert!(
            with < 0.4 && without > 0.9,
            "{with} with the discriminator, {without} without"
        );
    }
}
