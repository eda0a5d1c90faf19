//! The claim on a run: its holder may write to the run's folder, on whichever machine.
//!
//! Locks of the operating system do not do for this: some network file systems have none, some keep
//! them on one machine, and some keep those of a machine that is gone. A claim is a file that names
//! its owner, put into its place by a hard link, which is made whole or not at all on those systems
//! too (NFS, RFC 1813, `LINK`). An owner on this machine is dead when its process is; one
//! elsewhere, when it has left its file untouched for [`SILENCE`]. Nobody removes a dead owner's
//! claim: two processes could do so at once, and one of them would remove the other's new claim.
//! Instead the next claim is put behind it, under the dead owner's number, where again only one can
//! be. The last claim of the chain holds.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError, Sender},
    },
    thread,
    time::{Duration, SystemTime},
};

use super::{
    RecordError, RunPaths, beside, io_error, owner::Owner, paths::remove_if_there, read_bounded,
};
use crate::intake::{self, Links};

/// How often taking a claim is tried, with pauses between: somebody who looks after a run holds it
/// for a moment.
const TRIES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(50);
/// How often an owner touches its file.
const BEAT: Duration = Duration::from_secs(10);
/// An owner on another machine counts as dead after this long without a touch.
const SILENCE: Duration = Duration::from_secs(120);
/// The largest claim that is read, bytes.
const LIMIT: u64 = 1 << 12;
/// The longest chain that is followed; each link is an owner that died.
const LONGEST: usize = 10_000;

/// A claim, held until it is dropped or its process ends, however it ends.
#[derive(Debug)]
pub struct Claim {
    /// The claims that lead to this one, and this one; others look for the first one first.
    chain: Vec<PathBuf>,
    /// The place of the next claim, if this one is taken for dead.
    next: PathBuf,
    lost: Arc<AtomicBool>,
    /// Dropping it ends the touching.
    beats: Option<Sender<()>>,
}

/// The state at the end of a chain of claims.
enum End {
    /// Its owner is alive.
    Held(Owner),
    /// There is no claim at the last of these places.
    Free(Vec<PathBuf>),
}

impl Claim {
    /// Claims a run; `None` if somebody else holds it for a second or longer.
    ///
    /// # Errors
    ///
    /// The claim's file cannot be made, or the file there is no claim.
    pub fn take(paths: &RunPaths) -> Result<Option<Self>, RecordError> {
        for left in (0..TRIES).rev() {
            if let Some(claim) = Self::take_now(&paths.claim)? {
                return Ok(Some(claim));
            }
            if left > 0 {
                thread::sleep(PAUSE);
            }
        }
        Ok(None)
    }

    /// Claims whatever the file at `place` stands for; `None` if somebody else holds it.
    ///
    /// # Errors
    ///
    /// As for [`take`](Self::take).
    pub fn take_now(place: &Path) -> Result<Option<Self>, RecordError> {
        let folder = place.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder).map_err(io_error("claim", place))?;
        let owner = Owner::this();
        let mut own = beside(folder).map_err(io_error("claim", place))?;
        own.write_all(&owner.text())
            .and_then(|()| own.as_file().sync_all())
            .map_err(io_error("claim", place))?;
        // The clock of the machine that keeps the files: the times of touches are by that clock
        // too.
        let now = own
            .as_file()
            .metadata()
            .and_then(|own| own.modified())
            .map_err(io_error("claim", place))?;
        let End::Free(chain) = end(place, now)? else {
            return Ok(None);
        };
        let last = chain.last().map_or(place, PathBuf::as_path);
        match fs::hard_link(own.path(), last) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(None),
            // A network file system may have lost its first answer, and the second try then meets
            // the link of the first.
            Err(error) if !is_linked(own.as_file()) => return Err(io_error("claim", last)(error)),
            _ => {}
        }
        // If an earlier claim of the chain was removed meanwhile, nobody will find this one.
        if !leads_to(place, &chain)? {
            remove_if_there(last)?;
            return Ok(None);
        }
        let next = behind(place, &owner);
        let file = own.into_file();
        let lost = Arc::new(AtomicBool::new(false));
        let beats = touch(file, next.clone(), last.to_owned(), Arc::clone(&lost))
            .map_err(io_error("claim", place))?;
        Ok(Some(Self {
            chain,
            next,
            lost,
            beats: Some(beats),
        }))
    }

    /// Whether somebody holds the claim; takes and writes nothing.
    ///
    /// # Errors
    ///
    /// The claim's file is there and cannot be read.
    pub fn is_held(paths: &RunPaths) -> Result<bool, RecordError> {
        Ok(Self::owner(paths)?.is_some())
    }

    /// The process that holds the claim.
    ///
    /// # Errors
    ///
    /// As for [`is_held`](Self::is_held).
    pub fn owner(paths: &RunPaths) -> Result<Option<Owner>, RecordError> {
        // By this machine's clock: it may be wrong, but by less than the silence that counts.
        Ok(match end(&paths.claim, SystemTime::now())? {
            End::Held(owner) => Some(owner),
            End::Free(_) => None,
        })
    }

    /// Whether another machine took this process for dead because it stood still for too long.
    /// The claim's run is then no longer this process's.
    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::SeqCst) || self.next.exists()
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        drop(self.beats.take());
        // The first one first: whoever finds it gone begins anew, and whoever is in the middle
        // finds that it leads nowhere. A claim that cannot be removed is a dead owner's as soon as
        // this process ends.
        if !self.is_lost() {
            self.chain
                .iter()
                .for_each(|path| drop(fs::remove_file(path)));
        }
    }
}

/// The place behind the claim of `owner` on `place`.
fn behind(place: &Path, owner: &Owner) -> PathBuf {
    let mut name = place.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}", owner.number));
    place.with_file_name(name)
}

/// The end of the chain of claims on `place`, at the time `now`.
fn end(place: &Path, now: SystemTime) -> Result<End, RecordError> {
    let mut chain = vec![place.to_owned()];
    while let Some(last) = chain.last().filter(|_| chain.len() < LONGEST) {
        let Some((owner, touched)) = read(last)? else {
            return Ok(End::Free(chain));
        };
        let silent = now.duration_since(touched).unwrap_or_default();
        if owner.is_alive().unwrap_or(silent < SILENCE) {
            return Ok(End::Held(owner));
        }
        let next = behind(place, &owner);
        if chain.contains(&next) {
            let reason =
                "it leads back to itself; remove it where nobody works on the run".to_owned();
            return Err(RecordError::Malformed {
                path: next,
                expected: "a claim",
                reason,
            });
        }
        chain.push(next);
    }
    let reason = format!("{LONGEST} owners died; remove it where nobody works on the run");
    Err(RecordError::Malformed {
        path: place.to_owned(),
        expected: "a claim that can be taken",
        reason,
    })
}

/// The owner that a claim names, and the time of its last touch; `None` where there is no claim.
fn read(path: &Path) -> Result<Option<(Owner, SystemTime)>, RecordError> {
    let file = match intake::open(path, Links::Refuse, OpenOptions::new().read(true)) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(super::opened_or(path, "read")(error)),
    };
    let touched = file
        .metadata()
        .and_then(|file| file.modified())
        .map_err(io_error("read", path))?;
    let Some(text) = read_bounded(path, LIMIT)? else {
        return Ok(None);
    };
    match Owner::read(&text) {
        Some(owner) => Ok(Some((owner, touched))),
        None => {
            let reason = "it names no owner; remove it where nobody works on the run".to_owned();
            Err(RecordError::Malformed {
                path: path.to_owned(),
                expected: "a claim",
                reason,
            })
        }
    }
}

/// Whether each claim of the chain on `place` still leads to the next.
/// If so, none was removed since the chain was read: owners remove the first one first, and no
/// number comes again.
fn leads_to(place: &Path, chain: &[PathBuf]) -> Result<bool, RecordError> {
    for pair in chain.windows(2) {
        let owner = read(&pair[0])?;
        if owner.is_none_or(|(owner, _)| behind(place, &owner) != pair[1]) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether the file has a second name, the hard link.
fn is_linked(file: &File) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        file.metadata().is_ok_and(|file| file.nlink() == 2)
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        false
    }
}

/// Touches `file`, the claim at `place`, now and then until the returned sender is dropped.
/// Sets `lost` when another claim lies behind it at `next`, or the place is empty.
fn touch(
    file: File,
    next: PathBuf,
    place: PathBuf,
    lost: Arc<AtomicBool>,
) -> io::Result<Sender<()>> {
    let (sender, receiver) = mpsc::channel();
    let beat = move || {
        while receiver.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
            if next.exists() || !place.exists() {
                lost.store(true, Ordering::SeqCst);
                return;
            }
            let _ = stamp(&file); // the next one may succeed
        }
    };
    thread::Builder::new()
        .name("claim".to_owned())
        .spawn(beat)?;
    Ok(sender)
}

/// Sets a file's time by the clock of the machine that keeps it.
fn stamp(file: &File) -> io::Result<()> {
    #[cfg(unix)]
    {
        use rustix::fs::{Timespec, Timestamps, UTIME_NOW};
        let now = Timespec {
            tv_sec: 0,
            tv_nsec: UTIME_NOW,
        };
        Ok(rustix::fs::futimens(
            file,
            &Timestamps {
                last_access: now,
                last_modification: now,
            },
        )?)
    }
    #[cfg(not(unix))]
    {
        file.set_modified(SystemTime::now())
    }
}

#[cfg(test)]
mod tests;
