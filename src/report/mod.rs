//! The report: from recorded files to learning curves and tables.
//!
//! Owns the statistics shown, the comparison with the paper, and the drawing. Reads recorded files
//! only, so it can run years later on another machine; knows nothing of training. Start at
//! [`write()`]; [`CurveData`] and [`TableData`] are the numbers, which the modules `figure` and
//! `text` only show.

mod amount;
mod axis;
mod cell;
mod claims;
mod comparable;
mod compare;
mod curve;
pub mod export;
mod figure;
mod files;
#[cfg(test)]
mod fixture;
mod identity;
mod notes;
mod over_seeds;
mod page;
mod paper_value;
mod recorded;
pub mod reference;
mod scope;
mod settings;
mod statistics;
mod table;
mod text;
mod verdict;
mod write;

use std::{io, path::PathBuf};

pub use axis::Label;
pub use cell::{Best, Cell, Row};
pub use claims::{ClaimRow, ClaimVerdict, ClaimsData, Count, Unjudged};
pub use compare::{CompareData, CompareRow, in_folder};
pub use curve::{Curve, CurveData, LeftOut, Panel, Point};
pub use figure::{BLACK, PALETTE, picture};
pub use recorded::{Evaluation, Loaded, Recording, Run, State, load};
pub use scope::Scope;
pub use table::TableData;
pub use text::{claims as claims_text, compare as compare_text, terminal};
pub use verdict::{Comparison, Verdict};
pub use write::{Written, write};

use crate::{plan::PlanError, record::RecordError, spec::SelectionError};

/// Errors of making a report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A recorded file cannot be read, or the report not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// No plan can be made of the experiment.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// `only` of a figure or table cannot be understood.
    #[error("`only`: {0}")]
    Selection(#[from] SelectionError),
    /// There is nothing to report.
    #[error("{experiment}: nothing is recorded under {}", results.display())]
    NothingRecorded {
        /// The experiment.
        experiment: String,
        /// The folder of all results.
        results: PathBuf,
    },
    /// The selection matches no run.
    #[error("{experiment}: none of the {runs} runs match --only {only}")]
    NoneMatch {
        /// The experiment.
        experiment: String,
        /// The number of its runs.
        runs: usize,
        /// The selection.
        only: String,
    },
    /// A picture cannot be encoded.
    #[error("cannot draw a figure: {0}")]
    Draw(io::Error),
    /// A table cannot be written as CSV.
    #[error("cannot write a table as CSV: {0}")]
    Csv(#[from] csv::Error),
}
