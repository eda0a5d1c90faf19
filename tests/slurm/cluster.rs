//! A cluster and a folder with a matrix, for one scenario after another.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread,
    time::Duration,
};

use mcpo_run::record::{Claim, Manifest, RunPaths, policy};

use crate::processes::wait_for;

/// Slurm, until it is dropped.
pub struct Cluster {
    folder: tempfile::TempDir,
}

impl Cluster {
    /// Starts one; what stands in the way where none can be.
    pub fn start() -> Result<Self, String> {
        // Its sockets need a short name.
        let folder = tempfile::Builder::new()
            .prefix("mcpo.")
            .tempdir_in("/tmp")
            .map_err(|error| error.to_string())?;
        let is_root = fs::metadata(folder.path())
            .is_ok_and(|own| std::os::unix::fs::MetadataExt::uid(&own) == 0);
        let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin:/sbin";
        let is_there = |name: &str| {
            path.split(':')
                .any(|folder| Path::new(folder).join(name).exists())
        };
        if let Some(missing) = ["munged", "slurmctld", "slurmd", "sbatch"]
            .into_iter()
            .find(|name| !is_there(name))
        {
            return Err(format!(
                "there is no {missing}; `tests/slurm/cluster.sh install` installs Slurm as root"
            ));
        }
        if !is_root {
            return Err("Slurm's daemons need root".to_owned());
        }
        let cluster = Self { folder };
        cluster.script("start");
        Ok(cluster)
    }

    fn script(&self, command: &str) {
        let mut script = Command::new("tests/slurm/cluster.sh");
        let output = script
            .args([command, self.folder.path().to_str().expect("text")])
            .output()
            .expect("it starts");
        assert!(
            output.status.success(),
            "{command}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }

    /// Ends the controller and starts it again.
    pub fn restart_controller(&self) {
        self.script("stop-controller");
        thread::sleep(Duration::from_secs(2));
        self.script("start");
    }

    /// One of Slurm's commands.
    pub fn slurm(&self, program: &str, arguments: &[&str]) -> String {
        let mut command = Command::new(program);
        let output = command
            .args(arguments)
            .env("SLURM_CONF", self.conf())
            .output()
            .expect("it starts");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn conf(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }

    /// Waits until nothing is queued or runs.
    pub fn wait_until_idle(&self) {
        wait_for("the end of all jobs", || {
            thread::sleep(Duration::from_millis(20)); // the controller has other things to do
            self.slurm("squeue", &["-h"])
                .trim()
                .is_empty()
                .then_some(())
        });
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let mut script = Command::new("tests/slurm/cluster.sh");
        let _ = script
            .arg("stop")
            .arg(self.folder.path())
            .stderr(Stdio::null())
            .status();
    }
}

/// A folder with the matrix `tiny.toml`, and the program on it.
pub struct Bench<'a> {
    pub cluster: &'a Cluster,
    folder: tempfile::TempDir,
}

impl<'a> Bench<'a> {
    /// With runs of `env_steps` and `seeds` in two environments by two algorithms, and `slurm` in
    /// the table of that name.
    pub fn new(cluster: &'a Cluster, env_steps: u64, seeds: &str, slurm: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let matrix = format!(
            r#"
            name = "tiny"
            budget.env_steps = {env_steps}
            rollout.steps = 256
            network.hidden = [8]
            evaluation = {{ every = 100_000, episodes = 1, final_episodes = 2 }}
            checkpoint.every_seconds = 0.05
            algorithms.ppo.minibatch = 64
            algorithms.trpo.minibatch = 64

            [slurm]
            {slurm}

            [[matrix]]
            seed = [{seeds}]
            env = ["InvertedPendulum-v2", "MountainCarContinuous-v0"]
            algorithm = ["ppo", "trpo"]
            "#
        );
        fs::write(folder.path().join("tiny.toml"), matrix).expect("written");
        Self { cluster, folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program with `arguments`, to its end, which must be `code`; what it says.
    pub fn expect(&self, code: i32, arguments: &[&str]) -> String {
        let mut program = Command::new(env!("CARGO_BIN_EXE_mcpo-run"));
        program
            .args(arguments)
            .current_dir(self.folder.path())
            .env("SLURM_CONF", self.cluster.conf());
        let Output {
            status,
            stdout,
            stderr,
        } = program.output().expect("it starts");
        let said = format!(
            "{}{}",
            String::from_utf8_lossy(&stdout),
            String::from_utf8_lossy(&stderr)
        );
        assert_eq!(status.code(), Some(code), "{arguments:?}\n{said}");
        said
    }

    pub fn submit(&self, more: &[&str]) -> String {
        self.expect(
            0,
            &[&["submit", "tiny.toml", "--engine", "slurm"], more].concat(),
        )
    }

    pub fn status(&self) -> String {
        self.expect(0, &["status", "tiny.toml"])
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
            .unwrap_or_else(|| panic!("{id} has not ended: {}", self.logs(results)))
    }

    /// The digest of a finished run's policy, which is of every step that it took.
    pub fn digest(&self, results: &str, id: &str) -> String {
        policy::digest(&RunPaths::policy(&self.run(results, id).complete)).expect("it finished")
    }

    /// Waits until a run is under way and has a checkpoint; gives the process that trains it.
    pub fn wait_for_checkpoint(&self, id: &str) -> u32 {
        let paths = self.run("results", id);
        wait_for("a checkpoint", || {
            RunPaths::checkpoint(&paths.partial).exists().then_some(())
        });
        wait_for("a worker", || Claim::owner(&paths).ok()?).process
    }

    /// What the elements said.
    pub fn logs(&self, results: &str) -> String {
        let mut text = String::new();
        let Ok(submissions) = fs::read_dir(self.path(results).join("tiny/.slurm")) else {
            return text;
        };
        for submission in submissions.flatten() {
            for log in fs::read_dir(submission.path().join("log"))
                .into_iter()
                .flatten()
                .flatten()
            {
                text += &format!(
                    "{}:\n{}",
                    log.path().display(),
                    fs::read_to_string(log.path()).unwrap_or_default()
                );
            }
        }
        text
    }

    /// Whether the report is there, and of so many runs.
    pub fn assert_reported(&self, runs: usize) {
        let report =
            fs::read_to_string(self.path("results/tiny/report/README.md")).unwrap_or_default();
        assert!(
            report.contains(&format!("{runs} of {runs} runs finished")),
            "{report}\n{}",
            self.logs("results")
        );
    }
}

/// The ids of the runs of `seeds` seeds.
pub fn ids(seeds: u64) -> Vec<String> {
    let mut ids = Vec::new();
    for env in ["InvertedPendulum-v2", "MountainCarContinuous-v0"] {
        for algorithm in ["ppo", "trpo"] {
            ids.extend((0..seeds).map(|seed| format!("{env}/{algorithm}/seed-{seed}")));
        }
    }
    ids
}

/// The parent of a process.
pub fn parent(process: u32) -> u32 {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).expect("it lives");
    let fields = text.rsplit_once(')').expect("a state").1;
    fields
        .split_whitespace()
        .nth(1)
        .and_then(|parent| parent.parse().ok())
        .expect("a number")
}
