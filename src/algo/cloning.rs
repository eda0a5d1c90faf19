//! Behaviour cloning: supervised learning of the demonstration's actions (Schaal, 1997).
//!
//! Owns the regression that pre-training and BC alone share. Knows nothing of what follows it.
//! Start at [`clone_behaviour`].

use nalgebra::DMatrix;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Update,
    critic::gather,
    definition::{About, Definition, Learner},
    finite,
    revision::Part,
};
use crate::{
    demo::Demonstration,
    env::EnvId,
    nn::{GaussianPolicy, Normalizer, Pass},
    quantity::{Count, Positive, constant},
    rng::Rng,
    solver::adam::Adam,
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "cloning",
    revision: 1,
    uses: &[],
};

/// Behaviour cloning alone as an algorithm of the catalogue.
pub static BC: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        trains: false,
        passes: 0.0,
        ..About::new("bc", "BC", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: Some(|hyperparameters| hyperparameters),
    start: |hyperparameters, start| {
        let (agent, demonstration) = start.with_demonstration()?;
        let cloning_loss = Some(loss_of(
            hyperparameters.loss,
            &agent,
            &demonstration,
            &mut Pass::default(),
        ));
        Ok(Learner::Offline(
            agent,
            Box::new(Update {
                cloning_loss,
                ..Update::default()
            }),
        ))
    },
    operations: |_, _| Vec::new(),
};

/// How the demonstration's actions are learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// Passes over the demonstration.
    pub epochs: Count,
    /// Adam's step size.
    pub learning_rate: Positive,
    /// Samples in a minibatch. The paper's 1024 would be one step an epoch on a demonstration of
    /// 1,000.
    pub minibatch: Count,
    /// The loss that is minimised.
    pub loss: Loss,
}

/// The loss of behaviour cloning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// The mean over samples of the squared distance between the mean action and the
    /// demonstration's.
    Mse,
    /// The mean negative log-likelihood of the demonstration's actions; learns the standard
    /// deviation too.
    Nll,
}

impl Hyperparameters {
    /// The defaults, the same for every environment.
    pub fn for_env(_: EnvId) -> Self {
        Self {
            epochs: constant(50),
            learning_rate: constant(1e-4),
            minibatch: constant(64),
            loss: Loss::Mse,
        }
    }
}

/// Trains `agent`'s policy on `demonstration`, in units of the demonstration's own mean and
/// deviation, which its normaliser then keeps.
/// The value network is left as it is: a demonstration holds no sparse returns.
/// Calls `epoch` with the loss over the whole demonstration after each epoch.
///
/// # Errors
///
/// The loss is no longer finite.
pub fn clone_behaviour(
    hyperparameters: &Hyperparameters,
    demonstration: &Demonstration,
    agent: &mut Agent,
    rng: &mut Rng,
    mut epoch: impl FnMut(u64, f64, &Agent),
) -> Result<(), AlgoError> {
    // The clone is a function of states in these units, so they must not move afterwards.
    agent.normalizer = Normalizer::held(&demonstration.observations, agent.normalizer.clip());
    let observations = agent
        .normalizer
        .normalize_columns(&demonstration.observations);
    let actions = demonstration.actions.map(|action| action as f32);

    let mut optimizer = Adam::new(agent.policy.dim());
    let mut gradient = vec![0.0; agent.policy.dim()];
    let mut pass = Pass::default();
    let (mut some_observations, mut some_actions) = (DMatrix::zeros(0, 0), DMatrix::zeros(0, 0));
    let mut order: Vec<usize> = (0..actions.ncols()).collect();
    for number in 1..=hyperparameters.epochs.get() {
        order.shuffle(rng);
        for chosen in order.chunks(hyperparameters.minibatch.size()) {
            gather(&observations, chosen, &mut some_observations);
            gather(&actions, chosen, &mut some_actions);
            loss(
                hyperparameters.loss,
                &agent.policy,
                &some_observations,
                &some_actions,
                &mut pass,
                Some(&mut gradient),
            );
            optimizer.step_parts(
                agent.policy.parts_mut(),
                &gradient,
                hyperparameters.learning_rate.get(),
            );
        }
        let value = loss(
            hyperparameters.loss,
            &agent.policy,
            &observations,
            &actions,
            &mut pass,
            None,
        );
        epoch(
            number,
            finite("the loss of behaviour cloning", value)?,
            agent,
        );
    }
    Ok(())
}

/// The loss of `agent` on all of `demonstration`.
pub fn loss_of(
    loss_kind: Loss,
    agent: &Agent,
    demonstration: &Demonstration,
    pass: &mut Pass,
) -> f64 {
    let observations = agent
        .normalizer
        .normalize_columns(&demonstration.observations);
    let actions = demonstration.actions.map(|action| action as f32);
    loss(
        loss_kind,
        &agent.policy,
        &observations,
        &actions,
        pass,
        None,
    )
}

/// The loss of `policy` on `actions` (`[action_dim x n]`) at normalised `observations`, and its
/// gradient where asked for.
fn loss(
    loss: Loss,
    policy: &GaussianPolicy,
    observations: &DMatrix<f32>,
    actions: &DMatrix<f32>,
    pass: &mut Pass,
    gradient: Option<&mut [f32]>,
) -> f64 {
    let n = actions.ncols() as f64;
    policy.forward(observations, pass);
    match loss {
        Loss::Mse => {
            let errors = pass.output() - actions;
            if let Some(gradient) = gradient {
                policy.mean_gradient(observations, pass, &(&errors * (2.0 / n as f32)), gradient);
            }
            errors
                .iter()
                .map(|&error| f64::from(error).powi(2))
                .sum::<f64>()
                / n
        }
        Loss::Nll => {
            let mut densities = vec![0.0; actions.ncols()];
            policy.log_densities(pass.output(), actions, &mut densities);
            if let Some(gradient) = gradient {
                policy.score(
                    observations,
                    pass,
                    actions,
                    &vec![-1.0 / n; actions.ncols()],
                    gradient,
                );
            }
            -densities.iter().sum::<f64>() / n
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::{one_step, reference},
        rng::{Seed, Stream},
    };

    fn cloned(loss: Loss) -> (Vec<f64>, Agent) {
        let hyperparameters = Hyperparameters {
            epochs: constant(100),
            learning_rate: constant(3e-3),
            loss,
            ..Hyperparameters::for_env(EnvId::Hopper)
        };
        let mut agent = one_step::agent(0.5);
        let mut losses = Vec::new();
        let demonstration = one_step::demonstration(200, |s| 0.5 * s - 1.0);
        let mut rng = Seed(0).stream(Stream::Pretraining, 0);
        clone_behaviour(
            &hyperparameters,
            &demonstration,
            &mut agent,
            &mut rng,
            |_, loss, _| losses.push(loss),
        )
        .expect("finite");
        (losses, agent)
    }

    #[test]
    fn both_losses_learn_the_demonstrations_actions() {
        for loss in [Loss::Mse, Loss::Nll] {
            let (losses, agent) = cloned(loss);
            assert_eq!(losses.len(), 100);
            let likeness = |agent| one_step::score(agent, |s, a| -(a - 0.5 * s + 1.0).powi(2));
            let (before, after) = (likeness(&one_step::agent(0.5)), likeness(&agent));
            assert!(
                before < -1.0 && after > -0.003,
                "{loss:?}: from {before} to {after}"
            );
        }
    }

    #[test]
    fn only_the_likelihood_learns_the_standard_deviation() {
        assert_eq!(
            cloned(Loss::Mse).1.policy.log_std(),
            one_step::agent(0.5).policy.log_std()
        );
        assert!(cloned(Loss::Nll).1.policy.log_std()[0] < -1.0);
    }

    #[test]
    fn losses_gradients_and_a_step_are_numpys() {
        let reference = reference::reference();
        let demonstration = Demonstration {
            observations: reference::columns(&reference.observations),
            actions: reference::columns(&reference.actions),
            terminated: vec![false; 12],
            truncated: vec![false; 12],
            ..one_step::demonstration(12, |s| s)
        };
        let actions = demonstration.actions.map(|action| action as f32);
        for (kind, expected) in [
            (Loss::Mse, &reference.cloning.mse),
            (Loss::Nll, &reference.cloning.nll),
        ] {
            let mut agent = reference.agent(&reference.policy);
            let normalizer = Normalizer::from_columns(&demonstration.observations, 10.0);
            let inputs = normalizer.normalize_columns(&demonstration.observations);
            let mut gradient = vec![f32::NAN; agent.policy.dim()];
            let got = loss(
                kind,
                &agent.policy,
                &inputs,
                &actions,
                &mut Pass::default(),
                Some(&mut gradient),
            );
            reference::assert_near(&[got], &[expected.loss], 10.0 * reference::ROUNDING);
            reference::assert_near(&gradient, &expected.gradient, 10.0 * reference::ROUNDING);

            let hyperparameters = Hyperparameters {
                epochs: constant(1),
                learning_rate: constant(1e-2),
                minibatch: constant(12),
                loss: kind,
            };
            let mut rng = Seed(0).stream(Stream::Pretraining, 0);
            let mut after = f64::NAN;
            clone_behaviour(
                &hyperparameters,
                &demonstration,
                &mut agent,
                &mut rng,
                |_, loss, _| after = loss,
            )
            .expect("finite");
            reference::assert_near(&[after], &[expected.loss_after], 10.0 * reference::ROUNDING);
            reference::assert_near(
                &agent.policy.parameters(),
                &expected.after,
                reference::ROUNDING,
            );
        }
    }

    #[test]
    fn an_action_that_is_not_a_number_is_an_error() {
        let hyperparameters = Hyperparameters::for_env(EnvId::Hopper);
        let demonstration = one_step::demonstration(10, |_| f64::NAN);
        let mut rng = Seed(0).stream(Stream::Pretraining, 0);
        let result = clone_behaviour(
            &hyperparameters,
            &demonstration,
            &mut one_step::agent(0.5),
            &mut rng,
            |_, _, _| {},
        );
        assert!(matches!(result, Err(AlgoError::Diverged { .. })));
    }
}
