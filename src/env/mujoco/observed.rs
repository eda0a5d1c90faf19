//! The parts of an observation: how they are written, and which part of the pose they show.

use super::{reading::Bodies, simulation::Simulation};
use crate::env::{
    Flaw, Pose,
    robot::{Part, Range},
};

/// A part of an observation, with the number of its values known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Observed {
    source: Source,
    from: usize,
    until: usize,
    clip: Option<f64>,
}

/// The source of a part's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    Positions,
    Sines,
    Cosines,
    Velocities,
    ConstraintForces,
    ActuatorForces,
    Inertias,
    BodyVelocities,
    ContactForces,
    FromGoal(Bodies),
}

impl Observed {
    /// Looks up `part` in `simulation`, whose goal's bodies are `goal`.
    ///
    /// # Errors
    ///
    /// The simulation has no such numbers.
    pub(super) fn new(
        part: &Part,
        goal: Option<Bodies>,
        simulation: &Simulation,
    ) -> Result<Self, Flaw> {
        let (source, range) = match part {
            Part::Positions(range) => (Source::Positions, range),
            Part::Sines(range) => (Source::Sines, range),
            Part::Cosines(range) => (Source::Cosines, range),
            Part::Velocities(range) => (Source::Velocities, range),
            Part::ConstraintForces(range) => (Source::ConstraintForces, range),
            Part::ActuatorForces(range) => (Source::ActuatorForces, range),
            Part::Inertias(range) => (Source::Inertias, range),
            Part::BodyVelocities(range) => (Source::BodyVelocities, range),
            Part::ContactForces(range) => (Source::ContactForces, range),
            Part::FromGoal(range) => (Source::FromGoal(goal.ok_or(Flaw::NoGoal)?), range),
        };
        let Range { from, until, clip } = *range;
        let available = source.len(simulation);
        let until = until.unwrap_or(available);
        if until > available || from >= until {
            return Err(Flaw::NoPart {
                available,
                from,
                until,
            });
        }
        Ok(Self {
            source,
            from,
            until,
            clip: clip.map(|clip| clip.get()),
        })
    }

    /// The number of its values.
    pub(super) fn len(&self) -> usize {
        self.until - self.from
    }

    /// Whether it needs the contact forces.
    pub(super) fn reads_contacts(&self) -> bool {
        self.source == Source::ContactForces
    }

    /// Writes its values at the beginning of `slots`.
    pub(super) fn write(&self, simulation: &Simulation, slots: &mut [f64]) {
        let mut write = |numbers: &[f64], of: fn(f64) -> f64| {
            for (slot, number) in slots.iter_mut().zip(&numbers[self.from..self.until]) {
                let number = of(*number);
                *slot = self.clip.map_or(number, |clip| number.clamp(-clip, clip));
            }
        };
        let same: fn(f64) -> f64 = |x| x;
        match self.source {
            Source::Positions => write(simulation.qpos(), same),
            Source::Sines => write(simulation.qpos(), f64::sin),
            Source::Cosines => write(simulation.qpos(), f64::cos),
            Source::Velocities => write(simulation.qvel(), same),
            Source::ConstraintForces => write(simulation.constraint_forces(), same),
            Source::ActuatorForces => write(simulation.actuator_forces(), same),
            Source::Inertias => write(simulation.inertias(), same),
            Source::BodyVelocities => write(simulation.body_velocities(), same),
            Source::ContactForces => write(simulation.contact_forces(), same),
            Source::FromGoal(goal) => write(&goal.offset(simulation), same),
        }
    }

    /// Each of its numbers with the index of the position or velocity that it shows; only for
    /// sources that show one.
    fn told<'a>(&self, numbers: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        (self.from..self.until).zip(numbers.iter().copied())
    }
}

impl Source {
    /// The number of its values.
    fn len(self, simulation: &Simulation) -> usize {
        match self {
            Self::Positions | Self::Sines | Self::Cosines => simulation.qpos().len(),
            Self::Velocities => simulation.qvel().len(),
            Self::ConstraintForces => simulation.constraint_forces().len(),
            Self::ActuatorForces => simulation.actuator_forces().len(),
            Self::Inertias => simulation.inertias().len(),
            Self::BodyVelocities => simulation.body_velocities().len(),
            Self::ContactForces => simulation.contact_forces().len(),
            Self::FromGoal(_) => 3,
        }
    }
}

/// The pose (`nq` positions and `nv` velocities) behind `observation`, made of `parts`, and how
/// many numbers at its beginning are positions.
/// Positions before the first observed one are where the robot is on the ground, and become 0.
/// `None` if a velocity or any other position is not observed.
pub(super) fn pose_of(
    parts: &[Observed],
    observation: &[f64],
    nq: usize,
    nv: usize,
) -> Option<(Pose, usize)> {
    let (mut qpos, mut qvel) = (vec![None; nq], vec![None; nv]);
    let (mut sines, mut cosines) = (vec![None; nq], vec![None; nq]);
    let (mut rest, mut leading, mut only_positions) = (observation, 0, true);
    for part in parts {
        let (numbers, after) = rest.split_at_checked(part.len())?;
        rest = after;
        let places = match part.source {
            Source::Positions => &mut qpos,
            Source::Sines => &mut sines,
            Source::Cosines => &mut cosines,
            Source::Velocities => &mut qvel,
            _ => {
                only_positions = false;
                continue;
            }
        };
        part.told(numbers)
            .for_each(|(i, number)| places[i] = Some(number));
        only_positions &= part.source != Source::Velocities;
        leading += if only_positions { part.len() } else { 0 };
    }
    for ((position, sine), cosine) in qpos.iter_mut().zip(sines).zip(cosines) {
        *position = position.or_else(|| Some(f64::atan2(sine?, cosine?)));
    }
    let first = qpos.iter().position(Option::is_some)?;
    qpos[..first].fill(Some(0.0));
    let pose = Pose {
        qpos: qpos.into_iter().collect::<Option<_>>()?,
        qvel: qvel.into_iter().collect::<Option<_>>()?,
    };
    (leading > 0).then_some((pose, leading))
}
