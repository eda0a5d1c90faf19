//! `mcpo-run report PATH...`.

use std::{collections::BTreeSet, path::Path, process::ExitCode};

use anyhow::bail;
use comfy_table::Table;

use super::{print, selected::Selected};
use crate::{
    report::{
        self, ClaimRow, ClaimVerdict, Label, ReportError, Row, Scope, TableData, Verdict, claims_text, export::Format,
    },
    spec::ExperimentSpec,
};

/// The exit code of `--strict`.
const CONTRADICTED: u8 = 3;

/// What to report.
#[derive(Debug, clap::Args)]
pub struct ReportArguments {
    #[command(flatten)]
    selected: Selected,
    /// Exit with 3 where a value is better or worse than the paper's, or a claim of the file is contradicted
    #[arg(long)]
    strict: bool,
    /// Also write what other programs read, into the report's folder `export`
    #[arg(long, value_name = "FORMAT,...", value_delimiter = ',', value_enum)]
    export: Vec<Export>,
}

/// What other programs read.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Export {
    /// Event files with hyperparameters, for TensorBoard
    Tensorboard,
    /// Scores by method, seed and environment, as rliable reads them
    Rliable,
    /// Every evaluation, as marl-eval reads them
    MarlEval,
    /// Every evaluation episode as a row
    Csv,
    /// The numbers of each figure
    Json,
}

impl From<Export> for Format {
    fn from(export: Export) -> Self {
        match export {
            Export::Tensorboard => Self::Tensorboard,
            Export::Rliable => Self::Rliable,
            Export::MarlEval => Self::MarlEval,
            Export::Csv => Self::Csv,
            Export::Json => Self::Json,
        }
    }
}

/// Reports what `arguments` say.
pub fn run(arguments: &ReportArguments) -> anyhow::Result<ExitCode> {
    let Selected { only, axis, set, results, .. } = &arguments.selected;
    let scope = Scope { only: only.clone(), axis: axis.clone(), set: set.clone() };
    let experiments = arguments.selected.load()?;
    let is_contradicted = write(&experiments, results, &scope, false)?;
    let formats: BTreeSet<Format> = arguments.export.iter().copied().map(Format::from).collect();
    if !formats.is_empty() {
        export(&experiments, results, &scope, &formats.into_iter().collect::<Vec<_>>())?;
    }
    Ok(if arguments.strict && is_contradicted { ExitCode::from(CONTRADICTED) } else { ExitCode::SUCCESS })
}

/// Writes the figures and tables of `experiments`, as far as `scope` goes, from what is recorded under `results`; shows each
/// one's first table and its claims on stdout, and names what contradicts the paper in any of them, and the files; `quiet`, only
/// what contradicts. An experiment of which there is nothing to report is named; that is an error where it is so of all.
///
/// Tells whether a value is better or worse than the paper's, or a claim contradicted.
pub fn write(experiments: &[ExperimentSpec], results: &Path, scope: &Scope, quiet: bool) -> anyhow::Result<bool> {
    let (mut is_contradicted, mut without) = (false, Vec::new());
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
        let claims = written.claims.as_ref();
        let shown =
            claims.map_or_else(String::new, |claims| format!("\n{}", claims_text::shown(claims, terminal_width())));
        let files: String = written.files.iter().map(|file| format!("{}\n", file.display())).collect();
        let of_claims = claims.iter().flat_map(|claims| &claims.rows).filter_map(contradicted);
        let contradictions: String = written.tables.iter().map(contradictions).chain(of_claims).collect();
        print(&match quiet {
            true => contradictions.clone(),
            false => format!("{name}: {}\n{table}{shown}\n{contradictions}{files}", written.state),
        })?;
        is_contradicted |= !contradictions.is_empty();
    }
    if without.len() == experiments.len() {
        bail!("{}", without.join("\n"));
    }
    without.iter().try_for_each(|line| print(&format!("{line}\n")))?;
    Ok(is_contradicted)
}

/// Writes what is recorded of `experiments` for other programs, and names the files.
fn export(experiments: &[ExperimentSpec], results: &Path, scope: &Scope, formats: &[Format]) -> anyhow::Result<()> {
    for experiment in experiments {
        match report::export::export(experiment, results, scope, formats) {
            // Which were named when the report was written.
            Err(ReportError::NothingRecorded { .. } | ReportError::NoneMatch { .. }) => {}
            files => print(&files?.iter().map(|file| format!("{}\n", file.display())).collect::<String>())?,
        }
    }
    Ok(())
}

/// How wide the terminal is; `COLUMNS` says it where stdout is none.
fn terminal_width() -> Option<usize> {
    let said = || std::env::var("COLUMNS").ok()?.parse().ok();
    Table::new().width().map(usize::from).or_else(said)
}

/// A line where `row` contradicts its claim.
fn contradicted(row: &ClaimRow) -> Option<String> {
    let is_contradicted = row.verdict == ClaimVerdict::Contradicted;
    is_contradicted.then(|| format!("{}: contradicted in {}\n", row.claim.name, claims_text::place(row)))
}

/// The values of `table` that are better or worse than the paper's, a line each.
fn contradictions(table: &TableData) -> String {
    let cells = table.rows.iter().flat_map(|row| {
        let named = table.columns.iter().zip(&row.cells);
        named.filter_map(move |(column, cell)| Some((row, column, cell.as_ref()?.verdict.as_ref()?)))
    });
    let contradicting = cells.filter(|(.., verdict)| matches!(verdict, Verdict::Better | Verdict::Worse));
    let line = |(row, column, verdict): (&Row, &Label, &Verdict)| {
        let (labels, column) = (row.labels.join(", "), &column.text);
        format!("{labels}, {column}: {} than the paper's value ({})\n", verdict.text(), table.title)
    };
    contradicting.map(line).collect()
}
