//! Runs that are computed once more, to be compared with what is recorded of them.

use std::{path::Path, time::Duration};

use anyhow::Context;

use crate::{
    record::{Manifest, Stamp},
    schedule::{
        campaign::{Options, Summary},
        cost::CostModel,
        local::{self, physical_cores},
        preflight,
        progress::{Progress, Style},
        state::{Planned, RunState},
        stop::StopRequest,
    },
};

/// The exit code of what is not as it is recorded.
pub const NOT_REPRODUCED: u8 = 4;
/// A run that makes no progress for so long is killed.
const HANG_TIMEOUT: Duration = Duration::from_secs(600);

/// Computes those of `planned` that `results` does not hold.
///
/// # Errors
///
/// Whatever stands in the way of starting.
pub fn compute(
    planned: &[Planned],
    results: &Path,
    jobs: Option<u16>,
    quiet: bool,
) -> anyhow::Result<Summary> {
    let stop = StopRequest::on_signals().context("cannot listen for signals")?;
    let states = preflight::prepare(planned, results, false)?;
    let pairs = planned.iter().zip(&states);
    let due: Vec<Planned> = pairs
        .filter(|(_, state)| !matches!(state, RunState::Finished(_)))
        // Who computes it, and where, is not what is compared; a record of it may be published.
        .map(|(run, _)| Planned {
            stamp: run.stamp.without_origin(),
            ..run.clone()
        })
        .collect();
    let jobs = jobs.map_or_else(physical_cores, usize::from);
    let options = Options {
        jobs,
        threads: None,
        retries: 0,
        fail_fast: false,
        hang_timeout: HANG_TIMEOUT,
        verbose: false,
    };
    let costs = CostModel::default();
    let seconds = due.iter().map(|run| costs.seconds(&run.spec)).sum();
    let mut progress = Progress::new(Style::choose(quiet), false, due.len(), seconds);
    local::run(&due, results, options, &costs, &stop, &mut progress)
        .context("cannot find this program's own file")
}

/// Why this program on this machine is not held to the bits of a record, as part of a sentence.
pub enum Inexact {
    /// Another class of machine computed it, or more than one.
    Machine(String),
    /// Other versions of the program or of MuJoCo computed it.
    Versions(String),
}

/// Why the run that `recorded` tells of cannot be held to its bits `now`; `None` where it can.
pub fn inexact(recorded: &Manifest, now: &Stamp) -> Option<Inexact> {
    let (before, after) = (&recorded.stamp.build, &now.build);
    if !recorded.is_of_one_class() {
        return Some(Inexact::Machine(
            "the record was made on more than one class of machine".to_owned(),
        ));
    }
    if before.machine() != after.machine() {
        let (class, libm) = before.machine();
        return Some(Inexact::Machine(format!(
            "the record was made on {class}, libm {libm}"
        )));
    }
    (before.versions != after.versions).then(|| {
        Inexact::Versions(format!(
            "the record was made by different versions: {}",
            before.versions
        ))
    })
}
