//! `run.json`: a run's specification, and what became of it.

use std::{collections::BTreeSet, path::Path};

use serde::{Deserialize, Serialize};

use super::{Build, RecordError, RunPaths, Stamp, now, read_bounded, rows, write_atomically};

/// The largest `run.json` that is read, bytes.
const LIMIT: u64 = 16 << 20;

/// The content of `run.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// The origin of the run, as of its last attempt.
    pub stamp: Stamp,
    /// Every attempt of a process at the run, in order.
    pub attempts: Vec<Attempt>,
    /// Environment steps that were trained.
    pub env_steps: u64,
    /// Wall-clock seconds of training and evaluation, over the attempts whose work counts.
    pub seconds: f64,
    /// The digest of the policy at the end of training; absent before, and where there is none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub policy: Option<String>,
    /// The digests of the tables of a finished run; absent before, and in files of older programs.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub tables: Option<TableDigests>,
    /// The outcome of the run.
    pub outcome: Outcome,
}

/// BLAKE3 of a run's tables, by which damage is seen before anybody reads them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableDigests {
    /// The digest of `progress.parquet`.
    pub progress: String,
    /// The digest of `evaluations.parquet`.
    pub evaluations: String,
}

impl TableDigests {
    /// The digests of the tables in `folder`.
    ///
    /// # Errors
    ///
    /// A table is missing or cannot be read.
    pub fn of(folder: &Path) -> Result<Self, RecordError> {
        let digest = |path: &Path| {
            let bytes = read_bounded(path, rows::LIMIT)?;
            let absent = || RecordError::Damaged {
                path: path.to_owned(),
                reason: "it is missing".to_owned(),
            };
            Ok(blake3::hash(&bytes.ok_or_else(absent)?)
                .to_hex()
                .to_string())
        };
        Ok(Self {
            progress: digest(&RunPaths::progress(folder))?,
            evaluations: digest(&RunPaths::evaluations(folder))?,
        })
    }
}

/// One process's work on a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// When it began, UTC (RFC 3339).
    pub began: String,
    /// When it ended; absent while it goes on, and forever if its process was killed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ended: Option<String>,
    /// The machine's name.
    pub host: String,
    /// The process's number.
    pub process: u32,
    /// The environment steps of the checkpoint that it started from; 0 if it began anew.
    pub from_env_steps: u64,
    /// The [`cpu_class`](Build::cpu_class) that computed it; empty in files of older programs.
    #[serde(default)]
    pub cpu_class: String,
    /// The [`libm`](Build::libm) that computed it; empty in files of older programs.
    #[serde(default)]
    pub libm: String,
    /// The error that ended it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error: Option<String>,
}

/// The outcome of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The run has begun, and has not ended.
    Begun,
    /// The run used its budget.
    Finished,
    /// The run ended in an error.
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
        Self {
            stamp,
            attempts: Vec::new(),
            env_steps: 0,
            seconds: 0.0,
            policy: None,
            tables: None,
            outcome: Outcome::Begun,
        }
    }

    /// The same run, resumed by the program of `stamp`.
    pub fn taken_up(self, stamp: Stamp) -> Self {
        Self {
            stamp,
            policy: None,
            tables: None,
            outcome: Outcome::Begun,
            ..self
        }
    }

    /// Reads `run.json`; `None` where there is none.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a manifest.
    pub fn read(path: &Path) -> Result<Option<Self>, RecordError> {
        let Some(bytes) = read_bounded(path, LIMIT)? else {
            return Ok(None);
        };
        let manifest = serde_json::from_slice(&bytes).map_err(|error| RecordError::Malformed {
            path: path.to_owned(),
            expected: "a run's manifest",
            reason: error.to_string(),
        })?;
        Ok(Some(manifest))
    }

    /// Writes the manifest, whole or not at all.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), RecordError> {
        let mut bytes =
            serde_json::to_vec_pretty(self).map_err(|error| RecordError::Malformed {
                path: path.to_owned(),
                expected: "a run's manifest",
                reason: error.to_string(),
            })?;
        bytes.push(b'\n');
        write_atomically(path, &bytes)
    }

    /// Ends the attempt under way, with its error, if it had one.
    pub fn end_attempt(&mut self, error: Option<String>) {
        if let Some(attempt) = self
            .attempts
            .last_mut()
            .filter(|attempt| attempt.ended.is_none())
        {
            attempt.ended = Some(now());
            attempt.error = error;
        }
    }

    /// # Errors
    ///
    /// A table of this finished run in `folder` is missing or not what was recorded; nothing is
    /// known of those that an older program wrote.
    pub fn check_tables(&self, folder: &Path) -> Result<(), RecordError> {
        let Some(recorded) = &self.tables else {
            return Ok(());
        };
        let found = TableDigests::of(folder)?;
        let damaged = |path| RecordError::Damaged {
            path,
            reason: "it is not what was recorded".to_owned(),
        };
        if found.progress != recorded.progress {
            return Err(damaged(RunPaths::progress(folder)));
        }
        if found.evaluations != recorded.evaluations {
            return Err(damaged(RunPaths::evaluations(folder)));
        }
        Ok(())
    }

    /// Whether the whole run was computed on the class of machine that `stamp` names.
    /// A run that was resumed on another class has bits that no machine repeats.
    /// Attempts whose work was lost do not count.
    pub fn is_of_one_class(&self) -> bool {
        let counts = |index: usize| {
            let next = self.attempts.get(index + 1);
            next.is_none_or(|next| next.from_env_steps > self.attempts[index].from_env_steps)
        };
        let Build {
            cpu_class, libm, ..
        } = &self.stamp.build;
        let known = self
            .attempts
            .iter()
            .enumerate()
            .filter(|(index, attempt)| counts(*index) && !attempt.libm.is_empty());
        let classes: BTreeSet<_> = known
            .map(|(_, attempt)| (&attempt.cpu_class, &attempt.libm))
            .collect();
        classes.iter().all(|class| *class == (cpu_class, libm))
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
            origin: Some(Origin::current(std::path::Path::new("results"))),
        })
    }

    #[test]
    fn a_damaged_manifest_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.json");
        assert_eq!(Manifest::read(&path).expect("absence is no error"), None);
        std::fs::write(&path, "{\"outcome\":").expect("written");
        assert!(
            Manifest::read(&path)
                .expect_err("half a file")
                .to_string()
                .contains("run.json")
        );
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
            cpu_class: "x86_64".to_owned(),
            libm: "a".to_owned(),
            error: None,
        });
        manifest.end_attempt(Some("diverged".to_owned()));
        manifest.end_attempt(Some("ended before".to_owned()));
        manifest.outcome = Outcome::Failed {
            error: "diverged".to_owned(),
            log_tail: vec!["last".to_owned()],
        };
        manifest.write(&path).expect("written");
        let read = Manifest::read(&path).expect("readable").expect("there");
        assert_eq!(read, manifest);
        assert_eq!(read.attempts[0].error.as_deref(), Some("diverged"));
        assert_eq!(read.error(), Some("diverged"));
    }

    #[test]
    fn a_run_that_two_classes_computed_is_not_of_one() {
        let mut manifest = manifest();
        let Build {
            cpu_class, libm, ..
        } = manifest.stamp.build.clone();
        let mut attempt = |from_env_steps, cpu_class: &str| {
            manifest.attempts.push(Attempt {
                began: now(),
                ended: None,
                host: "here".to_owned(),
                process: 7,
                from_env_steps,
                cpu_class: cpu_class.to_owned(),
                libm: libm.clone(),
                error: None,
            });
            manifest.is_of_one_class()
        };
        assert!(!attempt(0, "sparc64"));
        assert!(attempt(0, &cpu_class), "the work on the other one was lost");
        assert!(attempt(512, &cpu_class));
        assert!(
            !attempt(512, "sparc64") && !attempt(1024, &cpu_class),
            "its work counts"
        );
    }

    #[test]
    fn a_table_that_is_not_the_recorded_one_is_damage() {
        let folder = tempfile::tempdir().expect("a folder");
        let (progress, evaluations) = (
            RunPaths::progress(folder.path()),
            RunPaths::evaluations(folder.path()),
        );
        std::fs::write(&progress, "rows").expect("written");
        assert!(
            TableDigests::of(folder.path())
                .expect_err("half")
                .to_string()
                .contains("evaluations.parquet")
        );
        std::fs::write(&evaluations, "episodes").expect("written");
        let tables = TableDigests::of(folder.path()).expect("both are there");
        let manifest = Manifest {
            tables: Some(tables),
            ..manifest()
        };
        assert!(manifest.check_tables(folder.path()).is_ok());
        for (path, whole) in [(progress, "rows"), (evaluations, "episodes")] {
            std::fs::write(&path, "other").expect("written");
            let error = manifest
                .check_tables(folder.path())
                .expect_err("another table");
            assert!(
                error.to_string().contains(&path.display().to_string()),
                "{error}"
            );
            std::fs::remove_file(&path).expect("there");
            assert!(manifest.check_tables(folder.path()).is_err());
            std::fs::write(&path, whole).expect("written");
        }
    }
}
