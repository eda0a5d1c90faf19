//! Pre-training that several runs share.

use std::{fs, path::PathBuf};

use crate::workbench::{Workbench, snapshot};

const MATRIX: &str = r#"
    name = "tiny"
    demonstrations = "demo.parquet"
    budget.env_steps = 512
    rollout.steps = 256
    network.hidden = [8]
    evaluation = { every = 4096, episodes = 1, final_episodes = 2 }
    algorithms.pretraining.ppo.minibatch = 64

    [[matrix]]
    seed = [0, 1]
    env = ["InvertedPendulum-v2"]
    algorithm = ["bc", "pretraining"]
    "pretraining.ppo.clip" = [0.1, 0.2]
"#;

fn bench() -> Workbench {
    let bench = Workbench::new(512);
    fs::write(bench.path("tiny.toml"), MATRIX).expect("written");
    fs::copy(
        "tests/parity/InvertedPendulum-v2.parquet",
        bench.path("demo.parquet"),
    )
    .expect("copied");
    bench
}

/// The files called `name` of all runs, with their contents.
fn files(bench: &Workbench, results: &str, name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = snapshot(&bench.path(results).join("tiny/runs"));
    files.retain(|(path, _)| path.ends_with(name));
    files.iter_mut().for_each(|(path, _)| {
        *path = path
            .strip_prefix(bench.path(results))
            .expect("below")
            .to_owned()
    });
    files
}

/// How many runs trained an agent before they began, and how many found one.
fn trained_and_found(bench: &Workbench, results: &str) -> (usize, usize) {
    let logs = files(bench, results, "log.txt");
    let count = |words: &str| {
        logs.iter()
            .filter(|(_, log)| String::from_utf8_lossy(log).contains(words))
            .count()
    };
    (
        count("trained the agent"),
        count("found the pre-trained agent"),
    )
}

#[test]
fn what_runs_share_is_trained_once_and_changes_no_bit() {
    let bench = bench();
    for jobs in ["1", "3"] {
        bench.expect(0, &["tiny.toml", "--jobs", jobs, "--results", jobs]);
        assert_eq!(
            trained_and_found(&bench, jobs),
            (2, 4),
            "two seeds, three runs each, {jobs} at a time"
        );
    }
    let policies = files(&bench, "1", "policy.safetensors");
    assert_eq!(policies.len(), 6);
    assert_eq!(policies, files(&bench, "3", "policy.safetensors"));
    // Each alone, where nothing can be found.
    for (clip, results) in [("0.1", "alone-1"), ("0.2", "alone-2")] {
        let only = format!("seed=1,algorithm=pretraining,pretraining.ppo.clip={clip}");
        bench.expect(0, &["tiny.toml", "--results", results, "--only", &only]);
        assert_eq!(trained_and_found(&bench, results), (1, 0));
        let alone = files(&bench, results, "policy.safetensors");
        assert!(
            alone.len() == 1 && policies.contains(&alone[0]),
            "clip {clip}: another policy without sharing"
        );
    }
}

#[test]
fn a_damaged_agent_is_trained_anew_and_told_in_the_log() {
    let bench = bench();
    bench.expect(0, &["tiny.toml", "--only", "algorithm=bc,seed=0"]);
    let kept = snapshot(&bench.path("results/.pretrained"));
    let (path, whole) = kept
        .iter()
        .find(|(_, bytes)| !bytes.is_empty())
        .expect("the agent is kept");
    fs::write(path, &whole[..whole.len() / 2]).expect("written");
    bench.expect(0, &["tiny.toml", "--only", "seed=0"]);
    assert_eq!(
        trained_and_found(&bench, "results"),
        (2, 1),
        "once by the first call, once for the damage"
    );
    assert_eq!(&fs::read(path).expect("replaced"), whole);
    let logs = files(&bench, "results", "log.txt");
    assert!(
        logs.iter()
            .any(|(_, log)| String::from_utf8_lossy(log).contains("damaged"))
    );
}
