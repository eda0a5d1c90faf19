//! `mcpo-run bench`.

use std::{path::Path, process::ExitCode};

use clap::builder::PossibleValuesParser;
use comfy_table::{Cell, CellAlignment, Table};

use super::{
    environment::{Named, named},
    plan::table,
    print,
};
use crate::{
    bench::{self, Floor, Measured},
    plan::{self, RunSpec},
    schedule::progress::thousands,
    spec::{self, Algorithm, Overrides, SpecErrors},
};

/// The arguments of `bench`.
#[derive(Debug, clap::Args)]
pub struct BenchArguments {
    /// The environment, such as HalfCheetah-v2, or robot.toml:NAME for a robot of one's own
    #[arg(long, value_parser = named)]
    env: Named,
    /// The algorithm
    #[arg(long, value_parser = PossibleValuesParser::new(Algorithm::names()))]
    algorithm: String,
    /// Set a key as in a matrix file, such as rollout.environments=1 or
    /// algorithms.mcpo.cg_iterations=5
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Iterations to measure, after one to warm up
    #[arg(long, value_name = "N", default_value_t = 5)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Measures the speed of training, and prints it.
pub fn run(arguments: &BenchArguments) -> anyhow::Result<ExitCode> {
    let measured = bench::measure(&spec(arguments)?, arguments.iterations.into())?;
    let text = if arguments.json {
        serde_json::to_string_pretty(&measured)? + "\n"
    } else {
        show(&measured)
    };
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// The errors without their lines, since they would be of a matrix file that nobody wrote.
fn invalid(errors: SpecErrors) -> anyhow::Error {
    let told = errors.iter().map(|error| {
        let more = [&error.label, &error.help]
            .into_iter()
            .flatten()
            .map(|more| format!("; {more}"));
        format!("{error}{}", more.collect::<String>())
    });
    anyhow::anyhow!(told.collect::<Vec<_>>().join("\n"))
}

/// The run to measure. It is read as if from a matrix file in `experiments`, so that the
/// demonstrations are found; on a user's robot, from one that extends the file of the robot.
fn spec(arguments: &BenchArguments) -> anyhow::Result<RunSpec> {
    let BenchArguments {
        env: Named { env, file },
        algorithm,
        set,
        ..
    } = arguments;
    let mut head = "name = 'bench'\n".to_owned();
    if let Some(file) = file {
        let file = std::path::absolute(file)?;
        // What the file draws is of axes that this run has not.
        head += &format!(
            "extends = {}\nfigures = []\ntables = []\nsettings = []\nclaims = []\n",
            toml::Value::String(file.to_string_lossy().into_owned())
        );
    }
    let text = format!(
        "{head}budget.env_steps = 1_000_000_000\n\
         [[matrix]]\nseed = [0]\nenv = ['{env}']\nalgorithm = ['{algorithm}']\n"
    );
    let overrides = Overrides {
        set: set.clone(),
        axis: Vec::new(),
    };
    let spec =
        spec::parse(Path::new("experiments/bench.toml"), &text, &overrides).map_err(invalid)?;
    let run = plan::plan(&spec)?.remove(0);
    spec.ready(run.demonstration.as_deref()).map_err(invalid)?;
    Ok(run)
}

fn show(measured: &Measured) -> String {
    let Measured {
        shapes,
        floor,
        iterations,
        env_steps,
        ..
    } = measured;
    let mut text = format!(
        "{} in {}: {} observations, hidden layers of {:?}, {} actions; {} environments; {}\n",
        measured.algorithm,
        measured.env,
        shapes.observation,
        shapes.hidden,
        shapes.action,
        shapes.environments,
        measured.cpu_class,
    );
    text += &format!(
        "{iterations} iterations of {} steps after one to warm up",
        shapes.rollout
    );
    // Only algorithms with a trust region solve by conjugate gradients.
    if let Some(products) = measured.cg_iterations {
        text += &format!(
            "; {:.1} conjugate-gradient products each",
            products as f64 / *iterations as f64
        );
    }
    for (case, count) in &measured.cases {
        text += &format!("; {count} {case}");
    }
    text += &format!(
        "\n\n{} steps/s, {} a second of CPU time: {:.0} % of the floor's speed, which is {}\n\n",
        thousands(measured.steps_per_s),
        thousands(measured.steps_per_cpu_s),
        100.0 * measured.floor_ratio,
        thousands(floor.steps_per_cpu_s),
    );

    let steps = *env_steps as f64;
    let mut phases = table(&["phase (wall clock)", "us/step", "%"]);
    for (name, seconds) in measured.phases.iter() {
        let share = 100.0 * seconds / measured.seconds;
        phases.add_row([
            Cell::new(name),
            number(1e6 * seconds / steps),
            number(share),
        ]);
    }
    text += &format!(
        "{phases}\n\n{}\n\nat {:.1} Gflop/s, the best product here: {}; and {:.2} billion tanh/s\n",
        floor_table(floor, steps),
        1e-9 * floor.rate.flops_per_s,
        floor.rate.product,
        1e-9 * floor.rate.tanhs_per_s,
    );
    text
}

/// The parts of the floor of so many `steps`; each part's time is that of its products, and tanh's
/// is that of all parts.
fn floor_table(floor: &Floor, steps: f64) -> Table {
    let mut rows = table(&["floor (CPU time)", "us/step", "Mflop/step", "tanh/step"]);
    let microseconds = |seconds: f64| number(1e6 * seconds / steps);
    rows.add_row([
        Cell::new("physics alone"),
        microseconds(floor.physics_seconds),
    ]);
    for ((name, operations), (_, tanhs)) in floor.operations.iter().zip(floor.tanhs.iter()) {
        rows.add_row([
            Cell::new(name),
            microseconds(operations / floor.rate.flops_per_s),
            number(1e-6 * operations / steps),
            number(tanhs / steps),
        ]);
    }
    rows.add_row([Cell::new("tanh"), microseconds(floor.tanh_seconds)]);
    rows
}

fn number(number: f64) -> Cell {
    Cell::new(format!("{number:.2}")).set_alignment(CellAlignment::Right)
}
