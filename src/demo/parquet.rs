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
//! Provenance is the file's key-value metadata. Other columns are ignored; a flawed file is an
//! error that says what was expected.
//!
//! polars writes the files; [`crate::parquet`] reads them, since they come from strangers.

use std::{fs::Permissions, io, path::Path};

use nalgebra::DMatrix;
use polars::prelude::{
    Column, DataFrame, DataType, Float64Type, IntoColumn, KeyValueMetadata, ListBuilderTrait,
    ListPrimitiveChunkedBuilder, ParquetWriter,
};

use super::{DemoError, Demonstration, Flaw, ReadError, WriteError};
use crate::{
    env::Pose,
    intake::{self, Links},
    parquet::{ParquetError, Table},
};

/// The largest file that is read, bytes: ten times 20,000 steps of Ant.
const MAX_BYTES: u64 = 1 << 30;

impl Demonstration {
    /// Writes the Parquet file `path`, whole or not at all.
    ///
    /// # Errors
    ///
    /// The folder or the disk refuses, or the fields contradict each other.
    pub fn write(&self, path: &Path) -> Result<(), DemoError> {
        self.write_whole(path)
            .map_err(|source| DemoError::Unwritable {
                path: path.to_owned(),
                source,
            })
    }

    fn write_whole(&self, path: &Path) -> Result<(), WriteError> {
        self.is_sound()?;
        let mut frame = self.to_frame()?;
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let mut file = beside(folder)?;
        ParquetWriter::new(file.as_file_mut())
            .with_key_value_metadata(Some(KeyValueMetadata::from_static(self.provenance.clone())))
            .finish(&mut frame)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    }

    /// Reads the Parquet file `path`.
    ///
    /// # Errors
    ///
    /// It is missing, larger than 1 GiB, no Parquet, damaged, or not in this format: a column is
    /// missing or has another type, rows differ in length, a number is not finite, episodes are
    /// torn apart.
    pub fn read(path: &Path) -> Result<Self, DemoError> {
        read_bounded(path)
            .map_err(ReadError::from)
            .and_then(from_bytes)
            .map_err(unreadable(path))
    }

    /// The BLAKE3 digest of the file `path`, whatever its content.
    ///
    /// # Errors
    ///
    /// It is missing, no regular file, or larger than 1 GiB.
    pub fn digest(path: &Path) -> Result<String, DemoError> {
        let bytes = read_bounded(path).map_err(|error| unreadable(path)(error.into()))?;
        Ok(blake3::hash(&bytes).to_hex().to_string())
    }

    /// The demonstration as a table, one row a step.
    pub(super) fn to_frame(&self) -> Result<DataFrame, polars::error::PolarsError> {
        let (mut episodes, mut steps) = (
            Vec::with_capacity(self.len()),
            Vec::with_capacity(self.len()),
        );
        for (episode, range) in self.episodes().enumerate() {
            episodes.extend(range.clone().map(|_| episode as i64));
            steps.extend((0..range.len()).map(|step| step as i64));
        }
        let rows = |matrix: &DMatrix<f64>, name: &str| {
            lists(
                name,
                matrix.nrows(),
                self.len(),
                matrix.as_slice().chunks_exact(matrix.nrows()),
            )
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
            columns.push(lists(
                "qpos",
                nq,
                self.len(),
                poses.iter().map(|pose| pose.qpos.as_slice()),
            ));
            columns.push(lists(
                "qvel",
                nv,
                self.len(),
                poses.iter().map(|pose| pose.qvel.as_slice()),
            ));
        }
        DataFrame::new(self.len(), columns)
    }
}

/// An unnamed file in `folder`, readable as the user's other files are (a bare temporary file is
/// its owner's alone).
fn beside(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(Permissions::from_mode(0o666)); // less the umask
    }
    builder.tempfile_in(folder)
}

/// A column of `n` lists of `width` numbers.
fn lists<'a>(name: &str, width: usize, n: usize, rows: impl Iterator<Item = &'a [f64]>) -> Column {
    let mut builder = ListPrimitiveChunkedBuilder::<Float64Type>::new(
        name.into(),
        n,
        n * width,
        DataType::Float64,
    );
    rows.for_each(|row| builder.append_slice(row));
    builder.finish().into_column()
}

/// The content of the file, unless that is too large.
pub(super) fn read_bounded(path: &Path) -> io::Result<Vec<u8>> {
    intake::read(path, Links::Follow, MAX_BYTES)
}

/// Turns a [`ReadError`] into a [`DemoError`] with the file.
pub(super) fn unreadable(path: &Path) -> impl FnOnce(ReadError) -> DemoError {
    let path = path.to_owned();
    move |source| DemoError::Unreadable { path, source }
}

/// The demonstration in the content of a file.
pub(super) fn from_bytes(file: Vec<u8>) -> Result<Demonstration, ReadError> {
    let table = Table::new(file)?;
    if table.rows() == 0 {
        return Err(Flaw::NoSteps.into());
    }
    let demonstration = Demonstration {
        observations: table.lists("observation")?,
        actions: table.lists("action")?,
        rewards: if table.has("reward") {
            Some(table.numbers("reward")?)
        } else {
            None
        },
        episode_starts: episode_starts(
            &table.whole_numbers("episode")?,
            &table.whole_numbers("step")?,
        )?,
        terminated: table.flags("terminated")?,
        truncated: table.flags("truncated")?,
        poses: poses(&table)?,
        provenance: table.notes(),
    };
    demonstration.is_sound()?;
    Ok(demonstration)
}

/// The first steps of episodes: where `steps` is 0 and `episodes` rises.
fn episode_starts(episodes: &[i64], steps: &[i64]) -> Result<Vec<usize>, Flaw> {
    let mut starts = Vec::new();
    for (row, (&episode, &step)) in episodes.iter().zip(steps).enumerate() {
        let before = row
            .checked_sub(1)
            .map(|before| (episodes[before], steps[before]));
        let expected = match before {
            Some((before, _)) if before > episode => {
                return Err(Flaw::TornEpisode {
                    row,
                    episode,
                    before,
                });
            }
            Some((before, step)) if before == episode => step + 1,
            _ => 0,
        };
        if step != expected {
            return Err(Flaw::OutOfStep {
                row,
                episode,
                step,
                expected,
            });
        }
        if step == 0 {
            starts.push(row);
        }
    }
    Ok(starts)
}

/// The poses, if they were recorded.
fn poses(table: &Table) -> Result<Option<Vec<Pose>>, ParquetError> {
    if !table.has("qpos") && !table.has("qvel") {
        return Ok(None);
    }
    let (qpos, qvel) = (table.lists("qpos")?, table.lists("qvel")?);
    let rows = qpos.column_iter().zip(qvel.column_iter());
    Ok(Some(
        rows.map(|(q, v)| Pose {
            qpos: q.as_slice().to_vec(),
            qvel: v.as_slice().to_vec(),
        })
        .collect(),
    ))
}
