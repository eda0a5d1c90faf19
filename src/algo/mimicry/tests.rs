use super::*;
use crate::{
    algo::{Segment, SegmentEnd, one_step},
    solver::dot,
};

fn mimicry(samples: Samples, demonstration: &Demonstration) -> Mimicry {
    let hyperparameters = Hyperparameters {
        samples,
        ..Hyperparameters::default()
    };
    Mimicry::new(hyperparameters, demonstration, &[16, 16], Seed(0))
}

fn costs(discount: f64) -> critic::Hyperparameters {
    critic::Hyperparameters {
        discount: constant(discount),
        gae_lambda: constant(1.0),
        learning_rate: constant(1e-3),
        l2_penalty: constant(0.0),
        value_epochs: constant(1),
        minibatch: constant(256),
    }
}

fn moved(policy: &GaussianPolicy, direction: &[f32], h: f64) -> GaussianPolicy {
    let mut policy = policy.clone();
    let parameters: Vec<f32> = policy
        .parameters()
        .iter()
        .zip(direction)
        .map(|(&p, &d)| p + (h * f64::from(d)) as f32)
        .collect();
    policy.set_parameters(&parameters);
    policy
}

fn unit(gradient: &[f32]) -> Vec<f32> {
    let norm = dot(gradient, gradient).sqrt() as f32;
    gradient.iter().map(|g| g / norm).collect()
}

#[test]
fn at_the_demonstrations_states_b_is_the_slope_of_d() {
    let demonstration = one_step::demonstration(40, |s| 0.8 * s + 0.5);
    let agent = one_step::agent(0.5);
    let mut mimicry = mimicry(Samples::DemoStates, &demonstration);
    let batch = one_step::batch(
        &agent,
        64,
        |_, _| 0.0,
        &mut Seed(5).stream(Stream::Action, 0),
    );
    let advantages = vec![0.0; 64];
    let mut pass = Pass::default();
    let surrogate = Surrogate::new(&agent.policy, &batch, &advantages, &mut pass);
    let mut rng = Seed(5).stream(Stream::Update, 0);
    let measured = mimicry
        .measure(&agent, &surrogate, &mut pass, &costs(0.9), &mut rng)
        .expect("finite");
    assert_eq!(mimicry.at(&measured, &agent.policy, &[]), measured.mmd);
    assert_eq!(
        measured.gradient.last(),
        Some(&0.0),
        "the mean action does not know log_std"
    );
    let direction = unit(&measured.gradient);
    let at =
        |mimicry: &mut Mimicry, h| mimicry.at(&measured, &moved(&agent.policy, &direction, h), &[]);
    let slope = (at(&mut mimicry, 1e-2) - at(&mut mimicry, -1e-2)) / 2e-2;
    let expected = dot(&measured.gradient, &direction);
    assert!(
        (slope - expected).abs() < 0.01 * expected,
        "{slope} against {expected}"
    );
}

/// In one-step episodes D can be followed without the score function: the same noise under a
/// moved policy gives moved samples, and MMD^2 is measured again on them.
#[test]
fn from_a_rollout_b_is_the_slope_of_d_measured_anew() {
    const N: usize = 6000;
    let demonstration = one_step::demonstration(200, |s| 0.8 * s + 0.5);
    let agent = one_step::agent(0.5);
    let mut mimicry = mimicry(Samples::Rollout, &demonstration);
    let batch = one_step::batch(
        &agent,
        N,
        |_, _| 0.0,
        &mut Seed(6).stream(Stream::Action, 0),
    );
    let advantages = vec![0.0; N];
    let mut pass = Pass::default();
    let surrogate = Surrogate::new(&agent.policy, &batch, &advantages, &mut pass);
    let means = pass.output().into_owned();
    let mut rng = Seed(6).stream(Stream::Update, 0);
    let measured = mimicry
        .measure(&agent, &surrogate, &mut pass, &costs(0.0), &mut rng)
        .expect("finite");

    let states = mimicry.standardizer.standardize(&batch.raw_observations);
    let direction = unit(&measured.gradient);
    let mut anew = |h: f64| {
        let policy = moved(&agent.policy, &direction, h);
        let stretch = (policy.log_std()[0] - agent.policy.log_std()[0]).exp();
        policy.forward(&batch.observations, &mut pass);
        let actions = DMatrix::from_fn(1, N, |_, i| {
            pass.output()[(0, i)] + stretch * (batch.actions[(0, i)] - means[(0, i)])
        });
        mimicry.target.mmd_squared(&stack(&states, &actions))
    };
    let slope = (anew(0.02) - anew(-0.02)) / 0.04;
    let expected = dot(&measured.gradient, &direction);
    // The score function's Monte Carlo error inflates |b|: about 2 % of it with 6000 samples;
    // five times that.
    assert!(
        (slope - expected).abs() < 0.1 * expected,
        "{slope} against {expected}"
    );
}

/// Every step's action is drawn alike, but one above 0.3 ends its episode. The samples'
/// distribution is then the policy's, however long episodes are, and so is D's slope, which
/// backpropagation through the actions tells exactly.
#[test]
fn an_episodes_end_is_neither_a_gain_nor_a_loss() {
    const N: usize = 8000;
    let demonstration = one_step::demonstration(200, |_| 1.5);
    let agent = one_step::agent(0.5);
    let mut mimicry = mimicry(Samples::Rollout, &demonstration);
    let mut batch = one_step::batch(
        &agent,
        N,
        |_, _| 0.0,
        &mut Seed(7).stream(Stream::Action, 0),
    );
    batch.segments.clear();
    let mut start = 0;
    for end in (1..=N).filter(|&end| batch.actions[(0, end - 1)] > 0.3) {
        batch.segments.push(Segment {
            range: start..end,
            end: SegmentEnd::Terminated,
        });
        start = end;
    }
    batch.segments.push(Segment {
        range: start..N,
        end: SegmentEnd::Bootstrapped {
            last_observation: vec![0.0],
        },
    });
    let advantages = vec![0.0; N];
    let mut pass = Pass::default();
    let surrogate = Surrogate::new(&agent.policy, &batch, &advantages, &mut pass);
    let noise = &batch.actions - pass.output();
    let mut rng = Seed(7).stream(Stream::Update, 0);
    let measured = mimicry
        .measure(&agent, &surrogate, &mut pass, &costs(0.99), &mut rng)
        .expect("finite");

    let points = stack(
        &mimicry.standardizer.standardize(&batch.raw_observations),
        &batch.actions,
    );
    let mut by_points = DMatrix::zeros(2, N);
    mimicry.target.mmd_squared_gradient(&points, &mut by_points);
    let by_actions = by_points.rows(1, 1).into_owned();
    let mut expected = vec![0.0; agent.policy.dim()];
    agent
        .policy
        .mean_gradient(&batch.observations, &mut pass, &by_actions, &mut expected);
    *expected.last_mut().expect("log_std") = by_actions.dot(&noise);
    let error: Vec<f32> = measured
        .gradient
        .iter()
        .zip(&expected)
        .map(|(b, e)| b - e)
        .collect();
    let relative = (dot(&error, &error) / dot(&expected, &expected)).sqrt();
    assert!(relative < 0.15, "{relative}");
}

#[test]
fn recovery_reaches_the_tolerance_and_stops_there() {
    let demonstration = one_step::demonstration(40, |s| 0.8 * s + 0.5);
    let mut agent = one_step::agent(0.5);
    let mut mimicry = mimicry(Samples::DemoStates, &demonstration);
    let descent = mimicry
        .descend(&mut agent, 1e-4, 2000, 3e-3)
        .expect("finite");
    assert!(
        descent.steps > 10 && descent.steps < 2000 && descent.after <= 1e-4,
        "{descent:?}"
    );
    let again = mimicry
        .descend(&mut agent, 1e-4, 2000, 3e-3)
        .expect("finite");
    assert_eq!(
        again.steps, 0,
        "a policy within the tolerance is left alone"
    );
}
