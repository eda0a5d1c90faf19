//! `mcpo-run report PATH...`.

use std::{path::Path, process::ExitCode};

use super::print;
use crate::{
    report::{self, Row, TableData, Verdict},
    spec::ExperimentSpec,
};

/// The exit code when a table's value is above or below the paper's.
const VERDICT_FAILED: u8 = 3;

/// Writes the figures and tables of `experiments` from what is recorded under `results`; shows each one's first table on
/// stdout, and names what contradicts the paper in any of them, and the files.
///
/// Exits with 3 when a value that can be compared with the paper's is not consistent with it.
pub fn run(experiments: &[ExperimentSpec], results: &Path) -> anyhow::Result<ExitCode> {
    let mut consistent = true;
    for experiment in experiments {
        let name = &experiment.name;
        let written = report::write(experiment, results)?;
        let table = written.tables.first().map_or_else(String::new, |table| format!("\n{}", report::terminal(table)));
        let files: String = written.files.iter().map(|file| format!("{}\n", file.display())).collect();
        let contradictions: String = written.tables.iter().map(contradictions).collect();
        print(&format!("{name}: {}\n{table}\n{contradictions}{files}", written.state))?;
        consistent &= contradictions.is_empty();
    }
    Ok(if consistent { ExitCode::SUCCESS } else { ExitCode::from(VERDICT_FAILED) })
}

/// The values of `table` that can be compared with the paper's and are not consistent with it, a line each.
fn contradictions(table: &TableData) -> String {
    let cells = table.rows.iter().flat_map(|row| {
        let named = table.columns.iter().zip(&row.cells);
        named.filter_map(move |(column, cell)| Some((row, column, cell.as_ref()?.verdict.as_ref()?)))
    });
    let contradicting = cells.filter(|(.., verdict)| matches!(verdict, Verdict::Above | Verdict::Below));
    let line = |(row, column, verdict): (&Row, &String, &Verdict)| {
        format!("{}, {column}: {} the paper's value ({})\n", row.labels.join(", "), verdict.text(), table.title)
    };
    contradicting.map(line).collect()
}
