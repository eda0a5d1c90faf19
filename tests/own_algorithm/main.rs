//! An algorithm of one's own, through the public interface alone: one file, `awr.rs`, and one call.
//!
//! This is a program of one's own too: it registers the algorithm and hands over to the command
//! line of `mcpo-run`, in its worker processes as well. Without the variable that the checks set,
//! it makes the checks.

mod awr;

use std::{
    env, fs,
    path::Path,
    process::{Command, ExitCode},
};

use mcpo_run::{
    algo::{Agent, catalogue},
    plan,
    spec::{self, Overrides},
    train::{self, Ending, EvaluationEpisode, Flow, Iteration, RunSink, SinkError},
};
use serde_json::{Value, json};

/// Set where this is the program rather than its test.
const PROGRAM: &str = "OWN_ALGORITHM_IS_THE_PROGRAM";

const MATRIX: &str = r#"
name = "own"
reward = "dense"
budget.env_steps = 2048
rollout.steps = 1024
network.hidden = [16, 16]
evaluation = { every = 2048, episodes = 1, final_episodes = 2 }

[[matrix]]
seed = [0]
env = ["InvertedPendulum-v2"]
algorithm = ["awr", "ppo"]
"awr.temperature" = [0.5, 2.0]

[algorithms.awr]
epochs = 3

[[settings]]
name = "rates"
title = "Step sizes"
show = ["learning_rate"]
"#;

#[expect(
    clippy::print_stdout,
    reason = "a test without the harness tells its checks itself"
)]
fn main() -> ExitCode {
    catalogue::register(&[&awr::AWR]).expect("its name is its own, and nothing was read before");
    if env::var_os(PROGRAM).is_some() {
        return mcpo_run::cli::main();
    }
    let checks: [(&str, fn()); 4] = [
        (
            "it_trains_and_resumes_bit_for_bit",
            it_trains_and_resumes_bit_for_bit,
        ),
        (
            "a_matrix_plans_runs_and_reports_it",
            a_matrix_plans_runs_and_reports_it,
        ),
        (
            "the_schema_and_messages_know_its_keys",
            the_schema_and_messages_know_its_keys,
        ),
        ("bench_measures_it", bench_measures_it),
    ];
    for (name, check) in checks {
        check();
        println!("test {name} ... ok");
    }
    ExitCode::SUCCESS
}

/// What the program prints with `arguments` in `folder`, on both streams; its exit code must be
/// `code`.
fn program(folder: &Path, code: i32, arguments: &[&str]) -> String {
    let this = env::current_exe().expect("this program's file");
    let output = Command::new(this)
        .args(arguments)
        .current_dir(folder)
        .env(PROGRAM, "1")
        .output()
        .expect("it starts");
    let (stdout, stderr) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert_eq!(
        output.status.code(),
        Some(code),
        "{arguments:?}\n{stdout}\n{stderr}"
    );
    format!("{stdout}{stderr}")
}

/// A folder with the matrix.
fn with_matrix(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("own.toml"), text).expect("written");
    folder
}

fn read_json(path: &Path) -> Value {
    serde_json::from_slice(
        &fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())),
    )
    .expect("JSON")
}

/// Keeps what a run tells; stops after `stop_after` iterations.
#[derive(Default)]
struct Memory {
    stop_after: Option<u64>,
    returns: Vec<Option<f64>>,
    evaluations: Vec<EvaluationEpisode>,
    checkpoint: Vec<u8>,
}

impl RunSink for Memory {
    fn iteration(
        &mut self,
        row: &Iteration,
        checkpoint: &dyn Fn() -> Vec<u8>,
    ) -> Result<Flow, SinkError> {
        self.returns.push(row.dense_return);
        self.checkpoint = checkpoint();
        Ok(if self.stop_after == Some(row.iteration) {
            Flow::Stop
        } else {
            Flow::Continue
        })
    }

    fn evaluation(&mut self, episodes: &[EvaluationEpisode]) -> Result<(), SinkError> {
        self.evaluations.extend_from_slice(episodes);
        Ok(())
    }

    fn policy(&mut self, _: u64, _: bool, _: &Agent) -> Result<(), SinkError> {
        Ok(())
    }
}

fn it_trains_and_resumes_bit_for_bit() {
    let overrides = Overrides {
        set: vec![
            "budget.env_steps=20480".into(),
            "algorithms.awr.epochs=20".into(),
        ],
        axis: Vec::new(),
    };
    let spec = spec::parse(Path::new("own.toml"), MATRIX, &overrides)
        .unwrap_or_else(|errors| panic!("{errors}"));
    let run = plan::plan(&spec).expect("a plan").remove(0);
    assert_eq!(run.algorithm_name(), "awr");
    let mut whole = Memory::default();
    assert_eq!(
        train::run(&run, None, &mut whole).expect("finite"),
        Ending::Finished
    );
    let (first, last) = (
        whole.returns[0].expect("episodes ended"),
        whole.returns[19].expect("episodes ended"),
    );
    assert!(last > 2.0 * first, "from {first} to {last}");

    let mut resumed = Memory {
        stop_after: Some(7),
        ..Memory::default()
    };
    train::run(&run, None, &mut resumed).expect("finite");
    let checkpoint = std::mem::take(&mut resumed.checkpoint);
    resumed.stop_after = None;
    train::run(&run, Some(&checkpoint), &mut resumed).expect("finite");
    assert_eq!(
        (whole.returns, whole.evaluations),
        (resumed.returns, resumed.evaluations)
    );
}

fn a_matrix_plans_runs_and_reports_it() {
    let folder = with_matrix(MATRIX);
    let plan = program(folder.path(), 0, &["plan", "own.toml"]);
    for run in [
        "awr-temperature=0.5/seed-0",
        "awr-temperature=2/seed-0",
        "InvertedPendulum-v2/ppo/seed-0",
    ] {
        assert!(plan.contains(run), "{run}: {plan}");
    }
    program(folder.path(), 0, &["own.toml", "--quiet"]);
    let runs = folder.path().join("results/own/runs/InvertedPendulum-v2");
    let manifest = read_json(&runs.join("awr-temperature=2/seed-0/run.json"));
    let spec = &manifest["stamp"]["spec"];
    assert_eq!(
        spec["algorithm"]["awr"]["temperature"],
        json!(2.0),
        "{manifest:#}"
    );
    assert_eq!(spec["algorithm"]["awr"]["epochs"], json!(3), "{manifest:#}");
    let revisions = &manifest["stamp"]["build"]["versions"]["revisions"];
    assert_eq!(
        *revisions,
        json!({ "awr": 1, "critic": 1, "gae": 1, "training": 1 }),
        "{manifest:#}"
    );
    let again = program(folder.path(), 0, &["status", "own.toml"]);
    assert!(
        again.contains("3 of 3") || again.contains("3 finished"),
        "{again}"
    );
    let table =
        fs::read_to_string(folder.path().join("results/own/report/rates.md")).expect("the table");
    assert!(table.contains("AWR") && table.contains("PPO"), "{table}");
}

fn the_schema_and_messages_know_its_keys() {
    let folder = with_matrix(&MATRIX.replace("epochs = 3", "epochs = 3\ntemperatur = 1.0"));
    let schema: Value =
        serde_json::from_str(&program(folder.path(), 0, &["schema"])).expect("JSON");
    let key = "/properties/algorithms/properties/awr/properties/temperature/description";
    let told = schema.pointer(key).and_then(Value::as_str);
    assert_eq!(
        told,
        Some("beta, by which advantages are divided before they become weights.")
    );
    let block = &schema["properties"]["matrix"]["items"]["properties"];
    assert!(
        block["algorithm"]["items"]["enum"]
            .as_array()
            .is_some_and(|names| names.contains(&json!("awr")))
    );
    assert!(block["awr.temperature"].is_object());
    let refused = program(folder.path(), 2, &["plan", "own.toml"]);
    assert!(
        refused.contains("`temperature`") && refused.contains("own.toml:17:1"),
        "{refused}"
    );
}

fn bench_measures_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let set = ["--set", "rollout.steps=256", "--set", "network.hidden=[8]"];
    let arguments = [
        &[
            "bench",
            "--env",
            "InvertedPendulum-v2",
            "--algorithm",
            "awr",
            "--iterations",
            "1",
            "--json",
        ],
        &set[..],
    ];
    let measured: Value =
        serde_json::from_str(&program(folder.path(), 0, &arguments.concat())).expect("JSON");
    let operations = measured["floor"]["operations"].as_object().expect("parts");
    assert!(
        ["policy inference", "values", "policy epochs"]
            .iter()
            .all(|part| operations.contains_key(*part)),
        "{measured}"
    );
}
