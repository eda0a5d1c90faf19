//! `mcpo-run bench`, as a user and the scripts in `benches/` call it.

use assert_cmd::Command;
use serde_json::Value;

fn bench(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
    command.arg("bench").args(arguments);
    command
}

/// What it says on stderr, with exit code 2.
fn refused(arguments: &[&str]) -> String {
    let output = bench(arguments).assert().code(2).get_output().clone();
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).expect("text")
}

#[test]
fn what_it_does_not_know_is_refused_with_the_nearest_known_name() {
    let env = refused(&["--env", "HalfCheta-v2", "--algorithm", "ppo"]);
    assert!(
        env.contains("the nearest known one is `HalfCheetah-v2`"),
        "{env}"
    );
    let algorithm = refused(&["--env", "Hopper-v2", "--algorithm", "mpco"]);
    assert!(algorithm.contains("'mcpo'"), "{algorithm}");
    let key = refused(&[
        "--env",
        "Hopper-v2",
        "--algorithm",
        "ppo",
        "--set",
        "rolout.steps=10",
    ]);
    assert!(key.contains("`rollout`"), "{key}");
    let nothing = refused(&["--env", "Hopper-v2", "--algorithm", "bc"]);
    assert!(nothing.contains("nothing to measure"), "{nothing}");
    let file = refused(&[
        "--env",
        "Hopper-v2",
        "--algorithm",
        "mcpo",
        "--set",
        "demonstrations=no.parquet",
    ]);
    assert!(
        file.contains("no.parquet") && !file.contains("bench.toml"),
        "a file that nobody wrote: {file}"
    );
    refused(&[
        "--env",
        "Hopper-v2",
        "--algorithm",
        "ppo",
        "--iterations",
        "0",
    ]);
}

/// No speed is asserted, which is the machine's, but what must hold at every speed. The floor is
/// measured too, so a ratio above 1 can be noise.
#[test]
fn its_parts_add_up_and_its_speed_is_not_above_the_floors() {
    for algorithm in ["mcpo", "ppo", "gail"] {
        let small = ["rollout.steps=512", "network.hidden=[64]"].map(|set| format!("--set={set}"));
        let minibatch = format!(
            "--set=algorithms.{algorithm}.{}minibatch=256",
            if algorithm == "gail" { "trpo." } else { "" }
        );
        let arguments = [
            "--json",
            "--env=Hopper-v2",
            "--iterations=2",
            "--algorithm",
            algorithm,
            &small[0],
            &small[1],
            &minibatch,
        ];
        let output = bench(&arguments)
            .assert()
            .success()
            .get_output()
            .stdout
            .clone();
        let measured: Value = serde_json::from_slice(&output).expect("JSON");
        let number = |value: &Value| {
            value
                .as_f64()
                .unwrap_or_else(|| panic!("a number in {measured:#}"))
        };

        let ratio = number(&measured["floor_ratio"]);
        assert!(ratio > 0.0 && ratio <= 1.5, "{measured:#}");
        assert_eq!(
            (
                number(&measured["env_steps"]),
                &measured["shapes"]["rollout"]
            ),
            (1024.0, &Value::from(512))
        );
        let seconds = number(&measured["seconds"]);
        assert!((number(&measured["steps_per_s"]) * seconds / 1024.0 - 1.0).abs() < 1e-9);
        let sum = |parts: &Value| {
            parts
                .as_object()
                .expect("parts by name")
                .values()
                .map(number)
                .sum::<f64>()
        };
        assert!(
            (sum(&measured["phases"]) / seconds - 1.0).abs() < 1e-6,
            "{measured:#}"
        );
        assert!(
            measured["phases"]
                .as_object()
                .expect("parts")
                .values()
                .all(|part| number(part) >= 0.0)
        );
        let floor = &measured["floor"];
        let is = |value: f64, wanted: f64| (value / wanted - 1.0).abs() < 1e-9;
        let products = number(&floor["product_seconds"]);
        let tanh = number(&floor["tanh_seconds"]);
        let physics = number(&floor["physics_seconds"]);
        assert!(is(
            sum(&floor["operations"]) / number(&floor["flops_per_s"]),
            products
        ));
        assert!(is(
            sum(&floor["tanhs"]) / number(&floor["tanhs_per_s"]),
            tanh
        ));
        // One hidden layer of 64, and the policy's pass of each step in the rollout.
        assert_eq!(number(&floor["tanhs"]["policy inference"]), 64.0 * 1024.0);
        assert!(physics > 0.0 && tanh > 0.0);
        let cpu_seconds = number(&floor["cpu_seconds"]);
        assert!(is(physics + products + tanh, cpu_seconds));
        assert!(is(number(&measured["cpu_seconds"]) * ratio, cpu_seconds));
    }
}
