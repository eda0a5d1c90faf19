use std::fs;

use super::*;
use crate::{
    quantity::constant,
    record::{TableDigests, rows::tests::iteration},
    schedule::tests::planned,
};

/// `run`, finished with 1,024 steps.
fn finish(run: &Planned) {
    run.paths.open().expect("made");
    let manifest = Manifest {
        outcome: Outcome::Finished,
        env_steps: 1024,
        ..Manifest::new(run.stamp.clone())
    };
    run.paths.close(&manifest).expect("closed");
}

#[test]
fn what_was_another_run_is_told_by_the_keys_that_differ() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = planned(folder.path(), "e", 0);
    finish(&run);
    assert!(matches!(run.state(), Ok(RunState::Finished(_))));
    run.spec.max_steps = 7;
    run.stamp.fingerprint = "another".to_owned();
    let Ok(RunState::Differs { keys }) = run.state() else {
        panic!("{:?}", run.state())
    };
    assert_eq!(keys, ["max_steps: 1000 -> 7"]);
}

#[test]
fn another_budget_makes_a_finished_run_one_to_extend_or_one_that_is_longer() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = planned(folder.path(), "e", 0);
    finish(&run);
    run.spec.budget.env_steps = constant(900);
    assert!(
        matches!(run.state(), Ok(RunState::Finished(_))),
        "it takes the same rollouts"
    );
    run.spec.budget.env_steps = constant(700);
    let Ok(RunState::Differs { keys }) = run.state() else {
        panic!("{:?}", run.state())
    };
    assert_eq!(keys, ["budget.env_steps: 1024 -> 700"]);
    run.spec.budget.env_steps = constant(2000);
    assert_eq!(run.spec.trained_steps(), 2048);
    let from = |state| match state {
        Ok(RunState::ToExtend { shorter, env_steps }) => {
            assert_eq!(shorter.env_steps, 1024);
            env_steps
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(from(run.state()), None, "its last state is not kept");
    let checkpoint = |n| Checkpoint {
        iterations: vec![iteration(n)],
        ..Checkpoint::default()
    };
    checkpoint(10)
        .write(
            &RunPaths::kept_state(&run.paths.complete),
            &run.stamp.fingerprint,
        )
        .expect("written");
    assert_eq!(from(run.state()), Some(1000));
    run.paths.open().expect("taken up");
    Manifest::new(run.stamp.clone())
        .write(&RunPaths::manifest(&run.paths.partial))
        .expect("written");
    let own = RunPaths::checkpoint(&run.paths.partial);
    for (n, expected) in [(3, 1000), (12, 1200)] {
        checkpoint(n)
            .write(&own, &run.stamp.fingerprint)
            .expect("written");
        assert_eq!(from(run.state()), Some(expected), "the farthest counts");
    }
    fs::write(&own, "mcpo-run checkpoint half").expect("written");
    assert_eq!(from(run.state()), Some(1000), "a damaged one does not");
    run.spec.budget.env_steps = constant(1024);
    assert!(
        matches!(run.state(), Ok(RunState::Finished(_))),
        "it is as it was"
    );
}

#[test]
fn other_evaluations_are_no_other_run_and_a_damaged_table_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut run = planned(folder.path(), "e", 0);
    run.paths.open().expect("made");
    for table in [RunPaths::progress, RunPaths::evaluations] {
        fs::write(table(&run.paths.partial), "rows").expect("written");
    }
    let tables = Some(TableDigests::of(&run.paths.partial).expect("there"));
    let manifest = Manifest {
        outcome: Outcome::Finished,
        env_steps: 1024,
        ..Manifest::new(run.stamp.clone())
    };
    run.paths
        .close(&Manifest { tables, ..manifest })
        .expect("closed");
    run.spec.evaluation.final_episodes = constant(3);
    assert!(matches!(run.state(), Ok(RunState::Finished(_))));
    assert_eq!(
        run.evaluated_otherwise(&run.stamp),
        ["evaluation.final_episodes: 50 -> 3"]
    );
    fs::write(RunPaths::evaluations(&run.paths.complete), "rowz").expect("written");
    let Ok(RunState::Damaged { reason }) = run.state() else {
        panic!("{:?}", run.state())
    };
    assert!(reason.contains("evaluations.parquet"), "{reason}");
}

#[test]
fn an_interrupted_run_is_known_by_its_checkpoint_and_a_damaged_one_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = planned(folder.path(), "e", 0);
    assert_eq!(run.state().ok(), Some(RunState::ToDo));
    run.paths.open().expect("made");
    assert_eq!(run.state().ok(), Some(RunState::ToDo));
    let path = RunPaths::checkpoint(&run.paths.partial);
    let checkpoint = Checkpoint {
        iterations: vec![crate::record::rows::tests::iteration(2)],
        ..Checkpoint::default()
    };
    checkpoint
        .write(&path, &run.stamp.fingerprint)
        .expect("written");
    assert_eq!(
        run.state().ok(),
        Some(RunState::Interrupted { env_steps: 200 })
    );
    let claim = Claim::take(&run.paths).expect("made").expect("free");
    assert_eq!(run.state().ok(), Some(RunState::Running(None)));
    drop(claim);
    fs::write(&path, "mcpo-run checkpoint 99\n").expect("written");
    let Ok(RunState::Unusable { reason }) = run.state() else {
        panic!("{:?}", run.state())
    };
    assert!(reason.contains("version 99"), "{reason}");
}
