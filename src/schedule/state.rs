//! The state of a run, from its files on the disk.

use std::cmp::Ordering;

use serde_json::Value;

use crate::{
    plan::{self, RunSpec},
    record::{Checkpoint, Claim, Heartbeat, Manifest, Outcome, RecordError, RunPaths, Stamp},
};

/// The reported difference where no key differs.
const DEMONSTRATION: &str = "the demonstration's content";

/// A run with everything that its process needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The run's specification.
    pub spec: RunSpec,
    /// The places of its files.
    pub paths: RunPaths,
    /// The provenance that its files carry, with the fingerprint.
    pub stamp: Stamp,
}

/// The state of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum RunState {
    /// Nothing is recorded.
    ToDo,
    /// It was interrupted, and can continue from a checkpoint.
    Interrupted {
        /// The checkpoint's environment steps.
        env_steps: u64,
    },
    /// A process works on it.
    Running(Option<Heartbeat>),
    /// It has finished.
    Finished(Manifest),
    /// It finished with fewer steps than are asked for now.
    ToExtend {
        /// The manifest of the shorter run.
        shorter: Manifest,
        /// The environment steps that it continues from; absent where its last state was not kept,
        /// so that it starts again.
        env_steps: Option<u64>,
    },
    /// It ended in an error; the next call tries again.
    Failed(Manifest),
    /// Another specification is recorded in its place.
    Differs {
        /// The keys that differ, as `key: recorded, and now asked for`.
        keys: Vec<String>,
    },
    /// Its record is incomplete or damaged.
    Damaged {
        /// The evidence of the damage.
        reason: String,
    },
    /// Its record is of another program.
    Unusable {
        /// Why it cannot be used.
        reason: String,
    },
}

/// The state that a run continues from.
#[derive(Debug, Default)]
pub struct LastState {
    /// The checkpoint with the most steps.
    pub checkpoint: Option<Checkpoint>,
    /// The errors of checkpoints that can no longer be used.
    pub damaged: Vec<RecordError>,
}

/// Those of the `planned` runs, which are in these `states`, that have not finished.
pub fn unfinished<'a>(
    planned: &'a [Planned],
    states: &'a [RunState],
) -> impl Iterator<Item = (&'a Planned, &'a RunState)> {
    planned
        .iter()
        .zip(states)
        .filter(|(_, state)| !matches!(state, RunState::Finished(_)))
}

impl RunState {
    /// The environment steps that are recorded and count.
    pub fn steps_done(&self) -> u64 {
        match self {
            Self::Interrupted { env_steps } => *env_steps,
            Self::ToExtend { env_steps, .. } => env_steps.unwrap_or(0),
            Self::Running(heartbeat) => heartbeat
                .as_ref()
                .map_or(0, |heartbeat| heartbeat.env_steps),
            Self::Finished(manifest) => manifest.env_steps,
            Self::ToDo
            | Self::Failed(_)
            | Self::Differs { .. }
            | Self::Damaged { .. }
            | Self::Unusable { .. } => 0,
        }
    }
}

impl Planned {
    /// The state of the run on the disk.
    ///
    /// # Errors
    ///
    /// The system refuses to read the run's files.
    pub fn state(&self) -> Result<RunState, RecordError> {
        let held = Claim::is_held(&self.paths)?;
        match self.recorded(held) {
            Err(error @ RecordError::Malformed { .. }) => Ok(RunState::Unusable {
                reason: error.to_string(),
            }),
            Err(error @ RecordError::Damaged { .. }) => Ok(RunState::Damaged {
                reason: error.to_string(),
            }),
            state => state,
        }
    }

    fn recorded(&self, held: bool) -> Result<RunState, RecordError> {
        let ended = self.paths.ended()?;
        if let Some(differs) = ended.as_ref().and_then(|ended| self.differs(ended)) {
            return Ok(differs);
        }
        let shorter = match ended {
            Some(ended) if ended.outcome == Outcome::Finished => {
                ended.check_tables(&self.paths.complete)?;
                match self.spec.trained_steps().cmp(&ended.env_steps) {
                    Ordering::Equal => return Ok(RunState::Finished(ended)),
                    Ordering::Less => return Ok(self.is_longer(&ended.stamp, ended.env_steps)),
                    Ordering::Greater => Some(ended),
                }
            }
            // The process was killed after writing the manifest and before the renaming, or the run
            // is being resumed at this instant.
            Some(ended) => {
                self.last_state()?;
                return Ok(RunState::Failed(ended));
            }
            None => None,
        };
        let under_way = Manifest::read(&RunPaths::manifest(&self.paths.partial))?;
        if let Some(differs) = under_way
            .as_ref()
            .and_then(|manifest| self.differs(manifest))
        {
            return Ok(differs);
        }
        // The holder's heartbeat is newer than any of its checkpoints.
        if held {
            return Ok(RunState::Running(Heartbeat::read(&RunPaths::heartbeat(
                &self.paths.partial,
            ))));
        }
        let env_steps = self
            .last_state()?
            .checkpoint
            .map(|checkpoint| checkpoint.env_steps());
        Ok(match (under_way, shorter, env_steps) {
            (Some(manifest), ..) if manifest.error().is_some() => RunState::Failed(manifest),
            (Some(manifest), _, Some(env_steps)) if env_steps > self.spec.trained_steps() => {
                self.is_longer(&manifest.stamp, env_steps)
            }
            (_, Some(shorter), env_steps) => RunState::ToExtend { shorter, env_steps },
            (_, None, Some(env_steps)) => RunState::Interrupted { env_steps },
            (_, None, None) => RunState::ToDo,
        })
    }

    /// The state that the run would continue from, wherever that lies.
    ///
    /// # Errors
    ///
    /// A checkpoint is of another program or run, or the system refuses to read it.
    pub fn last_state(&self) -> Result<LastState, RecordError> {
        let mut last = LastState::default();
        for folder in [&self.paths.partial, &self.paths.complete] {
            for path in [RunPaths::checkpoint(folder), RunPaths::kept_state(folder)] {
                match Checkpoint::read(&path, &self.stamp.fingerprint) {
                    Ok(found) => {
                        let steps = |checkpoint: &Option<Checkpoint>| {
                            checkpoint.as_ref().map(Checkpoint::env_steps)
                        };
                        if steps(&found) > steps(&last.checkpoint) {
                            last.checkpoint = found;
                        }
                    }
                    Err(error @ RecordError::Damaged { .. }) => last.damaged.push(error),
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(last)
    }

    /// Whether `manifest` says that the run finished with the number of steps that is asked for
    /// now.
    pub fn is_done(&self, manifest: &Manifest) -> bool {
        manifest.outcome == Outcome::Finished && manifest.env_steps == self.spec.trained_steps()
    }

    /// Sets the evaluations during training to those of the `recorded` run that this one continues,
    /// so that all of them are of one kind. The final evaluation is still to come, and stays as
    /// asked for.
    pub fn keep_evaluating_as(&mut self, recorded: &Stamp) {
        let Ok(before) = plan::recorded(&recorded.spec) else {
            return;
        };
        self.spec.evaluation.every = before.evaluation.every;
        self.spec.evaluation.episodes = before.evaluation.episodes;
        self.stamp.spec = serde_json::to_value(&self.spec).unwrap_or_default();
    }

    fn differs(&self, manifest: &Manifest) -> Option<RunState> {
        if manifest.stamp.fingerprint == self.stamp.fingerprint {
            return None;
        }
        let mut keys = self.training_differences(&manifest.stamp);
        let (before, after) = (self.versions(&manifest.stamp), self.versions(&self.stamp));
        keys.extend((before != after).then(|| format!("versions: {before} -> {after}")));
        if keys.is_empty() {
            // Older programs recorded the demonstration in the fingerprint alone.
            keys.push(DEMONSTRATION.to_owned());
        }
        Some(RunState::Differs { keys })
    }

    /// The versions in `stamp`, without the model of a user's robot, which is told as a setting.
    fn versions(&self, stamp: &Stamp) -> Value {
        let mut versions = stamp.build.versions.clone();
        if let Some(parts) = versions.as_object_mut().filter(|_| self.spec.env.is_own()) {
            parts.remove("model");
        }
        versions
    }

    fn is_longer(&self, recorded: &Stamp, env_steps: u64) -> RunState {
        let keys = match plan::recorded(&recorded.spec) {
            Ok(before) => vec![budgets(&before, &self.spec)],
            Err(_) => vec![format!(
                "{env_steps} steps that are recorded, more than are asked for"
            )],
        };
        RunState::Differs { keys }
    }

    /// The differences between this run and the one that left `recorded`, apart from the versions
    /// of the programs; empty if its files would be the same.
    pub fn differences(&self, recorded: &Stamp) -> Vec<String> {
        let mut keys = self.training_differences(recorded);
        if let Ok(before) = plan::recorded(&recorded.spec) {
            keys.extend(plan::evaluated_otherwise(&before, &self.spec));
            keys.extend(
                (before.trained_steps() != self.spec.trained_steps())
                    .then(|| budgets(&before, &self.spec)),
            );
        }
        keys
    }

    /// The differences between this run's evaluations and those of the run that left `recorded`.
    pub fn evaluated_otherwise(&self, recorded: &Stamp) -> Vec<String> {
        plan::recorded(&recorded.spec).map_or_else(
            |_| Vec::new(),
            |before| plan::evaluated_otherwise(&before, &self.spec),
        )
    }

    /// The differences between this run's training and that of the run that left `recorded`.
    fn training_differences(&self, recorded: &Stamp) -> Vec<String> {
        let mut keys = match plan::recorded(&recorded.spec) {
            Ok(recorded) => plan::differences(&recorded, &self.spec),
            Err(_) => vec!["the specification's format".to_owned()],
        };
        let digests = recorded
            .demonstration
            .as_ref()
            .zip(self.stamp.demonstration.as_ref());
        keys.extend(
            digests
                .filter(|(before, after)| before != after)
                .map(|_| DEMONSTRATION.to_owned()),
        );
        keys
    }
}

/// Both budgets, in the form of other differences.
fn budgets(before: &RunSpec, after: &RunSpec) -> String {
    format!(
        "budget.env_steps: {} -> {}",
        before.budget.env_steps.get(),
        after.budget.env_steps.get()
    )
}

#[cfg(test)]
mod tests;
