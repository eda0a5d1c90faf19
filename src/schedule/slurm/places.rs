//! The places of runs in the cluster: our requests, joined with Slurm's answers.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    path::{Path, PathBuf},
};

use super::{
    super::{state::Planned, submission},
    SlurmError,
    jobs::Asked,
    queue::{self, Row, Stage},
};
use crate::{record::RecordError, schedule::submission::Submission};

/// The element of a submission that a run belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The submission's folder.
    pub folder: PathBuf,
    /// The element's number in the submission.
    pub element: usize,
    /// The job and the index in its array; absent where it was never sent.
    pub job: Option<(String, usize)>,
    is_cancelled: bool,
    row: Option<Row>,
}

/// The cluster's view of a run that, by its own files, has not ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fate {
    /// Its element waits, for this reason.
    Waits(String),
    /// Its element is under way on these nodes.
    Runs(String),
    /// Its element has ended in this way.
    Ended(String),
    /// It was cancelled by this program.
    Cancelled,
    /// Slurm no longer knows of this job.
    Lost(String),
    /// It was never sent.
    Unsent,
}

impl Place {
    /// The cluster's view of the run.
    pub fn fate(&self) -> Fate {
        let Some((job, index)) = &self.job else {
            return Fate::Unsent;
        };
        match &self.row {
            Some(row) if row.stage() == Stage::Waits => Fate::Waits(row.reason.clone()),
            Some(row) if row.stage() == Stage::Runs => Fate::Runs(row.nodes.clone()),
            _ if self.is_cancelled => Fate::Cancelled,
            Some(row) => Fate::Ended(row.ending()),
            None => Fate::Lost(format!("{job}_{index}")),
        }
    }

    /// Whether the cluster runs its element, or will run it.
    pub fn is_taken(&self) -> bool {
        matches!(self.fate(), Fate::Waits(_) | Fate::Runs(_))
    }
}

/// The places of those of `runs`, all of one `experiment`, that were submitted, by their ids. Each
/// place is in the last submission that holds the run as it is planned now.
///
/// # Errors
///
/// A submission cannot be read, or Slurm does not answer.
pub fn places(
    results: &Path,
    experiment: &str,
    runs: &[&Planned],
) -> Result<HashMap<String, Place>, PlacesError> {
    let wanted: HashMap<&str, &str> = runs
        .iter()
        .map(|run| (run.spec.id.as_str(), run.stamp.fingerprint.as_str()))
        .collect();
    let mut places = HashMap::new();
    // Earlier submissions come first, so that later ones replace their places.
    for folder in submission::folders(results, experiment)? {
        let asked = Asked::read(&folder)?;
        let cancelled: BTreeSet<usize> = asked.iter().flat_map(Asked::cancelled).copied().collect();
        for (element, runs) in Submission::names(&Submission::plan(&folder))?
            .into_iter()
            .enumerate()
        {
            let job = asked.iter().find_map(|asked| asked.holds(element));
            for run in runs
                .iter()
                // Another fingerprint is another run, whatever its name.
                .filter(|run| wanted.get(run.id()) == Some(&run.fingerprint.as_str()))
            {
                let (folder, is_cancelled) = (folder.clone(), cancelled.contains(&element));
                let place = Place {
                    folder,
                    element,
                    job: job.clone(),
                    is_cancelled,
                    row: None,
                };
                places.insert(run.id().to_owned(), place);
            }
        }
    }
    // All jobs are asked for at once, since each question starts a command of Slurm's.
    let jobs: BTreeSet<String> = places
        .values()
        .filter_map(|place| Some(place.job.as_ref()?.0.clone()))
        .collect();
    if !jobs.is_empty() {
        let rows = queue::rows(&jobs.into_iter().collect::<Vec<_>>())?;
        for place in places.values_mut() {
            place.row = place.job.as_ref().and_then(|job| rows.get(job)).cloned();
        }
    }
    Ok(places)
}

/// Errors of finding the places of runs.
#[derive(Debug, thiserror::Error)]
pub enum PlacesError {
    /// A submission cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Slurm does not answer.
    #[error(transparent)]
    Slurm(#[from] SlurmError),
}

impl Asked {
    /// The job and the index under which the cluster knows `element`, if this request is for it.
    fn holds(&self, element: usize) -> Option<(String, usize)> {
        match self {
            Self::Array { job, first, count } if (*first..first + count).contains(&element) => {
                Some((job.clone(), element - first))
            }
            _ => None,
        }
    }

    fn cancelled(&self) -> &[usize] {
        match self {
            Self::Cancel { elements } => elements,
            _ => &[],
        }
    }
}

/// The elements of `places` by submission: the names by which `scancel` knows them, and their
/// numbers in the submission.
pub fn elements<'a>(
    places: impl Iterator<Item = &'a Place>,
) -> BTreeMap<PathBuf, (BTreeSet<String>, BTreeSet<usize>)> {
    let mut elements: BTreeMap<PathBuf, (BTreeSet<String>, BTreeSet<usize>)> = BTreeMap::new();
    for place in places {
        let Some((job, index)) = &place.job else {
            continue;
        };
        let (names, numbers) = elements.entry(place.folder.clone()).or_default();
        names.insert(format!("{job}_{index}"));
        numbers.insert(place.element);
    }
    elements
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A place in job 12 of which Slurm says `state`, or nothing.
    pub(crate) fn place(state: Option<&str>, is_cancelled: bool) -> Place {
        let row = state.map(|state| Row {
            state: state.to_owned(),
            status: 0,
            nodes: "n1".to_owned(),
            reason: "Resources".to_owned(),
        });
        let job = Some(("12".to_owned(), 3));
        Place {
            folder: PathBuf::new(),
            element: 3,
            job,
            is_cancelled,
            row,
        }
    }

    #[test]
    fn no_row_is_a_lost_job_unless_it_was_cancelled_and_no_job_was_never_sent() {
        assert_eq!(place(None, false).fate(), Fate::Lost("12_3".to_owned()));
        assert_eq!(place(None, true).fate(), Fate::Cancelled);
        assert_eq!(
            Place {
                job: None,
                ..place(None, false)
            }
            .fate(),
            Fate::Unsent
        );
        assert_eq!(
            place(Some("PENDING"), false).fate(),
            Fate::Waits("Resources".to_owned())
        );
        assert_eq!(
            place(Some("RUNNING"), true).fate(),
            Fate::Runs("n1".to_owned()),
            "it has not ended yet"
        );
        assert_eq!(place(Some("CANCELLED"), true).fate(), Fate::Cancelled);
        assert!(matches!(
            place(Some("COMPLETED"), false).fate(),
            Fate::Ended(how) if how.contains("COMPLETED")
        ));
        assert!(place(Some("PENDING"), false).is_taken());
        assert!(!place(Some("COMPLETED"), false).is_taken() && !place(None, false).is_taken());
    }

    #[test]
    fn an_element_is_known_by_its_place_in_the_array_that_it_was_sent_with() {
        let array = Asked::Array {
            job: "12".to_owned(),
            first: 1000,
            count: 5,
        };
        assert_eq!(array.holds(999), None);
        assert_eq!(array.holds(1004), Some(("12".to_owned(), 4)));
        assert_eq!(array.holds(1005), None);
    }
}
