//! Demonstrations as a user meets them: the MMD against scikit-learn, and `mcpo-run demo`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use assert_cmd::Command;
use mcpo_run::{
    demo::{Bandwidth, Demonstration, Estimator, Kernel, mmd::Target},
    env::EnvId,
    quantity::Positive,
};
use nalgebra::DMatrix;
use serde::Deserialize;
use tempfile::TempDir;

/// tests/reference/mmd.json, which mmd.py beside it wrote with scikit-learn.
#[derive(Deserialize)]
struct MmdCase {
    samples: Vec<Vec<f32>>,
    target: Vec<Vec<f32>>,
    median: f64,
    results: Vec<MmdResult>,
}

#[derive(Deserialize)]
struct MmdResult {
    sigma: f64,
    v: f64,
    u: f64,
    witness_v: Vec<f64>,
    witness_u: Vec<f64>,
    gradient_v: Vec<Vec<f64>>,
}

fn columns(rows: &[Vec<f32>]) -> DMatrix<f32> {
    DMatrix::from_vec(rows[0].len(), rows.len(), rows.concat())
}

#[test]
fn the_mmd_agrees_with_scikit_learn() {
    // Kernel values are f32: about 1e-6 for norms of some ten.
    const TOLERANCE: f64 = 3e-6;
    let cases: Vec<MmdCase> =
        serde_json::from_str(include_str!("reference/mmd.json")).expect("the reference");
    for case in &cases {
        let (samples, points) = (columns(&case.samples), columns(&case.target));
        let median = Kernel::new(Bandwidth::Median, &points);
        assert!((median.scale - 0.5 / case.median.powi(2)).abs() < 1e-5 * median.scale);
        for expected in &case.results {
            let sigma = Positive::try_from(expected.sigma).expect("above 0");
            let kernel = Kernel::new(Bandwidth::Fixed(sigma), &points);
            for (estimator, value, witness) in [
                (Estimator::V, expected.v, &expected.witness_v),
                (Estimator::U, expected.u, &expected.witness_u),
            ] {
                let target = Target::new(points.clone(), kernel, estimator);
                assert!(
                    (target.mmd_squared(&samples) - value).abs() < TOLERANCE,
                    "{estimator:?} {value}"
                );
                let mut got = vec![f64::NAN; samples.ncols()];
                target.mmd_squared_witness(&samples, &mut got);
                assert!(
                    got.iter()
                        .zip(witness)
                        .all(|(got, expected)| (got - expected).abs() < TOLERANCE)
                );
            }
            let target = Target::new(points.clone(), kernel, Estimator::V);
            let mut gradient = DMatrix::from_element(samples.nrows(), samples.ncols(), f32::NAN);
            target.mmd_squared_gradient(&samples, &mut gradient);
            let expected = expected.gradient_v.concat();
            assert!(
                gradient
                    .iter()
                    .zip(expected)
                    .all(|(&got, expected)| (f64::from(got) - expected).abs() < TOLERANCE)
            );
        }
    }
}

fn mcpo_run(arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::new(env!("CARGO_BIN_EXE_mcpo-run"))
        .arg("demo")
        .args(arguments)
        .assert()
}

fn text(output: &[u8]) -> String {
    String::from_utf8(output.to_vec()).expect("text")
}

fn reference(name: &str) -> String {
    Path::new("tests/reference")
        .join(name)
        .display()
        .to_string()
}

fn recorded(env: EnvId) -> PathBuf {
    Path::new("tests/parity").join(format!("{env}.parquet"))
}

/// One line on stderr, exit code 2, nothing on stdout.
fn refused(arguments: &[&str], says: &[&str]) {
    let output = mcpo_run(arguments).code(2).get_output().clone();
    let complaint = text(&output.stderr);
    assert!(
        output.stdout.is_empty() && complaint.starts_with("error: "),
        "{arguments:?}: {complaint}"
    );
    for words in says {
        assert!(complaint.contains(words), "{arguments:?}: {complaint}");
    }
}

#[test]
fn bad_input_is_one_error_and_writes_nothing() {
    let folder = TempDir::new().expect("a folder");
    let hopper = recorded(EnvId::Hopper).display().to_string();
    let out = folder.path().join("out.parquet").display().to_string();
    refused(
        &["verify", "nowhere.parquet", "--env", "Hopper-v2"],
        &["nowhere.parquet"],
    );
    refused(
        &["verify", &hopper, "--env", "Hoper-v2"],
        &["Hoper-v2", "nearest", "Hopper-v2"],
    );
    refused(
        &["verify", &hopper, "--env", "Walker2d-v2"],
        &[&hopper, "the file says that it is from Hopper-v2"],
    );
    refused(
        &["verify", &hopper, "--env", "Hopper-v2", "--tolerance", "-1"],
        &["--tolerance"],
    );
    refused(
        &["show", "tests/reference/mmd.json"],
        &["mmd.json", "not a Parquet file"],
    );
    let pickle = reference("import_protocol3.pkl");
    refused(
        &["import", &pickle, "--env", "Ant-v2", "--out", &out],
        &["does not fit Ant-v2", "InvertedPendulum-v2"],
    );
    refused(
        &[
            "import",
            "tests/reference/mmd.py",
            "--env",
            "Ant-v2",
            "--out",
            &out,
        ],
        &["mmd.py", "not a pickle"],
    );
    let nowhere = folder
        .path()
        .join("missing/out.parquet")
        .display()
        .to_string();
    refused(
        &[
            "import",
            &pickle,
            "--env",
            "InvertedPendulum-v2",
            "--out",
            &nowhere,
        ],
        &["cannot write", &nowhere],
    );
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
}

#[test]
fn verify_tells_agreement_from_deviation() {
    let folder = TempDir::new().expect("a folder");
    for env in EnvId::ALL {
        let file = recorded(env).display().to_string();
        let output = mcpo_run(&["verify", &file, "--env", env.name()])
            .code(0)
            .get_output()
            .clone();
        assert!(text(&output.stdout).contains("the replay agrees"), "{env}");
    }
    // One number of one observation, by a hundred times the tolerance.
    let mut demonstration =
        Demonstration::read(&recorded(EnvId::HalfCheetah)).expect("it was recorded");
    demonstration.observations[(3, 200)] += 1e-7;
    let path = folder.path().join("changed.parquet");
    demonstration.write(&path).expect("written");
    let changed = path.display().to_string();
    let output = mcpo_run(&["verify", &changed, "--env", "HalfCheetah-v2"])
        .code(4)
        .get_output()
        .clone();
    assert!(text(&output.stdout).contains("DIFFERS"));
    mcpo_run(&[
        "verify",
        &changed,
        "--env",
        "HalfCheetah-v2",
        "--tolerance",
        "1e-6",
    ])
    .code(0);
}

#[test]
fn verify_tells_where_it_differs_and_which_version_does_so() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("changed.parquet").display().to_string();
    let mut demonstration = Demonstration::read(&recorded(EnvId::Hopper)).expect("it was recorded");
    let lasts: Vec<usize> = demonstration
        .episodes()
        .map(|steps| steps.end - 1)
        .collect();
    for last in lasts
        .into_iter()
        .filter(|&last| demonstration.terminated[last])
    {
        demonstration.rewards.as_mut().expect("rewards")[last] -= 1.0;
    }
    demonstration.observations[(3, 30)] += 1e-3; // step 4 of episode 1, which begins in row 26
    demonstration.write(Path::new(&path)).expect("written");
    let output = mcpo_run(&["verify", &path, "--env", "Hopper-v2"])
        .code(4)
        .get_output()
        .clone();
    let said = text(&output.stdout);
    for words in [
        "in episode 1, step 4, number 3 (tolerance",
        "as a recording of Hopper-v5 does: v5 pays no 1",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn a_run_refuses_the_demonstration_of_another_environment() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("demo.parquet");
    let matrix = folder.path().join("x.toml");
    fs::write(
        &matrix,
        "name = \"x\"\ndemonstrations = \"demo.parquet\"\nbudget.env_steps = 100_000\n\
         [[matrix]]\nseed = [0]\nenv = [\"Walker2d-v2\"]\nalgorithm = [\"mcpo\"]\n",
    )
    .expect("written");
    let mut cheetah = Demonstration::read(&recorded(EnvId::HalfCheetah)).expect("it was recorded");
    for (label, says) in [
        (
            Some("HalfCheetah-v2"),
            "the file says that it is from HalfCheetah-v2",
        ),
        (
            Some("halfcheetah-medium-v2"),
            "the file says that it is from halfcheetah-medium-v2",
        ),
        (None, "its observations move like those of HalfCheetah-v2"),
        (
            Some("Walker2d-v2"),
            "its observations move like those of HalfCheetah-v2",
        ),
    ] {
        cheetah.provenance = label
            .map(|label| ("env".to_owned(), label.to_owned()))
            .into_iter()
            .collect();
        cheetah.write(&path).expect("written");
        let mut program = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
        let output = program
            .arg(&matrix)
            .arg("--results")
            .arg(folder.path().join("results"))
            .assert()
            .code(2);
        let complaint = text(&output.get_output().stderr);
        assert!(
            complaint.contains("does not fit Walker2d-v2") && complaint.contains(says),
            "{label:?}: {complaint}"
        );
    }
    assert!(!folder.path().join("results").exists());
}

#[test]
fn an_import_prints_what_it_has_and_what_was_lost() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("out.parquet");
    let out = path.display().to_string();
    let pickle = reference("import_protocol3.pkl");
    let output = mcpo_run(&[
        "import",
        &pickle,
        "--env",
        "InvertedPendulum-v2",
        "--out",
        &out,
    ])
    .code(0)
    .get_output()
    .clone();
    let said = text(&output.stdout);
    for words in [
        "2 episodes, 5 steps",
        "3.0000, 2.0000",
        "lost: 1 of 20 numbers in observations (5.00 %)",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let demonstration =
        Demonstration::read_for(&path, EnvId::InvertedPendulum).expect("it was written");
    assert!(
        demonstration
            .provenance
            .iter()
            .any(|(key, value)| key == "return" && value == "2.5")
    );
    let again = [
        "import",
        &pickle,
        "--env",
        "InvertedPendulum-v2",
        "--out",
        &out,
    ];
    refused(&again, &[&out, "already exists", "--force"]);
    mcpo_run(&[&again[..], &["--force"]].concat()).code(0);
    let shown = text(&mcpo_run(&["show", &out]).code(0).get_output().stdout);
    for words in [
        "2 episodes, 5 steps",
        "not recorded; it cannot be replayed",
        "imported_from",
        "import_protocol3.pkl",
    ] {
        assert!(shown.contains(words), "{shown}");
    }
    // Without poses there is nothing to replay.
    refused(&["verify", &out, "--env", "InvertedPendulum-v2"], &["qpos"]);
}

#[test]
fn collect_replaces_nothing_unasked_and_warns_of_a_return_that_is_far_off() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("kept.toml");
    let text_of_file = "name = 'kept'\nreward = 'dense'\nbudget.env_steps = 512\nnetwork.hidden = [8]\n\
                        checkpoint.keep_policy_every = 256\nevaluation.final_episodes = 1\n\
                        [rollout]\nsteps = 256\n[algorithms.ppo]\nminibatch = 64\n\
                        [[matrix]]\nseed = [0]\nenv = ['InvertedPendulum-v2']\nalgorithm = ['ppo']\n";
    fs::write(&file, text_of_file).expect("written");
    let (file, results) = (
        file.display().to_string(),
        folder.path().join("results").display().to_string(),
    );
    Command::new(env!("CARGO_BIN_EXE_mcpo-run"))
        .args(["run", &file, "--results", &results, "-q"])
        .assert()
        .code(0);

    let out = folder.path().join("demos");
    let at = out.display().to_string();
    let collect = |more: &[&str]| {
        mcpo_run(
            &[
                &["collect", &file, "--results", &results, "--starts", "2"],
                more,
            ]
            .concat(),
        )
        .get_output()
        .clone()
    };
    let without = collect(&["--target", "20"]);
    assert!(
        text(&without.stderr).contains("--out"),
        "where to is not guessed"
    );

    let first = collect(&["--out", &at, "--target", "20"]);
    let path = out.join("InvertedPendulum-v2.parquet");
    let written = fs::read(&path).expect("it was written");
    assert!(first.status.success(), "{}", text(&first.stderr));
    let again = collect(&["--out", &at, "--target", "600"]);
    let complaint = text(&again.stderr);
    assert!(
        again.status.code() == Some(2) && complaint.contains("--force"),
        "{complaint}"
    );
    assert_eq!(
        fs::read(&path).expect("it is there"),
        written,
        "it was replaced unasked"
    );

    let forced = collect(&["--out", &at, "--target", "600", "--force"]);
    assert!(forced.status.success());
    let warning = text(&forced.stderr);
    assert!(
        warning.contains("warning: no episode of InvertedPendulum-v2") && warning.contains("600"),
        "{warning}"
    );
    let replaced = Demonstration::read(&path).expect("a demonstration");
    let likely = replaced.returns().expect("rewards")[0];
    assert!(
        likely < 540.0
            && replaced
                .provenance
                .contains(&("wanted_return".into(), "600".into())),
        "{likely}"
    );
}

#[test]
fn several_are_shown_as_a_table_of_what_decides_a_tolerance() {
    let files = [EnvId::Hopper, EnvId::HalfCheetah].map(|env| recorded(env).display().to_string());
    let shown = text(
        &mcpo_run(&["show", &files[0], &files[1]])
            .code(0)
            .get_output()
            .stdout,
    );
    let lines: Vec<&str> = shown.lines().collect();
    assert!(
        lines.len() == 4 && lines[0].contains("action rms | D of doing nothing"),
        "{shown}"
    );
    for (line, file) in lines[2..].iter().zip(&files) {
        let demonstration = Demonstration::read(Path::new(file)).expect("it was recorded");
        let rms = format!("| {:.3} |", demonstration.action_rms());
        assert!(line.contains(file) && line.contains(&rms), "{line}");
    }
    refused(
        &["show", &files[0], &files[1], "--out", "both.png"],
        &["one demonstration"],
    );
}
