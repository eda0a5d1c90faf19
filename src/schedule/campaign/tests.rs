mod script;

use script::{Script, began, crashes, exited, finishes};

use super::*;
use crate::{
    quantity::constant,
    record::{Attempt, Manifest, Outcome, now},
    schedule::{progress::Style, tests::planned},
};

const OPTIONS: Options = Options {
    jobs: 2,
    threads: None,
    retries: 0,
    fail_fast: false,
    hang_timeout: Duration::from_secs(60),
    verbose: false,
};

/// Runs `count` runs by the script in a folder of their own, and gives what became of them.
fn play(
    script: &mut Script,
    options: Options,
    count: u64,
) -> (Summary, Vec<Planned>, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a folder");
    let due: Vec<Planned> = (0..count)
        .map(|seed| planned(folder.path(), "e", seed))
        .collect();
    let summary = play_due(script, options, &due, folder.path());
    (summary, due, folder)
}

/// The same with runs whose places under `results` a test has prepared.
fn play_due(script: &mut Script, options: Options, due: &[Planned], results: &Path) -> Summary {
    play_shown(script, options, due, results).0
}

/// The same with what was shown of it.
fn play_shown(
    script: &mut Script,
    options: Options,
    due: &[Planned],
    results: &Path,
) -> (Summary, Progress) {
    let stop = script
        .stop_at
        .as_ref()
        .map_or_else(StopRequest::default, |(_, stop)| stop.clone());
    let mut progress = Progress::new(Style::Quiet, false, vec![1.0; due.len()]);
    let summary = run(
        due,
        results,
        options,
        &CostModel::default(),
        script,
        &stop,
        &mut progress,
    );
    (summary, progress)
}

/// Records `outcome` of `run` in its place, as a process of its own does.
fn ended(run: &Planned, outcome: Outcome) -> Manifest {
    let attempt = Attempt {
        began: now(),
        ended: Some(now()),
        host: "here".to_owned(),
        process: 7,
        from_env_steps: 0,
        cpu_class: "x86_64".to_owned(),
        libm: "a".to_owned(),
        error: None,
    };
    let env_steps = if outcome == Outcome::Finished {
        run.spec.trained_steps()
    } else {
        512
    };
    let manifest = Manifest {
        attempts: vec![attempt],
        env_steps,
        outcome,
        ..Manifest::new(run.stamp.clone())
    };
    run.paths.open().expect("made");
    run.paths.close(&manifest).expect("closed");
    manifest
}

fn failed(error: &str) -> Outcome {
    Outcome::Failed {
        error: error.to_owned(),
        log_tail: Vec::new(),
    }
}

#[test]
fn places_that_no_run_will_take_become_threads_of_those_that_start() {
    for (jobs, threads, count, expected) in [
        (2, None, 3, vec![1, 1, 1]),
        (8, None, 2, vec![4, 4]),
        (8, None, 3, vec![2, 2, 2]),
        (4, Some(3), 2, vec![3, 3]),
    ] {
        let mut script = Script::default();
        play(
            &mut script,
            Options {
                jobs,
                threads,
                ..OPTIONS
            },
            count,
        );
        assert_eq!(script.threads, expected, "{count} runs in {jobs} places");
    }
}

#[test]
fn a_run_that_dies_is_recorded_and_the_others_go_on() {
    let mut script = Script::default();
    script.lives.insert(1, [crashes()].into());
    let (summary, due, _folder) = play(&mut script, OPTIONS, 4);
    assert_eq!(
        (summary.finished, summary.failed.len(), summary.left),
        (3, 1, 0)
    );
    assert_eq!(summary.failed[0].0, due[1].spec.id);
    let Ok(RunState::Failed(manifest)) = due[1].state() else {
        panic!("{:?}", due[1].state())
    };
    let error = manifest.error().expect("an error");
    assert!(
        error.contains("SIGABRT") && error.contains("said"),
        "{error}"
    );
}

#[test]
fn a_run_is_tried_again_as_often_as_wanted_and_no_more() {
    let mut script = Script::default();
    script
        .lives
        .insert(0, [crashes(), crashes(), finishes(1.0)].into());
    script
        .lives
        .insert(1, [crashes(), crashes(), crashes()].into());
    let (summary, due, _folder) = play(
        &mut script,
        Options {
            retries: 2,
            ..OPTIONS
        },
        2,
    );
    assert_eq!((summary.finished, summary.failed.len()), (1, 1));
    assert_eq!(
        script.started.iter().filter(|&&number| number == 0).count(),
        3
    );
    assert_eq!(
        script.started.iter().filter(|&&number| number == 1).count(),
        3
    );
    assert_eq!(
        due[1]
            .state()
            .map(|state| matches!(state, RunState::Failed(_)))
            .ok(),
        Some(true)
    );
}

#[test]
fn what_the_worker_says_of_its_failure_is_the_error() {
    let mut script = Script::default();
    let failed = Event::Failed {
        error: "training diverged".to_owned(),
    };
    script.lives.insert(
        0,
        [vec![began(), Message::Event(failed), exited("exit code 1")]].into(),
    );
    let (summary, ..) = play(&mut script, OPTIONS, 1);
    assert_eq!(summary.failed[0].1, "training diverged");
}

#[test]
fn a_run_that_is_recorded_as_finished_has_finished_however_its_process_ends() {
    let refused = Event::Failed {
        error: "cannot sync its folder".to_owned(),
    };
    for (how, life) in [
        ("killed", crashes()),
        (
            "failed",
            vec![began(), Message::Event(refused), exited("exit code 1")],
        ),
        (
            "claimed",
            vec![Message::Event(Event::Claimed), exited("exit code 0")],
        ),
        ("hung", vec![began()]),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let due = [planned(folder.path(), "e", 0)];
        let recorded = ended(&due[0], Outcome::Finished);
        let mut script = Script::default();
        script.lives.insert(0, [life].into());
        let options = Options {
            retries: 1,
            fail_fast: true,
            hang_timeout: Duration::from_millis(50),
            ..OPTIONS
        };
        let summary = play_due(&mut script, options, &due, folder.path());
        assert_eq!(
            (summary.finished, summary.failed.as_slice(), summary.left),
            (1, [].as_slice(), 0),
            "{how}"
        );
        assert_eq!(script.started, [0], "{how}");
        assert_eq!(
            due[0].state().ok(),
            Some(RunState::Finished(recorded)),
            "{how}"
        );
    }
}

#[test]
fn a_stop_counts_a_run_that_had_finished_before_its_process_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let due = [
        planned(folder.path(), "e", 0),
        planned(folder.path(), "e", 1),
    ];
    ended(&due[0], Outcome::Finished);
    let mut script = Script {
        stop_at: Some((2, StopRequest::default())),
        abrupt: true,
        ..Script::default()
    };
    for number in 0..2 {
        script.lives.insert(number, [vec![began()]].into());
    }
    let summary = play_due(&mut script, OPTIONS, &due, folder.path());
    assert_eq!(
        (
            summary.finished,
            summary.failed.len(),
            summary.left,
            summary.interrupted
        ),
        (1, 0, 1, true)
    );
}

#[test]
fn a_failure_that_another_process_recorded_since_is_recorded_and_counted_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let due = [planned(folder.path(), "e", 0)];
    let recorded = ended(&due[0], failed("theirs"));
    let mut script = Script::default();
    script.lives.insert(0, [crashes()].into());
    let summary = play_due(&mut script, OPTIONS, &due, folder.path());
    assert_eq!(
        summary.failed,
        [(due[0].spec.id.clone(), "theirs".to_owned())]
    );
    assert_eq!(due[0].state().ok(), Some(RunState::Failed(recorded)));
}

#[test]
fn a_failure_of_an_earlier_call_gives_way_to_that_of_a_process_that_never_began() {
    let folder = tempfile::tempdir().expect("a folder");
    let due = [planned(folder.path(), "e", 0)];
    ended(&due[0], failed("earlier"));
    let mut script = Script::default();
    script.lives.insert(0, [vec![exited("exit code 3")]].into());
    let summary = play_due(&mut script, OPTIONS, &due, folder.path());
    assert_eq!(summary.failed.len(), 1);
    let Ok(RunState::Failed(manifest)) = due[0].state() else {
        panic!("{:?}", due[0].state())
    };
    assert!(
        manifest
            .error()
            .is_some_and(|error| error.contains("exit code 3")),
        "{:?}",
        manifest.outcome
    );
    assert_eq!(
        manifest.env_steps, 512,
        "steps that were trained before are still trained"
    );
}

#[test]
fn a_run_that_another_process_took_up_when_its_own_died_is_that_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let due = [planned(folder.path(), "e", 0)];
    let claim = Claim::take(&due[0].paths).expect("made").expect("free");
    let mut script = Script::default();
    script.lives.insert(0, [crashes(), finishes(1.0)].into());
    let summary = std::thread::scope(|scope| {
        scope.spawn(move || {
            std::thread::sleep(Duration::from_millis(1500)); // longer than a claim is tried for
            drop(claim); // the other process dies
        });
        play_due(&mut script, OPTIONS, &due, folder.path())
    });
    assert_eq!(
        (summary.finished, summary.failed.len(), script.started.len()),
        (1, 0, 2)
    );
}

#[test]
fn the_first_failure_stops_everything_where_that_is_wanted() {
    let mut script = Script::default();
    script.lives.insert(0, [crashes()].into());
    script.lives.insert(1, [vec![began()]].into()); // would go on for ever
    let (summary, ..) = play(
        &mut script,
        Options {
            fail_fast: true,
            ..OPTIONS
        },
        5,
    );
    assert_eq!(
        (
            summary.finished,
            summary.failed.len(),
            summary.left,
            summary.interrupted
        ),
        (0, 1, 4, false)
    );
    assert_eq!(
        (script.stopped.as_slice(), script.started.len()),
        ([1].as_slice(), 2)
    );
}

#[test]
fn a_run_that_hangs_is_killed() {
    let mut script = Script::default();
    script.lives.insert(0, [vec![began()]].into());
    let (summary, ..) = play(
        &mut script,
        Options {
            hang_timeout: Duration::from_millis(50),
            ..OPTIONS
        },
        2,
    );
    assert_eq!((summary.finished, summary.failed.len()), (1, 1));
    assert!(
        summary.failed[0].1.contains("no progress"),
        "{}",
        summary.failed[0].1
    );
}

#[test]
fn time_in_which_the_program_stood_still_itself_is_not_held_against_the_workers() {
    let still = Duration::from_millis(3500); // Ctrl-Z, and later `fg`
    let mut script = Script {
        stands_still: Some(still),
        ..Script::default()
    };
    let (summary, ..) = play(
        &mut script,
        Options {
            hang_timeout: Duration::from_secs(3),
            ..OPTIONS
        },
        2,
    );
    assert_eq!(
        (summary.finished, script.killed.as_slice()),
        (2, [].as_slice())
    );
}

#[test]
fn runs_that_end_without_having_begun_here_are_shown_as_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let due: Vec<Planned> = (0..4)
        .map(|seed| planned(folder.path(), "e", seed))
        .collect();
    ended(&due[2], Outcome::Finished);
    ended(&due[3], failed("theirs"));
    let mut script = Script::default();
    script.lives.insert(
        0,
        [vec![Message::Event(Event::Finished), exited("exit code 0")]].into(),
    );
    script.lives.insert(1, [vec![exited("exit code 3")]].into());
    for number in 2..4 {
        script.lives.insert(
            number,
            [vec![Message::Event(Event::Claimed), exited("exit code 0")]].into(),
        );
    }
    let (summary, progress) = play_shown(&mut script, OPTIONS, &due, folder.path());
    assert_eq!((summary.finished, summary.failed.len()), (2, 2));
    assert!(
        progress.status().contains("4 of 4 runs done"),
        "{}",
        progress.status()
    );
}

#[test]
fn a_run_whose_claim_can_no_longer_be_read_is_not_waited_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let due = [planned(folder.path(), "e", 0)];
    let claims = folder.path().join("e/.claims");
    std::fs::create_dir_all(folder.path().join("e")).expect("made");
    std::fs::write(&claims, "in the way").expect("written");
    let mut script = Script::default();
    let refused = Event::Failed {
        error: "cannot claim it".to_owned(),
    };
    let lives =
        [Event::Claimed, refused].map(|event| vec![Message::Event(event), exited("exit code 1")]);
    script.lives.insert(0, lives.into());
    let summary = play_due(&mut script, OPTIONS, &due, folder.path());
    assert_eq!(
        summary.failed,
        [(due[0].spec.id.clone(), "cannot claim it".to_owned())]
    );
}

#[test]
fn a_stop_lets_the_runs_under_way_leave_and_starts_no_other() {
    let stop = StopRequest::default();
    let mut script = Script {
        stop_at: Some((2, stop)),
        ..Script::default()
    };
    for number in 0..2 {
        script.lives.insert(number, [vec![began()]].into());
    }
    let (summary, due, _folder) = play(&mut script, OPTIONS, 5);
    assert_eq!(
        (summary.left, summary.interrupted, summary.failed.len()),
        (5, true, 0)
    );
    assert_eq!(
        (script.stopped.as_slice(), script.started.len()),
        ([0, 1].as_slice(), 2)
    );
    assert!(
        due.iter().all(|run| !run.paths.complete.exists()),
        "a stop was recorded as an end"
    );
}

#[test]
fn no_more_run_together_than_wanted_and_the_longest_begin_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut due: Vec<Planned> = (0..4)
        .map(|seed| planned(folder.path(), "e", seed))
        .collect();
    for (run, env_steps) in due.iter_mut().zip([100, 400, 200, 300]) {
        run.spec.budget.env_steps = constant(env_steps);
    }
    let mut script = Script::default();
    let summary = play_due(&mut script, OPTIONS, &due, folder.path());
    assert_eq!((summary.finished, script.most), (4, 2));
    assert_eq!(script.started, [1, 3, 2, 0]);
}

#[test]
fn no_place_stays_empty_while_a_run_waits() {
    let mut script = Script::default();
    script.lives.insert(1, [crashes(), finishes(1.0)].into());
    let (summary, ..) = play(
        &mut script,
        Options {
            jobs: 3,
            retries: 1,
            ..OPTIONS
        },
        7,
    );
    assert_eq!((summary.finished, script.started.len()), (7, 8));
    let idle = script
        .waits
        .iter()
        .find(|&&(running, started)| running < 3 && started < 8);
    assert_eq!(idle, None, "running and started");
}

#[test]
fn a_run_of_another_process_is_waited_for_and_taken_up_when_it_is_let_go() {
    let folder = tempfile::tempdir().expect("a folder");
    let due = [planned(folder.path(), "e", 0)];
    let claim = Claim::take(&due[0].paths).expect("made").expect("free");
    let mut script = Script::default();
    let claimed = vec![Message::Event(Event::Claimed), exited("exit code 0")];
    script.lives.insert(0, [claimed, finishes(1.0)].into());
    let summary = std::thread::scope(|scope| {
        scope.spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            drop(claim); // the other process dies
        });
        play_due(&mut script, OPTIONS, &due, folder.path())
    });
    assert_eq!((summary.finished, script.started.len()), (1, 2));
}

#[test]
fn a_run_that_another_process_lets_go_waits_in_its_place_of_the_queue() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut due: Vec<Planned> = (0..3)
        .map(|seed| planned(folder.path(), "e", seed))
        .collect();
    for (run, env_steps) in due.iter_mut().zip([100, 400, 200]) {
        run.spec.budget.env_steps = constant(env_steps);
    }
    let mut script = Script::default();
    script.lives.insert(
        1,
        [vec![Message::Event(Event::Claimed), exited("exit code 0")]].into(),
    );
    script.lives.insert(2, [vec![began()]].into());
    // Longer than the pause between two looks around.
    let hang_timeout = LOOK_AROUND + Duration::from_millis(500);
    play_due(
        &mut script,
        Options {
            jobs: 1,
            hang_timeout,
            ..OPTIONS
        },
        &due,
        folder.path(),
    );
    assert_eq!(script.started, [1, 2, 1, 0]);
}
