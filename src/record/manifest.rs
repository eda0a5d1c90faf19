//! `run.json`: what a run was to be, and what became of it.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{RecordError, Stamp, now, read_bounded, write_atomically};

/// The largest `run.json` that is read, bytes.
const LIMIT: u64 = 16 << 20;

/// `run.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Where the run comes from; of its last attempt.
    pub stamp: Stamp,
    /// Every time a process took the run up, in order.
    pub attempts: Vec<Attempt>,
    /// Environment steps that were trained.
    pub env_steps: u64,
    /// Wall-clock seconds of training and evaluation, over the attempts whose work counts.
    pub seconds: f64,
    /// The digest of the policy at the end of training; absent before, and where there is none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub policy: Option<String>,
    /// What became of the run.
    pub outcome: Outcome,
}

/// One process's work on a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// When it began, UTC (RFC 3339).
    pub began: String,
    /// When it ended; absent while it goes on, and for ever when its process was killed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ended: Option<String>,
    /// The machine.
    pub host: String,
    /// The process.
    pub process: u32,
    /// The environment steps of the checkpoint that it went on from; 0 when it began anew.
    pub from_env_steps: u64,
    /// What it died of.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<String>,
}

/// What became of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It has begun, and has not ended.
    Begun,
    /// It used its budget.
    Finished,
    /// It ended in an error.
    Failed {
        /// The cause, in a sentence.
        error: String,
        /// The last lines of its log and of what its process wrote to stderr.
        log_tail: Vec<String>,
    },
}

impl Manifest {
    /// A run that begins now.
    pub fn new(stamp: Stamp) -> Self {
        Self { stamp, attempts: Vec::new(), env_steps: 0, seconds: 0.0, policy: None, outcome: Outcome::Begun }
    }

    /// Reads `run.json`; `None` where there is none.
    ///
    /// Errors: it is there and cannot be read, or is not a manifest.
    pub fn read(path: &Path) -> Result<Option<Self>, RecordError> {
        let Some(bytes) = read_bounded(path, LIMIT)? else { return Ok(None) };
        let manifest = serde_json::from_slice(&bytes).map_err(|error| RecordError::Malformed {
            path: path.to_owned(),
            expected: "a run's manifest",
            reason: error.to_string(),
        })?;
        Ok(Some(manifest))
    }

    /// Writes it, whole or not at all.
    ///
    /// Errors: the disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), RecordError> {
        let mut bytes = serde_json::to_vec_pretty(self).map_err(|error| RecordError::Malformed {
            path: path.to_owned(),
            expected: "a run's manifest",
            reason: error.to_string(),
        })?;
        bytes.push(b'\n');
        write_atomically(path, &bytes)
    }

    /// Ends the attempt under way, with what it died of, if it did.
    pub fn end_attempt(&mut self, error: Option<String>) {
        if let Some(attempt) = self.attempts.last_mut().filter(|attempt| attempt.ended.is_none()) {
            attempt.ended = Some(now());
            attempt.error = error;
        }
    }

    /// The error of a run that failed.
    pub fn error(&self) -> Option<&str> {
        match &self.outcome {
            Outcome::Failed { error, .. } => Some(error),
            Outcome::Begun | Outcome::Finished => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Build, Origin};

    fn manifest() -> Manifest {
        let build = Build::current(serde_json::json!({ "mujoco": "3.17.0" }));
        let spec = serde_json::json!({ "id": "a/b" });
        Manifest::new(Stamp {
            spec,
            fingerprint: "f".to_owned(),
            demonstration: None,
            demonstrated: None,
            build,
            origin: Some(Origin::current()),
        })
    }

    #[test]
    fn a_damaged_manifest_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.json");
        assert_eq!(Manifest::read(&path).expect("absence is no error"), None);
        std::fs::write(&path, "{\"outcome\":").expect("written");
        assert!(Manifest::read(&path).expect_err("half a file").to_string().contains("run.json"));
    }

    #[test]
    fn a_manifest_comes_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.json");
        let mut manifest = manifest();
        manifest.attempts.push(Attempt {
            began: now(),
            ended: None,
            host: "here".to_owned(),
            process: 7,
            from_env_steps: 0,
            error: None,
        });
        manifest.end_attempt(Some("diverged".to_owned()));
        manifest.end_attempt(Some("ended before".to_owned()));
        manifest.outcome = Outcome::Failed { error: "diverged".to_owned(), log_tail: vec!["last".to_owned()] };
        manifest.write(&path).expect("written");
        let read = Manifest::read(&path).expect("readable").expect("there");
        assert_eq!(read, manifest);
        assert_eq!(read.attempts[0].error.as_deref(), Some("diverged"));
        assert_eq!(read.error(), Some("diverged"));
    }
}
