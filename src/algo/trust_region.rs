//! The trust-region step on one batch: the surrogate objective, the quadratic model of the KL, and
//! the search along a step.
//!
//! Owns what the second-order methods share. Knows nothing of where a constraint beside the KL
//! comes from. Start at [`Surrogate`].
//!
//! By default 1,024 samples of a batch, evenly spaced, make the Fisher matrix: products then cost a
//! fourth of what all 4,096 cost. At the same KL the step gains as much in HalfCheetah and Hopper,
//! and 3 points in 55 less in Ant, whose 111 observations few samples tell least about. The model's
//! KL is 2, 0 and 24 % off, within [`KL_MARGIN`]; and learning does not suffer
//! (`experiments/studies/shortcuts`, which also says why conjugate gradient neither stops by its
//! residual nor starts warm).

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{
    AlgoError, Batch,
    operations::{Counter, Operations, Work},
    revision::Part,
};
use crate::{
    nn::{Fisher, GaussianPolicy, Pass},
    quantity::{Count, NonNegative, Positive, constant},
    solver::{
        ConstrainedStep, LinearConstraint, Step, Theta,
        conjugate_gradient::Limits,
        constrained_step,
        line_search::{self, Refused, Search, WayBack},
        way_back,
    },
};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "trust_region",
    revision: 1,
    uses: &[],
};

/// The line search accepts a real KL up to this multiple of `max_kl`.
/// The step's KL in the quadratic model is `max_kl` itself, which is some percent off either way: a
/// strict bound would halve every other good step.
pub const KL_MARGIN: f64 = 1.5;

/// The line search asks for at least this share of the gain that the linear model promised.
pub const GAIN_SHARE: f64 = 0.1;

/// The trust region, and how exactly a step in it is found: what second-order methods let a user
/// set of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TrustRegion {
    /// delta, the bound of the mean KL of one update.
    pub max_kl: Positive,
    /// Added to the Fisher matrix's diagonal.
    pub damping: NonNegative,
    /// Products of conjugate gradient, at most, for each gradient.
    pub cg_iterations: Count,
    /// The most samples of the batch, evenly spaced, that make the Fisher matrix.
    pub fisher_samples: Count,
    /// Steps that the line search tries, each half the one before.
    pub line_search_steps: Count,
}

impl Default for TrustRegion {
    fn default() -> Self {
        Self {
            max_kl: constant(5e-3),
            damping: constant(1e-2),
            cg_iterations: constant(10),
            fisher_samples: constant(1024),
            line_search_steps: constant(10),
        }
    }
}

impl TrustRegion {
    /// Minimises `g.x` (`g` `[policy's dim]`) in the trust region around `policy`, as far as
    /// `constraint` allows.
    /// `pass` holds `policy`'s forward pass on `observations` (`[observation_dim x n]`); it is
    /// overwritten if only some of them enter the Fisher matrix.
    pub fn step(
        &self,
        policy: &GaussianPolicy,
        observations: &DMatrix<f32>,
        pass: &mut Pass,
        g: &[f32],
        constraint: Option<LinearConstraint<'_>>,
    ) -> ConstrainedStep {
        let some = self.thinned(observations);
        if let Some(some) = &some {
            policy.forward(some, pass);
        }
        let mut fisher = Fisher::new(
            policy,
            some.as_ref().unwrap_or(observations),
            pass,
            self.damping.get(),
        );
        constrained_step(&mut fisher, g, constraint, self.max_kl.get(), self.limits())
    }

    /// The direction along which b's constraint (`b` `[policy's dim]`) is met again soonest.
    /// `pass` is that of the last [`step`](Self::step) on the same `policy` and `observations`: its
    /// activations and sensitivities serve again.
    pub fn way_back(
        &self,
        policy: &GaussianPolicy,
        observations: &DMatrix<f32>,
        pass: &mut Pass,
        b: &[f32],
    ) -> WayBack {
        let some = self.thinned(observations);
        let observations = some.as_ref().unwrap_or(observations);
        let mut fisher = Fisher::new(policy, observations, pass, self.damping.get());
        way_back(&mut fisher, b, self.limits())
    }

    /// Moves `policy` by the first of 1, 1/2, 1/4 ... of `step` that `judge` accepts, in at most
    /// `line_search_steps` trials.
    /// If all are rejected, the policy is unchanged and the result is `None`.
    /// With `corrections`, a trial that exceeds a constraint is moved back before the step is
    /// halved, see [`line_search::backtrack_corrected`].
    pub fn improve<V>(
        &self,
        policy: &mut GaussianPolicy,
        step: &Step,
        corrections: Option<Corrections<'_>>,
        mut judge: impl FnMut(Attempt<'_>) -> Result<V, Refused<&'static str>>,
    ) -> Option<Improved<V>> {
        let start = Theta::new(policy.parameters());
        let (most, way_back) = corrections
            .map(|Corrections { most, way_back }| (most, way_back))
            .unzip();
        let way_back = || way_back.map(|way_back| way_back());
        let trials = self.line_search_steps.size();
        let found = line_search::backtrack_corrected(
            &start,
            step,
            trials,
            most.unwrap_or(0),
            way_back,
            |trial| {
                policy.set_parameters(trial.theta.as_slice());
                judge(Attempt {
                    policy,
                    fraction: trial.fraction,
                    correctable: trial.correctable,
                })
            },
        );
        match found {
            Search::Accepted {
                fraction,
                corrections,
                verdict,
                ..
            } => Some(Improved {
                fraction,
                corrections,
                verdict,
            }),
            Search::Rejected { reasons } => {
                tracing::debug!(?reasons, "the line search rejected every trial");
                // The trials have overwritten the policy.
                policy.set_parameters(start.as_slice());
                None
            }
        }
    }

    /// Tests that the real KL of `trial` is within the region, by its margin; with the test's name.
    pub fn holds(&self, trial: &Trial) -> (bool, &'static str) {
        (trial.kl <= KL_MARGIN * self.max_kl.get(), "KL")
    }

    /// The observations of the Fisher matrix; `None` if all are used.
    fn thinned(&self, observations: &DMatrix<f32>) -> Option<DMatrix<f32>> {
        let n = observations.ncols();
        let every = spacing(n, self.fisher_samples.size());
        // Evenly spaced, since neighbours in time are nearly the same.
        (every > 1).then(|| {
            observations
                .columns_with_step(0, n.div_ceil(every), every - 1)
                .into_owned()
        })
    }

    fn limits(&self) -> Limits {
        // Below this residual, only rounding is left.
        Limits {
            iterations: self.cg_iterations.size(),
            relative_residual: 1e-10,
        }
    }
}

/// The least spacing at which at most `most` of `n` samples are taken.
pub fn spacing(n: usize, most: usize) -> usize {
    n.div_ceil(most).max(1)
}

/// The work of conjugate gradient, and of the policy's passes in `trials` of the line search.
pub(super) fn operations(
    region: &TrustRegion,
    trials: f64,
    counter: &Counter<'_>,
) -> [Operations; 2] {
    let &Counter {
        n, policy, update, ..
    } = counter;
    let products = update.cg_iterations.unwrap_or(0) as f64;
    let once = if products > 0.0 {
        samples(region, n) * policy.sensitivities
    } else {
        Work::default()
    };
    [
        (
            "Fisher products",
            once + fisher_products(region, products, counter),
        ),
        ("line search", trials * n * policy.forward()),
    ]
}

/// The work of so many `products` with the Fisher matrix, once there are sensitivities.
pub(super) fn fisher_products(region: &TrustRegion, products: f64, counter: &Counter<'_>) -> Work {
    samples(region, counter.n) * products * counter.policy.fisher_product
}

/// How many of a batch's `n` samples make the Fisher matrix.
fn samples(region: &TrustRegion, n: f64) -> f64 {
    (n / spacing(n as usize, region.fisher_samples.size()) as f64).ceil()
}

/// A policy that the line search tries.
pub struct Attempt<'a> {
    /// The policy.
    pub policy: &'a GaussianPolicy,
    /// The fraction of the step that was taken to it.
    pub fraction: f64,
    /// Whether it can still be corrected.
    pub correctable: bool,
}

/// The correction of trials that exceed a constraint.
pub struct Corrections<'a> {
    /// The most corrections of one trial.
    pub most: usize,
    /// The direction along which the constraint is met again soonest; asked for once, when needed.
    pub way_back: &'a mut dyn FnMut() -> WayBack,
}

/// The accepted trial of a line search.
#[derive(Debug, Clone, PartialEq)]
pub struct Improved<V> {
    /// The fraction of the step that was taken.
    pub fraction: f64,
    /// The number of corrections of the trial.
    pub corrections: usize,
    /// The judge's verdict on it.
    pub verdict: V,
}

/// The share of the linear model's promise `gain` that a trial at `fraction` of the step must keep;
/// NaN if the promise is.
pub fn enough(fraction: f64, gain: f64) -> f64 {
    GAIN_SHARE * fraction * gain
}

/// `verdict` if every one of `tests` passes. NaN fails any comparison.
///
/// # Errors
///
/// The name of the first test that fails.
pub fn judged<V, const N: usize>(
    tests: [(bool, &'static str); N],
    verdict: V,
) -> Result<V, Refused<&'static str>> {
    match tests.into_iter().find(|(passed, _)| !passed) {
        None => Ok(verdict),
        Some((_, failed)) => Err(Refused::Because(failed)),
    }
}

/// The step in `solved`.
///
/// # Errors
///
/// The problem has none: training diverged.
pub fn step_of(solved: &ConstrainedStep) -> Result<&Step, AlgoError> {
    let undefined = AlgoError::Undefined {
        q: solved.q,
        r: solved.r,
        s: solved.s,
    };
    solved.step.as_ref().ok_or(undefined)
}

/// The surrogate `L(theta) = mean over the batch of (pi_theta(a|s) / pi_old(a|s)) A(s, a)`, with
/// the old policy's values on the batch.
pub struct Surrogate<'a> {
    batch: &'a Batch,
    advantages: &'a [f64],
    old_log_std: Vec<f32>,
    old_densities: Vec<f64>,
}

/// A trial policy, measured on the batch.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// `L(theta) - L(theta_old)`.
    pub gain: f64,
    /// Mean `KL(old || trial)` over the batch's states, nats.
    pub kl: f64,
    /// Probability ratios `[n]`.
    pub ratios: Vec<f64>,
}

impl<'a> Surrogate<'a> {
    /// The surrogate of `advantages` (`[n]`) on `batch`, which `policy` collected. Leaves
    /// `policy`'s forward pass in `pass`.
    pub fn new(
        policy: &GaussianPolicy,
        batch: &'a Batch,
        advantages: &'a [f64],
        pass: &mut Pass,
    ) -> Self {
        policy.forward(&batch.observations, pass);
        let mut old_densities = vec![0.0; batch.len()];
        policy.log_densities(pass.output(), &batch.actions, &mut old_densities);
        Self {
            batch,
            advantages,
            old_log_std: policy.log_std().to_vec(),
            old_densities,
        }
    }

    /// The batch.
    pub fn batch(&self) -> &'a Batch {
        self.batch
    }

    /// The gradient of L at the old policy `[dim]`; `pass` is as [`new`](Surrogate::new) left it.
    pub fn gradient(&self, policy: &GaussianPolicy, pass: &mut Pass) -> Vec<f32> {
        self.score(policy, pass, self.advantages)
    }

    /// The mean over the batch of `weights` times the score function, at the old policy `[dim]`.
    pub fn score(&self, policy: &GaussianPolicy, pass: &mut Pass, weights: &[f64]) -> Vec<f32> {
        let n = weights.len() as f64;
        let shares: Vec<f64> = weights.iter().map(|weight| weight / n).collect();
        let mut gradient = vec![0.0; policy.dim()];
        policy.score(
            &self.batch.observations,
            pass,
            &self.batch.actions,
            &shares,
            &mut gradient,
        );
        gradient
    }

    /// Measures `trial` on the batch; `pass` is overwritten.
    pub fn measure(&self, trial: &GaussianPolicy, pass: &mut Pass) -> Trial {
        trial.forward(&self.batch.observations, pass);
        let mut ratios = vec![0.0; self.batch.len()];
        trial.log_densities(pass.output(), &self.batch.actions, &mut ratios);
        let mut gain = 0.0;
        for ((ratio, old), advantage) in ratios
            .iter_mut()
            .zip(&self.old_densities)
            .zip(self.advantages)
        {
            *ratio = (*ratio - old).exp();
            gain += (*ratio - 1.0) * advantage;
        }
        let kl = trial.kl_from(self.batch.means.as_view(), &self.old_log_std, pass.output());
        Trial {
            gain: gain / self.batch.len() as f64,
            kl,
            ratios,
        }
    }
}

#[cfg(test)]
mod tests;
