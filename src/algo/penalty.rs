//! The penalty method of the main paper's comparison: the surrogate minus a weighted MMD^2, with a
//! fixed or a shrinking weight.
//!
//! Owns what MCPO replaces: `maximise E[(pi/pi_k) A] - w_k D(pi)` under the KL alone, `w_k+1 = w_k
//! (1 - epsilon)`. Knows nothing of how D is measured. Start at [`Penalty`].
//!
//! The surrogate is a mean over steps, and its gradient that of `(1 - gamma)` times the discounted
//! return: the main paper's penalty `eta - lambda D` on the return is `w = (1 - gamma) lambda`
//! here. Its weights are not known; 1 is this project's.

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    critic::{self, Critic},
    definition::{About, Definition},
    finite, mimicry,
    mimicry::Mimicry,
    revision::Part,
    stopwatch::Stopwatch,
    trpo,
    trust_region::{self, Attempt, Improved, Surrogate, judged},
};
use crate::{
    demo::Demonstration,
    env::EnvId,
    nn::Pass,
    quantity::{NonNegative, UnitInterval, constant},
    rng::{Rng, Seed},
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "penalty",
    revision: 1,
    uses: &[
        &critic::PART,
        &mimicry::PART,
        &trpo::PART,
        &trust_region::PART,
    ],
};

/// The penalty method as an algorithm of the catalogue.
pub static PENALTY: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        ..About::new("penalty", "Penalty", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| {
        start.imitate(|agent, demonstration, seed| {
            Penalty::new(hyperparameters, agent, demonstration, seed)
        })
    },
    operations: |h, counter| {
        let trials = counter.trials(h.trpo.region.line_search_steps);
        let mut parts = trpo::operations(&h.trpo, counter);
        parts.push(mimicry::operations(
            h.mmd.samples,
            h.trpo.critic.value_epochs,
            trials,
            counter,
        ));
        parts
    },
};

/// The penalty method's hyperparameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// w, the weight of MMD^2 at the first iteration, in units of a step's advantage: `1 - gamma`
    /// times a weight against the discounted return.
    pub weight: NonNegative,
    /// How fast the weight shrinks: `w_k+1 = w_k (1 - epsilon)`; 0 keeps it.
    pub epsilon: UnitInterval,
    /// How MMD^2 to the demonstration is measured.
    pub mmd: mimicry::Hyperparameters,
    /// The trust-region step.
    pub trpo: trpo::Hyperparameters,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            weight: constant(1.0),
            epsilon: constant(0.0),
            mmd: mimicry::Hyperparameters::default(),
            trpo: trpo::Hyperparameters::for_env(env),
        }
    }
}

/// The penalty method.
pub struct Penalty {
    hyperparameters: Hyperparameters,
    mimicry: Mimicry,
    state: State,
    pass: Pass,
    trial_pass: Pass,
}

#[derive(Serialize, Deserialize)]
struct State {
    agent: Agent,
    critic: Critic,
    /// The weight w_k.
    weight: f64,
}

impl Penalty {
    /// The penalty method from `agent` on, near `demonstration`.
    pub fn new(
        hyperparameters: Hyperparameters,
        agent: Agent,
        demonstration: &Demonstration,
        seed: Seed,
    ) -> Self {
        let mimicry = Mimicry::new(
            hyperparameters.mmd.clone(),
            demonstration,
            agent.hidden(),
            seed,
        );
        let state = State {
            critic: Critic::new(&agent.value),
            agent,
            weight: hyperparameters.weight.get(),
        };
        Self {
            hyperparameters,
            mimicry,
            state,
            pass: Pass::default(),
            trial_pass: Pass::default(),
        }
    }
}

impl OnPolicy for Penalty {
    fn agent(&self) -> &Agent {
        &self.state.agent
    }

    fn agent_mut(&mut self) -> &mut Agent {
        &mut self.state.agent
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let Self {
            hyperparameters,
            mimicry,
            state:
                State {
                    agent,
                    critic,
                    weight,
                },
            pass,
            trial_pass,
        } = self;
        let trpo::Hyperparameters { region, critic: c } = &hyperparameters.trpo;
        let mut watch = Stopwatch::start();
        let estimate = c.estimate(batch, &batch.rewards, &agent.value, trial_pass);
        watch.lap("advantages");

        let surrogate = Surrogate::new(&agent.policy, batch, &estimate.advantages, pass);
        let measured = mimicry.measure(agent, &surrogate, pass, c, rng)?;
        let mut g = surrogate.gradient(&agent.policy, pass);
        // The step minimises, so the surrogate enters with the other sign.
        for (g, b) in g.iter_mut().zip(&measured.gradient) {
            *g = (*weight * f64::from(*b) - f64::from(*g)) as f32;
        }
        watch.lap("gradients");

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
                let mmd = mimicry.at(&measured, policy, &trial.ratios);
                let gain = trial.gain - *weight * (mmd - measured.mmd);
                let rises = gain >= trust_region::enough(fraction, -solved.objective_change);
                judged(
                    [region.holds(&trial), (rises, "penalised surrogate")],
                    (trial, mmd),
                )
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

        *weight *= 1.0 - hyperparameters.epsilon.get();
        let (step_fraction, kl, gain, mmd_after) = improved.map_or(
            (0.0, 0.0, 0.0, measured.mmd),
            |Improved {
                 fraction,
                 verdict: (trial, mmd),
                 ..
             }| { (fraction, trial.kl, trial.gain, mmd) },
        );
        Ok(Update {
            kl: Some(finite("the KL", kl)?),
            entropy: Some(agent.policy.entropy()),
            surrogate_gain: Some(finite("the surrogate's gain", gain)?),
            value_loss: Some(value_loss),
            mmd: Some(measured.mmd),
            mmd_after: Some(finite("D", mmd_after)?),
            lambda: solved.solution.multipliers().map(|(lambda, _)| lambda),
            step_fraction: Some(step_fraction),
            cg_iterations: Some(solved.products as u64),
            seconds: watch.laps(),
            ..Update::default()
        })
    }

    fn save(&self) -> Vec<u8> {
        super::to_bytes(&(&self.state, self.mimicry.save()))
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        let (state, mimicry): (State, Vec<u8>) = super::from_bytes("the penalty method", state)?;
        self.mimicry.restore(&mimicry)?;
        self.state = state;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{algo::one_step, rng::Stream};

    fn sparse(s: f64, a: f64) -> f64 {
        f64::from((a - s - 3.5).abs() < 0.3)
    }

    fn score(weight: f64) -> f64 {
        let mut trpo = trpo::Hyperparameters::for_env(EnvId::Hopper);
        trpo.region.max_kl = constant(2e-2);
        trpo.critic.learning_rate = constant(1e-2);
        trpo.critic.minibatch = constant(128);
        let hyperparameters = Hyperparameters {
            weight: constant(weight),
            epsilon: constant(0.05),
            mmd: mimicry::Hyperparameters::default(),
            trpo,
        };
        let demonstration = one_step::demonstration(100, |s| s + 2.9);
        let mut penalty = Penalty::new(
            hyperparameters,
            one_step::agent(0.5),
            &demonstration,
            Seed(0),
        );
        let mut rng = Seed(0).stream(Stream::Update, 0);
        for _ in 0..120 {
            let batch = one_step::batch(penalty.agent(), 512, sparse, &mut rng);
            penalty.update(&batch, &mut rng).expect("finite");
        }
        one_step::score(penalty.agent(), sparse)
    }

    #[test]
    fn the_penalty_leads_to_a_reward_that_is_not_found_without_it() {
        let (with, without) = (score(1.0), score(0.0));
        assert!(
            with > 0.3 && without == 0.0,
            "{with} with the penalty, {without} without"
        );
    }
}
