use super::*;
use crate::{
    algo::{one_step, reference},
    rng::{Seed, Stream},
};

fn hyperparameters() -> Hyperparameters {
    Hyperparameters {
        learning_rate: constant(3e-3),
        minibatch: constant(128),
        ..Hyperparameters::for_env(EnvId::InvertedPendulum)
    }
}

fn train(
    ppo: &mut Ppo,
    iterations: usize,
    reward: fn(f64, f64) -> f64,
    rng: &mut Rng,
) -> Vec<Update> {
    (0..iterations)
        .map(|_| {
            let batch = one_step::batch(ppo.agent(), 512, reward, rng);
            ppo.update(&batch, rng).expect("finite")
        })
        .collect()
}

#[test]
fn a_reward_that_is_not_a_number_is_an_error() {
    let mut ppo = Ppo::new(hyperparameters(), one_step::agent(0.5));
    let mut rng = Seed(0).stream(Stream::Update, 0);
    let batch = one_step::batch(ppo.agent(), 64, |_, _| f64::NAN, &mut rng);
    assert!(matches!(
        ppo.update(&batch, &mut rng),
        Err(AlgoError::Diverged { .. })
    ));
}

#[test]
fn without_any_reward_the_policy_stands_still() {
    let mut ppo = Ppo::new(hyperparameters(), one_step::agent(0.5));
    let before = ppo.agent().policy.clone();
    train(
        &mut ppo,
        3,
        |_, _| 0.0,
        &mut Seed(0).stream(Stream::Update, 0),
    );
    assert_eq!(ppo.agent().policy, before);
}

#[test]
fn it_learns_a_dense_reward() {
    fn reward(s: f64, a: f64) -> f64 {
        -(a - s).powi(2)
    }
    let mut ppo = Ppo::new(hyperparameters(), one_step::agent(0.5));
    let before = one_step::score(ppo.agent(), reward);
    train(&mut ppo, 30, reward, &mut Seed(0).stream(Stream::Update, 0));
    let after = one_step::score(ppo.agent(), reward);
    assert!(before < -0.25 && after > -0.02, "from {before} to {after}");
}

#[test]
fn the_gradient_of_the_clipped_surrogate_and_a_step_are_numpys() {
    let reference = reference::reference();
    let (batch, other) = (reference.batch(), reference.agent(&reference.other_policy));
    let (mut pass, mut old) = (Pass::default(), vec![0.0; 12]);
    other.policy.forward(&batch.observations, &mut pass);
    other
        .policy
        .log_densities(pass.output(), &batch.actions, &mut old);
    let unbounded = Hyperparameters {
        learning_rate: constant(1e-2),
        max_gradient_norm: constant(1e6),
        ..Hyperparameters::for_env(EnvId::Hopper)
    };
    let mut ppo = Ppo::new(unbounded, reference.agent(&reference.policy));
    let Ppo {
        hyperparameters,
        state: State {
            agent, optimizer, ..
        },
        buffers,
    } = &mut ppo;
    let (advantages, order): (_, Vec<usize>) = (&reference.ppo.advantages, (0..12).collect());
    let outside = step(
        hyperparameters,
        agent,
        optimizer,
        &batch,
        advantages,
        &old,
        &order,
        buffers,
    );
    assert_eq!(outside, reference.ppo.outside);
    reference::assert_near(
        &buffers.gradient,
        &reference.ppo.gradient,
        10.0 * reference::ROUNDING,
    );
    reference::assert_near(
        &agent.policy.parameters(),
        &reference.ppo.after,
        reference::ROUNDING,
    );
}

/// The clipped surrogate written out sample by sample, and its slope by finite differences.
#[test]
fn one_step_goes_up_the_clipped_surrogate() {
    let mut rng = Seed(4).stream(Stream::Action, 0);
    let unscaled = Hyperparameters {
        normalize_advantages: false,
        max_gradient_norm: constant(1e6),
        ..hyperparameters()
    };
    let mut ppo = Ppo::new(unscaled, one_step::agent(0.5));
    let batch = one_step::batch(ppo.agent(), 300, |_, _| 0.0, &mut rng);
    let advantages: Vec<f64> = batch.actions.iter().map(|&a| f64::from(a.sin())).collect();
    // Old densities some way off, so that about half of the ratios are clipped.
    let mut old = vec![0.0; 300];
    let mut pass = Pass::default();
    ppo.state
        .agent
        .policy
        .forward(&batch.observations, &mut pass);
    ppo.state
        .agent
        .policy
        .log_densities(pass.output(), &batch.actions, &mut old);
    old.iter_mut()
        .enumerate()
        .for_each(|(i, density)| *density += 0.4 * (i as f64).sin());

    let surrogate = |policy: &crate::nn::GaussianPolicy| {
        let mut pass = Pass::default();
        let mut densities = vec![0.0; 300];
        policy.forward(&batch.observations, &mut pass);
        policy.log_densities(pass.output(), &batch.actions, &mut densities);
        (0..300)
            .map(|i| {
                let ratio = (densities[i] - old[i]).exp();
                (ratio * advantages[i]).min(ratio.clamp(0.8, 1.2) * advantages[i]) / 300.0
            })
            .sum::<f64>()
    };
    let order: Vec<usize> = (0..300).collect();
    let start = ppo.state.agent.policy.clone();
    let Ppo {
        hyperparameters,
        state: State {
            agent, optimizer, ..
        },
        buffers,
    } = &mut ppo;
    let clipped = step(
        hyperparameters,
        agent,
        optimizer,
        &batch,
        &advantages,
        &old,
        &order,
        buffers,
    );
    assert!(clipped > 50 && clipped < 250, "{clipped}");
    // Adam was handed the gradient's negative.
    let gradient: Vec<f32> = buffers.gradient.iter().map(|g| -g).collect();
    let norm = dot(&gradient, &gradient).sqrt();
    let at = |h: f64| {
        let mut policy = start.clone();
        let moved: Vec<f32> = policy
            .parameters()
            .iter()
            .zip(&gradient)
            .map(|(&p, &g)| p + (h * f64::from(g) / norm) as f32)
            .collect();
        policy.set_parameters(&moved);
        surrogate(&policy)
    };
    let slope = (at(1e-3) - at(-1e-3)) / 2e-3;
    assert!((slope - norm).abs() < 0.02 * norm, "{slope} against {norm}");
}

#[test]
fn a_restored_run_goes_on_with_the_same_bits() {
    let mut first = Ppo::new(hyperparameters(), one_step::agent(0.5));
    let mut rng = Seed(0).stream(Stream::Update, 0);
    train(&mut first, 2, |_, a| a, &mut rng);
    let mut second = Ppo::new(hyperparameters(), one_step::agent(0.3));
    second.restore(&first.save()).expect("the same shapes");
    let mut same_rng = rng.clone();
    train(&mut first, 2, |_, a| a, &mut rng);
    train(&mut second, 2, |_, a| a, &mut same_rng);
    assert_eq!(first.save(), second.save());
    assert!(second.restore(&[1, 2, 3]).is_err());
}
