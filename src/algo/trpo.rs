//! TRPO (Schulman et al., 2015): MCPO without its constraint.
//!
//! Owns the trust-region step on the surrogate alone. Knows nothing of demonstrations. Start at [`Trpo`].

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    critic::{self, Critic},
    definition::{About, Definition, Learner},
    finite, gae,
    operations::{Counter, Operations},
    revision::Part,
    stopwatch::Stopwatch,
    trust_region::{self, GAIN_SHARE, KL_MARGIN, Region, Surrogate},
};
use crate::{
    env::EnvId,
    nn::Pass,
    quantity::{Count, Discount, NonNegative, Positive, UnitInterval, constant},
    rng::Rng,
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part { name: "trpo", revision: 1, uses: &[&critic::PART, &gae::PART, &trust_region::PART] };

/// TRPO as an algorithm of the catalogue.
pub static TRPO: Definition<Hyperparameters> = Definition {
    about: About {
        name: "trpo",
        label: "TRPO",
        demonstration: false,
        dense: false,
        trains: true,
        steps: None,
        passes: 50.0,
        part: Some(&PART),
        later: &[],
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| Ok(Learner::on_policy(Trpo::new(hyperparameters, start.agent))),
    operations,
};

/// The operations of an update.
pub(super) fn operations(h: &Hyperparameters, counter: &Counter<'_>) -> Vec<Operations> {
    let mut parts = vec![counter.values(), counter.surrogate_gradient()];
    parts.extend(trust_region::operations(h.fisher_samples, counter.trials(h.line_search_steps), counter));
    parts.push(counter.value_epochs(h.value_epochs));
    parts
}

/// TRPO's hyperparameters; the defaults are MCPO's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// delta, the bound of the mean KL of one update.
    pub max_kl: Positive,
    /// Added to the Fisher matrix's diagonal.
    pub damping: NonNegative,
    /// Products of conjugate gradient, at most.
    pub cg_iterations: Count,
    /// The most samples of the batch, evenly spaced, that make the Fisher matrix.
    pub fisher_samples: Count,
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
    /// Adam's step size for the value network.
    pub learning_rate: Positive,
    /// L2 penalty on the value network's parameters.
    pub l2_penalty: NonNegative,
    /// Passes of the value network over each batch.
    pub value_epochs: Count,
    /// Samples in a minibatch of the value network.
    pub minibatch: Count,
    /// Steps that the line search tries, each half the one before.
    pub line_search_steps: Count,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            max_kl: constant(5e-3),
            damping: constant(1e-2),
            cg_iterations: constant(10),
            fisher_samples: constant(1024),
            discount: constant(0.99),
            gae_lambda: constant(0.95),
            learning_rate: constant(1e-4),
            l2_penalty: constant(1e-3),
            value_epochs: constant(10),
            minibatch: constant(if env == EnvId::MountainCar { 64 } else { 1024 }),
            line_search_steps: constant(10),
        }
    }

    /// The trust region.
    pub(super) fn region(&self) -> Region {
        Region {
            max_kl: self.max_kl.get(),
            damping: self.damping.get(),
            cg_iterations: self.cg_iterations.size(),
            fisher_samples: self.fisher_samples.size(),
        }
    }

    /// How the value network is fitted.
    pub(super) fn critic_fit(&self) -> critic::Fit {
        critic::Fit {
            epochs: self.value_epochs.size(),
            minibatch: self.minibatch.size(),
            learning_rate: self.learning_rate.get(),
            l2_penalty: self.l2_penalty.get(),
        }
    }
}

/// TRPO.
pub struct Trpo {
    hyperparameters: Hyperparameters,
    state: State,
    pass: Pass,
    trial_pass: Pass,
}

#[derive(Serialize, Deserialize)]
struct State {
    agent: Agent,
    critic: Critic,
}

impl Trpo {
    /// TRPO from `agent` on.
    pub fn new(hyperparameters: Hyperparameters, agent: Agent) -> Self {
        let critic = Critic::new(&agent.value);
        Self { hyperparameters, state: State { agent, critic }, pass: Pass::default(), trial_pass: Pass::default() }
    }
}

impl OnPolicy for Trpo {
    fn agent(&self) -> &Agent {
        &self.state.agent
    }

    fn agent_mut(&mut self) -> &mut Agent {
        &mut self.state.agent
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let Self { hyperparameters: h, state: State { agent, critic }, pass, trial_pass } = self;
        let mut watch = Stopwatch::start();
        let estimate =
            gae::estimate(batch, &batch.rewards, &agent.value, h.discount.get(), h.gae_lambda.get(), trial_pass);
        watch.lap("advantages");

        let surrogate = Surrogate::new(&agent.policy, batch, &estimate.advantages, pass);
        let mut g = surrogate.gradient(&agent.policy, pass);
        g.iter_mut().for_each(|g| *g = -*g);
        watch.lap("gradient");

        let solved = h.region().step(&agent.policy, &batch.observations, pass, &g, None);
        let step = solved.step.ok_or(AlgoError::Undefined { q: solved.q, r: solved.r, s: solved.s })?;
        watch.lap("conjugate gradient");

        let promised = -solved.objective_change;
        let found = trust_region::search(&mut agent.policy, &step, h.line_search_steps.size(), |policy, fraction| {
            let trial = surrogate.measure(policy, trial_pass);
            let tests = [
                (trial.kl <= KL_MARGIN * h.max_kl.get(), "KL"),
                (trial.gain >= GAIN_SHARE * fraction * promised, "surrogate"),
            ];
            tests.into_iter().find(|(passed, _)| !passed).map_or(Ok(trial), |(_, failed)| Err(failed))
        });
        watch.lap("line search");

        let value_loss = critic.fit(&mut agent.value, &batch.observations, &estimate.returns, h.critic_fit(), rng)?;
        watch.lap("value");

        let (step_fraction, kl, gain) = found.map_or((0.0, 0.0, 0.0), |(step, trial)| (step, trial.kl, trial.gain));
        Ok(Update {
            kl: Some(finite("the KL", kl)?),
            entropy: Some(agent.policy.entropy()),
            surrogate_gain: Some(finite("the surrogate's gain", gain)?),
            value_loss: Some(value_loss),
            lambda: solved.solution.multipliers().map(|(lambda, _)| lambda),
            step_fraction: Some(step_fraction),
            cg_iterations: Some(solved.products as u64),
            seconds: watch.laps(),
            ..Update::default()
        })
    }

    fn save(&self) -> Vec<u8> {
        super::to_bytes(&self.state)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.state = super::from_bytes("trpo", state)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::bandit,
        rng::{Seed, Stream},
    };

    fn reward(s: f64, a: f64) -> f64 {
        -(a - s).powi(2)
    }

    fn trained(iterations: usize) -> (Trpo, Vec<Update>) {
        let hyperparameters = Hyperparameters {
            max_kl: constant(2e-2),
            learning_rate: constant(1e-2),
            minibatch: constant(128),
            ..Hyperparameters::for_env(EnvId::Hopper)
        };
        let mut trpo = Trpo::new(hyperparameters, bandit::agent(0.5));
        let mut rng = Seed(0).stream(Stream::Update, 0);
        let updates = (0..iterations)
            .map(|_| {
                let batch = bandit::batch(trpo.agent(), 512, reward, &mut rng);
                trpo.update(&batch, &mut rng).expect("finite")
            })
            .collect();
        (trpo, updates)
    }

    #[test]
    fn it_learns_a_dense_reward_within_its_trust_region() {
        let (trpo, updates) = trained(40);
        let score = bandit::score(trpo.agent(), reward);
        assert!(score > -0.02, "{score}");
        assert!(updates.iter().all(|update| update.kl <= Some(KL_MARGIN * 2e-2)));
    }

    #[test]
    fn a_restored_run_has_the_same_state() {
        let (first, _) = trained(2);
        let (mut second, _) = trained(1);
        second.restore(&first.save()).expect("the same shapes");
        assert_eq!(first.save(), second.save());
    }
}
