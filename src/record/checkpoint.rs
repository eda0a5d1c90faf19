//! The state from which an interrupted run goes on.
//!
//! A sealed file: a line that names the format and its version, the run's fingerprint, the
//! payload's BLAKE3 digest, the payload (postcard). What does not fit is refused with the reason,
//! and left where it is. A finished run keeps its last one, to go on from when it is to be longer.

use std::path::Path;

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{RecordError, read_bounded, write_atomically};
use crate::train::{EvaluationEpisode, Iteration};

/// The name in a checkpoint's first line.
const NAME: &str = "mcpo-run checkpoint";
/// The version of payloads; raise it when [`Checkpoint`], anything inside `state`, or an agent
/// changes its shape.
const VERSION: u32 = 2;
/// The largest sealed file that is read, bytes.
const LIMIT: u64 = 4 << 30;
const DIGEST: usize = 64; // hexadecimal

/// A run under way; by default one that has not begun.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Training's own state, as [`crate::train::run`] gave it.
    pub state: Vec<u8>,
    /// The iterations so far.
    pub iterations: Vec<Iteration>,
    /// The evaluation episodes so far.
    pub evaluations: Vec<EvaluationEpisode>,
    /// Wall-clock seconds so far.
    pub seconds: f64,
}

impl Checkpoint {
    /// Environment steps so far.
    pub fn env_steps(&self) -> u64 {
        self.iterations.last().map_or(0, |row| row.env_steps)
    }

    /// Writes the checkpoint, whole or not at all.
    ///
    /// # Errors
    ///
    /// The disk refuses; the previous checkpoint is then still there.
    pub fn write(&self, path: &Path, fingerprint: &str) -> Result<(), RecordError> {
        write_sealed(path, NAME, fingerprint, self)
    }

    /// Reads the checkpoint of the run with `fingerprint`; `None` where there is none.
    ///
    /// # Errors
    ///
    /// The checkpoint is of another version or run, or [damaged](RecordError::Damaged). The file is
    /// left alone.
    pub fn read(path: &Path, fingerprint: &str) -> Result<Option<Self>, RecordError> {
        read_sealed(path, NAME, fingerprint)
    }
}

/// Writes `content` after a head of three lines: `name` and version, `written_for`, and the digest.
/// The file is written whole or not at all.
pub(super) fn write_sealed<T: Serialize>(
    path: &Path,
    name: &str,
    written_for: &str,
    content: &T,
) -> Result<(), RecordError> {
    let payload =
        postcard::to_stdvec(content).map_err(|error| malformed(path, error.to_string()))?;
    let digest = blake3::hash(&payload).to_hex();
    let head = format!("{name} {VERSION}\n{written_for}\n{digest}\n");
    write_atomically(path, &[head.as_bytes(), &payload].concat())
}

/// Reads a file of [`write_sealed`] with the same `name` and `written_for`; `None` where there is
/// no such file.
pub(super) fn read_sealed<T: DeserializeOwned>(
    path: &Path,
    name: &str,
    written_for: &str,
) -> Result<Option<T>, RecordError> {
    let Some(bytes) = read_bounded(path, LIMIT)? else {
        return Ok(None);
    };
    unsealed(&bytes, name, written_for)
        .map(Some)
        .map_err(|refusal| match refusal {
            Refusal::Foreign(reason) => malformed(path, reason),
            Refusal::Damaged(reason) => RecordError::Damaged {
                path: path.to_owned(),
                reason,
            },
        })
}

/// Why a sealed file is not used.
enum Refusal {
    /// It belongs to another program or run.
    Foreign(String),
    /// It is of no use to anybody.
    Damaged(String),
}

fn unsealed<T: DeserializeOwned>(
    bytes: &[u8],
    name: &str,
    fingerprint: &str,
) -> Result<T, Refusal> {
    let damaged = |reason: &str| Refusal::Damaged(reason.to_owned());
    let rest = bytes
        .strip_prefix(name.as_bytes())
        .and_then(|rest| rest.strip_prefix(b" "));
    let rest = rest.ok_or_else(|| Refusal::Damaged(format!("it does not begin with `{name}`")))?;
    let (version, rest) = line(rest).map_err(damaged)?;
    if version != VERSION.to_string() {
        let reason =
            format!("it is of version {version}, and this program reads version {VERSION}");
        return Err(Refusal::Foreign(reason));
    }
    let (written_for, rest) = line(rest).map_err(damaged)?;
    let (digest, payload) = line(rest).map_err(damaged)?;
    if digest.len() != DIGEST || digest != blake3::hash(payload).to_hex().as_str() {
        return Err(damaged(
            "its content does not have the digest that it names",
        ));
    }
    if written_for != fingerprint {
        let reason = format!(
            "it was written by a run with fingerprint {written_for}, and this one has {fingerprint}"
        );
        return Err(Refusal::Foreign(reason));
    }
    postcard::from_bytes(payload)
        .map_err(|error| Refusal::Damaged(format!("its content cannot be decoded: {error}")))
}

/// The first line of `bytes` as text, and the bytes after it.
fn line(bytes: &[u8]) -> Result<(&str, &[u8]), &'static str> {
    let end = bytes
        .iter()
        .take(4096)
        .position(|&byte| byte == b'\n')
        .ok_or("it is cut off in its head")?;
    let text = std::str::from_utf8(&bytes[..end]).map_err(|_| "its head is not text")?;
    Ok((text, &bytes[end + 1..]))
}

fn malformed(path: &Path, reason: String) -> RecordError {
    RecordError::Malformed {
        path: path.to_owned(),
        expected: "what this run would go on from",
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::rows::tests::{episode, iteration};

    fn checkpoint() -> Checkpoint {
        Checkpoint {
            state: vec![1, 2, 3],
            iterations: vec![iteration(1), iteration(2)],
            evaluations: vec![episode(0)],
            seconds: 1.5,
        }
    }

    #[test]
    fn damage_and_strangers_are_refused_and_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("checkpoint");
        assert_eq!(
            Checkpoint::read(&path, "f").expect("absence is no error"),
            None
        );
        checkpoint().write(&path, "f").expect("written");
        let whole = std::fs::read(&path).expect("readable");
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).expect("written");
            let message = Checkpoint::read(&path, "f")
                .expect_err("refused")
                .to_string();
            assert_eq!(std::fs::read(&path).expect("kept"), bytes);
            message
        };
        for end in 0..whole.len() {
            refused(&whole[..end]);
        }
        for place in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[place] ^= 1;
            refused(&damaged);
        }
        std::fs::write(&path, &whole).expect("written");
        assert!(
            Checkpoint::read(&path, "g")
                .expect_err("another run")
                .to_string()
                .contains("fingerprint f")
        );
        let newer = [NAME.as_bytes(), b" 3\n", &whole[NAME.len() + 3..]].concat();
        assert!(refused(&newer).contains("version 3"));
    }

    #[test]
    fn a_checkpoint_comes_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("checkpoint");
        checkpoint().write(&path, "f").expect("written");
        let read = Checkpoint::read(&path, "f")
            .expect("readable")
            .expect("there");
        assert_eq!(read, checkpoint());
        assert_eq!(read.env_steps(), 200);
    }
}
