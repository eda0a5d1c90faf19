//! What goes wrong while runs are under way: signals, crashes, hangs, divergence. No run is lost,
//! and none becomes another.

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::{
    processes::{signal, wait_for},
    workbench::{PENDULUM, Workbench, texts},
};
use mcpo_run::{
    demo::Demonstration,
    record::{Claim, Outcome, RunPaths},
};

/// One run.
const ONE: [&str; 5] = [
    "tiny.toml",
    "--only",
    "env=InvertedPendulum-v2,seed=0",
    "--results",
    "disturbed",
];
/// Steps that take long enough to be disturbed, and not to end between two disturbances.
const LONG: u64 = 65_536;

/// The bench, with the undisturbed run recorded in `whole`.
fn with_whole_run() -> Workbench {
    let bench = Workbench::new(LONG);
    bench.expect(
        0,
        &[
            "tiny.toml",
            "--only",
            "env=InvertedPendulum-v2,seed=0",
            "--results",
            "whole",
        ],
    );
    bench
}

fn assert_same_run(bench: &Workbench) {
    assert_eq!(
        bench.recorded("disturbed", PENDULUM),
        bench.recorded("whole", PENDULUM),
        "the run is another"
    );
}

#[test]
fn killed_at_any_instant_a_run_goes_on_to_the_same_values() {
    let bench = with_whole_run();
    let mut killed = 0;
    // Checkpoints are 20 ms apart, so that some of these instants lie in the middle of writing one.
    for pause in [0, 30, 55, 80, 105, 130, 155, 180, 210] {
        let child = bench.start(&ONE);
        let worker = bench.worker("disturbed", PENDULUM);
        if killed > 2 {
            bench.wait_for_checkpoint("disturbed", PENDULUM); // the first ones may come before there is any
        }
        thread::sleep(Duration::from_millis(pause));
        let was_there = signal("KILL", worker);
        let output = child.wait_with_output().expect("it ends");
        if !was_there || output.status.success() {
            break; // it had finished
        }
        killed += 1;
        let (_, stderr) = texts(&output, 1, &ONE);
        assert!(
            stderr.contains("SIGKILL") && stderr.contains("memory"),
            "{stderr}"
        );
        let manifest = bench.manifest("disturbed", PENDULUM);
        assert!(
            manifest
                .error()
                .is_some_and(|error| error.contains("SIGKILL")),
            "{:?}",
            manifest.outcome
        );
        assert_eq!(manifest.attempts.len(), killed);
    }
    assert!(killed >= 3, "the runs were too quick to be killed");
    bench.expect(0, &ONE);
    assert_same_run(&bench);
    let attempts = bench.manifest("disturbed", PENDULUM).attempts;
    assert!(
        attempts.last().is_some_and(|last| last.from_env_steps > 0),
        "it began anew: {attempts:?}"
    );
}

#[test]
fn a_worker_whose_parent_is_killed_leaves_a_checkpoint_and_goes() {
    let bench = with_whole_run();
    let mut child = bench.start(&ONE);
    let worker = bench.worker("disturbed", PENDULUM);
    bench.wait_for_checkpoint("disturbed", PENDULUM);
    child.kill().expect("it was there");
    child.wait().expect("it ends");
    wait_for("the worker's end", || (!signal("0", worker)).then_some(()));
    assert!(
        !Claim::is_held(&bench.run("disturbed", PENDULUM)).expect("readable"),
        "the dead hold the run"
    );
    bench.expect(0, &ONE);
    assert_same_run(&bench);
}

#[test]
fn a_signal_stops_cleanly_and_the_same_command_goes_on() {
    let bench = with_whole_run();
    for name in ["INT", "TERM", "USR1"] {
        let child = bench.start(&ONE);
        bench.worker("disturbed", PENDULUM);
        assert!(signal(name, child.id()), "it was over before {name}");
        let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 130, &[name]);
        assert!(stderr.contains("resumes from here"), "{stderr}");
        let paths = bench.run("disturbed", PENDULUM);
        assert!(!paths.complete.exists() && RunPaths::checkpoint(&paths.partial).exists());
    }
    let (stdout, _) = bench.expect(0, &["status", "tiny.toml", "--results", "disturbed"]);
    assert!(
        stdout.contains("1 interrupted") && stdout.contains("65,536 steps"),
        "{stdout}"
    );
    bench.expect(0, &ONE);
    assert_same_run(&bench);
}

#[test]
fn a_signal_that_was_ignored_at_the_start_stays_ignored() {
    let bench = Workbench::new(LONG);
    let mut nohup = Command::new("nohup");
    nohup
        .arg(env!("CARGO_BIN_EXE_mcpo-run"))
        .args(ONE)
        .current_dir(bench.path(""));
    let child = nohup
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("nohup starts");
    let worker = bench.worker("disturbed", PENDULUM);
    assert!(
        signal("HUP", child.id()) && signal("HUP", worker),
        "it was over before"
    );
    let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 0, &["nohup"]);
    assert!(stderr.contains("1 of 1 runs finished"), "{stderr}");
}

#[test]
fn a_worker_ends_with_the_program_that_did_not_wait_for_it() {
    let bench = Workbench::new(1 << 24);
    // One iteration takes minutes, so that a worker that finishes it first is seen.
    let slow = [
        "--set",
        "rollout.steps=8388608",
        "--set",
        "network.hidden=[64, 64]",
    ];
    let mut child = bench.start(&[&ONE[..], &slow].concat());
    let worker = bench.worker("disturbed", PENDULUM);
    for _ in 0..2 {
        assert!(signal("INT", child.id()), "it was over before");
        thread::sleep(Duration::from_millis(700));
    }
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    let began = Instant::now();
    wait_for("the worker's end", || (!signal("0", worker)).then_some(()));
    assert!(
        began.elapsed() < Duration::from_secs(10),
        "it went on for {:?}",
        began.elapsed()
    );
}

#[test]
fn a_long_evaluation_is_no_hang() {
    let bench = Workbench::new(256);
    let long = [
        "--set",
        "evaluation.final_episodes=40000",
        "--set",
        "network.hidden=[96, 96]",
        "--hang-timeout",
        "5",
    ];
    let arguments = [
        "tiny.toml",
        "--only",
        "env=MountainCarContinuous-v0,seed=1",
        "--threads",
        "1",
    ];
    let began = Instant::now();
    bench.expect(0, &[&arguments[..], &long].concat());
    assert!(
        began.elapsed() > Duration::from_secs(6),
        "too quick to be taken for a hang: {:?}",
        began.elapsed()
    );
}

#[test]
fn results_may_have_a_name_that_is_no_text() {
    use std::os::unix::ffi::OsStrExt;
    let bench = Workbench::new(256);
    let mut program = bench.program(&[
        "tiny.toml",
        "--only",
        "env=InvertedPendulum-v2,seed=0",
        "--results",
    ]);
    let name = std::ffi::OsStr::from_bytes(b"r\xff");
    texts(
        &program.arg(name).output().expect("it starts"),
        0,
        &["no text"],
    );
    let recorded = bench.path("").join(name).join("tiny/runs").join(PENDULUM);
    assert!(RunPaths::manifest(&recorded).exists());
}

#[test]
fn a_crash_is_one_failed_run_with_its_cause_and_the_others_finish() {
    let bench = Workbench::new(LONG);
    let child = bench.start(&["tiny.toml", "--jobs", "2"]);
    assert!(
        signal("ABRT", bench.worker("results", PENDULUM)),
        "it was over before"
    );
    let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 1, &["ABRT"]);
    assert!(
        stderr.contains("SIGABRT") && stderr.contains("3 of 4 runs finished, 1 failed"),
        "{stderr}"
    );
    let manifest = bench.manifest("results", PENDULUM);
    let Outcome::Failed { error, log_tail } = &manifest.outcome else {
        panic!("{:?}", manifest.outcome)
    };
    assert!(
        error.contains("SIGABRT") && log_tail.iter().any(|line| line.contains("begins at 0")),
        "{log_tail:?}"
    );
    let folder = bench.run("results", PENDULUM).complete;
    assert!(
        !RunPaths::progress(&folder).exists(),
        "half a run would be scanned"
    );
    let (stdout, _) = bench.expect(0, &["status", "tiny.toml"]);
    assert!(
        stdout.contains("1 failed") && stdout.contains("SIGABRT"),
        "{stdout}"
    );
    bench.expect(0, &["tiny.toml"]);
    assert_eq!(
        bench.manifest("results", PENDULUM).outcome,
        Outcome::Finished
    );
}

#[test]
fn a_run_that_hangs_is_killed_and_tried_again_where_that_is_wanted() {
    let bench = with_whole_run();
    let arguments = [&ONE[..], &["--hang-timeout", "5", "--retries", "1"]].concat();
    let child = bench.start(&arguments);
    assert!(
        signal("STOP", bench.worker("disturbed", PENDULUM)),
        "it was over before"
    );
    let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 0, &arguments);
    assert!(
        stderr.contains("no progress for 5 s") && stderr.contains("trying again"),
        "{stderr}"
    );
    let attempts = bench.manifest("disturbed", PENDULUM).attempts;
    assert!(
        attempts[0]
            .error
            .as_ref()
            .is_some_and(|error| error.contains("no progress")),
        "{attempts:?}"
    );
    assert_eq!(attempts.len(), 2);
    assert_same_run(&bench);
}

#[test]
fn training_that_diverges_is_a_failed_run_that_says_so() {
    let bench = Workbench::new(4096);
    let arguments = [
        "tiny.toml",
        "--only",
        "seed=0",
        "--set",
        "algorithms.ppo.learning_rate=1e38",
    ];
    let (_, stderr) = bench.expect(1, &arguments);
    assert!(stderr.contains("diverged"), "{stderr}");
    assert!(
        bench
            .manifest("results", PENDULUM)
            .error()
            .is_some_and(|error| error.contains("iteration 1"))
    );
}

#[test]
fn a_checkpoint_of_another_version_is_refused_and_kept() {
    let bench = with_whole_run();
    let child = bench.start(&ONE);
    bench.wait_for_checkpoint("disturbed", PENDULUM);
    assert!(signal("INT", child.id()));
    texts(&child.wait_with_output().expect("it ends"), 130, &ONE);
    let path = RunPaths::checkpoint(&bench.run("disturbed", PENDULUM).partial);
    let older = "mcpo-run checkpoint 0\nsomething\n";
    fs::write(&path, older).expect("written");
    let (_, stderr) = bench.expect(2, &ONE);
    assert!(
        stderr.contains("version 0") && stderr.contains("--fresh"),
        "{stderr}"
    );
    assert_eq!(fs::read_to_string(&path).expect("kept"), older);
    bench.expect(0, &[&ONE[..], &["--fresh"]].concat());
    assert_same_run(&bench);
}

#[test]
fn a_damaged_checkpoint_is_set_aside_and_told_and_the_run_begins_again() {
    let bench = with_whole_run();
    let child = bench.start(&ONE);
    let worker = bench.worker("disturbed", PENDULUM);
    bench.wait_for_checkpoint("disturbed", PENDULUM);
    assert!(signal("KILL", worker), "it was over before");
    texts(&child.wait_with_output().expect("it ends"), 1, &ONE);
    let folder = bench.run("disturbed", PENDULUM).complete;
    let path = RunPaths::checkpoint(&folder);
    let mut bytes = fs::read(&path).expect("a failed run keeps it");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, &bytes).expect("written");
    let (_, stderr) = bench.expect(0, &ONE);
    assert!(
        stderr.contains("checkpoint is damaged") && stderr.contains("checkpoint.damaged"),
        "{stderr}"
    );
    assert_same_run(&bench);
    assert_eq!(
        fs::read(folder.join("checkpoint.damaged")).expect("kept"),
        bytes
    );
    assert_eq!(
        bench
            .manifest("disturbed", PENDULUM)
            .attempts
            .last()
            .map(|last| last.from_env_steps),
        Some(0)
    );
}

#[test]
fn a_finished_run_whose_table_is_damaged_is_told_and_run_anew_when_wanted() {
    let bench = Workbench::new(1024);
    bench.expect(0, &["tiny.toml"]);
    let path = RunPaths::progress(&bench.run("results", PENDULUM).complete);
    let whole = fs::read(&path).expect("readable");
    fs::write(&path, &whole[..whole.len() / 2]).expect("written");
    let (stdout, _) = bench.expect(0, &["plan", "tiny.toml"]);
    assert!(
        stdout.contains("damaged") && stdout.contains("3 finished"),
        "{stdout}"
    );
    let (_, stderr) = bench.expect(2, &["tiny.toml"]);
    assert!(
        stderr.contains("progress.parquet is damaged") && stderr.contains("--fresh"),
        "{stderr}"
    );
    bench.expect(0, &["tiny.toml", "--fresh"]);
    bench.expect(0, &["tiny.toml"]);
}

#[test]
fn results_that_vanish_under_way_end_the_runs_with_a_message() {
    let bench = Workbench::new(LONG);
    let child = bench.start(&ONE);
    bench.wait_for_checkpoint("disturbed", PENDULUM);
    // The worker may write between two of these removals.
    wait_for("the removal", || {
        fs::remove_dir_all(bench.path("disturbed")).ok()
    });
    let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 1, &ONE);
    assert!(stderr.contains("failed: cannot"), "{stderr}");
}

#[test]
fn a_program_whose_file_is_replaced_under_way_computes_all_runs_itself() {
    let bench = Workbench::new(LONG);
    let program = bench.path("program");
    fs::copy(env!("CARGO_BIN_EXE_mcpo-run"), &program).expect("copied");
    let arguments = [
        "tiny.toml",
        "--only",
        "env=InvertedPendulum-v2",
        "--jobs",
        "1",
        "--threads",
        "1",
    ];
    let mut child = Command::new(&program);
    child
        .args(arguments)
        .current_dir(bench.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let child = child.spawn().expect("it starts");
    bench.worker("results", PENDULUM);
    fs::remove_file(&program).expect("removed");
    fs::write(&program, "#!/bin/sh\nexit 3\n").expect("written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("set");
    let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 0, &arguments);
    assert!(stderr.contains("2 of 2 runs finished"), "{stderr}");
}

#[test]
fn a_demonstration_that_changes_under_way_fails_the_runs_that_would_learn_from_another() {
    let bench = Workbench::new(LONG);
    let demo = bench.path("demo.parquet");
    fs::copy("tests/parity/InvertedPendulum-v2.parquet", &demo).expect("copied");
    let matrix = fs::read_to_string(bench.path("tiny.toml")).expect("readable");
    let matrix = format!(
        "demonstrations = \"demo.parquet\"\n{}",
        matrix.replace("ppo", "mcpo")
    );
    fs::write(bench.path("tiny.toml"), matrix).expect("written");
    let arguments = [
        "tiny.toml",
        "--only",
        "env=InvertedPendulum-v2",
        "--jobs",
        "1",
        "--threads",
        "1",
    ];
    let child = bench.start(&arguments);
    bench.wait_for_checkpoint("results", "InvertedPendulum-v2/mcpo/seed-0");
    let mut other = Demonstration::read(&demo).expect("readable");
    other.actions[(0, 0)] += 0.5;
    other.write(&demo).expect("written");
    let (_, stderr) = texts(&child.wait_with_output().expect("it ends"), 1, &arguments);
    assert!(
        stderr.contains("1 of 2 runs finished, 1 failed"),
        "{stderr}"
    );
    let manifest = bench.manifest("results", "InvertedPendulum-v2/mcpo/seed-1");
    let error = manifest.error().expect("it failed");
    assert!(
        error.contains("demo.parquet is not the demonstration that it was"),
        "{error}"
    );
}
