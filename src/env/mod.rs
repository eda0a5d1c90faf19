//! The tasks: their physics, their dense rewards and the paper's sparse ones.
//!
//! Owns what happens between an action and the next observation. Knows nothing of policies or
//! learning. Start at [`Environment`], one episode's physics, and [`Task`], which adds the reward
//! that is trained on and the time limit. The facts about an environment by its name stand in its
//! descriptor, and all descriptors in one list, `catalog.rs`.

mod catalog;
mod flaw;
mod id;
mod mountain_car;
mod mujoco;
mod reward;
pub mod robot;
mod robots;
mod task;
mod versions;

pub use catalog::Version;
pub use flaw::Flaw;
pub use id::EnvId;
pub use mujoco::engine_version;
pub use reward::{Reward, SparseMode};
pub use task::{Task, Transition};

use crate::rng::Rng;

/// The shapes and bounds of an environment's observations and actions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spaces {
    /// Numbers in an observation.
    pub observation_dim: usize,
    /// Numbers in an action.
    pub action_dim: usize,
    /// Every action's bound: the physics clamps each number to `[-action_bound, action_bound]`;
    /// costs use the number before clamping.
    pub action_bound: f64,
}

/// Why an episode ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EpisodeEnd {
    /// The task ended it: no reward comes after this state.
    Terminated,
    /// The time limit cut it: the state's value still counts.
    Truncated,
}

/// The result of one step of physics, beside the observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The dense ("exact") reward.
    pub reward: f64,
    /// Whether the task ended the episode.
    pub terminated: bool,
}

/// Generalised positions and velocities: what a demonstration stores so that it can be replayed.
#[derive(Debug, Clone, PartialEq)]
pub struct Pose {
    /// Positions, in the engine's order.
    pub qpos: Vec<f64>,
    /// Velocities, in the engine's order.
    pub qvel: Vec<f64>,
}

/// Errors of environments.
#[derive(Debug, thiserror::Error)]
pub enum EnvError {
    /// No environment has this name.
    #[error("unknown environment `{name}`; {known}")]
    UnknownEnvironment {
        /// The name as it was given.
        name: String,
        /// The known names, for the message.
        known: String,
    },
    /// An action, pose or saved state does not fit the environment.
    #[error("{env}: {what} has {got} numbers; {expected} are needed")]
    WrongLength {
        /// The environment.
        env: String,
        /// The kind of numbers: an action, a pose or a saved state.
        what: &'static str,
        /// The length that was given.
        got: usize,
        /// The length that fits.
        expected: usize,
    },
    /// An action or pose holds NaN or an infinity.
    #[error("{env}: {what} {numbers:?} is not finite")]
    NonFinite {
        /// The environment.
        env: String,
        /// The kind of numbers: an action or a pose.
        what: &'static str,
        /// The numbers that were given.
        numbers: Vec<f64>,
    },
    /// The saved state is of another environment.
    #[error("{env}: the saved state is of another environment")]
    ForeignState {
        /// The environment.
        env: String,
    },
    /// The physics left the range in which it means anything.
    #[error("{env}: the simulation diverged under the action {action:?}")]
    Diverged {
        /// The environment.
        env: String,
        /// The last action.
        action: Vec<f64>,
    },
    /// The reward does not exist for this environment.
    #[error("{env} has no reward {reward}; it has dense and {has}")]
    NoSuchReward {
        /// The environment.
        env: EnvId,
        /// The reward that was asked for.
        reward: &'static str,
        /// The sparse reward that it has.
        has: &'static str,
    },
    /// A robot has the name of an environment that ships.
    #[error("the name `{name}` is taken: {by} ships with the program")]
    NameTaken {
        /// The name as it was given.
        name: String,
        /// The environment of that name.
        by: EnvId,
    },
    /// A robot's name cannot name a folder.
    #[error("`{}` cannot name an environment: letters, digits, `.`, `_` and `-` can, not starting with `.`, at most 100 of them", name.escape_debug())]
    BadName {
        /// The name as it was given.
        name: String,
    },
    /// The model of a robot lacks something that its table names, or the table itself is wrong.
    #[error("{env}: {}: {flaw}", at(key, *index))]
    Robot {
        /// The robot's name.
        env: String,
        /// The table's key.
        key: &'static str,
        /// The element of its list, from 0; absent for a key that is no list.
        index: Option<usize>,
        /// The mistake.
        flaw: Box<Flaw>,
    },
    /// The physics engine refused its model or state.
    #[error("{env}: MuJoCo: {message}")]
    Engine {
        /// The environment.
        env: String,
        /// The engine's message.
        message: String,
    },
}

/// The physics of one task. An implementation is deterministic: the same state and action give the
/// same bits.
pub trait Environment: Send {
    /// The shapes and bounds.
    fn spaces(&self) -> Spaces;

    /// Starts an episode in a random initial state and writes its observation
    /// (`[observation_dim]`).
    fn reset(&mut self, rng: &mut Rng, observation: &mut [f64]);

    /// Takes one step under `action` (`[action_dim]`, unclamped) and writes the observation after
    /// it.
    ///
    /// # Errors
    ///
    /// The action has a wrong length or is not finite, or the physics diverged; after an error,
    /// start another episode.
    fn step(&mut self, action: &[f64], observation: &mut [f64]) -> Result<Outcome, EnvError>;

    /// Takes the physics of a step under `action` (`[action_dim]`, unclamped) alone, for
    /// `mcpo-run bench`.
    /// Nothing is observed or paid, and everything that depends on these is stale until the next
    /// episode.
    ///
    /// # Errors
    ///
    /// As for [`step`](Environment::step).
    fn advance(&mut self, action: &[f64]) -> Result<(), EnvError>;

    /// The number that the sparse reward watches: distance travelled since the episode's start,
    /// height of the last pole, or 1 at the goal and 0 elsewhere.
    fn landmark(&self) -> f64;

    /// The current pose.
    fn pose(&self) -> Pose;

    /// The pose behind `observation`, as if it were at the origin of the ground, and how many
    /// numbers at the observation's beginning are positions; `None` if an observation does not hold
    /// a whole pose.
    fn pose_of(&self, _observation: &[f64]) -> Option<(Pose, usize)> {
        None
    }

    /// Puts the environment into `pose` as the start of an episode, and writes its observation.
    ///
    /// # Errors
    ///
    /// The pose has a wrong length or is not finite.
    fn set_pose(&mut self, pose: &Pose, observation: &mut [f64]) -> Result<(), EnvError>;

    /// Everything that the next step depends on, for a checkpoint.
    fn save(&self) -> Vec<f64>;

    /// Restores a state of [`save`](Environment::save); every later bit is as it would have been.
    ///
    /// # Errors
    ///
    /// The state is of another environment.
    fn restore(&mut self, state: &[f64]) -> Result<(), EnvError>;
}

/// A key of a robot's table, with the element of its list: `alive[1]`.
fn at(key: &str, index: Option<usize>) -> String {
    index.map_or_else(|| format!("`{key}`"), |index| format!("`{key}[{index}]`"))
}

/// # Errors
///
/// There are not `expected` numbers but `got`.
fn check_length(
    env: &str,
    what: &'static str,
    got: usize,
    expected: usize,
) -> Result<(), EnvError> {
    if got == expected {
        Ok(())
    } else {
        Err(EnvError::WrongLength {
            env: env.to_owned(),
            what,
            got,
            expected,
        })
    }
}

/// # Errors
///
/// NaN or an infinity is among `numbers`.
fn check_finite(env: &str, what: &'static str, numbers: &[f64]) -> Result<(), EnvError> {
    if numbers.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(EnvError::NonFinite {
            env: env.to_owned(),
            what,
            numbers: numbers.to_vec(),
        })
    }
}

/// The saved `state` of `env` without the tag in front, if that is `tag` and `len` numbers follow.
/// The tag is needed because two environments' states can have the same length, as HalfCheetah's
/// and Walker2d's do.
fn untag<'a>(env: &str, tag: f64, state: &'a [f64], len: usize) -> Result<&'a [f64], EnvError> {
    match state {
        [first, rest @ ..] if *first == tag => {
            check_length(env, "the saved state", rest.len(), len)?;
            Ok(rest)
        }
        _ => Err(EnvError::ForeignState {
            env: env.to_owned(),
        }),
    }
}
