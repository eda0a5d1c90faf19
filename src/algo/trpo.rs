//! TRPO (Schulman et al., 2015): MCPO without its constraint.
//!
//! Owns the trust-region step on the surrogate alone. Knows nothing of demonstrations. Start at
//! [`Trpo`].

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    critic::{self, Critic},
    definition::{About, Definition, Learner},
    finite,
    operations::{Counter, Operations},
    revision::Part,
    stopwatch::Stopwatch,
    trust_region::{self, Attempt, Surrogate, TrustRegion, judged},
};
use crate::{env::EnvId, nn::Pass, rng::Rng};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "trpo",
    revision: 1,
    uses: &[&critic::PART, &trust_region::PART],
};

/// TRPO as an algorithm of the catalogue.
pub static TRPO: Definition<Hyperparameters> = Definition {
    about: About {
        passes: 50.0,
        ..About::new("trpo", "TRPO", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| Ok(Learner::on_policy(Trpo::new(hyperparameters, start.agent))),
    operations,
};

/// The work of an update.
pub(super) fn operations(h: &Hyperparameters, counter: &Counter<'_>) -> Vec<Operations> {
    let mut parts = vec![counter.values(), counter.surrogate_gradient()];
    parts.extend(trust_region::operations(
        &h.region,
        counter.trials(h.region.line_search_steps),
        counter,
    ));
    parts.push(counter.value_epochs(h.critic.value_epochs));
    parts
}

/// TRPO's hyperparameters; the defaults are MCPO's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// The trust region.
    #[serde(flatten)]
    pub region: TrustRegion,
    /// The value network and the advantages.
    #[serde(flatten)]
    pub critic: critic::Hyperparameters,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        let minibatch = if env == EnvId::MountainCar { 64 } else { 1024 };
        Self {
            region: TrustRegion::default(),
            critic: critic::Hyperparameters::with_minibatch(minibatch),
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
        Self {
            hyperparameters,
            state: State { agent, critic },
            pass: Pass::default(),
            trial_pass: Pass::default(),
        }
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
        let Self {
            hyperparameters: h,
            state: State { agent, critic },
            pass,
            trial_pass,
        } = self;
        let Hyperparameters { region, critic: c } = h;
        let mut watch = Stopwatch::start();
        let estimate = c.estimate(batch, &batch.rewards, &agent.value, trial_pass);
        watch.lap("advantages");

        let surrogate = Surrogate::new(&agent.policy, batch, &estimate.advantages, pass);
        let mut g = surrogate.gradient(&agent.policy, pass);
        // The step minimises, so this is the gradient of the loss.
        g.iter_mut().for_each(|g| *g = -*g);
        watch.lap("gradient");

        let solved = region.step(&agent.policy, &batch.observations, pass, &g, None);
        let step = trust_region::step_of(&solved)?;
        watch.lap("conjugate gradient");

        let improved = region.improve(
            &mut agent.policy,
            step,
            None,
            |Attempt {
                 policy, fraction, ..
             }| {
                let trial = surrogate.measure(policy, trial_pass);
                let rises = trial.gain >= trust_region::enough(fraction, -solved.objective_change);
                judged([region.holds(&trial), (rises, "surrogate")], trial)
            },
        );
        watch.lap("line search");

        let value_loss = critic.fit(
            &mut agent.value,
            &batch.observations,
            &estimate.returns,
            c.fit(),
            rng,
        )?;
        watch.lap("value");

        let (step_fraction, kl, gain) = improved.map_or((0.0, 0.0, 0.0), |found| {
            (found.fraction, found.verdict.kl, found.verdict.gain)
        });
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
        algo::{one_step, trust_region::KL_MARGIN},
        quantity::constant,
        rng::{Seed, Stream},
    };

    fn reward(s: f64, a: f64) -> f64 {
        -(a - s).powi(2)
    }

    fn trained(iterations: usize) -> (Trpo, Vec<Update>) {
        let mut hyperparameters = Hyperparameters::for_env(EnvId::Hopper);
        hyperparameters.region.max_kl = constant(2e-2);
        hyperparameters.critic.learning_rate = constant(1e-2);
        hyperparameters.critic.minibatch = constant(128);
        let mut trpo = Trpo::new(hyperparameters, one_step::agent(0.5));
        let mut rng = Seed(0).stream(Stream::Update, 0);
        let updates = (0..iterations)
            .map(|_| {
                let batch = one_step::batch(trpo.agent(), 512, reward, &mut rng);
                trpo.update(&batch, &mut rng).expect("finite")
            })
            .collect();
        (trpo, updates)
    }

    #[test]
    fn it_learns_a_dense_reward_within_its_trust_region() {
        let (trpo, updates) = trained(40);
        let score = one_step::score(trpo.agent(), reward);
        assert!(score > -0.02, "{score}");
        assert!(
            updates
                .iter()
                .all(|update| update.kl <= Some(KL_MARGIN * 2e-2))
        );
    }

    #[test]
    fn a_restored_run_has_the_same_state() {
        let (first, _) = trained(2);
        let (mut second, _) = trained(1);
        second.restore(&first.save()).expect("the same shapes");
        assert_eq!(first.save(), second.save());
    }
}
