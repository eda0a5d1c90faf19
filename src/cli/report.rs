//! `mcpo-run report PATH...`.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    thread,
    time::{Duration, SystemTime},
};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use comfy_table::Table;

use super::{chosen::Chosen, print};
use crate::{
    report::{
        self, ClaimRow, ClaimVerdict, Label, ReportError, Row, Scope, TableData, Verdict, Written,
        claims_text, export::Format,
    },
    spec::ExperimentSpec,
};

/// The exit code of `--strict`.
pub(super) const CONTRADICTED: u8 = 3;

/// The arguments of `report`.
#[derive(Debug, clap::Args)]
pub struct ReportArguments {
    #[command(flatten)]
    chosen: Chosen,
    /// Exit with 3 where a value is better or worse than the paper's, or a claim of the file is
    /// contradicted
    #[arg(long)]
    strict: bool,
    /// Write the report again whenever more is recorded, looking every so many seconds (10), until
    /// all runs have ended
    #[arg(long, value_name = "SECONDS", num_args = 0..=1)]
    #[arg(default_missing_value = "10", require_equals = true)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..))]
    watch: Option<u16>,
    /// Also write what other programs read, into the report's folder `export`
    #[arg(long, value_name = "FORMAT,...", value_delimiter = ',', value_parser = format())]
    export: Vec<Format>,
}

/// Reads the name of a format.
fn format() -> impl TypedValueParser<Value = Format> {
    let names = Format::ALL
        .iter()
        .map(|format| PossibleValue::new(format.name()).help(format.help()));
    let named = |name: String| {
        Format::ALL
            .iter()
            .copied()
            .find(|format| format.name() == name)
    };
    PossibleValuesParser::new(names)
        .map(move |name| named(name).expect("the parser knows the names of formats alone"))
}

/// Writes the reports, again and again with `--watch`.
pub fn run(arguments: &ReportArguments) -> anyhow::Result<ExitCode> {
    let Chosen {
        only,
        axis,
        set,
        results,
        ..
    } = &arguments.chosen;
    let scope = Scope {
        only: only.clone(),
        axis: axis.clone(),
        set: set.clone(),
    };
    let experiments = arguments.chosen.load()?;
    // A format that is asked for twice is written once.
    let formats: BTreeSet<Format> = arguments.export.iter().copied().collect();
    let formats: Vec<Format> = formats.into_iter().collect();
    let mut shown = Shown::Whole;
    let is_contradicted = loop {
        // Looking before the report is made ensures that later records lead to another report.
        let seen = arguments.watch.map(|_| recorded(&experiments, results));
        let told = match told(&experiments, results, &scope, shown) {
            // With `--watch`, something may be recorded later.
            Err(nothing) if arguments.watch.is_some() && nothing.is::<Nothing>() => Told {
                open: 1,
                is_contradicted: false,
            },
            told => told?,
        };
        export(&experiments, results, &scope, &formats)?;
        let Some(seconds) = arguments.watch.filter(|_| told.open > 0) else {
            break told.is_contradicted;
        };
        while Some(recorded(&experiments, results)) == seen {
            thread::sleep(Duration::from_secs(seconds.into()));
        }
        shown = Shown::State;
    };
    Ok(if arguments.strict && is_contradicted {
        ExitCode::from(CONTRADICTED)
    } else {
        ExitCode::SUCCESS
    })
}

/// How much of a report is shown on stdout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shown {
    /// The first table, the claims, and the files.
    Whole,
    /// The progress, and the values and claims that contradict.
    State,
    /// Only the values and claims that contradict.
    Contradictions,
}

/// The outcome of the reports of several experiments.
struct Told {
    /// Whether a value is better or worse than the paper's, or a claim contradicted.
    is_contradicted: bool,
    /// Runs that have neither finished nor failed.
    open: usize,
}

/// There is nothing to report of any experiment; the reasons, one per line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Nothing(String);

/// Writes the figures and tables of `experiments`, within `scope`, from the records under
/// `results`. Shows each one's first table and claims on stdout, then whatever contradicts the
/// paper, and the files; with `quiet`, only what contradicts. Names each experiment without
/// anything to report, and fails where none has anything.
///
/// Returns whether a value is better or worse than the paper's, or a claim contradicted.
pub fn write(
    experiments: &[ExperimentSpec],
    results: &Path,
    scope: &Scope,
    quiet: bool,
) -> anyhow::Result<bool> {
    let shown = if quiet {
        Shown::Contradictions
    } else {
        Shown::Whole
    };
    Ok(told(experiments, results, scope, shown)?.is_contradicted)
}

fn told(
    experiments: &[ExperimentSpec],
    results: &Path,
    scope: &Scope,
    shown: Shown,
) -> anyhow::Result<Told> {
    let (mut all, mut without) = (
        Told {
            is_contradicted: false,
            open: 0,
        },
        Vec::new(),
    );
    for experiment in experiments {
        let name = &experiment.name;
        let written = match report::write(experiment, results, scope) {
            Err(error @ (ReportError::NothingRecorded { .. } | ReportError::NoneMatch { .. })) => {
                // Records may still appear, but a selection that matches no run will never match
                // any.
                all.open += usize::from(matches!(error, ReportError::NothingRecorded { .. }));
                without.push(error.to_string());
                continue;
            }
            written => written?,
        };
        let claims = written.claims.as_ref();
        let of_claims = claims
            .iter()
            .flat_map(|claims| &claims.rows)
            .filter_map(contradicted);
        let contradictions: String = written
            .tables
            .iter()
            .map(contradictions)
            .chain(of_claims)
            .collect();
        print(&match shown {
            Shown::Contradictions => contradictions.clone(),
            Shown::State => format!("{name}: {}\n{contradictions}", written.state),
            Shown::Whole => whole(name, &written, &contradictions),
        })?;
        all.is_contradicted |= !contradictions.is_empty();
        all.open += written.open;
    }
    // One report is enough for a success; what the others lack is only told.
    if without.len() == experiments.len() {
        return Err(Nothing(without.join("\n")).into());
    }
    without
        .iter()
        .try_for_each(|line| print(&format!("{line}\n")))?;
    Ok(all)
}

/// The text on stdout for one report, in full.
fn whole(name: &str, written: &Written, contradictions: &str) -> String {
    let table = written.tables.first();
    let table = table.map_or_else(String::new, |table| {
        format!("\n{}", report::terminal(table, terminal_width()))
    });
    let claims = written.claims.as_ref();
    let claims = claims.map_or_else(String::new, |claims| {
        format!("\n{}", claims_text::shown(claims, terminal_width()))
    });
    let files: String = written
        .files
        .iter()
        .map(|file| format!("{}\n", file.display()))
        .collect();
    format!(
        "{name}: {}\n{table}{claims}\n{contradictions}{files}",
        written.state
    )
}

/// The manifests and checkpoints of `experiments`, with their times and sizes. A report has to be
/// made anew where these change.
fn recorded(
    experiments: &[ExperimentSpec],
    results: &Path,
) -> Vec<(PathBuf, Option<SystemTime>, u64)> {
    let mut folders: Vec<PathBuf> = experiments
        .iter()
        .map(|spec| results.join(&spec.name).join("runs"))
        .collect();
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let (path, Ok(metadata)) = (entry.path(), entry.metadata()) else {
                continue;
            }; // of a link, the link's
            if metadata.is_dir() {
                folders.push(path);
            } else if ["run.json", "checkpoint"]
                .iter()
                .any(|name| path.ends_with(name))
            {
                found.push((path, metadata.modified().ok(), metadata.len()));
            }
        }
    }
    found.sort();
    found
}

/// Writes the records of `experiments` for other programs, and prints the names of the files.
fn export(
    experiments: &[ExperimentSpec],
    results: &Path,
    scope: &Scope,
    formats: &[Format],
) -> anyhow::Result<()> {
    for experiment in experiments.iter().filter(|_| !formats.is_empty()) {
        match report::export::export(experiment, results, scope, formats) {
            // These were named when the report was written.
            Err(ReportError::NothingRecorded { .. } | ReportError::NoneMatch { .. }) => {}
            files => print(
                &files?
                    .iter()
                    .map(|file| format!("{}\n", file.display()))
                    .collect::<String>(),
            )?,
        }
    }
    Ok(())
}

/// The width of the terminal; that of `COLUMNS` where stdout is not a terminal.
pub(super) fn terminal_width() -> Option<usize> {
    let said = || std::env::var("COLUMNS").ok()?.parse().ok();
    Table::new().width().map(usize::from).or_else(said)
}

/// A line for `row` if it contradicts its claim.
fn contradicted(row: &ClaimRow) -> Option<String> {
    let is_contradicted = row.verdict == ClaimVerdict::Contradicted;
    is_contradicted.then(|| {
        format!(
            "{}: contradicted in {}\n",
            row.claim.name,
            claims_text::place(row)
        )
    })
}

/// The values of `table` that are better or worse than the paper's, one per line.
fn contradictions(table: &TableData) -> String {
    let cells = table.rows.iter().flat_map(|row| {
        let named = table.columns.iter().zip(&row.cells);
        named
            .filter_map(move |(column, cell)| Some((row, column, cell.as_ref()?.verdict.as_ref()?)))
    });
    let contradicting =
        cells.filter(|(.., verdict)| matches!(verdict, Verdict::Better | Verdict::Worse));
    let line = |(row, column, verdict): (&Row, &Label, &Verdict)| {
        let (labels, column) = (row.labels.join(", "), &column.text);
        format!(
            "{labels}, {column}: {} than the paper's value ({})\n",
            verdict.text(),
            table.title
        )
    };
    contradicting.map(line).collect()
}
