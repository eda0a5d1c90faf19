//! A frozen plan: the runs of a cluster's elements, independent of later changes to the matrix
//! file, the program and the shell.
//!
//! It is one file, of which an element reads two short pieces, however many elements there are: the
//! first line, with the common settings and the length of each element's line, and the element's
//! own line with its runs.

use std::{
    ffi::OsString,
    fs::{self, File},
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::state::Planned;
use crate::{
    plan::RunSpec,
    record::{
        Build, Demonstrated, Origin, RecordError, RunPaths, Stamp, experiment_folder, io_error,
        write_atomically,
    },
};

/// The version of the format.
const FORMAT: u32 = 1;

/// The common settings of all elements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Submission {
    /// The version of the format.
    format: u32,
    /// The experiment.
    pub experiment: String,
    /// The folder of all results.
    pub results: OsString,
    /// The folder at which relative paths start.
    pub folder: OsString,
    /// Who submitted it, and where.
    pub origin: Origin,
    /// Cores of an element.
    pub cpus: usize,
    /// How often a run that failed is tried again.
    pub retries: u32,
    /// Whether logs hold every iteration.
    pub verbose: bool,
    /// The length of each element's line, bytes.
    elements: Vec<usize>,
}

/// A run of an element. It has no facts about the machine, which the one that computes the run
/// adds.
#[derive(Debug, Serialize, Deserialize)]
struct Frozen {
    spec: Value,
    fingerprint: String,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    demonstration: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    demonstrated: Option<Demonstrated>,
    versions: Value,
}

/// The names of a run, without the rest of its specification.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Named {
    /// The names in its specification.
    spec: NamedSpec,
    /// The fingerprint, which covers everything that decides its numbers.
    pub fingerprint: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
struct NamedSpec {
    id: String,
}

impl Named {
    /// The run's id.
    pub fn id(&self) -> &str {
        &self.spec.id
    }
}

impl Submission {
    /// A submission to be frozen; its elements are counted then.
    pub fn new(
        experiment: &str,
        results: &Path,
        folder: &Path,
        cpus: usize,
        retries: u32,
        verbose: bool,
    ) -> Self {
        Self {
            format: FORMAT,
            experiment: experiment.to_owned(),
            results: results.into(),
            folder: folder.into(),
            origin: Origin::current(results),
            cpus,
            retries,
            verbose,
            elements: Vec::new(),
        }
    }

    /// The folder of all submissions of an experiment.
    ///
    /// # Errors
    ///
    /// The experiment's name would lead elsewhere.
    pub fn all(results: &Path, experiment: &str) -> Result<PathBuf, RecordError> {
        Ok(experiment_folder(results, experiment)?.join(".slurm"))
    }

    /// The frozen plan in the folder of a submission.
    pub fn plan(folder: &Path) -> PathBuf {
        folder.join("plan.jsonl")
    }

    /// The number of elements.
    pub fn elements(&self) -> usize {
        self.elements.len()
    }

    /// Freezes the submission with its `elements` in `folder`.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn freeze(
        mut self,
        folder: &Path,
        elements: &[Vec<&Planned>],
    ) -> Result<Self, RecordError> {
        let path = Self::plan(folder);
        let refused = |error: serde_json::Error| io_error("write", &path)(error.into());
        let mut body = Vec::new();
        for element in elements {
            let before = body.len();
            let frozen: Vec<Frozen> = element.iter().map(|run| Frozen::of(&run.stamp)).collect();
            serde_json::to_writer(&mut body, &frozen).map_err(refused)?;
            body.push(b'\n');
            self.elements.push(body.len() - before);
        }
        let mut whole = serde_json::to_vec(&self).map_err(refused)?;
        whole.push(b'\n');
        whole.extend(body);
        write_atomically(&path, &whole)?;
        Ok(self)
    }

    /// Reads the common settings of all elements.
    ///
    /// # Errors
    ///
    /// The file is missing, or of another program.
    pub fn read(plan: &Path) -> Result<Self, RecordError> {
        Ok(open(plan)?.0)
    }

    /// Reads the common settings and the runs of the element `index`, for this machine.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read), or there is no such element.
    pub fn element(plan: &Path, index: usize) -> Result<(Self, Vec<Planned>), RecordError> {
        let (submission, mut reader) = open(plan)?;
        let Some(&length) = submission.elements.get(index) else {
            let reason = format!(
                "it has {} elements, and none of number {index}",
                submission.elements.len()
            );
            return Err(malformed(plan, reason));
        };
        let before: usize = submission.elements[..index].iter().sum();
        let offset = i64::try_from(before).map_err(|error| malformed(plan, error.to_string()))?;
        let mut line = Vec::new();
        reader
            .seek_relative(offset)
            .map_err(io_error("read", plan))?;
        reader
            .take(length as u64)
            .read_to_end(&mut line)
            .map_err(io_error("read", plan))?;
        let frozen: Vec<Frozen> = parsed(plan, &line)?;
        let runs = frozen
            .into_iter()
            .map(|run| submission.planned(plan, run))
            .collect::<Result<_, _>>()?;
        Ok((submission, runs))
    }

    /// The names of the runs of each element, in order.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn names(plan: &Path) -> Result<Vec<Vec<Named>>, RecordError> {
        let (_, reader) = open(plan)?;
        reader
            .split(b'\n')
            .map(|line| parsed(plan, &line.map_err(io_error("read", plan))?))
            .collect()
    }

    fn planned(&self, plan: &Path, run: Frozen) -> Result<Planned, RecordError> {
        let spec: RunSpec =
            serde_json::from_value(run.spec.clone()).map_err(|e| malformed(plan, e.to_string()))?;
        let paths = RunPaths::new(self.results.as_ref(), &spec.experiment, &spec.id)?;
        let stamp = Stamp {
            spec: run.spec,
            fingerprint: run.fingerprint,
            demonstration: run.demonstration,
            demonstrated: run.demonstrated,
            build: Build::current(run.versions),
            origin: Some(self.origin.clone().here()),
        };
        Ok(Planned { spec, paths, stamp })
    }
}

impl Frozen {
    fn of(stamp: &Stamp) -> Self {
        Self {
            spec: stamp.spec.clone(),
            fingerprint: stamp.fingerprint.clone(),
            demonstration: stamp.demonstration.clone(),
            demonstrated: stamp.demonstrated.clone(),
            versions: stamp.build.versions.clone(),
        }
    }
}

/// The head of the plan, and a reader positioned after it.
fn open(plan: &Path) -> Result<(Submission, BufReader<File>), RecordError> {
    let mut reader = BufReader::new(File::open(plan).map_err(io_error("read", plan))?);
    let mut head = Vec::new();
    reader
        .read_until(b'\n', &mut head)
        .map_err(io_error("read", plan))?;
    let submission: Submission = parsed(plan, &head)?;
    match submission.format {
        FORMAT => Ok((submission, reader)),
        other => Err(malformed(
            plan,
            format!("it is of version {other}, and this program reads version {FORMAT}"),
        )),
    }
}

fn parsed<T: serde::de::DeserializeOwned>(plan: &Path, line: &[u8]) -> Result<T, RecordError> {
    serde_json::from_slice(line).map_err(|error| malformed(plan, error.to_string()))
}

fn malformed(plan: &Path, reason: String) -> RecordError {
    RecordError::Malformed {
        path: plan.to_owned(),
        expected: "a frozen plan",
        reason,
    }
}

/// The folders of all submissions of an experiment, the first one first.
///
/// # Errors
///
/// The system refuses.
pub fn folders(results: &Path, experiment: &str) -> Result<Vec<PathBuf>, RecordError> {
    let all = Submission::all(results, experiment)?;
    let entries = match fs::read_dir(&all) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(io_error("read", &all)(error)),
    };
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|folder| Submission::plan(folder).exists())
        .collect();
    folders.sort();
    Ok(folders)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::tests::planned;

    #[test]
    fn an_element_finds_its_runs_as_they_were_planned_and_no_others() {
        let folder = tempfile::tempdir().expect("a folder");
        let results = folder.path().join("results");
        let runs: Vec<Planned> = (0..5).map(|seed| planned(&results, "e", seed)).collect();
        let elements: Vec<Vec<&Planned>> =
            runs.chunks(2).map(|runs| runs.iter().collect()).collect();
        let frozen = Submission::new("e", &results, folder.path(), 1, 0, false);
        frozen.freeze(folder.path(), &elements).expect("written");
        let plan = Submission::plan(folder.path());
        for (index, expected) in elements.iter().enumerate() {
            let (submission, found) = Submission::element(&plan, index).expect("there");
            assert_eq!((submission.elements(), found.len()), (3, expected.len()));
            for (found, expected) in found.iter().zip(expected) {
                assert_eq!(
                    (&found.spec, &found.paths),
                    (&expected.spec, &expected.paths)
                );
                assert_eq!(found.stamp.fingerprint, expected.stamp.fingerprint);
            }
        }
        let message = Submission::element(&plan, 3)
            .expect_err("no such element")
            .to_string();
        assert!(message.contains("none of number 3"), "{message}");
        let names: Vec<String> = Submission::names(&plan)
            .expect("there")
            .concat()
            .iter()
            .map(|n| n.id().into())
            .collect();
        assert_eq!(
            names,
            runs.iter()
                .map(|run| run.spec.id.clone())
                .collect::<Vec<_>>()
        );
    }

    #[test]
    fn what_is_no_plan_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let plan = Submission::plan(folder.path());
        assert!(Submission::read(&plan).is_err(), "there is none");
        for text in ["", "{}\n", "{\"format\":1}\n"] {
            fs::write(&plan, text).expect("written");
            assert!(Submission::read(&plan).is_err(), "{text}");
        }
    }
}
