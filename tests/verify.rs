//! `verify` where a run fails, now or when it was recorded.

use std::{fs, path::Path};

use assert_cmd::Command;
use mcpo_run::record::{Manifest, Outcome, RunPaths};

/// One run, of four quick iterations.
const MATRIX: &str = r#"
name = "one"
budget.env_steps = 1024
rollout.steps = 256
network.hidden = [8]
evaluation = { every = 1024, episodes = 1, final_episodes = 1 }
algorithms.ppo.minibatch = 64

[[matrix]]
seed = [0]
env = ["InvertedPendulum-v2"]
algorithm = ["ppo"]
"#;
const RUN: &str = "InvertedPendulum-v2/ppo/seed-0";

/// What `verify` with `arguments` says in `folder`; its exit code must be `code`.
fn verify(folder: &Path, code: i32, arguments: &[&str]) -> String {
    let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
    command
        .current_dir(folder)
        .args(["verify", "one.toml", "--against", "record"])
        .args(arguments);
    let output = command.output().expect("it starts");
    let (stdout, stderr) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert_eq!(output.status.code(), Some(code), "{stdout}\n{stderr}");
    stdout.into_owned()
}

/// A folder with the matrix and its record.
fn with_record() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("one.toml"), MATRIX).expect("written");
    verify(folder.path(), 0, &["--record"]);
    folder
}

#[test]
fn a_run_of_the_record_that_fails_now_is_told_with_its_cause() {
    let folder = with_record();
    let paths = RunPaths::new(&folder.path().join("now"), "one", RUN).expect("a good id");
    // What takes the policy's place makes the run fail when all of its numbers are there.
    fs::create_dir_all(RunPaths::policy(&paths.partial)).expect("made");
    let stdout = verify(folder.path(), 4, &["--results", "now"]);
    assert!(
        stdout.starts_with(&format!("{RUN}: failed: cannot write ")),
        "{stdout}"
    );
    assert!(
        stdout.contains("policy.safetensors") && stdout.contains("0 of 1 runs are as recorded"),
        "{stdout}"
    );
}

/// Runs that a test may change.
fn recorded(folder: &Path, name: &str) -> std::path::PathBuf {
    folder.join("record/runs").join(RUN).join(name)
}

#[test]
fn a_damaged_table_of_the_record_is_told_with_its_run_with_its_digest_or_without() {
    let folder = with_record();
    let (path, table) = (
        recorded(folder.path(), "run.json"),
        recorded(folder.path(), "evaluations.parquet"),
    );
    let whole = fs::read(&table).expect("readable");
    verify(folder.path(), 0, &["--results", "now"]);
    let told = |bytes: &[u8]| {
        fs::write(&table, bytes).expect("written");
        let stdout = verify(folder.path(), 4, &["--results", "now"]);
        assert!(
            stdout.starts_with(&format!("{RUN}: ")) && stdout.contains("evaluations.parquet"),
            "{stdout}"
        );
        stdout
    };
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    assert!(told(&changed).contains("is damaged: it is not what was recorded"));
    let manifest = Manifest::read(&path).expect("readable").expect("there");
    Manifest {
        tables: None,
        ..manifest
    }
    .write(&path)
    .expect("written");
    assert!(told(&whole[..whole.len() / 2]).contains("is not a table of results"));
    fs::write(&table, &whole).expect("written");
    verify(folder.path(), 0, &["--results", "now"]);
}

#[cfg(unix)]
#[test]
fn links_and_pipes_in_a_record_are_refused_and_end() {
    use std::os::unix::fs::symlink;
    let folder = with_record();
    verify(folder.path(), 0, &["--results", "now"]);
    symlink(".", folder.path().join("record/runs/loop")).expect("linked");
    verify(folder.path(), 0, &["--results", "now"]);
    for name in ["evaluations.parquet", "run.json"] {
        let path = recorded(folder.path(), name);
        let aside = path.with_extension("aside");
        fs::rename(&path, &aside).expect("renamed");
        let pipe = || {
            std::process::Command::new("mkfifo")
                .arg(&path)
                .status()
                .map(|_| ())
                .expect("mkfifo is there")
        };
        let places: [&dyn Fn(); 3] = [
            &|| symlink("/dev/zero", &path).expect("linked"),
            &|| symlink(&aside, &path).expect("linked"),
            &pipe,
        ];
        for make in places {
            make();
            let stdout = verify(folder.path(), 4, &["--results", "now"]);
            assert!(
                stdout.starts_with(&format!("{RUN}: ")) && stdout.contains(name),
                "{stdout}"
            );
            fs::remove_file(&path).expect("made");
        }
        fs::rename(&aside, &path).expect("renamed");
    }
}

#[test]
fn a_run_that_failed_when_it_was_recorded_and_does_not_now_is_told() {
    let folder = with_record();
    let path = RunPaths::manifest(&folder.path().join("record/runs").join(RUN));
    let mut manifest = Manifest::read(&path).expect("readable").expect("there");
    manifest.outcome = Outcome::Failed {
        error: "out of memory".into(),
        log_tail: vec!["begins".into()],
    };
    manifest.write(&path).expect("written");
    let stdout = verify(folder.path(), 4, &[]);
    assert!(
        stdout.starts_with(&format!(
            "{RUN}: recorded as failed (out of memory), but finished now\n"
        )),
        "{stdout}"
    );
}
