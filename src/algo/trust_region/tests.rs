use super::*;
use crate::{
    algo::one_step,
    rng::{Seed, Stream},
    solver::dot,
};

/// Where each sample stands four times, one of four says all.
#[test]
fn a_thinned_fisher_matrix_is_that_of_evenly_spaced_samples() {
    let agent = one_step::agent(0.5);
    let some = DMatrix::from_fn(1, 30, |_, i| (0.7 * i as f32).sin());
    let all = DMatrix::from_fn(1, 120, |_, i| some[i / 4]);
    let g: Vec<f32> = (0..agent.policy.dim())
        .map(|i| (1.3 * i as f32).cos())
        .collect();
    let step = |observations: &DMatrix<f32>, fisher_samples: i64| {
        let region = TrustRegion {
            max_kl: constant(1e-2),
            cg_iterations: constant(8),
            fisher_samples: constant(fisher_samples),
            ..TrustRegion::default()
        };
        let mut pass = Pass::default();
        agent.policy.forward(observations, &mut pass);
        region.step(&agent.policy, observations, &mut pass, &g, None)
    };
    assert_eq!(step(&all, 30), step(&some, 30));
    assert_eq!(
        step(&all, 39),
        step(&some, 30),
        "as few as an even spacing needs"
    );
    let (thinned, whole) = (step(&all, 30), step(&all, 120));
    assert!(
        thinned != whole,
        "sums of four times as many samples round otherwise"
    );
    assert!(
        (thinned.q / whole.q - 1.0).abs() < 1e-5,
        "{} and {}",
        thinned.q,
        whole.q
    );
}

/// The step's pass serves the way back too: to the bit, whether the matrix is thinned or not.
#[test]
fn the_way_back_is_solved_for_with_the_pass_of_the_step() {
    let agent = one_step::agent(0.5);
    let observations = DMatrix::from_fn(1, 120, |_, i| (0.7 * i as f32).sin());
    let b: Vec<f32> = (0..agent.policy.dim())
        .map(|i| (1.3 * i as f32).cos())
        .collect();
    for fisher_samples in [30, 120] {
        let region = TrustRegion {
            cg_iterations: constant(8),
            fisher_samples: constant(fisher_samples),
            ..TrustRegion::default()
        };
        let mut pass = Pass::default();
        agent.policy.forward(&observations, &mut pass);
        let step = region.step(&agent.policy, &observations, &mut pass, &b, None);
        let way_back = region.way_back(&agent.policy, &observations, &mut pass, &b);
        assert_eq!(way_back.slope, step.q);
    }
}

#[test]
fn the_gradient_is_the_slope_of_the_measured_gain() {
    let agent = one_step::agent(0.5);
    let batch = one_step::batch(
        &agent,
        200,
        |_, _| 0.0,
        &mut Seed(2).stream(Stream::Action, 0),
    );
    let advantages: Vec<f64> = batch
        .actions
        .iter()
        .map(|&a| f64::from(a) * 2.0 + 0.3)
        .collect();
    let (mut pass, mut trial_pass) = (Pass::default(), Pass::default());
    let surrogate = Surrogate::new(&agent.policy, &batch, &advantages, &mut pass);
    let gradient = surrogate.gradient(&agent.policy, &mut pass);

    let here = surrogate.measure(&agent.policy, &mut trial_pass);
    assert_eq!(
        (here.gain, here.kl),
        (0.0, 0.0),
        "the old policy gains nothing over itself"
    );

    // Along the gradient itself and along log_std alone. A central difference of step h is off
    // by O(h^2) and by f32 rounding of the densities over h: at h = 3e-3 both are far below the
    // tolerance of 1 %.
    let mut along_log_std = vec![0.0; gradient.len()];
    along_log_std[gradient.len() - 1] = 1.0;
    let norm = dot(&gradient, &gradient).sqrt() as f32;
    let unit: Vec<f32> = gradient.iter().map(|g| g / norm).collect();
    for direction in [unit, along_log_std] {
        let mut gain_at = |h: f32| {
            let mut trial = agent.policy.clone();
            let moved: Vec<f32> = trial
                .parameters()
                .iter()
                .zip(&direction)
                .map(|(p, along)| p + h * along)
                .collect();
            trial.set_parameters(&moved);
            surrogate.measure(&trial, &mut trial_pass).gain
        };
        let slope = (gain_at(3e-3) - gain_at(-3e-3)) / 6e-3;
        let expected = dot(&gradient, &direction);
        assert!(
            (slope - expected).abs() < 0.01 * expected.abs(),
            "{slope} against {expected}"
        );
    }
}
