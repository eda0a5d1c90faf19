//! What has become of a run so far, from what lies on the disk.

use crate::{
    plan::{self, RunSpec},
    record::{Checkpoint, Claim, Heartbeat, Manifest, Outcome, RecordError, RunPaths, Stamp},
};

/// What differs where no key does.
const DEMONSTRATION: &str = "the demonstration's content";

/// A run with everything that its process needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// What is to be run.
    pub spec: RunSpec,
    /// Where it is recorded.
    pub paths: RunPaths,
    /// What its files carry: the fingerprint among it.
    pub stamp: Stamp,
}

/// What has become of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum RunState {
    /// Nothing is recorded.
    ToDo,
    /// It goes on from a checkpoint.
    Interrupted {
        /// The checkpoint's environment steps.
        env_steps: u64,
    },
    /// A process works on it.
    Running(Option<Heartbeat>),
    /// It is recorded.
    Finished(Manifest),
    /// It ended in an error; the next call tries again.
    Failed(Manifest),
    /// What is recorded was another specification.
    Differs {
        /// The keys that differ, as `key: recorded, and now asked for`.
        keys: Vec<String>,
    },
    /// What is recorded cannot be read.
    Unusable {
        /// Why not.
        reason: String,
    },
}

impl Planned {
    /// What has become of it.
    ///
    /// Errors: the system refuses to read what is there.
    pub fn state(&self) -> Result<RunState, RecordError> {
        let held = Claim::is_held(&self.paths)?;
        match self.recorded(held) {
            Err(error @ RecordError::Malformed { .. }) => Ok(RunState::Unusable { reason: error.to_string() }),
            state => state,
        }
    }

    fn recorded(&self, held: bool) -> Result<RunState, RecordError> {
        if let Some(manifest) = self.paths.ended()? {
            if let Some(differs) = self.differs(&manifest) {
                return Ok(differs);
            }
            return Ok(match manifest.outcome {
                Outcome::Finished => RunState::Finished(manifest),
                // Killed between its last word and the renaming, or taken up again at this very instant.
                Outcome::Failed { .. } | Outcome::Begun => RunState::Failed(manifest),
            });
        }
        let manifest = Manifest::read(&RunPaths::manifest(&self.paths.partial))?;
        if let Some(differs) = manifest.as_ref().and_then(|manifest| self.differs(manifest)) {
            return Ok(differs);
        }
        if held {
            return Ok(RunState::Running(Heartbeat::read(&RunPaths::heartbeat(&self.paths.partial))));
        }
        let checkpoint = Checkpoint::read(&RunPaths::checkpoint(&self.paths.partial), &self.stamp.fingerprint)?;
        Ok(checkpoint.map_or(RunState::ToDo, |checkpoint| RunState::Interrupted { env_steps: checkpoint.env_steps() }))
    }

    fn differs(&self, manifest: &Manifest) -> Option<RunState> {
        if manifest.stamp.fingerprint == self.stamp.fingerprint {
            return None;
        }
        let mut keys = self.differences(&manifest.stamp);
        let (before, after) = (&manifest.stamp.build.versions, &self.stamp.build.versions);
        keys.extend((before != after).then(|| format!("versions: {before} -> {after}")));
        if keys.is_empty() {
            // Older programs recorded it in the fingerprint alone.
            keys.push(DEMONSTRATION.to_owned());
        }
        Some(RunState::Differs { keys })
    }

    /// In what this run differs from the one that left `recorded`, the versions of what computes it apart; empty when it is the
    /// same run.
    pub fn differences(&self, recorded: &Stamp) -> Vec<String> {
        let mut keys = match serde_json::from_value(recorded.spec.clone()) {
            Ok(recorded) => plan::differences(&recorded, &self.spec),
            Err(_) => vec!["the specification's format".to_owned()],
        };
        let digests = recorded.demonstration.as_ref().zip(self.stamp.demonstration.as_ref());
        keys.extend(digests.filter(|(before, after)| before != after).map(|_| DEMONSTRATION.to_owned()));
        keys
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::{quantity::constant, schedule::tests::planned};

    #[test]
    fn what_was_another_run_is_told_by_the_keys_that_differ() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut run = planned(folder.path(), "e", 0);
        run.paths.open().expect("made");
        run.paths.close(&Manifest { outcome: Outcome::Finished, ..Manifest::new(run.stamp.clone()) }).expect("closed");
        assert!(matches!(run.state(), Ok(RunState::Finished(_))));
        run.spec.budget.env_steps = constant(2048);
        run.stamp.fingerprint = "another".to_owned();
        let Ok(RunState::Differs { keys }) = run.state() else { panic!("{:?}", run.state()) };
        assert_eq!(keys, ["budget.env_steps: 1024 -> 2048"]);
    }

    #[test]
    fn an_interrupted_run_is_known_by_its_checkpoint_and_a_damaged_one_is_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = planned(folder.path(), "e", 0);
        assert_eq!(run.state().ok(), Some(RunState::ToDo));
        run.paths.open().expect("made");
        assert_eq!(run.state().ok(), Some(RunState::ToDo));
        let path = RunPaths::checkpoint(&run.paths.partial);
        let checkpoint =
            Checkpoint { iterations: vec![crate::record::rows::tests::iteration(2)], ..Checkpoint::default() };
        checkpoint.write(&path, &run.stamp.fingerprint).expect("written");
        assert_eq!(run.state().ok(), Some(RunState::Interrupted { env_steps: 200 }));
        let claim = Claim::take(&run.paths).expect("made").expect("free");
        assert_eq!(run.state().ok(), Some(RunState::Running(None)));
        drop(claim);
        fs::write(&path, "mcpo-run checkpoint 99\n").expect("written");
        let Ok(RunState::Unusable { reason }) = run.state() else { panic!("{:?}", run.state()) };
        assert!(reason.contains("version 99"), "{reason}");
    }
}
