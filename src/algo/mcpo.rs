//! MCPO: policy optimisation under a mimicry constraint (appendix, section C).
//!
//! ```text
//! maximise E_pi_k[(pi/pi_k) A]   subject to   D(pi) <= d_k   and   KL(pi_k || pi) <= delta
//! ```
//!
//! Owns one iteration of it: linearise (Eq. 5), solve the dual (Eq. 6 to 12, with Eq. 11 corrected in
//! [`solver::dual`](crate::solver::dual)), search along the step, recover by Eq. (13) where the constraint is out of reach,
//! and anneal the tolerance, `d_k+1 = d_k (1 + epsilon)`. Knows nothing of how D is measured: that is [`mimicry`](super::mimicry). Start at
//! [`Mcpo::update`].
//!
//! Eq. (14) judges by the linear model whether the constraint can be reached. Far from the demonstration MMD^2 is nearly flat,
//! and a step that should reach it falls short; at the demonstration's states, where the real D is known, recovery then
//! follows in the same iteration.
//!
//! Three things keep the policy at the bound rather than below it, all where D is known at the demonstration's states. A trial
//! that D's curvature carries over the bound is corrected before the step is halved
//! ([`line_search`](crate::solver::line_search)). The normaliser is held at the demonstration's statistics, so that D stays where
//! the last step left it: a running one moves the policy at the demonstration's states, and D with it. And recovery, which is
//! then met at the start alone, goes on far below the bound, as the appendix has it ("as much as possible"): on the edge of a
//! loose bound the policy may be one that never meets a reward.
//!
//! What the appendix leaves open, and what is done here: `c = d_k - D(theta_k)`; D is MMD^2; the line search halves the step
//! until the real KL, the real surrogate and the real D agree with it; advantages are not normalised; the value network is
//! fitted after the policy's step, so that advantages come from a network that has not seen the batch; the tolerance grows in
//! iterations of recovery too. Table 1's batch is read as the steps of an iteration (`rollout.steps`), since d grows by the
//! iteration; the value network takes it in smaller minibatches. Table 1's Adam serves the value network and recovery: the
//! policy's step is in closed form.

mod hyperparameters;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    critic::{self, Critic},
    definition::{About, Definition, Learner},
    finite, gae,
    mimicry::{self, Costs, Measured, Mimicry, Samples},
    operations::{Counter, Operations},
    revision::Part,
    stopwatch::Stopwatch,
    trust_region::{self, Found, GAIN_SHARE, KL_MARGIN, Surrogate, Trial},
};
use crate::{
    demo::Demonstration,
    nn::{GaussianPolicy, Normalizer, Pass},
    quantity::Positive,
    rng::{Rng, Seed},
    solver::{
        LinearConstraint, Step,
        dual::DualSolution,
        line_search::{Refused, WayBack},
    },
};

pub use hyperparameters::Hyperparameters;

/// Raise its revision when what this file computes changes.
pub static PART: Part =
    Part { name: "mcpo", revision: 2, uses: &[&critic::PART, &gae::PART, &mimicry::PART, &trust_region::PART] };

/// MCPO as an algorithm of the catalogue. Its iteration is Table 1's batch, since the tolerance grows by the iteration.
pub static MCPO: Definition<Hyperparameters> = Definition {
    about: About {
        name: "mcpo",
        label: "MCPO",
        demonstration: true,
        dense: false,
        trains: true,
        steps: Some(1024),
        passes: 50.0,
        part: Some(&PART),
        later: &[("max_corrections", "0"), ("recovery_depth", "1")],
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| {
        let seed = start.seed;
        let (agent, demonstration) = start.with_demonstration()?;
        Ok(Learner::on_policy(Mcpo::new(hyperparameters, agent, &demonstration, seed)))
    },
    operations,
};

/// The operations of an update.
fn operations(h: &Hyperparameters, counter: &Counter<'_>) -> Vec<Operations> {
    let update = counter.update;
    let at_states = h.mmd.samples == Samples::DemoStates;
    let no_step = update.case.as_deref() == Some("infeasible") && at_states;
    let stays = update.case.as_deref() == Some("degenerate_g") && update.mmd <= update.d;
    let trials = if no_step || stays { 0.0 } else { counter.trials(h.line_search_steps) };
    let mut parts = vec![counter.values(), counter.surrogate_gradient()];
    parts.push(mimicry::operations(h.mmd.samples, h.value_epochs, trials, counter));
    parts.extend(trust_region::operations(h.fisher_samples, trials, counter));
    if at_states && update.recovery_steps.is_some() {
        parts.push(("recovery", mimicry::descent_operations(counter)));
    }
    parts.push(counter.value_epochs(h.value_epochs));
    parts
}

/// The constraint is met where D exceeds the tolerance by less than this share of it: a correction ends near the bound, on
/// either side.
const D_MARGIN: f64 = 1e-3;

/// MCPO.
pub struct Mcpo {
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
    /// d_k.
    tolerance: f64,
}

/// What one iteration did to the policy, for the record.
#[derive(Default)]
struct Outcome {
    kl: f64,
    gain: f64,
    mmd_after: f64,
    step_fraction: f64,
    corrections: u64,
    recovery_steps: Option<u64>,
}

impl Mcpo {
    /// MCPO from `agent` on, near `demonstration`.
    pub fn new(hyperparameters: Hyperparameters, mut agent: Agent, demonstration: &Demonstration, seed: Seed) -> Self {
        if hyperparameters.mmd.samples == Samples::DemoStates {
            agent.normalizer = Normalizer::held(&demonstration.observations, agent.normalizer.clip());
        }
        let mimicry = Mimicry::new(hyperparameters.mmd.clone(), demonstration, agent.hidden(), seed);
        let critic = Critic::new(&agent.value);
        let tolerance = hyperparameters.d.bound(|| mimicry.of_doing_nothing());
        Self {
            hyperparameters,
            mimicry,
            state: State { agent, critic, tolerance },
            pass: Pass::default(),
            trial_pass: Pass::default(),
        }
    }
}

impl OnPolicy for Mcpo {
    fn agent(&self) -> &Agent {
        &self.state.agent
    }

    fn agent_mut(&mut self) -> &mut Agent {
        &mut self.state.agent
    }

    fn update(&mut self, batch: &Batch, rng: &mut Rng) -> Result<Update, AlgoError> {
        let Self { hyperparameters, mimicry, state: State { agent, critic, tolerance }, pass, trial_pass } = self;
        let mut watch = Stopwatch::start();
        let (discount, lambda) = (hyperparameters.discount.get(), hyperparameters.gae_lambda.get());
        let estimate = gae::estimate(batch, &batch.rewards, &agent.value, discount, lambda, trial_pass);
        watch.lap("advantages");

        // g is the gradient of the loss, the surrogate's with the other sign; b and D are the constraint's.
        let surrogate = Surrogate::new(&agent.policy, batch, &estimate.advantages, pass);
        let mut g = surrogate.gradient(&agent.policy, pass);
        g.iter_mut().for_each(|g| *g = -*g);
        watch.lap("gradient");
        let costs = Costs { discount, lambda, fit: hyperparameters.critic_fit() };
        let measured = mimicry.measure(agent, batch, &surrogate, pass, &costs, rng)?;
        let slack = *tolerance - measured.mmd;
        watch.lap("mimicry");

        // Eq. (5) to (12).
        let constraint = LinearConstraint { gradient: &measured.gradient, slack };
        let solved = hyperparameters.region().step(&agent.policy, &batch.observations, pass, &g, Some(constraint));
        watch.lap("conjugate gradient");

        let start = agent.policy.clone();
        let iteration = Iteration {
            hyperparameters,
            start: &start,
            observations: &batch.observations,
            surrogate: &surrogate,
            measured: &measured,
            way_back: solved.way_back,
            tolerance: *tolerance,
        };
        let outcome = match (&solved.step, solved.solution) {
            (
                Some(step),
                DualSolution::Inactive { .. } | DualSolution::Active { .. } | DualSolution::DegenerateB { .. },
            ) => iteration.search(&mut agent.policy, step, Some(-solved.objective_change), mimicry, pass, trial_pass),
            (Some(_), DualSolution::DegenerateG { .. }) if slack >= 0.0 => iteration.stay(),
            (Some(step), _) => {
                let outcome = iteration.search(&mut agent.policy, step, None, mimicry, pass, trial_pass);
                match hyperparameters.mmd.samples {
                    // The step was to reach the tolerance, and D is known well enough to see that it did not.
                    Samples::DemoStates if outcome.mmd_after > (1.0 + D_MARGIN) * *tolerance => {
                        let recovered = iteration.recover(agent, mimicry, 1.0, pass, trial_pass)?;
                        Outcome { step_fraction: outcome.step_fraction, ..recovered }
                    }
                    _ => outcome,
                }
            }
            (None, DualSolution::Infeasible) => {
                iteration.recover(agent, mimicry, hyperparameters.recovery_depth.get(), pass, trial_pass)?
            }
            (None, _) => return Err(AlgoError::Undefined { q: solved.q, r: solved.r, s: solved.s }),
        };
        watch.lap("line search and recovery");

        let value_loss =
            critic.fit(&mut agent.value, &batch.observations, &estimate.returns, hyperparameters.critic_fit(), rng)?;
        watch.lap("value");

        let d = *tolerance;
        *tolerance =
            (d * (1.0 + hyperparameters.epsilon.get())).min(hyperparameters.max_d.map_or(f64::INFINITY, Positive::get));
        let multipliers = solved.solution.multipliers();
        Ok(Update {
            kl: Some(finite("the KL", outcome.kl)?),
            entropy: Some(agent.policy.entropy()),
            surrogate_gain: Some(finite("the surrogate's gain", outcome.gain)?),
            value_loss: Some(value_loss),
            mmd: Some(measured.mmd),
            mmd_after: Some(finite("D", outcome.mmd_after)?),
            d: Some(d),
            case: Some(solved.solution.name().to_owned()),
            lambda: multipliers.map(|(lambda, _)| lambda),
            nu: multipliers.map(|(_, nu)| nu),
            step_fraction: Some(outcome.step_fraction),
            corrections: Some(outcome.corrections),
            cg_iterations: Some(solved.products as u64),
            recovery_steps: outcome.recovery_steps,
            seconds: watch.laps(),
            ..Update::default()
        })
    }

    fn save(&self) -> Vec<u8> {
        super::to_bytes(&(&self.state, self.mimicry.save()))
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), AlgoError> {
        let (state, mimicry): (State, Vec<u8>) = super::from_bytes("mcpo", state)?;
        self.mimicry.restore(&mimicry)?;
        self.state = state;
        Ok(())
    }
}

/// What the parts of one iteration's step share.
struct Iteration<'a> {
    hyperparameters: &'a Hyperparameters,
    /// The policy at its start.
    start: &'a GaussianPolicy,
    /// What it saw, normalised `[observation_dim x n]`.
    observations: &'a DMatrix<f32>,
    surrogate: &'a Surrogate<'a>,
    measured: &'a Measured,
    /// Along which D is lowered soonest, where the dual has asked for it.
    way_back: Option<WayBack>,
    /// d_k.
    tolerance: f64,
}

impl Iteration<'_> {
    /// Nothing to gain and nothing to mend: the policy stays.
    fn stay(&self) -> Outcome {
        Outcome { mmd_after: self.measured.mmd, ..Outcome::default() }
    }

    /// Moves `policy` along `step` as far as the real KL, D and surrogate allow: the KL stays within `max_kl`, D within the
    /// tolerance or, where it was beyond, below what it was. `promised` is the gain that the linear model sees in the whole
    /// step; where the step is to restore the constraint, nothing is promised and the surrogate may fall.
    fn search(
        &self,
        policy: &mut GaussianPolicy,
        step: &Step,
        promised: Option<f64>,
        mimicry: &mut Mimicry,
        fisher_pass: &mut Pass,
        pass: &mut Pass,
    ) -> Outcome {
        let h = self.hyperparameters;
        let max_kl = KL_MARGIN * h.max_kl.get();
        let met = (1.0 + D_MARGIN) * self.tolerance;
        let max_mmd = met.max(self.measured.mmd);
        let trials = h.line_search_steps.size();
        // From a rollout D is known to first order alone, which has no curvature to correct.
        let corrections = if h.mmd.samples == Samples::DemoStates { h.max_corrections.size() } else { 0 };
        let way_back = || {
            let solve = || h.region().way_back(self.start, self.observations, fisher_pass, &self.measured.gradient);
            Some(self.way_back.clone().unwrap_or_else(solve))
        };
        let found = trust_region::search_corrected(
            policy,
            step,
            trials,
            corrections,
            way_back,
            |trial, fraction, correctable| {
                if correctable {
                    let mmd = mimicry.at(self.measured, trial, &[]);
                    if mmd > met {
                        return Err(Refused::Excess(mmd - self.tolerance));
                    }
                }
                let measured = self.surrogate.measure(trial, pass);
                let mmd = mimicry.at(self.measured, trial, &measured.ratios);
                let enough = promised.map_or(f64::NEG_INFINITY, |gain| GAIN_SHARE * fraction * gain);
                // Each test is one that NaN fails.
                let tests =
                    [(measured.kl <= max_kl, "KL"), (mmd <= max_mmd, "D"), (measured.gain >= enough, "surrogate")];
                let failed = tests.into_iter().find(|(passed, _)| !passed);
                failed.map_or(Ok((measured, mmd)), |(_, failed)| Err(Refused::Because(failed)))
            },
        );
        found.map_or_else(
            || self.stay(),
            |Found { fraction, corrections, verdict: (Trial { gain, kl, .. }, mmd_after) }| Outcome {
                kl,
                gain,
                mmd_after,
                step_fraction: fraction,
                corrections: corrections as u64,
                recovery_steps: None,
            },
        )
    }

    /// Eq. (13), for a constraint out of reach. At the demonstration's states D is known everywhere, and Adam descends on it
    /// until it is within `depth` times the tolerance, whatever the KL. From a rollout it is known nearby alone, and one step of the
    /// trust region goes down its gradient.
    fn recover(
        &self,
        agent: &mut Agent,
        mimicry: &mut Mimicry,
        depth: f64,
        fisher_pass: &mut Pass,
        pass: &mut Pass,
    ) -> Result<Outcome, AlgoError> {
        let h = self.hyperparameters;
        match h.mmd.samples {
            Samples::DemoStates => {
                let enough = depth * self.tolerance;
                let descent = mimicry.descend(agent, enough, h.recovery_steps.get(), h.recovery_learning_rate.get())?;
                let Trial { gain, kl, .. } = self.surrogate.measure(&agent.policy, pass);
                Ok(Outcome {
                    kl,
                    gain,
                    mmd_after: descent.after,
                    recovery_steps: Some(descent.steps),
                    ..Outcome::default()
                })
            }
            Samples::Rollout => {
                let solved = h.region().step(self.start, self.observations, fisher_pass, &self.measured.gradient, None);
                let outcome = match &solved.step {
                    Some(step) => self.search(&mut agent.policy, step, None, mimicry, fisher_pass, pass),
                    None => self.stay(),
                };
                Ok(Outcome { recovery_steps: Some(1), ..outcome })
            }
        }
    }
}

#[cfg(test)]
mod tests;
