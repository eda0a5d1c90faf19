//! `mcpo-run plan PATH...`.

use std::process::ExitCode;

use comfy_table::{Cell, CellAlignment, Table, presets};

use super::{print, selected::Selected};
use crate::{
    schedule::{
        cost::CostModel,
        progress::{clock, thousands},
        state::{Planned, RunState},
    },
    spec::ExperimentSpec,
};

/// What to show of a plan.
#[derive(Debug, clap::Args)]
pub struct PlanArguments {
    #[command(flatten)]
    selected: Selected,
    /// Say for each run why it will or will not be run
    #[arg(long)]
    explain: bool,
}

/// Shows every run.
pub fn run(arguments: &PlanArguments) -> anyhow::Result<ExitCode> {
    let specs = arguments.selected.load()?;
    show(&specs, &arguments.selected.planned(&specs)?, arguments.explain)
}

/// Shows the runs of a plan with their states and costs, and how many its files name twice.
pub fn show(specs: &[ExperimentSpec], planned: &[Planned], explain: bool) -> anyhow::Result<ExitCode> {
    let states = planned.iter().map(Planned::state).collect::<Result<Vec<_>, _>>()?;
    let mut costs = CostModel::default();
    for (run, state) in planned.iter().zip(&states) {
        if let RunState::Finished(manifest) = state {
            costs.learn(&run.spec, manifest);
        }
    }
    let mut table = table(&["run", "state", "steps", "time"]);
    let mut seconds_left = 0.0;
    for (run, state) in planned.iter().zip(&states) {
        let (done, seconds) = (done(state), costs.seconds(&run.spec));
        let budget = run.spec.budget.env_steps.get();
        let time = match state {
            RunState::Finished(manifest) => clock(manifest.seconds),
            RunState::Differs { .. } => String::new(),
            _ => {
                let left = seconds * (1.0 - done as f64 / budget as f64).clamp(0.0, 1.0);
                seconds_left += left;
                format!("about {}", clock(left))
            }
        };
        let word = if explain { reason(state) } else { word(state).to_owned() };
        table.add_row([
            Cell::new(format!("{}/{}", run.spec.experiment, run.spec.id)),
            Cell::new(word),
            Cell::new(thousands(budget as f64)).set_alignment(CellAlignment::Right),
            Cell::new(time).set_alignment(CellAlignment::Right),
        ]);
    }
    let finished = states.iter().filter(|state| matches!(state, RunState::Finished(_))).count();
    let differing = states.iter().filter(|state| matches!(state, RunState::Differs { .. })).count();
    let left = planned.len() - finished - differing;
    let differing =
        if differing > 0 { format!(", {differing} recorded by another specification") } else { String::new() };
    let mut repeated = 0;
    for spec in specs {
        repeated += spec.named_runs() - crate::plan::plan(spec)?.len();
    }
    let repeated = match repeated {
        0 => String::new(),
        n => format!("; the blocks name {n} of their runs again, which are run once"),
    };
    print(&format!(
        "{table}\n{} runs, {finished} finished{differing}, {left} to do: about {} in one process{repeated}\n",
        planned.len(),
        clock(seconds_left)
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// A table as all commands draw them.
pub(super) fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    table
}

/// The steps that are recorded.
fn done(state: &RunState) -> u64 {
    match state {
        RunState::Interrupted { env_steps } => *env_steps,
        RunState::Running(heartbeat) => heartbeat.as_ref().map_or(0, |heartbeat| heartbeat.env_steps),
        RunState::Finished(manifest) => manifest.env_steps,
        RunState::ToDo | RunState::Failed(_) | RunState::Differs { .. } | RunState::Unusable { .. } => 0,
    }
}

/// A state in a word.
pub(super) fn word(state: &RunState) -> &'static str {
    match state {
        RunState::ToDo => "to do",
        RunState::Interrupted { .. } => "interrupted",
        RunState::Running(_) => "running",
        RunState::Finished(_) => "finished",
        RunState::Failed(_) => "failed",
        RunState::Differs { .. } => "differs",
        RunState::Unusable { .. } => "unusable",
    }
}

/// Why the run will or will not be run.
fn reason(state: &RunState) -> String {
    match state {
        RunState::ToDo => "will run: nothing is recorded".to_owned(),
        RunState::Interrupted { env_steps } => {
            format!("will run: goes on from the checkpoint after {} steps", thousands(*env_steps as f64))
        }
        RunState::Running(_) => "will not run here: another process works on it".to_owned(),
        RunState::Finished(manifest) => {
            format!("will not run: recorded with the same fingerprint {}", manifest.stamp.fingerprint)
        }
        RunState::Failed(manifest) => {
            format!("will run again: failed: {}", manifest.error().unwrap_or("it did not end"))
        }
        RunState::Differs { keys } => {
            format!("refused: what is recorded differs in {}; --fresh sets it aside", keys.join(", "))
        }
        RunState::Unusable { reason } => format!("refused: {reason}; --fresh sets it aside"),
    }
}
