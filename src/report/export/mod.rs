//! Recorded results in the formats of other programs.
//!
//! Owns the files that TensorBoard, rliable, marl-eval and spreadsheets read. Knows nothing of
//! tables or verdicts. Start at [`export`]. Everything is written into `export` within the
//! report's folder, which is made anew each time.

mod rows;
mod scores;
mod tensorboard;
#[cfg(test)]
mod tests;

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    CurveData, ReportError, Scope,
    files::refuse_link,
    recorded::{self, Run},
    write::{figures, identities, planned, selected},
};
use crate::{
    measured::progress,
    record::{self, RecordError},
    spec::ExperimentSpec,
};

/// A format of another program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// Event files with hyperparameters, one per run.
    Tensorboard,
    /// Scores by method, seed and environment.
    Rliable,
    /// Every evaluation by environment, method and seed.
    MarlEval,
    /// Every evaluation as a row.
    Csv,
    /// The numbers of each figure.
    Json,
}

impl Format {
    /// Every format, in the order in which they are written.
    pub const ALL: [Self; 5] = [
        Self::Tensorboard,
        Self::Rliable,
        Self::MarlEval,
        Self::Csv,
        Self::Json,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tensorboard => "tensorboard",
            Self::Rliable => "rliable",
            Self::MarlEval => "marl-eval",
            Self::Csv => "csv",
            Self::Json => "json",
        }
    }

    /// A short description of its contents, for the command line's help.
    pub fn help(self) -> &'static str {
        match self {
            Self::Tensorboard => "Event files with hyperparameters, for TensorBoard",
            Self::Rliable => "Scores by method, seed and environment, as rliable reads them",
            Self::MarlEval => "Every evaluation, as marl-eval reads them",
            Self::Csv => "Every evaluation episode as a row",
            Self::Json => "The numbers of each figure",
        }
    }
}

/// Writes the recorded results of `spec` within `scope` in these `formats`; returns the files.
///
/// # Errors
///
/// As for [`write()`](super::write()).
pub fn export(
    spec: &ExperimentSpec,
    results: &Path,
    scope: &Scope,
    formats: &[Format],
) -> Result<Vec<PathBuf>, ReportError> {
    let (home, whole, plan) = planned(spec, results, scope)?;
    let runs = recorded::load(&plan, results, progress::COLUMNS)?.runs;
    let folder = home.join(scope.folder());
    // Removing through a link would empty a folder elsewhere.
    refuse_link(&folder)?;
    let folder = folder.join("export");
    // An earlier export may have files that this one has not.
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(|source| io("remove", &folder, source))?;
    }
    let mut files = Vec::new();
    let mut write = |name: &str, bytes: &[u8]| -> Result<(), ReportError> {
        let path = folder.join(name);
        let parent = path.parent().unwrap_or(&folder);
        fs::create_dir_all(parent).map_err(|source| io("create", parent, source))?;
        record::write_atomically(&path, bytes)?;
        files.push(path);
        Ok(())
    };
    for format in formats {
        match format {
            Format::Tensorboard => {
                for run in runs.iter().filter(|run| run.recording().is_some()) {
                    // TensorBoard finds a file by `tfevents`. The time in the name is fixed, so
                    // that the same records give the same files.
                    let name = format!(
                        "tensorboard/{}/events.out.tfevents.0000000000.mcpo-run",
                        run.spec.id
                    );
                    write(&name, &tensorboard::events(run))?;
                }
            }
            Format::Rliable => write("rliable.json", text(&scores::rliable(&runs)).as_bytes())?,
            Format::MarlEval => write(
                "marl-eval.json",
                text(&scores::marl_eval(&spec.name, &runs)).as_bytes(),
            )?,
            Format::Csv => write("evaluations.csv", &rows::evaluations(&runs)?)?,
            Format::Json => {
                for figure in &figures(spec) {
                    // The sketch of a step draws nothing that was recorded.
                    let Some(y) = figure.y.measure() else {
                        continue;
                    };
                    let runs = selected(&runs, figure.only.as_ref());
                    let data = CurveData::new(figure, y, &runs, &identities(&whole));
                    write(
                        &format!("{}.json", figure.name),
                        text(&rows::figure(&data)).as_bytes(),
                    )?;
                }
            }
        }
    }
    Ok(files)
}

fn io(action: &'static str, path: &Path, source: std::io::Error) -> RecordError {
    RecordError::Io {
        action,
        path: path.to_owned(),
        source,
    }
}

fn text(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

/// The name of a run's method: its id without environment and seed.
fn method(run: &Run) -> &str {
    let of_env = run
        .spec
        .id
        .split_once('/')
        .map_or(run.spec.id.as_str(), |(_, rest)| rest);
    of_env.rsplit_once('/').map_or(of_env, |(method, _)| method)
}
