//! `mcpo-run report PATH...`.

use std::{path::Path, process::ExitCode};

use super::print;
use crate::{
    report::{self, TableData, Verdict},
    spec::ExperimentSpec,
};

/// The exit code when a table's value is above or below the paper's.
const VERDICT_FAILED: u8 = 3;

/// Writes the figures and tables of `experiments` from what is recorded under `results`; shows each one's first table on
/// stdout, and names the files.
///
/// Exits with 3 when a value that can be compared with the paper's is not consistent with it.
pub fn run(experiments: &[ExperimentSpec], results: &Path) -> anyhow::Result<ExitCode> {
    let mut consistent = true;
    for experiment in experiments {
        let name = &experiment.name;
        let written = report::write(experiment, results)?;
        let table = written.tables.first().map_or_else(String::new, |table| format!("\n{}", report::terminal(table)));
        let files: String = written.files.iter().map(|file| format!("{}\n", file.display())).collect();
        print(&format!("{name}: {}\n{table}\n{files}", written.state))?;
        consistent &= !written.tables.iter().any(contradicts);
    }
    Ok(if consistent { ExitCode::SUCCESS } else { ExitCode::from(VERDICT_FAILED) })
}

/// Whether a value of `table` that can be compared with the paper's is not consistent with it.
fn contradicts(table: &TableData) -> bool {
    let cells = table.rows.iter().flat_map(|row| row.cells.iter().flatten());
    cells.filter_map(|cell| cell.verdict.as_ref()).any(|verdict| matches!(verdict, Verdict::Above | Verdict::Below))
}
