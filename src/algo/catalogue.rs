//! All algorithms: those of this crate, and those that a user's program adds.
//!
//! Owns the list. Knows nothing of what an algorithm is: that is its
//! [`Definition`](super::definition::Definition). Start at [`all`]; a user's program calls
//! [`register`], and then [`cli::main`](crate::cli::main).

use std::sync::OnceLock;

use super::{
    About, Algorithm, Entry, cloning, gail, mcpo, mmd_il, penalty, pofd, ppo, pretraining, random,
    trpo,
};
use crate::env::EnvId;

/// This crate's algorithms, in the order of messages and of the looks in figures: append only.
static BUILT_IN: [&dyn Entry; 11] = [
    &mcpo::MCPO,
    &ppo::PPO,
    &pretraining::PRETRAINING,
    &pofd::POFD,
    &mmd_il::MMD_IL,
    &ppo::EXPERT,
    &random::RANDOM,
    &trpo::TRPO,
    &gail::GAIL,
    &cloning::BC,
    &penalty::PENALTY,
];

/// The registered algorithms; fixed by the first caller who asks for the list.
static ADDED: OnceLock<Vec<&'static dyn Entry>> = OnceLock::new();

/// Errors of adding algorithms.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RegisterError {
    /// The list is already in use.
    #[error("algorithms are registered once, before any file is read")]
    Late,
    /// Two algorithms would have one name.
    #[error("there is an algorithm called `{0}` already")]
    Taken(&'static str),
    /// Matrices, folders and records could not all hold this name.
    #[error(
        "`{0}` cannot be the name of an algorithm: expected lower-case letters, digits and `_`, a letter first"
    )]
    Name(&'static str),
}

/// Adds algorithms to the catalogue for this process: matrices, the schema, `plan`, `bench`,
/// training and reports know them like those of this crate.
/// Call it once, first thing in `main`, which workers run too.
///
/// # Errors
///
/// A name is taken or malformed, or the catalogue was read or added to before; nothing is then
/// added.
pub fn register(added: &[&'static dyn Entry]) -> Result<(), RegisterError> {
    let mut known: Vec<&str> = BUILT_IN.iter().map(|entry| entry.about().name).collect();
    for name in added.iter().map(|entry| entry.about().name) {
        let is_inner = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(is_inner) {
            return Err(RegisterError::Name(name));
        }
        if known.contains(&name) {
            return Err(RegisterError::Taken(name));
        }
        known.push(name);
    }
    ADDED.set(added.to_vec()).map_err(|_| RegisterError::Late)
}

/// Every algorithm, this crate's first.
pub fn all() -> impl Iterator<Item = &'static dyn Entry> {
    BUILT_IN
        .into_iter()
        .chain(ADDED.get_or_init(Vec::new).iter().copied())
}

/// The algorithm called `name`; `None` when there is none of that name.
pub fn find(name: &str) -> Option<&'static dyn Entry> {
    all().find(|entry| entry.about().name == name)
}

impl Algorithm {
    /// The names of all algorithms.
    pub fn names() -> impl Iterator<Item = &'static str> {
        all().map(|entry| entry.about().name)
    }

    /// The algorithm called `name` with its defaults for `env`; `None` when there is none of that
    /// name.
    pub fn defaults(name: &str, env: EnvId) -> Option<Self> {
        find(name).map(|entry| entry.defaults(env))
    }

    /// The label of the algorithm called `name` in figures and tables; `None` when there is none of
    /// that name.
    pub fn label(name: &str) -> Option<&'static str> {
        find(name).map(|entry| entry.about().label)
    }

    /// All algorithms' hyperparameters that are newer than some recorded runs, as
    /// `mcpo.recovery_depth`, each with its neutral value, under which nothing changes, as JSON.
    pub fn later() -> impl Iterator<Item = (String, &'static str)> {
        let of = |about: &'static About| {
            about
                .later
                .iter()
                .map(|(key, json)| (format!("{}.{key}", about.name), *json))
        };
        all().flat_map(move |entry| of(entry.about()))
    }
}

#[cfg(test)]
mod tests {
    use super::{super::Definition, *};

    #[test]
    fn every_algorithm_is_read_as_it_is_written() {
        for name in Algorithm::names() {
            let algorithm = Algorithm::defaults(name, EnvId::Ant).expect("a known name");
            assert_eq!(algorithm.name(), name);
            let again = Algorithm::from_hyperparameters(name, algorithm.hyperparameters())
                .expect("it is in the catalogue");
            assert_eq!(again.expect("defaults are complete"), algorithm);
            let text = serde_json::to_string(&algorithm).expect("JSON");
            assert_eq!(
                serde_json::from_str::<Algorithm>(&text).expect("it was written so"),
                algorithm,
                "{text}"
            );
        }
    }

    /// Their order is that of the looks in figures, which readers have learned.
    #[test]
    fn algorithms_keep_their_places() {
        let names: Vec<&str> = Algorithm::names().collect();
        let expected = [
            "mcpo",
            "ppo",
            "pretraining",
            "pofd",
            "mmd_il",
            "expert",
            "random",
            "trpo",
            "gail",
            "bc",
            "penalty",
        ];
        assert_eq!(names, expected);
    }

    #[test]
    fn nothing_is_added_under_a_name_that_cannot_be_told_from_another_or_too_late() {
        static CAPITAL: Definition<random::Hyperparameters> = Definition {
            about: About {
                name: "Toy",
                ..random::RANDOM.about
            },
            ..random::RANDOM
        };
        assert_eq!(register(&[&CAPITAL]), Err(RegisterError::Name("Toy")));
        assert_eq!(register(&[&ppo::PPO]), Err(RegisterError::Taken("ppo")));
        all().for_each(drop);
        assert_eq!(register(&[]), Err(RegisterError::Late));
    }
}
