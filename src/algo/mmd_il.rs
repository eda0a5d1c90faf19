//! MMD imitation: MMD^2 to the demonstration minimised directly, whatever the task's reward.
//!
//! Owns the descent on D alone (appendix, Eq. 13); D, its witness and its gradient are those of
//! MCPO's constraint. Knows nothing of rewards. Start at [`MmdIl`].
//!
//! From a `rollout`, the default, as the appendix words it, each iteration is one trust-region step
//! down b, whose advantages are those of the witness function as a cost. At the `demo_states` it is
//! a few steps of Adam, and the rollouts serve the normaliser and the curve alone.

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    definition::{About, Definition},
    finite, mimicry,
    mimicry::{Mimicry, Samples},
    operations::{Counter, Operations},
    revision::Part,
    stopwatch::Stopwatch,
    trpo,
    trust_region::{self, Attempt, Surrogate, judged},
};
use crate::{
    demo::Demonstration,
    env::EnvId,
    nn::Pass,
    quantity::{Count, Positive, constant},
    rng::{Rng, Seed},
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "mmd_il",
    revision: 1,
    uses: &[&mimicry::PART, &trpo::PART, &trust_region::PART],
};

/// MMD imitation as an algorithm of the catalogue.
pub static MMD_IL: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        passes: 50.0,
        ..About::new("mmd_il", "MMD-IL", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| {
        start.imitate(|agent, demonstration, seed| {
            MmdIl::new(hyperparameters, agent, demonstration, seed)
        })
    },
    operations,
};

/// The work of an update.
fn operations(h: &Hyperparameters, counter: &Counter<'_>) -> Vec<Operations> {
    match h.mmd.samples {
        Samples::DemoStates => vec![("descent", mimicry::descent_operations(counter))],
        Samples::Rollout => {
            let trials = counter.trials(h.trpo.region.line_search_steps);
            let mut parts = vec![mimicry::operations(
                h.mmd.samples,
                h.trpo.critic.value_epochs,
                trials,
                counter,
            )];
            parts.extend(trust_region::operations(&h.trpo.region, trials, counter));
            parts
        }
    }
}

/// MMD imitation's hyperparameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// How MMD^2 to the demonstration is measured.
    pub mmd: mimicry::Hyperparameters,
    /// The trust-region step (`samples = "rollout"`); its value network is the cost's.
    pub trpo: trpo::Hyperparameters,
    /// Adam steps of one iteration (`samples = "demo_states"`).
    pub descent_steps: Count,
    /// Adam's step size.
    pub descent_learning_rate: Positive,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            mmd: mimicry::Hyperparameters {
                samples: Samples::Rollout,
                ..mimicry::Hyperparameters::default()
            },
            trpo: trpo::Hyperparameters::for_env(env),
            descent_steps: constant(10),
            descent_learning_rate: constant(1e-3),
        }
    }
}

/// MMD imitation.
pub struct MmdIl {
    hyperparameters: Hyperparameters,
    mimicry: Mimicry,
    agent: Agent,
    pass: Pass,
    trial_pass: Pass,
}

impl MmdIl {
    /// MMD imitation of `demonstration` from `agent` on.
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
        Self {
            hyperparameters,
            mimicry,
            agent,
            pass: Pass::default(),
            trial_pass: Pass::default(),
        }
    }

    /// One trust-region step down the gradient of D.
    fn step(
        &mut self,
        batch: &Batch,
        rng: &mut Rng,
        watch: &mut Stopwatch,
    ) -> Result<Update, AlgoError> {
        let Self {
            hyperparameters,
            mimicry,
            agent,
            pass,
            trial_pass,
        } = self;
        let trpo::Hyperparameters { region, critic } = &hyperparameters.trpo;
        // Rewards do not count here: the surrogate only serves for ratios, the KL and the score.
        let no_advantages = vec![0.0; batch.len()];
        let surrogate = Surrogate::new(&agent.policy, batch, &no_advantages, pass);
        let measured = mimicry.measure(agent, &surrogate, pass, critic, rng)?;
        watch.lap("mimicry");

        let solved = region.step(
            &agent.policy,
            &batch.observations,
            pass,
            &measured.gradient,
            None,
        );
        let step = trust_region::step_of(&solved)?;
        watch.lap("conjugate gradient");

        let improved = region.improve(
            &mut agent.policy,
            step,
            None,
            |Attempt { policy, .. }| {
                let trial = surrogate.measure(policy, trial_pass);
                let mmd = mimicry.at(&measured, policy, &trial.ratios);
                judged(
                    [region.holds(&trial), (mmd <= measured.mmd, "D")],
                    (trial.kl, mmd),
                )
            },
        );
        watch.lap("line search");
        let (step_fraction, (kl, mmd_after)) = improved
            .map_or((0.0, (0.0, measured.mmd)), |found| {
                (found.fraction, found.verdict)
            });
        Ok(Update {
            kl: Some(finite("the KL", kl)?),
            mmd: Some(measured.mmd),
            mmd_after: Some(finite("D", mmd_after)?),
            lambda: solved.solution.multipliers().map(|(lambda, _)| lambda),
            step_fraction: Some(step_fraction),
            cg_iterations: Some(solved.products as u64),
            ..Update::default()
        })
    }
}

impl OnPolicy for MmdIl {
    fn agent(&self) -> &Agent {
        &self.agent
    }

    fn agent_mut(&mut self) -> &mut Agent {
        &mut self.agent
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let mut watch = Stopwatch::start();
        let update = match self.hyperparameters.mmd.samples {
            Samples::Rollout => self.step(batch, rng, &mut watch)?,
            Samples::DemoStates => {
                let Self {
                    hyperparameters: h,
                    mimicry,
                    agent,
                    ..
                } = self;
                let (steps, learning_rate) = (h.descent_steps.get(), h.descent_learning_rate.get());
                let descent = mimicry.descend(agent, f64::NEG_INFINITY, steps, learning_rate)?;
                watch.lap("descent");
                Update {
                    mmd: Some(descent.before),
                    mmd_after: Some(descent.after),
                    recovery_steps: Some(descent.steps),
                    ..Update::default()
                }
            }
        };
        Ok(Update {
            entropy: Some(self.agent.policy.entropy()),
            seconds: watch.laps(),
            ..update
        })
    }

    fn save(&self) -> Vec<u8> {
        super::to_bytes(&(&self.agent, self.mimicry.save()))
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        let (agent, mimicry): (Agent, Vec<u8>) = super::from_bytes("mmd_il", state)?;
        self.mimicry.restore(&mimicry)?;
        self.agent = agent;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{algo::one_step, rng::Stream};

    /// How near the mean action is to the demonstration's.
    fn likeness(s: f64, a: f64) -> f64 {
        -(a - s - 1.0).powi(2)
    }

    #[test]
    fn both_readings_imitate_without_any_reward() {
        for samples in [Samples::Rollout, Samples::DemoStates] {
            let mut hyperparameters = Hyperparameters::for_env(EnvId::Hopper);
            hyperparameters.mmd.samples = samples;
            hyperparameters.trpo.region.max_kl = constant(2e-2);
            hyperparameters.trpo.critic.learning_rate = constant(1e-2);
            hyperparameters.trpo.critic.minibatch = constant(128);
            hyperparameters.descent_learning_rate = constant(3e-3);
            let demonstration = one_step::demonstration(100, |s| s + 1.0);
            let mut imitation = MmdIl::new(
                hyperparameters,
                one_step::agent(0.3),
                &demonstration,
                Seed(0),
            );
            let before = one_step::score(imitation.agent(), likeness);
            let mut rng = Seed(0).stream(Stream::Update, 0);
            let updates: Vec<Update> = (0..60)
                .map(|_| {
                    let batch = one_step::batch(imitation.agent(), 512, |_, _| 0.0, &mut rng);
                    imitation.update(&batch, &mut rng).expect("finite")
                })
                .collect();
            let after = one_step::score(imitation.agent(), likeness);
            assert!(
                before < -1.0 && after > -0.1,
                "{samples:?}: from {before} to {after}"
            );
            let (first, last) = (updates[0].mmd, updates[59].mmd);
            assert!(
                last < first.map(|mmd| 0.2 * mmd),
                "{samples:?}: D from {first:?} to {last:?}"
            );
        }
    }
}
