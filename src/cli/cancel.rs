//! `mcpo-run cancel PATH...`.

use std::process::ExitCode;

use super::{chosen::Chosen, demo::counted, print};
use crate::schedule::{
    slurm::{
        self,
        jobs::Asked,
        places::{elements, places},
    },
    state::{Planned, RunState},
};

/// Cancels those of the chosen runs that the cluster has. Runs under way write a checkpoint, and
/// all can be submitted again.
pub fn run(chosen: &Chosen) -> anyhow::Result<ExitCode> {
    let specs = chosen.load()?;
    let planned = chosen.planned(&specs)?;
    for spec in &specs {
        let mut open = Vec::new();
        for run in planned
            .iter()
            .filter(|run: &&Planned| run.spec.experiment == spec.name)
        {
            if !matches!(run.state()?, RunState::Finished(_)) {
                open.push(run);
            }
        }
        let places = places(&chosen.results, &spec.name, &open)?;
        let taken = || places.values().filter(|place| place.is_taken());
        let runs = taken().count();
        let mut count = 0;
        for (folder, (names, numbers)) in elements(taken()) {
            count += names.len();
            slurm::scancel(&names.into_iter().collect::<Vec<_>>())?;
            Asked::Cancel {
                elements: numbers.into_iter().collect(),
            }
            .add(&folder)?;
        }
        let name = &spec.name;
        print(&match count {
            0 => format!("{name}: the cluster has none of these runs\n"),
            _ => format!(
                "{name}: {} with {} cancelled\n",
                counted(count, "element"),
                counted(runs, "run")
            ),
        })?;
    }
    Ok(ExitCode::SUCCESS)
}
