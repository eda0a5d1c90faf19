//! Demonstrations from elsewhere: the authors' pickles, Parquet with other names, `.npz` archives.
//!
//! Owns what those files look like and what of a demonstration they do not hold. Runs nothing that a file says and
//! believes none of its sizes. Start at [`import`].

mod arrays;
mod npz;
mod pickle;
mod returns;
mod rlframe;
mod table;

use std::{io::Read, path::Path};

pub use returns::recomputed_rewards;

use super::{
    DemoError, Demonstration,
    parquet::{MAX_NUMBERS, read_bounded},
};
use crate::env::EnvId;

/// The most bytes that a compressed file may unfold to.
const MAX_UNFOLDED: usize = 1 << 28;

/// A demonstration from elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// What was read.
    pub demonstration: Demonstration,
    /// What the file did not hold, or what could not be recovered, each in a sentence.
    pub losses: Vec<String>,
}

/// Reads `path`, whose kind its first bytes tell, as a demonstration of `env`:
///
/// - a pickle of the authors' code, compressed by bzip2 or not: one or several trajectories of filtered states and raw
///   actions, with the filter's state;
/// - Parquet, in this crate's format or with columns or lists named `observations`, `obs`, `actions`, `acts`, `rewards`,
///   `terminals`, `timeouts` and the like;
/// - `.npz`, with arrays of those names, as the `imitation` library and D4RL dumps have them.
///
/// Errors: the file is none of these, damaged, or of another environment.
pub fn import(path: &Path, env: EnvId) -> Result<Imported, DemoError> {
    let unreadable = |reason: String| DemoError::Unreadable { path: path.to_owned(), reason };
    let file = read_bounded(path).map_err(unreadable)?;
    let (mut imported, made_for) = from_bytes(file, env).map_err(unreadable)?;
    if let Some(other) = made_for.filter(|&other| other != env) {
        let reason = format!("the file says that it is of {other}");
        return Err(DemoError::Misfit { path: path.to_owned(), env, reason });
    }
    if let Some(flaw) = imported.demonstration.flaw() {
        return Err(unreadable(flaw));
    }
    imported.demonstration.check(path, env)?;
    let provenance = &mut imported.demonstration.provenance;
    provenance.retain(|(key, _)| key != "env");
    provenance.insert(0, ("env".into(), env.name().into()));
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    provenance.push(("imported_from".into(), name.unwrap_or_default()));
    provenance.extend(imported.losses.iter().enumerate().map(|(i, loss)| (format!("loss_{}", i + 1), loss.clone())));
    Ok(imported)
}

/// What the bytes hold, and which environment they say it is of.
fn from_bytes(file: Vec<u8>, env: EnvId) -> Result<(Imported, Option<EnvId>), String> {
    if file.starts_with(b"BZh") {
        let unfolded = unfold(bzip2::read::MultiBzDecoder::new(file.as_slice()))
            .map_err(|reason| format!("it is damaged where it was compressed by bzip2: {reason}"))?;
        rlframe::read(&unfolded, env)
    } else if file.starts_with(b"\x80") {
        rlframe::read(&file, env)
    } else if file.starts_with(b"PAR1") {
        table::read(file, env).map(|imported| (imported, None))
    } else if file.starts_with(b"PK") {
        npz::read(&file, env).map(|imported| (imported, None))
    } else {
        Err("it is none of a pickle (compressed by bzip2 or not), Parquet and .npz".into())
    }
}

/// Everything that `reader` gives, if it is not too much.
fn unfold(reader: impl Read) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    reader.take(MAX_UNFOLDED as u64 + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() > MAX_UNFOLDED {
        return Err(format!("it unfolds to more than {} MiB", MAX_UNFOLDED >> 20));
    }
    Ok(bytes)
}

/// Marks the ends that a source does not tell: an episode as long as `env` allows was cut, a shorter one terminated.
fn infer_ends(demonstration: &mut Demonstration, env: EnvId, losses: &mut Vec<String>) {
    let ends: Vec<_> = demonstration.episodes().map(|steps| (steps.len() as u64, steps.end - 1)).collect();
    for (length, last) in ends {
        let whole = length >= env.max_steps();
        (demonstration.terminated[last], demonstration.truncated[last]) = (!whole, whole);
    }
    losses.push(format!(
        "how episodes ended is not recorded; shorter than {} steps is taken as terminated",
        env.max_steps()
    ));
}

#[cfg(test)]
mod tests;
