use super::*;
use crate::{measured::progress, report::fixture};

fn loaded(run: &Run, folder: &Path) -> Run {
    load(std::slice::from_ref(&run.spec), folder, progress::COLUMNS)
        .expect("a good id")
        .runs
        .remove(0)
}

fn failure(run: &Run) -> &str {
    match &run.state {
        State::Failed { error } => error,
        other => panic!("it did not fail: {other:?}"),
    }
}

#[test]
fn a_damaged_file_is_one_failed_run_that_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = fixture::ppo("Hopper-v2", 1)
        .finished(&[(100, &[1.0])])
        .progress("kl", &[(10, 0.5)]);
    fixture::record(&good, folder.path());
    for name in ["progress.parquet", "evaluations.parquet", "run.json"] {
        let run = fixture::ppo("Hopper-v2", 0)
            .finished(&[(100, &[1.0])])
            .progress("kl", &[(10, 0.5)]);
        fixture::record(&run, folder.path());
        let paths =
            RunPaths::new(folder.path(), &run.spec.experiment, &run.spec.id).expect("a good id");
        let bytes = std::fs::read(paths.complete.join(name)).expect("it was written");
        std::fs::write(paths.complete.join(name), &bytes[..bytes.len() / 2]).expect("written");
        let runs = load(
            &[run.spec.clone(), good.spec.clone()],
            folder.path(),
            progress::COLUMNS,
        )
        .expect("good ids")
        .runs;
        assert!(
            failure(&runs[0]).contains(name),
            "{name}: {}",
            failure(&runs[0])
        );
        assert!(runs[1].recording().is_some(), "{name}");
    }
    let run = fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])]);
    fixture::record(&run, folder.path());
    let paths =
        RunPaths::new(folder.path(), &run.spec.experiment, &run.spec.id).expect("a good id");
    std::fs::write(RunPaths::progress(&paths.complete), "not Parquet").expect("written");
    let runs = load(&[run.spec], folder.path(), &[])
        .expect("a good id")
        .runs;
    assert!(runs[0].recording().is_some(), "progress was not asked for");
}

#[test]
fn a_final_return_that_is_no_number_is_a_failure_and_an_earlier_one_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let run = fixture::ppo("Hopper-v2", 0).finished(&[(50, &[1.0]), (100, &[1.0, bad])]);
        fixture::record(&run, folder.path());
        assert_eq!(
            failure(&loaded(&run, folder.path())),
            format!("the return of its final evaluation is {bad}")
        );
        let run = fixture::ppo("Hopper-v2", 0).finished(&[(50, &[bad]), (100, &[1.0])]);
        fixture::record(&run, folder.path());
        assert!(loaded(&run, folder.path()).recording().is_some());
    }
    let run = fixture::ppo("Hopper-v2", 0).finished(&[]);
    fixture::record(&run, folder.path());
    assert_eq!(
        failure(&loaded(&run, folder.path())),
        "it has no final evaluation"
    );
}

#[test]
fn a_demonstrations_return_is_told_where_all_that_learned_from_one_learned_from_the_same() {
    let finished = |seed, digest, mean_return| {
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, seed)
            .finished(&[(100, &[1.0])])
            .demonstrated(digest, mean_return)
    };
    let one = finished(0, Some("a"), Some(974.5));
    let told = |other: Run| demonstrated_return(&[&one, &other]);
    assert_eq!(
        told(finished(1, Some("b"), Some(974.5))),
        None,
        "another demonstration"
    );
    assert_eq!(
        told(finished(1, None, None)),
        None,
        "it may have been another"
    );
    assert_eq!(
        told(finished(1, Some("a"), None)),
        Some(974.5),
        "an older program's record of the same"
    );
    assert_eq!(
        told(fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])])),
        Some(974.5),
        "PPO has none"
    );
    assert_eq!(
        told(fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1)),
        Some(974.5),
        "nothing is recorded"
    );
    assert_eq!(
        demonstrated_return(&[&finished(0, Some("a"), None)]),
        None,
        "no rewards, or an older program"
    );
    assert_eq!(
        demonstrated_return(&[&fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])])]),
        None
    );
}

#[test]
fn runs_come_back_as_they_were_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let finished = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0)
        .finished(&[(50, &[1.0, 2.0]), (100, &[3.0])])
        .progress("mmd", &[(10, 0.5), (20, 0.25)])
        .demonstrated(Some("a"), Some(974.5));
    let failed = fixture::ppo("Hopper-v2", 1).failed("training diverged");
    let missing = fixture::ppo("Hopper-v2", 2);
    fixture::record(&finished, folder.path());
    fixture::record(&failed, folder.path());
    let plan = [&finished, &failed, &missing].map(|run| run.spec.clone());
    let runs = load(&plan, folder.path(), progress::COLUMNS)
        .expect("readable")
        .runs;
    assert_eq!(
        [&runs[1].state, &runs[2].state],
        [&failed.state, &missing.state]
    );
    assert!(runs[1].trace.is_some() && runs[2].trace.is_none());
    let (read, written) = (
        runs[0].recording().expect("finished"),
        finished.recording().expect("finished"),
    );
    assert_eq!(read.evaluations, written.evaluations);
    assert_eq!(
        (&read.demonstration, &read.demonstrated),
        (&written.demonstration, &written.demonstrated)
    );
    assert_eq!(
        read.progress.get(&progress::MMD),
        written.progress.get(&progress::MMD)
    );
    assert_eq!(
        read.progress.get(&progress::ENV_STEPS),
        written.progress.get(&progress::ENV_STEPS)
    );
    assert_eq!(read.progress.get(&progress::KL), Some(&[None, None][..]));
}

#[test]
fn a_run_under_way_is_missing_and_tells_how_far_it_has_come() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = fixture::ppo("Hopper-v2", 0)
        .finished(&[(20, &[1.0, 3.0])])
        .progress("kl", &[(10, 0.5), (30, f64::NAN)]);
    fixture::record_under_way(&rows, folder.path());
    let run = loaded(&rows, folder.path());
    assert_eq!(run.state, State::Missing);
    let so_far = run.under_way.expect("rows");
    assert_eq!(
        (so_far.env_steps, so_far.recording.final_returns().len()),
        (30, 2)
    );
    assert_eq!(
        so_far.recording.progress.get(&progress::ENV_STEPS),
        Some(&[Some(10.0), Some(30.0)][..])
    );
    let kl = so_far
        .recording
        .progress
        .get(&progress::KL)
        .expect("it was asked for");
    assert!(
        kl[0] == Some(0.5) && kl[1].is_some_and(f64::is_nan),
        "{kl:?}"
    );
    let longer = fixture::ppo("Hopper-v2", 0).budget(7);
    assert_eq!(
        loaded(&longer, folder.path()).under_way,
        None,
        "another specification's"
    );
    let paths =
        RunPaths::new(folder.path(), &run.spec.experiment, &run.spec.id).expect("a good id");
    std::fs::write(RunPaths::checkpoint(&paths.partial), "damaged").expect("written");
    let loaded = load(&[run.spec], folder.path(), progress::COLUMNS).expect("a good id");
    assert!(
        loaded.runs[0].under_way.is_none() && loaded.remarks[0].contains("cannot be drawn"),
        "{:?}",
        loaded.remarks
    );
}
