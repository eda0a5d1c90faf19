//! The moves of MCPO's policy in one iteration: along a step, or down D.
//!
//! Owns how far each goes. The dual decides which it is, and [`Mcpo::update`](super::Mcpo) follows
//! it.

use nalgebra::DMatrix;

use super::Hyperparameters;
use crate::{
    algo::{
        Agent, AlgoError,
        mimicry::{Measured, Mimicry, Samples},
        trust_region::{self, Attempt, Corrections, Improved, Surrogate, Trial, judged},
    },
    nn::{GaussianPolicy, Pass},
    solver::{
        Step,
        line_search::{Refused, WayBack},
    },
};

/// The constraint is met where D exceeds the tolerance by less than this share of it: a correction
/// ends near the bound, on either side.
pub(super) const D_MARGIN: f64 = 1e-3;

/// The record of a move.
#[derive(Default)]
pub(super) struct Outcome {
    pub kl: f64,
    pub gain: f64,
    pub mmd_after: f64,
    pub step_fraction: f64,
    pub corrections: u64,
    pub recovery_steps: Option<u64>,
}

/// The start of one iteration, and the means to measure its moves.
pub(super) struct Iteration<'a> {
    pub hyperparameters: &'a Hyperparameters,
    /// The policy at its start.
    pub start: &'a GaussianPolicy,
    /// The observations of the batch, normalised `[observation_dim x n]`.
    pub observations: &'a DMatrix<f32>,
    pub surrogate: &'a Surrogate<'a>,
    pub measured: &'a Measured,
    /// The direction that lowers D soonest, if the dual asked for it.
    pub way_back: Option<&'a WayBack>,
    /// The tolerance d_k.
    pub tolerance: f64,
    pub mimicry: &'a mut Mimicry,
    /// The pass of the dual's step, as it was left.
    pub fisher_pass: &'a mut Pass,
    pub pass: &'a mut Pass,
}

impl Iteration<'_> {
    /// Leaves the policy as it is: there is nothing to gain and nothing to mend.
    pub fn stay(&self) -> Outcome {
        Outcome {
            mmd_after: self.measured.mmd,
            ..Outcome::default()
        }
    }

    /// Moves `policy` along `step` as far as the surrogate rises by its share of `promised`, the
    /// linear model's gain.
    pub fn improve(&mut self, policy: &mut GaussianPolicy, step: &Step, promised: f64) -> Outcome {
        self.search(policy, step, |fraction| {
            trust_region::enough(fraction, promised)
        })
    }

    /// Moves `agent`'s policy along `step` to where the constraint holds, whatever happens to the
    /// surrogate.
    /// If the step falls short, and D is known well enough to see that, recovery follows up to the
    /// tolerance.
    ///
    /// # Errors
    ///
    /// D is no longer finite.
    pub fn restore(&mut self, agent: &mut Agent, step: &Step) -> Result<Outcome, AlgoError> {
        let outcome = self.search(&mut agent.policy, step, whatever);
        if self.knows_d() && outcome.mmd_after > (1.0 + D_MARGIN) * self.tolerance {
            let recovered = self.recover(agent, 1.0)?;
            return Ok(Outcome {
                step_fraction: outcome.step_fraction,
                ..recovered
            });
        }
        Ok(outcome)
    }

    /// Recovers by Eq. (13).
    /// At the demonstration's states D is known everywhere, and Adam descends on it until it is
    /// within `depth` times the tolerance, whatever the KL.
    /// From a rollout it is only known nearby, and one step of the trust region goes down its
    /// gradient.
    ///
    /// # Errors
    ///
    /// D is no longer finite.
    pub fn recover(&mut self, agent: &mut Agent, depth: f64) -> Result<Outcome, AlgoError> {
        let h = self.hyperparameters;
        if self.knows_d() {
            let (enough, steps) = (depth * self.tolerance, h.recovery_steps.get());
            let descent =
                self.mimicry
                    .descend(agent, enough, steps, h.recovery_learning_rate.get())?;
            let Trial { gain, kl, .. } = self.surrogate.measure(&agent.policy, self.pass);
            let (mmd_after, recovery_steps) = (descent.after, Some(descent.steps));
            return Ok(Outcome {
                kl,
                gain,
                mmd_after,
                recovery_steps,
                ..Outcome::default()
            });
        }
        let b = &self.measured.gradient;
        let solved = h
            .region
            .step(self.start, self.observations, self.fisher_pass, b, None);
        let outcome = match &solved.step {
            Some(step) => self.search(&mut agent.policy, step, whatever),
            None => self.stay(),
        };
        Ok(Outcome {
            recovery_steps: Some(1),
            ..outcome
        })
    }

    /// Whether D is known at every policy rather than to first order around the iteration's: only
    /// then can its curvature be corrected, and a step be checked against it.
    fn knows_d(&self) -> bool {
        self.hyperparameters.mmd.samples == Samples::DemoStates
    }

    /// Moves `policy` along `step` as far as the real KL, D and surrogate allow.
    /// The KL must stay within the region.
    /// D must stay within the tolerance or, if it was beyond, below its old value.
    /// The surrogate's gain must reach `enough` for the fraction.
    fn search(
        &mut self,
        policy: &mut GaussianPolicy,
        step: &Step,
        enough: impl Fn(f64) -> f64,
    ) -> Outcome {
        let knows_d = self.knows_d();
        let Self {
            hyperparameters,
            start,
            observations,
            surrogate,
            measured,
            mimicry,
            fisher_pass,
            pass,
            ..
        } = self;
        let (region, tolerance, known_way) =
            (&hyperparameters.region, self.tolerance, self.way_back);
        let met = (1.0 + D_MARGIN) * tolerance;
        let max_mmd = met.max(measured.mmd);
        let corrections = Corrections {
            most: if knows_d {
                hyperparameters.max_corrections.size()
            } else {
                0
            },
            // If the dual did not need H^-1 b, a corrected trial still does.
            way_back: &mut || {
                known_way.cloned().unwrap_or_else(|| {
                    region.way_back(start, observations, fisher_pass, &measured.gradient)
                })
            },
        };
        let judge = |Attempt {
                         policy,
                         fraction,
                         correctable,
                     }: Attempt<'_>| {
            // First the measure that only takes a pass over the demonstration: a trial that is
            // corrected is not judged.
            let known = correctable.then(|| mimicry.at(measured, policy, &[]));
            if let Some(mmd) = known.filter(|mmd| *mmd > met) {
                return Err(Refused::Excess(mmd - tolerance));
            }
            let trial = surrogate.measure(policy, pass);
            let mmd = known.unwrap_or_else(|| mimicry.at(measured, policy, &trial.ratios));
            let tests = [
                region.holds(&trial),
                (mmd <= max_mmd, "D"),
                (trial.gain >= enough(fraction), "surrogate"),
            ];
            judged(tests, (trial, mmd))
        };
        match region.improve(policy, step, Some(corrections), judge) {
            None => self.stay(),
            Some(Improved {
                fraction,
                corrections,
                verdict: (Trial { gain, kl, .. }, mmd_after),
            }) => Outcome {
                kl,
                gain,
                mmd_after,
                step_fraction: fraction,
                corrections: corrections as u64,
                recovery_steps: None,
            },
        }
    }
}

/// Accepts any gain or loss of the surrogate.
fn whatever(_: f64) -> f64 {
    f64::NEG_INFINITY
}
