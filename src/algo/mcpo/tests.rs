use super::{iteration::D_MARGIN, *};
use crate::{
    algo::{
        one_step, ppo,
        tolerance::Tolerance,
        trust_region::{KL_MARGIN, TrustRegion},
    },
    demo::Standardizer,
    env::EnvId,
    quantity::constant,
    rng::Stream,
};

/// Pays only for actions that a policy near zero never takes; the demonstration comes near, and
/// gets nothing.
fn sparse(s: f64, a: f64) -> f64 {
    f64::from((a - s - 3.5).abs() < 0.3)
}

fn hyperparameters(samples: Samples, d: f64) -> Hyperparameters {
    let table1 = Hyperparameters::for_env(EnvId::InvertedPendulum);
    Hyperparameters {
        d: Tolerance::Absolute(constant(d)),
        epsilon: constant(0.05),
        region: TrustRegion {
            max_kl: constant(2e-2),
            ..table1.region
        },
        critic: critic::Hyperparameters {
            learning_rate: constant(1e-2),
            ..table1.critic
        },
        recovery_learning_rate: constant(3e-3),
        mmd: mimicry::Hyperparameters {
            samples,
            ..Default::default()
        },
        ..table1
    }
}

fn mcpo(samples: Samples, d: f64) -> Mcpo {
    let demonstration = one_step::demonstration(100, |s| s + 2.9);
    Mcpo::new(
        hyperparameters(samples, d),
        one_step::agent(0.5),
        &demonstration,
        Seed(0),
    )
}

fn train(
    mcpo: &mut Mcpo,
    iterations: usize,
    reward: fn(f64, f64) -> f64,
    rng: &mut Rng,
) -> Vec<Update> {
    (0..iterations)
        .map(|_| {
            let batch = one_step::batch(mcpo.agent(), 512, reward, rng);
            mcpo.update(&batch, rng).expect("finite")
        })
        .collect()
}

#[test]
fn a_reward_that_is_not_a_number_is_an_error_and_moves_nothing() {
    let mut mcpo = mcpo(Samples::DemoStates, 10.0);
    let before = mcpo.agent().policy.clone();
    let mut rng = Seed(0).stream(Stream::Update, 0);
    let batch = one_step::batch(mcpo.agent(), 64, |_, _| f64::NAN, &mut rng);
    assert!(mcpo.update(&batch, &mut rng).is_err());
    assert_eq!(mcpo.agent().policy, before);
}

/// The demonstration leads to where a reward is; the reward then leads beyond the demonstration.
#[test]
fn it_learns_a_sparse_reward_that_ppo_never_sees() {
    for samples in [Samples::DemoStates, Samples::Rollout] {
        let d = if samples == Samples::DemoStates {
            5e-2
        } else {
            0.2
        };
        let mut mcpo = mcpo(samples, d);
        train(
            &mut mcpo,
            120,
            sparse,
            &mut Seed(0).stream(Stream::Update, 0),
        );
        let score = one_step::score(mcpo.agent(), sparse);
        assert!(score > 0.8, "{samples:?}: {score}");
    }
    let hyperparameters = ppo::Hyperparameters {
        learning_rate: constant(3e-3),
        minibatch: constant(128),
        ..ppo::Hyperparameters::for_env(EnvId::InvertedPendulum)
    };
    let mut ppo = ppo::Ppo::new(hyperparameters, one_step::agent(0.5));
    let mut rng = Seed(0).stream(Stream::Update, 0);
    for _ in 0..120 {
        let batch = one_step::batch(ppo.agent(), 512, sparse, &mut rng);
        ppo.update(&batch, &mut rng).expect("finite");
    }
    assert_eq!(one_step::score(ppo.agent(), sparse), 0.0);
}

#[test]
fn no_step_breaks_the_kl_or_leaves_the_tolerance() {
    let mut mcpo = mcpo(Samples::DemoStates, 5e-2);
    let updates = train(
        &mut mcpo,
        60,
        sparse,
        &mut Seed(1).stream(Stream::Update, 0),
    );
    let mut cases = std::collections::BTreeSet::new();
    for update in &updates {
        let case = update.case.as_deref().expect("every update has a case");
        cases.insert(case);
        if case != "infeasible" {
            assert!(
                update.kl.expect("measured") <= KL_MARGIN * 2e-2,
                "{update:?}"
            );
        }
        let bound = update.mmd.zip(update.d).map(|(mmd, d)| mmd.max(d));
        assert!(
            update.mmd_after <= bound.map(|bound| (1.0 + D_MARGIN) * bound),
            "{update:?}"
        );
    }
    assert!(
        cases.contains("infeasible") && cases.len() >= 2,
        "{cases:?}"
    );
}

/// The reward pulls away along the curved constraint: corrected steps go the whole way and stay at
/// the bound, and halved ones crawl.
#[test]
fn corrections_let_whole_steps_pass_along_the_bound() {
    let steps = |max_corrections: i64| {
        let h = Hyperparameters {
            max_corrections: constant(max_corrections),
            epsilon: constant(0.0),
            ..hyperparameters(Samples::DemoStates, 1e-3)
        };
        let mut mcpo = Mcpo::new(
            h,
            one_step::agent(0.5),
            &one_step::demonstration(100, |s| s),
            Seed(0),
        );
        let updates = train(
            &mut mcpo,
            40,
            |s, a| a * s.abs(),
            &mut Seed(0).stream(Stream::Update, 0),
        );
        let late = &updates[20..];
        assert!(
            late.iter()
                .all(|update| update.mmd_after <= Some((1.0 + D_MARGIN) * 1e-3)),
            "{late:?}"
        );
        assert!(
            late.iter()
                .all(|update| update.corrections <= Some(max_corrections as u64)),
            "{late:?}"
        );
        let corrected = late
            .iter()
            .filter_map(|update| update.corrections)
            .sum::<u64>();
        (
            late.iter()
                .filter_map(|update| update.step_fraction)
                .sum::<f64>()
                / 20.0,
            corrected,
        )
    };
    let ((halved, none), (whole, some)) = (steps(0), steps(3));
    assert!(
        whole > 1.5 * halved && none == 0 && some > 0,
        "{halved}, {whole}; {some} corrections"
    );
}

#[test]
fn recovery_goes_as_far_below_the_tolerance_as_it_is_told() {
    for depth in [1.0, 0.01] {
        let h = Hyperparameters {
            recovery_depth: constant(depth),
            recovery_steps: constant(5000),
            ..hyperparameters(Samples::DemoStates, 1e-2)
        };
        let mut mcpo = Mcpo::new(
            h,
            one_step::agent(0.5),
            &one_step::demonstration(100, |s| s + 2.9),
            Seed(0),
        );
        let update = &train(&mut mcpo, 1, sparse, &mut Seed(0).stream(Stream::Update, 0))[0];
        assert_eq!(update.case.as_deref(), Some("infeasible"));
        let after = update.mmd_after.expect("measured");
        assert!(
            after <= depth * 1e-2 && after > 0.5 * depth * 1e-2,
            "{depth}: {after}"
        );
    }
}

#[test]
fn a_relative_tolerance_is_a_share_of_what_doing_nothing_has() {
    let demonstration = one_step::demonstration(100, |s| s + 1.0);
    let h = Hyperparameters {
        d: Tolerance::Relative(constant(0.25)),
        ..hyperparameters(Samples::DemoStates, 1.0)
    };
    let mcpo = Mcpo::new(h, one_step::agent(0.5), &demonstration, Seed(0));
    let states =
        Standardizer::new(&demonstration.observations).standardize(&demonstration.observations);
    // Eq. (4) by plain loops, sigma 1.
    let kernel =
        |x: (f64, f64), y: (f64, f64)| (-((x.0 - y.0).powi(2) + (x.1 - y.1).powi(2)) / 2.0).exp();
    let shown: Vec<_> = (0..100)
        .map(|i| (f64::from(states[(0, i)]), demonstration.actions[(0, i)]))
        .collect();
    let still: Vec<_> = shown.iter().map(|&(s, _)| (s, 0.0)).collect();
    let mean = |a: &[(f64, f64)], b: &[(f64, f64)]| {
        a.iter()
            .flat_map(|&x| b.iter().map(move |&y| kernel(x, y)))
            .sum::<f64>()
            / 1e4
    };
    let of_nothing = mean(&shown, &shown) + mean(&still, &still) - 2.0 * mean(&shown, &still);
    assert!(
        (mcpo.state.tolerance - 0.25 * of_nothing).abs() < 1e-5 * of_nothing,
        "{}",
        mcpo.state.tolerance
    );
}

/// Nothing is paid; D curves on the way, and the step that reaches the tolerance in the linear
/// model does not in truth.
#[test]
fn a_step_that_falls_short_of_the_tolerance_is_followed_by_recovery() {
    let demonstration = one_step::demonstration(100, |s| s + 1.2);
    let h = hyperparameters(Samples::DemoStates, 1e-3);
    let region = TrustRegion {
        max_kl: constant(2.0),
        ..h.region
    };
    let h = Hyperparameters {
        region,
        max_corrections: constant(0),
        ..h
    };
    let mut mcpo = Mcpo::new(h, one_step::agent(0.5), &demonstration, Seed(0));
    let updates = train(
        &mut mcpo,
        2,
        |_, _| 0.0,
        &mut Seed(0).stream(Stream::Update, 0),
    );
    for update in &updates {
        assert!(
            update.mmd_after <= update.d.map(|d| (1.0 + D_MARGIN) * d),
            "{update:?}"
        );
    }
    assert_eq!(
        updates[0].case.as_deref(),
        Some("degenerate_g"),
        "the linear model sees a way"
    );
    assert!(updates[0].recovery_steps.is_some_and(|steps| steps > 0));
}

#[test]
fn the_tolerance_grows_by_its_factor_up_to_its_ceiling() {
    let mut mcpo = mcpo(Samples::DemoStates, 1.0);
    mcpo.hyperparameters.max_d = Some(constant(1.1));
    let updates = train(&mut mcpo, 4, sparse, &mut Seed(0).stream(Stream::Update, 0));
    let d: Vec<f64> = updates.iter().filter_map(|update| update.d).collect();
    assert_eq!(d, [1.0, 1.05, 1.1, 1.1]);
}

#[test]
fn without_reward_and_within_the_tolerance_the_policy_stands_still() {
    let mut mcpo = mcpo(Samples::DemoStates, 10.0);
    let before = mcpo.agent().policy.clone();
    let updates = train(
        &mut mcpo,
        2,
        |_, _| 0.0,
        &mut Seed(0).stream(Stream::Update, 0),
    );
    assert_eq!(mcpo.agent().policy, before);
    assert!(
        updates
            .iter()
            .all(|update| update.case.as_deref() == Some("degenerate_g"))
    );
}

#[test]
fn a_restored_run_goes_on_with_the_same_bits() {
    for samples in [Samples::DemoStates, Samples::Rollout] {
        let mut first = mcpo(samples, 5e-2);
        let mut rng = Seed(0).stream(Stream::Update, 0);
        train(&mut first, 3, sparse, &mut rng);
        let mut second = mcpo(samples, 5e-2);
        second.restore(&first.save()).expect("the same shapes");
        let mut same_rng = rng.clone();
        train(&mut first, 3, sparse, &mut rng);
        train(&mut second, 3, sparse, &mut same_rng);
        assert_eq!(first.save(), second.save());
    }
}
