//! The measurements of training: the rows of a run, and the catalogue of their columns.
//!
//! Owns the rows ([`Iteration`], [`EvaluationEpisode`]) and, for each of their columns, its name,
//! unit, meaning, kind and role, and how it is read from a row and put into one. Whoever writes,
//! reads, compares, draws, judges or documents a column asks here. Knows nothing of files. Start at
//! [`progress::COLUMNS`]; a column is added there, and nowhere else.

pub mod evaluations;
mod measure;
pub mod progress;

pub use evaluations::EvaluationEpisode;
pub use measure::{Measure, UnknownMeasure};
pub use progress::Iteration;

/// One column of the rows `R`.
#[derive(Debug)]
pub struct Column<R> {
    /// Its name in the Parquet file.
    pub name: &'static str,
    /// Its name in a matrix file and in an export, where that differs from the name in the Parquet
    /// file because a run's key may have the latter.
    pub alias: Option<&'static str>,
    /// Its label on a figure's axis; empty where its name in words will do.
    pub words: &'static str,
    /// Its unit; empty for a count or a ratio.
    pub unit: &'static str,
    /// Its meaning, as a sentence without the full stop.
    pub meaning: &'static str,
    /// Its role in the row.
    pub role: Role,
    /// How its cells are read and written.
    pub cell: Cell<R>,
}

/// The role of a column in its row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// It says which run the row belongs to.
    Key,
    /// It says where the row stands in its run.
    Position,
    /// It was measured, and comes out the same whenever the run is trained again.
    Measured,
    /// A clock measured it, so that it never comes out the same.
    Clock,
}

/// How cells of one kind are read from rows `R` and put into them.
#[derive(Debug)]
pub enum Cell<R> {
    /// A whole number, in every row.
    Whole(Field<R, u64>),
    /// A number, in every row.
    Number(Field<R, f64>),
    /// A truth value, in every row.
    Truth(Field<R, bool>),
    /// A word, in every row.
    Word(Field<R, String>),
    /// A whole number, where the run has such a thing.
    MaybeWhole(Field<R, Option<u64>>),
    /// A number, where the run has such a thing.
    MaybeNumber(Field<R, Option<f64>>),
    /// A word, where the run has such a thing.
    MaybeWord(Field<R, Option<String>>),
}

/// The field of a row that a column holds.
#[derive(Debug)]
pub struct Field<R, T> {
    /// Reads the field.
    pub get: fn(&R) -> T,
    /// Sets the field.
    pub set: fn(&mut R, T),
}

impl<R> Column<R> {
    /// Its name in a matrix file and in an export.
    pub fn called(&self) -> &'static str {
        self.alias.unwrap_or(self.name)
    }

    /// Its label on a figure's axis, with its unit: `KL of the update (nats)`.
    pub fn label(&self) -> String {
        let words = if self.words.is_empty() {
            self.name.replace('_', " ")
        } else {
            self.words.to_owned()
        };
        if self.unit.is_empty() {
            words
        } else {
            format!("{words} ({})", self.unit)
        }
    }

    /// Whether its cells are numbers, which can be drawn.
    pub fn holds_numbers(&self) -> bool {
        match self.cell {
            Cell::Whole(_) | Cell::Number(_) | Cell::MaybeWhole(_) | Cell::MaybeNumber(_) => true,
            Cell::Truth(_) | Cell::Word(_) | Cell::MaybeWord(_) => false,
        }
    }

    /// Its number in `row`; `None` where the run has no such thing, or it holds no numbers.
    pub fn number(&self, row: &R) -> Option<f64> {
        match &self.cell {
            Cell::Whole(field) => Some((field.get)(row) as f64),
            Cell::Number(field) => Some((field.get)(row)),
            Cell::MaybeWhole(field) => (field.get)(row).map(|number| number as f64),
            Cell::MaybeNumber(field) => (field.get)(row),
            Cell::Truth(_) | Cell::Word(_) | Cell::MaybeWord(_) => None,
        }
    }
}

/// The catalogue of one kind of row: each column as a static of its own, which other modules refer
/// to, and the list of all of them in the file's order.
///
/// A line is `STATIC "name" ["alias"] Kind = field.of.the.row, Role, "words", "unit", "meaning";`.
macro_rules! columns {
    ($row:ty; $($id:ident $name:literal $([$alias:literal])? $kind:ident = $($path:ident).+,
        $role:ident, $words:literal, $unit:literal, $meaning:literal;)*) => {
        $(
            #[doc = $meaning]
            pub static $id: Column<$row> = Column {
                name: $name,
                alias: columns!(@ $($alias)?),
                words: $words,
                unit: $unit,
                meaning: $meaning,
                role: Role::$role,
                cell: Cell::$kind(Field {
                    get: |row| Clone::clone(&row.$($path).+),
                    set: |row, value| row.$($path).+ = value,
                }),
            };
        )*

        /// All columns, in the order of the file.
        pub static COLUMNS: &[&Column<$row>] = &[$(&$id),*];
    };
    (@ $alias:literal) => { Some($alias) };
    (@) => { None };
}
pub(crate) use columns;

/// Whether the column `name`, of either table, holds measurements of a clock.
pub fn is_of_clock(name: &str) -> bool {
    fn within<R>(columns: &[&Column<R>], name: &str) -> bool {
        columns
            .iter()
            .any(|column| column.name == name && column.role == Role::Clock)
    }
    within(progress::COLUMNS, name) || within(evaluations::COLUMNS, name)
}

/// Whether either table has a column called `name`.
pub fn is_column(name: &str) -> bool {
    let of_progress = progress::COLUMNS.iter().any(|column| column.name == name);
    of_progress
        || evaluations::COLUMNS
            .iter()
            .any(|column| column.name == name)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde_json::Value;

    use super::*;

    /// The fields of `row`, those of a field that is a row itself among them.
    fn fields(row: Value) -> BTreeSet<String> {
        let Value::Object(fields) = row else {
            panic!("a row has fields")
        };
        let inner = |(name, value)| match value {
            Value::Object(_) => super::tests::fields(value),
            _ => BTreeSet::from([name]),
        };
        fields.into_iter().flat_map(inner).collect()
    }

    fn names<R>(columns: &[&Column<R>]) -> BTreeSet<String> {
        columns
            .iter()
            .map(|column| column.called().to_owned())
            .collect()
    }

    #[test]
    fn every_field_of_a_row_is_a_column() {
        let mut of_iteration = fields(serde_json::to_value(Iteration::default()).expect("a row"));
        assert!(
            of_iteration.remove("seconds"),
            "the parts of an update are for `bench` alone"
        );
        assert_eq!(names(progress::COLUMNS), of_iteration);
        let of_episode = fields(serde_json::to_value(EvaluationEpisode::default()).expect("a row"));
        assert_eq!(names(evaluations::COLUMNS), of_episode);
    }

    #[test]
    fn what_is_put_into_a_column_is_read_from_it_and_from_no_other() {
        for (index, column) in progress::COLUMNS.iter().enumerate() {
            let mut row = Iteration::default();
            match &column.cell {
                Cell::Whole(field) => (field.set)(&mut row, 7),
                Cell::Number(field) => (field.set)(&mut row, 7.0),
                Cell::Truth(field) => (field.set)(&mut row, true),
                Cell::Word(field) => (field.set)(&mut row, "7".to_owned()),
                Cell::MaybeWhole(field) => (field.set)(&mut row, Some(7)),
                Cell::MaybeNumber(field) => (field.set)(&mut row, Some(7.0)),
                Cell::MaybeWord(field) => (field.set)(&mut row, Some("7".to_owned())),
            }
            assert_ne!(row, Iteration::default(), "{}", column.name);
            for (other, second) in progress::COLUMNS
                .iter()
                .enumerate()
                .filter(|_| column.holds_numbers())
            {
                let is_seven = second.number(&row) == Some(7.0);
                assert_eq!(
                    is_seven,
                    index == other,
                    "{} and {}",
                    column.name,
                    second.name
                );
            }
        }
    }

    #[test]
    fn a_clocks_columns_are_those_of_seconds() {
        let clocks: Vec<&str> = progress::COLUMNS
            .iter()
            .map(|c| c.name)
            .filter(|name| is_of_clock(name))
            .collect();
        assert_eq!(
            clocks,
            ["physics_seconds", "rollout_seconds", "update_seconds"]
        );
        assert!(
            !is_of_clock("kl") && !is_of_clock("length") && !is_of_clock("axis.update_seconds")
        );
    }
}
