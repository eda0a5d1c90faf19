//! The descriptors of environments, and the one list of them.
//!
//! Owns what the rest of the program asks of an environment by its name: limits, rewards, versions,
//! cost. A descriptor stands beside its environment; adding one means adding its file and a line to
//! [`SHIPPED`]. A user's robot gets its descriptor when its table is read, and keeps it as long as
//! the process lives. Start at [`Descriptor`].

use std::{
    collections::BTreeMap,
    sync::{LazyLock, OnceLock, PoisonError, RwLock},
};

use super::{
    EnvError, Environment, Reward, Spaces, SparseMode,
    mountain_car::{self, MountainCar},
    mujoco::{Model, RobotEnvironment},
    robot::{Landmark, Robot},
    robots,
};
use crate::quantity::constant;

/// The environments that ship: the paper's seven in its order, then others. A saved state holds its
/// environment's number, so the order must not change.
pub(super) static SHIPPED: [&Descriptor; 10] = [
    &mountain_car::DESCRIPTOR,
    &robots::inverted_pendulum::DESCRIPTOR,
    &robots::inverted_double_pendulum::DESCRIPTOR,
    &robots::half_cheetah::DESCRIPTOR,
    &robots::hopper::DESCRIPTOR,
    &robots::walker2d::DESCRIPTOR,
    &robots::ant::DESCRIPTOR,
    &robots::swimmer::DESCRIPTOR,
    &robots::reacher::DESCRIPTOR,
    &robots::humanoid::DESCRIPTOR,
];

/// The microseconds of a robot's step for each of its model's own steps, as in Hopper; used until
/// there is a recorded run.
const MICROSECONDS: f64 = 15.0;

/// Everything that is known of an environment.
pub(super) struct Descriptor {
    /// The Gym id, or the user's name.
    pub(super) name: &'static str,
    /// The paper's name, where it is not Gym's.
    pub(super) paper_name: Option<&'static str>,
    /// The time limit, steps.
    pub(super) max_steps: u64,
    /// The reward that is trained on by default: the paper's sparse one.
    pub(super) default_reward: fn() -> Reward,
    /// Raised when physics, observations, rewards or ends give other numbers.
    /// The model in its file does not count here: its digest tells.
    pub(super) revision: u32,
    /// Microseconds of one step on one core, as `mcpo-run bench` measures them in 2026.
    pub(super) microseconds: f64,
    /// Whether Gymnasium keeps the state in f32, whose roundings add up over an episode.
    pub(super) is_f32_in_gymnasium: bool,
    /// The other versions of it in Gym and Gymnasium.
    pub(super) versions: &'static [Version],
    /// Its physics.
    pub(super) body: Body,
    /// Its spaces, once somebody asked for them.
    pub(super) spaces: OnceLock<Option<Spaces>>,
}

/// Another version of an environment that Gym or Gymnasium has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Version {
    /// The number behind the `v`.
    pub number: u32,
    /// Its difference from this project's version, in a sentence; absent if the numbers of a step
    /// are the same except for the engine's last bits.
    pub difference: Option<&'static str>,
    /// The number of its observations, if that differs.
    pub observation_dim: Option<usize>,
    /// The reward that it does not pay for the step that ends an episode.
    pub unpaid_at_the_end: Option<f64>,
    /// Whether its model moves differently.
    pub moves_otherwise: bool,
}

impl Version {
    /// A version with the same numbers.
    pub(super) const fn same(number: u32) -> Self {
        Self {
            number,
            difference: None,
            observation_dim: None,
            unpaid_at_the_end: None,
            moves_otherwise: false,
        }
    }

    /// A version with other numbers, as `difference` says.
    pub(super) const fn other(number: u32, difference: &'static str) -> Self {
        Self {
            difference: Some(difference),
            ..Self::same(number)
        }
    }

    /// Sets how many numbers the version observes.
    pub(super) const fn observing(self, numbers: usize) -> Self {
        Self {
            observation_dim: Some(numbers),
            ..self
        }
    }

    /// Sets the reward that the version does not pay for the step that ends an episode.
    pub(super) const fn not_paying(self, bonus: f64) -> Self {
        Self {
            unpaid_at_the_end: Some(bonus),
            ..self
        }
    }

    /// Marks the version's model as moving differently.
    pub(super) const fn moving_otherwise(self) -> Self {
        Self {
            moves_otherwise: true,
            ..self
        }
    }
}

/// The physics of an environment.
pub(super) enum Body {
    /// A car on a curve.
    MountainCar,
    /// A robot that ships.
    Robot(LazyLock<(Robot, Model)>),
    /// A user's robot.
    Own(Own),
}

/// A user's robot.
pub(super) struct Own {
    pub(super) robot: Robot,
    pub(super) model: Model,
    /// The digest of the robot's table and its model.
    pub(super) digest: String,
}

impl Descriptor {
    /// The physics; `tag` marks its saved states.
    ///
    /// # Errors
    ///
    /// The engine refuses the model.
    pub(super) fn build(&self, tag: f64) -> Result<Box<dyn Environment>, EnvError> {
        let Some((robot, model)) = self.robot() else {
            return Ok(Box::new(MountainCar::new(self.name, tag)));
        };
        Ok(Box::new(RobotEnvironment::new(
            self.name, tag, robot, model,
        )?))
    }

    /// The robot and its model; `None` if it is none.
    pub(super) fn robot(&self) -> Option<(&Robot, &Model)> {
        match &self.body {
            Body::MountainCar => None,
            Body::Robot(both) => Some((&both.0, &both.1)),
            Body::Own(own) => Some((&own.robot, &own.model)),
        }
    }

    /// The user's robot; `None` if it is none.
    pub(super) fn own(&self) -> Option<&Own> {
        match &self.body {
            Body::Own(own) => Some(own),
            Body::MountainCar | Body::Robot(_) => None,
        }
    }

    /// The sparse reward of the environment; for those that ship, with the thresholds that the
    /// project chose.
    pub(super) fn sparse_reward(&self) -> Option<Reward> {
        let Some(own) = self.own() else {
            return Some((self.default_reward)());
        };
        Some(match own.robot.landmark.as_ref()? {
            Landmark::Distance => metres(1.0),
            Landmark::Height(_) => height(1.0),
            Landmark::Goal(_) => Reward::Sparse1,
        })
    }
}

/// SPARSE2 for every `distance` metres.
pub(super) fn metres(distance: f64) -> Reward {
    Reward::Sparse2 {
        distance: constant(distance),
        mode: SparseMode::Milestone,
    }
}

/// SPARSE3 above `height` metres.
pub(super) fn height(height: f64) -> Reward {
    Reward::Sparse3 {
        height: constant(height),
    }
}

/// A robot that ships: its table, and the model that the table names.
///
/// Panics if the table is invalid, which a test would tell.
pub(super) fn shipped(table: &str, model: &'static str) -> (Robot, Model) {
    let robot = toml::from_str(table).unwrap_or_else(|error| panic!("a robot that ships: {error}"));
    (robot, Model::shipped(model))
}

/// The user's robots.
struct Owned {
    /// The robots in the order in which they were first read.
    robots: Vec<&'static Descriptor>,
    /// For each name, the robot that was read last.
    last: BTreeMap<&'static str, usize>,
}

static OWN: RwLock<Owned> = RwLock::new(Owned {
    robots: Vec::new(),
    last: BTreeMap::new(),
});

/// The descriptor with this number: of those that ship, then of the user's.
pub(super) fn descriptor(number: usize) -> &'static Descriptor {
    let own = |number| OWN.read().unwrap_or_else(PoisonError::into_inner).robots[number];
    SHIPPED
        .get(number)
        .copied()
        .unwrap_or_else(|| own(number - SHIPPED.len()))
}

/// The number of the user's robot called `name`; if several have the name, the one that was read
/// last.
pub(super) fn own_number(name: &str) -> Option<usize> {
    let own = OWN.read().unwrap_or_else(PoisonError::into_inner);
    Some(SHIPPED.len() + own.last.get(name)?)
}

/// The names of the user's robots.
pub(super) fn own_names() -> Vec<&'static str> {
    let own = OWN.read().unwrap_or_else(PoisonError::into_inner);
    own.last.keys().copied().collect()
}

/// The number of the user's `robot` called `name` on `model`; equal robots get the same number as
/// long as the process lives.
pub(super) fn intern(name: &str, robot: Robot, model: Model) -> usize {
    let table =
        toml::to_string(&robot).unwrap_or_else(|error| panic!("a robot is a table: {error}"));
    let digest = blake3::hash(format!("{name}\n{table}\n{}", model.digest()).as_bytes()).to_hex()
        [..16]
        .to_owned();
    let mut own = OWN.write().unwrap_or_else(PoisonError::into_inner);
    let is_known = |known: &&Descriptor| known.own().is_some_and(|own| own.digest == digest);
    let number = own.robots.iter().position(is_known).unwrap_or_else(|| {
        let descriptor = Descriptor {
            name: Box::leak(name.to_owned().into_boxed_str()),
            paper_name: None,
            max_steps: robot.max_steps.get(),
            default_reward: || Reward::Dense,
            revision: 1,
            microseconds: MICROSECONDS * robot.frame_skip.get() as f64,
            is_f32_in_gymnasium: false,
            versions: &[],
            body: Body::Own(Own {
                robot,
                model,
                digest,
            }),
            spaces: OnceLock::new(),
        };
        own.robots.push(Box::leak(Box::new(descriptor)));
        own.robots.len() - 1
    });
    let name = own.robots[number].name;
    own.last.insert(name, number);
    SHIPPED.len() + number
}
