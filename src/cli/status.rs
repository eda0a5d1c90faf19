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
    let states = planned
        .iter()
        .map(Planned::state)
        .collect::<Result<Vec<_>, _>>()?;
    // The files are authoritative: without an answer from Slurm there is less to show, but all of
    // it is right.
    let cluster = match in_cluster(&specs, &chosen.results, &planned, &states) {
        Ok(cluster) => cluster,
        Err(error) => {
            complain(
                &anyhow::Error::from(error)
                    .context("what follows is from the files of the runs alone"),
            );
            HashMap::new()
        }
    };
    let survey = Survey::new(&planned, &states, &cluster);
    print(&survey.render(&evaluated_otherwise(&planned, &states)))?;
    if states.iter().all(|state| matches!(state, RunState::ToDo)) && cluster.is_empty() {
        print(&chosen.elsewhere(&specs))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The places in a cluster of the runs that have not finished, by experiment and id.
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
        let open: Vec<&Planned> = planned
            .iter()
            .zip(states)
            .filter(is_open)
            .map(|(run, _)| run)
            .collect();
        let places = places(results, name, &open)?;
        cluster.extend(
            places
                .into_iter()
                .map(|(id, place)| ((name.clone(), id), place)),
        );
    }
    Ok(cluster)
}

/// The cluster's additions to what the files say about an unfinished run: another word for its
/// state, and more detail.
fn placed(state: &RunState, place: &Place) -> (Option<&'static str>, String) {
    match (state, place.fate()) {
        (RunState::Running(_), _) | (_, Fate::Unsent) => (None, String::new()),
        (_, Fate::Waits(reason)) => (Some("queued"), format!("waits in Slurm: {reason}")),
        (_, Fate::Runs(nodes)) => (
            Some("queued"),
            format!("its element is under way on {nodes}"),
        ),
        // The run's own files say more than Slurm does.
        (RunState::Failed(_), _) => (None, String::new()),
        (_, Fate::Cancelled) => (Some("cancelled"), String::new()),
        (RunState::ToDo, Fate::Ended(how)) => {
            (Some("failed"), format!("{how}, and it left no result"))
        }
        (_, Fate::Ended(how)) => (None, how),
        (RunState::ToDo, Fate::Lost(job)) => (
            Some("lost"),
            format!("Slurm knows no job {job}, and it left no result"),
        ),
        (_, Fate::Lost(_)) => (None, String::new()),
    }
}

/// The progress of a campaign.
struct Survey {
    /// A line for each run that is neither finished nor simply still to do.
    lines: Vec<Line>,
    /// The number of runs in each state.
    counts: BTreeMap<&'static str, usize>,
    /// The number of runs that a process works on now.
    running: usize,
    /// The work that is left, in expected seconds of one process.
    left: f64,
    /// The speed of the running processes: expected seconds of work per second.
    rate: f64,
}

/// The line of one run.
struct Line {
    name: String,
    state: &'static str,
    detail: String,
}

impl Survey {
    /// Surveys the `planned` runs, which are in these `states`. `cluster` knows more about some of
    /// the unfinished ones.
    fn new(
        planned: &[Planned],
        states: &[RunState],
        cluster: &HashMap<(String, String), Place>,
    ) -> Self {
        let costs = CostModel::of(planned, states);
        let mut survey = Self {
            lines: Vec::new(),
            counts: BTreeMap::new(),
            running: 0,
            left: 0.0,
            rate: 0.0,
        };
        for (run, state) in planned.iter().zip(states) {
            let place = cluster.get(&(run.spec.experiment.clone(), run.spec.id.clone()));
            let (other_word, more) =
                place.map_or((None, String::new()), |place| placed(state, place));
            let word = other_word.unwrap_or(word(state));
            *survey.counts.entry(word).or_default() += 1;
            // A run recorded under another specification is refused, so it is no work.
            if !matches!(state, RunState::Finished(_) | RunState::Differs { .. }) {
                survey.left += seconds_of(run, state, &costs);
            }
            if let RunState::Running(heartbeat) = state {
                survey.running += 1;
                let (seconds, steps) = (
                    costs.seconds(&run.spec),
                    run.spec.trained_steps().max(1) as f64,
                );
                // Before its first iteration, a run is assumed to be as fast as expected.
                let rate = heartbeat
                    .as_ref()
                    .map(|heartbeat| heartbeat.steps_per_second * seconds / steps);
                survey.rate += rate.unwrap_or(1.0);
            }
            // A run that is to do and is not in the cluster is only counted.
            let is_told = !matches!(state, RunState::ToDo) || other_word.is_some();
            if let Some(detail) = detail(run, state).filter(|_| is_told) {
                let parts = [detail, more].into_iter().filter(|text| !text.is_empty());
                let name = format!("{}/{}", run.spec.experiment, run.spec.id);
                survey.lines.push(Line {
                    name,
                    state: word,
                    detail: parts.collect::<Vec<_>>().join("; "),
                });
            }
        }
        survey
    }

    /// The lines as a table, then the number of runs in each state and the time left. `otherwise`
    /// ends the last line.
    fn render(&self, otherwise: &str) -> String {
        let mut lines = table(&["run", "state", ""]);
        for Line {
            name,
            state,
            detail,
        } in &self.lines
        {
            lines.add_row([name.as_str(), state, detail].map(Cell::new));
        }
        let counts: Vec<String> = self
            .counts
            .iter()
            .map(|(word, count)| format!("{count} {word}"))
            .collect();
        let time = match self.running {
            _ if self.left == 0.0 => String::new(),
            0 => format!(
                "; nothing is running now; about {} of work left",
                clock(self.left)
            ),
            _ if self.rate == 0.0 => "; time left not yet known".to_owned(),
            n => format!(
                "; about {} left at {n} at a time",
                clock(self.left / self.rate)
            ),
        };
        let runs = counted(self.counts.values().sum(), "run");
        let whole = format!("{runs}: {}{time}{otherwise}\n", counts.join(", "));
        if self.lines.is_empty() {
            whole
        } else {
            format!("{lines}\n{whole}")
        }
    }
}

/// The details of a run in `state`, from its files; `None` for one that has finished.
fn detail(run: &Planned, state: &RunState) -> Option<String> {
    let steps = thousands(run.spec.trained_steps() as f64);
    Some(match state {
        RunState::Finished(_) => return None,
        RunState::ToDo => String::new(),
        RunState::Running(None) => "no iteration yet".to_owned(),
        RunState::Running(Some(heartbeat)) => {
            let mean = heartbeat.training_return;
            let mean = mean.map_or_else(String::new, |mean| format!(", training return {mean:.1}"));
            format!(
                "{} of {steps} steps, {} steps/s{mean}{} (at {})",
                thousands(heartbeat.env_steps as f64),
                thousands(heartbeat.steps_per_second),
                worked_on(run),
                heartbeat.written,
            )
        }
        RunState::Interrupted { env_steps } => {
            format!("{} of {steps} steps", thousands(*env_steps as f64))
        }
        RunState::ToExtend {
            env_steps: Some(env_steps),
            ..
        } => {
            format!("from {} to {steps} steps", thousands(*env_steps as f64))
        }
        RunState::ToExtend {
            shorter,
            env_steps: None,
        } => {
            let recorded = thousands(shorter.env_steps as f64);
            format!(
                "from its start to {steps} steps: the last state of its {recorded} was not kept"
            )
        }
        RunState::Failed(manifest) => manifest.error().unwrap_or("it did not finish").to_owned(),
        RunState::Differs { keys } => format!("in {}", keys.join(", ")),
        RunState::Unusable { reason } | RunState::Damaged { reason } => reason.clone(),
    })
}

/// The machine that works on a run, where that is recorded.
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
        assert!(
            detail.contains("COMPLETED (exit code 0, on n1") && detail.contains("no result"),
            "{detail}"
        );
        let interrupted = RunState::Interrupted { env_steps: 7 };
        let (word, detail) = placed(&interrupted, &place(Some("TIMEOUT"), false));
        assert_eq!((word, detail.contains("TIMEOUT")), (None, true));
    }

    #[test]
    fn the_files_word_goes_before_slurms() {
        for state in [Some("COMPLETED"), Some("PENDING"), None] {
            assert_eq!(
                placed(&RunState::Running(None), &place(state, false)),
                (None, String::new()),
                "{state:?}"
            );
        }
    }

    #[test]
    fn what_waits_is_queued_and_what_slurm_forgot_is_lost_unless_it_was_cancelled() {
        assert_eq!(
            placed(&RunState::ToDo, &place(Some("PENDING"), false)).0,
            Some("queued")
        );
        assert_eq!(placed(&RunState::ToDo, &place(None, false)).0, Some("lost"));
        assert_eq!(
            placed(&RunState::ToDo, &place(None, true)).0,
            Some("cancelled")
        );
    }
}
