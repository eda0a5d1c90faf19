//! The file in which a target shows its bytes to readers, which take paths.

use std::{fs, path::PathBuf, sync::LazyLock};

static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a folder"));

/// A file that holds `bytes`, until the next call.
pub fn file(bytes: &[u8]) -> PathBuf {
    let path = FOLDER.path().join("hostile");
    fs::write(&path, bytes).expect("written");
    path
}
