use super::*;

#[test]
fn names_cannot_lead_elsewhere() {
    let results = Path::new("results");
    for bad in [
        "",
        "..",
        ".",
        "a/../../b",
        "/etc",
        "a//b",
        "a/",
        r"a\b",
        "c:d",
        "a\0",
        "x.partial",
        "x.replaced",
        "x.old-1/y",
        ".git",
    ] {
        assert!(RunPaths::new(results, "e", bad).is_err(), "{bad:?}");
    }
    for bad in ["", "..", "a/b", "/"] {
        assert!(RunPaths::new(results, bad, "a").is_err(), "{bad:?}");
    }
    assert!(RunPaths::new(results, "e", &"x".repeat(201)).is_err());
}

#[test]
fn a_run_lies_where_the_design_says() {
    let paths = RunPaths::new(
        Path::new("r"),
        "ablation",
        "HalfCheetah-v2/mcpo d=0.001/seed-0",
    )
    .expect("a good id");
    assert_eq!(
        paths.complete,
        Path::new("r/ablation/runs/HalfCheetah-v2/mcpo d=0.001/seed-0")
    );
    assert_eq!(
        paths.partial,
        Path::new("r/ablation/runs/HalfCheetah-v2/mcpo d=0.001/seed-0.partial")
    );
}

#[cfg(unix)]
#[test]
fn a_folder_that_is_a_link_is_not_written_to() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = RunPaths::new(folder.path(), "e", "a/b").expect("a good id");
    let other = folder.path().join("other");
    fs::create_dir_all(&other).expect("made");
    fs::write(other.join(".writing-theirs"), "somebody's").expect("written");
    fs::create_dir_all(paths.partial.parent().expect("a folder")).expect("made");
    std::os::unix::fs::symlink(&other, &paths.partial).expect("linked");
    let error = paths.open().expect_err("a link").to_string();
    assert!(
        error.contains("b.partial") && error.contains("a link"),
        "{error}"
    );
    assert_eq!(fs::read_dir(&other).expect("readable").count(), 1);
}

#[test]
fn what_is_set_aside_is_kept_and_not_scanned() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = RunPaths::new(folder.path(), "e", "a/b").expect("a good id");
    for content in ["first", "second"] {
        fs::create_dir_all(&paths.complete).expect("made");
        fs::write(RunPaths::progress(&paths.complete), content).expect("written");
        assert_eq!(paths.set_aside().expect("renamed").len(), 1);
        assert!(!paths.complete.exists());
    }
    let kept = |n: u32| {
        fs::read_to_string(
            folder
                .path()
                .join(format!("e/runs/a/b.old-{n}/progress.parquet.old")),
        )
    };
    assert_eq!(kept(1).expect("kept"), "first");
    assert_eq!(kept(2).expect("kept"), "second");
    assert!(paths.set_aside().expect("nothing to do").is_empty());
}

#[test]
fn what_a_killed_process_was_writing_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = RunPaths::new(folder.path(), "e", "a/b").expect("a good id");
    paths.open().expect("made");
    let policy = RunPaths::kept_policy(&paths.partial, 1);
    let policies = RunPaths::kept_policies(&paths.partial);
    fs::create_dir(&policies).expect("made");
    for file in [
        paths.partial.join(".writing-x1"),
        policies.join(".writing-x2"),
    ] {
        fs::write(file, "half").expect("written");
    }
    for file in [RunPaths::checkpoint(&paths.partial), policy.clone()] {
        fs::write(file, "whole").expect("written");
    }
    paths.open().expect("taken up");
    let files = |folder| -> Vec<_> {
        fs::read_dir(folder)
            .expect("readable")
            .map(|entry| entry.expect("e").path())
            .filter(|p| p.is_file())
            .collect()
    };
    assert_eq!(
        files(&paths.partial),
        [RunPaths::checkpoint(&paths.partial)]
    );
    assert_eq!(files(&policies), [policy]);
}

fn finished(env_steps: u64) -> Manifest {
    Manifest {
        outcome: Outcome::Finished,
        env_steps,
        ..Manifest::new(crate::record::rows::tests::stamp())
    }
}

#[test]
fn a_longer_run_takes_the_place_of_the_shorter_one_whenever_its_process_is_killed() {
    // What lies where after each step of `settle`: nothing renamed yet, the shorter one away, the
    // longer one there.
    for step in 0..3 {
        let folder = tempfile::tempdir().expect("a folder");
        let paths = RunPaths::new(folder.path(), "e", "a/b").expect("a good id");
        paths.open().expect("made");
        fs::write(RunPaths::log(&paths.partial), "first\n").expect("written");
        fs::write(RunPaths::checkpoint(&paths.partial), "short").expect("written");
        paths.close(&finished(100)).expect("closed");
        assert!(
            RunPaths::kept_state(&paths.complete).exists()
                && !RunPaths::checkpoint(&paths.complete).exists()
        );
        paths.open().expect("to be longer");
        assert_eq!(
            fs::read_to_string(RunPaths::log(&paths.partial)).expect("brought along"),
            "first\n"
        );
        for file in [RunPaths::checkpoint, RunPaths::heartbeat] {
            fs::write(file(&paths.partial), "long").expect("written");
        }
        fs::write(paths.partial.join(".writing-x"), "half").expect("written");
        finished(200)
            .write(&RunPaths::manifest(&paths.partial))
            .expect("its last word");
        if step > 0 {
            fs::rename(&paths.complete, paths.replaced()).expect("renamed");
        }
        if step > 1 {
            fs::rename(
                RunPaths::checkpoint(&paths.partial),
                RunPaths::kept_state(&paths.partial),
            )
            .expect("renamed");
            fs::remove_file(RunPaths::heartbeat(&paths.partial)).expect("there");
            fs::remove_file(paths.partial.join(".writing-x")).expect("there");
            fs::rename(&paths.partial, &paths.complete).expect("renamed");
            assert!(paths.is_unsettled());
        }
        paths.settle().expect("settled");
        assert!(!paths.is_unsettled() && !paths.partial.exists() && !paths.replaced().exists());
        assert_eq!(
            paths
                .ended()
                .expect("readable")
                .map(|ended| ended.env_steps),
            Some(200)
        );
        let mut names: Vec<_> = fs::read_dir(&paths.complete)
            .expect("readable")
            .map(|entry| entry.expect("e").file_name())
            .collect();
        names.sort();
        assert_eq!(
            names,
            ["log.txt", "run.json", "state.checkpoint"],
            "step {step}"
        );
        assert_eq!(
            fs::read_to_string(RunPaths::kept_state(&paths.complete)).expect("readable"),
            "long"
        );
    }
}

#[test]
fn a_longer_run_that_fails_leaves_the_shorter_one_in_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = RunPaths::new(folder.path(), "e", "a/b").expect("a good id");
    paths.open().expect("made");
    fs::create_dir(RunPaths::kept_policies(&paths.partial)).expect("made");
    fs::write(RunPaths::kept_policy(&paths.partial, 5), "policy").expect("written");
    paths.close(&finished(100)).expect("closed");
    paths.open().expect("to be longer");
    fs::write(RunPaths::checkpoint(&paths.partial), "long").expect("written");
    let outcome = Outcome::Failed {
        error: "boom".to_owned(),
        log_tail: Vec::new(),
    };
    paths
        .close(&Manifest {
            outcome,
            ..finished(150)
        })
        .expect("closed");
    assert_eq!(
        paths
            .ended()
            .expect("readable")
            .map(|ended| ended.env_steps),
        Some(100)
    );
    assert!(
        RunPaths::checkpoint(&paths.partial).exists(),
        "its progress is lost"
    );
    assert!(RunPaths::kept_policy(&paths.partial, 5).exists());
}

#[test]
fn a_file_in_the_way_makes_the_results_unwritable() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    assert!(check_writable(&file).is_err());
    check_writable(&folder.path().join("new/results")).expect("made");
    assert_eq!(
        fs::read_dir(folder.path().join("new/results"))
            .expect("readable")
            .count(),
        0,
        "the probe was left"
    );
}

#[test]
fn a_file_of_a_run_tells_the_folder_of_results_while_it_is_in_its_place() {
    let results = |file: &str| RunPaths::results_of(Path::new(file), "e", "a/b/seed-0");
    for file in [
        "/r/e/runs/a/b/seed-0",
        "/r/e/runs/a/b/seed-0/progress.parquet",
        "/r/e/runs/a/b/seed-0/policies/1",
    ] {
        assert_eq!(results(file), Some("/r".into()), "{file}");
    }
    assert_eq!(results("/r/e/runs/a/b/seed-1/progress.parquet"), None);
    assert_eq!(results("/downloads/progress.parquet"), None);
}
