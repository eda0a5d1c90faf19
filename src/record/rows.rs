//! `progress.parquet` and `evaluations.parquet`: one row an iteration, one row an evaluation episode.
//!
//! Every row begins with its run's keys, and every file has the same columns of the same types whatever the algorithm, so
//! that all of them can be scanned as one table. A quantity that a run does not have is null.
//!
//! polars writes them; [`crate::parquet`] reads them, since a record may be damaged, or a stranger's.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use polars::prelude::{Column, DataFrame, DataType, KeyValueMetadata, ParquetWriter, PolarsError, PolarsResult};

use super::{RecordError, Stamp, io_error, read_bounded, write_atomically};
use crate::{
    algo::Update,
    parquet::{Cells, MAX_NUMBERS, Table},
    plan::{AxisValue, RunSpec},
    train::{EvaluationEpisode, Iteration},
};

/// The largest table that is read, bytes.
pub(super) const LIMIT: u64 = 1 << 28;

/// What every row begins with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Keys {
    /// The experiment's name.
    pub experiment: String,
    /// The run's id.
    pub run: String,
    /// The environment's Gym id.
    pub env: String,
    /// The algorithm's name.
    pub algorithm: String,
    /// The tolerance at the start; absent for algorithms without one.
    pub d: Option<f64>,
    /// The annealing factor; absent likewise.
    pub epsilon: Option<f64>,
    /// The seed.
    pub seed: u64,
    /// The other axes of the run's experiment, each a column of its own between these and the row's.
    pub axes: BTreeMap<String, AxisValue>,
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

/// The kinds of cells that columns hold.
trait Cell: Sized {
    /// The type of the column, as a message calls it.
    const TYPE: &str;
    /// The column of these cells.
    fn column(name: &str, cells: Vec<Self>) -> Column;
    /// The cells of a column. Errors: it is of another type, or a cell is null that may not be.
    fn of(cells: Cells) -> Result<Vec<Self>, String>;
}

macro_rules! cell {
    ($($cell:ty = $cells:ident, $type:literal as $get:expr;)*) => {$(
        impl Cell for $cell {
            const TYPE: &str = $type;

            fn column(name: &str, cells: Vec<Self>) -> Column {
                Column::new(name.into(), cells)
            }

            fn of(cells: Cells) -> Result<Vec<Self>, String> {
                let get: fn(Option<_>) -> Option<Self> = $get;
                match cells {
                    Cells::$cells(cells) => {
                        let cells: Option<Vec<Self>> = cells.into_iter().map(get).collect();
                        cells.ok_or_else(|| "has nulls; it may have none".to_owned())
                    }
                    other => Err(format!("holds {}; expected {}", other.name(), Self::TYPE)),
                }
            }
        }
    )*};
}

cell! {
    u64 = Unsigned, "whole numbers" as |cell| cell;
    f64 = Numbers, "numbers" as |cell| cell;
    bool = Truths, "truth values" as |cell| cell;
    String = Texts, "text" as |cell: Option<Arc<str>>| cell.map(|text| text.to_string());
    Option<bool> = Truths, "truth values" as Some;
    Option<i64> = Signed, "whole numbers with a sign" as Some;
    Option<u64> = Unsigned, "whole numbers" as Some;
    Option<f64> = Numbers, "numbers" as Some;
    Option<String> = Texts, "text" as |cell: Option<Arc<str>>| Some(cell.map(|text| text.to_string()));
}

/// The names and two functions from one list of columns: `$to` makes the frame of rows, `$from` the rows of a table. `$row` names every
/// field of the row, so that a field which is added elsewhere cannot be forgotten here.
macro_rules! table {
    ($names:ident, $to:ident, $from:ident, $row:ident; $($column:ident: $cell:ty = $($path:ident).+;)*; $build:expr) => {
        /// The names of the row's columns.
        const $names: &[&str] = &[$(stringify!($column)),*];

        fn $to(keys: &Keys, rows: &[$row]) -> PolarsResult<DataFrame> {
            let mut columns = key_columns(keys, rows.len());
            $(columns.push(<$cell>::column(stringify!($column), rows.iter().map(|row| row.$($path).+.clone()).collect()));)*
            DataFrame::new(rows.len(), columns)
        }

        fn $from(table: &Table) -> Result<Vec<$row>, String> {
            $(let mut $column = cells::<$cell>(table, stringify!($column))?.into_iter();)*
            let mut rows = Vec::new();
            for _ in 0..table.rows() {
                $(let Some($column) = $column.next() else { break };)*
                rows.push($build);
            }
            Ok(rows)
        }
    };
}

table! { OF_PROGRESS, progress_frame, progress_rows, Iteration;
    iteration: u64 = iteration;
    env_steps: u64 = env_steps;
    episodes: u64 = episodes;
    dense_return: Option<f64> = dense_return;
    training_return: Option<f64> = training_return;
    episode_length: Option<f64> = episode_length;
    kl: Option<f64> = update.kl;
    entropy: Option<f64> = update.entropy;
    surrogate_gain: Option<f64> = update.surrogate_gain;
    value_loss: Option<f64> = update.value_loss;
    clip_fraction: Option<f64> = update.clip_fraction;
    mmd: Option<f64> = update.mmd;
    mmd_after: Option<f64> = update.mmd_after;
    d_k: Option<f64> = update.d; // `d` is the key: the tolerance that the matrix asks for
    case: Option<String> = update.case;
    lambda: Option<f64> = update.lambda;
    nu: Option<f64> = update.nu;
    step_fraction: Option<f64> = update.step_fraction;
    corrections: Option<u64> = update.corrections;
    cg_iterations: Option<u64> = update.cg_iterations;
    recovery_steps: Option<u64> = update.recovery_steps;
    discriminator_loss: Option<f64> = update.discriminator_loss;
    cloning_loss: Option<f64> = update.cloning_loss;
    physics_seconds: f64 = physics_seconds;
    rollout_seconds: f64 = rollout_seconds;
    update_seconds: f64 = update_seconds;
    ; Iteration {
        iteration, env_steps, episodes, dense_return, training_return, episode_length, physics_seconds,
        rollout_seconds, update_seconds,
        update: Update {
            kl, entropy, surrogate_gain, value_loss, clip_fraction, mmd, mmd_after, d: d_k, case, lambda, nu,
            step_fraction, corrections, cg_iterations, recovery_steps, discriminator_loss, cloning_loss,
            seconds: Vec::new(), // for `bench` alone; not recorded
        },
    }
}

table! { OF_EVALUATIONS, evaluation_frame, evaluation_rows, EvaluationEpisode;
    env_steps: u64 = env_steps;
    last: bool = last;
    episode: u64 = episode;
    dense_return: f64 = dense_return;
    training_return: f64 = training_return;
    length: u64 = length;
    ; EvaluationEpisode { env_steps, last, episode, dense_return, training_return, length }
}

/// What goes before the name of an axis that another column has: the axis `cg_iterations` is what was allowed, the column
/// `cg_iterations` what was taken; the column `d` holds numbers alone.
const AXIS: &str = "axis.";

/// The column of the axis `key`, the same in both tables.
fn axis_column(key: &str) -> String {
    let taken = ["d", "epsilon"].contains(&key) || OF_PROGRESS.contains(&key) || OF_EVALUATIONS.contains(&key);
    if taken { format!("{AXIS}{key}") } else { key.to_owned() }
}

fn key_columns(keys: &Keys, height: usize) -> Vec<Column> {
    let mut columns = vec![
        String::column("experiment", vec![keys.experiment.clone(); height]),
        String::column("run", vec![keys.run.clone(); height]),
        String::column("env", vec![keys.env.clone(); height]),
        String::column("algorithm", vec![keys.algorithm.clone(); height]),
        Option::<f64>::column("d", vec![keys.d; height]),
        Option::<f64>::column("epsilon", vec![keys.epsilon; height]),
        u64::column("seed", vec![keys.seed; height]),
    ];
    columns.extend(keys.axes.iter().map(|(key, value)| {
        let name = axis_column(key);
        match value {
            AxisValue::Number(number) => Option::<f64>::column(&name, vec![*number; height]),
            AxisValue::Whole(number) => Option::<i64>::column(&name, vec![*number; height]),
            AxisValue::Truth(truth) => Option::<bool>::column(&name, vec![*truth; height]),
            AxisValue::Text(text) => Option::<String>::column(&name, vec![text.clone(); height]),
        }
    }));
    columns
}

/// The axes of a table, by its first row.
fn axes_of(table: &Table) -> Result<BTreeMap<String, AxisValue>, String> {
    let names = table.columns().into_iter().skip_while(|name| *name != "seed").skip(1);
    let mut axes = BTreeMap::new();
    // They end where the row's quantities begin.
    for name in names.take_while(|name| ![OF_PROGRESS[0], OF_EVALUATIONS[0]].contains(name)) {
        fn first<T>(cells: Vec<Option<T>>) -> Option<T> {
            cells.into_iter().next().flatten()
        }
        let value = match table.cells(name)? {
            Cells::Numbers(cells) => AxisValue::Number(first(cells)),
            Cells::Signed(cells) => AxisValue::Whole(first(cells)),
            Cells::Truths(cells) => AxisValue::Truth(first(cells)),
            Cells::Texts(cells) => AxisValue::Text(first(cells).map(|text| text.to_string())),
            other @ Cells::Unsigned(_) => {
                return Err(format!("its column `{name}` holds {}; no axis does", other.name()));
            }
        };
        axes.insert(name.strip_prefix(AXIS).unwrap_or(name).to_owned(), value);
    }
    Ok(axes)
}

fn cells<T: Cell>(table: &Table, name: &str) -> Result<Vec<T>, String> {
    T::of(table.cells(name)?).map_err(|reason| format!("its column `{name}` {reason}"))
}

/// Writes the rows of iterations.
///
/// Errors: the disk refuses.
pub fn write_progress(path: &Path, keys: &Keys, stamp: &Stamp, rows: &[Iteration]) -> Result<(), RecordError> {
    write(path, progress_frame(keys, rows), stamp)
}

/// The rows of iterations; the seconds of an update's parts are not kept.
///
/// Errors: there is no such file, or it has other columns.
pub fn read_progress(path: &Path) -> Result<Vec<Iteration>, RecordError> {
    progress_rows(&read(path)?).map_err(|reason| malformed(path, reason))
}

/// The columns of numbers that a file of these rows would have, the run's keys apart.
///
/// Errors: none that polars gives for columns of one length.
pub fn numbers(rows: &[Iteration]) -> Result<BTreeMap<String, Vec<Option<f64>>>, RecordError> {
    let columns = || -> PolarsResult<_> {
        let frame = progress_frame(&Keys::default(), rows)?;
        let own = frame.columns().iter().filter(|column| OF_PROGRESS.contains(&column.name().as_str()));
        let numeric = own.filter(|column| column.dtype().is_primitive_numeric());
        numeric
            .map(|column| {
                let cells = column.cast(&DataType::Float64)?.f64()?.iter().collect();
                Ok((column.name().to_string(), cells))
            })
            .collect()
    };
    columns().map_err(|error| malformed(Path::new("rows of a checkpoint"), error.to_string()))
}

/// Writes the rows of evaluation episodes.
///
/// Errors: the disk refuses.
pub fn write_evaluations(
    path: &Path,
    keys: &Keys,
    stamp: &Stamp,
    rows: &[EvaluationEpisode],
) -> Result<(), RecordError> {
    write(path, evaluation_frame(keys, rows), stamp)
}

/// The rows of evaluation episodes.
///
/// Errors: there is no such file, or it has other columns.
pub fn read_evaluations(path: &Path) -> Result<Vec<EvaluationEpisode>, RecordError> {
    evaluation_rows(&read(path)?).map_err(|reason| malformed(path, reason))
}

/// The keys of a file of either kind.
///
/// Errors: there is no such file, it has other columns, or no rows.
pub fn read_keys(path: &Path) -> Result<Keys, RecordError> {
    keys_of(&read(path)?).map_err(|reason| malformed(path, reason))
}

fn keys_of(table: &Table) -> Result<Keys, String> {
    fn first<T: Cell>(table: &Table, name: &str) -> Result<T, String> {
        cells(table, name)?.into_iter().next().ok_or_else(|| "it has no rows".to_owned())
    }
    Ok(Keys {
        experiment: first(table, "experiment")?,
        run: first(table, "run")?,
        env: first(table, "env")?,
        algorithm: first(table, "algorithm")?,
        d: first(table, "d")?,
        epsilon: first(table, "epsilon")?,
        seed: first(table, "seed")?,
        axes: axes_of(table)?,
    })
}

/// Every column of numbers, whatever its name, one entry a row.
///
/// Errors: there is no such file, or it is no table of results.
pub fn read_numbers(path: &Path) -> Result<BTreeMap<String, Vec<Option<f64>>>, RecordError> {
    let table = read(path)?;
    let mut columns = BTreeMap::new();
    for name in table.columns() {
        let cells = table.cells(name).map_err(|reason| malformed(path, reason))?;
        columns.extend(cells.numbers().map(|numbers| (name.to_owned(), numbers)));
    }
    Ok(columns)
}

/// The stamp of a file of either kind.
///
/// Errors: there is no such file, or it was not written by this program.
pub fn read_stamp(path: &Path) -> Result<Stamp, RecordError> {
    let notes = read(path)?.notes();
    let text = notes.into_iter().find(|(key, _)| key == Stamp::KEY).map(|(_, text)| text);
    let text = text.ok_or_else(|| malformed(path, format!("its metadata has no `{}`", Stamp::KEY)))?;
    serde_json::from_str(&text).map_err(|error| malformed(path, error.to_string()))
}

fn write(path: &Path, frame: PolarsResult<DataFrame>, stamp: &Stamp) -> Result<(), RecordError> {
    let stamp = serde_json::to_string(stamp).map_err(|error| io_error("write", path)(error.into()))?;
    let mut bytes = Vec::new();
    frame
        .and_then(|mut frame| {
            ParquetWriter::new(&mut bytes)
                .with_key_value_metadata(Some(KeyValueMetadata::from_static(vec![(Stamp::KEY.to_owned(), stamp)])))
                .set_parallel(false)
                .finish(&mut frame)
        })
        .map_err(|error: PolarsError| malformed(path, error.to_string()))?;
    write_atomically(path, &bytes)
}

/// A table of results, whose columns are decoded when they are asked for.
///
/// Errors: it is missing, no Parquet, or larger than any that this program writes.
pub(super) fn read(path: &Path) -> Result<Table, RecordError> {
    let absent = || io_error("read", path)(std::io::ErrorKind::NotFound.into());
    let table = Table::new(read_bounded(path, LIMIT)?.ok_or_else(absent)?).map_err(|reason| malformed(path, reason))?;
    let cells = table.rows().saturating_mul(table.columns().len());
    if cells > MAX_NUMBERS {
        return Err(malformed(path, format!("it claims {} rows, more than are read", table.rows())));
    }
    Ok(table)
}

pub(super) fn malformed(path: &Path, reason: String) -> RecordError {
    RecordError::Malformed { path: path.to_owned(), expected: "a table of results", reason }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::record::Build;

    /// A row with numbers that text would not keep.
    pub(crate) fn iteration(n: u64) -> Iteration {
        let update = Update {
            kl: Some(0.1 + 0.2),
            case: (n % 2 == 1).then(|| "active".to_owned()),
            cg_iterations: Some(n),
            mmd: Some(f64::MIN_POSITIVE / 3.0),
            d: Some(1e-3),
            ..Update::default()
        };
        Iteration {
            iteration: n,
            env_steps: n * 100,
            episodes: 3,
            dense_return: (n > 1).then_some(-1.0 / 3.0),
            training_return: None,
            episode_length: Some(12.5),
            update,
            physics_seconds: 0.125,
            rollout_seconds: 0.25,
            update_seconds: 0.5,
        }
    }

    pub(crate) fn episode(n: u64) -> EvaluationEpisode {
        EvaluationEpisode {
            env_steps: 100,
            last: n > 0,
            episode: n,
            dense_return: 0.1,
            training_return: 1.0,
            length: 7,
        }
    }

    pub(crate) fn stamp() -> Stamp {
        let spec = serde_json::json!({ "id": "a/b" });
        Stamp {
            spec,
            fingerprint: "f".to_owned(),
            demonstration: None,
            demonstrated: None,
            build: Build::current(serde_json::Value::Null),
            origin: None,
        }
    }

    pub(crate) fn keys(d: Option<f64>) -> Keys {
        Keys {
            experiment: "e".to_owned(),
            run: "a/b".to_owned(),
            env: "Hopper-v2".to_owned(),
            algorithm: "mcpo".to_owned(),
            d,
            epsilon: None,
            seed: u64::MAX,
            axes: BTreeMap::from([
                ("mcpo.max_kl".to_owned(), AxisValue::Number(d)),
                ("ppo.normalize_advantages".to_owned(), AxisValue::Truth(Some(true))),
                ("reward".to_owned(), AxisValue::Text(Some("dense".to_owned()))),
                ("rollout.steps".to_owned(), AxisValue::Whole(Some(2048))),
            ]),
        }
    }

    #[test]
    fn any_parameter_can_be_an_axis_beside_the_row_and_comes_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut keys = keys(Some(1e-3));
        let names = crate::spec::Parameter::names().into_iter();
        keys.axes = names.map(|name| (name, AxisValue::Number(Some(0.5)))).collect();
        assert!(keys.axes.contains_key("cg_iterations"), "MCPO bounds what a column counts");
        let (progress, evaluations) = (folder.path().join("p.parquet"), folder.path().join("e.parquet"));
        write_progress(&progress, &keys, &stamp(), &[iteration(1)]).expect("written");
        write_evaluations(&evaluations, &keys, &stamp(), &[episode(0)]).expect("written");
        assert_eq!(read_progress(&progress).expect("readable"), [iteration(1)], "an axis took a quantity's place");
        assert_eq!(read_evaluations(&evaluations).expect("readable"), [episode(0)]);
        assert_eq!(
            [read_keys(&progress), read_keys(&evaluations)].map(|read| read.expect("readable")),
            [keys.clone(), keys]
        );
    }

    #[test]
    fn what_is_no_table_of_results_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("progress.parquet");
        assert!(read_progress(&path).expect_err("absent").to_string().contains("progress.parquet"));
        std::fs::write(&path, b"PAR1 no").expect("written");
        assert!(read_progress(&path).is_err() && read_stamp(&path).is_err());
        write_evaluations(&path, &keys(None), &stamp(), &[episode(0)]).expect("written");
        assert!(read_progress(&path).expect_err("other columns").to_string().contains("iteration"));
    }

    #[test]
    fn a_changed_byte_is_refused_or_gives_other_rows_but_no_panic() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("p.parquet");
        write_progress(&path, &keys(Some(1e-3)), &stamp(), &[iteration(1), iteration(2)]).expect("written");
        let whole = std::fs::read(&path).expect("readable");
        let mut refused = 0;
        for place in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[place] ^= [0x01, 0x10, 0x80, 0xff][place % 4];
            std::fs::write(&path, bytes).expect("written");
            let read = [read_progress(&path).is_ok(), read_keys(&path).is_ok(), read_numbers(&path).is_ok()];
            refused += usize::from(read != [true; 3]);
        }
        assert!(refused > whole.len() / 8, "{refused} of {}", whole.len());
    }

    #[test]
    fn rows_and_keys_and_stamp_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().expect("a folder");
        let (progress, evaluations) = (folder.path().join("p.parquet"), folder.path().join("e.parquet"));
        let rows: Vec<_> = (1..=5).map(iteration).collect();
        let episodes: Vec<_> = (0..4).map(episode).collect();
        write_progress(&progress, &keys(Some(1e-3)), &stamp(), &rows).expect("written");
        write_evaluations(&evaluations, &keys(None), &stamp(), &episodes).expect("written");
        assert_eq!(read_progress(&progress).expect("readable"), rows);
        assert_eq!(read_evaluations(&evaluations).expect("readable"), episodes);
        assert_eq!(read_keys(&progress).expect("readable"), keys(Some(1e-3)));
        assert_eq!(read_keys(&evaluations).expect("readable"), keys(None));
        assert_eq!(read_stamp(&progress).expect("readable"), stamp());
    }

    #[test]
    fn every_file_has_the_same_columns_of_the_same_types() {
        let bare = Iteration { update: Update::default(), dense_return: None, episode_length: None, ..iteration(1) };
        let full = progress_frame(&keys(Some(1.0)), &[iteration(1)]).expect("a frame");
        for rows in [vec![], vec![bare]] {
            let frame = progress_frame(&keys(None), &rows).expect("a frame");
            assert_eq!(frame.schema(), full.schema());
        }
        assert_eq!(full.column("recovery_steps").expect("a column").dtype(), &polars::prelude::DataType::UInt64);
        let none = evaluation_frame(&keys(None), &[]).expect("a frame");
        assert_eq!(none.schema(), evaluation_frame(&keys(Some(1.0)), &[episode(1)]).expect("a frame").schema());
    }
}
