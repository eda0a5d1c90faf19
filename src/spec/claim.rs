//! `[[claims]]`: a paper's statements about its methods, to be judged by the recorded runs.

use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::{Selection, measured};
use crate::{
    fit::objection,
    measured::Measure,
    quantity::{UnitInterval, constant},
};

/// One claim: `on` of the runs `of` is above, below or like that of the runs `than`; or they keep
/// their constraint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The paper's sentence, shortened.
    pub name: String,
    /// The runs that it is about, as for `--only`; those that differ in more than their seed are
    /// judged separately.
    pub of: Selection,
    /// What is said of these runs.
    pub is: Relation,
    /// What these are compared with: runs of one setting, as for `--only`, or `demonstration`, for
    /// the return of theirs.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub than: Option<Versus>,
    /// What is compared: `return` (evaluations, dense) or a column of numbers of
    /// `progress.parquet`.
    #[serde(default = "Claim::returns")]
    #[serde(with = "measured")]
    #[schemars(with = "String")]
    pub on: Measure,
    /// Which part of training counts.
    #[serde(default)]
    pub at: Part,
    /// Whether the claim is judged in each environment, or over all of them.
    #[serde(default)]
    pub environments: Environments,
    /// Runs that count on either side, as for `--only`; all when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub only: Option<Selection>,
    /// The difference that does not count; for returns, as a share of the paper's Expert - Random.
    /// Below 0, the shortfall that is allowed.
    #[serde(default)]
    pub margin: f64,
    /// For `kept`: the least share of the iterations, after the first in which the constraint was
    /// met, in which it must be met.
    #[serde(default = "Claim::nearly_all")]
    pub share: UnitInterval,
}

/// The other side of a claim's comparison.
#[derive(Debug, Clone, PartialEq)]
pub enum Versus {
    /// The return of the demonstration that they learned from.
    Demonstration,
    /// Other runs.
    Runs(Selection),
}

impl Versus {
    /// The name of the demonstration's return in a file.
    pub(super) const DEMONSTRATION: &str = "demonstration";
}

impl fmt::Display for Versus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Demonstration => f.write_str(Self::DEMONSTRATION),
            Self::Runs(selection) => selection.fmt(f),
        }
    }
}

impl Serialize for Versus {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Versus {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        if text == Self::DEMONSTRATION {
            return Ok(Self::Demonstration);
        }
        let selection = Selection::parse(&text);
        selection
            .map(Self::Runs)
            .map_err(|error| D::Error::custom(objection(&error.to_string(), None)))
    }
}

impl JsonSchema for Versus {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Versus".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string" })
    }
}

/// What a claim says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// Greater, by more than the margin.
    Above,
    /// Less, by more than the margin.
    Below,
    /// Apart by less than the margin.
    Like,
    /// Once met, the mimicry constraint is met in at least `share` of the iterations.
    Kept,
}

/// Which part of training a claim is about.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The final evaluation; of a column, the last tenth of the steps.
    #[default]
    End,
    /// All of it: the area under the curve, over its length.
    Area,
}

/// Where a claim is judged.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Environments {
    /// In each environment that both sides have.
    #[default]
    Each,
    /// Over all of them, each with the same weight.
    Overall,
}

impl Claim {
    fn returns() -> Measure {
        Measure::Return
    }

    fn nearly_all() -> UnitInterval {
        constant(0.95)
    }

    /// A valid claim.
    pub(super) fn specimen() -> Self {
        Self {
            name: "claim".into(),
            of: Selection::parse("algorithm=mcpo").expect("a selection"),
            is: Relation::Above,
            than: None,
            on: Self::returns(),
            at: Part::End,
            environments: Environments::Each,
            only: None,
            margin: 0.0,
            share: Self::nearly_all(),
        }
    }
}
