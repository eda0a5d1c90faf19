//! A running run's sign of life, for `mcpo-run status` in another terminal.

use std::{fs::OpenOptions, io::Write, path::Path};

use serde::{Deserialize, Serialize};

use super::{RecordError, io_error, opened_or, read_bounded};
use crate::intake::{self, Links};

/// The progress of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Heartbeat {
    /// Steps taken.
    pub env_steps: u64,
    /// Steps per second since this attempt began.
    pub steps_per_second: f64,
    /// Mean training return of the last iteration whose rollout ended an episode.
    pub training_return: Option<f64>,
    /// When this was written, UTC (RFC 3339).
    pub written: String,
}

impl Heartbeat {
    /// Writes the heartbeat. It is neither synced nor renamed: it is worth nothing after a power
    /// cut, and a half-written one counts as absent.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), RecordError> {
        let text =
            serde_json::to_vec(self).map_err(|error| io_error("write", path)(error.into()))?;
        let options = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .clone();
        let mut file =
            intake::open(path, Links::Refuse, &options).map_err(opened_or(path, "write"))?;
        file.write_all(&text).map_err(io_error("write", path))
    }

    /// The last heartbeat; `None` where there is none that can be read.
    pub fn read(path: &Path) -> Option<Self> {
        serde_json::from_slice(&read_bounded(path, 1 << 16).ok()??).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_link_in_its_place_leaves_the_other_file_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, other) = (
            folder.path().join("heartbeat.json"),
            folder.path().join("other"),
        );
        std::fs::write(&other, "somebody's").expect("written");
        std::os::unix::fs::symlink(&other, &path).expect("linked");
        let heartbeat = Heartbeat {
            env_steps: 5,
            steps_per_second: 2.0,
            training_return: None,
            written: super::super::now(),
        };
        assert!(heartbeat.write(&path).is_err());
        assert_eq!(
            std::fs::read_to_string(&other).expect("readable"),
            "somebody's"
        );
    }

    #[test]
    fn half_a_heartbeat_counts_as_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("heartbeat.json");
        let heartbeat = Heartbeat {
            env_steps: 5,
            steps_per_second: 2.0,
            training_return: None,
            written: super::super::now(),
        };
        assert_eq!(Heartbeat::read(&path), None);
        heartbeat.write(&path).expect("written");
        assert_eq!(Heartbeat::read(&path), Some(heartbeat));
        let text = std::fs::read(&path).expect("readable");
        std::fs::write(&path, &text[..text.len() / 2]).expect("cut");
        assert_eq!(Heartbeat::read(&path), None);
    }
}
