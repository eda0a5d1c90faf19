//! `mcpo-run plan PATH...`.

use std::process::ExitCode;

use comfy_table::{Cell, CellAlignment, Table, presets};

use super::{chosen::Chosen, demo::counted, print};
use crate::{
    schedule::{
        cost::CostModel,
        progress::{clock, thousands},
        state::{Planned, RunState},
    },
    spec::ExperimentSpec,
};

/// The arguments of `plan`.
#[derive(Debug, clap::Args)]
pub struct PlanArguments {
    #[command(flatten)]
    chosen: Chosen,
    /// Say for each run why it will or will not be run
    #[arg(long)]
    explain: bool,
}

/// Shows every run.
pub fn run(arguments: &PlanArguments) -> anyhow::Result<ExitCode> {
    let specs = arguments.chosen.load()?;
    show(
        &specs,
        &arguments.chosen.planned(&specs)?,
        arguments.explain,
    )
}

/// Shows the runs of a plan with their states and costs, and the number of runs that its files name
/// twice.
pub fn show(
    specs: &[ExperimentSpec],
    planned: &[Planned],
    explain: bool,
) -> anyhow::Result<ExitCode> {
    let states = planned
        .iter()
        .map(Planned::state)
        .collect::<Result<Vec<_>, _>>()?;
    // Finished runs tell how long the others will take.
    let costs = CostModel::of(planned, &states);
    let mut table = table(&["run", "state", "steps", "time"]);
    let mut seconds_left = 0.0;
    for (run, state) in planned.iter().zip(&states) {
        let time = match state {
            RunState::Finished(manifest) => clock(manifest.seconds),
            // It is refused, so it takes no time.
            RunState::Differs { .. } => String::new(),
            _ => {
                let left = seconds_of(run, state, &costs);
                seconds_left += left;
                format!("about {}", clock(left))
            }
        };
        let word = if explain {
            reason(run, state)
        } else {
            word(state).to_owned()
        };
        table.add_row([
            Cell::new(format!("{}/{}", run.spec.experiment, run.spec.id)),
            Cell::new(word),
            Cell::new(thousands(run.spec.trained_steps() as f64))
                .set_alignment(CellAlignment::Right),
            Cell::new(time).set_alignment(CellAlignment::Right),
        ]);
    }
    let finished = states
        .iter()
        .filter(|state| matches!(state, RunState::Finished(_)))
        .count();
    let differing = states
        .iter()
        .filter(|state| matches!(state, RunState::Differs { .. }))
        .count();
    let left = planned.len() - finished - differing;
    let differing = if differing > 0 {
        format!(", {differing} recorded by another specification")
    } else {
        String::new()
    };
    let mut repeated = 0;
    // Only several blocks can name a run twice: the lists of one have no repeats.
    for spec in specs.iter().filter(|spec| spec.matrix.len() > 1) {
        repeated += spec.named_runs() - crate::plan::plan(spec)?.len();
    }
    let repeated = match repeated {
        0 => String::new(),
        n => format!("; the blocks name {n} of their runs again, which are run once"),
    };
    print(&format!(
        "{table}\n{}, {finished} finished{differing}, {left} to do: about {} in one \
         process{repeated}{}\n{}",
        counted(planned.len(), "run"),
        clock(seconds_left),
        evaluated_otherwise(planned, &states),
        whole_rollouts(planned),
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// A note on runs that train noticeably more steps than their budget, since they take whole
/// rollouts.
fn whole_rollouts(planned: &[Planned]) -> String {
    let longer = planned
        .iter()
        .map(|run| &run.spec)
        .filter(|spec| spec.trains_noticeably_longer());
    let Some(first) = longer.clone().next() else {
        return String::new();
    };
    let (trained, budget) = (
        thousands(first.trained_steps() as f64),
        thousands(first.budget.env_steps.get() as f64),
    );
    let (runs, take) = (
        counted(longer.count(), "run"),
        thousands(first.rollout.steps.get() as f64),
    );
    format!(
        "{runs} will train longer than the budget, since rollouts are whole: {trained} steps for \
         {budget} with rollouts of {take}\n"
    )
}

/// An empty table in the style of all commands.
pub(super) fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    table
}

/// The expected seconds of the steps that a run in `state` has before it.
pub(super) fn seconds_of(run: &Planned, state: &RunState, costs: &CostModel) -> f64 {
    let seconds = costs.seconds(&run.spec);
    match run.spec.trained_steps() {
        0 => seconds,
        steps => seconds * (1.0 - state.steps_done() as f64 / steps as f64).clamp(0.0, 1.0),
    }
}

/// The end of a sentence: the number of finished runs that were evaluated in another way than is
/// asked for now.
pub(super) fn evaluated_otherwise(planned: &[Planned], states: &[RunState]) -> String {
    let otherwise = planned.iter().zip(states).filter(|(run, state)| {
        matches!(
            state,
            RunState::Finished(manifest)
                if !run.evaluated_otherwise(&manifest.stamp).is_empty()
        )
    });
    match otherwise.count() {
        0 => String::new(),
        n => format!(
            "; {n} finished with other evaluation settings, and kept (plan --explain names them)"
        ),
    }
}

/// The word for a state.
pub(super) fn word(state: &RunState) -> &'static str {
    match state {
        RunState::ToDo => "to do",
        RunState::Interrupted { .. } => "interrupted",
        RunState::Running(_) => "running",
        RunState::Finished(_) => "finished",
        RunState::ToExtend { .. } => "to extend",
        RunState::Failed(_) => "failed",
        RunState::Differs { .. } => "differs",
        RunState::Damaged { .. } => "damaged",
        RunState::Unusable { .. } => "unusable",
    }
}

/// The reason why the run will or will not be started.
fn reason(run: &Planned, state: &RunState) -> String {
    let steps = |steps: u64| thousands(steps as f64);
    match state {
        RunState::ToDo => "will run: nothing is recorded".to_owned(),
        RunState::Interrupted { env_steps } => {
            format!(
                "will run: resumes from the checkpoint at {} steps",
                steps(*env_steps)
            )
        }
        RunState::Running(_) => "will not run here: another process is working on it".to_owned(),
        RunState::ToExtend {
            shorter,
            env_steps: Some(env_steps),
        } => {
            let recorded = steps(shorter.env_steps);
            format!(
                "will run: recorded with {recorded} steps, and resumes from its state at {}",
                steps(*env_steps)
            )
        }
        RunState::ToExtend {
            shorter,
            env_steps: None,
        } => {
            let recorded = steps(shorter.env_steps);
            format!(
                "will run from its start: recorded with {recorded} steps, whose last state was not \
                 kept"
            )
        }
        RunState::Finished(manifest) => {
            // Evaluations do not make it another run, so what differs in them is told, not refused.
            let otherwise = match run.evaluated_otherwise(&manifest.stamp) {
                keys if keys.is_empty() => String::new(),
                keys => format!(", but its evaluations differ in {}", keys.join(", ")),
            };
            // It is finished all the same; only its bits cannot be repeated.
            let classes = if manifest.is_of_one_class() {
                ""
            } else {
                "; computed on more than one class of machine"
            };
            let fingerprint = &manifest.stamp.fingerprint;
            format!(
                "will not run: recorded with the same fingerprint {fingerprint}{otherwise}{classes}"
            )
        }
        RunState::Failed(manifest) => {
            format!(
                "will run again: failed: {}",
                manifest.error().unwrap_or("it did not finish")
            )
        }
        RunState::Differs { keys } => {
            format!(
                "refused: what is recorded differs in {}; --fresh sets it aside",
                keys.join(", ")
            )
        }
        RunState::Unusable { reason } | RunState::Damaged { reason } => {
            format!("refused: {reason}; --fresh sets it aside")
        }
    }
}
