//! Pre-training (Silver et al., 2016): behaviour cloning on the demonstration, then PPO.
//!
//! Owns the order of the two, and the name of the result of the first. Knows nothing of either's
//! inside. Start at [`Pretraining`].
//!
//! The cloned policy keeps the standard deviation it started with (mean squared error does not see
//! it), and the value network and both optimisers start fresh. The normaliser stays at the
//! demonstration's statistics: the clone is a function of states in these units. If the normaliser
//! ran on, as PPO's own does, the exploring agent's states would stretch the units under the clone,
//! most where the demonstration's states lie close together.

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update, cloning,
    definition::{About, Definition, Learner},
    ppo::{self, Ppo},
    revision::Part,
};
use crate::{
    demo::Demonstration,
    env::EnvId,
    nn::Pass,
    rng::{Rng, Seed, Stream},
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "pretraining",
    revision: 1,
    uses: &[&cloning::PART, &ppo::PART],
};

/// Pre-training as an algorithm of the catalogue.
pub static PRETRAINING: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        ..About::new("pretraining", "Pre-training", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: Some(|hyperparameters| &hyperparameters.cloning),
    start: |hyperparameters, start| {
        let (agent, demonstration) = start.with_demonstration()?;
        Ok(Learner::on_policy(Pretrained::new(
            hyperparameters,
            agent,
            demonstration,
        )))
    },
    operations: |hyperparameters, counter| ppo::operations(&hyperparameters.ppo, counter),
};

/// Pre-training's hyperparameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Behaviour cloning, before the first rollout.
    pub cloning: cloning::Hyperparameters,
    /// PPO, from then on.
    pub ppo: ppo::Hyperparameters,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            cloning: cloning::Hyperparameters::for_env(env),
            ppo: ppo::Hyperparameters::for_env(env),
        }
    }
}

/// Everything that decides a pre-trained agent.
#[derive(Debug, Clone, Copy)]
pub struct Pretraining<'a> {
    /// The hyperparameters of its cloning.
    pub hyperparameters: &'a cloning::Hyperparameters,
    /// The agent before cloning.
    pub agent: &'a Agent,
    /// The demonstration that it learns from.
    pub demonstration: &'a Demonstration,
    /// The seed of the minibatches' order.
    pub seed: Seed,
}

impl Pretraining<'_> {
    /// The name of the agent that [`train`](Self::train) returns: a hash of all that it depends on,
    /// the revision of cloning included. Only the class of the machine may still change last bits.
    pub fn key(&self) -> String {
        let Self {
            hyperparameters,
            agent,
            demonstration,
            seed,
        } = self;
        let (observations, actions) = (&demonstration.observations, &demonstration.actions);
        let numbers = (
            observations.shape(),
            observations.as_slice(),
            actions.shape(),
            actions.as_slice(),
        );
        blake3::hash(&super::to_bytes(&(
            cloning::PART.revision,
            hyperparameters,
            agent,
            numbers,
            seed,
        )))
        .to_hex()
        .to_string()
    }

    /// The agent after behaviour cloning, which calls `alive` after each epoch; unchanged PPO
    /// follows.
    ///
    /// # Errors
    ///
    /// The loss is no longer finite.
    pub fn train(&self, alive: &mut dyn FnMut()) -> Result<Agent, AlgoError> {
        let mut agent = self.agent.clone();
        let mut rng = self.seed.stream(Stream::Pretraining, 0);
        cloning::clone_behaviour(
            self.hyperparameters,
            self.demonstration,
            &mut agent,
            &mut rng,
            |epoch, loss, _| {
                tracing::debug!(epoch, loss, "behaviour cloning");
                alive();
            },
        )?;
        Ok(agent)
    }
}

/// PPO from the pre-trained agent on, which records with each update how much of the clone is left.
pub struct Pretrained {
    ppo: Ppo,
    loss: cloning::Loss,
    demonstration: Demonstration,
    pass: Pass,
}

impl Pretrained {
    /// PPO from `agent` on, which was cloned from `demonstration`.
    pub fn new(
        hyperparameters: Hyperparameters,
        agent: Agent,
        demonstration: Demonstration,
    ) -> Self {
        let Hyperparameters { cloning, ppo } = hyperparameters;
        Self {
            ppo: Ppo::new(ppo, agent),
            loss: cloning.loss,
            demonstration,
            pass: Pass::default(),
        }
    }
}

impl OnPolicy for Pretrained {
    fn agent(&self) -> &Agent {
        self.ppo.agent()
    }

    fn agent_mut(&mut self) -> &mut Agent {
        self.ppo.agent_mut()
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let cloning_loss = Some(cloning::loss_of(
            self.loss,
            self.ppo.agent(),
            &self.demonstration,
            &mut self.pass,
        ));
        Ok(Update {
            cloning_loss,
            ..self.ppo.update(batch, rng)?
        })
    }

    fn save(&self) -> Vec<u8> {
        self.ppo.save()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.ppo.restore(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{algo::one_step, quantity::constant};

    /// Pays beside the demonstration, where a policy near zero never comes.
    fn sparse(s: f64, a: f64) -> f64 {
        f64::from((a - s - 3.5).abs() < 0.3)
    }

    fn hyperparameters() -> cloning::Hyperparameters {
        cloning::Hyperparameters {
            epochs: constant(200),
            learning_rate: constant(3e-3),
            ..cloning::Hyperparameters::for_env(EnvId::Hopper)
        }
    }

    /// The score of PPO from `agent` on.
    fn score_after_ppo(agent: Agent) -> f64 {
        let hyperparameters = ppo::Hyperparameters {
            learning_rate: constant(3e-3),
            minibatch: constant(128),
            ..ppo::Hyperparameters::for_env(EnvId::Hopper)
        };
        let mut ppo = Ppo::new(hyperparameters, agent);
        let mut rng = Seed(0).stream(Stream::Update, 0);
        for _ in 0..60 {
            let batch = one_step::batch(ppo.agent(), 512, sparse, &mut rng);
            ppo.update(&batch, &mut rng).expect("finite");
        }
        one_step::score(ppo.agent(), sparse)
    }

    fn cloned(
        hyperparameters: &cloning::Hyperparameters,
        agent: &Agent,
        demonstration: &Demonstration,
    ) -> Agent {
        Pretraining {
            hyperparameters,
            agent,
            demonstration,
            seed: Seed(0),
        }
        .train(&mut || {})
        .expect("finite")
    }

    /// Cloning leads to where the reward can be met, and PPO from there to it; neither gets there
    /// alone.
    #[test]
    fn it_learns_a_sparse_reward_that_neither_of_its_parts_does() {
        let (hyperparameters, agent) = (hyperparameters(), one_step::agent(0.5));
        let demonstration = one_step::demonstration(100, |s| s + 2.9);
        let cloned = cloned(&hyperparameters, &agent, &demonstration);
        assert_eq!(
            cloned.value, agent.value,
            "a demonstration says nothing of sparse returns"
        );
        let alone = (one_step::score(&cloned, sparse), score_after_ppo(agent));
        let together = score_after_ppo(cloned);
        assert!(
            alone == (0.0, 0.0) && together > 0.8,
            "{alone:?} alone, {together} together"
        );
    }

    /// The states that an agent meets move the units of other methods' inputs, but not the clone's,
    /// whose loss each update tells.
    #[test]
    fn states_far_from_the_demonstration_leave_the_clone_as_it_is() {
        let (hyperparameters, agent) = (hyperparameters(), one_step::agent(0.5));
        let mut demonstration = one_step::demonstration(100, |s| s);
        demonstration.observations *= 0.1;
        demonstration
            .actions
            .copy_from(&(&demonstration.observations * 10.0));
        let cloned = cloned(&hyperparameters, &agent, &demonstration);
        let loss = cloning::loss_of(
            hyperparameters.loss,
            &cloned,
            &demonstration,
            &mut Pass::default(),
        );
        let ppo = ppo::Hyperparameters {
            minibatch: constant(128),
            ..ppo::Hyperparameters::for_env(EnvId::Hopper)
        };
        let mut pretrained = Pretrained::new(
            Hyperparameters {
                cloning: hyperparameters,
                ppo,
            },
            cloned,
            demonstration,
        );
        for i in 0..4096 {
            pretrained
                .agent_mut()
                .normalizer
                .update(&[3.0 * f64::from(i).sin()]);
        }
        let mut rng = Seed(0).stream(Stream::Update, 0);
        let batch = one_step::batch(pretrained.agent(), 256, sparse, &mut rng);
        let told = pretrained
            .update(&batch, &mut rng)
            .expect("finite")
            .cloning_loss
            .expect("it is told");
        assert!(
            loss < 0.01 && (told - loss).abs() < 0.01 * loss,
            "{told} after {loss}"
        );
    }

    #[test]
    fn the_key_tells_whatever_decides_the_agent() {
        let (hyperparameters, agent) = (hyperparameters(), one_step::agent(0.5));
        let demonstration = one_step::demonstration(20, |s| s);
        let start = Pretraining {
            hyperparameters: &hyperparameters,
            agent: &agent,
            demonstration: &demonstration,
            seed: Seed(0),
        };
        let named = Demonstration {
            provenance: vec![("return".into(), "1".into())],
            ..demonstration.clone()
        };
        assert_eq!(
            Pretraining {
                demonstration: &named,
                ..start
            }
            .key(),
            start.key()
        );
        let nll = cloning::Hyperparameters {
            loss: cloning::Loss::Nll,
            ..hyperparameters.clone()
        };
        let mut wide = agent.clone();
        wide.normalizer = crate::nn::Normalizer::new(1, 5.0);
        let mut other = demonstration.clone();
        other.actions[7] += 1e-9;
        for changed in [
            Pretraining {
                hyperparameters: &nll,
                ..start
            },
            Pretraining {
                agent: &wide,
                ..start
            },
            Pretraining {
                agent: &one_step::agent(0.4),
                ..start
            },
            Pretraining {
                demonstration: &other,
                ..start
            },
            Pretraining {
                seed: Seed(1),
                ..start
            },
        ] {
            assert_ne!(changed.key(), start.key(), "{changed:?}");
        }
    }
}
