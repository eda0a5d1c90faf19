//! The program as a user calls it: what it runs, skips, refuses and shows.

use std::{collections::BTreeSet, fs};

use crate::workbench::{ALL, CAR, PENDULUM, Workbench, snapshot, texts};
use mcpo_run::record::{Outcome, RunPaths, Stamp, policy, rows};

#[test]
fn a_matrix_is_run_and_recorded_and_skipped_the_next_time() {
    let bench = Workbench::new(1024);
    let (_, stderr) = bench.expect(0, &["tiny.toml"]);
    assert!(
        stderr.contains("4 runs to do") && stderr.contains("4 of 4 runs finished"),
        "{stderr}"
    );
    for id in ALL {
        let manifest = bench.manifest("results", id);
        assert_eq!(
            (
                &manifest.outcome,
                manifest.env_steps,
                manifest.attempts.len()
            ),
            (&Outcome::Finished, 1024, 1)
        );
        let folder = bench.run("results", id).complete;
        let stamps: Vec<Stamp> = vec![
            rows::read_stamp(&RunPaths::progress(&folder)).expect("readable"),
            rows::read_stamp(&RunPaths::evaluations(&folder)).expect("readable"),
        ];
        assert!(
            stamps.iter().all(|stamp| *stamp == manifest.stamp),
            "the files do not say what run.json says"
        );
        let (_, stamp) = policy::read(&RunPaths::policy(&folder)).expect("readable");
        assert_eq!(stamp, manifest.stamp.without_origin());
        let keys = rows::read_keys(&RunPaths::evaluations(&folder)).expect("readable");
        assert_eq!(
            (keys.run.as_str(), keys.algorithm.as_str(), keys.d),
            (id, "ppo", None)
        );
        assert!(!bench.run("results", id).partial.exists());
        let names: BTreeSet<_> = fs::read_dir(&folder)
            .expect("readable")
            .map(|e| e.expect("e").file_name())
            .collect();
        let expected = [
            "evaluations.parquet",
            "log.txt",
            "policy.safetensors",
            "progress.parquet",
            "run.json",
            "state.checkpoint",
        ];
        assert_eq!(names, expected.into_iter().map(Into::into).collect());
    }
    let before = snapshot(&bench.path("results/tiny/runs"));
    bench.expect(0, &["run", "tiny.toml", "--quiet"]);
    assert_eq!(
        snapshot(&bench.path("results/tiny/runs")),
        before,
        "a finished run was touched"
    );
}

#[test]
fn results_do_not_depend_on_how_many_run_at_a_time() {
    let bench = Workbench::new(1024);
    for jobs in ["1", "2", "4"] {
        bench.expect(0, &["--jobs", jobs, "--results", jobs, "tiny.toml"]);
    }
    for id in ALL {
        let one = bench.recorded("1", id);
        assert_eq!(one, bench.recorded("2", id));
        assert_eq!(one, bench.recorded("4", id));
        let bytes =
            |jobs| fs::read(RunPaths::policy(&bench.run(jobs, id).complete)).expect("readable");
        assert_eq!(bytes("1"), bytes("4"), "{id}: the policy's bytes differ");
    }
    assert_ne!(
        bench.recorded("1", ALL[0]),
        bench.recorded("1", ALL[1]),
        "two seeds gave the same run"
    );
}

#[test]
fn another_specification_is_refused_with_its_keys_and_set_aside_when_told() {
    let bench = Workbench::new(1024);
    bench.expect(0, &["tiny.toml", "--only", "seed=0"]);
    let before = snapshot(&bench.path("results"));
    let (_, stderr) = bench.expect(2, &["tiny.toml", "--set", "algorithms.ppo.epochs=3"]);
    assert!(
        stderr.contains("epochs: 10 -> 3") && stderr.contains("--fresh"),
        "{stderr}"
    );
    assert_eq!(
        snapshot(&bench.path("results")),
        before,
        "something recorded was touched"
    );
    let (stdout, _) = bench.expect(
        0,
        &[
            "plan",
            "tiny.toml",
            "--explain",
            "--set",
            "algorithms.ppo.epochs=3",
        ],
    );
    assert!(
        stdout.contains("refused: what is recorded differs in")
            && stdout.contains("nothing is recorded"),
        "{stdout}"
    );

    bench.expect(
        0,
        &[
            "tiny.toml",
            "--only",
            "seed=0",
            "--set",
            "algorithms.ppo.epochs=3",
            "--fresh",
        ],
    );
    let run = bench.run("results", PENDULUM).complete;
    let old = run.with_file_name("seed-0.old-1");
    let kept = fs::read(RunPaths::policy(&old)).expect("kept");
    assert!(before.iter().any(|(_, bytes)| *bytes == kept));
    assert_ne!(fs::read(RunPaths::policy(&run)).expect("run anew"), kept);
    assert!(
        !RunPaths::progress(&old).exists(),
        "a scan would count the run twice"
    );
}

#[test]
fn two_programs_on_the_same_results_share_the_work() {
    let bench = Workbench::new(16_384);
    let arguments = ["tiny.toml", "--jobs", "2"];
    let both = [bench.start(&arguments), bench.start(&arguments)];
    for child in both {
        texts(&child.wait_with_output().expect("it ends"), 0, &arguments);
    }
    for id in ALL {
        let manifest = bench.manifest("results", id);
        assert_eq!(
            (manifest.outcome, manifest.attempts.len()),
            (Outcome::Finished, 1),
            "{id} was run twice"
        );
    }
}

#[test]
fn bad_input_is_told_before_anything_is_written() {
    let bench = Workbench::new(1024);
    let refused = |arguments: &[&str], expected: &str| {
        let (_, stderr) = bench.expect(2, arguments);
        assert!(stderr.contains(expected), "{arguments:?}: {stderr}");
        assert!(
            !bench.path("results").exists(),
            "{arguments:?} wrote something"
        );
    };
    refused(&["missing.toml"], "missing.toml");
    refused(&["statsu"], "did you mean `status`");
    refused(&["tiny.toml", "--jobs", "0"], "0");
    refused(&["tiny.toml", "--set", "budget.env_stps=5"], "env_steps");
    refused(&["tiny.toml", "--set", "budget.env_steps=-5"], "-5");
    refused(
        &["tiny.toml", "--only", "env=Hopper-v2"],
        "none of the 4 runs",
    );
    refused(&["tiny.toml", "--set", "name='../outside'"], "outside");
    fs::write(bench.path("file"), "").expect("written");
    refused(&["tiny.toml", "--results", "file/results"], "file/results");
}

#[test]
fn a_demonstration_that_cannot_be_used_is_told_before_anything_is_written() {
    let bench = Workbench::new(1024);
    let matrix = fs::read_to_string(bench.path("tiny.toml")).expect("readable");
    let matrix = matrix
        .replace(r#"["ppo"]"#, r#"["mcpo"]"#)
        .replace("algorithms.ppo", "algorithms.mcpo");
    let matrix = format!("demonstrations = \"demo.parquet\"\n{matrix}");
    fs::write(bench.path("tiny.toml"), matrix).expect("written");
    let (_, stderr) = bench.expect(2, &["tiny.toml"]);
    assert!(stderr.contains("demo.parquet"), "missing: {stderr}");
    fs::write(bench.path("demo.parquet"), "PAR1 but no more").expect("written");
    let (_, stderr) = bench.expect(2, &["tiny.toml"]);
    assert!(stderr.contains("demo.parquet"), "malformed: {stderr}");
    assert!(!bench.path("results").exists());
}

#[test]
fn a_plan_and_a_dry_run_start_nothing() {
    let bench = Workbench::new(1024);
    for arguments in [
        &["plan", "tiny.toml"][..],
        &["tiny.toml", "--dry-run"],
        &["status", "tiny.toml"],
    ] {
        let (stdout, _) = bench.expect(0, arguments);
        assert!(stdout.contains("4 runs"), "{stdout}");
    }
    assert!(!bench.path("results").exists());
}

#[test]
fn what_is_recorded_can_be_shown_and_played() {
    let bench = Workbench::new(1024);
    bench.expect(0, &[".", "--only", "seed=1"]);
    let (stdout, _) = bench.expect(0, &["status", "tiny.toml"]);
    assert!(
        stdout.contains("2 finished") && stdout.contains("2 to do"),
        "{stdout}"
    );
    let run = bench.run("results", CAR).complete;
    for file in [
        "progress.parquet",
        "evaluations.parquet",
        "policy.safetensors",
        "run.json",
        "log.txt",
    ] {
        let path = run.join(file);
        let (stdout, _) = bench.expect(0, &["show", path.to_str().expect("text")]);
        for expected in [
            CAR,
            "fingerprint",
            "cpu class",
            "\"ppo\":1",
            "--only seed=1",
            "\"minibatch\": 64",
        ] {
            assert!(
                stdout.contains(expected),
                "{file}: no {expected} in\n{stdout}"
            );
        }
    }
    let folder = run.to_str().expect("text");
    let (first, _) = bench.expect(0, &["eval", folder, "--episodes", "3"]);
    assert!(
        first.contains("3 episodes") && first.contains("dense return"),
        "{first}"
    );
    assert_eq!(
        bench.expect(0, &["eval", folder, "--episodes", "3"]).0,
        first,
        "an evaluation does not repeat"
    );
    let (_, stderr) = bench.expect(2, &["show", "tiny.toml"]);
    assert!(stderr.contains("no provenance"), "{stderr}");
}

#[test]
fn a_policy_that_does_not_fit_what_it_says_is_not_played() {
    let bench = Workbench::new(1024);
    bench.expect(
        0,
        &["tiny.toml", "--only", "env=InvertedPendulum-v2,seed=0"],
    );
    let folder = bench.run("results", PENDULUM).complete;
    let own = RunPaths::policy(&folder);
    let (agent, stamp) = policy::read(&own).expect("readable");
    let refused = |stamp: &Stamp, expected: &str| {
        policy::write(&bench.path("other.safetensors"), &agent, stamp).expect("written");
        let (_, stderr) = bench.expect(2, &["eval", "other.safetensors", "--episodes", "2"]);
        assert!(
            stderr.contains("other.safetensors") && stderr.contains(expected),
            "{stderr}"
        );
    };
    let with = |change: fn(&mut serde_json::Value)| {
        let mut stamp = stamp.clone();
        change(&mut stamp.spec);
        stamp
    };
    refused(
        &with(|spec| spec["env"] = "MountainCarContinuous-v0".into()),
        "has no reward sparse3",
    );
    let other = with(|spec| {
        (spec["env"], spec["reward"]) = ("MountainCarContinuous-v0".into(), "dense".into())
    });
    refused(
        &other,
        "observations of 4 and actions of 1 numbers; its environment has observations of 2 and",
    );
    refused(
        &with(|spec| spec["max_steps"] = (1_u64 << 62).into()),
        "at most 1000000 are played",
    );
    // However many environments it asks for, as many play as there are episodes.
    let many = with(|spec| spec["rollout"]["environments"] = 8_000_000.into());
    policy::write(&bench.path("other.safetensors"), &agent, &many).expect("written");
    let (played, _) = bench.expect(0, &["eval", "other.safetensors", "--episodes", "2"]);
    assert_eq!(
        bench
            .expect(
                0,
                &["eval", folder.to_str().expect("text"), "--episodes", "2"]
            )
            .0,
        played
    );

    fs::remove_file(folder.join("policy.safetensors")).expect("there");
    let (_, stderr) = bench.expect(2, &["eval", folder.to_str().expect("text")]);
    assert!(stderr.contains("keeps no policy"), "{stderr}");
    // Other weights than run.json names.
    let mut changed = agent.clone();
    changed.value.parameters_mut()[0] += 1.0;
    policy::write(&own, &changed, &stamp).expect("written");
    let (_, stderr) = bench.expect(2, &["eval", folder.to_str().expect("text")]);
    assert!(
        stderr.contains("is not the policy that the run.json beside it records"),
        "{stderr}"
    );
}

#[test]
fn a_name_that_reports_have_of_their_own_is_refused() {
    let bench = Workbench::new(1024);
    let matrix = fs::read_to_string(bench.path("tiny.toml")).expect("readable");
    for name in ["README", "readme", "f-curves"] {
        let table = format!(
            "[[tables]]\nname = '{name}'\ntitle = 't'\nrows = ['env']\ncolumns = 'algorithm'\n"
        );
        fs::write(bench.path("named.toml"), matrix.clone() + &table).expect("written");
        let (_, stderr) = bench.expect(2, &["plan", "named.toml"]);
        assert!(
            stderr.contains("is the name of one of the report's own files"),
            "{stderr}"
        );
    }
}

#[test]
fn a_budget_in_whole_rollouts_and_results_elsewhere_are_told() {
    let bench = Workbench::new(257);
    let (stdout, _) = bench.expect(0, &["plan", "tiny.toml"]);
    assert!(
        stdout.contains("rollouts are whole: 512 steps for 257 with rollouts of 256"),
        "{stdout}"
    );
    let (stdout, _) = bench.expect(
        0,
        &[
            "status",
            "tiny.toml",
            "--only",
            "seed=0,env=InvertedPendulum-v2",
        ],
    );
    assert!(
        stdout.contains("1 run: 1 to do") && stdout.contains("nothing is recorded under results"),
        "{stdout}"
    );
    let (stdout, _) = bench.expect(0, &["tiny.toml", "--quiet", "--only", "seed=0"]);
    assert_eq!(stdout, "", "quiet");
    let notes = fs::read_to_string(bench.path("results/tiny/report/README.md")).expect("written");
    assert!(
        notes.contains("trained for 512, since rollouts are whole"),
        "{notes}"
    );
    let elsewhere = tempfile::tempdir().expect("a folder");
    let path = bench.path("tiny.toml");
    let arguments = ["status", path.to_str().expect("text")];
    let output = bench
        .program(&arguments)
        .current_dir(elsewhere.path())
        .output()
        .expect("it starts");
    let (stdout, _) = texts(&output, 0, &arguments);
    assert!(
        stdout.contains("holds results: --results names it"),
        "{stdout}"
    );
}

#[test]
fn shells_manuals_and_editors_are_served() {
    let bench = Workbench::new(1024);
    assert!(
        bench
            .expect(0, &["completions", "bash"])
            .0
            .contains("mcpo-run")
    );
    assert!(bench.expect(0, &["man"]).0.contains(".TH"));
    assert!(bench.expect(0, &["man", "plan"]).0.contains("explain"));
    let schema: serde_json::Value =
        serde_json::from_str(&bench.expect(0, &["schema"]).0).expect("JSON");
    assert!(schema.get("properties").is_some());
    assert!(
        !bench.expect(0, &["--help"]).0.contains("worker"),
        "the workers' command is nobody else's"
    );
}

#[test]
fn a_report_that_cannot_be_written_is_told_with_its_cause_and_hides_no_failure() {
    let bench = Workbench::new(1024);
    fs::create_dir_all(bench.path("results/tiny")).expect("made");
    fs::write(bench.path("results/tiny/report"), "in the way").expect("written");
    let (_, stderr) = bench.expect(2, &["tiny.toml", "--only", "seed=0"]);
    assert!(
        stderr.contains("error: the runs are recorded, but not their report: cannot"),
        "{stderr}"
    );
    let (_, stderr) = bench.expect(
        1,
        &[
            "tiny.toml",
            "--set",
            "algorithms.ppo.learning_rate=1e38",
            "--results",
            "results",
            "--fresh",
        ],
    );
    assert!(
        stderr.contains("diverged") && stderr.contains("but not their report"),
        "{stderr}"
    );
}

#[test]
fn runs_that_two_blocks_name_are_run_once_and_told() {
    let bench = Workbench::new(1024);
    let matrix = fs::read_to_string(bench.path("tiny.toml")).expect("readable");
    let again =
        "[[matrix]]\nseed = [1, 2]\nenv = [\"InvertedPendulum-v2\"]\nalgorithm = [\"ppo\"]\n";
    fs::write(bench.path("tiny.toml"), format!("{matrix}\n{again}")).expect("written");
    let (stdout, _) = bench.expect(0, &["plan", "tiny.toml"]);
    assert!(
        stdout.contains("5 runs, 0 finished") && stdout.contains("name 1 of their runs again"),
        "{stdout}"
    );
}
