//! One number of a simulation, with every name already looked up.

use super::simulation::{Named, Simulation};
use crate::env::{
    Flaw,
    robot::{Axis, Goal, Measure, Place},
};

/// How a [`Measure`] is read.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Reading {
    Position(usize),
    Velocity(usize),
    Body(usize, usize),
    Site(usize, usize),
    CenterOfMass(usize),
    /// The poles' angles and lengths, metres.
    Poles(Vec<(usize, f64)>),
    Magnitude(usize),
}

impl Reading {
    /// Looks up `measure` in `simulation`.
    ///
    /// # Errors
    ///
    /// The model has no such number; the message says what it has.
    pub(super) fn new(measure: &Measure, simulation: &Simulation) -> Result<Self, Flaw> {
        let (nq, nv) = (simulation.qpos().len(), simulation.qvel().len());
        Ok(match measure {
            Measure::Position(i) => Self::Position(within(*i, nq, "positions")?),
            Measure::Velocity(i) => Self::Velocity(within(*i, nv, "velocities")?),
            Measure::Body(Place { name, axis }) => {
                Self::Body(find(simulation, Named::Body, name)?, number(*axis))
            }
            Measure::Site(Place { name, axis }) => {
                Self::Site(find(simulation, Named::Site, name)?, number(*axis))
            }
            Measure::CenterOfMass(axis) => Self::CenterOfMass(number(*axis)),
            Measure::Magnitude(from) => Self::Magnitude(within(*from, nq, "positions")?),
            Measure::Poles(poles) => {
                let (angles, lengths) = (poles.angles.len(), poles.lengths.len());
                if angles != lengths || angles == 0 {
                    return Err(Flaw::Poles { angles, lengths });
                }
                let pole = |(angle, length): (&usize, &crate::quantity::Positive)| {
                    Ok((within(*angle, nq, "positions")?, length.get()))
                };
                Self::Poles(
                    poles
                        .angles
                        .iter()
                        .zip(&poles.lengths)
                        .map(pole)
                        .collect::<Result<_, Flaw>>()?,
                )
            }
        })
    }

    /// The number now. Bodies, sites and the centre of mass are where they were at the last
    /// evaluation of the dynamics, up to one of the model's own steps ago, as in Gym.
    pub(super) fn read(&self, simulation: &Simulation) -> f64 {
        let (qpos, qvel) = (simulation.qpos(), simulation.qvel());
        match self {
            Self::Position(i) => qpos[*i],
            Self::Velocity(i) => qvel[*i],
            Self::Body(id, axis) => simulation.body_position(*id)[*axis],
            Self::Site(id, axis) => simulation.site_position(*id)[*axis],
            Self::CenterOfMass(axis) => simulation.center_of_mass(*axis),
            Self::Magnitude(from) => qpos[*from..]
                .iter()
                .chain(qvel)
                .fold(0.0, |greatest: f64, x| greatest.max(x.abs())),
            Self::Poles(poles) => {
                let mut angle = 0.0;
                poles.iter().fold(0.0, |height, (i, length)| {
                    angle += qpos[*i];
                    height + length * angle.cos()
                })
            }
        }
    }
}

/// The bodies of a goal, by number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bodies {
    body: usize,
    target: usize,
}

impl Bodies {
    /// Looks up the bodies of `goal`.
    ///
    /// # Errors
    ///
    /// The model has no such body.
    pub(super) fn new(goal: &Goal, simulation: &Simulation) -> Result<Self, Flaw> {
        let find = |name| find(simulation, Named::Body, name);
        Ok(Self {
            body: find(&goal.body)?,
            target: find(&goal.target)?,
        })
    }

    /// The offset from the target to the body, metres.
    pub(super) fn offset(self, simulation: &Simulation) -> [f64; 3] {
        let (body, target) = (
            simulation.body_position(self.body),
            simulation.body_position(self.target),
        );
        [0, 1, 2].map(|axis| body[axis] - target[axis])
    }

    /// The distance between the two, metres.
    pub(super) fn distance(self, simulation: &Simulation) -> f64 {
        self.offset(simulation)
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt()
    }
}

/// `index`, if it is a number below `count`.
///
/// # Errors
///
/// `index` is too large.
pub(super) fn within(index: usize, count: usize, what: &'static str) -> Result<usize, Flaw> {
    if index < count {
        Ok(index)
    } else {
        Err(Flaw::NoNumber { index, count, what })
    }
}

fn find(simulation: &Simulation, kind: Named, name: &str) -> Result<usize, Flaw> {
    simulation.find(kind, name).ok_or_else(|| Flaw::NoSuchName {
        what: match kind {
            Named::Body => "body",
            Named::Site => "site",
        },
        name: name.to_owned(),
        known: simulation
            .names(kind)
            .iter()
            .map(ToString::to_string)
            .collect(),
    })
}

fn number(axis: Axis) -> usize {
    match axis {
        Axis::X => 0,
        Axis::Y => 1,
        Axis::Z => 2,
    }
}
