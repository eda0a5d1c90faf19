//! The settings of all runs, of one environment, or of an axis, beside hyperparameters.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::{
    algo::catalogue,
    env::{EnvId, Reward},
    quantity::{Count, EnvSteps, Positive, constant},
};

/// Every setting of a run that is not its algorithm's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The reward that is trained on: `"dense"`, `"sparse1"`, `{ sparse2 = { distance = 15.0 } }`
    /// or `{ sparse3 = { height = 0.59 } }`; the paper's sparse one for the environment when
    /// absent, and a robot's of one's own dense.
    pub reward: Reward,
    /// The time limit of an episode in steps; Gym's when absent, 1000 for a robot of one's own.
    pub max_steps: Count,
    /// The demonstration's file, relative to the file that names it; `{env}` stands for the
    /// environment's name.
    pub demonstrations: PathBuf,
    /// How long each run is.
    pub budget: Budget,
    /// How experience is collected.
    pub rollout: Rollout,
    /// How and when policies are evaluated.
    pub evaluation: Evaluation,
    /// The networks' shapes.
    pub network: Network,
    /// When checkpoints are written.
    pub checkpoint: Checkpoint,
}

/// `[budget]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Steps in the environments, over the whole run; required.
    pub env_steps: EnvSteps,
}

/// `[rollout]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rollout {
    /// Steps of one iteration, over all environments; a multiple of `environments`. Default 1024
    /// under MCPO, Table 1's batch; else 4096, MountainCar 2048.
    pub steps: Count,
    /// Environments stepped together in one process. Default 8.
    pub environments: Count,
}

/// `[evaluation]`: episodes with the mean action and a frozen normaliser, on the dense and the
/// sparse reward.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// Environment steps of training between two evaluations; the last policy is evaluated in any
    /// case. Default 20,000, but no less than ten times the steps that one evaluation can take.
    pub every: EnvSteps,
    /// Episodes of each evaluation during training. Default 2.
    pub episodes: Count,
    /// Episodes of the evaluation at the end of training. Default 50, as in the paper.
    pub final_episodes: Count,
}

/// `[network]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Widths of the hidden layers of policy, value and discriminator networks. Default `[300,
    /// 400]`.
    pub hidden: Vec<Count>,
    /// The policy's standard deviation at the start, in units of the action. Default 0.5.
    pub initial_std: Positive,
    /// Normalised observations are clipped to this, on either side. Default 10.
    pub observation_clip: Positive,
}

/// `[checkpoint]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Seconds of wall time between two checkpoints that an interrupted run resumes from. Default
    /// 60.
    pub every_seconds: Positive,
    /// Keep the policy every so many environment steps, for `demo collect`; none is kept when
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub keep_policy_every: Option<EnvSteps>,
}

impl Settings {
    /// Where demonstrations lie, from the folder of the experiment.
    pub(super) const DEMONSTRATIONS: &str = "demos/{env}.parquet";
    /// Evaluations during training may take one part in this many of its steps.
    const EVALUATION_PART: u64 = 10;
    /// Steps between two evaluations where these cost little: a hundred points in a learning curve
    /// of 2 million steps.
    const EVALUATE_EVERY: u64 = 20_000;

    /// The defaults for `algorithm` in `env` under a budget of `env_steps`.
    pub fn defaults(env: EnvId, algorithm: &str, env_steps: EnvSteps) -> Self {
        let episodes = constant(2);
        let max_steps = count(env.max_steps());
        let of_env = || {
            constant(if env == EnvId::MountainCar {
                2048
            } else {
                4096
            })
        };
        Self {
            reward: env.default_reward(),
            max_steps,
            demonstrations: PathBuf::from(Self::DEMONSTRATIONS),
            budget: Budget { env_steps },
            rollout: Rollout {
                steps: catalogue::find(algorithm)
                    .and_then(|entry| entry.about().steps)
                    .map_or_else(of_env, count),
                environments: constant(8),
            },
            evaluation: Evaluation {
                every: Self::evaluate_every(episodes, max_steps),
                episodes,
                final_episodes: constant(50),
            },
            network: Network {
                hidden: vec![constant(300), constant(400)],
                initial_std: constant(0.5),
                observation_clip: constant(10.0),
            },
            checkpoint: Checkpoint {
                every_seconds: constant(60.0),
                keep_policy_every: None,
            },
        }
    }

    /// The default of `evaluation.every`.
    /// It does not depend on the budget: a run that is extended is evaluated at the same steps as
    /// one that was longer from the start.
    /// Evaluations never cost more than a tenth of training's steps.
    pub(super) fn evaluate_every(episodes: Count, max_steps: Count) -> EnvSteps {
        let longest = episodes.get().saturating_mul(max_steps.get());
        count(Self::EVALUATE_EVERY.max(longest.saturating_mul(Self::EVALUATION_PART)))
    }
}

/// `number` as a count, known to be above 0.
fn count(number: u64) -> Count {
    constant(i64::try_from(number).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evaluations_under_way_stay_below_a_tenth_of_training() {
        for env_steps in [20_000, 200_000, 3_000_000] {
            let settings = Settings::defaults(EnvId::Hopper, "ppo", constant(env_steps));
            let evaluations = settings.budget.env_steps.get() / settings.evaluation.every.get();
            let cost = evaluations * settings.evaluation.episodes.get() * settings.max_steps.get();
            assert!(
                cost * 10 <= settings.budget.env_steps.get(),
                "{cost} of {env_steps}"
            );
        }
        assert_eq!(
            Settings::evaluate_every(constant(10), constant(1000)),
            constant(100_000)
        );
        assert_eq!(
            Settings::evaluate_every(constant(1), constant(200)),
            constant(20_000)
        );
    }

    #[test]
    fn rollouts_divide_among_their_environments() {
        for (env, algorithm) in EnvId::ALL
            .into_iter()
            .flat_map(|env| [(env, "mcpo"), (env, "ppo")])
        {
            let rollout = Settings::defaults(env, algorithm, constant(1)).rollout;
            assert_eq!(
                rollout.steps.get() % rollout.environments.get(),
                0,
                "{algorithm} in {env}"
            );
        }
    }
}
