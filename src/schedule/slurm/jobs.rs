//! The jobs of the cluster that a submission has become.

use std::{
    fs::OpenOptions,
    io::Write,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    intake::{self, Links},
    record::{RecordError, io_error, opened_or, read_bounded},
};

/// The size of the largest list of jobs that is read, bytes.
const LIMIT: u64 = 16 << 20;

/// A request to the cluster, one line of `jobs.jsonl`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Asked {
    /// An array of elements.
    Array {
        /// The array's job number in the cluster.
        job: String,
        /// The number, in the submission, of its first element.
        first: usize,
        /// The number of its elements.
        count: usize,
    },
    /// The job that writes the report.
    Collect {
        /// Its job number in the cluster.
        job: String,
    },
    /// The cancellation of these elements.
    Cancel {
        /// Their numbers in the submission.
        elements: Vec<usize>,
    },
}

impl Asked {
    /// The file of requests in the folder of a submission.
    fn path(folder: &Path) -> PathBuf {
        folder.join("jobs.jsonl")
    }

    /// Appends the request to those of the submission in `folder`.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn add(&self, folder: &Path) -> Result<(), RecordError> {
        let path = Self::path(folder);
        let mut line =
            serde_json::to_vec(self).map_err(|error| io_error("write", &path)(error.into()))?;
        line.push(b'\n');
        let options = OpenOptions::new().append(true).create(true).clone();
        let mut file =
            intake::open(&path, Links::Refuse, &options).map_err(opened_or(&path, "write"))?;
        file.write_all(&line)
            .and_then(|()| file.sync_all())
            .map_err(io_error("write", &path))
    }

    /// All requests of the submission in `folder`, in order. A line cut off by a crash is ignored:
    /// its elements are sent again, and continue what the first ones did.
    ///
    /// # Errors
    ///
    /// The system refuses.
    pub fn read(folder: &Path) -> Result<Vec<Self>, RecordError> {
        let bytes = read_bounded(&Self::path(folder), LIMIT)?.unwrap_or_default();
        Ok(bytes
            .split(|&byte| byte == b'\n')
            .filter_map(|line| serde_json::from_slice(line).ok())
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_asked_comes_back_but_for_half_a_line() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(Asked::read(folder.path()).expect("absence is no error"), []);
        let asked = [
            Asked::Array {
                job: "12".to_owned(),
                first: 0,
                count: 1000,
            },
            Asked::Collect {
                job: "13".to_owned(),
            },
            Asked::Cancel {
                elements: vec![3, 5],
            },
        ];
        asked
            .iter()
            .for_each(|asked| asked.add(folder.path()).expect("written"));
        assert_eq!(Asked::read(folder.path()).expect("there"), asked);
        let path = Asked::path(folder.path());
        let whole = std::fs::read(&path).expect("there");
        std::fs::write(&path, &whole[..whole.len() - 5]).expect("written");
        assert_eq!(Asked::read(folder.path()).expect("there"), asked[..2]);
    }
}
