//! `mcpo-run report PATH...`.

use std::{path::Path, process::ExitCode};

use crate::spec::ExperimentSpec;

/// Writes the figures and tables of `experiments` from what is recorded under `results`, and names them on stdout.
pub fn run(experiments: &[ExperimentSpec], results: &Path) -> anyhow::Result<ExitCode> {
    let _ = (experiments, results);
    todo!()
}
