//! MCPO: policy optimisation under a mimicry constraint (appendix, section C).
//!
//! ```text
//! maximise E_pi_k[(pi/pi_k) A]   subject to   D(pi) <= d_k   and   KL(pi_k || pi) <= delta
//! ```
//!
//! Owns one iteration of it: linearise (Eq. 5), solve the dual (Eq. 6 to 12, with Eq. 11 corrected
//! in [`solver::dual`](crate::solver::dual)), search along the step, recover by Eq. (13) if the
//! constraint is out of reach, and anneal the tolerance, `d_k+1 = d_k (1 + epsilon)`. Knows nothing
//! of how D is measured: that is [`mimicry`](super::mimicry). Start at [`Mcpo::update`].
//!
//! Eq. (14) judges by the linear model whether the constraint can be reached. Far from the
//! demonstration MMD^2 is nearly flat, and a step that should reach it falls short; at the
//! demonstration's states, where the real D is known, recovery then follows in the same iteration.
//!
//! Three things keep the policy at the bound rather than below it, all where D is known at the
//! demonstration's states. A trial that D's curvature carries over the bound is corrected before
//! the step is halved ([`line_search`](crate::solver::line_search)). The normaliser is held at the
//! demonstration's statistics, so that D stays where the last step left it: a running one moves the
//! policy at the demonstration's states, and D with it. And recovery, which is then met at the
//! start alone, goes on far below the bound, as the appendix has it ("as much as possible"): on the
//! edge of a loose bound the policy may be one that never meets a reward.
//!
//! Choices where the appendix leaves them open: `c = d_k - D(theta_k)`; D is MMD^2; the line search
//! halves the step until the real KL, the real surrogate and the real D agree with it; advantages
//! are not normalised; the value network is fitted after the policy's step, so that advantages come
//! from a network that has not seen the batch; the tolerance grows in iterations of recovery too.
//! Table 1's batch is read as the steps of an iteration (`rollout.steps`), since d grows by the
//! iteration; the value network takes it in smaller minibatches. Table 1's Adam serves the value
//! network and recovery: the policy's step is in closed form.

mod hyperparameters;
mod iteration;

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    critic::{self, Critic},
    definition::{About, Definition},
    finite,
    mimicry::{self, Mimicry, Samples},
    operations::{Counter, Operations},
    revision::Part,
    stopwatch::Stopwatch,
    trust_region::{self, Surrogate},
};
use crate::{
    demo::Demonstration,
    nn::{Normalizer, Pass},
    quantity::Positive,
    rng::{Rng, Seed},
    solver::{ConstrainedStep, LinearConstraint, Step, dual::DualSolution},
};

pub use hyperparameters::Hyperparameters;
use iteration::Iteration;

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "mcpo",
    revision: 2,
    uses: &[&critic::PART, &mimicry::PART, &trust_region::PART],
};

/// MCPO as an algorithm of the catalogue. Its iteration is Table 1's batch, since the tolerance
/// grows by the iteration.
pub static MCPO: Definition<Hyperparameters> = Definition {
    about: About {
        demonstration: true,
        steps: Some(1024),
        passes: 50.0,
        later: &[("max_corrections", "0"), ("recovery_depth", "1")],
        ..About::new("mcpo", "MCPO", &PART)
    },
    defaults: Hyperparameters::for_env,
    cloning: None,
    start: |hyperparameters, start| {
        start.imitate(|agent, demonstration, seed| {
            Mcpo::new(hyperparameters, agent, demonstration, seed)
        })
    },
    operations,
};

/// The work of an update.
fn operations(h: &Hyperparameters, counter: &Counter<'_>) -> Vec<Operations> {
    let update = counter.update;
    let at_states = h.mmd.samples == Samples::DemoStates;
    let no_step = update.case.as_deref() == Some("infeasible") && at_states;
    let stays = update.case.as_deref() == Some("degenerate_g") && update.mmd <= update.d;
    let trials = if no_step || stays {
        0.0
    } else {
        counter.trials(h.region.line_search_steps)
    };
    let mut parts = vec![counter.values(), counter.surrogate_gradient()];
    // D is measured at each trial, and again at each correction.
    let measured = trials + update.corrections.unwrap_or(0) as f64;
    parts.push(mimicry::operations(
        h.mmd.samples,
        h.critic.value_epochs,
        measured,
        counter,
    ));
    parts.extend(trust_region::operations(&h.region, trials, counter));
    // Without nu the dual had no use for H^-1 b, so that the first correction solved for it.
    if update.nu == Some(0.0) && update.corrections > Some(0) {
        let products = h.region.cg_iterations.get() as f64;
        let way_back = trust_region::fisher_products(&h.region, products, counter);
        parts.push(("way back", way_back));
    }
    if at_states && update.recovery_steps.is_some() {
        parts.push(("recovery", mimicry::descent_operations(counter)));
    }
    parts.push(counter.value_epochs(h.critic.value_epochs));
    parts
}

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
    /// The tolerance d_k.
    tolerance: f64,
}

impl Mcpo {
    /// MCPO from `agent` on, near `demonstration`.
    pub fn new(
        hyperparameters: Hyperparameters,
        mut agent: Agent,
        demonstration: &Demonstration,
        seed: Seed,
    ) -> Self {
        if hyperparameters.mmd.samples == Samples::DemoStates {
            agent.normalizer =
                Normalizer::held(&demonstration.observations, agent.normalizer.clip());
        }
        let mimicry = Mimicry::new(
            hyperparameters.mmd.clone(),
            demonstration,
            agent.hidden(),
            seed,
        );
        let critic = Critic::new(&agent.value);
        let tolerance = hyperparameters.d.bound(|| mimicry.of_doing_nothing());
        Self {
            hyperparameters,
            mimicry,
            state: State {
                agent,
                critic,
                tolerance,
            },
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
        let Self {
            hyperparameters: h,
            mimicry,
            state:
                State {
                    agent,
                    critic,
                    tolerance,
                },
            pass,
            trial_pass,
        } = self;
        let mut watch = Stopwatch::start();
        let estimate = h
            .critic
            .estimate(batch, &batch.rewards, &agent.value, trial_pass);
        watch.lap("advantages");

        // Eq. (5): g is the gradient of the loss, the surrogate's with the other sign; b and D are
        // the constraint's.
        let surrogate = Surrogate::new(&agent.policy, batch, &estimate.advantages, pass);
        let mut g = surrogate.gradient(&agent.policy, pass);
        g.iter_mut().for_each(|g| *g = -*g);
        watch.lap("gradient");
        let measured = mimicry.measure(agent, &surrogate, pass, &h.critic, rng)?;
        let slack = *tolerance - measured.mmd;
        watch.lap("mimicry");

        // Eq. (6) to (12).
        let constraint = LinearConstraint {
            gradient: &measured.gradient,
            slack,
        };
        let solved = h.region.step(
            &agent.policy,
            &batch.observations,
            pass,
            &g,
            Some(constraint),
        );
        watch.lap("conjugate gradient");

        let mut iteration = Iteration {
            hyperparameters: h,
            start: &agent.policy.clone(),
            observations: &batch.observations,
            surrogate: &surrogate,
            measured: &measured,
            way_back: solved.way_back.as_ref(),
            tolerance: *tolerance,
            mimicry,
            fisher_pass: pass,
            pass: trial_pass,
        };
        let outcome = match Action::of(&solved, slack)? {
            Action::Improve(step) => {
                iteration.improve(&mut agent.policy, step, -solved.objective_change)
            }
            Action::Restore(step) => iteration.restore(agent, step)?,
            Action::Stay => iteration.stay(),
            Action::Recover => iteration.recover(agent, h.recovery_depth.get())?,
        };
        watch.lap("line search and recovery");

        let value_loss = critic.fit(
            &mut agent.value,
            &batch.observations,
            &estimate.returns,
            h.critic.fit(),
            rng,
        )?;
        watch.lap("value");

        let d = *tolerance;
        *tolerance =
            (d * (1.0 + h.epsilon.get())).min(h.max_d.map_or(f64::INFINITY, Positive::get));
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

/// The policy's move in one iteration, as the dual's case decides.
enum Action<'a> {
    /// The constraint holds, and there is a reward to gain: the step of Eq. (8) and (12).
    Improve(&'a Step),
    /// The constraint is violated, and the trust region reaches where it holds (Eq. 14): the step
    /// that leads there.
    Restore(&'a Step),
    /// The constraint holds, and there is nothing to gain.
    Stay,
    /// The constraint is violated, and out of the trust region's reach (Eq. 14): Eq. (13).
    Recover,
}

impl<'a> Action<'a> {
    /// The one that follows from the solution of the dual at `slack`, `c = d_k - D(theta_k)`.
    ///
    /// # Errors
    ///
    /// The problem is undefined: training diverged.
    fn of(solved: &'a ConstrainedStep, slack: f64) -> Result<Self, AlgoError> {
        Ok(match solved.solution {
            DualSolution::Infeasible => Self::Recover,
            DualSolution::DegenerateG { .. } if slack >= 0.0 => Self::Stay,
            DualSolution::DegenerateG { .. } | DualSolution::Recoverable { .. } => {
                Self::Restore(trust_region::step_of(solved)?)
            }
            DualSolution::Inactive { .. }
            | DualSolution::Active { .. }
            | DualSolution::DegenerateB { .. }
            | DualSolution::Undefined => Self::Improve(trust_region::step_of(solved)?),
        })
    }
}

#[cfg(test)]
mod tests;
