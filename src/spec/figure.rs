//! What a report shows: figures and tables.

use serde::{Deserialize, Serialize};

use super::{Band, Drawing, Panels, Width};
use crate::{measured::Measure, quantity::EnvSteps};

/// `[[figures]]`: learning curves in panels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title above the panels; a figure for print has none, since its caption says it.
    pub title: String,
    /// What is drawn: `return` (evaluations, dense) or a column of numbers of `progress.parquet`; or `step`, the sketch of
    /// one step of MCPO, which needs no run.
    pub y: Drawing,
    /// Axes whose values make one curve each, such as `["d"]`.
    pub series: Vec<String>,
    /// An axis, for one panel per value, or a list of selections, as for `--only`, for one panel per selection; one panel per
    /// environment when absent.
    #[serde(default)]
    pub panels: Panels,
    /// Runs that are drawn, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<String>,
    /// The paper's table whose values are marked: `table3`, `table4` or `table5`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reference: Option<String>,
    /// Whether the y axis is logarithmic.
    #[serde(default)]
    pub log_y: bool,
    /// The width in print: `column` (3.25 inches), `text` (5.5), `full` (7) or a number of inches; for the screen when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub width: Option<Width>,
    /// How a curve's seeds are shown: `t` (95 % Student t interval), `std`, `bootstrap` (95 %) or `seeds`.
    #[serde(default)]
    pub band: Band,
    /// Environment steps over which each seed is averaged, with the unsmoothed curve behind; no smoothing when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub smooth: Option<EnvSteps>,
}

/// `[[tables]]`: returns at the end of training beside the paper's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// File name without extension.
    pub name: String,
    /// Title above the table.
    pub title: String,
    /// Axes whose values make one row each.
    pub rows: Vec<String>,
    /// The axis whose values make one column each.
    pub columns: String,
    /// Runs that count, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<String>,
    /// The paper's table to compare with: `table3`, `table4` or `table5`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reference: Option<String>,
}

/// `[[settings]]`: what was set, from the specifications as they were resolved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SettingsTable {
    /// File name without extension.
    pub name: String,
    /// Title above the table.
    pub title: String,
    /// What is shown: parameters, and `observations`, `actions` and `trajectories` of the environment and its demonstration.
    pub show: Vec<String>,
    /// Axes whose values make one row each, with one column per parameter; one row per parameter when absent.
    #[serde(default)]
    pub rows: Vec<String>,
    /// Runs that count, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<String>,
}

/// What a table of settings can show beside parameters.
pub(super) const OF_ENVIRONMENTS: [&str; 3] = ["observations", "actions", "trajectories"];

/// The paper's tables that a table can be compared with.
pub(super) const REFERENCES: [&str; 3] = ["table3", "table4", "table5"];

impl Figure {
    /// The figure `name` of the dense return in each environment.
    pub fn returns(name: &str, title: String) -> Self {
        Self {
            name: name.to_owned(),
            title,
            y: Drawing::Of(Measure::Return),
            series: Vec::new(),
            panels: Panels::default(),
            only: None,
            reference: None,
            log_y: false,
            width: None,
            band: Band::default(),
            smooth: None,
        }
    }
}

impl SettingsTable {
    /// A valid table.
    pub(super) fn specimen() -> Self {
        let (name, title) = ("settings".into(), "Settings".into());
        Self { name, title, show: vec![], rows: vec![], only: None }
    }
}

impl Table {
    /// A valid table.
    pub(super) fn specimen() -> Self {
        let (name, title, columns) = ("table".into(), "Table".into(), "algorithm".into());
        Self { name, title, rows: vec![], columns, only: None, reference: None }
    }
}
