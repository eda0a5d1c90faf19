//! `verify` and `reproduce`: what is recorded comes again, and a number that does not is named.

use std::{fs, path::Path, process::Command};

use mcpo_run::record::{Build, Manifest, RunPaths, TableDigests, compare::TOLERANCE, rows};

use crate::workbench::{PENDULUM, Workbench, texts};

/// The matrix that is compared, of the four runs of the bench.
const VERIFY: [&str; 4] = ["verify", "tiny.toml", "--against", "record"];

/// The bench with its record.
fn with_record() -> Workbench {
    let bench = Workbench::new(1024);
    bench.expect(0, &[&VERIFY[..], &["--record"]].concat());
    bench
}

/// Makes the record of `id` that of a run whose iterations differ by `change`.
fn falsify(bench: &Workbench, id: &str, change: impl FnOnce(&mut [mcpo_run::train::Iteration])) {
    let path = RunPaths::progress(&bench.path("record/runs").join(id));
    let mut iterations = rows::read_progress(&path).expect("readable");
    let (keys, stamp) = (
        rows::read_keys(&path).expect("readable"),
        rows::read_stamp(&path).expect("readable"),
    );
    change(&mut iterations);
    rows::write_progress(&path, &keys, &stamp, &iterations).expect("written");
    let folder = bench.path("record/runs").join(id);
    let manifest = Manifest::read(&RunPaths::manifest(&folder))
        .expect("readable")
        .expect("there");
    let tables = Some(TableDigests::of(&folder).expect("both are there"));
    Manifest { tables, ..manifest }
        .write(&RunPaths::manifest(&folder))
        .expect("written");
}

/// Changes the class of machine that the record of `id` was made on.
fn move_to_another_class(bench: &Workbench, id: &str) {
    let path = RunPaths::manifest(&bench.path("record/runs").join(id));
    let mut manifest = Manifest::read(&path).expect("readable").expect("there");
    manifest.stamp.build.cpu_class = "sparc64".to_owned();
    manifest.write(&path).expect("written");
}

#[test]
fn the_committed_record_is_reproduced() {
    let arguments = [
        "verify",
        "experiments/ci.toml",
        "--against",
        "results/ci",
        "--exact",
        "--quiet",
    ];
    let mut program = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
    let (stdout, _) = texts(
        &program.args(arguments).output().expect("it starts"),
        0,
        &arguments,
    );
    let path = RunPaths::manifest(&Path::new("results/ci/runs").join(PENDULUM));
    let recorded = Manifest::read(&path)
        .expect("readable")
        .expect("there")
        .stamp
        .build;
    // On another class of machine the first iteration alone can be compared, which is said.
    let here = Build::current(serde_json::Value::Null).machine() == recorded.machine();
    let how = if here {
        "to the bit"
    } else {
        "in the first iteration, since the record was made on"
    };
    let expected = format!("28 of 28 runs are as recorded, {how}");
    assert!(
        stdout.contains("28 of 28 runs are as recorded, ") && stdout.contains(how),
        "no `{expected}` in {stdout}"
    );
}

#[test]
fn the_committed_record_names_no_machine() {
    for file in crate::workbench::snapshot(Path::new("results/ci")) {
        let text = String::from_utf8_lossy(&file.1);
        for word in [
            "\"host\"",
            "command_line",
            "\"cpu\"",
            "/home",
            "/work",
            "/tmp",
            "/root",
        ] {
            assert!(!text.contains(word), "{} says {word}", file.0.display());
        }
    }
}

#[test]
fn one_changed_number_is_named_with_its_run_iteration_and_column() {
    let bench = with_record();
    let (stdout, _) = bench.expect(0, &VERIFY);
    assert!(
        stdout.contains("4 of 4 runs are as recorded, to the bit"),
        "{stdout}"
    );
    let mut changed = None;
    falsify(&bench, PENDULUM, |iterations| {
        let kl = iterations[2].update.kl.as_mut().expect("PPO has one");
        changed = Some((*kl, kl.next_up()));
        *kl = kl.next_up();
    });
    let (stdout, _) = bench.expect(4, &VERIFY);
    let (now, recorded) = changed.expect("it was changed");
    let expected = format!("{PENDULUM}: iteration 3, kl: recorded {recorded:?}, now {now:?}\n");
    assert!(
        stdout.starts_with(&expected) && stdout.contains("3 of 4"),
        "{stdout}"
    );
    // Another class of machine is not held to the third iteration, but to the first.
    move_to_another_class(&bench, PENDULUM);
    let (stdout, _) = bench.expect(0, &VERIFY);
    assert!(
        stdout.contains("4 of 4") && stdout.contains("sparc64"),
        "{stdout}"
    );
    falsify(&bench, PENDULUM, |iterations| {
        let entropy = iterations[0].update.entropy.as_mut().expect("PPO has one");
        *entropy *= 1.0 + 2.0 * TOLERANCE;
    });
    let (stdout, _) = bench.expect(4, &VERIFY);
    assert!(
        stdout.starts_with(&format!("{PENDULUM}: iteration 1, entropy: recorded")),
        "{stdout}"
    );
}

#[test]
fn a_record_of_other_versions_is_a_difference_where_bits_are_insisted_on() {
    let bench = with_record();
    let exact = [&VERIFY[..], &["--exact"]].concat();
    let path = RunPaths::manifest(&bench.path("record/runs").join(PENDULUM));
    let whole = Manifest::read(&path).expect("readable").expect("there");
    let mut older = whole.clone();
    older.stamp.build.versions["revisions"]["ppo"] = 0.into();
    older.write(&path).expect("written");
    let (stdout, _) = bench.expect(0, &VERIFY);
    assert!(
        stdout.contains("4 of 4") && stdout.contains("the record was made by different versions"),
        "{stdout}"
    );
    let (stdout, _) = bench.expect(4, &exact);
    assert!(
        stdout.starts_with(&format!(
            "{PENDULUM}: the record was made by different versions: "
        )),
        "{stdout}"
    );
    assert!(
        stdout.contains("it must be recorded again") && stdout.contains("3 of 4"),
        "{stdout}"
    );
    // Another class of machine is no fault of the record.
    whole.write(&path).expect("written");
    move_to_another_class(&bench, PENDULUM);
    let (stdout, _) = bench.expect(0, &exact);
    assert!(
        stdout.contains("4 of 4") && stdout.contains("the record was made on sparc64"),
        "{stdout}"
    );
}

#[test]
fn runs_that_are_missing_failed_or_too_many_are_differences() {
    let bench = with_record();
    let folder = bench.path("record/runs").join(PENDULUM);
    let aside = bench.path("record/runs/InvertedPendulum-v2/ppo/seed-7");
    fs::rename(&folder, &aside).expect("renamed");
    let (stdout, _) = bench.expect(4, &VERIFY);
    assert!(
        stdout.starts_with(&format!("{PENDULUM}: nothing is recorded for it\n")),
        "{stdout}"
    );
    assert!(
        stdout.contains("ppo/seed-7: recorded, but no run of tiny.toml"),
        "{stdout}"
    );
    fs::rename(&aside, &folder).expect("renamed");
    let output = bench
        .program(&VERIFY)
        .env("MCPO_ALGORITHMS__PPO__CLIP", "0.3")
        .output()
        .expect("it starts");
    let (stdout, _) = texts(&output, 4, &VERIFY);
    assert!(
        stdout.contains("another run is recorded; it differs in ppo.clip: 0.2 -> 0.3"),
        "{stdout}"
    );
    let (_, stderr) = bench.expect(2, &[&VERIFY[..], &["--record"]].concat());
    assert!(stderr.contains("already exists"), "{stderr}");
    let (_, stderr) = bench.expect(2, &["verify", "tiny.toml", "--against", "nowhere"]);
    assert!(stderr.contains("no recorded runs"), "{stderr}");
}

#[test]
fn a_result_file_is_enough_to_reproduce_its_run() {
    let bench = Workbench::new(1024);
    bench.expect(0, &["tiny.toml", "--only", "seed=0"]);
    let folder = bench.run("results", PENDULUM).complete;
    for path in [
        folder.clone(),
        RunPaths::manifest(&folder),
        RunPaths::policy(&folder),
    ] {
        let (stdout, _) = bench.expect(0, &["reproduce", path.to_str().expect("text")]);
        assert!(stdout.contains("reproduced, to the bit"), "{stdout}");
    }
    // A table on its own, away from its folder.
    let alone = bench.path("alone.parquet");
    fs::copy(RunPaths::evaluations(&folder), &alone).expect("copied");
    bench.expect(0, &["reproduce", "alone.parquet"]);
    let (keys, stamp) = (
        rows::read_keys(&alone).expect("readable"),
        rows::read_stamp(&alone).expect("readable"),
    );
    let mut episodes = rows::read_evaluations(&alone).expect("readable");
    episodes[0].length += 1;
    rows::write_evaluations(&alone, &keys, &stamp, &episodes).expect("written");
    let (stdout, _) = bench.expect(4, &["reproduce", "alone.parquet"]);
    assert!(
        stdout.contains("evaluation after 0 steps, episode 0, length"),
        "{stdout}"
    );
    let (_, stderr) = bench.expect(2, &["reproduce", "tiny.toml"]);
    assert!(stderr.contains("no provenance"), "{stderr}");
}

#[test]
fn without_its_demonstration_a_run_cannot_be_reproduced() {
    let bench = Workbench::new(1024);
    fs::create_dir(bench.path("demos")).expect("made");
    let demo = |name: &str| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("experiments/demos")
            .join(name)
    };
    let own = bench.path("demos/InvertedPendulum-v2.parquet");
    fs::copy(demo("InvertedPendulum-v2.parquet"), &own).expect("copied");
    let only = [
        "tiny.toml",
        "--axis",
        "algorithm=bc",
        "--axis",
        "env=InvertedPendulum-v2",
        "--only",
        "seed=0",
    ];
    bench.expect(0, &only);
    let folder = bench
        .run("results", "InvertedPendulum-v2/bc/seed-0")
        .complete;
    let arguments = ["reproduce", folder.to_str().expect("text")];
    bench.expect(0, &arguments);
    // From another folder too: the relative path starts where the run was planned.
    let elsewhere = tempfile::tempdir().expect("a folder");
    let output = bench
        .program(&arguments)
        .current_dir(elsewhere.path())
        .output()
        .expect("it starts");
    texts(&output, 0, &arguments);
    let whole = fs::read(&own).expect("readable");
    let demonstration = mcpo_run::demo::Demonstration::read(&own).expect("readable");
    let mut other = demonstration;
    other.actions[(0, 0)] += 0.5;
    other.write(&own).expect("written");
    assert_ne!(fs::read(&own).expect("readable"), whole);
    let (_, stderr) = bench.expect(2, &arguments);
    assert!(
        stderr.contains("the demonstration's content differs (")
            && stderr.contains("demos/InvertedPendulum-v2.parquet)"),
        "{stderr}"
    );
    fs::remove_file(&own).expect("removed");
    let (_, stderr) = bench.expect(2, &arguments);
    assert!(
        stderr.contains("cannot read the demonstration "),
        "{stderr}"
    );
    assert!(
        stderr.contains("demos/InvertedPendulum-v2.parquet"),
        "{stderr}"
    );
}
