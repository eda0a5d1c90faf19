//! The Parquet format: one row a step.
//!
//! | column | type | |
//! |---|---|---|
//! | `episode` | i64 | constant within an episode, rising from one to the next |
//! | `step` | i64 | from 0 within each episode |
//! | `observation` | list of f64 | raw, before the step |
//! | `action` | list of f64 | raw, unclamped |
//! | `reward` | f64 | dense; may be absent |
//! | `terminated`, `truncated` | bool | true at an episode's last step alone |
//! | `qpos`, `qvel` | list of f64 | before the step; both or neither |
//!
//! Provenance is the file's key-value metadata. Other columns are ignored; a flawed file is an error that says what was
//! expected.

use std::{
    fs::File,
    io::{Cursor, Read},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use nalgebra::DMatrix;
use polars::prelude::{
    Column, DataFrame, DataType, Float64Type, IntoColumn, KeyValueMetadata, ListBuilderTrait,
    ListPrimitiveChunkedBuilder, ParallelStrategy, ParquetReader, ParquetWriter, SerReader, Series,
};

use super::{DemoError, Demonstration};
use crate::env::Pose;

/// The largest file that is read, bytes: ten times 20,000 steps of Ant.
const MAX_BYTES: u64 = 1 << 30;

/// The longest demonstration that is read, steps.
const MAX_STEPS: usize = 10_000_000;

/// Keys of metadata that writers of Parquet add for themselves.
const WRITERS_KEYS: [&str; 2] = ["ARROW:schema", "pandas"];

impl Demonstration {
    /// Writes the Parquet file `path`, whole or not at all.
    ///
    /// Errors: the folder or the disk refuses, or the fields contradict each other.
    pub fn write(&self, path: &Path) -> Result<(), DemoError> {
        let failed = |reason: String| DemoError::Unwritable { path: path.to_owned(), reason };
        if let Some(flaw) = self.flaw() {
            return Err(failed(flaw));
        }
        let mut frame = self.to_frame().map_err(|error| failed(error.to_string()))?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut file = tempfile::NamedTempFile::new_in(folder).map_err(|error| failed(error.to_string()))?;
        ParquetWriter::new(file.as_file_mut())
            .with_key_value_metadata(Some(KeyValueMetadata::from_static(self.provenance.clone())))
            .finish(&mut frame)
            .map_err(|error| failed(error.to_string()))?;
        file.as_file().sync_all().map_err(|error| failed(error.to_string()))?;
        file.persist(path).map_err(|error| failed(error.to_string()))?;
        Ok(())
    }

    /// Reads the Parquet file `path`.
    ///
    /// Errors: it is missing, larger than 1 GiB or 10 million steps, no Parquet, damaged, or not in this format: a column
    /// is missing or has another type, rows differ in length, a number is not finite, episodes are torn apart.
    pub fn read(path: &Path) -> Result<Self, DemoError> {
        let failed = |reason: String| DemoError::Unreadable { path: path.to_owned(), reason };
        let bytes = read_bounded(path).map_err(failed)?;
        // polars panics on some damaged files; here alone, where it meets bytes that nobody has checked, that is caught.
        let frame = catch_unwind(AssertUnwindSafe(|| Frame::read(bytes)))
            .unwrap_or_else(|_| Err("it is damaged (the Parquet reader gave up)".into()));
        frame.and_then(Frame::into_demonstration).map_err(failed)
    }

    /// One row a step.
    pub(super) fn to_frame(&self) -> Result<DataFrame, polars::error::PolarsError> {
        let (mut episodes, mut steps) = (Vec::with_capacity(self.len()), Vec::with_capacity(self.len()));
        for (episode, range) in self.episodes().enumerate() {
            episodes.extend(range.clone().map(|_| episode as i64));
            steps.extend((0..range.len()).map(|step| step as i64));
        }
        let rows = |matrix: &DMatrix<f64>, name: &str| {
            lists(name, matrix.nrows(), self.len(), matrix.as_slice().chunks_exact(matrix.nrows()))
        };
        let mut columns = vec![
            Column::new("episode".into(), episodes),
            Column::new("step".into(), steps),
            rows(&self.observations, "observation"),
            rows(&self.actions, "action"),
        ];
        if let Some(rewards) = &self.rewards {
            columns.push(Column::new("reward".into(), rewards));
        }
        columns.push(Column::new("terminated".into(), &self.terminated));
        columns.push(Column::new("truncated".into(), &self.truncated));
        if let Some(poses) = &self.poses {
            let (nq, nv) = (poses[0].qpos.len(), poses[0].qvel.len());
            columns.push(lists("qpos", nq, self.len(), poses.iter().map(|pose| pose.qpos.as_slice())));
            columns.push(lists("qvel", nv, self.len(), poses.iter().map(|pose| pose.qvel.as_slice())));
        }
        DataFrame::new(self.len(), columns)
    }
}

/// A column of `n` lists of `width` numbers.
fn lists<'a>(name: &str, width: usize, n: usize, rows: impl Iterator<Item = &'a [f64]>) -> Column {
    let mut builder = ListPrimitiveChunkedBuilder::<Float64Type>::new(name.into(), n, n * width, DataType::Float64);
    rows.for_each(|row| builder.append_slice(row));
    builder.finish().into_column()
}

/// The whole file, if it is not too large.
pub(super) fn read_bounded(path: &Path) -> Result<Vec<u8>, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(format!("it is larger than {} MiB", MAX_BYTES >> 20));
    }
    Ok(bytes)
}

/// A Parquet file's columns, with its metadata.
pub(super) struct Frame {
    pub(super) columns: DataFrame,
    pub(super) provenance: Vec<(String, String)>,
}

impl Frame {
    /// The file `bytes`. Errors: it is no Parquet or too long.
    pub(super) fn read(bytes: Vec<u8>) -> Result<Self, String> {
        let said = |error: polars::error::PolarsError| format!("it is no readable Parquet: {error}");
        let mut reader = ParquetReader::new(Cursor::new(bytes)).read_parallel(ParallelStrategy::None);
        let metadata = reader.get_metadata().map_err(said)?.clone();
        if metadata.num_rows > MAX_STEPS {
            return Err(format!("it has {} rows; at most {MAX_STEPS} are read", metadata.num_rows));
        }
        let provenance = metadata
            .key_value_metadata()
            .iter()
            .flatten()
            .filter(|entry| !WRITERS_KEYS.contains(&entry.key.as_str()))
            .map(|entry| (entry.key.clone(), entry.value.clone().unwrap_or_default()))
            .collect();
        let columns = reader.set_rechunk(true).finish().map_err(said)?;
        Ok(Self { columns, provenance })
    }

    /// The demonstration that the columns are.
    fn into_demonstration(self) -> Result<Demonstration, String> {
        if self.columns.height() == 0 {
            return Err("it has no steps".into());
        }
        let demonstration = Demonstration {
            observations: self.lists("observation")?,
            actions: self.lists("action")?,
            rewards: if self.has("reward") { Some(self.numbers("reward")?) } else { None },
            episode_starts: self.episode_starts()?,
            terminated: self.flags("terminated")?,
            truncated: self.flags("truncated")?,
            poses: self.poses()?,
            provenance: self.provenance,
        };
        match demonstration.flaw() {
            Some(flaw) => Err(flaw),
            None => Ok(demonstration),
        }
    }

    /// Whether there is a column `name`.
    pub(super) fn has(&self, name: &str) -> bool {
        self.columns.column(name).is_ok()
    }

    /// The column `name`.
    fn column(&self, name: &str) -> Result<&Series, String> {
        self.columns.column(name).map(Column::as_materialized_series).map_err(|_| {
            let names: Vec<&str> = self.columns.get_column_names().into_iter().map(|name| name.as_str()).collect();
            format!("it has no column `{name}`; it has {}", names.join(", "))
        })
    }

    /// What to say of a column of another type.
    fn wrong_type(series: &Series, expected: &str) -> String {
        format!("its column `{}` holds {}; expected {expected}", series.name(), series.dtype())
    }

    /// The numbers of column `name`.
    pub(super) fn numbers(&self, name: &str) -> Result<Vec<f64>, String> {
        let series = self.column(name)?;
        let values = series.f64().map_err(|_| Self::wrong_type(series, "f64"))?;
        values.iter().collect::<Option<_>>().ok_or_else(|| format!("its column `{name}` has gaps"))
    }

    /// The truth values of column `name`.
    pub(super) fn flags(&self, name: &str) -> Result<Vec<bool>, String> {
        let series = self.column(name)?;
        let values = series.bool().map_err(|_| Self::wrong_type(series, "bool"))?;
        values.iter().collect::<Option<_>>().ok_or_else(|| format!("its column `{name}` has gaps"))
    }

    /// The whole numbers of column `name`, of whichever integer type a writer preferred.
    fn whole_numbers(&self, name: &str) -> Result<Vec<i64>, String> {
        let series = self.column(name)?;
        if !series.dtype().is_integer() {
            return Err(Self::wrong_type(series, "a whole number"));
        }
        let values =
            series.cast(&DataType::Int64).map_err(|_| Self::wrong_type(series, "a whole number below 2^63"))?;
        let values = values.i64().map_err(|_| Self::wrong_type(series, "a whole number"))?;
        values.iter().collect::<Option<_>>().ok_or_else(|| format!("its column `{name}` has gaps"))
    }

    /// The lists of column `name`, one a column of the matrix.
    pub(super) fn lists(&self, name: &str) -> Result<DMatrix<f64>, String> {
        let series = self.column(name)?;
        let expected = "a list of f64";
        let lists = series.list().map_err(|_| Self::wrong_type(series, expected))?;
        let n = lists.len();
        let mut numbers = Vec::new();
        for (i, list) in lists.amortized_iter().enumerate() {
            let list = list.ok_or_else(|| format!("its column `{name}` has gaps"))?;
            let values = list.as_ref().f64().map_err(|_| Self::wrong_type(series, expected))?;
            let values = values.cont_slice().map_err(|_| format!("a list in its column `{name}` has gaps"))?;
            let width = if i == 0 { values.len() } else { numbers.len() / i };
            if values.len() != width {
                return Err(format!(
                    "its column `{name}` has {} numbers in row {i} and {width} before; all rows need as many",
                    values.len()
                ));
            }
            numbers.extend_from_slice(values);
        }
        Ok(DMatrix::from_vec(numbers.len() / n, n, numbers))
    }

    /// Where episodes start: where `step` is 0 and `episode` rises.
    fn episode_starts(&self) -> Result<Vec<usize>, String> {
        let (episodes, steps) = (self.whole_numbers("episode")?, self.whole_numbers("step")?);
        let mut starts = Vec::new();
        for (row, (episode, &step)) in episodes.iter().zip(&steps).enumerate() {
            let goes_on = row > 0 && episodes[row - 1] == *episode;
            if row > 0 && episodes[row - 1] > *episode {
                return Err(format!(
                    "episode {episode} comes after episode {} in row {row}; episodes must be whole and in order",
                    episodes[row - 1]
                ));
            }
            let expected = if goes_on { steps[row - 1] + 1 } else { 0 };
            if step != expected {
                return Err(format!("row {row} is step {step} of episode {episode}; expected step {expected}"));
            }
            if !goes_on {
                starts.push(row);
            }
        }
        Ok(starts)
    }

    /// The poses, if they were recorded.
    pub(super) fn poses(&self) -> Result<Option<Vec<Pose>>, String> {
        if !self.has("qpos") && !self.has("qvel") {
            return Ok(None);
        }
        let (qpos, qvel) = (self.lists("qpos")?, self.lists("qvel")?);
        let rows = qpos.column_iter().zip(qvel.column_iter());
        Ok(Some(rows.map(|(q, v)| Pose { qpos: q.as_slice().to_vec(), qvel: v.as_slice().to_vec() }).collect()))
    }
}
