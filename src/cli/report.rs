//! `mcpo-run report PATH...`.

use std::{path::Path, process::ExitCode};

use anyhow::bail;
use comfy_table::Table;

use super::{print, selected::Selected};
use crate::{
    report::{self, Label, ReportError, Row, Scope, TableData, Verdict},
    spec::ExperimentSpec,
};

/// The exit code when a table's value is above or below the paper's.
const VERDICT_FAILED: u8 = 3;

/// Reports what `selected` says.
pub fn run(selected: &Selected) -> anyhow::Result<ExitCode> {
    let Selected { only, axis, set, results, .. } = selected;
    let scope = Scope { only: only.clone(), axis: axis.clone(), set: set.clone() };
    write(&selected.load()?, results, &scope, false)
}

/// Writes the figures and tables of `experiments`, as far as `scope` goes, from what is recorded under `results`; shows each
/// one's first table on stdout, and names what contradicts the paper in any of them, and the files; `quiet`, only what
/// contradicts. An experiment of which
/// there is nothing to report is named; that is an error where it is so of all.
///
/// Exits with 3 when a value that can be compared with the paper's is not consistent with it.
pub fn write(experiments: &[ExperimentSpec], results: &Path, scope: &Scope, quiet: bool) -> anyhow::Result<ExitCode> {
    let (mut consistent, mut without) = (true, Vec::new());
    for experiment in experiments {
        let name = &experiment.name;
        let written = match report::write(experiment, results, scope) {
            Err(error @ (ReportError::NothingRecorded { .. } | ReportError::NoneMatch { .. })) => {
                without.push(error.to_string());
                continue;
            }
            written => written?,
        };
        let table = written.tables.first();
        let table = table.map_or_else(String::new, |table| format!("\n{}", report::terminal(table, terminal_width())));
        let files: String = written.files.iter().map(|file| format!("{}\n", file.display())).collect();
        let contradictions: String = written.tables.iter().map(contradictions).collect();
        print(&match quiet {
            true => contradictions.clone(),
            false => format!("{name}: {}\n{table}\n{contradictions}{files}", written.state),
        })?;
        consistent &= contradictions.is_empty();
    }
    if without.len() == experiments.len() {
        bail!("{}", without.join("\n"));
    }
    without.iter().try_for_each(|line| print(&format!("{line}\n")))?;
    Ok(if consistent { ExitCode::SUCCESS } else { ExitCode::from(VERDICT_FAILED) })
}

/// How wide the terminal is; `COLUMNS` says it where stdout is none.
fn terminal_width() -> Option<usize> {
    let said = || std::env::var("COLUMNS").ok()?.parse().ok();
    Table::new().width().map(usize::from).or_else(said)
}

/// The values of `table` that can be compared with the paper's and are not consistent with it, a line each.
fn contradictions(table: &TableData) -> String {
    let cells = table.rows.iter().flat_map(|row| {
        let named = table.columns.iter().zip(&row.cells);
        named.filter_map(move |(column, cell)| Some((row, column, cell.as_ref()?.verdict.as_ref()?)))
    });
    let contradicting = cells.filter(|(.., verdict)| matches!(verdict, Verdict::Above | Verdict::Below));
    let line = |(row, column, verdict): (&Row, &Label, &Verdict)| {
        let (labels, column) = (row.labels.join(", "), &column.text);
        format!("{labels}, {column}: {} the paper's value ({})\n", verdict.text(), table.title)
    };
    contradicting.map(line).collect()
}
