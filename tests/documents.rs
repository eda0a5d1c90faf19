//! What the repository's pages promise: links that lead somewhere, a first page that is short,
//! examples that run.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use assert_cmd::prelude::CommandCargoExt;
use mcpo_run::{nn::Pass, record::policy};
use nalgebra::DMatrix;

#[path = "../examples/environment.rs"]
mod environment;
#[path = "../examples/solver.rs"]
mod solver;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The pages below `folder`, those that programs write apart.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of the repository") {
        let path = entry.expect("its entries can be read").path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let is_written =
            name.starts_with('.') || ["target", "third_party"].contains(&name.as_str());
        if path.is_dir() && !is_written && folder != root().join("results") {
            found.extend(pages(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found
}

/// `text` without its fenced blocks.
fn prose(text: &str) -> String {
    text.split("\n```").step_by(2).collect()
}

/// Where the links of a page lead, those to other sites apart.
fn links(text: &str) -> Vec<String> {
    let prose = prose(text);
    let targets = prose
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next());
    targets
        .filter(|target| !target.contains("://"))
        .map(str::to_owned)
        .collect()
}

/// The anchors of a page's headings, as GitHub makes them: a second heading of the same words gets
/// `-1`.
fn anchors(text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for heading in prose(text).lines().filter(|line| line.starts_with('#')) {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words
            .chars()
            .filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
        let anchor: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        let earlier = found.iter().filter(|other| {
            other
                .split_once('~')
                .map_or(other.as_str(), |(name, _)| name)
                == anchor
        });
        let count = earlier.count();
        found.push(if count == 0 {
            anchor
        } else {
            format!("{anchor}~{count}")
        });
    }
    found
        .iter()
        .map(|anchor| anchor.replace('~', "-"))
        .collect()
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let pages = pages(root());
    assert!(pages.len() > 10, "{pages:?}");
    let mut broken = Vec::new();
    for page in &pages {
        let text = fs::read_to_string(page).expect("a page");
        for link in links(&text) {
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() {
                page.clone()
            } else {
                page.parent().expect("a folder").join(file)
            };
            let is_there = target.exists()
                && (anchor.is_empty()
                    || anchors(&fs::read_to_string(&target).unwrap_or_default())
                        .iter()
                        .any(|a| a == anchor));
            if !is_there {
                broken.push(format!(
                    "{}: {link}",
                    page.strip_prefix(root()).unwrap_or(page).display()
                ));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn the_first_page_is_short() {
    let words = fs::read_to_string(root().join("README.md"))
        .expect("the first page")
        .split_whitespace()
        .count();
    assert!(words < 900, "{words} words");
}

#[test]
fn the_solver_agrees_with_a_search() {
    solver::main();
}

#[test]
fn an_environment_of_ones_own_is_played() {
    environment::main().expect("the cart comes to rest");
}

/// Trains for one iteration, and gives the policy's file.
fn trained(folder: &Path) -> PathBuf {
    let matrix = "
        name = 'play'
        budget.env_steps = 256
        rollout.steps = 256
        evaluation.final_episodes = 1
        network.hidden = [8, 5]
        algorithms.ppo.minibatch = 64
        [[matrix]]
        seed = [0]
        env = ['InvertedPendulum-v2']
        algorithm = ['ppo']
    ";
    fs::write(folder.join("play.toml"), matrix).expect("written");
    let mut command = Command::cargo_bin("mcpo-run").expect("the binary is built");
    let output = command
        .current_dir(folder)
        .args(["play.toml", "--jobs", "1"])
        .output()
        .expect("it runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    folder.join("results/play/runs/InvertedPendulum-v2/ppo/seed-0/policy.safetensors")
}

#[test]
fn a_policy_acts_in_numpy_as_it_does_here() {
    let python = |code: &str, file: &Path| {
        let mut command =
            Command::new(std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned()));
        let command = command
            .current_dir(root().join("examples"))
            .env("PYTHONDONTWRITEBYTECODE", "1");
        command
            .args(["-c", code])
            .arg(file)
            .output()
            .expect("python3, which the build needs, runs")
    };
    if !python("import numpy", Path::new("")).status.success() {
        return; // the build needs no numpy; where it is there, the example is run
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = trained(folder.path());
    let code = "import sys, play; policy = play.Policy(sys.argv[1]); print(*policy.act([0.1, -0.02, 0.3, 9e3]))";
    let output = python(code, &file);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let shown: f64 = String::from_utf8_lossy(&output.stdout)
        .trim()
        .parse()
        .expect("one number");

    let (agent, _) = policy::read(&file).expect("a policy");
    let observation = DMatrix::from_column_slice(4, 1, &[0.1, -0.02, 0.3, 9e3]); // the last is clipped
    let mut pass = Pass::default();
    agent
        .policy
        .forward(&agent.normalizer.normalize_columns(&observation), &mut pass);
    let action = f64::from(pass.output()[(0, 0)]);
    // tanh and sums of a dozen f32 numbers, rounded differently.
    assert!(
        (shown - action).abs() < 1e-6 * (1.0 + action.abs()),
        "{shown} in numpy, {action} here"
    );
}
