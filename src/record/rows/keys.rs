//! The first columns of every row: the keys of its run.

use std::collections::BTreeMap;

use crate::{
    measured::{self, Cell, Column, Field, Role, columns},
    parquet::{Cells, Entries, Table},
    plan::{AxisValue, RunSpec},
};

use super::{
    TableError,
    frame::{self, named},
};

/// The first columns of every row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Keys {
    /// [`EXPERIMENT`].
    pub experiment: String,
    /// [`RUN`].
    pub run: String,
    /// [`ENV`].
    pub env: String,
    /// [`ALGORITHM`].
    pub algorithm: String,
    /// [`D`].
    pub d: Option<f64>,
    /// [`EPSILON`].
    pub epsilon: Option<f64>,
    /// [`SEED`].
    pub seed: u64,
    /// The other axes of the run's experiment, each a column of its own between these and the
    /// row's.
    pub axes: BTreeMap<String, AxisValue>,
}

columns! { Keys;
    EXPERIMENT "experiment" Word = experiment, Key, "", "",
        "The experiment's name";
    RUN "run" Word = run, Key, "", "",
        "The run's id: `<env>/<algorithm and axes>/seed-<n>`";
    ENV "env" Word = env, Key, "", "",
        "The environment's Gym id";
    ALGORITHM "algorithm" Word = algorithm, Key, "", "",
        "The algorithm's name";
    D "d" MaybeNumber = d, Key, "", "",
        "The tolerance at the start, where the algorithm has one that is a number";
    EPSILON "epsilon" MaybeNumber = epsilon, Key, "", "",
        "The annealing factor, where the algorithm has one";
    SEED "seed" Whole = seed, Key, "", "",
        "The seed";
}

impl From<&RunSpec> for Keys {
    fn from(spec: &RunSpec) -> Self {
        Self {
            experiment: spec.experiment.clone(),
            run: spec.id.clone(),
            env: spec.env.to_string(),
            algorithm: spec.algorithm_name().to_owned(),
            d: spec.d(),
            epsilon: spec.epsilon(),
            seed: spec.seed.0,
            axes: spec.axis_columns(),
        }
    }
}

/// The prefix for an axis whose name another column has.
/// The axis `cg_iterations` is a limit, and the column `cg_iterations` the number taken; the column
/// `d` holds numbers alone.
const AXIS: &str = "axis.";

/// The column of the axis `key`, the same in both tables.
fn axis_column(key: &str) -> String {
    let taken = COLUMNS.iter().any(|column| column.name == key) || measured::is_column(key);
    if taken {
        format!("{AXIS}{key}")
    } else {
        key.to_owned()
    }
}

/// The columns of `keys`, and then of its axes, of `height` rows.
pub(super) fn to_columns(keys: &Keys, height: usize) -> Vec<polars::prelude::Column> {
    let rows = vec![keys.clone(); height];
    let mut columns = frame::to_columns(COLUMNS, &rows);
    columns.extend(keys.axes.iter().map(|(key, value)| {
        let name = axis_column(key);
        match value {
            AxisValue::Number(number) => named(&name, vec![*number; height]),
            AxisValue::Whole(number) => named(&name, vec![*number; height]),
            AxisValue::Truth(truth) => named(&name, vec![*truth; height]),
            AxisValue::Text(text) => named(&name, vec![text.clone(); height]),
        }
    }));
    columns
}

/// The keys of a table, from its first row.
///
/// # Errors
///
/// It has no rows, or a key's column is missing or of another type.
pub(super) fn of(table: &Table) -> Result<Keys, TableError> {
    let rows = frame::to_rows(COLUMNS, table, 1)?;
    let keys: Keys = rows.into_iter().next().ok_or(TableError::NoRows)?;
    Ok(Keys {
        axes: axes_of(table)?,
        ..keys
    })
}

/// The axes of a table, from its first row.
fn axes_of(table: &Table) -> Result<BTreeMap<String, AxisValue>, TableError> {
    let names = table
        .columns()
        .into_iter()
        .skip_while(|name| *name != SEED.name)
        .skip(1);
    let of_rows = [
        measured::progress::COLUMNS[0].name,
        measured::evaluations::COLUMNS[0].name,
    ];
    let mut axes = BTreeMap::new();
    // They end where the row's quantities begin.
    for name in names.take_while(|name| !of_rows.contains(name)) {
        fn first<T>(cells: Vec<Option<T>>) -> Option<T> {
            cells.into_iter().next().flatten()
        }
        let value = match table.cells(name)? {
            Cells::Numbers(cells) => AxisValue::Number(first(cells)),
            Cells::Signed(cells) => AxisValue::Whole(first(cells)),
            Cells::Truths(cells) => AxisValue::Truth(first(cells)),
            Cells::Texts(cells) => AxisValue::Text(first(cells).map(|text| text.to_string())),
            other @ Cells::Unsigned(_) => {
                return Err(TableError::Axis {
                    column: name.to_owned(),
                    found: Entries::Single(other.name()),
                });
            }
        };
        axes.insert(name.strip_prefix(AXIS).unwrap_or(name).to_owned(), value);
    }
    Ok(axes)
}
