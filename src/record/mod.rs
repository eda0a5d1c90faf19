//! The files that runs leave on the disk, and how they are read back.
//!
//! Owns the layout of the results, the Parquet rows, policies, manifests, checkpoints and claims,
//! and the rule that every final file is written beside its place, synced and renamed into it.
//! Knows nothing of queues, processes or figures: it is told what happened. Start at [`RunPaths`],
//! then [`rows`] and [`Manifest`].

pub mod checkpoint;
mod claim;
pub mod compare;
mod executable;
mod heartbeat;
mod manifest;
mod owner;
mod paths;
pub mod policy;
pub mod pretrained;
mod provenance;
mod repository;
pub mod rows;
mod under_way;

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

pub use checkpoint::Checkpoint;
pub use claim::Claim;
pub use executable::Executable;
pub use heartbeat::Heartbeat;
pub use manifest::{Attempt, Manifest, Outcome, TableDigests};
pub use owner::Owner;
pub use paths::{RunPaths, check_writable, experiment_folder};
pub use provenance::{Build, Demonstrated, Origin, Stamp, cpu_class, now};
pub use repository::Git;
pub use under_way::UnderWay;

use crate::intake::{self, Links};
use policy::PolicyError;
use rows::TableError;

/// The beginning of the names of files that are not yet in their place.
const WRITING: &str = ".writing-";

/// Errors of writing or reading results; the message names the file.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}{}", path.display(), hint(source))]
    Io {
        /// The action that failed, as a verb.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Another machine took this process for dead.
    #[error("{} is another process's now: this one stood still for too long", path.display())]
    Lost {
        /// The run's folder.
        path: PathBuf,
    },
    /// A name that would not stay in its folder.
    #[error("`{name}` cannot name a folder of results: {reason}")]
    Name {
        /// The name as it was given.
        name: String,
        /// The reason against it.
        reason: &'static str,
    },
    /// The file is of the right kind but damaged: its content is lost.
    #[error("{} is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The evidence of the damage.
        reason: String,
    },
    /// The file is no table of results.
    #[error("{} is not a table of results: {source}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// The mistake in it.
        source: TableError,
    },
    /// The file is no saved policy.
    #[error("{} is not a saved policy: {source}", path.display())]
    Policy {
        /// The file.
        path: PathBuf,
        /// The mistake in it.
        source: PolicyError,
    },
    /// The file is there but of the wrong kind.
    #[error("{} is not {expected}: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The kind of file that was expected.
        expected: &'static str,
        /// The mistake in it.
        reason: String,
    },
}

/// Advice about the commonest refusals.
fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull => {
            "; free some space and run again: what is recorded is kept, and runs resume from their checkpoints"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "; make it writable or name another folder with --results"
        }
        _ => "",
    }
}

/// Turns an [`io::Error`] into a [`RecordError`] with the action and the file.
pub(crate) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RecordError {
    let path = path.to_owned();
    move |source| RecordError::Io {
        action,
        path,
        source,
    }
}

/// Writes a file whole or not at all: beside its place, synced, renamed. Whoever reads `path` at
/// any instant, after a power cut too, finds the old content or the new.
///
/// # Errors
///
/// The folder is missing, full or not writable; `path` is then as it was.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), RecordError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut file = beside(folder).map_err(io_error("write", path))?;
    file.write_all(bytes)
        .and_then(|()| file.as_file().sync_all())
        .map_err(io_error("write", path))?;
    file.persist(path)
        .map_err(|error| io_error("write", path)(error.error))?;
    sync_folder(folder)
}

/// An unnamed file in `folder`, readable as the user's other files are (a bare temporary file is
/// its owner's alone).
fn beside(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(WRITING);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666)); // less the umask
    }
    builder.tempfile_in(folder)
}

/// Makes the names in `folder` outlive a power cut.
pub(crate) fn sync_folder(folder: &Path) -> Result<(), RecordError> {
    File::open(folder)
        .and_then(|file| file.sync_all())
        .map_err(io_error("sync", folder))
}

/// Renames `from` to `to` and makes the change outlive a power cut.
pub(crate) fn rename(from: &Path, to: &Path) -> Result<(), RecordError> {
    fs::rename(from, to).map_err(io_error("rename", from))?;
    to.parent().map_or(Ok(()), sync_folder)
}

/// The content of a regular file of at most `limit` bytes; `None` where there is no such file.
///
/// # Errors
///
/// It is a link, a pipe or the like, or longer, or the system refuses.
pub(crate) fn read_bounded(path: &Path, limit: u64) -> Result<Option<Vec<u8>>, RecordError> {
    match intake::read(path, Links::Refuse, limit) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(opened_or(path, "read")(error)),
    }
}

/// Turns an error of [`intake`] into ours: a file that we refuse is no fault of the system.
pub(crate) fn opened_or(
    path: &Path,
    action: &'static str,
) -> impl FnOnce(io::Error) -> RecordError {
    let path = path.to_owned();
    move |source| match source.kind() {
        io::ErrorKind::InvalidInput => RecordError::Malformed {
            path,
            expected: "a file of this program",
            reason: source.to_string(),
        },
        _ => RecordError::Io {
            action,
            path,
            source,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_that_fails_leaves_the_old_content_and_nothing_beside_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("missing").join("file");
        assert!(
            write_atomically(&missing, b"new")
                .expect_err("no folder")
                .to_string()
                .contains("missing")
        );
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).expect("a folder in the way");
        assert!(write_atomically(&taken, b"new").is_err());
        assert_eq!(
            fs::read_dir(folder.path()).expect("readable").count(),
            1,
            "a temporary file was left"
        );
    }

    #[test]
    fn a_write_replaces_what_was_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        write_atomically(&path, b"old").expect("written");
        write_atomically(&path, b"new").expect("written");
        assert_eq!(
            read_bounded(&path, 10).expect("readable"),
            Some(b"new".to_vec())
        );
        assert!(read_bounded(&path, 2).is_err(), "the limit was not kept");
        assert_eq!(
            read_bounded(&folder.path().join("none"), 2).expect("absence is no error"),
            None
        );
    }
}
