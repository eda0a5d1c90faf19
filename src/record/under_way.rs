//! The rows of a run that has not ended, for those who look at it meanwhile.

use super::{Checkpoint, Manifest, RecordError, RunPaths};
use crate::train::{EvaluationEpisode, Iteration};

/// The progress of a run under way: the rows of its last checkpoint, which is replaced whole every
/// `checkpoint.every_seconds`.
/// They lie in `<id>.partial/checkpoint` and in no table, so that whoever scans tables does not
/// meet half a run.
#[derive(Debug, Clone, PartialEq)]
pub struct UnderWay {
    /// The manifest of its last attempt, with the specification of these rows.
    pub manifest: Manifest,
    /// The iterations so far.
    pub iterations: Vec<Iteration>,
    /// The evaluation episodes so far, without the last evaluation.
    pub evaluations: Vec<EvaluationEpisode>,
}

impl UnderWay {
    /// The rows of the run at `paths`; `None` if none is under way or interrupted, or it has no
    /// checkpoint yet.
    ///
    /// A finished run that is being extended has its tables, and the longer run's rows here.
    ///
    /// # Errors
    ///
    /// Its files are damaged or of another program.
    pub fn read(paths: &RunPaths) -> Result<Option<Self>, RecordError> {
        let Some(manifest) = Manifest::read(&RunPaths::manifest(&paths.partial))? else {
            return Ok(None);
        };
        let checkpoint = Checkpoint::read(
            &RunPaths::checkpoint(&paths.partial),
            &manifest.stamp.fingerprint,
        )?;
        Ok(checkpoint.map(
            |Checkpoint {
                 iterations,
                 evaluations,
                 ..
             }| Self {
                manifest,
                iterations,
                evaluations,
            },
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::rows::tests::{episode, iteration, stamp};

    #[test]
    fn the_rows_of_the_last_checkpoint_are_there_and_damage_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let paths = RunPaths::new(folder.path(), "e", "a/b").expect("a good id");
        assert_eq!(UnderWay::read(&paths).expect("absence is no error"), None);
        paths.open().expect("made");
        let manifest = Manifest::new(stamp());
        manifest
            .write(&RunPaths::manifest(&paths.partial))
            .expect("written");
        assert_eq!(
            UnderWay::read(&paths).expect("no checkpoint is no error"),
            None
        );
        let (iterations, evaluations) = (vec![iteration(1)], vec![episode(0)]);
        let checkpoint = Checkpoint {
            iterations: iterations.clone(),
            evaluations: evaluations.clone(),
            ..Checkpoint::default()
        };
        let path = RunPaths::checkpoint(&paths.partial);
        checkpoint.write(&path, "f").expect("written");
        let read = UnderWay::read(&paths).expect("readable");
        assert_eq!(
            read,
            Some(UnderWay {
                manifest,
                iterations,
                evaluations
            })
        );
        let whole = std::fs::read(&path).expect("readable");
        std::fs::write(&path, &whole[..whole.len() - 1]).expect("cut");
        assert!(matches!(
            UnderWay::read(&paths),
            Err(RecordError::Damaged { .. })
        ));
    }
}
