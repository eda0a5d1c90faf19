//! A task on a MuJoCo model, as it is written in TOML.
//!
//! Owns the words of a robot's table: observations, rewards, ends and starts of episodes. Knows
//! nothing of how MuJoCo computes any of it. The robots that ship are written in these words too
//! (`robots/*.toml`). Start at [`Robot`]; the format is documented in
//! `experiments/environments.md`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::quantity::{Count, NonNegative, Positive, constant};

/// A robot and its task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// The model, a file in MuJoCo's format MJCF, relative to the file that names it.
    pub model: PathBuf,
    /// Steps of the model's own length that one step of the task takes; required.
    pub frame_skip: Count,
    /// The time limit of an episode in steps. Default 1000.
    #[serde(default = "default_max_steps")]
    pub max_steps: Count,
    /// How actions reach the actuators. Default `"raw"`.
    #[serde(default)]
    pub actions: Actions,
    /// Where the robot is on its way, metres. Default `{ position = 0 }`.
    #[serde(default = "first_position")]
    pub forward: Measure,
    /// What is to be brought where.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub goal: Option<Goal>,
    /// The parts of an observation, in order; required.
    pub observation: Vec<Part>,
    /// The terms of the dense reward, summed in order; required.
    pub dense_reward: Vec<Term>,
    /// What holds as long as an episode goes on; when it no longer does, the episode terminates.
    /// Default: it never ends.
    #[serde(default)]
    pub alive: Vec<Condition>,
    /// How an episode's start is disturbed. Default: not at all.
    #[serde(default)]
    pub initial_noise: InitialNoise,
    /// What the sparse reward watches; without it there is none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub landmark: Option<Landmark>,
}

/// How actions reach the actuators.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Actions {
    /// As they are; all actuators have one range, the same on either side of 0.
    #[default]
    Raw,
    /// From [-1, 1] to each actuator's own range.
    Scaled,
}

/// What is to be brought where: two bodies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// The body that moves.
    pub body: String,
    /// The body where it is to be.
    pub target: String,
}

/// A part of an observation. MuJoCo's own name of the numbers stands in brackets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Part {
    /// Generalised positions (`qpos`), metres and radians.
    Positions(Range),
    /// Sines of positions.
    Sines(Range),
    /// Cosines of positions.
    Cosines(Range),
    /// Generalised velocities (`qvel`).
    Velocities(Range),
    /// Forces of the constraints on the joints (`qfrc_constraint`).
    ConstraintForces(Range),
    /// Forces of the actuators on the joints (`qfrc_actuator`).
    ActuatorForces(Range),
    /// Inertia and mass of each body about the centre of mass, the world's first (`cinert`), ten
    /// numbers a body.
    Inertias(Range),
    /// Velocity of each body, turning and moving (`cvel`), six numbers a body.
    BodyVelocities(Range),
    /// Torque and force of the contacts on each body (`cfrc_ext`), six numbers a body.
    ContactForces(Range),
    /// From the goal's target to its body, three numbers, metres.
    FromGoal(Range),
}

/// Which numbers of an array, and how far each is let.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// The first number, counted from 0. Default 0.
    #[serde(default)]
    pub from: usize,
    /// The number before which to stop. Default: none, to the end.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub until: Option<usize>,
    /// Clipped to this on either side of 0. Default: not clipped.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub clip: Option<Positive>,
}

/// One number of the simulation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Measure {
    /// A generalised position, counted from 0.
    Position(usize),
    /// A generalised velocity, counted from 0.
    Velocity(usize),
    /// A coordinate of a body's origin, metres.
    Body(Place),
    /// A coordinate of a site, metres.
    Site(Place),
    /// A coordinate of the whole model's centre of mass, metres.
    CenterOfMass(Axis),
    /// The height of the end of poles that stand one on the other, metres.
    Poles(Poles),
    /// The greatest magnitude among the positions from this one on and all velocities.
    Magnitude(usize),
}

/// A coordinate of something that the model names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// As the model has it.
    pub name: String,
    /// Which coordinate.
    pub axis: Axis,
}

/// A coordinate's axis in the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Along the way.
    X,
    /// To its left.
    Y,
    /// Up.
    Z,
}

/// Poles that stand one on the other: the sum of each length times the cosine of the angles so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Poles {
    /// The positions that are each pole's angle against the one below, counted from 0.
    pub angles: Vec<usize>,
    /// Metres, as many.
    pub lengths: Vec<Positive>,
}

/// A term of the dense reward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Term {
    /// This many for each metre a second by which `forward` grew over the step.
    ForwardVelocity(f64),
    /// This many for every step, the last one included.
    Alive(f64),
    /// Less this many times the sum of squares of the action, as it was given.
    ControlCost(NonNegative),
    /// Less a share of the sum of squares of the contacts' torques and forces on all bodies.
    ContactCost(ContactCost),
    /// Less this many for each metre between the goal's body and its target.
    GoalDistance(GoalDistance),
    /// Less this many times the square of what a number differs by from where it is to be.
    Deviation(Deviation),
}

/// The cost of contacts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactCost {
    /// What the sum of squares is multiplied by.
    pub weight: NonNegative,
    /// Each torque and force is clipped to this first, on either side of 0. Default: not clipped.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub clip: Option<Positive>,
    /// The most that a step can cost. Default: no limit.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub most: Option<Positive>,
}

/// The cost of being away from the goal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalDistance {
    /// What a metre costs.
    pub weight: NonNegative,
    /// Whether the distance is that of before the step. Default: after it.
    #[serde(default)]
    pub before: bool,
}

/// The cost of a number that is not where it is to be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// The number.
    pub of: Measure,
    /// Where it is to be. Default 0.
    #[serde(default)]
    pub from: f64,
    /// What the square is multiplied by.
    pub weight: NonNegative,
}

/// What holds as long as an episode goes on: all bounds that are given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// The number.
    pub of: Measure,
    /// It is greater than this.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub above: Option<f64>,
    /// It is less than this.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub below: Option<f64>,
    /// It is this or greater.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub at_least: Option<f64>,
    /// It is this or less.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub at_most: Option<f64>,
}

impl Condition {
    /// Whether `number` is within all bounds.
    pub(super) fn holds(&self, number: f64) -> bool {
        self.above.is_none_or(|bound| number > bound)
            && self.below.is_none_or(|bound| number < bound)
            && self.at_least.is_none_or(|bound| number >= bound)
            && self.at_most.is_none_or(|bound| number <= bound)
    }
}

/// How an episode's start differs from the model's.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InitialNoise {
    /// Added to each position.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub positions: Option<Noise>,
    /// Added to each velocity.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub velocities: Option<Noise>,
    /// A point that is put anywhere within a disc, and stands still.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub disc: Option<Disc>,
}

/// How a number is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Noise {
    /// Evenly, up to this far from 0 on either side.
    Uniform(Positive),
    /// Normally around 0 with this standard deviation.
    Normal(Positive),
}

impl Noise {
    /// How far numbers are drawn apart: the bound, or the standard deviation.
    pub(super) fn spread(self) -> f64 {
        match self {
            Self::Uniform(spread) | Self::Normal(spread) => spread.get(),
        }
    }
}

/// Two positions that are drawn together, evenly from a disc around 0; their velocities are 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    /// The first of the two positions, counted from 0.
    pub first: usize,
    /// Metres.
    pub radius: Positive,
}

/// What the sparse reward watches, and with it which one there is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Landmark {
    /// How far `forward` has come since the episode's start: `sparse2`.
    Distance,
    /// A height: `sparse3`.
    Height(Measure),
    /// Whether the goal's body is this near to its target, metres: `sparse1`.
    Goal(Positive),
}

impl Robot {
    /// A table that has every table within it, so that each of their keys can be checked alone.
    pub(crate) fn specimen() -> Self {
        Self {
            model: PathBuf::from("robot.xml"),
            frame_skip: constant(1),
            max_steps: default_max_steps(),
            actions: Actions::default(),
            forward: first_position(),
            goal: Some(Goal {
                body: "tip".to_owned(),
                target: "target".to_owned(),
            }),
            observation: vec![Part::Positions(Range::default())],
            dense_reward: Vec::new(),
            alive: Vec::new(),
            initial_noise: InitialNoise {
                disc: Some(Disc {
                    first: 0,
                    radius: constant(1.0),
                }),
                ..InitialNoise::default()
            },
            landmark: None,
        }
    }
}

fn default_max_steps() -> Count {
    constant(1000)
}

fn first_position() -> Measure {
    Measure::Position(0)
}
