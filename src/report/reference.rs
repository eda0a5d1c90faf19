//! The numbers that the paper prints.
//!
//! Owns `reference.toml`, the transcription of the appendix's Tables 2 to 5 with the margin of
//! verdicts, and typed access to it. Knows nothing of what was recorded here. Start at [`returns`]
//! and [`ablation`].

use std::sync::LazyLock;

use serde::Deserialize;

use crate::plan::RunSpec;

/// A return as the paper prints it: over 50 episodes with the best policy of five seeds, in the
/// dense reward.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(from = "(f64, f64)")]
pub struct PaperValue {
    /// Mean over the episodes.
    pub mean: f64,
    /// Standard deviation over the episodes.
    pub std: f64,
}

impl PaperValue {
    /// Evaluation episodes behind the mean (appendix, E.2).
    pub const EPISODES: f64 = 50.0;
    /// The number of seeds, of which the best one's policy is evaluated (appendix, E.2).
    pub const SEEDS: usize = 5;
}

impl From<(f64, f64)> for PaperValue {
    fn from((mean, std): (f64, f64)) -> Self {
        Self { mean, std }
    }
}

/// The row of Tables 3 and 4 of one environment.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Returns {
    environment: String,
    /// Return of the one demonstrated trajectory.
    pub demo: f64,
    pretraining: PaperValue,
    pofd: PaperValue,
    mcpo: PaperValue,
    expert: PaperValue,
    random: PaperValue,
    ppo: PaperValue,
    mmd_il: PaperValue,
}

impl Returns {
    /// The value of `algorithm`, by its name in a matrix; `None` where the paper has none.
    pub fn of(&self, algorithm: &str) -> Option<PaperValue> {
        Some(match algorithm {
            "pretraining" => self.pretraining,
            "pofd" => self.pofd,
            "mcpo" => self.mcpo,
            "expert" => self.expert,
            "random" => self.random,
            "ppo" => self.ppo,
            "mmd_il" => self.mmd_il,
            _ => return None,
        })
    }
}

/// MCPO's constraint in one environment (Table 2).
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Constraint {
    environment: String,
    gym: String,
    /// The tolerance d.
    pub d: f64,
    /// The annealing factor epsilon.
    pub epsilon: f64,
}

/// The properties of the authors' demonstration in one environment.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Demonstration {
    gym: String,
    /// Its length in steps.
    pub steps: usize,
    /// The rms of its actions, in units of the action.
    pub action_rms: f64,
    /// MMD^2 to the policy that does nothing, as `mcpo` measures it by default.
    pub mmd_of_doing_nothing: f64,
}

/// The scale of returns in one environment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The random policy's return.
    pub random: f64,
    /// The expert's return less the random policy's.
    pub distance: f64,
}

impl Scale {
    /// The margin: the difference of returns that counts as none.
    pub fn margin(self) -> f64 {
        PAPER.verdict.margin * self.distance
    }
}

#[derive(Debug, Deserialize)]
struct Verdict {
    /// The margin, as a share of [`Scale::distance`].
    margin: f64,
}

#[derive(Debug, Deserialize)]
struct AblationRow {
    d: f64,
    epsilon: f64,
    mcpo: PaperValue,
}

#[derive(Debug, Deserialize)]
struct Paper {
    verdict: Verdict,
    table2: Vec<Constraint>,
    returns: Vec<Returns>,
    demonstrations: Vec<Demonstration>,
    table5: Vec<AblationRow>,
}

static PAPER: LazyLock<Paper> = LazyLock::new(|| {
    toml::from_str(include_str!("reference.toml")).expect("reference.toml is checked by a test")
});

/// The environment of Table 5, by its Gym id.
pub const ABLATION_ENV: &str = "HalfCheetah-v2";

/// Table 2's row for the environment with Gym id `gym`.
pub fn constraint(gym: &str) -> Option<&'static Constraint> {
    PAPER.table2.iter().find(|row| row.gym == gym)
}

/// The row of Tables 3 and 4 for the environment with Gym id `gym`.
pub fn returns(gym: &str) -> Option<&'static Returns> {
    let paper_name = &constraint(gym)?.environment;
    PAPER
        .returns
        .iter()
        .find(|row| &row.environment == paper_name)
}

/// The scale of returns in the environment with Gym id `gym`: Table 4's expert and random policy.
pub fn scale(gym: &str) -> Option<Scale> {
    returns(gym).map(|row| Scale {
        random: row.random.mean,
        distance: row.expert.mean - row.random.mean,
    })
}

/// The authors' demonstration in the environment with Gym id `gym`.
pub fn demonstration(gym: &str) -> Option<&'static Demonstration> {
    PAPER.demonstrations.iter().find(|row| row.gym == gym)
}

/// Table 5: MCPO on [`ABLATION_ENV`] with tolerance `d` and annealing factor `epsilon`.
pub fn ablation(d: f64, epsilon: f64) -> Option<PaperValue> {
    PAPER
        .table5
        .iter()
        .find(|row| row.d == d && row.epsilon == epsilon)
        .map(|row| row.mcpo)
}

/// Environment steps that a run like `spec` needs for a comparison with the paper, which does not
/// print its budget.
///
/// This project's choice: 2e5 for MountainCar and InvertedPendulum, 1e6 for InvertedDoublePendulum,
/// 3e6 for the others; 0 for an algorithm that does not train.
pub fn assumed_budget(spec: &RunSpec) -> u64 {
    match spec.env.name() {
        _ if !spec.algorithm.trains() => 0,
        "MountainCarContinuous-v0" | "InvertedPendulum-v2" => 200_000,
        "InvertedDoublePendulum-v2" => 1_000_000,
        _ => 3_000_000,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_paper_does_not_print_is_absent() {
        assert_eq!(returns("Swimmer-v2"), None);
        assert_eq!(
            returns("HalfCheetah-v2").and_then(|row| row.of("trpo")),
            None
        );
        assert_eq!(ablation(1e-2, 0.0), None);
    }

    #[test]
    fn the_tables_are_found_by_gym_id_and_algorithm() {
        let cheetah = returns("HalfCheetah-v2").expect("a row");
        assert_eq!(cheetah.demo, 2109.80);
        assert_eq!(
            cheetah.of("mcpo"),
            Some(PaperValue {
                mean: 3541.23,
                std: 135.72
            })
        );
        let pendulum = returns("InvertedPendulum-v2").expect("the paper's Pendulum-v2");
        assert_eq!(
            pendulum.of("mmd_il"),
            Some(PaperValue {
                mean: 25.71,
                std: 1.03
            })
        );
        assert_eq!(
            ablation(1e-3, 2e-3),
            Some(PaperValue {
                mean: 2943.08,
                std: 99.60
            })
        );
        assert_eq!(ablation(1.0, 0.0).map(|value| value.mean), Some(-586.52));
        assert_eq!(constraint("Hopper-v2").map(|row| row.d), Some(1e-4));
        assert_eq!(PAPER.returns.len(), 7);
        let scale = scale("HalfCheetah-v2").expect("a row");
        assert!(
            (scale.distance - 4509.36).abs() < 1e-9 && (scale.margin() - 450.936).abs() < 1e-9,
            "{scale:?}"
        );
        assert!(
            PAPER
                .table2
                .iter()
                .all(|row| returns(&row.gym).is_some() && demonstration(&row.gym).is_some())
        );
    }
}
