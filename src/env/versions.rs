//! Gym's and Gymnasium's other versions of the tasks: which task a label means, and what is not the same there.

use super::EnvId;

impl EnvId {
    /// The task that `label` names, in whichever version, and the version's number where it has one: `Hopper-v5`,
    /// `hopper-medium-v2` of D4RL, `mujoco/hopper/expert-v0` of Minari.
    pub fn of_label(label: &str) -> Option<(Self, Option<u32>)> {
        if let Some((_, id)) = Self::known().find(|(known, _)| *known == label) {
            return Some((id, version(label)));
        }
        let words = label.split(['-', '/', '_', ' ', '.']).map(str::to_lowercase);
        let id =
            words.into_iter().find_map(|word| Self::ALL.into_iter().find(|id| id.family().to_lowercase() == word))?;
        Some((id, version(label)))
    }

    /// The name without a version.
    pub fn family(self) -> &'static str {
        self.name().split_once("-v").map_or(self.name(), |(family, _)| family)
    }

    /// What `version` of this task has that this project's has not, in a sentence; absent where the numbers of a step are
    /// the same but for the engine's last bits, and for versions that are not known.
    pub fn differs_in(self, version: u32) -> Option<&'static str> {
        match (self, version) {
            (Self::InvertedPendulum, 5) => Some("v5 pays 0 instead of 1 for the step in which the pole falls"),
            (Self::InvertedDoublePendulum, 5) => {
                Some("v5 observes 9 numbers instead of 11, and pays no 10 for the step in which the poles fall")
            }
            (Self::Hopper, 5) => Some("v5 pays no 1 for the step in which it falls"),
            (Self::Walker2d, 5) => Some(
                "v5 pays no 1 for the step in which it falls, and gives both feet the friction 1.9 (here the right one has 0.9)",
            ),
            (Self::Ant, 4) => {
                Some("v4 observes 27 numbers instead of 111: the contact forces are left out unless they are asked for")
            }
            (Self::Ant, 5) => {
                Some("v5 observes 105 numbers instead of 111, and pays no 1 for the step in which it falls")
            }
            _ => None,
        }
    }

    /// The version of this task whose observations have so many numbers, which this project's have not.
    pub fn observing(self, numbers: usize) -> Option<u32> {
        match (self, numbers) {
            (Self::InvertedDoublePendulum, 9) | (Self::Ant, 105) => Some(5),
            (Self::Ant, 27) => Some(4),
            _ => None,
        }
    }

    /// The versions of this task that Gym and Gymnasium have beside this project's.
    pub fn other_versions(self) -> &'static [u32] {
        match self {
            Self::MountainCar => &[],
            Self::InvertedPendulum | Self::InvertedDoublePendulum => &[4, 5],
            _ => &[3, 4, 5],
        }
    }
}

/// The number behind the last `-v`.
fn version(label: &str) -> Option<u32> {
    label.rsplit_once("-v")?.1.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_name_tasks_in_any_version() {
        for (label, expected) in [
            ("Hopper-v2", Some((EnvId::Hopper, Some(2)))),
            ("Hopper-v5", Some((EnvId::Hopper, Some(5)))),
            ("hopper-medium-v2", Some((EnvId::Hopper, Some(2)))),
            ("mujoco/halfcheetah/expert-v0", Some((EnvId::HalfCheetah, Some(0)))),
            ("DoublePendulum-v2", Some((EnvId::InvertedDoublePendulum, Some(2)))),
            ("Ant", Some((EnvId::Ant, None))),
            ("Humanoid-v4", None),
            ("antmaze-umaze-v0", None),
            ("", None),
        ] {
            assert_eq!(EnvId::of_label(label), expected, "{label}");
        }
    }
}
