//! The environments that ship: laws that hold for every one of them, and what is each one's own.

use std::path::Path;

use mcpo_run::{
    demo::{Demonstration, verify},
    env::{EnvError, EnvId, EpisodeEnd, Pose, Reward, SparseMode, Task, Transition},
    quantity::constant,
    rng::{Rng, Seed, Stream},
};
use rand::RngExt;

fn rng(seed: u64) -> Rng {
    Seed(seed).stream(Stream::Environment, 0)
}

fn dense(env: EnvId) -> Task {
    Task::new(env, Reward::Dense, env.max_steps()).expect("every environment has its dense reward")
}

fn buffer(task: &Task) -> Vec<f64> {
    vec![0.0; task.spaces().observation_dim]
}

/// Uniform actions, some of them beyond the bounds.
fn action(task: &Task, rng: &mut Rng) -> Vec<f64> {
    let bound = 1.5 * task.spaces().action_bound;
    (0..task.spaces().action_dim)
        .map(|_| rng.random_range(-bound..bound))
        .collect()
}

/// Everything that `steps` random steps show, as bits; episodes that end are begun again.
fn trace(task: &mut Task, rng: &mut Rng, steps: usize) -> Vec<u64> {
    let mut observation = buffer(task);
    let mut bits = Vec::new();
    for _ in 0..steps {
        let action = action(task, rng);
        let Transition {
            reward,
            dense_reward,
            end,
        } = task.step(&action, &mut observation).expect("a step");
        bits.extend(
            observation
                .iter()
                .chain([&reward, &dense_reward])
                .map(|x| x.to_bits()),
        );
        bits.push(end.map_or(0, |end| 1 + u64::from(end == EpisodeEnd::Truncated)));
        if end.is_some() {
            task.reset(rng, &mut observation);
            bits.extend(observation.iter().map(|x| x.to_bits()));
        }
    }
    bits
}

#[test]
fn an_action_of_wrong_length_or_not_finite_is_refused_and_moves_nothing() {
    for env in EnvId::shipped() {
        let mut task = dense(env);
        let mut observation = buffer(&task);
        task.reset(&mut rng(0), &mut observation);
        let (before, dim) = (task.save(), task.spaces().action_dim);
        for wrong in [vec![], vec![0.0; dim + 1]] {
            let error = task
                .step(&wrong, &mut observation)
                .expect_err("a wrong length");
            assert!(
                matches!(error, EnvError::WrongLength { expected, .. } if expected == dim),
                "{error}"
            );
        }
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut action = vec![0.0; dim];
            action[dim - 1] = bad;
            let error = task
                .step(&action, &mut observation)
                .expect_err("not finite");
            assert!(matches!(error, EnvError::NonFinite { .. }), "{error}");
        }
        assert_eq!(task.save(), before, "{env}");
    }
}

#[test]
fn a_pose_of_wrong_length_or_not_finite_is_refused() {
    for env in EnvId::shipped() {
        let mut task = dense(env);
        let mut observation = buffer(&task);
        task.reset(&mut rng(0), &mut observation);
        let pose = task.pose();
        let short = Pose {
            qpos: pose.qpos[1..].to_vec(),
            ..pose.clone()
        };
        let long = Pose {
            qvel: [&pose.qvel[..], &[0.0]].concat(),
            ..pose.clone()
        };
        for wrong in [short, long] {
            let error = task
                .set_pose(&wrong, &mut observation)
                .expect_err("a wrong length");
            assert!(matches!(error, EnvError::WrongLength { .. }), "{error}");
        }
        let mut bad = pose.clone();
        bad.qvel[0] = f64::NAN;
        assert!(
            matches!(
                task.set_pose(&bad, &mut observation),
                Err(EnvError::NonFinite { .. })
            ),
            "{env}"
        );
        assert_eq!(task.pose(), pose, "{env}");
    }
}

#[test]
fn a_state_of_another_environment_is_refused() {
    for env in EnvId::shipped() {
        let state = dense(env).save();
        assert!(dense(env).restore(&state[..1]).is_err(), "{env}");
        assert!(
            dense(env).restore(&state[..state.len() - 1]).is_err(),
            "{env}"
        );
        for other in EnvId::shipped() {
            assert_eq!(
                dense(other).restore(&state).is_ok(),
                other == env,
                "{env} into {other}"
            );
        }
    }
}

#[test]
fn physics_that_diverge_are_an_error_and_a_new_episode_goes_on() {
    for env in EnvId::shipped().filter(|&env| env != EnvId::MountainCar) {
        let mut task = dense(env);
        let mut observation = buffer(&task);
        task.reset(&mut rng(0), &mut observation);
        let zero = vec![0.0; task.spaces().action_dim];
        for speed in [1e9, 1e200] {
            let mut pose = task.pose();
            pose.qvel.iter_mut().for_each(|v| *v = speed);
            task.set_pose(&pose, &mut observation).expect("finite");
            let error = (0..20)
                .find_map(|_| task.step(&zero, &mut observation).err())
                .expect("it diverges");
            assert!(matches!(error, EnvError::Diverged { .. }), "{error}");
            task.reset(&mut rng(0), &mut observation);
            task.step(&zero, &mut observation).expect("a new episode");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    for env in EnvId::shipped() {
        let run = |seed| {
            let (mut task, mut rng) = (dense(env), rng(seed));
            task.reset(&mut rng, &mut buffer(&task));
            trace(&mut task, &mut rng, 200)
        };
        assert_eq!(run(1), run(1), "{env}");
        assert_ne!(run(1), run(2), "{env}");
    }
}

#[test]
fn a_restored_task_goes_on_bit_for_bit() {
    for env in EnvId::shipped() {
        let sparse = match env.sparse_reward() {
            // Near enough to be paid on the way, and for the start of the episode to matter.
            Reward::Sparse2 { .. } => Reward::Sparse2 {
                distance: constant(0.02),
                mode: SparseMode::Milestone,
            },
            other => other,
        };
        for reward in [Reward::Dense, sparse] {
            let mut task = Task::new(env, reward, 150).expect("its own reward");
            let mut rng = rng(3);
            task.reset(&mut rng, &mut buffer(&task));
            trace(&mut task, &mut rng, 77);
            let (state, at) = (task.save(), rng.clone());
            let expected = trace(&mut task, &mut rng, 300);

            task.restore(&state).expect("its own state");
            assert_eq!(
                trace(&mut task, &mut at.clone(), 300),
                expected,
                "{env}: rewound"
            );
            let mut other = Task::new(env, reward, 150).expect("its own reward");
            other.reset(&mut rng, &mut buffer(&task));
            trace(&mut other, &mut rng, 20);
            other.restore(&state).expect("its own state");
            assert_eq!(
                trace(&mut other, &mut at.clone(), 300),
                expected,
                "{env}: in another"
            );
        }
    }
}

#[test]
fn an_episode_follows_from_its_first_pose() {
    for env in EnvId::shipped() {
        let (mut task, mut rng) = (dense(env), rng(4));
        let (mut first, mut again) = (buffer(&task), buffer(&task));
        trace(&mut task, &mut rng, 50);
        task.reset(&mut rng, &mut first);
        let (pose, at) = (task.pose(), rng.clone());
        let expected = trace(&mut task, &mut rng, 100);
        task.set_pose(&pose, &mut again).expect("its own pose");
        assert_eq!(first, again, "{env}");
        assert_eq!(task.pose(), pose, "{env}");
        assert_eq!(trace(&mut task, &mut at.clone(), 100), expected, "{env}");
    }
}

#[test]
fn the_time_limit_truncates_and_a_termination_wins_over_it() {
    // Without control, MountainCar and HalfCheetah never end; a pendulum that leans beyond 0.2 ends
    // at once.
    for env in [EnvId::MountainCar, EnvId::HalfCheetah] {
        let mut task = Task::new(env, Reward::Dense, 5).expect("dense");
        let mut observation = buffer(&task);
        let zero = vec![0.0; task.spaces().action_dim];
        for _ in 0..2 {
            task.reset(&mut rng(5), &mut observation);
            let ends: Vec<_> = (0..5)
                .map(|_| task.step(&zero, &mut observation).expect("a step").end)
                .collect();
            assert_eq!(
                ends,
                [None, None, None, None, Some(EpisodeEnd::Truncated)],
                "{env}"
            );
        }
    }
    let mut task = Task::new(EnvId::InvertedPendulum, Reward::Dense, 1).expect("dense");
    let mut observation = buffer(&task);
    task.set_pose(
        &Pose {
            qpos: vec![0.0, 0.3],
            qvel: vec![0.0, 0.0],
        },
        &mut observation,
    )
    .expect("a pose");
    let transition = task.step(&[0.0], &mut observation).expect("a step");
    assert_eq!(transition.end, Some(EpisodeEnd::Terminated));
    assert_eq!(
        transition.dense_reward, 1.0,
        "Gym pays for the last step too"
    );
}

#[test]
fn actions_beyond_the_bounds_move_as_the_bounds_do_and_cost_what_they_are() {
    for env in EnvId::shipped() {
        let mut task = dense(env);
        let (mut at_bound, mut beyond) = (buffer(&task), buffer(&task));
        task.reset(&mut rng(6), &mut at_bound);
        let state = task.save();
        let bound = task.spaces().action_bound;
        let dim = task.spaces().action_dim;
        let first = task.step(&vec![bound; dim], &mut at_bound).expect("a step");
        // MuJoCo takes a number beyond 1e10 for a diverged one, but not here.
        for factor in [3.0, 1e11] {
            task.restore(&state).expect("its own state");
            let second = task
                .step(&vec![factor * bound; dim], &mut beyond)
                .expect("a step");
            assert_eq!(at_bound, beyond, "{env}");
            let weight = match env.name() {
                "InvertedPendulum-v2" | "InvertedDoublePendulum-v2" => 0.0,
                "MountainCarContinuous-v0" | "HalfCheetah-v2" | "Humanoid-v2" => 0.1,
                "Hopper-v2" | "Walker2d-v2" => 1e-3,
                "Swimmer-v2" => 1e-4,
                "Ant-v2" => 0.5,
                "Reacher-v2" => 1.0,
                other => panic!("{other} costs nobody knows what"),
            };
            let cost = weight * dim as f64 * bound * bound * (factor * factor - 1.0);
            assert!(
                (first.reward - second.reward - cost).abs() <= 1e-12 * cost.max(1.0),
                "{env}"
            );
        }
    }
}

/// Thrown forwards, a body is paid as often as it covered its distance, by the default reward.
fn paid_by_milestones(env: EnvId, distance: f64) {
    let mut task = Task::new(env, env.sparse_reward(), 1000).expect("its own reward");
    let mut observation = buffer(&task);
    task.reset(&mut rng(7), &mut observation);
    let mut pose = task.pose();
    pose.qvel[0] = 30.0;
    task.set_pose(&pose, &mut observation).expect("a pose");
    let zero = vec![0.0; task.spaces().action_dim];
    let (mut paid, mut farthest) = (0.0, 0.0_f64);
    for _ in 0..100 {
        paid += task.step(&zero, &mut observation).expect("a step").reward;
        farthest = farthest.max(task.pose().qpos[0] - pose.qpos[0]);
    }
    // Ant's position is the torso's of up to 10 ms ago: so near a whole distance either count is
    // right.
    let counts = [farthest - 0.05, farthest + 0.05].map(|x| (x / distance).floor());
    assert!(
        paid >= 1.0 && (counts[0]..=counts[1]).contains(&paid),
        "{env}: {paid} for {farthest} m"
    );
}

#[test]
fn a_sparse_reward_follows_the_body() {
    // Thrown forwards, a body passes its distance at once.
    for env in [
        EnvId::HalfCheetah,
        EnvId::Hopper,
        EnvId::Walker2d,
        EnvId::Ant,
    ] {
        let Reward::Sparse2 { distance, .. } = env.sparse_reward() else {
            panic!("{env} moves forwards")
        };
        paid_by_milestones(env, distance.get());
        let beyond = Reward::Sparse2 {
            distance,
            mode: SparseMode::Beyond,
        };
        let mut task = Task::new(env, beyond, 1000).expect("its own reward");
        let mut observation = buffer(&task);
        task.reset(&mut rng(7), &mut observation);
        let mut pose = task.pose();
        pose.qpos[0] += 100.0;
        pose.qvel[0] = 30.0;
        task.set_pose(&pose, &mut observation).expect("a pose");
        let zero = vec![0.0; task.spaces().action_dim];
        let mut paid = Vec::new();
        for _ in 0..100 {
            let reward = task.step(&zero, &mut observation).expect("a step").reward;
            let beyond = task.pose().qpos[0] - pose.qpos[0] - distance.get();
            // Ant's position is the torso's of up to 10 ms ago.
            if beyond.abs() > 0.5 {
                assert_eq!(
                    reward,
                    f64::from(u8::from(beyond > 0.0)),
                    "{env} at {beyond}"
                );
                paid.push(reward);
            }
        }
        assert!(
            paid.contains(&1.0) && (env == EnvId::Ant || paid.contains(&0.0)),
            "{env}: {paid:?}"
        );
    }
    let falls = |env: EnvId, angle: f64| {
        let mut task = Task::new(env, env.sparse_reward(), 1000).expect("its own reward");
        let mut observation = buffer(&task);
        let mut pose = task.pose();
        pose.qpos[1] = angle;
        task.set_pose(&pose, &mut observation).expect("a pose");
        task.step(&[0.0], &mut observation).expect("a step").reward
    };
    assert_eq!(falls(EnvId::InvertedPendulum, 0.1), 1.0);
    assert_eq!(falls(EnvId::InvertedPendulum, -0.19), 0.0);
    assert_eq!(falls(EnvId::InvertedDoublePendulum, 0.1), 1.0);
    assert_eq!(falls(EnvId::InvertedDoublePendulum, -0.3), 0.0);

    let mut car = Task::new(EnvId::MountainCar, Reward::Sparse1, 999).expect("its own reward");
    let mut observation = buffer(&car);
    car.set_pose(
        &Pose {
            qpos: vec![0.38],
            qvel: vec![0.05],
        },
        &mut observation,
    )
    .expect("a pose");
    let first = car.step(&[1.0], &mut observation).expect("a step");
    let second = car.step(&[1.0], &mut observation).expect("a step");
    assert_eq!((first.reward, first.end), (0.0, None));
    assert_eq!(
        (second.reward, second.dense_reward, second.end),
        (1.0, 99.9, Some(EpisodeEnd::Terminated))
    );
}

#[test]
fn episodes_start_with_gyms_noise() {
    // (environment, bound of the positions' noise, bound or standard deviation of the velocities',
    // whether normal).
    for (env, position, velocity, normal) in [
        (EnvId::InvertedPendulum, 0.01, 0.01, false),
        (EnvId::InvertedDoublePendulum, 0.1, 0.1, true),
        (EnvId::HalfCheetah, 0.1, 0.1, true),
        (EnvId::Hopper, 0.005, 0.005, false),
        (EnvId::Walker2d, 0.005, 0.005, false),
        (EnvId::Ant, 0.1, 0.1, true),
    ] {
        let mut task = dense(env);
        let mut observation = buffer(&task);
        // A new task is in its model's start.
        let (start, mut rng) = (task.pose(), rng(8));
        let (mut positions, mut velocities) = (Vec::new(), Vec::new());
        for _ in 0..400 {
            task.reset(&mut rng, &mut observation);
            let pose = task.pose();
            positions.extend(
                pose.qpos
                    .iter()
                    .zip(&start.qpos)
                    .map(|(q, start)| q - start),
            );
            velocities.extend(pose.qvel);
        }
        let deviation = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
        let greatest = |x: &[f64]| x.iter().fold(0.0_f64, |greatest, x| greatest.max(x.abs()));
        // 800 numbers or more: a standard deviation is known within 2.5 % of itself, four of which
        // are 10 %.
        let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 0.1;
        let uniform = |x: &[f64], bound: f64| {
            greatest(x) <= bound && near(deviation(x), bound / 3_f64.sqrt())
        };
        assert!(uniform(&positions, position), "{env}");
        if normal {
            assert!(
                near(deviation(&velocities), velocity) && greatest(&velocities) > 2.5 * velocity,
                "{env}"
            );
        } else {
            assert!(uniform(&velocities, velocity), "{env}");
        }
    }
    let mut car = dense(EnvId::MountainCar);
    let (mut observation, mut rng) = (buffer(&car), rng(8));
    for _ in 0..400 {
        car.reset(&mut rng, &mut observation);
        assert!((-0.6..-0.4).contains(&observation[0]) && observation[1] == 0.0);
    }
}

#[test]
fn uniform_actions_earn_what_they_do_in_gym() {
    // (environment, episodes here, Gymnasium's mean and standard deviation of a return, its
    // episodes), with f64 actions.
    for (env, episodes, mean, deviation, reference_episodes) in [
        (EnvId::MountainCar, 20, -33.22, 0.82, 60),
        (EnvId::InvertedPendulum, 200, 6.11, 3.53, 2000),
        (EnvId::InvertedDoublePendulum, 200, 57.63, 17.55, 2000),
        (EnvId::HalfCheetah, 8, -273.38, 82.73, 60),
        (EnvId::Hopper, 50, 18.58, 17.85, 1500),
        (EnvId::Walker2d, 50, 2.65, 6.04, 1500),
        (EnvId::Ant, 8, -59.85, 102.24, 60),
    ] {
        let (mut task, mut rng) = (dense(env), rng(9));
        let mut observation = buffer(&task);
        let bound = task.spaces().action_bound;
        let mut total = 0.0;
        for _ in 0..episodes {
            task.reset(&mut rng, &mut observation);
            loop {
                let action: Vec<f64> = (0..task.spaces().action_dim)
                    .map(|_| rng.random_range(-bound..bound))
                    .collect();
                let transition = task.step(&action, &mut observation).expect("a step");
                total += transition.dense_reward;
                if transition.end.is_some() {
                    break;
                }
            }
        }
        let found = total / f64::from(episodes);
        // Four standard errors of the difference.
        let tolerance = 4.0
            * deviation
            * (1.0 / f64::from(episodes) + 1.0 / f64::from(reference_episodes)).sqrt();
        assert!(
            (found - mean).abs() < tolerance,
            "{env}: {found}, not {mean} +- {tolerance}"
        );
    }
}

#[test]
fn gymnasiums_transitions_are_reproduced() {
    let mut seen = [0; 3];
    for env in EnvId::shipped() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/parity/{env}.parquet"));
        let recorded = Demonstration::read(&path).expect("a committed file");
        let deviation = verify(&recorded, &path, env)
            .expect("a recording of this environment")
            .deviation;
        // Gymnasium keeps MountainCar's state in f32, and its roundings add up over an episode.
        let tolerance = if env == EnvId::MountainCar {
            1e-5
        } else {
            1e-9
        };
        assert!(deviation.observation <= tolerance, "{env}: {deviation:?}");
        assert!(
            deviation.reward.is_some_and(|reward| reward <= tolerance),
            "{env}: {deviation:?}"
        );
        assert_eq!(deviation.ends, 0, "{env}");
        let bound = dense(env).spaces().action_bound;
        seen[0] += recorded.terminated.iter().filter(|&&ended| ended).count();
        seen[1] += recorded.truncated.iter().filter(|&&ended| ended).count();
        seen[2] += recorded.actions.iter().filter(|a| a.abs() > bound).count();
    }
    assert!(
        seen.iter().all(|&count| count > 2),
        "the recordings have terminations, truncations, great actions: {seen:?}"
    );
}
