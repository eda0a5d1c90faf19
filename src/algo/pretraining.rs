//! Pre-training (Silver et al., 2016): behaviour cloning on the demonstration, then PPO.
//!
//! Owns the order of the two, and what names the result of the first. Knows nothing of either's inside. Start at
//! [`Pretraining`].
//!
//! The cloned policy keeps the standard deviation it started with (mean squared error does not see it), the normaliser
//! starts at the demonstration's statistics, and the value network and both optimisers start fresh. The normaliser then
//! runs on, as every method's does, and so what the policy sees of a state changes: where the demonstration's states lie
//! close together and the exploring agent's do not, as in InvertedPendulum, the return falls at once and is learned back.
//! A frozen normaliser was tried (one seed, 32,768 steps): somewhat better in HalfCheetah, somewhat worse in Hopper, and
//! far worse in InvertedPendulum, whose states it clips.

use serde::{Deserialize, Serialize};

use super::{Agent, AlgoError, REVISION, cloning, ppo};
use crate::{
    demo::Demonstration,
    env::EnvId,
    rng::{Seed, Stream},
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
        Self { cloning: cloning::Hyperparameters::for_env(env), ppo: ppo::Hyperparameters::for_env(env) }
    }
}

/// Everything that decides a pre-trained agent.
#[derive(Debug, Clone, Copy)]
pub struct Pretraining<'a> {
    /// How it learns.
    pub hyperparameters: &'a cloning::Hyperparameters,
    /// The agent before it learned anything.
    pub agent: &'a Agent,
    /// From what it learns.
    pub demonstration: &'a Demonstration,
    /// Of the order of the minibatches.
    pub seed: Seed,
}

impl Pretraining<'_> {
    /// What names the agent that [`train`](Self::train) gives: a hash of all that it depends on, this program's
    /// [`REVISION`] included. Only the class of the machine may still change last bits.
    pub fn key(&self) -> String {
        let Self { hyperparameters, agent, demonstration, seed } = self;
        let (observations, actions) = (&demonstration.observations, &demonstration.actions);
        let numbers = (observations.shape(), observations.as_slice(), actions.shape(), actions.as_slice());
        blake3::hash(&super::to_bytes(&(REVISION, hyperparameters, agent, numbers, seed))).to_hex().to_string()
    }

    /// The agent after behaviour cloning, which calls `alive` after each epoch; what follows is PPO as it is.
    ///
    /// Errors: the loss is no longer finite.
    pub fn train(&self, alive: &mut dyn FnMut()) -> Result<Agent, AlgoError> {
        let mut agent = self.agent.clone();
        let mut rng = self.seed.stream(Stream::Pretraining, 0);
        cloning::clone_behaviour(self.hyperparameters, self.demonstration, &mut agent, &mut rng, |epoch, loss, _| {
            tracing::debug!(epoch, loss, "behaviour cloning");
            alive();
        })?;
        Ok(agent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::{OnPolicy, bandit, ppo::Ppo},
        quantity::constant,
    };

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
            let batch = bandit::batch(ppo.agent(), 512, sparse, &mut rng);
            ppo.update(&batch, &mut rng).expect("finite");
        }
        bandit::score(ppo.agent(), sparse)
    }

    /// Cloning leads to where the reward can be met, and PPO from there to it; neither gets there alone.
    #[test]
    fn it_learns_a_sparse_reward_that_neither_of_its_parts_does() {
        let (hyperparameters, agent) = (hyperparameters(), bandit::agent(0.5));
        let demonstration = bandit::demonstration(100, |s| s + 2.9);
        let start = Pretraining {
            hyperparameters: &hyperparameters,
            agent: &agent,
            demonstration: &demonstration,
            seed: Seed(0),
        };
        let cloned = start.train(&mut || {}).expect("finite");
        assert_eq!(cloned.value, agent.value, "a demonstration says nothing of sparse returns");
        let alone = (bandit::score(&cloned, sparse), score_after_ppo(agent));
        let together = score_after_ppo(cloned);
        assert!(alone == (0.0, 0.0) && together > 0.8, "{alone:?} alone, {together} together");
    }

    #[test]
    fn the_key_tells_whatever_decides_the_agent() {
        let (hyperparameters, agent) = (hyperparameters(), bandit::agent(0.5));
        let demonstration = bandit::demonstration(20, |s| s);
        let start = Pretraining {
            hyperparameters: &hyperparameters,
            agent: &agent,
            demonstration: &demonstration,
            seed: Seed(0),
        };
        let named = Demonstration { provenance: vec![("return".into(), "1".into())], ..demonstration.clone() };
        assert_eq!(Pretraining { demonstration: &named, ..start }.key(), start.key());
        let nll = cloning::Hyperparameters { loss: cloning::Loss::Nll, ..hyperparameters.clone() };
        let mut wide = agent.clone();
        wide.normalizer = crate::nn::Normalizer::new(1, 5.0);
        let mut other = demonstration.clone();
        other.actions[7] += 1e-9;
        for changed in [
            Pretraining { hyperparameters: &nll, ..start },
            Pretraining { agent: &wide, ..start },
            Pretraining { agent: &bandit::agent(0.4), ..start },
            Pretraining { demonstration: &other, ..start },
            Pretraining { seed: Seed(1), ..start },
        ] {
            assert_ne!(changed.key(), start.key(), "{changed:?}");
        }
    }
}
