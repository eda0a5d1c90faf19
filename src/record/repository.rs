//! The git repository that a command is called in, asked in such a way that nothing in it is run.
//!
//! A repository's own configuration can name programs: a monitor of the file system, filters of
//! files, ways to fetch what is missing. The folder that a command stands in may be a stranger's,
//! so each of them is switched off.

use std::{path::Path, process::Command};

use serde::{Deserialize, Serialize};

/// A state of a git repository.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Git {
    /// The commit's hash.
    pub commit: String,
    /// Whether tracked files differ from it.
    pub dirty: bool,
}

impl Git {
    /// The state of the repository around `folder`; `None` without a repository or without git.
    pub(super) fn of(folder: &Path) -> Option<Self> {
        let commit = ask(folder, &[], &["rev-parse", "HEAD"])?;
        let filters = ask(
            folder,
            &[],
            &[
                "config",
                "--name-only",
                "--get-regexp",
                "^filter[.].*[.](clean|process)$",
            ],
        );
        let filters: Vec<String> = filters
            .unwrap_or_default()
            .lines()
            .map(str::to_owned)
            .collect();
        let off: Vec<(&str, &str)> = filters.iter().map(|key| (key.as_str(), "")).collect();
        let changes = [
            "status",
            "--porcelain",
            "--untracked-files=no",
            "--ignore-submodules=all",
        ];
        let changes = ask(folder, &off, &changes)?;
        Some(Self {
            commit,
            dirty: !changes.is_empty(),
        })
    }
}

/// The output of git for `arguments`, under `settings` that override the repository's own.
fn ask(folder: &Path, settings: &[(&str, &str)], arguments: &[&str]) -> Option<String> {
    let always = [("core.fsmonitor", "false"), ("core.hooksPath", "/dev/null")];
    let settings: Vec<_> = always.iter().chain(settings).collect();
    let mut git = Command::new("git");
    git.current_dir(folder)
        .arg("--no-optional-locks")
        .args(arguments);
    git.env("GIT_ALLOW_PROTOCOL", "")
        .env("GIT_NO_LAZY_FETCH", "1");
    git.env("GIT_CONFIG_COUNT", settings.len().to_string());
    for (i, (key, value)) in settings.into_iter().enumerate() {
        git.env(format!("GIT_CONFIG_KEY_{i}"), key)
            .env(format!("GIT_CONFIG_VALUE_{i}"), value);
    }
    let output = git.output().ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn git(folder: &Path, arguments: &[&str]) {
        let who = ["-c", "user.name=a", "-c", "user.email=a@example.org"];
        let output = Command::new("git")
            .current_dir(folder)
            .args(who)
            .args(arguments)
            .output()
            .expect("git is there");
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }

    #[test]
    fn a_repository_is_asked_without_running_what_it_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let (repository, ran) = (folder.path().join("theirs"), folder.path().join("ran"));
        fs::create_dir(&repository).expect("made");
        assert_eq!(Git::of(&repository), None);
        git(&repository, &["init", "--quiet"]);
        fs::write(repository.join("file"), "one\n").expect("written");
        git(&repository, &["add", "file"]);
        git(&repository, &["commit", "--quiet", "--message", "first"]);
        let clean = Git::of(&repository).expect("a repository");
        assert!(clean.commit.len() == 40 && !clean.dirty, "{clean:?}");

        let program = folder.path().join("program");
        fs::write(
            &program,
            format!("#!/bin/sh\ntouch '{}'\ncat\n", ran.display()),
        )
        .expect("written");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(&program, fs::Permissions::from_mode(0o755))
                .expect("made executable");
        }
        for key in [
            "core.fsmonitor",
            "filter.theirs.clean",
            "filter.theirs.smudge",
        ] {
            git(
                &repository,
                &["config", key, &program.display().to_string()],
            );
        }
        fs::write(repository.join(".git/info/attributes"), "* filter=theirs\n").expect("written");
        fs::write(repository.join("file"), "two\n").expect("written");
        let changed = Git::of(&repository).expect("a repository");
        assert!(
            changed.commit == clean.commit && changed.dirty,
            "{changed:?}"
        );
        assert!(!ran.exists(), "a program of the repository was run");
        // The same question without care runs it.
        Command::new("git")
            .current_dir(&repository)
            .arg("status")
            .output()
            .expect("git is there");
        assert!(ran.exists());
    }
}
