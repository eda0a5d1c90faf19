//! A plan that several machines share out, and a machine that is lent for a while.

use std::collections::BTreeSet;

use crate::workbench::{ALL, PENDULUM, Workbench};

#[test]
fn the_shards_of_a_plan_are_the_plan() {
    let bench = Workbench::new(1024);
    bench.expect(0, &["tiny.toml", "--results", "whole"]);
    let mut done: BTreeSet<&str> = BTreeSet::new();
    for number in 1..=3 {
        let shard = format!("{number}/3");
        bench.expect(
            0,
            &["run", "tiny.toml", "--results", "shared", "--shard", &shard],
        );
        let finished = ALL
            .into_iter()
            .filter(|id| bench.run("shared", id).complete.exists())
            .collect();
        assert!(
            done.is_subset(&finished) && done.len() < finished.len(),
            "{shard} did nothing"
        );
        done = finished;
        assert!(
            !bench.path("shared/tiny/report").exists(),
            "a part has no report"
        );
    }
    assert_eq!(done.len(), ALL.len());
    for id in ALL {
        assert_eq!(
            bench.recorded("shared", id),
            bench.recorded("whole", id),
            "{id}"
        );
    }
    bench.expect(0, &["report", "tiny.toml", "--results", "shared"]);
}

#[test]
fn a_shard_that_is_none_is_refused_and_one_that_is_empty_is_done() {
    let bench = Workbench::new(1024);
    for shard in ["0/2", "3/2", "1", "x/2"] {
        let (_, stderr) = bench.expect(2, &["run", "tiny.toml", "--shard", shard]);
        assert!(stderr.contains("K/N"), "{stderr}");
    }
    bench.expect(0, &["run", "tiny.toml", "--shard", "9/9"]);
    assert!(!bench.path("results/tiny/runs").exists());
}

#[test]
fn a_run_whose_time_is_up_leaves_a_checkpoint_and_the_same_command_goes_on() {
    let bench = Workbench::new(150_000);
    let one = [
        "tiny.toml",
        "--only",
        "env=InvertedPendulum-v2,seed=0",
        "--results",
    ];
    bench.expect(0, &[&one[..], &["whole"]].concat());
    let limited = [&one[..], &["limited", "--max-time", "1s"]].concat();
    let mut calls = 0;
    loop {
        calls += 1;
        let output = bench.call(&limited);
        if output.status.success() {
            break;
        }
        assert_eq!(
            output.status.code(),
            Some(130),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        assert!(String::from_utf8_lossy(&output.stderr).contains("resumes from here"));
        assert!(calls < 200, "it never comes to its end");
    }
    assert!(calls > 1, "it was over before its time was up");
    assert_eq!(
        bench.recorded("limited", PENDULUM),
        bench.recorded("whole", PENDULUM)
    );
    bench.expect(2, &[&one[..], &["limited", "--max-time", "soon"]].concat());
}
