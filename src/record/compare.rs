//! Compares two recordings of one run, and finds the first number that differs.
//!
//! Within one numeric class ([`Build`](super::Build) tells it) every row and
//! the policy must have the same bits, except for times by a clock. Between classes the last bits
//! differ from the first step on, and the physics amplifies that: with products summed in another
//! order, the rows of `experiments/ci.toml` deviate by up to 3 parts in 100 in the first iteration
//! and in every digit in the second. So there the first iteration and the evaluations before it
//! must agree within [`TOLERANCE`], words and counts exactly, and nothing after them is compared.

use std::path::Path;

use super::{
    Manifest, RecordError, RunPaths, policy,
    rows::{self, TableError},
};
use crate::{
    measured::{self, evaluations, progress},
    parquet::{Cell, Cells, ParquetError, Table},
};

/// How far a number of the first iteration may be from the recorded one in another numeric class,
/// as a part of the larger one.
/// That is nearly twice the greatest deviation seen (0.027), between sums in vectors of 16 numbers
/// and sums in order.
pub const TOLERANCE: f64 = 0.05;
/// Numbers nearer than this count as equal in another numeric class: sums that cancel keep no
/// relative precision.
const NEGLIGIBLE: f64 = 1e-6;

/// How equal two recordings must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exactness {
    /// The same bits throughout.
    Bits,
    /// The first iteration within [`TOLERANCE`].
    FirstIteration,
}

/// The first difference between two recordings.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}, {column}: recorded {recorded}, now {computed}")]
pub struct Difference {
    /// The row: `iteration 3`, `evaluation after 1024 steps, episode 0`; or `policy`.
    pub place: String,
    /// The column's name.
    pub column: String,
    /// The recorded value.
    pub recorded: String,
    /// The value now.
    pub computed: String,
}

/// The first difference between the finished run in the folder `recorded` and the same run in
/// `computed`.
///
/// The policies are compared by their digests, so that a record may do without the file.
///
/// # Errors
///
/// A file is missing or not what its name says.
pub fn runs(
    recorded: &Path,
    computed: &Path,
    exactness: Exactness,
) -> Result<Option<Difference>, RecordError> {
    for table in [RunPaths::progress, RunPaths::evaluations] {
        let difference = tables(&table(recorded), &table(computed), exactness)?;
        if difference.is_some() {
            return Ok(difference);
        }
    }
    if exactness == Exactness::FirstIteration {
        return Ok(None);
    }
    Ok(differing(
        "policy",
        "digest",
        digest(recorded)?,
        digest(computed)?,
    ))
}

/// The first difference between two tables of rows of one kind.
///
/// # Errors
///
/// A file is missing or no table of results.
pub fn tables(
    recorded: &Path,
    computed: &Path,
    exactness: Exactness,
) -> Result<Option<Difference>, RecordError> {
    let (before, now) = (rows::read(recorded)?, rows::read(computed)?);
    let columns =
        |path, table: &Table| Columns::of(table).map_err(|error| rows::malformed(path, error));
    let (before, now) = (columns(recorded, &before)?, columns(computed, &now)?);
    first_difference(&before, &now, exactness).map_err(|error| rows::malformed(recorded, error))
}

/// The difference between two policies.
///
/// # Errors
///
/// A file is missing or no policy.
pub fn policies(recorded: &Path, computed: &Path) -> Result<Option<Difference>, RecordError> {
    Ok(differing(
        "policy",
        "digest",
        Some(policy::digest(recorded)?),
        Some(policy::digest(computed)?),
    ))
}

/// The digest of a run's policy: the file's if it is there, else the manifest's; `None` for a run
/// without a policy.
fn digest(folder: &Path) -> Result<Option<String>, RecordError> {
    let path = RunPaths::policy(folder);
    if path.exists() {
        return policy::digest(&path).map(Some);
    }
    Ok(Manifest::read(&RunPaths::manifest(folder))?.and_then(|manifest| manifest.policy))
}

fn differing(
    place: &str,
    column: &str,
    recorded: Option<String>,
    computed: Option<String>,
) -> Option<Difference> {
    let shown = |value: Option<String>| value.unwrap_or_else(|| "none".to_owned());
    (recorded != computed).then(|| Difference {
        place: place.to_owned(),
        column: column.to_owned(),
        recorded: shown(recorded),
        computed: shown(computed),
    })
}

/// The columns of a table by name, in its order.
struct Columns {
    cells: Vec<(String, Cells)>,
    height: usize,
}

impl Columns {
    fn of(table: &Table) -> Result<Self, ParquetError> {
        let named = |name: &str| Ok((name.to_owned(), table.cells(name)?));
        let cells = table
            .columns()
            .into_iter()
            .map(named)
            .collect::<Result<_, ParquetError>>()?;
        Ok(Self {
            cells,
            height: table.rows(),
        })
    }

    fn names(&self) -> String {
        self.cells
            .iter()
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// The whole number in `row` of column `name`; `None` where there is no such column.
    fn number(&self, name: &str, row: usize) -> Option<u64> {
        match self
            .cells
            .iter()
            .find(|(found, _)| found == name)?
            .1
            .get(row)
        {
            Cell::Unsigned(number) => Some(number),
            _ => None,
        }
    }
}

fn first_difference(
    before: &Columns,
    now: &Columns,
    exactness: Exactness,
) -> Result<Option<Difference>, TableError> {
    if before.names() != now.names() {
        return Ok(differing(
            "table",
            "its columns",
            Some(before.names()),
            Some(now.names()),
        ));
    }
    for row in 0..before.height.max(now.height) {
        let there = |columns: &Columns| row < columns.height;
        let place = place(if there(before) { before } else { now }, row)?;
        if exactness == Exactness::FirstIteration && !place.first {
            continue;
        }
        if there(before) != there(now) {
            let shown = |columns| Some(if there(columns) { "there" } else { "absent" }.to_owned());
            return Ok(differing(&place.name, "the row", shown(before), shown(now)));
        }
        for ((name, recorded), (_, computed)) in before.cells.iter().zip(&now.cells) {
            let (recorded, computed) = (recorded.get(row), computed.get(row));
            if !measured::is_of_clock(name) && !equal(&recorded, &computed, exactness) {
                return Ok(differing(
                    &place.name,
                    name,
                    Some(shown(&recorded)),
                    Some(shown(&computed)),
                ));
            }
        }
    }
    Ok(None)
}

/// A row's name, and whether it is from the first iteration or before.
struct RowPlace {
    name: String,
    first: bool,
}

fn place(columns: &Columns, row: usize) -> Result<RowPlace, TableError> {
    if let Some(iteration) = columns.number(progress::ITERATION.name, row) {
        return Ok(RowPlace {
            name: format!("iteration {iteration}"),
            first: iteration == 1,
        });
    }
    let numbers = columns
        .number(evaluations::ENV_STEPS.name, row)
        .zip(columns.number(evaluations::EPISODE.name, row));
    let (env_steps, episode) = numbers.ok_or(TableError::NamelessRow(row))?;
    let name = format!("evaluation after {env_steps} steps, episode {episode}");
    Ok(RowPlace {
        name,
        first: env_steps == 0,
    })
}

fn equal(recorded: &Cell, computed: &Cell, exactness: Exactness) -> bool {
    match (recorded, computed, exactness) {
        (Cell::Number(a), Cell::Number(b), Exactness::Bits) => a.to_bits() == b.to_bits(),
        (Cell::Number(a), Cell::Number(b), Exactness::FirstIteration) => {
            (a - b).abs() <= NEGLIGIBLE.max(TOLERANCE * a.abs().max(b.abs()))
        }
        _ => recorded == computed,
    }
}

/// A cell with all its digits.
fn shown(cell: &Cell) -> String {
    match cell {
        Cell::Null => "null".to_owned(),
        Cell::Truth(truth) => truth.to_string(),
        Cell::Signed(number) => number.to_string(),
        Cell::Unsigned(number) => number.to_string(),
        Cell::Number(number) => format!("{number:?}"),
        Cell::Text(text) => format!("{text:?}"),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{
        record::rows::tests::{episode, iteration, keys, stamp},
        train::{EvaluationEpisode, Iteration},
    };

    /// A finished run of these rows, with a policy of which the digest alone is kept.
    fn recorded(
        iterations: &[Iteration],
        evaluations: &[EvaluationEpisode],
        policy: &str,
    ) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path();
        rows::write_progress(&RunPaths::progress(path), &keys(None), &stamp(), iterations)
            .expect("written");
        rows::write_evaluations(
            &RunPaths::evaluations(path),
            &keys(None),
            &stamp(),
            evaluations,
        )
        .expect("written");
        let manifest = Manifest {
            policy: Some(policy.to_owned()),
            ..Manifest::new(stamp())
        };
        manifest.write(&RunPaths::manifest(path)).expect("written");
        folder
    }

    fn rows() -> (Vec<Iteration>, Vec<EvaluationEpisode>) {
        let before = EvaluationEpisode {
            env_steps: 0,
            ..episode(0)
        };
        (
            (1..=3).map(iteration).collect(),
            vec![before, episode(0), episode(1)],
        )
    }

    /// The difference, in both ways of comparing, that `change` makes.
    fn told(
        change: impl FnOnce(&mut Vec<Iteration>, &mut Vec<EvaluationEpisode>),
    ) -> [Option<String>; 2] {
        let (mut iterations, mut evaluations) = rows();
        let whole = recorded(&iterations, &evaluations, "p");
        change(&mut iterations, &mut evaluations);
        let other = recorded(&iterations, &evaluations, "p");
        [Exactness::Bits, Exactness::FirstIteration].map(|exactness| {
            let difference = runs(whole.path(), other.path(), exactness).expect("readable");
            difference.map(|difference| difference.to_string())
        })
    }

    #[test]
    fn one_bit_is_a_difference_that_is_named_and_another_class_forgives_it() {
        let [bits, first] = told(|iterations, _| {
            let kl = iterations[0].update.kl.as_mut().expect("there");
            *kl = kl.next_up();
        });
        assert_eq!(
            bits.as_deref(),
            Some("iteration 1, kl: recorded 0.30000000000000004, now 0.3000000000000001")
        );
        assert_eq!(first, None);
        let [bits, first] = told(|_, evaluations| evaluations[2].length += 1);
        assert_eq!(
            bits.as_deref(),
            Some("evaluation after 100 steps, episode 1, length: recorded 7, now 8")
        );
        assert_eq!(first, None);
    }

    #[test]
    fn another_class_forgives_neither_more_than_the_tolerance_nor_another_word() {
        let [_, first] =
            told(|iterations, _| iterations[0].update.kl = Some(0.3 * (1.0 + 2.0 * TOLERANCE)));
        assert!(first.is_some_and(|difference| difference.starts_with("iteration 1, kl")));
        let [_, first] = told(|iterations, _| iterations[0].update.kl = Some(f64::NAN));
        assert!(first.is_some_and(|difference| difference.contains("now NaN")));
        let [_, first] = told(|iterations, _| iterations[0].update.case = None);
        assert!(first.is_some_and(|difference| {
            difference.starts_with("iteration 1, case: recorded \"active\"")
        }));
        let [_, first] = told(|_, evaluations| evaluations[0].dense_return = 1.0);
        assert!(first.is_some_and(|difference| {
            difference.starts_with("evaluation after 0 steps, episode 0, dense")
        }));
        let [_, first] = told(|iterations, _| iterations.clear());
        assert_eq!(
            first.as_deref(),
            Some("iteration 1, the row: recorded there, now absent")
        );
    }

    #[test]
    fn what_a_clock_said_does_not_count_and_every_row_does() {
        assert_eq!(
            told(|iterations, _| iterations[1].update_seconds = 9.0),
            [None, None]
        );
        let [bits, first] = told(|iterations, _| iterations.truncate(2));
        assert_eq!(
            bits.as_deref(),
            Some("iteration 3, the row: recorded there, now absent")
        );
        assert_eq!(first, None);
    }

    #[test]
    fn another_policy_is_a_difference_and_a_missing_table_an_error() {
        let (iterations, evaluations) = rows();
        let [whole, other] = ["p", "q"].map(|policy| recorded(&iterations, &evaluations, policy));
        let difference = runs(whole.path(), other.path(), Exactness::Bits)
            .expect("readable")
            .expect("another policy");
        assert_eq!(difference.to_string(), "policy, digest: recorded p, now q");
        fs::remove_file(RunPaths::progress(whole.path())).expect("it was there");
        assert!(runs(whole.path(), other.path(), Exactness::Bits).is_err());
    }
}
