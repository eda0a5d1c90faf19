//! Runs that are computed once more, to be compared with their records.

use std::path::Path;

use anyhow::Context;

use crate::{
    record::{Manifest, Stamp},
    schedule::{
        campaign::{Options, Summary},
        local::{self, physical_cores},
        preflight,
        progress::Style,
        state::{Planned, unfinished},
        stop::StopRequest,
    },
};

/// The exit code where a result differs from its record.
pub const NOT_REPRODUCED: u8 = 4;
/// The error where no process can be started.
pub const NO_PROGRAM: &str = "cannot find this program's own file";

/// Computes those of the `planned` runs that `results` does not hold.
///
/// # Errors
///
/// The runs cannot be started.
pub fn compute(
    planned: &[Planned],
    results: &Path,
    jobs: Option<u16>,
    quiet: bool,
) -> anyhow::Result<Summary> {
    let stop = StopRequest::on_signals().context("cannot listen for signals")?;
    let states = preflight::prepare(planned, results, false)?;
    let due: Vec<Planned> = unfinished(planned, &states)
        // The user and the machine are left out: they are not compared, and the record may be
        // published.
        .map(|(run, _)| Planned {
            stamp: run.stamp.without_origin(),
            ..run.clone()
        })
        .collect();
    let options = Options::new(jobs.map_or_else(physical_cores, usize::from));
    local::run_unknown(&due, results, options, Style::choose(quiet), &stop).context(NO_PROGRAM)
}

/// The reason why this program on this machine need not reproduce the bits of a record, as part of
/// a sentence.
pub enum Inexact {
    /// Another class of machine computed it, or more than one.
    Machine(String),
    /// Other versions of the program or of MuJoCo computed it.
    Versions(String),
}

/// The reason why the `recorded` run need not be reproduced bit by bit `now`; `None` where it must
/// be.
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
