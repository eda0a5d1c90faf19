//! The figures and tables of a report.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{
    Band, Drawing, Key, Panels, Parameter, Selection, Width,
    named::{Named, by_name},
};
use crate::{measured::Measure, quantity::EnvSteps};

/// `[[figures]]`: learning curves in panels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title above the panels; a figure for print has none, since its caption says it.
    pub title: String,
    /// What is drawn: `return` (evaluations, dense) or a column of numbers of `progress.parquet`;
    /// or `step`, the sketch of one step of MCPO, which needs no run.
    pub y: Drawing,
    /// Axes whose values make one curve each, such as `["d"]`.
    pub series: Vec<Key>,
    /// An axis, for one panel per value, or a list of selections, as for `--only`, for one panel
    /// per selection; one panel per environment when absent.
    #[serde(default)]
    pub panels: Panels,
    /// Runs that are drawn, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<Selection>,
    /// The paper's table whose values are marked: `table3`, `table4` or `table5`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reference: Option<Reference>,
    /// Whether the y axis is logarithmic.
    #[serde(default)]
    pub log_y: bool,
    /// The width in print: `column` (3.25 inches), `text` (5.5), `full` (7) or a number of inches;
    /// for the screen when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub width: Option<Width>,
    /// How a curve's seeds are shown: `t` (95 % Student t interval), `std`, `bootstrap` (95 %) or
    /// `seeds`.
    #[serde(default)]
    pub band: Band,
    /// Environment steps over which each seed is averaged, with the unsmoothed curve behind; no
    /// smoothing when absent.
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
    pub rows: Vec<Key>,
    /// The axis whose values make one column each.
    pub columns: Key,
    /// Runs that count, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<Selection>,
    /// The paper's table to compare with: `table3`, `table4` or `table5`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reference: Option<Reference>,
}

/// `[[settings]]`: what was set, from the specifications as they were resolved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SettingsTable {
    /// File name without extension.
    pub name: String,
    /// Title above the table.
    pub title: String,
    /// What is shown: parameters, and `observations`, `actions` and `trajectories` of the
    /// environment and its demonstration.
    pub show: Vec<Shown>,
    /// Axes whose values make one row each, with one column per parameter; one row per parameter
    /// when absent.
    #[serde(default)]
    pub rows: Vec<Key>,
    /// Runs that count, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<Selection>,
}

/// An entry of a table of settings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Shown {
    /// Numbers in an observation.
    Observations,
    /// Numbers in an action.
    Actions,
    /// Episodes of the demonstration.
    Trajectories,
    /// A setting or hyperparameter.
    Parameter(Parameter),
}

impl Named for Shown {
    const WHAT: &str = "parameter";

    fn named(name: &str) -> Option<Self> {
        match name {
            "observations" => Some(Self::Observations),
            "actions" => Some(Self::Actions),
            "trajectories" => Some(Self::Trajectories),
            _ => Parameter::find(name).map(Self::Parameter),
        }
    }

    fn known() -> Vec<String> {
        let of_environments =
            [Self::Observations, Self::Actions, Self::Trajectories].map(|shown| shown.to_string());
        of_environments
            .into_iter()
            .chain(Parameter::names())
            .collect()
    }
}

by_name!(Shown);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Observations => f.write_str("observations"),
            Self::Actions => f.write_str("actions"),
            Self::Trajectories => f.write_str("trajectories"),
            Self::Parameter(parameter) => parameter.fmt(f),
        }
    }
}

/// One of the paper's tables of returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// All methods in all environments.
    Table3,
    /// As Table 3, by another measure of the same runs.
    Table4,
    /// The ablation of d and epsilon.
    Table5,
}

impl Reference {
    const NAMED: [(&str, Self); 3] = [
        ("table3", Self::Table3),
        ("table4", Self::Table4),
        ("table5", Self::Table5),
    ];
}

impl Named for Reference {
    const WHAT: &str = "reference";

    fn named(name: &str) -> Option<Self> {
        Self::NAMED
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, reference)| *reference)
    }

    fn known() -> Vec<String> {
        Self::NAMED.map(|(name, _)| name.to_owned()).into()
    }
}

by_name!(Reference);

impl fmt::Display for Reference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMED
            .iter()
            .find(|(_, known)| known == self)
            .map_or("", |(name, _)| name);
        f.write_str(name)
    }
}

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
        Self {
            name,
            title,
            show: vec![],
            rows: vec![],
            only: None,
        }
    }
}

impl Table {
    /// A valid table.
    pub(super) fn specimen() -> Self {
        let (name, title, columns) = ("table".into(), "Table".into(), Key::Algorithm);
        Self {
            name,
            title,
            rows: vec![],
            columns,
            only: None,
            reference: None,
        }
    }
}
