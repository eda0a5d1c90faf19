use super::*;
use crate::report::fixture;

/// The return of this score.
fn worth(env: &str, score: f64) -> f64 {
    let scale = reference::scale(env).expect("known");
    scale.random + score * scale.distance
}

fn runs(algorithm: &str, env: &str, scores: &[f64]) -> Vec<Run> {
    let run = |(seed, score): (usize, &f64)| {
        let run = fixture::run(algorithm, &format!("env = [{env:?}]\nseed = [{seed}]"));
        run.finished(&[
            (0, &[worth(env, 0.0)]),
            (50, &[worth(env, *score)]),
            (100, &[worth(env, *score)]),
        ])
    };
    scores.iter().enumerate().map(run).collect()
}

fn statistics(runs: &[Run]) -> Option<StatisticsData> {
    StatisticsData::new(runs, &Identities::new(&runs.iter().collect::<Vec<_>>()))
}

#[test]
fn one_environment_needs_no_summary() {
    assert_eq!(statistics(&runs("mcpo", "Hopper-v2", &[0.5, 0.6])), None);
    assert_eq!(statistics(&[]), None);
}

#[test]
fn returns_are_measured_by_the_papers_expert_and_random() {
    let mut all = runs("ppo", "Hopper-v2", &[0.1, 0.3]);
    all.extend(runs("ppo", "Ant-v2", &[0.2]));
    all.extend(runs("mcpo", "Hopper-v2", &[0.6, 0.8]));
    all.extend(runs("mcpo", "Ant-v2", &[0.2, 1.2]));
    let data = statistics(&all).expect("two environments");
    let close =
        |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
    let [ppo, mcpo] = data.methods.as_slice() else {
        panic!("{:?}", data.methods)
    };
    assert_eq!(
        (ppo.label.text.as_str(), mcpo.label.text.as_str(), data.base),
        ("PPO", "MCPO", 1)
    );
    assert_eq!((ppo.environments, ppo.scores, mcpo.scores), (2, 3, 4));
    close(ppo.aggregates.mean.value, 0.2);
    close(mcpo.aggregates.mean.value, 0.7);
    close(mcpo.aggregates.iqm.value, 0.7);
    // Short of 1 by 0.4 and 0.2 in Hopper, by 0.8 and 0 in Ant.
    close(mcpo.aggregates.optimality_gap.value, (0.3 + 0.4) / 2.0);
    // From 0 to the score in the first half of the steps.
    close(mcpo.area.expect("finished"), 0.75 * 0.7);
    // Three of the four reach one half, at half of their 100 steps; of PPO none.
    assert_eq!((mcpo.half, ppo.half), (0.5, f64::INFINITY));
    // Hopper: all of 4 pairs; Ant: 0.2 against 0.2 is even, 1.2 above.
    close(ppo.below_base.expect("compared").value, (1.0 + 0.75) / 2.0);
    assert_eq!(mcpo.below_base, None);
    let above_half = data.profile.panels[0].curves[1].as_ref().expect("a curve");
    let at_half = above_half
        .points
        .iter()
        .find(|point| point.env_steps >= HALF)
        .expect("it is on the axis");
    close(at_half.mean, 0.75);
}

#[test]
fn a_run_that_failed_counts_and_an_environment_that_a_method_lacks_does_not() {
    let mut all = runs("mcpo", "Hopper-v2", &[0.6, 0.8]);
    all.extend(runs("mcpo", "Ant-v2", &[0.4]));
    all.extend(runs("mcpo", "HalfCheetah-v2", &[1.0, 1.0]));
    all.extend(runs("ppo", "Ant-v2", &[0.4]));
    assert_eq!(statistics(&all), None, "they share one alone");
    all.extend(runs("ppo", "Hopper-v2", &[0.1]));
    all.push(fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 2).failed("diverged"));
    let data = statistics(&all).expect("two environments");
    assert!((data.methods[0].aggregates.mean.value - (1.4 / 3.0 + 0.4) / 2.0).abs() < 1e-9);
    assert_eq!(
        (data.methods[0].environments, data.methods[0].scores),
        (2, 4)
    );
    let told = data.notes.join("\n");
    let left_out = "not every method here has a finished run there: HalfCheetah-v2.";
    assert!(
        told.contains("Runs that failed have score 0: 1.") && told.contains(left_out),
        "{told}"
    );
}
