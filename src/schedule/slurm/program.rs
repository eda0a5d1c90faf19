//! The program that a submission runs: a copy of this one, which nobody builds anew while elements
//! wait.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
};

use crate::record::{Executable, RecordError, io_error};

/// This program's copy under `results`, where all nodes see it, made if need be. Submissions of one
/// program share it.
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
    // With its permissions, beside its place and renamed: whoever finds it finds all of it.
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
