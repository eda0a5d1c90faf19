//! Demonstrations from other programs: the authors' pickles, Parquet with other names, `.npz`
//! archives.
//!
//! Owns the forms of those files and what they lack of a demonstration. Executes nothing that a
//! file says, and trusts none of the sizes in it. Start at [`import`].

mod arrays;
mod assemble;
mod episodes;
mod error;
mod npz;
mod pickle;
mod returns;
mod rlframe;
mod table;

use std::{io::Read, path::Path};

pub use error::{ArraysError, EpisodesError, ImportError, UnfoldError};
pub use npz::{MemberError, NpzError};
pub use pickle::PickleError;
pub use returns::recomputed_rewards;
pub use rlframe::TrajectoryError;

use super::{
    DemoError, Demonstration, Mismatch, ReadError,
    motion::{self, Mover},
    parquet::{read_bounded, unreadable},
};
use crate::{env::EnvId, parquet::MAX_NUMBERS};

/// The most bytes that a compressed file may unfold to.
const MAX_UNFOLDED: usize = 1 << 27;

/// The most names that a message lists from a file.
const NAMES: usize = 10;

/// A demonstration from elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The demonstration that was read.
    pub demonstration: Demonstration,
    /// Quantities that the file lacked or that could not be recovered, each in a sentence.
    pub losses: Vec<String>,
    /// Reasons why it may be another demonstration than was meant, each in a sentence.
    pub warnings: Vec<String>,
}

/// Reads `path`, whose kind its first bytes tell, as a demonstration of `env`:
///
/// - a pickle of the authors' code, compressed by bzip2 or not: one or several trajectories of
///   filtered states and raw actions, with the filter's state;
/// - Parquet, in this crate's format or with columns or lists named `observations`, `obs`,
///   `actions`, `acts`, `rewards`, `terminals`, `timeouts`, `episode_index`, `is_first` and the
///   like;
/// - `.npz`, with arrays of those names, as Stable Baselines, the `imitation` library and D4RL
///   dumps have them.
///
/// # Errors
///
/// The file is none of these, damaged, or of another environment; arrays do not fit each other; an
/// episode is longer than `env` allows.
pub fn import(path: &Path, env: EnvId) -> Result<Imported, DemoError> {
    let mut imported = read(path, env).map_err(unreadable(path))?;
    let Imported {
        demonstration,
        losses,
        warnings,
    } = &mut imported;
    demonstration.check(path, env)?;
    lengths_are_possible(demonstration, env).map_err(|source| DemoError::Misfit {
        path: path.to_owned(),
        env,
        source,
    })?;
    let label = demonstration.label().filter(|label| *label != env.name());
    warnings.extend(label.and_then(|label| of_another_version(label, env)));
    let failed = |source| DemoError::Environment {
        path: path.to_owned(),
        source,
    };
    // Scaled observations have the right lengths; only their motion gives them away.
    if motion::mover(demonstration, env).map_err(failed)? == Mover::Unknown {
        warnings.push(format!(
            "its observations do not move like those of {env}: they may be scaled, or from another robot"
        ));
    } else {
        warnings.extend(jump(&motion::jumps(demonstration, env).map_err(failed)?));
    }
    let provenance = &mut demonstration.provenance;
    // The file may spell the environment's name in another way.
    provenance.retain(|(key, _)| key != "env");
    provenance.insert(0, ("env".into(), env.name().into()));
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    provenance.push(("imported_from".into(), name.unwrap_or_default()));
    provenance.extend(
        losses
            .iter()
            .enumerate()
            .map(|(i, loss)| (format!("loss_{}", i + 1), loss.clone())),
    );
    provenance.extend(
        warnings
            .iter()
            .enumerate()
            .map(|(i, warning)| (format!("warning_{}", i + 1), warning.clone())),
    );
    Ok(imported)
}

/// The demonstration of `env` in the file `path`.
fn read(path: &Path, env: EnvId) -> Result<Imported, ReadError> {
    let imported = from_bytes(read_bounded(path)?, env)?;
    imported.demonstration.is_sound()?;
    Ok(imported)
}

/// The warning about a file whose `label` is not quite that of `env`.
fn of_another_version(label: &str, env: EnvId) -> Option<String> {
    let Some((_, version)) = EnvId::of_label(label) else {
        return Some(format!(
            "the file says that it is from `{}`, which is not known",
            label.escape_debug()
        ));
    };
    let difference = env.differs_in(version?)?;
    Some(format!(
        "the file says that it is from `{}`: {difference}",
        label.escape_debug()
    ))
}

/// Checks that no episode is longer than `env` allows.
fn lengths_are_possible(demonstration: &Demonstration, env: EnvId) -> Result<(), Mismatch> {
    let limit = env.max_steps();
    let lengths = demonstration.episodes().map(|steps| steps.len());
    match lengths.enumerate().find(|(_, steps)| *steps as u64 > limit) {
        Some((episode, steps)) => Err(Mismatch::TooLong {
            episode,
            steps,
            limit,
        }),
        None => Ok(()),
    }
}

/// The warning about observations that jump after `steps`.
fn jump(steps: &[usize]) -> Option<String> {
    let (first, places) = (steps.first()?, steps.len());
    let more = if places > 1 {
        format!(" and in {} other places", places - 1)
    } else {
        String::new()
    };
    Some(format!(
        "between rows {first} and {}{more} the observation jumps as no physics does: episodes may be joined there",
        first + 1
    ))
}

/// The demonstration in the bytes of a file.
fn from_bytes(file: Vec<u8>, env: EnvId) -> Result<Imported, ImportError> {
    if file.starts_with(b"BZh") {
        let unfolded = unfold(bzip2::read::MultiBzDecoder::new(file.as_slice()))
            .map_err(ImportError::Bzip2)?;
        Ok(rlframe::read(&unfolded, env)?)
    } else if file.starts_with(b"\x80") {
        Ok(rlframe::read(&file, env)?)
    } else if file.starts_with(b"PAR1") {
        table::read(file, env)
    } else if file.starts_with(b"PK") {
        npz::read(&file, env)
    } else {
        Err(ImportError::UnknownKind)
    }
}

/// Everything that `reader` gives, unless that is too much.
fn unfold(reader: impl Read) -> Result<Vec<u8>, UnfoldError> {
    let mut bytes = Vec::new();
    reader
        .take(MAX_UNFOLDED as u64 + 1)
        .read_to_end(&mut bytes)?;
    if bytes.len() > MAX_UNFOLDED {
        return Err(UnfoldError::TooLarge);
    }
    Ok(bytes)
}

/// Marks the ends that a source does not tell: an episode as long as `env` allows counts as cut, a
/// shorter one as terminated.
fn infer_ends(demonstration: &mut Demonstration, env: EnvId, losses: &mut Vec<String>) {
    let ends: Vec<_> = demonstration
        .episodes()
        .map(|steps| (steps.len() as u64, steps.end - 1))
        .collect();
    for (length, last) in ends {
        let whole = length >= env.max_steps();
        (
            demonstration.terminated[last],
            demonstration.truncated[last],
        ) = (!whole, whole);
    }
    losses.push(format!(
        "how episodes ended is not recorded; those shorter than {} steps are taken as terminated",
        env.max_steps()
    ));
}

#[cfg(test)]
mod tests;
