//! Runs that are made longer: they become, to the bit, the run that was longer from the start, and
//! nothing is lost on the way.

use std::{fs, path::Path, thread, time::Duration};

use mcpo_run::record::{
    Outcome, RunPaths, UnderWay,
    compare::{self, Exactness},
};

use crate::{
    processes::{signal, wait_for},
    workbench::{PENDULUM, Workbench, snapshot, texts},
};

const SHORT: [&str; 5] = [
    "tiny.toml",
    "--only",
    "env=InvertedPendulum-v2,seed=0",
    "--results",
    "extended",
];
/// A budget that the evaluations of the shorter run, every 4,096 steps, do not divide.
const LONG: &str = "budget.env_steps=66000";

fn long() -> Vec<&'static str> {
    [&SHORT[..], &["--set", LONG]].concat()
}

/// A bench with the short run in `extended` and, from its start, the long one in `whole`.
fn bench() -> Workbench {
    let bench = Workbench::new(8192);
    bench.expect(0, &SHORT);
    let mut whole = long();
    whole[4] = "whole";
    bench.expect(0, &whole);
    bench
}

/// That the run in `extended` is the one in `whole`: every row, clocks apart, the policy, and the
/// files.
fn assert_is_whole(bench: &Workbench) {
    let [extended, whole] =
        ["extended", "whole"].map(|results| bench.run(results, PENDULUM).complete);
    let difference = compare::runs(&whole, &extended, Exactness::Bits).expect("both are readable");
    assert_eq!(difference.map(|difference| difference.to_string()), None);
    let bytes = |folder| fs::read(RunPaths::policy(folder)).expect("readable");
    assert_eq!(bytes(&whole), bytes(&extended));
    let names = |folder: &Path| -> Vec<_> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .expect("readable")
            .map(|e| e.expect("e").file_name())
            .collect();
        names.sort();
        names
    };
    assert_eq!(
        names(&whole),
        names(&extended),
        "something was left, or lost"
    );
    assert_eq!(
        names(whole.parent().expect("a folder")),
        names(extended.parent().expect("a folder"))
    );
    let [extended, whole] = ["extended", "whole"].map(|results| bench.manifest(results, PENDULUM));
    assert_eq!(
        (extended.outcome, extended.env_steps, extended.policy),
        (whole.outcome, whole.env_steps, whole.policy)
    );
}

#[test]
fn a_finished_run_whose_budget_grows_goes_on_and_is_the_longer_run() {
    let bench = bench();
    let plan = [&["plan"][..], &long()].concat();
    let (stdout, _) = bench.expect(0, &plan);
    assert!(
        stdout.contains("to extend") && stdout.contains("66,048"),
        "{stdout}"
    );
    let (stdout, _) = bench.expect(0, &[&plan[..], &["--explain"]].concat());
    assert!(
        stdout.contains("recorded with 8,192 steps, and resumes from its state at 8,192"),
        "{stdout}"
    );
    let (stdout, _) = bench.expect(0, &[&["status"][..], &long()].concat());
    assert!(
        stdout.contains("from 8,192 to 66,048 steps") && stdout.contains("1 to extend"),
        "{stdout}"
    );
    bench.expect(0, &long());
    assert_is_whole(&bench);
    let attempts = bench.manifest("extended", PENDULUM).attempts;
    assert_eq!(
        attempts
            .iter()
            .map(|attempt| attempt.from_env_steps)
            .collect::<Vec<_>>(),
        [0, 8192]
    );
    let log = fs::read_to_string(RunPaths::log(&bench.run("extended", PENDULUM).complete))
        .expect("readable");
    assert!(
        log.contains("begins at 0 of 8192") && log.contains("begins at 8192 of 66048"),
        "{log}"
    );
    // What has grown does not shrink.
    let before = snapshot(&bench.path("extended"));
    let (_, stderr) = bench.expect(2, &SHORT);
    assert!(
        stderr.contains("budget.env_steps: 66000 -> 8192") && stderr.contains("--fresh"),
        "{stderr}"
    );
    assert_eq!(
        snapshot(&bench.path("extended")),
        before,
        "something recorded was touched"
    );
}

#[test]
fn killed_at_any_instant_neither_the_shorter_run_nor_the_longer_ones_progress_is_lost() {
    let bench = bench();
    let shorter = bench.recorded("extended", PENDULUM);
    let paths = bench.run("extended", PENDULUM);
    let (mut killed, mut farthest) = (0, 0);
    for pause in [0, 30, 60, 90, 120, 150, 180] {
        let child = bench.start(&long());
        // The claim may be there before the manifest.
        let worker = bench.worker("extended", PENDULUM);
        thread::sleep(Duration::from_millis(pause));
        signal("KILL", worker);
        let output = child.wait_with_output().expect("it ends");
        if output.status.success() {
            break; // it had finished
        }
        killed += 1;
        texts(&output, 1, &["killed"]);
        if bench.manifest("extended", PENDULUM).env_steps == 8192 {
            assert_eq!(
                bench.recorded("extended", PENDULUM),
                shorter,
                "the shorter run is lost"
            );
            let (stdout, _) = bench.expect(0, &[&["status"][..], &SHORT].concat());
            assert!(stdout.contains("1 finished"), "{stdout}");
        }
        let rows = UnderWay::read(&paths)
            .expect("readable")
            .map_or(0, |rows| rows.iterations.len());
        assert!(
            rows >= farthest,
            "its progress is lost: {rows} iterations after {farthest}"
        );
        farthest = rows;
    }
    assert!(killed >= 3, "the runs were too quick to be killed");
    bench.expect(0, &long());
    assert_is_whole(&bench);
}

#[test]
fn without_its_last_state_it_is_trained_anew_which_is_said() {
    for damage in [false, true] {
        let bench = bench();
        let state = RunPaths::kept_state(&bench.run("extended", PENDULUM).complete);
        if damage {
            let bytes = fs::read(&state).expect("kept");
            fs::write(&state, &bytes[..bytes.len() / 2]).expect("cut");
        } else {
            fs::remove_file(&state).expect("there");
        }
        let (stdout, _) = bench.expect(0, &[&["plan"][..], &long(), &["--explain"]].concat());
        assert!(
            stdout.contains("will run from its start: recorded with 8,192 steps"),
            "{stdout}"
        );
        let (stdout, _) = bench.expect(0, &[&["status"][..], &long()].concat());
        assert!(
            stdout.contains("the last state of its 8,192 was not kept"),
            "{stdout}"
        );
        let (_, stderr) = bench.expect(0, &long());
        assert_eq!(
            stderr.contains("state.checkpoint is damaged"),
            damage,
            "{stderr}"
        );
        assert_is_whole(&bench);
    }
}

#[test]
fn a_signal_stops_an_extension_and_the_report_finds_its_rows() {
    let bench = bench();
    let child = bench.start(&long());
    bench.worker("extended", PENDULUM);
    bench.wait_for_checkpoint("extended", PENDULUM);
    let paths = bench.run("extended", PENDULUM);
    let rows = wait_for("rows", || UnderWay::read(&paths).ok()?);
    assert!(
        rows.iterations.len() > 8192 / 256 && rows.evaluations.iter().all(|episode| !episode.last)
    );
    assert_eq!(rows.manifest.outcome, Outcome::Begun);
    assert!(signal("INT", child.id()), "it was over before");
    texts(&child.wait_with_output().expect("it ends"), 130, &["INT"]);
    let (stdout, _) = bench.expect(0, &[&["plan"][..], &long()].concat());
    assert!(stdout.contains("to extend"), "{stdout}");
    bench.expect(0, &long());
    assert_is_whole(&bench);
}

#[test]
fn other_settings_of_evaluation_leave_a_run_as_it_is_and_are_told() {
    let bench = Workbench::new(8192);
    bench.expect(0, &SHORT);
    let before = snapshot(&bench.path("extended/tiny/runs"));
    let other = [
        &SHORT[..],
        &[
            "--set",
            "evaluation={ every = 1024, episodes = 1, final_episodes = 9 }",
        ],
    ]
    .concat();
    bench.expect(0, &other);
    assert_eq!(
        snapshot(&bench.path("extended/tiny/runs")),
        before,
        "a finished run was touched"
    );
    let (stdout, _) = bench.expect(0, &[&["plan"][..], &other, &["--explain"]].concat());
    let expected = "its evaluations differ in evaluation.every: 4096 -> 1024, evaluation.final_episodes: 2 -> 9";
    assert!(stdout.contains(expected), "{stdout}");
    let (stdout, _) = bench.expect(0, &[&["status"][..], &other].concat());
    assert!(
        stdout.contains("1 finished with other evaluation settings"),
        "{stdout}"
    );
    // Made longer, it goes on being evaluated when it was; at its end as is asked for now.
    let longer = [&other[..], &["--set", "budget.env_steps=16384"]].concat();
    bench.expect(0, &longer);
    let run = bench.run("extended", PENDULUM).complete;
    let rows =
        mcpo_run::record::rows::read_evaluations(&RunPaths::evaluations(&run)).expect("readable");
    let under_way: Vec<u64> = rows
        .iter()
        .filter(|row| !row.last)
        .map(|row| row.env_steps)
        .collect();
    assert_eq!(under_way, [0, 4096, 8192, 12_288]);
    assert_eq!(rows.iter().filter(|row| row.last).count(), 9);
    let recorded = bench.manifest("extended", PENDULUM).stamp.spec;
    assert_eq!(
        (
            &recorded["evaluation"]["every"],
            &recorded["evaluation"]["final_episodes"]
        ),
        (&4096.into(), &9.into())
    );
}
