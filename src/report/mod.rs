//! The report: from recorded files to learning curves and tables.
//!
//! Owns the statistics shown, the comparison with the paper, and the drawing. Reads recorded files only, so it can run years
//! later on another machine; knows nothing of training. Start at [`write()`]; [`CurveData`] and [`TableData`] are the numbers,
//! which the modules `figure` and `text` only show.

mod axis;
mod counterpart;
mod curve;
mod figure;
#[cfg(test)]
mod fixture;
mod notes;
mod recorded;
pub mod reference;
mod table;
mod text;
mod write;

use std::io;

pub use curve::{Curve, CurveData, Panel, Point};
pub use figure::{BLACK, PALETTE, picture};
pub use recorded::{Evaluation, Recording, Run, State, load};
pub use table::{Best, Cell, Row, TableData, Verdict};
pub use text::terminal;
pub use write::{Written, write};

use crate::{plan::PlanError, record::RecordError, spec::SelectionError};

/// What can go wrong when a report is made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A recorded file cannot be read, or the report not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The experiment has no plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// `only` of a figure or table cannot be understood.
    #[error("`only`: {0}")]
    Selection(#[from] SelectionError),
    /// A figure asks for a column that no run has.
    #[error("the figure {figure}: no finished run has a column `{column}` of numbers; known: return, {known}")]
    NoColumn {
        /// The figure's name.
        figure: String,
        /// As it was asked for.
        column: String,
        /// The columns that there are.
        known: String,
    },
    /// A picture cannot be encoded.
    #[error("cannot draw a figure: {0}")]
    Draw(io::Error),
    /// A table cannot be written as CSV.
    #[error("cannot write a table as CSV: {0}")]
    Csv(#[from] csv::Error),
}
