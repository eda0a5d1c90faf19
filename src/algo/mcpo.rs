//! MCPO: policy optimisation under a mimicry constraint (appendix, section C).
//!
//! ```text
//! maximise E_pi_k[(pi/pi_k) A]   subject to   D(pi) <= d_k   and   KL(pi_k || pi) <= delta
//! ```
//!
//! Owns one iteration of it: linearise (Eq. 5), solve the dual (Eq. 6 to 12, with Eq. 11 corrected in
//! [`solver::dual`](crate::solver::dual)), search along the step, recover by Eq. (13) where the constraint is out of reach,
//! and anneal the tolerance, `d_k+1 = d_k (1 + epsilon)`. Knows nothing of how D is measured: that is [`mimicry`]. Start at
//! [`Mcpo::update`].
//!
//! What the appendix leaves open, and what is done here: `c = d_k - D(theta_k)`; D is MMD^2; the line search halves the step
//! until the real KL, the real surrogate and the real D agree with it; advantages are not normalised; the value network is
//! fitted after the policy's step, so that advantages come from a network that has not seen the batch.

use serde::{Deserialize, Serialize};

use super::{
    Agent, AlgoError, Batch, OnPolicy, Update,
    critic::{self, Critic},
    finite, gae, mimicry,
    mimicry::{Costs, Measured, Mimicry, Samples},
    stopwatch::Stopwatch,
    trust_region::{Surrogate, Trial},
};
use crate::{
    demo::Demonstration,
    env::EnvId,
    nn::{Fisher, GaussianPolicy, Pass},
    quantity::{Count, Discount, NonNegative, Positive, UnitInterval, constant},
    rng::{Rng, Seed},
    solver::{
        Step, Theta,
        conjugate_gradient::Limits,
        constrained::{self, Constraint},
        dual::DualSolution,
        line_search::{self, Search},
    },
};

/// The line search accepts a real KL up to this multiple of `max_kl`: the quadratic model, whose KL is `max_kl` itself, is
/// off by some percent either way, and a strict bound would halve every other good step.
const KL_MARGIN: f64 = 1.5;

/// The line search wants at least this share of the gain that the linear model promised.
const GAIN_SHARE: f64 = 0.1;

/// MCPO's hyperparameters; the defaults are the paper's Tables 1 and 2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hyperparameters {
    /// The tolerance d on MMD^2 at the first iteration.
    pub d: Positive,
    /// The annealing factor: `d_k+1 = d_k (1 + epsilon)`.
    pub epsilon: NonNegative,
    /// d grows no further than this; no ceiling when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub max_d: Option<Positive>,
    /// How MMD^2 to the demonstration is measured.
    pub mmd: mimicry::Hyperparameters,
    /// delta, the bound of the mean KL of one update.
    pub max_kl: Positive,
    /// Added to the Fisher matrix's diagonal.
    pub damping: NonNegative,
    /// Conjugate gradient's products, at most, for each of g and b.
    pub cg_iterations: Count,
    /// Discount gamma.
    pub discount: Discount,
    /// GAE's lambda.
    pub gae_lambda: UnitInterval,
    /// Adam's step size for the value network.
    pub learning_rate: Positive,
    /// L2 penalty on the value network's parameters.
    pub l2_penalty: NonNegative,
    /// Passes of the value network over each batch.
    pub value_epochs: Count,
    /// Samples in a minibatch of the value network.
    pub minibatch: Count,
    /// Steps that the line search tries, each half the one before.
    pub line_search_steps: Count,
    /// Adam steps of one recovery, at most (`samples = "demo_states"`).
    pub recovery_steps: Count,
    /// Adam's step size in recovery.
    pub recovery_learning_rate: Positive,
}

impl Hyperparameters {
    /// The defaults for `env`.
    pub fn for_env(env: EnvId) -> Self {
        let (d, epsilon) = match env {
            EnvId::MountainCar => (1e-3, 5e-3),
            EnvId::InvertedPendulum => (1e-3, 1e-2),
            EnvId::InvertedDoublePendulum => (1e-3, 5e-2),
            EnvId::HalfCheetah => (1e-3, 1e-3),
            EnvId::Hopper => (1e-4, 1e-3),
            EnvId::Walker2d => (1e-2, 1e-3),
            EnvId::Ant => (1e-5, 1e-3),
        };
        Self {
            d: constant(d),
            epsilon: constant(epsilon),
            max_d: None,
            mmd: mimicry::Hyperparameters::default(),
            max_kl: constant(5e-3),
            damping: constant(1e-2),
            cg_iterations: constant(10),
            discount: constant(0.99),
            gae_lambda: constant(0.95),
            learning_rate: constant(1e-4),
            l2_penalty: constant(1e-3),
            value_epochs: constant(10),
            minibatch: constant(if env == EnvId::MountainCar { 64 } else { 1024 }),
            line_search_steps: constant(10),
            recovery_steps: constant(500),
            recovery_learning_rate: constant(1e-3),
        }
    }

    fn critic_fit(&self) -> critic::Fit {
        critic::Fit {
            epochs: self.value_epochs.size(),
            minibatch: self.minibatch.size(),
            learning_rate: self.learning_rate.get(),
            l2_penalty: self.l2_penalty.get(),
        }
    }
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
    recovery_steps: Option<u64>,
}

impl Mcpo {
    /// MCPO from `agent` on, near `demonstration`.
    pub fn new(hyperparameters: Hyperparameters, agent: Agent, demonstration: &Demonstration, seed: Seed) -> Self {
        let widths = agent.value.widths();
        let mimicry =
            Mimicry::new(hyperparameters.mmd.clone(), demonstration, &widths[1..widths.len() - 1], seed);
        let critic = Critic::new(&agent.value);
        let tolerance = hyperparameters.d.get();
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
        let measured =
            mimicry.measure(&agent.policy, &agent.normalizer, batch, &surrogate, pass, &costs, rng)?;
        let slack = *tolerance - measured.mmd;
        watch.lap("mimicry");

        // Eq. (5) to (12).
        let limits = Limits { iterations: hyperparameters.cg_iterations.size(), relative_residual: 1e-10 };
        let mut fisher = Fisher::new(&agent.policy, &batch.observations, pass, hyperparameters.damping.get());
        let constraint = Constraint { gradient: &measured.gradient, slack };
        let solved = constrained::solve(&mut fisher, &g, Some(constraint), hyperparameters.max_kl.get(), limits);
        watch.lap("conjugate gradient");

        let outcome = match &solved.step {
            Some(step) => search(
                hyperparameters, &mut agent.policy, step, solved.solution, &surrogate, mimicry, &measured, *tolerance,
                trial_pass,
            ),
            // Eq. (13): the constraint is out of this step's reach.
            None if slack < 0.0 => {
                recover(hyperparameters, agent, mimicry, &surrogate, &measured, *tolerance, &solved, trial_pass)?
            }
            // Nothing to gain, and nothing to mend.
            None => Outcome { mmd_after: measured.mmd, ..Outcome::default() },
        };
        watch.lap("line search and recovery");

        let value_loss =
            critic.fit(&mut agent.value, &batch.observations, &estimate.returns, hyperparameters.critic_fit(), rng)?;
        watch.lap("value");

        let d = *tolerance;
        *tolerance = (d * (1.0 + hyperparameters.epsilon.get()))
            .min(hyperparameters.max_d.map_or(f64::INFINITY, Positive::get));
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
            cg_iterations: Some(solved.iterations as u64),
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
