//! The matrix file, as a user meets it.

mod layers;
mod mistakes_are_told;
mod schema;
mod shipped;
mod slurm;

use std::path::Path;

use mcpo_run::{
    plan::{RunSpec, plan},
    spec::{self, ExperimentSpec, Overrides, SpecErrors},
};

/// The least that an experiment needs, for tests to add to.
const LEAST: &str = r#"
name = "least"
budget.env_steps = 100_000

[[matrix]]
seed = [0, 1]
env = ["Hopper-v2", "Ant-v2"]
algorithm = ["mcpo", "ppo"]
"#;

fn parse(text: &str) -> Result<ExperimentSpec, SpecErrors> {
    spec::parse(Path::new("test.toml"), text, &Overrides::default())
}

/// What `--set` and `--axis` say.
fn overrides(set: &[&str], axis: &[&str]) -> Overrides {
    let owned = |arguments: &[&str]| {
        arguments
            .iter()
            .map(|argument| (*argument).to_owned())
            .collect()
    };
    Overrides {
        set: owned(set),
        axis: owned(axis),
    }
}

/// The plan of [`LEAST`] with `more` behind it, under `--set` and `--axis`.
fn runs(more: &str, set: &[&str], axis: &[&str]) -> Vec<RunSpec> {
    let spec = spec::parse(
        Path::new("test.toml"),
        &format!("{LEAST}{more}"),
        &overrides(set, axis),
    )
    .expect("a valid experiment");
    plan(&spec).expect("a valid experiment has a plan")
}
