//! The tables of columns in `experiments/columns.md`, from the catalogue.

use std::fmt::Write;

use super::keys;
use crate::measured::{Cell, Column, Role, evaluations, progress};

/// The text of `experiments/columns.md`: every column of the Parquet files, with its type, unit and
/// meaning.
pub fn documentation() -> String {
    let sections = [
        ("What every row begins with", rows(keys::COLUMNS)),
        (
            "`progress.parquet`: one row an iteration",
            rows(progress::COLUMNS),
        ),
        (
            "`evaluations.parquet`: one row an evaluation episode",
            rows(evaluations::COLUMNS),
        ),
    ];
    let mut text = INTRODUCTION.to_owned();
    for (title, rows) in sections {
        let _ = write!(
            text,
            "\n## {title}\n\n| column | type | unit | what it says |\n|---|---|---|---|\n{rows}"
        );
    }
    text
}

const INTRODUCTION: &str = "\
# The columns of a run's Parquet files

Every file has the same columns of the same types whatever the algorithm, so that all of them can be scanned as one table. A quantity
that a run does not have is null. Between the run's keys and the row's own columns stands one column for each axis of the experiment,
under the axis's name; where another column has that name, under `axis.` and the name.

A figure's `y` and a claim's `on` can be `return` (the mean dense return of each evaluation) and every column of numbers of
`progress.parquet`. Columns that a clock fills are the only ones that training the run again does not give back to the bit.
";

fn rows<R>(columns: &[&Column<R>]) -> String {
    columns.iter().map(|column| row(column)).collect()
}

fn row<R>(column: &Column<R>) -> String {
    let alias = column
        .alias
        .map(|alias| format!(", in a matrix file also `{alias}`"))
        .unwrap_or_default();
    let clock = if column.role == Role::Clock {
        " (by a clock)"
    } else {
        ""
    };
    let kind = match column.cell {
        Cell::Whole(_) => "whole number",
        Cell::Number(_) => "number",
        Cell::Truth(_) => "true or false",
        Cell::Word(_) => "word",
        Cell::MaybeWhole(_) => "whole number or null",
        Cell::MaybeNumber(_) => "number or null",
        Cell::MaybeWord(_) => "word or null",
    };
    format!(
        "| `{}`{alias} | {kind} | {} | {}{clock} |\n",
        column.name, column.unit, column.meaning
    )
}
