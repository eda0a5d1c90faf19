//! Gym's and Gymnasium's other versions of the tasks: which task a label means, and what differs
//! there.

use super::EnvId;

impl EnvId {
    /// The task that `label` names, in whichever version, and the version's number where it has
    /// one: `Hopper-v5`, `hopper-medium-v2` of D4RL, `mujoco/hopper/expert-v0` of Minari.
    pub fn of_label(label: &str) -> Option<(Self, Option<u32>)> {
        if let Some((_, id)) = Self::known().find(|(known, _)| *known == label) {
            return Some((id, version(label)));
        }
        let words = label
            .split(['-', '/', '_', ' ', '.'])
            .map(str::to_lowercase);
        let id = words
            .into_iter()
            .find_map(|word| Self::shipped().find(|id| id.family().to_lowercase() == word))?;
        Some((id, version(label)))
    }

    /// The name without its version.
    pub fn family(self) -> &'static str {
        self.name()
            .split_once("-v")
            .map_or(self.name(), |(family, _)| family)
    }

    /// The difference of this task's `version` from this project's, in a sentence; absent if the
    /// numbers of a step are the same except for the engine's last bits, and for unknown versions.
    pub fn differs_in(self, version: u32) -> Option<&'static str> {
        self.versions()
            .iter()
            .find(|other| other.number == version)?
            .difference
    }

    /// The version of this task whose observations have this many numbers, if this project's have
    /// another number.
    pub fn observing(self, numbers: usize) -> Option<u32> {
        let version = self
            .versions()
            .iter()
            .find(|version| version.observation_dim == Some(numbers))?;
        Some(version.number)
    }
}

/// The number after the last `-v`.
fn version(label: &str) -> Option<u32> {
    label.rsplit_once("-v")?.1.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_name_tasks_in_any_version() {
        for (label, expected) in [
            ("Hopper-v2", Some(("Hopper-v2", Some(2)))),
            ("Hopper-v5", Some(("Hopper-v2", Some(5)))),
            ("hopper-medium-v2", Some(("Hopper-v2", Some(2)))),
            (
                "mujoco/halfcheetah/expert-v0",
                Some(("HalfCheetah-v2", Some(0))),
            ),
            (
                "DoublePendulum-v2",
                Some(("InvertedDoublePendulum-v2", Some(2))),
            ),
            ("Ant", Some(("Ant-v2", None))),
            ("Humanoid-v4", Some(("Humanoid-v2", Some(4)))),
            ("Pusher-v4", None),
            ("antmaze-umaze-v0", None),
            ("", None),
        ] {
            assert_eq!(
                EnvId::of_label(label).map(|(id, version)| (id.name(), version)),
                expected,
                "{label}"
            );
        }
    }
}
