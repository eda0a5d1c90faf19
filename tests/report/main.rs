//! `mcpo-run report` on recorded files, as a user calls it.

mod columns;
mod page;
mod recorded;

use std::{fs, path::Path, process::Output};

use assert_cmd::Command;
use mcpo_run::{
    plan::{RunSpec, plan},
    record::RunPaths,
    spec::{self, Overrides},
};
use recorded::write;

const MATRIX: &str = r#"
name = "small"
description = "MCPO and PPO on InvertedPendulum"
budget.env_steps = 4096

[[matrix]]
seed = [0, 1]
env = ["InvertedPendulum-v2"]
algorithm = ["mcpo", "ppo"]

[[figures]]
name = "mmd"
title = "The constraint"
y = "mmd"
series = ["algorithm"]
only = "algorithm=mcpo"
log_y = true

[[tables]]
name = "returns"
title = "Returns"
rows = ["env"]
columns = "algorithm"
reference = "table3"
"#;

/// Writes what `spec` would have left: a failure, or two evaluations with the last one's returns
/// around `end`.
fn record(spec: &RunSpec, results: &Path, end: Result<f64, &str>) {
    let mmd = [1, 2, 3, 4].map(|iteration| (1024 * iteration, 0.1_f64.powi(iteration as i32)));
    match end {
        Err(error) => write(spec, results, Err(error)),
        Ok(mean) => {
            let returns = [
                (2048, false, 20.0),
                (4096, true, mean - 1.0),
                (4096, true, mean + 1.0),
            ];
            write(spec, results, Ok((&returns, &mmd)));
        }
    }
}

fn report(folder: &Path) -> Output {
    report_with(folder, &[])
}

fn report_with(folder: &Path, options: &[&str]) -> Output {
    let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
    command
        .current_dir(folder)
        .args(["report", "small.toml"])
        .args(options)
        .output()
        .expect("it runs")
}

fn plan_in(folder: &Path) -> Vec<RunSpec> {
    fs::write(folder.join("small.toml"), MATRIX).expect("written");
    let spec = spec::load(&folder.join("small.toml"), &Overrides::default()).expect("a valid file");
    plan(&spec).expect("a plan")
}

#[test]
fn a_damaged_recording_is_one_failed_run_that_names_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = plan_in(folder.path());
    let results = folder.path().join("results");
    for run in &plan {
        record(run, &results, Ok(100.0));
    }
    let place = |run: &RunSpec| {
        RunPaths::new(&results, "small", &run.id)
            .expect("a good id")
            .complete
    };
    fs::write(
        RunPaths::evaluations(&place(&plan[0])),
        "PAR1, but nothing else",
    )
    .expect("damaged");
    fs::write(
        RunPaths::manifest(&place(&plan[1])),
        "{\"stamp\": {\u{1b}[31m",
    )
    .expect("damaged");
    let output = report(folder.path());
    let (stdout, stderr) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stdout.contains("small: 2 of 4 runs finished."), "{stdout}");
    for (run, file) in [(&plan[0], "evaluations.parquet"), (&plan[1], "run.json")] {
        let line = stdout
            .lines()
            .find(|line| line.contains(&format!("{} failed: ", run.id)))
            .expect(file);
        assert!(line.contains(file), "{line}");
    }
    assert!(!stdout.contains('\u{1b}'), "{stdout}");
}

#[test]
fn runs_of_an_edited_file_are_not_averaged_with_those_before() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = folder.path().join("results");
    let file = folder.path().join("small.toml");
    let planned = |text: String| {
        fs::write(&file, text).expect("written");
        plan(&spec::load(&file, &Overrides::default()).expect("a valid file")).expect("a plan")
    };
    let ppo = |runs: Vec<RunSpec>| runs.into_iter().filter(|run| run.algorithm_name() == "ppo");
    let text = |clip: f64, seeds: &str| {
        format!(
            "algorithms.ppo.clip = {clip}\n{}",
            MATRIX.replace("[0, 1]", seeds)
        )
    };
    ppo(planned(text(0.2, "[0, 1]"))).for_each(|run| record(&run, &results, Ok(10.0)));
    ppo(planned(text(0.9, "[2, 3]"))).for_each(|run| record(&run, &results, Ok(30.0)));
    planned(text(0.9, "[0, 1, 2, 3]"));
    let output = report(folder.path());
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert!(
        stdout.contains("2 of 8 runs finished; 2 were recorded with another `ppo.clip`."),
        "{stdout}"
    );
    assert_eq!(
        stdout.matches("ppo.clip: 0.2 -> 0.9").count(),
        1,
        "named once: {stdout}"
    );
    assert!(stdout.contains("30 ± 0 (2 of 4 seeds)"), "{stdout}");
    let status = call(
        folder.path(),
        &["report", "small.toml", "--only", "algorithm=ppo,seed=0"],
    );
    assert!(
        status.contains("0 of 1 run finished; 1 was recorded with another `ppo.clip`."),
        "{status}"
    );
}

#[test]
fn a_part_has_a_report_of_its_own_and_a_wrong_folder_has_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = folder.path().join("results");
    for run in &plan_in(folder.path()) {
        record(run, &results, Ok(900.0 + run.seed.0 as f64));
    }
    report(folder.path());
    let page = results.join("small/report/README.md");
    let whole = fs::read(&page).expect("readable");
    for (options, count, place) in [
        (
            &["--only", "seed=0"][..],
            "2 of 2 runs finished.",
            "report-only-seed=0",
        ),
        (
            &["--axis", "seed=0"],
            "2 of 2 runs finished.",
            "report-axis-seed=0",
        ),
        (
            &["--only", "seed=0,algorithm=ppo"],
            "1 of 1 run finished.",
            "report-only-seed=0,algorithm=ppo",
        ),
    ] {
        let told = call(
            folder.path(),
            &[&["report", "small.toml"], options].concat(),
        );
        assert!(
            told.contains(count) && told.contains(&format!("with {}.", options.join(" "))),
            "{told}"
        );
        assert!(
            results.join("small").join(place).join("README.md").exists(),
            "{place}: {told}"
        );
    }
    assert!(
        fs::read(&page).expect("readable") == whole,
        "the whole report was overwritten"
    );

    let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
    let arguments = ["report", "small.toml", "--results", "wrong"];
    let output = command
        .current_dir(folder.path())
        .args(arguments)
        .output()
        .expect("it runs");
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        stderr.contains("small: nothing is recorded under wrong"),
        "{stderr}"
    );
    assert!(!folder.path().join("wrong").exists());
}

#[test]
fn a_wide_table_is_folded_to_the_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    for run in &plan_in(folder.path()) {
        record(run, &folder.path().join("results"), Ok(900.0));
    }
    let told = |columns: &str| {
        let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
        command
            .current_dir(folder.path())
            .env("COLUMNS", columns)
            .args(["report", "small.toml"]);
        String::from_utf8(command.output().expect("it runs").stdout).expect("text")
    };
    let heads = |text: &str| {
        text.lines()
            .filter(|line| line.starts_with(" environment"))
            .count()
    };
    assert_eq!(
        (heads(&told("200")), heads(&told("50"))),
        (1, 2),
        "{}",
        told("50")
    );
}

/// The first example of this language in the README.
fn documented(language: &str) -> String {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md"))
        .expect("readable");
    let begin = text
        .find(&format!("```{language}\n"))
        .expect("there is one")
        + language.len()
        + 4;
    text[begin..begin + text[begin..].find("```").expect("it ends")].to_owned()
}

#[test]
fn the_documented_way_to_read_results_gives_the_means_of_one_experiment() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = folder.path().join("results");
    for (name, algorithm_mean) in [("smoke", 900.0), ("ci", 100.0)] {
        let text = MATRIX.replace("name = \"small\"", &format!("name = {name:?}"));
        fs::write(folder.path().join("small.toml"), text).expect("written");
        let spec = spec::load(&folder.path().join("small.toml"), &Overrides::default())
            .expect("a valid file");
        plan(&spec)
            .expect("a plan")
            .iter()
            .for_each(|run| record(run, &results, Ok(algorithm_mean)));
    }
    let example = documented("python");
    assert!(
        example.contains("\"results/smoke/**/evaluations.parquet\""),
        "a clone has results/ci too: {example}"
    );
    let python = |code: &str| {
        let mut command = std::process::Command::new(
            std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned()),
        );
        command
            .current_dir(folder.path())
            .args(["-c", code])
            .output()
            .expect("python3, which the build needs, runs")
    };
    if !python("import polars").status.success() {
        return; // the build needs no polars for Python; where it is there, the example is run
    }
    let output = python(&example);
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(
        (
            stdout.matches(" 900.0 ").count(),
            stdout.matches(" 100.0 ").count()
        ),
        (2, 0),
        "{stdout}"
    );
}

#[test]
fn partial_results_make_a_report_that_says_what_is_missing() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = plan_in(folder.path());
    let results = folder.path().join("results");
    record(&plan[0], &results, Ok(900.0));
    record(&plan[1], &results, Err("training diverged"));
    record(&plan[2], &results, Ok(30.0));

    let output = report(folder.path());
    let (stdout, stderr) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stdout.contains("small: 2 of 4 runs finished."), "{stdout}");
    assert!(
        stdout.contains("seed-1 failed: training diverged"),
        "{stdout}"
    );
    assert!(
        stdout.contains("900 (1 of 2 seeds)") && stdout.contains("1000 ± 0"),
        "{stdout}"
    );

    let written = results.join("small/report");
    for name in [
        "mmd.png",
        "mmd.svg",
        "mmd-curves.csv",
        "returns.md",
        "returns.tex",
        "returns.csv",
        "README.md",
    ] {
        assert!(written.join(name).exists(), "{name}");
        assert!(stdout.contains(name), "{name} is not named: {stdout}");
    }
    let csv = fs::read_to_string(written.join("mmd-curves.csv")).expect("readable");
    assert!(
        csv.contains("InvertedPendulum-v2,mcpo,1024,0.1,,,1,2"),
        "{csv}"
    );
    let cells = fs::read_to_string(written.join("returns.csv")).expect("readable");
    assert!(
        cells.contains("InvertedPendulum-v2,mcpo,900,,,1,2,0,900,"),
        "{cells}"
    );
}

#[test]
fn a_value_that_contradicts_the_papers_is_named_wherever_its_table_stands() {
    let folder = tempfile::tempdir().expect("a folder");
    let second = MATRIX[MATRIX.find("[[tables]]").expect("one")..]
        .replace("returns", "again")
        .replace("Returns", "Again");
    let matrix = format!("{MATRIX}{second}only = \"algorithm=ppo\"\n")
        .replace("4096", "200_000")
        .replace("[0, 1]", "[0, 1, 2]");
    fs::write(folder.path().join("small.toml"), matrix).expect("written");
    let spec =
        spec::load(&folder.path().join("small.toml"), &Overrides::default()).expect("a valid file");
    let results = folder.path().join("results");
    for run in plan(&spec).expect("a plan") {
        // The paper's are 1000 ± 0 and 728 ± 360.
        record(
            &run,
            &results,
            Ok(if run.algorithm_name() == "mcpo" {
                1000.0
            } else {
                30.0
            }),
        );
    }
    let output = report(folder.path());
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{stdout}");
    let told: Vec<&str> = stdout
        .lines()
        .filter(|line| line.contains("the paper's value ("))
        .collect();
    let ppo = "InvertedPendulum-v2, PPO: worse than the paper's value";
    assert_eq!(told, [format!("{ppo} (Returns)"), format!("{ppo} (Again)")]);
    assert_eq!(
        report_with(folder.path(), &["--strict"]).status.code(),
        Some(3)
    );

    let written = results.join("small/report");
    let cells = fs::read_to_string(written.join("returns.csv")).expect("readable");
    let verdicts: Vec<&str> = cells
        .lines()
        .skip(1)
        .filter_map(|line| line.split(',').nth(18))
        .collect();
    assert_eq!(verdicts, ["reproduced", "worse"], "{cells}");
    let table = fs::read_to_string(written.join("returns.md")).expect("readable");
    assert!(
        table.contains(" 30, 30, 30 |") && table.contains("| worse "),
        "{table}"
    );
    let seeds = fs::read_to_string(written.join("returns-seeds.csv")).expect("readable");
    assert!(seeds.contains("InvertedPendulum-v2,ppo,2,30\n"), "{seeds}");
}

#[test]
fn claims_are_judged_by_what_is_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let claims = r#"
[[claims]]
name = "MCPO outperforms PPO"
of = "algorithm=mcpo"
is = "above"
than = "algorithm=ppo"

[[claims]]
name = "PPO has the smaller MMD | at the end"
of = "algorithm=ppo"
is = "below"
than = "algorithm=mcpo"
on = "mmd"

[[claims]]
name = "MCPO keeps its constraint"
of = "algorithm=mcpo"
is = "kept"
"#;
    let matrix = MATRIX.replace("[0, 1]", "[0, 1, 2]") + claims;
    fs::write(folder.path().join("small.toml"), matrix).expect("written");
    let spec =
        spec::load(&folder.path().join("small.toml"), &Overrides::default()).expect("a valid file");
    let results = folder.path().join("results");
    let plan = plan(&spec).expect("a plan");
    let of = |algorithm: &str, seed: u64| {
        if algorithm == "mcpo" {
            900.0 + seed as f64
        } else {
            30.0 - seed as f64
        }
    };
    plan.iter()
        .for_each(|run| record(run, &results, Ok(of(run.algorithm_name(), run.seed.0))));

    let output = report_with(folder.path(), &["--strict"]);
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{stdout}");
    assert!(
        stdout.contains("return of algorithm=mcpo above that of algorithm=ppo"),
        "{stdout}"
    );
    let verdict = |claim: &str, text: &str| {
        let line = text
            .lines()
            .find(|line| line.contains(claim))
            .expect(claim)
            .to_owned();
        ["holds", "contradicted", "inconclusive"]
            .into_iter()
            .find(|verdict| line.contains(verdict))
            .expect("one")
    };
    for (claim, wanted) in [
        ("MCPO outperforms", "holds"),
        ("PPO has the", "inconclusive"),
        ("MCPO keeps", "holds"),
    ] {
        assert_eq!(verdict(claim, &stdout), wanted, "{claim}");
    }
    let written = results.join("small/report");
    let csv = fs::read_to_string(written.join("claims.csv")).expect("readable");
    let row =
        "MCPO outperforms PPO,algorithm=mcpo,above,algorithm=ppo,return,InvertedPendulum-v2,,872,";
    assert!(csv.contains(row) && csv.contains(",3,3,3,3,"), "{csv}");
    let page = fs::read_to_string(written.join("README.md")).expect("readable");
    assert!(
        page.contains("## Claims") && page.contains("PPO has the smaller MMD \\| at the end"),
        "{page}"
    );
    assert!(written.join("claims.tex").exists());

    plan.iter().for_each(|run| {
        record(
            run,
            &results,
            Ok(1000.0 - of(run.algorithm_name(), run.seed.0)),
        )
    });
    assert_eq!(report_with(folder.path(), &[]).status.code(), Some(0));
    let output = report_with(folder.path(), &["--strict"]);
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{stdout}");
    assert!(
        stdout.contains("MCPO outperforms PPO: contradicted in InvertedPendulum-v2\n"),
        "{stdout}"
    );
}

#[test]
fn neither_claims_nor_tables_nor_figures_make_another_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let planned = |text: &str| {
        let file = folder.path().join("small.toml");
        fs::write(&file, text).expect("written");
        plan(&spec::load(&file, &Overrides::default()).expect("a valid file")).expect("a plan")
    };
    let (whole, bare) = (
        MATRIX.to_owned(),
        &MATRIX[..MATRIX.find("[[figures]]").expect("there is one")],
    );
    let claims = "[[claims]]\nname = 'c'\nof = 'algorithm=mcpo'\nis = 'kept'\n";
    assert!(planned(&(whole + claims)) == planned(bare));
}

/// The program on `small.toml`; what it says on stdout.
fn call(folder: &Path, arguments: &[&str]) -> String {
    let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
    let output = command
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("it runs");
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn what_a_demonstration_returned_is_recorded_with_its_runs_and_stands_beside_the_papers() {
    let folder = tempfile::tempdir().expect("a folder");
    let demo =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/demos/InvertedPendulum-v2.parquet");
    let settings =
        "evaluation = { every = 4096, episodes = 1, final_episodes = 1 }\nnetwork.hidden = [8]";
    let matrix = format!("demonstrations = {demo:?}\n{settings}\n{MATRIX}");
    fs::write(folder.path().join("small.toml"), matrix).expect("written");
    call(
        folder.path(),
        &["run", "small.toml", "--only", "seed=0", "--quiet"],
    );
    let cells = || {
        call(folder.path(), &["report", "small.toml"]);
        let csv = fs::read_to_string(folder.path().join("results/small/report/returns.csv"))
            .expect("readable");
        csv.lines()
            .skip(1)
            .map(|line| line.rsplit_once(",4096,").expect("the budget").1.to_owned())
            .collect::<Vec<_>>()
    };
    // As `mcpo-run demo show` prints it; the paper's is Table 3's.
    assert_eq!(cells(), ["556,553"; 2]);
    let table = fs::read_to_string(folder.path().join("results/small/report/returns.md"))
        .expect("readable");
    assert!(
        table.contains("runs that depart from them have none beside them: network.hidden.\n"),
        "{table}"
    );
    let manifest = folder
        .path()
        .join("results/small/runs/InvertedPendulum-v2/mcpo/seed-0/run.json");
    let shown = call(folder.path(), &["show", manifest.to_str().expect("text")]);
    assert!(
        shown.contains("demo         1 episode, 556 steps, return 556.0000\n"),
        "{shown}"
    );
    // Older programs did not record it.
    let mut older: serde_json::Value =
        serde_json::from_slice(&fs::read(&manifest).expect("readable")).expect("JSON");
    older["stamp"]
        .as_object_mut()
        .expect("an object")
        .remove("demonstrated")
        .expect("it was recorded");
    fs::write(&manifest, older.to_string()).expect("written");
    assert_eq!(cells(), [",553"; 2]);
    let status = call(folder.path(), &["status", "small.toml"]);
    assert!(status.contains("2 finished"), "{status}");
}

#[test]
fn two_folders_are_compared_and_a_worse_one_fails_where_asked() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = MATRIX.replace("[0, 1]", "[0, 1, 2]");
    fs::write(folder.path().join("small.toml"), text).expect("written");
    let runs =
        plan(&spec::load(&folder.path().join("small.toml"), &Overrides::default()).expect("valid"))
            .expect("a plan");
    for run in &runs {
        let worse = if run.algorithm_name() == "ppo" {
            500.0
        } else {
            0.0
        };
        record(
            run,
            &folder.path().join("results"),
            Ok(900.0 + run.seed.0 as f64),
        );
        record(
            run,
            &folder.path().join("later"),
            Ok(901.0 + run.seed.0 as f64 - worse),
        );
    }
    let compare = |options: &[&str]| {
        let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
        command
            .current_dir(folder.path())
            .env("COLUMNS", "200")
            .arg("compare")
            .args(options)
            .output()
            .expect("it runs")
    };
    let output = compare(&["small.toml", "later/small", "--strict"]);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(3), "{told}");
    let line = |algorithm: &str| {
        told.lines()
            .find(|line| line.contains(algorithm))
            .expect(algorithm)
    };
    assert!(
        line("/mcpo").contains("reproduced") && line("/ppo").contains("worse"),
        "{told}"
    );
    assert_eq!(
        compare(&[
            "results/small",
            "later/small",
            "--strict",
            "--only",
            "algorithm=mcpo"
        ])
        .status
        .code(),
        Some(0)
    );
    let output = compare(&["results", "later/small"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("results holds no `runs`"));
}

#[test]
fn a_watched_report_is_written_again_until_all_runs_have_ended() {
    let folder = tempfile::tempdir().expect("a folder");
    let results = folder.path().join("results");
    let runs = plan_in(folder.path());
    for run in &runs[1..] {
        record(run, &results, Ok(100.0));
    }
    let mut watch = std::process::Command::new(assert_cmd::cargo::cargo_bin("mcpo-run"));
    watch
        .current_dir(folder.path())
        .args(["report", "small.toml", "--watch=1"])
        .stdout(std::process::Stdio::piped());
    let watch = watch.spawn().expect("it starts");
    let page = results.join("small/report/README.md");
    while !fs::read_to_string(&page).is_ok_and(|text| text.contains("3 of 4 runs finished.")) {
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    record(&runs[0], &results, Ok(100.0));
    let told = watch.wait_with_output().expect("it ends by itself");
    assert!(told.status.success());
    let told = String::from_utf8_lossy(&told.stdout);
    assert!(told.ends_with("small: 4 of 4 runs finished.\n"), "{told}");
    assert!(
        fs::read_to_string(&page)
            .expect("readable")
            .contains("4 of 4 runs finished.")
    );
}
