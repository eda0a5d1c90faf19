//! A robot's table against its model: every name looked up, every number counted.

use super::{
    observed::Observed,
    reading::{Bodies, Reading, within},
    simulation::Simulation,
};
use crate::env::{
    EnvError, Flaw,
    robot::{Actions, Condition, InitialNoise, Landmark, Measure, Noise, Robot, Term},
};

/// The parts of a [`Robot`] that a step needs.
pub(super) struct Pieces {
    pub(super) frame_skip: usize,
    pub(super) controls: Controls,
    pub(super) forward: Reading,
    pub(super) goal: Option<Bodies>,
    pub(super) observation: Vec<Observed>,
    pub(super) terms: Vec<(Term, Option<Reading>)>,
    pub(super) alive: Vec<(Reading, Condition)>,
    /// The landmark, with the reading that it needs.
    pub(super) landmark: Option<(Landmark, Option<Reading>)>,
    /// Whether contact forces are observed or cost anything.
    pub(super) reads_contacts: bool,
}

/// How actions become controls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Controls {
    /// Unchanged; MuJoCo clamps each to `bound` on either side of 0.
    Raw { bound: f64 },
    /// Scaled from [-1, 1] to each control's own range.
    Scaled,
}

/// The amount that a term of the reward gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Paid {
    /// An amount to add.
    More(f64),
    /// An amount to subtract.
    Less(f64),
}

/// The most steps of a model in one step of a task: a step of a run has to end, or nothing can
/// interrupt it.
const MOST_STEPS: u64 = 10_000;
/// The widest initial noise, metres or radians: beyond it no simulation means anything.
const MOST_NOISE: f64 = 1e6;

impl Pieces {
    /// Looks up `robot`, called `name`, in `simulation`.
    ///
    /// # Errors
    ///
    /// The model lacks something that the table names; the error tells which key, and why.
    pub(super) fn new(
        name: &str,
        robot: &Robot,
        simulation: &Simulation,
    ) -> Result<Self, EnvError> {
        let at = |key: &'static str, index: Option<usize>| {
            move |flaw| EnvError::Robot {
                env: name.to_owned(),
                key,
                index,
                flaw: Box::new(flaw),
            }
        };
        let read = |measure: &Measure| Reading::new(measure, simulation);
        let goal = robot
            .goal
            .as_ref()
            .map(|goal| Bodies::new(goal, simulation))
            .transpose();
        let goal = goal.map_err(at("goal", None))?;
        let needs_goal = |wanted: bool| {
            if wanted && goal.is_none() {
                Err(Flaw::NoGoal)
            } else {
                Ok(())
            }
        };

        let mut observation = Vec::new();
        for (index, part) in robot.observation.iter().enumerate() {
            let part = Observed::new(part, goal, simulation);
            observation.push(part.map_err(at("observation", Some(index)))?);
        }
        if observation.is_empty() {
            return Err(at("observation", None)(Flaw::Blind));
        }
        let mut terms = Vec::new();
        for (index, term) in robot.dense_reward.iter().enumerate() {
            let wrong = at("dense_reward", Some(index));
            let reading = match term {
                Term::Deviation(deviation) => Some(read(&deviation.of).map_err(wrong)?),
                _ => None,
            };
            needs_goal(matches!(term, Term::GoalDistance(_))).map_err(wrong)?;
            finite(term).map_err(wrong)?;
            terms.push((term.clone(), reading));
        }
        let mut alive = Vec::new();
        for (index, condition) in robot.alive.iter().enumerate() {
            let wrong = at("alive", Some(index));
            bounded(condition).map_err(wrong)?;
            alive.push((read(&condition.of).map_err(wrong)?, condition.clone()));
        }
        let landmark = match &robot.landmark {
            Some(Landmark::Height(measure)) => Some(read(measure).map_err(at("landmark", None))?),
            landmark => {
                needs_goal(matches!(landmark, Some(Landmark::Goal(_))))
                    .map_err(at("landmark", None))?;
                None
            }
        };
        if robot.frame_skip.get() > MOST_STEPS {
            return Err(at("frame_skip", None)(Flaw::TooMany {
                value: robot.frame_skip.get(),
                most: MOST_STEPS,
            }));
        }
        let InitialNoise {
            positions,
            velocities,
            disc,
        } = robot.initial_noise;
        let spread = [positions, velocities]
            .into_iter()
            .flatten()
            .map(Noise::spread);
        let widest = spread
            .chain(disc.map(|disc| disc.radius.get()))
            .fold(0.0, f64::max);
        if widest > MOST_NOISE {
            return Err(at("initial_noise", None)(Flaw::TooWide {
                spread: widest,
                most: MOST_NOISE,
            }));
        }
        if let Some(disc) = disc {
            let last = disc.first.saturating_add(1);
            let both = within(last, simulation.qpos().len(), "positions")
                .and_then(|_| within(last, simulation.qvel().len(), "velocities"));
            both.map_err(at("initial_noise", None))?;
        }
        let reads_contacts = observation.iter().any(Observed::reads_contacts)
            || robot
                .dense_reward
                .iter()
                .any(|term| matches!(term, Term::ContactCost(_)));
        Ok(Self {
            frame_skip: robot.frame_skip.size(),
            controls: controls(robot.actions, simulation).map_err(at("actions", None))?,
            forward: read(&robot.forward).map_err(at("forward", None))?,
            goal,
            observation,
            terms,
            alive,
            landmark: robot.landmark.clone().map(|kind| (kind, landmark)),
            reads_contacts,
        })
    }

    /// Writes the observation, part after part.
    pub(super) fn observe(&self, simulation: &Simulation, observation: &mut [f64]) {
        let mut rest = observation;
        for part in &self.observation {
            let (slots, after) = rest.split_at_mut(part.len());
            part.write(simulation, slots);
            rest = after;
        }
    }
}

/// The amount that `term`, with its reading, gives for a step at `velocity` along the way (m/s),
/// from `distances[0]` metres before the goal to `distances[1]`, under `action`.
pub(super) fn paid(
    (term, reading): &(Term, Option<Reading>),
    simulation: &Simulation,
    velocity: f64,
    distances: [f64; 2],
    action: &[f64],
) -> Paid {
    match term {
        Term::ForwardVelocity(weight) => Paid::More(weight * velocity),
        Term::Alive(bonus) => Paid::More(*bonus),
        Term::ControlCost(weight) => {
            Paid::Less(weight.get() * action.iter().map(|a| a * a).sum::<f64>())
        }
        Term::ContactCost(cost) => {
            let clipped = |f: &f64| {
                cost.clip
                    .map_or(*f, |clip| f.clamp(-clip.get(), clip.get()))
            };
            let sum: f64 = simulation
                .contact_forces()
                .iter()
                .map(clipped)
                .map(|f| f * f)
                .sum();
            let paid = cost.weight.get() * sum;
            Paid::Less(cost.most.map_or(paid, |most| paid.min(most.get())))
        }
        Term::GoalDistance(cost) => {
            Paid::Less(cost.weight.get() * distances[usize::from(!cost.before)])
        }
        Term::Deviation(cost) => {
            let off = reading
                .as_ref()
                .map_or(0.0, |reading| reading.read(simulation))
                - cost.from;
            Paid::Less(cost.weight.get() * (off * off))
        }
    }
}

/// # Errors
///
/// A number of `term` is not finite.
fn finite(term: &Term) -> Result<(), Flaw> {
    let number = match term {
        Term::ForwardVelocity(x) | Term::Alive(x) => *x,
        Term::Deviation(deviation) => deviation.from,
        Term::ControlCost(_) | Term::ContactCost(_) | Term::GoalDistance(_) => return Ok(()),
    };
    if number.is_finite() {
        Ok(())
    } else {
        Err(Flaw::NotFinite(number))
    }
}

/// # Errors
///
/// `condition` bounds nothing, or holds for no number.
fn bounded(condition: &Condition) -> Result<(), Flaw> {
    let Condition {
        above,
        below,
        at_least,
        at_most,
        ..
    } = condition;
    let given: Vec<f64> = [above, below, at_least, at_most]
        .into_iter()
        .copied()
        .flatten()
        .collect();
    if given.is_empty() {
        return Err(Flaw::NoBound);
    }
    if let Some(bound) = given.iter().find(|bound| !bound.is_finite()) {
        return Err(Flaw::NotFinite(*bound));
    }
    let low = above
        .iter()
        .chain(at_least)
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let high = below
        .iter()
        .chain(at_most)
        .copied()
        .fold(f64::INFINITY, f64::min);
    if low < high || (low == high && above.is_none() && below.is_none()) {
        Ok(())
    } else {
        Err(Flaw::NoneBetween { low, high })
    }
}

/// How actions become controls.
///
/// # Errors
///
/// There is nothing to control, a control has no range, or raw actions have no common bound.
fn controls(actions: Actions, simulation: &Simulation) -> Result<Controls, Flaw> {
    let ranges = simulation.control_range();
    let first = ranges.first().ok_or(Flaw::NoActuators)?;
    if let Some(actuator) = simulation.control_limited().position(|limited| !limited) {
        return Err(Flaw::NoRange { actuator });
    }
    let bound = first[1];
    match (
        actions,
        ranges.iter().position(|range| *range != [-bound, bound]),
    ) {
        (Actions::Scaled, _) => Ok(Controls::Scaled),
        (Actions::Raw, None) => Ok(Controls::Raw { bound }),
        (Actions::Raw, Some(actuator)) => {
            let [low, high] = ranges[actuator];
            Err(Flaw::UnlikeRange {
                actuator,
                low,
                high,
            })
        }
    }
}
