//! PPO with the clipped surrogate (Schulman et al., 2017).
//!
//! Owns the clipped update, which every first-order method here shares. Knows nothing of where
//! rewards come from: others hand it a batch with theirs. Start at [`Ppo`].
//!
//! The paper names the clipping, the rate, the penalty and the batch of Table 1. Not from it: 10
//! epochs, advantages scaled in each minibatch, gradients clipped at 0.5, no annealing of rate or
//! clipping. Table 1's "batch size" is the minibatch here: a rollout of 64 steps would be shorter
//! than MountainCar's demonstration. Its L2 penalty is on the value network alone, and decoupled;
//! see [`critic::Fit`].

use nalgebra::DMatrix;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update, critic,
    critic::{Critic, gather},
    definition::{About, Definition, Learner, Start},
    finite, gae,
    operations::{Counter, Operations},
    revision::Part,
    stopwatch::Stopwatch,
};
use crate::{
    env::EnvId,
    nn::Pass,
    quantity::{Count, Discount, NonNegative, Positive, UnitInterval, constant},
    rng::Rng,
    solver::{adam::Adam, dot},
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "ppo",
    revision: 1,
    uses: &[&critic::PART, &gae::PART],
};

/// PPO on the task's reward as an algorithm of the catalogue.
pub static PPO: Definition<Hyperparameters> = Definition {
    about: About::new("ppo", "PPO", &PART),
    defaults: Hyperparameters::for_env,
    cloning: None,
    start,
    operations,
};

/// PPO on the dense reward: the upper end of the scale of returns.
pub static EXPERT: Definition<Hyperparameters> = Definition {
    about: About {
        dense: true,
        ..About::new("expert", "Expert", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start,
    operations,
};

fn start(hyperparameters: Hyperparameters, start: Start) -> Result<Learner, AlgoError> {
    Ok(Learner::on_policy(Ppo::new(hyperparameters, start.agent)))
}

/// The work of an update.
pub(super) fn operations(h: &Hyperparameters, counter: &Counter<'_>) -> Vec<Operations> {
    vec![
        counter.values(),
        counter.policy_epochs(h.epochs),
        counter.value_epochs(h.epochs),
    ]
}

/// PPO's hyperparameters; the defaults are the paper's Table 1 where it names one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
    /// Adam's step size, for the policy and the value network.
    pub learning_rate: Positive,
    /// L2 penalty on the value network's parameters.
    pub l2_penalty: NonNegative,
    /// Half-width of the interval in which the probability ratio counts.
    pub clip: Positive,
    /// Passes over each batch.
    pub epochs: Count,
    /// Samples in a minibatch.
    pub minibatch: Count,
    /// Weight of the entropy bonus.
    pub entropy_weight: NonNegative,
    /// The norm of the policy's gradient is clipped to this.
    pub max_gradient_norm: Positive,
    /// Whether advantages are centred and scaled to unit variance, minibatch by minibatch.
    pub normalize_advantages: bool,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        Self {
            discount: constant(0.99),
            gae_lambda: constant(0.95),
            learning_rate: constant(1e-4),
            l2_penalty: constant(1e-3),
            clip: constant(0.2),
            epochs: constant(10),
            minibatch: constant(if env == EnvId::MountainCar { 64 } else { 1024 }),
            entropy_weight: constant(0.0),
            max_gradient_norm: constant(0.5),
            normalize_advantages: true,
        }
    }

    fn critic_fit(&self) -> critic::Fit {
        critic::Fit {
            epochs: self.epochs.size(),
            minibatch: self.minibatch.size(),
            learning_rate: self.learning_rate.get(),
            l2_penalty: self.l2_penalty.get(),
        }
    }
}

/// PPO.
pub struct Ppo {
    hyperparameters: Hyperparameters,
    state: State,
    buffers: Buffers,
}

#[derive(Serialize, Deserialize)]
struct State {
    agent: Agent,
    optimizer: Adam,
    critic: Critic,
}

#[derive(Default)]
struct Buffers {
    pass: Pass,
    observations: DMatrix<f32>,
    actions: DMatrix<f32>,
    log_densities: Vec<f64>,
    weights: Vec<f64>,
    gradient: Vec<f32>,
}

impl Ppo {
    /// PPO from `agent` on, with fresh optimisers.
    pub fn new(hyperparameters: Hyperparameters, agent: Agent) -> Self {
        let optimizer = Adam::new(agent.policy.dim());
        let critic = Critic::new(&agent.value);
        Self {
            hyperparameters,
            state: State {
                agent,
                optimizer,
                critic,
            },
            buffers: Buffers::default(),
        }
    }
}

/// Takes one step of Adam up the clipped surrogate of the samples `chosen`; returns how many of
/// their ratios were clipped.
#[expect(
    clippy::too_many_arguments,
    reason = "the parts of a borrowed Ppo, and one minibatch"
)]
fn step(
    hyperparameters: &Hyperparameters,
    agent: &mut Agent,
    optimizer: &mut Adam,
    batch: &Batch,
    advantages: &[f64],
    old_densities: &[f64],
    chosen: &[usize],
    buffers: &mut Buffers,
) -> usize {
    let Buffers {
        pass,
        observations,
        actions,
        log_densities,
        weights,
        gradient,
    } = buffers;
    let policy = &mut agent.policy;
    gather(&batch.observations, chosen, observations);
    gather(&batch.actions, chosen, actions);
    log_densities.resize(chosen.len(), 0.0);
    policy.forward(observations, pass);
    policy.log_densities(pass.output(), actions, log_densities);

    let (centre, scale) = if hyperparameters.normalize_advantages {
        moments(advantages, chosen)
    } else {
        (0.0, 1.0)
    };
    let clip = hyperparameters.clip.get();
    let mut clipped = 0;
    weights.clear();
    weights.extend(
        chosen
            .iter()
            .zip(log_densities.iter())
            .map(|(&i, &density)| {
                let advantage = (advantages[i] - centre) / scale;
                let ratio = (density - old_densities[i]).exp();
                // Outside the interval, and on the side that the advantage pushes to, the surrogate
                // is flat.
                let flat = if advantage > 0.0 {
                    ratio > 1.0 + clip
                } else {
                    ratio < 1.0 - clip
                };
                clipped += usize::from((ratio - 1.0).abs() > clip);
                if flat {
                    0.0
                } else {
                    ratio * advantage / chosen.len() as f64
                }
            }),
    );

    gradient.resize(policy.dim(), 0.0);
    policy.score(observations, pass, actions, weights, gradient);
    // The entropy of a diagonal Gaussian grows by one nat with each log_std.
    let log_std = gradient.len() - policy.log_std().len();
    gradient[log_std..]
        .iter_mut()
        .for_each(|g| *g += hyperparameters.entropy_weight.get() as f32);
    // Adam goes down.
    let norm = dot(gradient, gradient).sqrt();
    let factor = -(hyperparameters.max_gradient_norm.get() / norm.max(1e-12)).min(1.0) as f32;
    gradient.iter_mut().for_each(|g| *g *= factor);

    optimizer.step_parts(
        policy.parts_mut(),
        gradient,
        hyperparameters.learning_rate.get(),
    );
    clipped
}

/// Mean and standard deviation of the chosen advantages; the deviation is kept off zero.
fn moments(advantages: &[f64], chosen: &[usize]) -> (f64, f64) {
    let n = chosen.len() as f64;
    let mean = chosen.iter().map(|&i| advantages[i]).sum::<f64>() / n;
    let variance = chosen
        .iter()
        .map(|&i| (advantages[i] - mean).powi(2))
        .sum::<f64>()
        / n;
    (mean, variance.sqrt() + 1e-8)
}

impl OnPolicy for Ppo {
    fn agent(&self) -> &Agent {
        &self.state.agent
    }

    fn agent_mut(&mut self) -> &mut Agent {
        &mut self.state.agent
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let Self {
            hyperparameters,
            state:
                State {
                    agent,
                    optimizer,
                    critic,
                },
            buffers,
        } = self;
        let mut watch = Stopwatch::start();
        let (discount, lambda) = (
            hyperparameters.discount.get(),
            hyperparameters.gae_lambda.get(),
        );
        let estimate = gae::estimate(
            batch,
            &batch.rewards,
            &agent.value,
            discount,
            lambda,
            &mut buffers.pass,
        );
        watch.lap("advantages");

        let mut old_densities = vec![0.0; batch.len()];
        agent
            .policy
            .log_densities(batch.means.as_view(), &batch.actions, &mut old_densities);
        let old_log_std = agent.policy.log_std().to_vec();

        let mut order: Vec<usize> = (0..batch.len()).collect();
        let mut clipped = 0;
        let mut steps = 0;
        for _ in 0..hyperparameters.epochs.get() {
            order.shuffle(rng);
            // Only the last epoch's share is recorded.
            clipped = 0;
            for chosen in order.chunks(hyperparameters.minibatch.size()) {
                clipped += step(
                    hyperparameters,
                    agent,
                    optimizer,
                    batch,
                    &estimate.advantages,
                    &old_densities,
                    chosen,
                    buffers,
                );
                steps += 1;
            }
        }
        // The product is not finite if any parameter is not.
        finite(
            "the policy's parameters",
            dot(&buffers.gradient, &agent.policy.parameters()),
        )?;
        watch.lap("policy");

        let value_loss = critic.fit(
            &mut agent.value,
            &batch.observations,
            &estimate.returns,
            hyperparameters.critic_fit(),
            rng,
        )?;
        watch.lap("value");

        agent.policy.forward(&batch.observations, &mut buffers.pass);
        let kl = agent
            .policy
            .kl_from(batch.means.as_view(), &old_log_std, buffers.pass.output());
        watch.lap("diagnostics");
        tracing::debug!(steps, kl, value_loss, "ppo");
        Ok(Update {
            kl: Some(finite("the KL", kl)?),
            entropy: Some(agent.policy.entropy()),
            value_loss: Some(value_loss),
            clip_fraction: Some(clipped as f64 / batch.len() as f64),
            seconds: watch.laps(),
            ..Update::default()
        })
    }

    fn save(&self) -> Vec<u8> {
        super::to_bytes(&self.state)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.state = super::from_bytes("ppo", state)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
