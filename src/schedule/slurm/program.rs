//! The program that a submission runs: a copy of this one, so that a new build does not change it
//! while elements wait.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
};

use crate::record::{Executable, RecordError, io_error};

/// The copy of this program under `results`, where all nodes see it; made if it does not exist.
/// Submissions of one program share it.
///
/// # Errors
///
/// The disk refuses.
pub fn frozen(results: &Path) -> Result<PathBuf, RecordError> {
    let folder = results.join(".programs");
    fs::create_dir_all(&folder).map_err(io_error("create", &folder))?;
    let digest = Executable::This.digest();
    let path = folder.join(format!("mcpo-run-{}", digest.get(..16).unwrap_or(digest)));
    if path.exists() {
        return Ok(path);
    }
    // Copied with its permissions to a temporary name and then renamed, so that nobody finds a
    // partial copy.
    let copied = || -> io::Result<()> {
        let beside = tempfile::Builder::new()
            .prefix(".writing-")
            .tempfile_in(&folder)?;
        fs::copy(env::current_exe()?, beside.path())?;
        beside.as_file().sync_all()?;
        beside.persist(&path).map_err(|error| error.error)?;
        Ok(())
    };
    copied().map_err(io_error("copy this program to", &path))?;
    Ok(path)
}
