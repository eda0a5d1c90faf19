//! The least work that an iteration needs: floating-point operations, and values of tanh.
//!
//! Owns the counts of networks' passes, from which each algorithm composes its own. They count
//! matrix products, 2 for each multiplication with its addition, and tanh apart, which has no
//! fixed number of operations. Tanh's slopes, exp, densities, Adam, shuffles and copies count as
//! nothing, and so does what a run computes for its record alone (the KL after an update, the
//! discriminator's loss). Knows nothing of how long either takes. Start at [`of_iteration`].
//!
//! A network of weights P, of which P_1 are the first layer's and P_L the last's, with A outputs
//! and hidden layers of h_1 to h_k, takes for each sample
//!
//! | | operations | since |
//! |---|---|---|
//! | forward pass | 2 P, and h_1 + ... + h_k values of tanh | |
//! | VJP | 4 P - 2 P_1 | weights' gradient, and the way back but for the last step |
//! | sensitivities | 2 A sum h_l h_l+1 | the outputs' derivatives by the lower hidden layers' sums, once for all products |
//! | Fisher product | 4 P + 4 P_L + 4 A (h_1 + ... + h_k-1) | there and back through the sensitivities |
//!
//! and n points of d numbers against m others take 2 d n m for their kernel values. At the
//! demonstration's states, a pair of samples, the two pairs of a sample and a point, and the pair
//! of points share the product of states; and the gradient, by the actions alone, takes 2 A m m
//! for each of the two sides. The activations of the rollout's pass are taken
//! to be kept: the gradient of the surrogate and the old densities need no pass of their own. How
//! often conjugate gradient, the line search and the recovery went round is read from the
//! [`Update`]; a way back that only a correction asked for is taken to spend all products that
//! conjugate gradient may. What is not recorded there counts as nothing: conjugate gradient of a
//! recovery from a rollout, and corrections that the outcome does not name. So work that an update
//! leaves out lowers the floor with it, and work done twice does not raise it.

use std::ops::{Add, Mul};

use serde::Serialize;

use super::{Algorithm, Update};
use crate::quantity::Count;

/// The sizes that decide how much an iteration's passes cost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shapes {
    /// Numbers in an observation.
    pub observation: usize,
    /// Numbers in an action.
    pub action: usize,
    /// Widths of the hidden layers.
    pub hidden: Vec<usize>,
    /// Environments stepped together.
    pub environments: usize,
    /// Samples of one iteration.
    pub rollout: usize,
    /// Points of the demonstration; 0 for algorithms that use none.
    pub demonstration: usize,
}

/// The name of a part of an iteration, and its work.
pub type Operations = (&'static str, Work);

/// What has to be computed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Floating-point operations of matrix products.
    pub products: f64,
    /// Values of tanh.
    pub tanhs: f64,
}

impl Work {
    /// Matrix products of so many `operations`.
    pub fn products(operations: f64) -> Self {
        Self {
            products: operations,
            tanhs: 0.0,
        }
    }
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            products: self.products + other.products,
            tanhs: self.tanhs + other.tanhs,
        }
    }
}

/// So many times the same.
impl Mul<Work> for f64 {
    type Output = Work;

    fn mul(self, work: Work) -> Work {
        Work {
            products: self * work.products,
            tanhs: self * work.tanhs,
        }
    }
}

/// The work of an iteration of `algorithm` that did `update`, part by part. `cuts` is the
/// number of the batch's segments that end with a value to be looked up.
pub fn of_iteration(
    algorithm: &Algorithm,
    shapes: &Shapes,
    cuts: usize,
    update: &Update,
) -> Vec<Operations> {
    let counter = Counter::new(shapes, cuts, update);
    let mut parts = vec![("policy inference", counter.n * counter.policy.forward())];
    parts.extend(algorithm.operations(&counter));
    parts
}

/// The work that a sample's pass through one network takes.
#[derive(Debug, Clone, Copy)]
pub struct Network {
    /// The number of weights, P.
    weights: f64,
    /// The number of the first layer's weights, P_1.
    first: f64,
    /// The number of hidden units.
    hidden: f64,
    /// A Fisher product.
    pub fisher_product: Work,
    /// The sensitivities, which all Fisher products of an iteration share.
    pub sensitivities: Work,
}

impl Network {
    fn new(input: usize, hidden: &[usize], output: usize) -> Self {
        let widths = [&[input], hidden, &[output]].concat();
        let weights = |layer: &[usize]| (layer[0] * layer[1]) as f64;
        let (all, last) = (
            widths.windows(2).map(weights).sum::<f64>(),
            weights(&widths[widths.len() - 2..]),
        );
        let lower: usize = hidden.iter().rev().skip(1).sum();
        Self {
            weights: all,
            first: weights(&widths[..2]),
            hidden: hidden.iter().sum::<usize>() as f64,
            fisher_product: Work::products(4.0 * (all + last + (output * lower) as f64)),
            sensitivities: Work::products(
                2.0 * output as f64 * hidden.windows(2).map(weights).sum::<f64>(),
            ),
        }
    }

    /// A forward pass.
    pub fn forward(self) -> Work {
        Work {
            products: 2.0 * self.weights,
            tanhs: self.hidden,
        }
    }

    /// A vector-Jacobian product, after a forward pass.
    pub fn vjp(self) -> Work {
        Work::products(4.0 * self.weights - 2.0 * self.first)
    }

    /// A forward pass and a vector-Jacobian product.
    pub fn forward_and_vjp(self) -> Work {
        self.forward() + self.vjp()
    }
}

/// The sizes of one iteration, from which its work is counted.
pub struct Counter<'a> {
    /// The policy's network.
    pub policy: Network,
    /// The value network.
    pub value: Network,
    /// The discriminator's network, whose inputs are pairs of observation and action.
    pub discriminator: Network,
    /// The number of samples in the batch.
    pub n: f64,
    /// The number of points in the demonstration.
    pub m: f64,
    /// The number of coordinates of an observation.
    pub observation: f64,
    /// The number of coordinates of an action.
    pub action: f64,
    /// The number of the batch's segments that end with a value to be looked up.
    pub cuts: f64,
    /// The update's record, which tells how often its loops went round.
    pub update: &'a Update,
}

impl<'a> Counter<'a> {
    fn new(shapes: &Shapes, cuts: usize, update: &'a Update) -> Self {
        let Shapes {
            observation,
            action,
            hidden,
            rollout,
            demonstration,
            ..
        } = shapes;
        Self {
            policy: Network::new(*observation, hidden, *action),
            value: Network::new(*observation, hidden, 1),
            discriminator: Network::new(observation + action, hidden, 1),
            n: *rollout as f64,
            m: *demonstration as f64,
            observation: *observation as f64,
            action: *action as f64,
            cuts: cuts as f64,
            update,
        }
    }

    /// The number of coordinates of a point: observation and action.
    pub fn point(&self) -> f64 {
        self.observation + self.action
    }

    /// The values for the baseline of the advantages.
    pub fn values(&self) -> Operations {
        ("values", (self.n + self.cuts) * self.value.forward())
    }

    /// The gradient of the surrogate; the rollout's activations are reused.
    pub fn surrogate_gradient(&self) -> Operations {
        ("surrogate gradient", self.n * self.policy.vjp())
    }

    /// `epochs` forward and backward passes of the policy over the batch.
    pub fn policy_epochs(&self, epochs: Count) -> Operations {
        (
            "policy epochs",
            epochs.get() as f64 * self.n * self.policy.forward_and_vjp(),
        )
    }

    /// `epochs` forward and backward passes of the value network over the batch.
    pub fn value_epochs(&self, epochs: Count) -> Operations {
        (
            "value epochs",
            epochs.get() as f64 * self.n * self.value.forward_and_vjp(),
        )
    }

    /// The trials of a line search of at most `limit`, from the fraction that it took: it halves
    /// the step from 1 on, and the fraction 0 means that all were rejected.
    pub fn trials(&self, limit: Count) -> f64 {
        match self.update.step_fraction {
            Some(fraction) if fraction > 0.0 => 1.0 - fraction.log2(),
            Some(_) => limit.get() as f64,
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::{
            mcpo::{self, MCPO},
            ppo::{self, PPO},
            trpo::{self, TRPO},
        },
        env::EnvId,
        quantity::constant,
    };

    /// A policy of 3 x 5 x 4 x 2: P = 15 + 20 + 8 = 43, P_1 = 15. A value network of 3 x 5 x 4 x 1:
    /// P = 39. Forward passes of 86 and 78 operations, VJPs of 142 and 126, Fisher products of 244
    /// after 80 for the sensitivities. A pass takes 9 values of tanh.
    fn shapes() -> Shapes {
        Shapes {
            observation: 3,
            action: 2,
            hidden: vec![5, 4],
            environments: 2,
            rollout: 10,
            demonstration: 6,
        }
    }

    /// So many operations of products, and `passes` samples' values of tanh.
    fn work(products: f64, passes: f64) -> Work {
        Work {
            products,
            tanhs: 9.0 * passes,
        }
    }

    fn counted(algorithm: &Algorithm, update: &Update) -> Vec<Operations> {
        of_iteration(algorithm, &shapes(), 3, update)
    }

    #[test]
    fn ppo_is_two_networks_epochs() {
        let hyperparameters = ppo::Hyperparameters {
            epochs: constant(7),
            ..ppo::Hyperparameters::for_env(EnvId::Ant)
        };
        let parts = counted(&PPO.with(hyperparameters), &Update::default());
        let expected = [
            ("policy inference", work(860.0, 10.0)),
            ("values", work(13.0 * 78.0, 13.0)),
            ("policy epochs", work(70.0 * (86.0 + 142.0), 70.0)),
            ("value epochs", work(70.0 * (78.0 + 126.0), 70.0)),
        ];
        assert_eq!(parts, expected);
    }

    #[test]
    fn trust_regions_are_what_the_update_did() {
        let mut trpo = trpo::Hyperparameters::for_env(EnvId::Ant);
        trpo.critic.value_epochs = constant(2);
        let update = Update {
            cg_iterations: Some(9),
            step_fraction: Some(0.25),
            ..Update::default()
        };
        let parts = counted(&TRPO.with(trpo.clone()), &update);
        let expected = [
            ("policy inference", work(860.0, 10.0)),
            ("values", work(13.0 * 78.0, 13.0)),
            ("surrogate gradient", work(1420.0, 0.0)),
            ("Fisher products", work(9.0 * 2440.0 + 800.0, 0.0)),
            ("line search", work(3.0 * 860.0, 30.0)),
            ("value epochs", work(20.0 * 204.0, 20.0)),
        ];
        assert_eq!(parts, expected);
        let rejected = Update {
            step_fraction: Some(0.0),
            ..update
        };
        assert_eq!(
            counted(&TRPO.with(trpo.clone()), &rejected)[4],
            ("line search", work(10.0 * 860.0, 100.0))
        );
        // Every fourth of ten samples makes three.
        trpo.region.fisher_samples = constant(3);
        let products = counted(&TRPO.with(trpo), &rejected)[3];
        let expected = work(3.0 * (9.0 * 244.0 + 80.0), 0.0);
        assert_eq!(products, ("Fisher products", expected));
    }

    /// Points of 3 + 2 numbers, 6 of each side: 36 pairs with the demonstration and half as many on
    /// their own side. Kernel values take 6 operations for the states of half of the 36, and 4 for
    /// the actions of all 54; two sides' gradients 4 for each of 36.
    #[test]
    fn mimicry_is_measured_once_and_at_each_trial_and_correction_or_descended() {
        let mut h = mcpo::Hyperparameters::for_env(EnvId::Ant);
        h.critic.value_epochs = constant(2);
        let of = |update: Update, part: &str| {
            let parts = counted(&MCPO.with(h.clone()), &update);
            parts
                .iter()
                .find(|(name, _)| *name == part)
                .map(|(_, work)| *work)
        };
        let step = work(6.0 * (86.0 + 142.0) + 324.0 + 288.0, 6.0);
        let case = |case: &str| Update {
            case: Some(case.to_owned()),
            step_fraction: Some(0.0),
            ..Update::default()
        };
        let active = Update {
            step_fraction: Some(0.5),
            cg_iterations: Some(20),
            ..case("active")
        };
        assert_eq!(
            of(active.clone(), "mimicry"),
            Some(step + 2.0 * work(6.0 * 86.0 + 324.0, 6.0))
        );
        assert_eq!(
            of(active.clone(), "Fisher products"),
            Some(work(20.0 * 2440.0 + 800.0, 0.0))
        );
        assert_eq!(of(active.clone(), "recovery"), None);
        // H^-1 b is only solved for in the line search where the dual did not need it.
        let corrected = |nu: f64| Update {
            nu: Some(nu),
            corrections: Some(2),
            ..active.clone()
        };
        assert_eq!(
            of(corrected(0.5), "mimicry"),
            Some(step + 4.0 * work(6.0 * 86.0 + 324.0, 6.0))
        );
        assert_eq!(of(corrected(0.5), "way back"), None);
        assert_eq!(
            of(corrected(0.0), "way back"),
            Some(work(10.0 * 2440.0, 0.0))
        );
        let infeasible = Update {
            recovery_steps: Some(4),
            ..case("infeasible")
        };
        assert_eq!(of(infeasible.clone(), "mimicry"), Some(step));
        assert_eq!(of(infeasible.clone(), "line search"), Some(Work::default()));
        assert_eq!(of(infeasible, "recovery"), Some(5.0 * step));
        let fell_short = Update {
            recovery_steps: Some(1),
            step_fraction: Some(1.0),
            ..case("recoverable")
        };
        assert_eq!(
            of(fell_short.clone(), "line search"),
            Some(work(860.0, 10.0))
        );
        assert_eq!(of(fell_short, "recovery"), Some(2.0 * step));
        let stays = Update {
            mmd: Some(1.0),
            d: Some(2.0),
            ..case("degenerate_g")
        };
        assert_eq!(of(stays.clone(), "line search"), Some(Work::default()));
        assert_eq!(
            of(
                Update {
                    mmd: Some(3.0),
                    ..stays
                },
                "line search"
            ),
            Some(work(10.0 * 860.0, 100.0))
        );
    }

    #[test]
    fn every_algorithm_with_rollouts_is_counted() {
        let update = Update {
            step_fraction: Some(1.0),
            cg_iterations: Some(1),
            ..Update::default()
        };
        let all = Algorithm::names().filter_map(|name| Algorithm::defaults(name, EnvId::Hopper));
        for algorithm in all.filter(Algorithm::trains) {
            let (name, parts) = (algorithm.name(), counted(&algorithm, &update));
            assert!(
                parts.len() > 1 && parts.iter().all(|(_, work)| work.products > 0.0),
                "{name}: {parts:?}"
            );
        }
    }
}
