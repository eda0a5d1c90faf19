//! What a report shows: figures and tables.

use serde::{Deserialize, Serialize};

use crate::algo::Update;

/// `[[figures]]`: learning curves, one panel an environment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title above the panels.
    pub title: String,
    /// What is drawn: `return` (evaluations, dense), `training_return` or a column of `progress.parquet`.
    pub y: String,
    /// Axes whose values make one curve each, such as `["d"]`.
    pub series: Vec<String>,
    /// Runs that are drawn, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<String>,
    /// Whether the y axis is logarithmic.
    #[serde(default)]
    pub log_y: bool,
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

/// The paper's tables that a table can be compared with.
pub(super) const REFERENCES: [&str; 3] = ["table3", "table4", "table5"];

/// Columns of `progress.parquet` that are not the update's.
const ROLLOUT_COLUMNS: [&str; 8] = [
    "iteration",
    "episodes",
    "dense_return",
    "training_return",
    "episode_length",
    "physics_seconds",
    "rollout_seconds",
    "update_seconds",
];

/// Columns that hold words, which a figure cannot draw.
pub(super) const WORDS: [&str; 1] = ["case"];

/// What a figure's `y` can be: columns of numbers.
pub(super) fn columns() -> Vec<&'static str> {
    static UPDATE: std::sync::LazyLock<Vec<String>> = std::sync::LazyLock::new(|| {
        let fields = serde_json::to_value(Update::default()).unwrap_or_default();
        fields
            .as_object()
            .into_iter()
            .flatten()
            .filter(|(key, value)| value.is_null() && !WORDS.contains(&key.as_str()))
            .map(|(key, _)| key.clone())
            .collect()
    });
    std::iter::once("return").chain(ROLLOUT_COLUMNS).chain(UPDATE.iter().map(String::as_str)).collect()
}

impl Figure {
    /// A valid figure.
    pub(super) fn specimen() -> Self {
        let (name, title, y) = ("figure".into(), "Figure".into(), "return".into());
        Self { name, title, y, series: vec![], only: None, log_y: false }
    }
}

impl Table {
    /// A valid table.
    pub(super) fn specimen() -> Self {
        let (name, title, columns) = ("table".into(), "Table".into(), "algorithm".into());
        Self { name, title, rows: vec![], columns, only: None, reference: None }
    }
}
