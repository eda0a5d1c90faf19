//! `mcpo-run status PATH...`.

use std::{collections::BTreeMap, process::ExitCode};

use comfy_table::Cell;

use super::{
    demo::counted,
    plan::{evaluated_otherwise, seconds_of, table, word},
    print,
    selected::Selected,
};
use crate::schedule::{
    cost::CostModel,
    progress::{clock, thousands},
    state::{Planned, RunState},
};

/// Shows how far the campaign is.
pub fn run(selected: &Selected) -> anyhow::Result<ExitCode> {
    let specs = selected.load()?;
    let planned = selected.planned(&specs)?;
    let states = planned.iter().map(Planned::state).collect::<Result<Vec<_>, _>>()?;
    print(&render(&planned, &states))?;
    if states.iter().all(|state| matches!(state, RunState::ToDo)) {
        print(&selected.elsewhere(&specs))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn render(planned: &[Planned], states: &[RunState]) -> String {
    let mut costs = CostModel::default();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (run, state) in planned.iter().zip(states) {
        *counts.entry(word(state)).or_default() += 1;
        if let RunState::Finished(manifest) | RunState::ToExtend { shorter: manifest, .. } = state {
            costs.learn(&run.spec, manifest);
        }
    }
    let mut lines = table(&["run", "state", ""]);
    // Work that is left, in expected seconds, and how many of those the running processes do in a second.
    let (mut left, mut rate, mut running) = (0.0, 0.0, 0);
    for (run, state) in planned.iter().zip(states) {
        let steps = run.spec.trained_steps();
        if !matches!(state, RunState::Finished(_) | RunState::Differs { .. }) {
            left += seconds_of(run, state, &costs);
        }
        let detail = match state {
            RunState::Finished(_) | RunState::ToDo => continue,
            RunState::Running(heartbeat) => {
                running += 1;
                let seconds = costs.seconds(&run.spec);
                rate += heartbeat
                    .as_ref()
                    .map_or(1.0, |heartbeat| heartbeat.steps_per_second * seconds / steps.max(1) as f64);
                heartbeat.as_ref().map_or_else(
                    || "no iteration yet".to_owned(),
                    |heartbeat| {
                        let mean = heartbeat.training_return;
                        let mean = mean.map_or_else(String::new, |mean| format!(", training return {mean:.1}"));
                        format!(
                            "{} of {} steps, {} steps/s{mean} (at {})",
                            thousands(heartbeat.env_steps as f64),
                            thousands(steps as f64),
                            thousands(heartbeat.steps_per_second),
                            heartbeat.written,
                        )
                    },
                )
            }
            RunState::Interrupted { env_steps } => {
                format!("{} of {} steps", thousands(*env_steps as f64), thousands(steps as f64))
            }
            RunState::ToExtend { env_steps: Some(env_steps), .. } => {
                format!("from {} to {} steps", thousands(*env_steps as f64), thousands(steps as f64))
            }
            RunState::ToExtend { shorter, env_steps: None } => {
                let recorded = thousands(shorter.env_steps as f64);
                format!(
                    "from its start to {} steps: the last state of its {recorded} was not kept",
                    thousands(steps as f64)
                )
            }
            RunState::Failed(manifest) => manifest.error().unwrap_or("it did not end").to_owned(),
            RunState::Differs { keys } => format!("in {}", keys.join(", ")),
            RunState::Unusable { reason } | RunState::Damaged { reason } => reason.clone(),
        };
        let name = format!("{}/{}", run.spec.experiment, run.spec.id);
        lines.add_row([Cell::new(name), Cell::new(word(state)), Cell::new(detail)]);
    }
    let counts: Vec<String> = counts.into_iter().map(|(word, count)| format!("{count} {word}")).collect();
    let time = match running {
        _ if left == 0.0 => String::new(),
        0 => format!("; nothing runs now; about {} of work left", clock(left)),
        _ if rate == 0.0 => "; time left not yet known".to_owned(),
        n => format!("; about {} left at {n} at a time", clock(left / rate)),
    };
    let otherwise = evaluated_otherwise(planned, states);
    let whole = format!("{}: {}{time}{otherwise}\n", counted(planned.len(), "run"), counts.join(", "));
    if lines.row_count() == 0 { whole } else { format!("{lines}\n{whole}") }
}
