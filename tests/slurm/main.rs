//! Submissions to a real Slurm of two nodes: nothing is lost, nothing is run twice, and no bit
//! changes.
//!
//! One scenario after another on one cluster, by a harness of its own: so it can say where it skips
//! them, and why. An argument chooses the scenarios whose names hold it.

mod cluster;
#[path = "../runner/processes.rs"]
mod processes;

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use cluster::{Bench, Cluster, ids, parent};
use mcpo_run::record::{Attempt, Outcome, RunPaths};
use processes::{signal, wait_for};

/// A run that takes long enough to be disturbed.
const LONG: u64 = 150_000;
const PENDULUM: &str = "InvertedPendulum-v2/ppo/seed-0";
/// That run alone.
const ONE: [&str; 2] = ["--only", "env=InvertedPendulum-v2,algorithm=ppo,seed=0"];

type Scenario = (&'static str, fn(&Cluster));

const SCENARIOS: [Scenario; 9] = [
    (
        "twelve_runs_over_two_nodes_are_those_of_one_machine",
        twelve_runs_over_two_nodes_are_those_of_one_machine,
    ),
    (
        "a_node_that_goes_down_loses_no_run",
        a_node_that_goes_down_loses_no_run,
    ),
    (
        "a_worker_that_is_killed_is_a_failed_run_and_sent_again_alone",
        a_worker_that_is_killed_is_a_failed_run,
    ),
    (
        "an_element_that_is_killed_resumes_when_it_is_sent_again",
        an_element_that_is_killed_resumes,
    ),
    (
        "a_run_longer_than_its_time_limit_resumes_by_itself",
        a_run_longer_than_its_time_limit_resumes_by_itself,
    ),
    (
        "what_is_cancelled_is_sent_again",
        what_is_cancelled_is_sent_again,
    ),
    (
        "a_controller_that_starts_again_changes_nothing",
        a_controller_that_starts_again_changes_nothing,
    ),
    (
        "a_job_that_completed_without_a_result_is_a_failed_run",
        a_job_that_completed_without_a_result,
    ),
    (
        "names_reach_slurm_and_the_script_as_they_are",
        names_reach_slurm_and_the_script_as_they_are,
    ),
];

#[expect(clippy::print_stderr, reason = "the harness of these tests")]
fn main() -> ExitCode {
    let wanted = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with('-'))
        .unwrap_or_default();
    let chosen: Vec<&Scenario> = SCENARIOS
        .iter()
        .filter(|(name, _)| name.contains(&wanted))
        .collect();
    if chosen.is_empty() {
        return ExitCode::SUCCESS;
    }
    let cluster = match Cluster::start() {
        Ok(cluster) => cluster,
        Err(reason) => {
            eprintln!(
                "SKIPPED: the {} tests of `mcpo-run submit` on a real Slurm: {reason}",
                chosen.len()
            );
            return ExitCode::SUCCESS;
        }
    };
    let mut failed = 0;
    for (name, scenario) in chosen {
        let began = Instant::now();
        let is_good = catch_unwind(AssertUnwindSafe(|| scenario(&cluster))).is_ok();
        failed += usize::from(!is_good);
        let verdict = if is_good { "ok" } else { "FAILED" };
        eprintln!(
            "test slurm::{name} ... {verdict} ({:.0} s)",
            began.elapsed().as_secs_f64()
        );
        cluster.slurm("scancel", &["--user=root"]);
        cluster.wait_until_idle();
    }
    drop(cluster);
    if failed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// The bench whose one long run is recorded undisturbed in `whole`.
fn with_whole_run<'a>(cluster: &'a Cluster, slurm: &str) -> Bench<'a> {
    let bench = Bench::new(cluster, LONG, "0", slurm);
    bench.expect(
        0,
        &[&["run", "tiny.toml", "--results", "whole"], &ONE[..]].concat(),
    );
    bench
}

fn assert_same_run(bench: &Bench<'_>) {
    assert_eq!(
        bench.digest("results", PENDULUM),
        bench.digest("whole", PENDULUM),
        "the run is another"
    );
}

/// Asserts that no step was taken twice for nothing: each attempt went on from where a checkpoint
/// was.
fn assert_resumed(attempts: &[Attempt]) {
    assert!(
        attempts.len() > 1 && attempts[0].from_env_steps == 0,
        "{attempts:?}"
    );
    assert!(
        attempts
            .windows(2)
            .all(|pair| pair[1].from_env_steps > pair[0].from_env_steps),
        "{attempts:?}"
    );
}

fn twelve_runs_over_two_nodes_are_those_of_one_machine(cluster: &Cluster) {
    let bench = Bench::new(cluster, 20_000, "0, 1, 2", "throttle = 2");
    bench.expect(0, &["run", "tiny.toml", "--results", "local", "--quiet"]);
    let said = bench.submit(&[]);
    // The cluster takes no more than nine elements in an array.
    assert!(
        said.contains("12 runs in 12 elements submitted as job") && said.matches(", ").count() >= 2,
        "{said}"
    );
    assert!(bench.status().contains("queued"));
    cluster.wait_until_idle();
    let mut nodes = std::collections::BTreeSet::new();
    for id in ids(3) {
        let manifest = bench.manifest("results", &id);
        assert_eq!(
            (&manifest.outcome, manifest.attempts.len()),
            (&Outcome::Finished, 1),
            "{id}"
        );
        assert_eq!(
            manifest.stamp.fingerprint,
            bench.manifest("local", &id).stamp.fingerprint
        );
        assert_eq!(
            bench.digest("results", &id),
            bench.digest("local", &id),
            "{id}"
        );
        nodes.insert(manifest.attempts[0].host.clone());
    }
    assert_eq!(nodes.into_iter().collect::<Vec<_>>(), ["n1", "n2"]);
    bench.assert_reported(12);
    assert!(bench.status().contains("12 runs: 12 finished"));
    assert!(
        bench
            .submit(&[])
            .contains("nothing to submit: 12 of 12 runs finished")
    );
}

fn a_node_that_goes_down_loses_no_run(cluster: &Cluster) {
    let bench = with_whole_run(cluster, "");
    bench.submit(&[&ONE[..], &["--sbatch=--nodelist=n2"]].concat());
    bench.wait_for_checkpoint(PENDULUM);
    assert!(
        bench.submit(&ONE).contains("nothing to submit"),
        "what runs is no longer missing"
    );
    cluster.slurm(
        "scontrol",
        &["update", "nodename=n2", "state=down", "reason=test"],
    );
    cluster.wait_until_idle();
    let attempts = bench.manifest("results", PENDULUM).attempts;
    assert_resumed(&attempts);
    assert_eq!(attempts.len(), 2, "{attempts:?}");
    assert_same_run(&bench);
    bench.assert_reported_one();
}

fn a_worker_that_is_killed_is_a_failed_run(cluster: &Cluster) {
    let bench = with_whole_run(cluster, "pack = 2");
    let two = ["--only", "env=InvertedPendulum-v2,seed=0"];
    bench.submit(&two);
    assert!(
        signal("KILL", bench.wait_for_checkpoint(PENDULUM)),
        "it was over before"
    );
    cluster.wait_until_idle();
    let error = bench
        .manifest("results", PENDULUM)
        .error()
        .expect("it failed")
        .to_owned();
    assert!(error.contains("SIGKILL"), "{error}");
    let other = "InvertedPendulum-v2/trpo/seed-0";
    assert_eq!(
        bench.manifest("results", other).outcome,
        Outcome::Finished,
        "its neighbour in the element"
    );
    let said = bench.status();
    assert!(
        said.contains("1 failed") && said.contains("SIGKILL"),
        "{said}"
    );
    assert!(bench.submit(&two).contains("1 run in 1 element submitted"));
    cluster.wait_until_idle();
    assert_resumed(&bench.manifest("results", PENDULUM).attempts);
    assert_eq!(
        bench.manifest("results", other).attempts.len(),
        1,
        "it was run twice"
    );
    assert_same_run(&bench);
}

fn an_element_that_is_killed_resumes(cluster: &Cluster) {
    let bench = with_whole_run(cluster, "");
    bench.submit(&ONE);
    let worker = bench.wait_for_checkpoint(PENDULUM);
    assert!(signal("KILL", parent(worker)), "it was over before");
    cluster.wait_until_idle();
    let said = bench.status();
    assert!(
        said.contains("interrupted") && said.contains("SIGKILL"),
        "{said}"
    );
    assert!(bench.submit(&ONE).contains("1 run in 1 element submitted"));
    cluster.wait_until_idle();
    assert_resumed(&bench.manifest("results", PENDULUM).attempts);
    assert_same_run(&bench);
    bench.assert_reported_one();
}

fn a_run_longer_than_its_time_limit_resumes_by_itself(cluster: &Cluster) {
    // Slurm counts limits in minutes and warns up to half a minute late. The run stands still until
    // it has been warned, so that it is too long for its limit however fast the machine is.
    let bench = Bench::new(cluster, 10 * LONG, "0", "time = \"1\"\ngrace = 55");
    bench.expect(
        0,
        &[&["run", "tiny.toml", "--results", "whole"], &ONE[..]].concat(),
    );
    bench.submit(&ONE);
    let worker = bench.wait_for_checkpoint(PENDULUM);
    assert!(signal("STOP", worker), "it was over before");
    thread::sleep(Duration::from_secs(45));
    assert!(signal("CONT", worker), "it did not wait");
    cluster.wait_until_idle();
    assert_resumed(&bench.manifest("results", PENDULUM).attempts);
    assert_same_run(&bench);
    bench.assert_reported_one();
}

fn what_is_cancelled_is_sent_again(cluster: &Cluster) {
    let bench = with_whole_run(cluster, "throttle = 1");
    bench.submit(&[]);
    let first = ids(1).into_iter().find(|id| bench.is_under_way(id));
    let first = first.unwrap_or_else(|| {
        wait_for("a run", || {
            ids(1).into_iter().find(|id| bench.is_under_way(id))
        })
    });
    let said = bench.expect(0, &["cancel", "tiny.toml"]);
    assert!(said.contains("cancelled"), "{said}");
    cluster.wait_until_idle();
    let said = bench.status();
    assert!(
        said.contains("cancelled") && !said.contains("queued") && !said.contains("lost"),
        "{said}"
    );
    assert!(
        bench
            .expect(0, &["cancel", "tiny.toml"])
            .contains("none of these runs")
    );
    bench.submit(&[]);
    cluster.wait_until_idle();
    for id in ids(1) {
        let attempts = bench.manifest("results", &id).attempts.len();
        assert!(
            attempts == 1 || id == first && attempts == 2,
            "{id}: {attempts} attempts"
        );
    }
    assert_same_run(&bench);
    bench.assert_reported(4);
}

fn a_controller_that_starts_again_changes_nothing(cluster: &Cluster) {
    let bench = with_whole_run(cluster, "");
    bench.submit(&[]);
    bench.wait_for_checkpoint(PENDULUM);
    cluster.restart_controller();
    cluster.wait_until_idle();
    for id in ids(1) {
        assert_eq!(bench.manifest("results", &id).attempts.len(), 1, "{id}");
    }
    assert_same_run(&bench);
    bench.assert_reported(4);
}

fn a_job_that_completed_without_a_result(cluster: &Cluster) {
    let bench = Bench::new(cluster, 512, "0", "");
    bench.submit(&ONE);
    cluster.wait_until_idle();
    let mut programs = fs::read_dir(bench.path("results/.programs")).expect("the frozen program");
    let program = programs.next().expect("one").expect("readable").path();
    fs::write(&program, "#!/bin/sh\nexit 0\n").expect("written");
    let two = ["--only", "env=InvertedPendulum-v2"];
    assert!(bench.submit(&two).contains("1 run in 1 element submitted"));
    cluster.wait_until_idle();
    let said = bench.status();
    assert!(
        said.contains("1 failed") && said.contains("1 finished") && said.contains("2 to do"),
        "{said}"
    );
    assert!(
        said.contains("calls its job COMPLETED (exit code 0, on n")
            && said.contains("left no result"),
        "{said}"
    );
    fs::remove_file(&program).expect("there");
    assert!(bench.submit(&two).contains("1 run in 1 element submitted"));
    cluster.wait_until_idle();
    assert_eq!(
        bench
            .manifest("results", "InvertedPendulum-v2/trpo/seed-0")
            .outcome,
        Outcome::Finished
    );
}

fn names_reach_slurm_and_the_script_as_they_are(cluster: &Cluster) {
    for name in [
        "it's \"a\" b",
        "$(touch pwned)",
        "--wrap=touch pwned",
        "two\nlines;touch pwned",
        "100% %A %j",
    ] {
        let bench = Bench::new(cluster, 512, "0", "");
        let results = format!("--results={name}");
        bench.submit(&[&ONE[..], &[&results]].concat());
        cluster.wait_until_idle();
        assert_eq!(
            bench.manifest(name, PENDULUM).outcome,
            Outcome::Finished,
            "{name}"
        );
        assert!(
            bench.path(name).join("tiny/report/README.md").exists(),
            "{name}"
        );
        assert!(
            !bench.path("pwned").exists() && !Path::new("pwned").exists(),
            "{name} was read as a command"
        );
        // A value that Slurm does not know is its to refuse, as the value that it is.
        let partition = format!("--partition={}", name.replace('\n', " "));
        let said = bench.expect(
            2,
            &[
                "submit",
                "tiny.toml",
                "--engine",
                "slurm",
                &partition,
                "--results",
                "other",
            ],
        );
        assert!(
            said.contains("sbatch: ") && said.contains("partition"),
            "{said}"
        );
        assert!(
            !bench.path("pwned").exists(),
            "{name} was read as a command"
        );
    }
    let bench = Bench::new(cluster, 512, "0", "");
    let said = bench.expect(
        2,
        &[
            "submit",
            "tiny.toml",
            "--engine",
            "slurm",
            "--results",
            "a\\b",
        ],
    );
    assert!(said.contains("backslash"), "{said}");
}

impl Bench<'_> {
    fn assert_reported_one(&self) {
        let report =
            fs::read_to_string(self.path("results/tiny/report/README.md")).unwrap_or_default();
        assert!(
            report.contains("1 of 4 runs finished"),
            "{report}\n{}",
            self.logs("results")
        );
    }

    fn is_under_way(&self, id: &str) -> bool {
        RunPaths::checkpoint(&self.run("results", id).partial).exists()
    }
}
