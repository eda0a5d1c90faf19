//! `mcpo-run status PATH...`.

use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
    process::ExitCode,
};

use comfy_table::Cell;

use super::{
    chosen::Chosen,
    complain,
    demo::counted,
    plan::{evaluated_otherwise, seconds_of, table, word},
    print,
};
use crate::{
    record::Claim,
    schedule::{
        cost::CostModel,
        progress::{clock, thousands},
        slurm::places::{Fate, Place, PlacesError, places},
        state::{Planned, RunState},
    },
    spec::ExperimentSpec,
};

/// Shows how far the campaign is.
pub fn run(chosen: &Chosen) -> anyhow::Result<ExitCode> {
    let specs = chosen.load()?;
    let planned = chosen.planned(&specs)?;
    let states = planned.iter().map(Planned::state).collect::<Result<Vec<_>, _>>()?;
    // The files are the truth: without Slurm's word there is less to say, and no less to believe.
    let cluster = match in_cluster(&specs, &chosen.results, &planned, &states) {
        Ok(cluster) => cluster,
        Err(error) => {
            complain(&anyhow::Error::from(error).context("what follows is from the files of the runs alone"));
            HashMap::new()
        }
    };
    print(&render(&planned, &states, &cluster))?;
    if states.iter().all(|state| matches!(state, RunState::ToDo)) && cluster.is_empty() {
        print(&chosen.elsewhere(&specs))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Where in a cluster the runs are that have not finished, by experiment and id.
fn in_cluster(
    specs: &[ExperimentSpec],
    results: &Path,
    planned: &[Planned],
    states: &[RunState],
) -> Result<HashMap<(String, String), Place>, PlacesError> {
    let mut cluster = HashMap::new();
    for ExperimentSpec { name, .. } in specs {
        let is_open = |(run, state): &(&Planned, &RunState)| {
            run.spec.experiment == *name && !matches!(state, RunState::Finished(_))
        };
        let open: Vec<&Planned> = planned.iter().zip(states).filter(is_open).map(|(run, _)| run).collect();
        let places = places(results, name, &open)?;
        cluster.extend(places.into_iter().map(|(id, place)| ((name.clone(), id), place)));
    }
    Ok(cluster)
}

/// What the cluster adds to what the files say of a run that has not finished: another word for its state, and more to tell.
fn placed(state: &RunState, place: &Place) -> (Option<&'static str>, String) {
    match (state, place.fate()) {
        (RunState::Running(_), _) | (_, Fate::Unsent) => (None, String::new()),
        (_, Fate::Waits(reason)) => (Some("queued"), format!("waits in Slurm: {reason}")),
        (_, Fate::Runs(nodes)) => (Some("queued"), format!("its element is under way on {nodes}")),
        // Their own files say more than Slurm does.
        (RunState::Failed(_), _) => (None, String::new()),
        (_, Fate::Cancelled) => (Some("cancelled"), String::new()),
        (RunState::ToDo, Fate::Ended(how)) => (Some("failed"), format!("{how}, and it left no result")),
        (_, Fate::Ended(how)) => (None, how),
        (RunState::ToDo, Fate::Lost(job)) => (Some("lost"), format!("Slurm knows no job {job}, and it left no result")),
        (_, Fate::Lost(_)) => (None, String::new()),
    }
}

fn render(planned: &[Planned], states: &[RunState], cluster: &HashMap<(String, String), Place>) -> String {
    let mut costs = CostModel::default();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let placed: Vec<(Option<&'static str>, String)> = planned
        .iter()
        .zip(states)
        .map(|(run, state)| {
            let place = cluster.get(&(run.spec.experiment.clone(), run.spec.id.clone()));
            place.map_or((None, String::new()), |place| placed(state, place))
        })
        .collect();
    for ((run, state), (other_word, _)) in planned.iter().zip(states).zip(&placed) {
        *counts.entry(other_word.unwrap_or(word(state))).or_default() += 1;
        if let RunState::Finished(manifest) | RunState::ToExtend { shorter: manifest, .. } = state {
            costs.learn(&run.spec, manifest);
        }
    }
    let mut lines = table(&["run", "state", ""]);
    // Work that is left, in expected seconds, and how many of those the running processes do in a second.
    let (mut left, mut rate, mut running) = (0.0, 0.0, 0);
    for ((run, state), (other_word, more)) in planned.iter().zip(states).zip(&placed) {
        let steps = run.spec.trained_steps();
        if !matches!(state, RunState::Finished(_) | RunState::Differs { .. }) {
            left += seconds_of(run, state, &costs);
        }
        let detail = match state {
            RunState::Finished(_) => continue,
            RunState::ToDo if other_word.is_none() => continue,
            RunState::ToDo => String::new(),
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
                            "{} of {} steps, {} steps/s{mean}{} (at {})",
                            thousands(heartbeat.env_steps as f64),
                            thousands(steps as f64),
                            thousands(heartbeat.steps_per_second),
                            worked_on(run),
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
            RunState::Failed(manifest) => manifest.error().unwrap_or("it did not finish").to_owned(),
            RunState::Differs { keys } => format!("in {}", keys.join(", ")),
            RunState::Unusable { reason } | RunState::Damaged { reason } => reason.clone(),
        };
        let name = format!("{}/{}", run.spec.experiment, run.spec.id);
        let detail = [detail.as_str(), more].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join("; ");
        lines.add_row([Cell::new(name), Cell::new(other_word.unwrap_or(word(state))), Cell::new(detail)]);
    }
    let counts: Vec<String> = counts.into_iter().map(|(word, count)| format!("{count} {word}")).collect();
    let time = match running {
        _ if left == 0.0 => String::new(),
        0 => format!("; nothing is running now; about {} of work left", clock(left)),
        _ if rate == 0.0 => "; time left not yet known".to_owned(),
        n => format!("; about {} left at {n} at a time", clock(left / rate)),
    };
    let otherwise = evaluated_otherwise(planned, states);
    let whole = format!("{}: {}{time}{otherwise}\n", counted(planned.len(), "run"), counts.join(", "));
    if lines.row_count() == 0 { whole } else { format!("{lines}\n{whole}") }
}

/// On which machine a run is worked on, where that is told.
fn worked_on(run: &Planned) -> String {
    let owner = Claim::owner(&run.paths).ok().flatten();
    owner.map_or_else(String::new, |owner| format!(", on {}", owner.host))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::slurm::places::tests::place;

    #[test]
    fn what_slurm_calls_completed_and_left_no_result_has_failed_with_that_cause() {
        let (word, detail) = placed(&RunState::ToDo, &place(Some("COMPLETED"), false));
        assert_eq!(word, Some("failed"));
        assert!(detail.contains("COMPLETED (exit code 0, on n1") && detail.contains("no result"), "{detail}");
        let interrupted = RunState::Interrupted { env_steps: 7 };
        let (word, detail) = placed(&interrupted, &place(Some("TIMEOUT"), false));
        assert_eq!((word, detail.contains("TIMEOUT")), (None, true));
    }

    #[test]
    fn the_files_word_goes_before_slurms() {
        for state in [Some("COMPLETED"), Some("PENDING"), None] {
            assert_eq!(placed(&RunState::Running(None), &place(state, false)), (None, String::new()), "{state:?}");
        }
    }

    #[test]
    fn what_waits_is_queued_and_what_slurm_forgot_is_lost_unless_it_was_cancelled() {
        assert_eq!(placed(&RunState::ToDo, &place(Some("PENDING"), false)).0, Some("queued"));
        assert_eq!(placed(&RunState::ToDo, &place(None, false)).0, Some("lost"));
        assert_eq!(placed(&RunState::ToDo, &place(None, true)).0, Some("cancelled"));
    }
}
