//! The places of a run's files.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{
    Manifest, Outcome, RecordError, WRITING, io_error, read_bounded, rename, write_atomically,
};

/// The largest log or policy that a longer run copies from the finished one, bytes.
const BROUGHT_ALONG: u64 = 1 << 30;

/// The places of one run.
///
/// A run has one folder at a time: beside its place (`<id>.partial`) while it is under way or
/// interrupted, at its place (`<id>`) once it has finished or failed. The change from one to the
/// other is a rename. A finished run that is being extended has both, and keeps its own until the
/// longer run takes its place.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct RunPaths {
    /// `<results>/<experiment>/runs/<id>`: the ended run.
    pub complete: PathBuf,
    /// `<results>/<experiment>/runs/<id>.partial`: the run while it is written.
    pub partial: PathBuf,
    /// The file that names the process working on the run.
    pub claim: PathBuf,
    /// `<results>/.pretrained`: agents trained before their runs, for all runs under these results
    /// that share them.
    pub pretrained: PathBuf,
}

impl RunPaths {
    /// The places of run `id` of `experiment` under the folder `results`.
    ///
    /// # Errors
    ///
    /// A name would lead elsewhere (`..`, `/x`, empty ...), or would be taken for a folder of the
    /// program's own.
    pub fn new(results: &Path, experiment: &str, id: &str) -> Result<Self, RecordError> {
        let folder = experiment_folder(results, experiment)?;
        let mut complete = folder.join("runs");
        let mut claim = folder.join(".claims");
        for part in id.split('/') {
            check(part)?;
            complete.push(part);
            claim.push(part);
        }
        let partial = with_suffix(&complete, ".partial");
        // Older programs have locks under the bare name.
        let claim = with_suffix(&claim, ".claim");
        Ok(Self {
            complete,
            partial,
            claim,
            pretrained: results.join(".pretrained"),
        })
    }

    /// The folder of results that holds `file`, the folder of the run `id` or a file in it; `None`
    /// if it was moved elsewhere.
    pub fn results_of(file: &Path, experiment: &str, id: &str) -> Option<PathBuf> {
        let file = std::path::absolute(file).ok()?;
        let holds = |results: &&Path| {
            Self::new(results, experiment, id).is_ok_and(|run| file.starts_with(run.complete))
        };
        file.ancestors().find(holds).map(Path::to_owned)
    }

    /// The file of the rows of iterations, in `folder` (one of this run's).
    pub fn progress(folder: &Path) -> PathBuf {
        folder.join("progress.parquet")
    }

    /// The rows of evaluation episodes.
    pub fn evaluations(folder: &Path) -> PathBuf {
        folder.join("evaluations.parquet")
    }

    /// The policy at the end of training.
    pub fn policy(folder: &Path) -> PathBuf {
        folder.join("policy.safetensors")
    }

    /// The policy that was kept after `env_steps`.
    pub fn kept_policy(folder: &Path, env_steps: u64) -> PathBuf {
        // Leading zeros, so that names sort as numbers do.
        Self::kept_policies(folder).join(format!("{env_steps:012}.safetensors"))
    }

    /// The folder of the policies that were kept on the way.
    fn kept_policies(folder: &Path) -> PathBuf {
        folder.join("policies")
    }

    /// The `env_steps` after which the policy in `file` was kept; `None` if the file's name does
    /// not say.
    pub fn kept_after(file: &Path) -> Option<u64> {
        file.file_name()?
            .to_str()?
            .strip_suffix(".safetensors")?
            .parse()
            .ok()
    }

    /// The manifest.
    pub fn manifest(folder: &Path) -> PathBuf {
        folder.join("run.json")
    }

    /// The last checkpoint of a run that has not finished.
    pub fn checkpoint(folder: &Path) -> PathBuf {
        folder.join("checkpoint")
    }

    /// The last checkpoint of a run that has finished, to go on from when it is to be longer. It
    /// may be removed: a longer run is then trained from its start.
    pub fn kept_state(folder: &Path) -> PathBuf {
        folder.join("state.checkpoint")
    }

    /// The file with the run's progress.
    pub fn heartbeat(folder: &Path) -> PathBuf {
        folder.join("heartbeat.json")
    }

    /// The log.
    pub fn log(folder: &Path) -> PathBuf {
        folder.join("log.txt")
    }

    /// The manifest of this run if it has ended; `None` if it has not.
    ///
    /// # Errors
    ///
    /// The manifest is there and cannot be read.
    pub fn ended(&self) -> Result<Option<Manifest>, RecordError> {
        Manifest::read(&Self::manifest(&self.complete))
    }

    /// Makes the folder in which the run is written.
    ///
    /// A run that failed is resumed from its checkpoint. A finished run is left as it is; the
    /// longer run gets its log and the policies that it kept. Files that a killed process was
    /// writing are removed, so only the holder of the claim may call this.
    ///
    /// # Errors
    ///
    /// The folders cannot be made, renamed or read.
    pub fn open(&self) -> Result<(), RecordError> {
        self.refuse_links()?;
        self.settle()?;
        let finished = self
            .ended()?
            .is_some_and(|ended| ended.outcome == Outcome::Finished);
        if self.complete.exists() && !finished && !self.partial.exists() {
            rename(&self.complete, &self.partial)?;
        }
        fs::create_dir_all(&self.partial).map_err(io_error("create", &self.partial))?;
        self.remove_half_written()?;
        if finished { self.bring_along() } else { Ok(()) }
    }

    /// # Errors
    ///
    /// A folder of the run is a link: writing or removing there would change somebody else's files.
    fn refuse_links(&self) -> Result<(), RecordError> {
        match [&self.partial, &self.complete]
            .into_iter()
            .find(|folder| folder.is_symlink())
        {
            Some(folder) => {
                let reason =
                    "it is a link to another folder, and links are not followed there".to_owned();
                Err(RecordError::Malformed {
                    path: folder.clone(),
                    expected: "a run's folder",
                    reason,
                })
            }
            None => Ok(()),
        }
    }

    /// Moves the run into its place, with `manifest` as its last word.
    ///
    /// A failed run keeps its checkpoint, to go on from, and no tables: whoever scans them must not
    /// meet half a run. A failed extension leaves the shorter, finished run in its place.
    ///
    /// # Errors
    ///
    /// The disk refuses; everything is then still in [`partial`](Self::partial).
    pub fn close(&self, manifest: &Manifest) -> Result<(), RecordError> {
        if manifest.outcome == Outcome::Finished {
            manifest.write(&Self::manifest(&self.partial))?;
            return self.settle();
        }
        remove_if_there(&Self::progress(&self.partial))?;
        remove_if_there(&Self::evaluations(&self.partial))?;
        remove_if_there(&Self::heartbeat(&self.partial))?;
        manifest.write(&Self::manifest(&self.partial))?;
        match self.ended()? {
            Some(ended) if ended.outcome == Outcome::Finished => Ok(()),
            _ => rename(&self.partial, &self.complete),
        }
    }

    /// Moves a run whose manifest says that it finished into its place, even if the process that
    /// wrote it was killed before it could. It replaces a shorter run there. Only the holder of the
    /// claim may call this.
    ///
    /// # Errors
    ///
    /// The disk refuses; the next call goes on from there.
    pub fn settle(&self) -> Result<(), RecordError> {
        let manifest = Manifest::read(&Self::manifest(&self.partial))?;
        if manifest.is_some_and(|manifest| manifest.outcome == Outcome::Finished) {
            self.remove_half_written()?;
            remove_if_there(&Self::heartbeat(&self.partial))?;
            let last = Self::checkpoint(&self.partial);
            if last.exists() {
                rename(&last, &Self::kept_state(&self.partial))?;
            }
            if self.complete.exists() {
                remove_folder(&self.replaced())?;
                rename(&self.complete, &self.replaced())?;
            }
            rename(&self.partial, &self.complete)?;
        }
        if self.complete.exists() {
            remove_folder(&self.replaced())
        } else {
            Ok(())
        }
    }

    /// Whether a killed process left something for [`settle`](Self::settle) to put right.
    pub fn is_unsettled(&self) -> bool {
        self.replaced().exists() && self.complete.exists()
    }

    /// The place of a shorter run while the longer one replaces it.
    fn replaced(&self) -> PathBuf {
        with_suffix(&self.complete, ".replaced")
    }

    /// Copies the files that a longer run needs from the finished one, unless they are there
    /// already.
    fn bring_along(&self) -> Result<(), RecordError> {
        let mut files = vec![(Self::log(&self.complete), Self::log(&self.partial))];
        let kept = Self::kept_policies(&self.complete);
        if kept.exists() {
            let own = Self::kept_policies(&self.partial);
            fs::create_dir_all(&own).map_err(io_error("create", &own))?;
            for entry in fs::read_dir(&kept).map_err(io_error("read", &kept))? {
                let entry = entry.map_err(io_error("read", &kept))?;
                files.push((entry.path(), own.join(entry.file_name())));
            }
        }
        for (from, to) in files.into_iter().filter(|(_, to)| !to.exists()) {
            if let Some(bytes) = read_bounded(&from, BROUGHT_ALONG)? {
                write_atomically(&to, &bytes)?;
            }
        }
        Ok(())
    }

    fn remove_half_written(&self) -> Result<(), RecordError> {
        remove_half_written(&self.partial)?;
        let policies = Self::kept_policies(&self.partial);
        if policies.exists() {
            remove_half_written(&policies)
        } else {
            Ok(())
        }
    }

    /// Whether a folder of this name holds a run that is under way, replaced or set aside, rather
    /// than ended.
    pub fn is_aside(name: &str) -> bool {
        name.ends_with(".partial") || name.ends_with(".replaced") || name.contains(".old-")
    }

    /// Renames all folders of the run to `<id>.old-<n>`, and returns the new names.
    ///
    /// Its Parquet files get the ending `.old`, so that scans over `**/progress.parquet` do not
    /// count the run twice.
    ///
    /// # Errors
    ///
    /// A rename fails.
    pub fn set_aside(&self) -> Result<Vec<PathBuf>, RecordError> {
        let mut aside = Vec::new();
        for folder in [&self.complete, &self.partial] {
            if !folder.exists() {
                continue;
            }
            let old = (1..)
                .map(|n| with_suffix(&self.complete, &format!(".old-{n}")))
                .find(|old| !old.exists())
                .unwrap_or_else(|| unreachable!("a folder holds finitely many names"));
            rename(folder, &old)?;
            for file in [Self::progress(&old), Self::evaluations(&old)] {
                if file.exists() {
                    rename(&file, &with_suffix(&file, ".old"))?;
                }
            }
            aside.push(old);
        }
        Ok(aside)
    }
}

/// The folder `<results>/<experiment>`.
///
/// # Errors
///
/// The name would lead elsewhere.
pub fn experiment_folder(results: &Path, experiment: &str) -> Result<PathBuf, RecordError> {
    check(experiment)?;
    Ok(results.join(experiment))
}

/// Makes `results` if need be, and writes and removes a file in it.
///
/// # Errors
///
/// It is no folder, or cannot be written to.
pub fn check_writable(results: &Path) -> Result<(), RecordError> {
    fs::create_dir_all(results).map_err(io_error("create", results))?;
    let probe = results.join(".writable");
    write_atomically(&probe, b"")?;
    remove_if_there(&probe)
}

/// Removes the files in `folder` that a killed process left half written.
fn remove_half_written(folder: &Path) -> Result<(), RecordError> {
    for entry in fs::read_dir(folder).map_err(io_error("read", folder))? {
        let entry = entry.map_err(io_error("read", folder))?;
        if entry.file_name().to_string_lossy().starts_with(WRITING) {
            remove_if_there(&entry.path())?;
        }
    }
    Ok(())
}

/// Removes a file if it is there.
pub(crate) fn remove_if_there(path: &Path) -> Result<(), RecordError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(io_error("remove", path)(error))
        }
        _ => Ok(()),
    }
}

/// Removes a folder with its content if it is there.
fn remove_folder(path: &Path) -> Result<(), RecordError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(io_error("remove", path)(error))
        }
        _ => Ok(()),
    }
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(suffix);
    path.with_file_name(name)
}

/// Checks a folder's name: it stays in its folder on every system, and is not one of the program's
/// own.
fn check(name: &str) -> Result<(), RecordError> {
    let reason = if name.is_empty() {
        "it is empty, or has an empty part"
    } else if name.starts_with('.') {
        "a part begins with a dot"
    } else if name
        .chars()
        .any(|c| c.is_control() || r#"/\:*?"<>|"#.contains(c))
    {
        r#"a part holds a control character or one of / \ : * ? " < > |"#
    } else if name.len() > 200 {
        "a part is longer than 200 bytes"
    } else if RunPaths::is_aside(name) {
        "a part ends as the program's own folders do (.partial, .replaced, .old-N)"
    } else {
        return Ok(());
    };
    Err(RecordError::Name {
        name: name.to_owned(),
        reason,
    })
}

#[cfg(test)]
mod tests;
