//! Advantage-weighted regression (Peng et al., 2019), as a crate of one's own would add it.

use mcpo_run::{
    algo::{
        self, About, Agent, AlgoError, Batch, Definition, Learner, OnPolicy, Update,
        critic::{self, Critic},
        gae,
        revision::Part,
    },
    nn::Pass,
    quantity::{Count, Discount, Positive, UnitInterval, constant},
    rng::Rng,
    solver::adam::Adam,
};
use serde::{Deserialize, Serialize};

/// AWR's hyperparameters.
#[derive(Debug, Clone, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// beta, by which advantages are divided before they become weights.
    pub temperature: Positive,
    /// Adam's step size, for the policy and the value network.
    pub learning_rate: Positive,
    /// Passes of both networks over each batch.
    pub epochs: Count,
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
}

/// Raise its revision when what this file computes changes.
static PART: Part = Part {
    name: "awr",
    revision: 1,
    uses: &[&critic::PART, &gae::PART],
};

/// AWR as an algorithm of the catalogue.
pub static AWR: Definition<Hyperparameters> = Definition {
    about: About::new("awr", "AWR", &PART),
    defaults: |_| Hyperparameters {
        temperature: constant(1.0),
        learning_rate: constant(1e-3),
        epochs: constant(10),
        discount: constant(0.99),
        gae_lambda: constant(0.95),
    },
    cloning: None,
    start: |hyperparameters, start| {
        let optimizer = Adam::new(start.agent.policy.dim());
        let critic = Critic::new(&start.agent.value);
        Ok(Learner::on_policy(Awr {
            hyperparameters,
            state: State {
                agent: start.agent,
                optimizer,
                critic,
            },
        }))
    },
    operations: |h, counter| {
        vec![
            counter.values(),
            counter.policy_epochs(h.epochs),
            counter.value_epochs(h.epochs),
        ]
    },
};

struct Awr {
    hyperparameters: Hyperparameters,
    state: State,
}

#[derive(Serialize, Deserialize)]
struct State {
    agent: Agent,
    optimizer: Adam,
    critic: Critic,
}

impl OnPolicy for Awr {
    fn agent(&self) -> &Agent {
        &self.state.agent
    }

    fn agent_mut(&mut self) -> &mut Agent {
        &mut self.state.agent
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let Self {
            hyperparameters: h,
            state:
                State {
                    agent,
                    optimizer,
                    critic,
                },
        } = self;
        let mut pass = Pass::default();
        let (discount, lambda) = (h.discount.get(), h.gae_lambda.get());
        let estimate = gae::estimate(
            batch,
            &batch.rewards,
            &agent.value,
            discount,
            lambda,
            &mut pass,
        );

        // The gradient of the weighted log-likelihood, upwards: hence the minus.
        let weight = |advantage: &f64| {
            -(advantage / h.temperature.get()).min(3.0).exp() / batch.len() as f64
        };
        let weights: Vec<f64> = estimate.advantages.iter().map(weight).collect();
        let mut gradient = vec![0.0; agent.policy.dim()];
        for _ in 0..h.epochs.get() {
            agent.policy.forward(&batch.observations, &mut pass);
            agent.policy.score(
                &batch.observations,
                &mut pass,
                &batch.actions,
                &weights,
                &mut gradient,
            );
            optimizer.step_parts(agent.policy.parts_mut(), &gradient, h.learning_rate.get());
        }
        let fit = critic::Fit {
            epochs: h.epochs.size(),
            minibatch: 128,
            learning_rate: h.learning_rate.get(),
            l2_penalty: 0.0,
        };
        let value_loss = critic.fit(
            &mut agent.value,
            &batch.observations,
            &estimate.returns,
            fit,
            rng,
        )?;
        Ok(Update {
            entropy: Some(agent.policy.entropy()),
            value_loss: Some(value_loss),
            ..Update::default()
        })
    }

    fn save(&self) -> Vec<u8> {
        algo::to_bytes(&self.state)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        self.state = algo::from_bytes("awr", state)?;
        Ok(())
    }
}
