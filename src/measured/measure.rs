//! The quantity that a curve draws or a claim compares.

use std::fmt;

use super::{Column, Iteration, evaluations, progress};

/// A number that a run has over its steps, which a figure can draw and a claim can compare.
#[derive(Debug, Clone, Copy)]
pub enum Measure {
    /// The mean dense return of each evaluation's episodes.
    Return,
    /// A column of numbers of `progress.parquet`.
    Column(&'static Column<Iteration>),
}

/// A name that no measure has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnknownMeasure {
    /// The column holds words.
    #[error("`{0}` holds words, not numbers")]
    Words(String),
    /// There is no such column.
    #[error("no column is called `{0}`")]
    NoColumn(String),
}

impl Measure {
    /// The name of the return of evaluations in a matrix file.
    pub const RETURN: &'static str = "return";

    /// The measure that a matrix file calls `name`.
    ///
    /// # Errors
    ///
    /// There is no such column, or it holds words.
    pub fn parse(name: &str) -> Result<Self, UnknownMeasure> {
        match progress::find(name) {
            _ if name == Self::RETURN => Ok(Self::Return),
            Some(column) if column.holds_numbers() => Ok(Self::Column(column)),
            Some(_) => Err(UnknownMeasure::Words(name.to_owned())),
            None => Err(UnknownMeasure::NoColumn(name.to_owned())),
        }
    }

    /// Every name that [`parse`](Self::parse) knows.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let columns = progress::COLUMNS
            .iter()
            .filter(|column| column.holds_numbers());
        let named =
            columns.flat_map(|column| [Some(column.called()), column.alias.map(|_| column.name)]);
        std::iter::once(Self::RETURN).chain(named.flatten())
    }

    /// Its name in a matrix file and in an export.
    pub fn name(self) -> &'static str {
        match self {
            Self::Return => Self::RETURN,
            Self::Column(column) => column.called(),
        }
    }

    /// Its label on a figure's axis, with its unit.
    pub fn label(self) -> String {
        match self {
            Self::Return => evaluations::DENSE_RETURN.label(),
            Self::Column(column) => column.label(),
        }
    }

    /// Whether it is this column of `progress.parquet`.
    pub fn is(self, column: &Column<Iteration>) -> bool {
        matches!(self, Self::Column(own) if own.name == column.name)
    }
}

impl PartialEq for Measure {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Measure {}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_of_numbers_can_be_asked_for_by_both_of_its_names() {
        for name in Measure::names() {
            assert!(Measure::parse(name).is_ok(), "{name}");
        }
        assert!(Measure::names().any(|name| name == "physics_seconds"));
        assert_eq!(Measure::parse("d_k"), Measure::parse("d"));
        assert!(Measure::parse("d").is_ok_and(|measure| measure.is(&progress::TOLERANCE)));
        assert_eq!(
            Measure::parse("case"),
            Err(UnknownMeasure::Words("case".into()))
        );
        assert_eq!(
            Measure::parse("mdd"),
            Err(UnknownMeasure::NoColumn("mdd".into()))
        );
    }

    #[test]
    fn an_axis_tells_its_unit() {
        let label = |name| Measure::parse(name).map(Measure::label);
        for (name, words) in [
            ("return", "return (dense reward)"),
            ("training_return", "return (training reward)"),
            ("kl", "KL of the update (nats)"),
            ("physics_seconds", "physics (s)"),
            ("value_loss", "value loss"),
        ] {
            assert_eq!(label(name).as_deref(), Ok(words));
        }
    }
}
