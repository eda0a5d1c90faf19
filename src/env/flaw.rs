//! The flaws of a robot: what its table asks for and its model does not have.

use std::{io, path::PathBuf};

/// A flaw in a robot's table or model. Numbers of things count from 0.
#[derive(Debug, thiserror::Error)]
pub enum Flaw {
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The model is no text.
    #[error("{} is not UTF-8 text", path.display())]
    NoText {
        /// The model's file.
        path: PathBuf,
    },
    /// A file that the model needs is gone.
    #[error("the model needs {}: {source}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file that the model needs has changed.
    #[error("{}, which the model needs, is not what it was", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The model's own steps take no time.
    #[error("its `timestep` is {seconds}; a robot moves by steps above 0 seconds")]
    TimeStep {
        /// The length of a step.
        seconds: f64,
    },
    /// The model has fewer numbers of a kind.
    #[error("the model has {count} {what}, 0 to {}, and no number {index}", count.saturating_sub(1))]
    NoNumber {
        /// The number that is asked for.
        index: usize,
        /// How many there are.
        count: usize,
        /// Their kind: `positions`, `velocities`.
        what: &'static str,
    },
    /// The model has nothing of a name.
    #[error("the model has no {what} `{}`; it has {}", name.escape_debug(), listed(known))]
    NoSuchName {
        /// The kind: `body`, `site`.
        what: &'static str,
        /// The name that is asked for.
        name: String,
        /// The names of that kind.
        known: Vec<String>,
    },
    /// There are fewer numbers to observe.
    #[error("there are {available} numbers; from {from} to before {until} is no part of them")]
    NoPart {
        /// How many there are.
        available: usize,
        /// The first that is asked for.
        from: usize,
        /// The number before which to stop.
        until: usize,
    },
    /// Nothing is observed.
    #[error("nothing is observed")]
    Blind,
    /// Something is measured against a goal that the table does not have.
    #[error("it needs a `goal`")]
    NoGoal,
    /// Poles without an angle or a length each.
    #[error("{angles} angles and {lengths} lengths are not one of each for every pole")]
    Poles {
        /// The angles.
        angles: usize,
        /// The lengths.
        lengths: usize,
    },
    /// A number that is infinite or NaN.
    #[error("{0} is not a finite number")]
    NotFinite(f64),
    /// A number above what has a meaning.
    #[error("it is {value}; {most} at most")]
    TooMany {
        /// The number.
        value: u64,
        /// The greatest that is allowed.
        most: u64,
    },
    /// Noise beyond what any simulation bears.
    #[error("{spread:e} is too wide; {most:e} at most")]
    TooWide {
        /// How far the noise reaches.
        spread: f64,
        /// The farthest that is allowed.
        most: f64,
    },
    /// A condition without a bound.
    #[error("it has no bound; write `above`, `below`, `at_least` or `at_most`")]
    NoBound,
    /// A condition that no number meets.
    #[error("no number is beyond {low} and short of {high}")]
    NoneBetween {
        /// The lower bound.
        low: f64,
        /// The upper bound.
        high: f64,
    },
    /// There is nothing to control.
    #[error("the model has no actuators")]
    NoActuators,
    /// An actuator without a range.
    #[error("actuator {actuator}, counted from 0, has no `ctrlrange` in the model")]
    NoRange {
        /// The actuator.
        actuator: usize,
    },
    /// Raw actions for actuators of several ranges.
    #[error(
        "actuator {actuator}, counted from 0, has the range [{low}, {high}], and raw actions need one range for all, the \
         same on either side of 0; write `actions = \"scaled\"`"
    )]
    UnlikeRange {
        /// The actuator.
        actuator: usize,
        /// Its lower bound.
        low: f64,
        /// Its upper bound.
        high: f64,
    },
}

/// Names in a list, or that there is none.
fn listed(names: &[String]) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match names.is_empty() {
        true => "none".to_owned(),
        false => names.join(", "),
    }
}
