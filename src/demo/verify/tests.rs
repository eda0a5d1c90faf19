use nalgebra::DMatrix;
use rand::RngExt;

use super::*;
use crate::rng::{Seed, Stream};

/// Two episodes of random actions, at most `limit` steps each.
fn recorded(env: EnvId, limit: u64) -> Demonstration {
    let mut task = Task::new(env, Reward::Dense, limit).expect("a task");
    let mut rng = Seed(5).stream(Stream::Environment, 0);
    let spaces = task.spaces();
    let mut observation = vec![0.0; spaces.observation_dim];
    let (mut observations, mut actions, mut poses) = (vec![], vec![], vec![]);
    let (mut rewards, mut terminated, mut truncated, mut episode_starts) =
        (vec![], vec![], vec![], vec![]);
    for _ in 0..2 {
        episode_starts.push(rewards.len());
        task.reset(&mut rng, &mut observation);
        loop {
            let action: Vec<f64> = (0..spaces.action_dim)
                .map(|_| rng.random_range(-1.0..1.0))
                .collect();
            poses.push(task.pose());
            observations.extend_from_slice(&observation);
            let transition = task.step(&action, &mut observation).expect("a step");
            actions.extend(action);
            rewards.push(transition.dense_reward);
            terminated.push(transition.end == Some(EpisodeEnd::Terminated));
            truncated.push(transition.end == Some(EpisodeEnd::Truncated));
            if transition.end.is_some() {
                break;
            }
        }
    }
    let n = rewards.len();
    Demonstration {
        observations: DMatrix::from_vec(spaces.observation_dim, n, observations),
        actions: DMatrix::from_vec(spaces.action_dim, n, actions),
        rewards: Some(rewards),
        episode_starts,
        terminated,
        truncated,
        poses: Some(poses),
        provenance: vec![],
    }
}

fn deviation(demonstration: &Demonstration, env: EnvId) -> Deviation {
    replay(demonstration, env).deviation
}

fn replay(demonstration: &Demonstration, env: EnvId) -> Replay {
    verify(demonstration, Path::new("d.parquet"), env).expect("it is replayed")
}

#[test]
fn what_does_not_fit_or_has_no_pose_is_refused() {
    let demonstration = recorded(EnvId::Hopper, 5);
    let path = Path::new("d.parquet");
    let message = verify(&demonstration, path, EnvId::Walker2d)
        .expect_err("of Hopper")
        .to_string();
    assert!(
        message.contains("d.parquet") && message.contains("an observation has 11 numbers; 17"),
        "{message}"
    );
    let mut long = demonstration.clone();
    long.actions = DMatrix::zeros(4, long.len());
    let message = long
        .check(path, EnvId::Hopper)
        .expect_err("a long action")
        .to_string();
    assert!(
        message.contains("Hopper-v2: an action has 4 numbers; 3 are needed"),
        "{message}"
    );
    let without = Demonstration {
        poses: None,
        ..demonstration
    };
    let message = verify(&without, path, EnvId::Hopper)
        .expect_err("no pose")
        .to_string();
    assert!(message.contains("`qpos`"), "{message}");
}

#[test]
fn each_change_is_seen_where_it_is() {
    let whole = recorded(EnvId::Hopper, 1000);
    let last = whole.len() - 1;
    assert!(whole.terminated[last], "random actions make it fall");
    let mut changed = whole.clone();
    changed.observations[(10, last)] += 1e-6;
    let seen = deviation(&changed, EnvId::Hopper);
    assert!(
        (seen.observation - 1e-6).abs() < 1e-9 && seen.reward == Some(0.0) && seen.ends == 0,
        "{seen:?}"
    );
    let mut changed = whole.clone();
    changed.rewards.as_mut().expect("rewards")[0] -= 0.5;
    let seen = deviation(&changed, EnvId::Hopper);
    assert!(
        seen.observation == 0.0 && seen.reward == Some(0.5) && seen.ends == 0,
        "{seen:?}"
    );
    let mut changed = whole.clone();
    changed.terminated[last] = false;
    assert_eq!(deviation(&changed, EnvId::Hopper).ends, 1);
    let mut changed = whole.clone();
    changed.actions[(0, 0)] += 0.1;
    assert!(deviation(&changed, EnvId::Hopper).observation > 1e-3);
    let mut changed = whole;
    changed.episode_starts = vec![0];
    assert!(
        deviation(&changed, EnvId::Hopper).ends > 0,
        "an episode that goes on after its end"
    );
}

#[test]
fn the_greatest_deviation_is_found_where_it_is() {
    let whole = recorded(EnvId::Hopper, 1000);
    let (second, last) = (whole.episode_starts[1], whole.len() - 1);
    let mut changed = whole.clone();
    changed.observations[(3, second + 2)] += 1e-3;
    changed.rewards.as_mut().expect("rewards")[1] += 0.5;
    changed.terminated[last] = false;
    let replay = replay(&changed, EnvId::Hopper);
    assert_eq!(
        replay.observation_at,
        At {
            episode: 1,
            step: 2,
            number: 3
        }
    );
    assert_eq!(
        replay.reward_at,
        At {
            episode: 0,
            step: 1,
            number: 0
        }
    );
    assert_eq!(
        replay.end_at,
        Some(At {
            episode: 1,
            step: last - second,
            number: 0
        })
    );
    assert_eq!(
        replay.version(EnvId::Hopper, &Tolerance::of(&changed, EnvId::Hopper)),
        None
    );
}

#[test]
fn a_reward_that_version_5_does_not_pay_is_known() {
    for (env, bonus) in [
        (EnvId::Hopper, 1.0),
        (EnvId::InvertedPendulum, 1.0),
        (EnvId::InvertedDoublePendulum, 10.0),
    ] {
        let mut theirs = recorded(env, 1000);
        let ends: Vec<usize> = theirs.episodes().map(|steps| steps.end - 1).collect();
        let tolerance = Tolerance::of(&theirs, env);
        for last in ends {
            assert!(
                theirs.terminated[last],
                "{env}: random actions make it fall"
            );
            theirs.rewards.as_mut().expect("rewards")[last] -= bonus;
        }
        let known = replay(&theirs, env)
            .version(env, &tolerance)
            .expect("version 5");
        assert!(
            known.0 == 5 && known.1.contains("the step in which"),
            "{known:?}"
        );
        theirs.rewards.as_mut().expect("rewards")[0] -= bonus;
        assert_eq!(replay(&theirs, env).version(env, &tolerance), None, "{env}");
    }
}

#[test]
fn actions_in_f32_allow_rewards_in_f32() {
    let mut demonstration = recorded(EnvId::Ant, 5);
    assert_eq!(
        Tolerance::of(&demonstration, EnvId::Ant),
        Tolerance {
            observation: 1e-9,
            reward: 1e-9
        }
    );
    demonstration
        .actions
        .iter_mut()
        .for_each(|action| *action = f64::from(*action as f32));
    let tolerance = Tolerance::of(&demonstration, EnvId::Ant);
    assert_eq!(
        tolerance,
        Tolerance {
            observation: 1e-9,
            reward: 1e-6
        }
    );
    assert!(tolerance.holds(&Deviation {
        observation: 0.0,
        reward: Some(5e-7),
        ends: 0
    }));
    assert!(!tolerance.holds(&Deviation {
        observation: 5e-7,
        reward: None,
        ends: 0
    }));
    assert!(!tolerance.holds(&Deviation {
        observation: 0.0,
        reward: None,
        ends: 1
    }));
}

#[test]
fn a_time_limit_must_be_noted_and_may_be_shorter() {
    let short = recorded(EnvId::HalfCheetah, 20);
    assert_eq!(deviation(&short, EnvId::HalfCheetah).ends, 0);
    let mut whole = recorded(EnvId::HalfCheetah, 1000);
    *whole.truncated.last_mut().expect("steps") = false;
    assert_eq!(deviation(&whole, EnvId::HalfCheetah).ends, 1);
}

#[test]
fn a_recording_of_every_environment_replays_to_the_bit() {
    for env in EnvId::ALL {
        let demonstration = recorded(env, 30);
        let exact = Deviation {
            observation: 0.0,
            reward: Some(0.0),
            ends: 0,
        };
        assert_eq!(deviation(&demonstration, env), exact, "{env}");
        let without = Demonstration {
            rewards: None,
            ..demonstration
        };
        assert_eq!(
            deviation(&without, env),
            Deviation {
                reward: None,
                ..exact
            },
            "{env}"
        );
    }
}
