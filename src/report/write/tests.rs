use std::fs;

use super::*;
use crate::{
    report::fixture,
    spec::{self, Overrides},
};

/// The matrix that the made-up runs are of, with `more` below it.
fn experiment(more: &str) -> ExperimentSpec {
    let text = format!(
        r#"
        name = "made-up"
        description = "Two seeds of each"
        budget.env_steps = 100
        rollout = {{ steps = 10, environments = 1 }}
        evaluation = {{ every = 50, episodes = 2, final_episodes = 2 }}
        algorithms.mcpo.minibatch = 10
        algorithms.ppo.minibatch = 10
        [[matrix]]
        seed = [0, 1]
        env = ["Hopper-v2"]
        algorithm = ["mcpo", "ppo"]
        d = [1e-4]
        epsilon = [1e-3]
        {more}
        "#
    );
    spec::parse(Path::new("made-up.toml"), &text, &Overrides::default()).expect("a valid file")
}

/// One of its runs, missing.
fn run(algorithm: &str, seed: u64) -> Run {
    let mut plan = plan::plan(&experiment("")).expect("a plan");
    plan.retain(|spec| spec.algorithm_name() == algorithm && spec.seed.0 == seed);
    Run::new(plan.remove(0), State::Missing)
}

fn record_some(results: &Path) {
    let evaluations: [(u64, &[f64]); 2] = [(50, &[10.0, 12.0]), (100, &[1500.0, 1600.0])];
    fixture::record(&run("mcpo", 0).finished(&evaluations), results);
    fixture::record(&run("mcpo", 1).failed("training diverged"), results);
    fixture::record(&run("ppo", 0).finished(&evaluations), results);
}

fn report(spec: &ExperimentSpec, results: &Path) -> Written {
    write(spec, results, &Scope::default()).expect("written")
}

#[test]
fn a_wrong_folder_is_an_error_and_gets_no_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let wrong = folder.path().join("wrong");
    let error = write(&experiment(""), &wrong, &Scope::default()).expect_err("nothing is there");
    assert!(
        error
            .to_string()
            .contains("made-up: nothing is recorded under ")
            && !wrong.exists(),
        "{error}"
    );
}

#[test]
fn a_part_is_reported_beside_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let whole = report(&experiment(""), folder.path());
    let page = fs::read(whole.files.last().expect("a page")).expect("readable");
    let of = |only: &str| Scope {
        only: vec![only.to_owned()],
        ..Scope::default()
    };
    let part = write(&experiment(""), folder.path(), &of("algorithm=ppo")).expect("written");
    assert!(
        part.files[0].ends_with("made-up/report-only-algorithm=ppo/returns.md"),
        "{:?}",
        part.files
    );
    assert!(
        part.state.starts_with("1 of 2 runs finished.")
            && part.state.contains("--only algorithm=ppo")
    );
    assert_eq!(part.tables[0].columns.len(), 1);
    assert!(
        fs::read(whole.files.last().expect("a page")).expect("readable") == page,
        "the whole report was overwritten"
    );
    let error =
        write(&experiment(""), folder.path(), &of("seed=7")).expect_err("there is no such run");
    assert_eq!(
        error.to_string(),
        "made-up: none of the 4 runs match --only seed=7"
    );
}

#[test]
fn what_an_earlier_report_alone_had_is_removed_and_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let table = |name: &str| {
        format!(
            "[[tables]]\nname = {name:?}\ntitle = \"\"\nrows = [\"env\"]\ncolumns = \"algorithm\""
        )
    };
    let old = report(&experiment(&table("old")), folder.path());
    let home = folder.path().join("made-up/report");
    let (own, outside) = (
        home.join("mine.md"),
        folder.path().join("made-up/outside.md"),
    );
    fs::write(&own, "").expect("written");
    fs::write(&outside, "").expect("written");
    let list = home.join(".files");
    let hostile = fs::read_to_string(&list).expect("readable") + "../outside.md\n";
    fs::write(&list, hostile).expect("written");
    let new = report(&experiment(&table("new")), folder.path());
    assert!(
        old.files[..4].iter().all(|file| !file.exists()),
        "{:?}",
        old.files
    );
    assert!(
        new.files
            .iter()
            .chain([&own, &outside])
            .all(|file| file.exists())
    );
}

#[test]
fn runs_of_other_settings_are_left_out_and_named_once() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let spec = experiment(
        "[environments.Hopper-v2.algorithms.mcpo]\nmax_kl = 0.25\n[[figures]]\nname=\"f\"\n\
         title=\"\"\ny=\"return\"\nseries=[]",
    );
    let written = report(&spec, folder.path());
    let start = "1 of 4 runs finished; 2 were recorded with another `mcpo.max_kl`.";
    assert!(written.state.starts_with(start), "{}", written.state);
    assert_eq!(
        written.state.matches("mcpo.max_kl: 0.005 -> 0.25").count(),
        1,
        "{}",
        written.state
    );
    let curves = fs::read_to_string(&written.files[0]).expect("readable");
    assert!(!curves.contains("mcpo"), "{curves}");
}

#[test]
fn a_sweep_has_settings_as_rows() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let sweep = "[[matrix]]\nseed = [0]\nenv = [\"Hopper-v2\"]\nalgorithm = [\"mcpo\"]\n\
        d = [1e-1, 1e-2, 1.0]";
    let table = &report(&experiment(sweep), folder.path()).tables[0];
    assert_eq!(
        (&table.row_keys, &table.column_keys),
        (&vec!["env".into(), "d".into()], &vec!["algorithm".into()])
    );
    let labels: Vec<String> = table.rows.iter().map(|row| row.labels.join(" ")).collect();
    assert_eq!(
        labels,
        [
            "Hopper-v2 10⁻⁴",
            "Hopper-v2 ",
            "Hopper-v2 10⁻¹",
            "Hopper-v2 10⁻²",
            "Hopper-v2 1"
        ]
    );
}

#[test]
fn text_from_outside_is_shown_and_not_obeyed() {
    let folder = tempfile::tempdir().expect("a folder");
    let evil = "\x1b[31m|<script>\n=cmd()";
    fixture::record(&run("mcpo", 0).failed(evil), folder.path());
    let mut spec = experiment("");
    spec.description = evil.to_owned();
    let written = report(&spec, folder.path());
    assert!(
        written
            .state
            .contains("failed: \\u{1b}[31m|<script> =cmd()"),
        "{}",
        written.state
    );
    let page = fs::read_to_string(written.files.last().expect("a page")).expect("readable");
    assert!(
        !page.contains('\x1b') && !page.contains("<script>") && page.contains("\\|&lt;script&gt;"),
        "{page}"
    );
    let tex = fs::read_to_string(&written.files[2]).expect("readable");
    assert!(
        !tex.contains('\x1b') && tex.contains("$|$$<$script$>$"),
        "{tex}"
    );
}

#[cfg(unix)]
#[test]
fn a_report_is_not_written_through_a_link() {
    let (folder, elsewhere) = (
        tempfile::tempdir().expect("a folder"),
        tempfile::tempdir().expect("a folder"),
    );
    record_some(folder.path());
    fs::write(elsewhere.path().join("README.md"), "precious").expect("written");
    std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("made-up/report"))
        .expect("linked");
    let error = write(&experiment(""), folder.path(), &Scope::default()).expect_err("refused");
    let refused = error.to_string();
    assert!(
        refused.contains("made-up/report is not a folder to write a report into: it is a link"),
        "{refused}"
    );
    assert_eq!(
        fs::read_to_string(elsewhere.path().join("README.md")).expect("readable"),
        "precious"
    );
}

#[test]
fn environments_of_which_no_run_has_ended_are_left_out_and_named() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let more = "[[matrix]]\nseed = [0]\nenv = [\"Ant-v2\"]\nalgorithm = [\"ppo\"]";
    let written = report(&experiment(more), folder.path());
    let start =
        "2 of 5 runs finished. Left out, since no run of theirs has ended: Ant-v2.\n- Hopper-v2/";
    assert!(written.state.starts_with(start), "{}", written.state);
    assert_eq!(written.tables[0].rows.len(), 1);
}

#[test]
fn a_campaign_of_which_nothing_has_ended_has_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir_all(folder.path().join("made-up/runs")).expect("made");
    let written = report(&experiment(""), folder.path());
    assert_eq!(written.state, "0 of 4 runs finished.");
    assert!(written.files.iter().all(|file| file.exists()));
}

#[test]
fn an_experiment_without_figures_gets_curves_and_a_table_the_same_bytes_twice() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let spec = experiment("");
    let written = report(&spec, folder.path());
    let names: Vec<_> = written
        .files
        .iter()
        .filter_map(|file| file.file_name()?.to_str())
        .collect();
    let expected = [
        "returns.md",
        "returns.tex",
        "returns-float.tex",
        "returns.csv",
        "returns-seeds.csv",
        "returns-curves.csv",
        "returns.png",
        "returns.svg",
        "index.html",
        "README.md",
    ];
    assert_eq!(names, expected);
    assert_eq!(
        written.state,
        format!(
            "2 of 4 runs finished.\n- {} failed: training diverged",
            run("mcpo", 1).spec.id
        )
    );
    let read = || {
        written
            .files
            .iter()
            .map(|file| fs::read(file).expect("readable"))
            .collect::<Vec<_>>()
    };
    let first = read();
    report(&spec, folder.path());
    assert!(first == read(), "the same recordings gave other bytes");
    assert!(first[6].starts_with(b"\x89PNG"));
    let table = String::from_utf8(first[0].clone()).expect("text");
    assert!(table.contains("1 of 2 seeds"), "{table}");
}

#[test]
fn only_selects_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    record_some(folder.path());
    let more = "[[tables]]\nname = \"t\"\ntitle = \"\"\nrows = [\"env\"]\ncolumns = \"algorithm\"\n\
        only = \"algorithm=ppo\"";
    let written = report(&experiment(more), folder.path());
    assert_eq!(written.tables[0].columns.len(), 1);
    assert_eq!(written.tables[0].columns[0].text, "PPO");
}
