//! A folder with a small matrix, and the program on it, for the tests of the runner.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
};

use crate::processes::wait_for;
use mcpo_run::{
    algo::Agent,
    record::{Manifest, RunPaths, policy, rows},
    train::{EvaluationEpisode, Iteration},
};

/// Everything that a finished run recorded, but for what a clock said.
#[derive(Debug, PartialEq)]
pub struct Recorded {
    iterations: Vec<Iteration>,
    evaluations: Vec<EvaluationEpisode>,
    agent: Agent,
}

/// A temporary folder that holds `tiny.toml`.
pub struct Workbench {
    folder: tempfile::TempDir,
}

impl Workbench {
    /// With runs of `env_steps` on two quick tasks, two seeds each.
    pub fn new(env_steps: u64) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let matrix = format!(
            r#"
            name = "tiny"
            description = "four quick runs"
            budget.env_steps = {env_steps}
            rollout.steps = 256
            network.hidden = [8]
            evaluation = {{ every = 4096, episodes = 1, final_episodes = 2 }}
            checkpoint.every_seconds = 0.02
            algorithms.ppo.minibatch = 64

            [[matrix]]
            seed = [0, 1]
            env = ["InvertedPendulum-v2", "MountainCarContinuous-v0"]
            algorithm = ["ppo"]
            "#
        );
        fs::write(folder.path().join("tiny.toml"), matrix).expect("written");
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program with `arguments`, in the folder.
    pub fn program(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
        command.args(arguments).current_dir(self.folder.path());
        command
    }

    /// Runs the program to its end.
    pub fn call(&self, arguments: &[&str]) -> Output {
        self.program(arguments)
            .output()
            .expect("the program starts")
    }

    /// Runs the program to its end, which must be `code`; gives what it wrote to stdout and to
    /// stderr.
    pub fn expect(&self, code: i32, arguments: &[&str]) -> (String, String) {
        texts(&self.call(arguments), code, arguments)
    }

    /// Starts the program, to be disturbed, and not to ignore what the tests themselves were
    /// started to ignore: a shell's background job ignores Ctrl-C.
    pub fn start(&self, arguments: &[&str]) -> Child {
        let mut program = Command::new("env");
        program
            .args(["--default-signal", env!("CARGO_BIN_EXE_mcpo-run")])
            .args(arguments);
        program
            .current_dir(self.folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts")
    }

    /// The places of a run in the folder `results`.
    pub fn run(&self, results: &str, id: &str) -> RunPaths {
        RunPaths::new(&self.path(results), "tiny", id).expect("a good id")
    }

    /// The manifest of a run that has ended.
    pub fn manifest(&self, results: &str, id: &str) -> Manifest {
        self.run(results, id)
            .ended()
            .expect("readable")
            .expect("the run has ended")
    }

    /// What a finished run recorded.
    pub fn recorded(&self, results: &str, id: &str) -> Recorded {
        let folder = self.run(results, id).complete;
        let mut iterations = rows::read_progress(&RunPaths::progress(&folder)).expect("readable");
        for row in &mut iterations {
            (row.physics_seconds, row.rollout_seconds, row.update_seconds) = (0.0, 0.0, 0.0);
        }
        let evaluations =
            rows::read_evaluations(&RunPaths::evaluations(&folder)).expect("readable");
        let (agent, _) = policy::read(&RunPaths::policy(&folder)).expect("readable");
        Recorded {
            iterations,
            evaluations,
            agent,
        }
    }

    /// The process that works on a run, once it has begun.
    pub fn worker(&self, results: &str, id: &str) -> u32 {
        let path = RunPaths::manifest(&self.run(results, id).partial);
        let begun = || {
            Manifest::read(&path)
                .ok()??
                .attempts
                .last()
                .filter(|last| last.ended.is_none())
                .cloned()
        };
        wait_for("a worker", || begun().map(|attempt| attempt.process))
    }

    /// Waits until a run has a checkpoint.
    pub fn wait_for_checkpoint(&self, results: &str, id: &str) {
        let path = RunPaths::checkpoint(&self.run(results, id).partial);
        wait_for("a checkpoint", || path.exists().then_some(()));
    }
}

/// What `output` says, whose exit code must be `code`.
pub fn texts(output: &Output, code: i32, what: &[&str]) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(
        output.status.code(),
        Some(code),
        "{what:?}\n{stdout}\n{stderr}"
    );
    (stdout, stderr)
}

/// All files under `folder` with their contents, by their paths.
pub fn snapshot(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        if path.is_dir() {
            files.extend(snapshot(&path));
        } else {
            files.push((path.clone(), fs::read(&path).expect("readable")));
        }
    }
    files.sort();
    files
}

pub const PENDULUM: &str = "InvertedPendulum-v2/ppo/seed-0";
pub const CAR: &str = "MountainCarContinuous-v0/ppo/seed-1";
pub const ALL: [&str; 4] = [
    PENDULUM,
    "InvertedPendulum-v2/ppo/seed-1",
    "MountainCarContinuous-v0/ppo/seed-0",
    CAR,
];
