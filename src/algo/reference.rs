//! Numpy's results for the same inputs, for tests: tests/reference/algorithms.json, which
//! algorithms.py beside it wrote.

use nalgebra::DMatrix;
use serde::Deserialize;

use super::{Agent, Batch, Segment, SegmentEnd};
use crate::{
    nn::{GaussianPolicy, Mlp, Normalizer},
    rng::{Seed, Stream},
};

/// The hidden layers of every network.
pub const HIDDEN: [usize; 2] = [5, 4];

/// All of numpy's results; one row a sample.
#[derive(Deserialize)]
pub struct Reference {
    pub policy: Vec<f32>,
    pub other_policy: Vec<f32>,
    pub observations: Vec<Vec<f64>>,
    pub actions: Vec<Vec<f64>>,
    pub gaussian: Gaussian,
    pub cloning: Cloning,
    pub ppo: Ppo,
    pub gae: Gae,
    pub discriminator: Discriminator,
}

#[derive(Deserialize)]
pub struct Gaussian {
    pub log_densities: Vec<f64>,
    pub kl: f64,
    pub entropy: f64,
}

#[derive(Deserialize)]
pub struct Cloning {
    pub mse: Cloned,
    pub nll: Cloned,
}

/// One step of Adam, rate 1e-2, on the whole demonstration.
#[derive(Deserialize)]
pub struct Cloned {
    pub loss: f64,
    pub gradient: Vec<f64>,
    pub after: Vec<f64>,
    pub loss_after: f64,
}

#[derive(Deserialize)]
pub struct Ppo {
    pub advantages: Vec<f64>,
    pub gradient: Vec<f64>,
    pub outside: usize,
    pub after: Vec<f64>,
}

/// With discount 0.9 and lambda 0.7.
#[derive(Deserialize)]
pub struct Gae {
    pub value: Vec<f32>,
    pub rewards: Vec<f64>,
    pub last: Vec<Vec<f32>>,
    pub advantages: Vec<f64>,
    pub returns: Vec<f64>,
}

/// The rewards are the task's and 0.1 times the discriminator's after its step.
#[derive(Deserialize)]
pub struct Discriminator {
    pub network: Vec<f32>,
    pub demonstration_observations: Vec<Vec<f64>>,
    pub demonstration_actions: Vec<Vec<f64>>,
    pub loss: f64,
    pub after: Vec<f64>,
    pub rewards: Vec<f64>,
}

/// Reads numpy's results.
pub fn reference() -> Reference {
    serde_json::from_str(include_str!("../../tests/reference/algorithms.json"))
        .expect("the reference")
}

impl Reference {
    /// An agent with the policy `parameters` (`[dim]`), the value network, and a normaliser that
    /// saw nothing.
    pub fn agent(&self, parameters: &[f32]) -> Agent {
        let mut rng = Seed(0).stream(Stream::Network, 0);
        let mut policy = GaussianPolicy::new(3, &HIDDEN, 2, 1.0, &mut rng);
        policy.set_parameters(parameters);
        let mut value = Mlp::new(&[&[3], &HIDDEN[..], &[1]].concat(), 1.0, &mut rng);
        value.parameters_mut().copy_from_slice(&self.gae.value);
        Agent {
            policy,
            value,
            normalizer: Normalizer::new(3, 10.0),
        }
    }

    /// An episode that terminated, one that the time limit cut, and one that the rollout's end cut.
    pub fn batch(&self) -> Batch {
        let observations = columns(&self.observations).map(|x| x as f32);
        let mut pass = crate::nn::Pass::default();
        self.agent(&self.policy)
            .policy
            .forward(&observations, &mut pass);
        let [cut, end] = [0, 1].map(|i| SegmentEnd::Bootstrapped {
            last_observation: self.gae.last[i].clone(),
        });
        Batch {
            raw_observations: columns(&self.observations),
            observations,
            means: pass.output().into_owned(),
            actions: columns(&self.actions).map(|x| x as f32),
            rewards: self.gae.rewards.clone(),
            segments: vec![
                Segment {
                    range: 0..4,
                    end: SegmentEnd::Terminated,
                },
                Segment {
                    range: 4..9,
                    end: cut,
                },
                Segment { range: 9..12, end },
            ],
        }
    }
}

/// Turns rows, one a sample, into columns, one a sample.
pub fn columns(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_vec(rows[0].len(), rows.len(), rows.concat())
}

/// Asserts that `found` is `expected` within `tolerance`, number by number.
#[track_caller]
pub fn assert_near<T: Copy + Into<f64>>(found: &[T], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "lengths");
    for (i, (&found, &expected)) in found.iter().zip(expected).enumerate() {
        let found = found.into();
        assert!(
            (found - expected).abs() <= tolerance,
            "number {i}: {found}, numpy has {expected}"
        );
    }
}

/// The rounding error of f32 networks of this size, in losses, gradients and advantages of order
/// one.
pub const ROUNDING: f64 = 2e-6;

#[test]
fn the_gaussian_is_numpys() {
    let reference = reference();
    let (agent, other) = (
        reference.agent(&reference.policy),
        reference.agent(&reference.other_policy),
    );
    let batch = reference.batch();
    let (mut pass, mut other_pass) = (crate::nn::Pass::default(), crate::nn::Pass::default());
    agent.policy.forward(&batch.observations, &mut pass);
    other.policy.forward(&batch.observations, &mut other_pass);
    let mut densities = vec![f64::NAN; batch.len()];
    agent
        .policy
        .log_densities(pass.output(), &batch.actions, &mut densities);
    assert_near(
        &densities,
        &reference.gaussian.log_densities,
        10.0 * ROUNDING,
    );
    let kl = other
        .policy
        .kl_from(pass.output(), agent.policy.log_std(), other_pass.output());
    assert_near(
        &[kl, agent.policy.entropy()],
        &[reference.gaussian.kl, reference.gaussian.entropy],
        ROUNDING,
    );
}
