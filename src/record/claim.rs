//! The claim on a run: who holds it may write to the run's folder.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io, thread,
    time::Duration,
};

use super::{RecordError, RunPaths, io_error, opened_or};
use crate::intake::{self, Links};

/// How often a claim is tried for, and the pause between: whoever asks whether it is held holds it for a moment.
const TRIES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(50);

/// A lock on a run, held until it is dropped or its process ends, however it ends.
#[derive(Debug)]
pub struct Claim {
    _file: File,
}

impl Claim {
    /// Claims a run; `None` when somebody else holds it, and goes on to for a second.
    ///
    /// Errors: the file of the lock cannot be made.
    pub fn take(paths: &RunPaths) -> Result<Option<Self>, RecordError> {
        let refused = |source| io_error("claim", &paths.claim)(source);
        if let Some(folder) = paths.claim.parent() {
            fs::create_dir_all(folder).map_err(refused)?;
        }
        // What the file holds is left alone: it may be another's that was put here under this name.
        let options = OpenOptions::new().write(true).create(true).truncate(false).clone();
        let file = intake::open(&paths.claim, Links::Refuse, &options).map_err(opened_or(&paths.claim, "claim"))?;
        for left in (0..TRIES).rev() {
            match file.try_lock() {
                Ok(()) => return Ok(Some(Self { _file: file })),
                Err(TryLockError::WouldBlock) if left > 0 => thread::sleep(PAUSE),
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(source)) => return Err(refused(source)),
            }
        }
        Ok(None)
    }

    /// Whether somebody holds the claim; takes none and writes nothing.
    ///
    /// Errors: the file of the lock is there and cannot be read.
    pub fn is_held(paths: &RunPaths) -> Result<bool, RecordError> {
        let file = match intake::open(&paths.claim, Links::Refuse, OpenOptions::new().read(true)) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(opened_or(&paths.claim, "read")(error)),
        };
        match file.try_lock_shared() {
            Ok(()) => Ok(false),
            Err(TryLockError::WouldBlock) => Ok(true),
            Err(TryLockError::Error(source)) => Err(io_error("read", &paths.claim)(source)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_holds_others_off_until_it_is_dropped() {
        let folder = tempfile::tempdir().expect("a folder");
        let paths = RunPaths::new(folder.path(), "e", "a/seed-0").expect("a good id");
        assert!(!Claim::is_held(&paths).expect("no file is no claim"));
        let claim = Claim::take(&paths).expect("made").expect("free");
        assert!(Claim::take(&paths).expect("no error").is_none(), "claimed twice");
        assert!(Claim::is_held(&paths).expect("readable"));
        drop(claim);
        assert!(!Claim::is_held(&paths).expect("readable"));
        assert!(Claim::take(&paths).expect("no error").is_some());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_the_claims_place_leaves_the_other_file_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let paths = RunPaths::new(folder.path(), "e", "a/seed-0").expect("a good id");
        let other = folder.path().join("other");
        fs::write(&other, "somebody's").expect("written");
        fs::create_dir_all(paths.claim.parent().expect("a folder")).expect("made");
        std::os::unix::fs::symlink(&other, &paths.claim).expect("linked");
        assert!(Claim::take(&paths).is_err() && Claim::is_held(&paths).is_err());
        fs::remove_file(&paths.claim).expect("there");
        fs::hard_link(&other, &paths.claim).expect("linked");
        drop(Claim::take(&paths).expect("made"));
        assert_eq!(fs::read_to_string(&other).expect("readable"), "somebody's");
    }

    #[test]
    fn a_look_at_a_claim_keeps_nobody_from_taking_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let paths = RunPaths::new(folder.path(), "e", "a/seed-0").expect("a good id");
        drop(Claim::take(&paths).expect("made"));
        let look = File::open(&paths.claim).expect("there");
        look.lock_shared().expect("free");
        let taken = thread::scope(|scope| {
            scope.spawn(move || {
                thread::sleep(2 * PAUSE);
                drop(look);
            });
            Claim::take(&paths).expect("no error")
        });
        assert!(taken.is_some());
    }
}
