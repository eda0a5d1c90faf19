use super::*;
use crate::report::fixture;

/// Expert - Random is 3346.71 in Hopper-v2.
const ENV: &str = "Hopper-v2";

fn claim(text: &str) -> Claim {
    toml::from_str(&format!("name = 'c'\n{text}")).expect("a claim")
}

fn mcpo(env: &str, d: f64, returns: &[f64]) -> Vec<Run> {
    let run = |(seed, value): (u64, &f64)| {
        fixture::mcpo(env, d, 1e-3, seed).finished(&[(100, &[*value])])
    };
    (0..).zip(returns).map(run).collect()
}

fn ppo(env: &str, returns: &[f64]) -> Vec<Run> {
    let run = |(seed, value): (u64, &f64)| fixture::ppo(env, seed).finished(&[(100, &[*value])]);
    (0..).zip(returns).map(run).collect()
}

fn judged(text: &str, runs: &[Vec<Run>]) -> Vec<ClaimRow> {
    ClaimsData::new(&[claim(text)], &runs.concat()).rows
}

fn verdict(text: &str, runs: &[Vec<Run>]) -> ClaimVerdict {
    let rows = judged(text, runs);
    assert_eq!(rows.len(), 1, "{rows:?}");
    rows[0].verdict.clone()
}

const ABOVE_PPO: &str = "of = 'algorithm=mcpo'\nis = 'above'\nthan = 'algorithm=ppo'";

#[test]
fn what_cannot_be_judged_says_why() {
    let reason = |text: &str, runs: &[Vec<Run>]| match verdict(text, runs) {
        ClaimVerdict::Inconclusive(Some(reason)) => reason.to_string(),
        other => panic!("{other:?}"),
    };
    let three = [1.0, 2.0, 3.0];
    assert_eq!(
        reason(ABOVE_PPO, &[mcpo(ENV, 1e-4, &three)]),
        "the file has no such runs"
    );
    assert_eq!(
        reason(ABOVE_PPO, &[ppo(ENV, &three)]),
        "the file has no such runs"
    );
    let few = [mcpo(ENV, 1e-4, &three), ppo(ENV, &[1.0, 2.0])];
    assert_eq!(
        reason(ABOVE_PPO, &few),
        "2 seeds in Hopper-v2; 3 are needed"
    );
    assert_eq!(
        reason(
            "of = 'algorithm=ppo'\nis = 'below'\nthan = 'algorithm=mcpo'\non = 'mmd'",
            &[ppo(ENV, &three), mcpo(ENV, 1e-4, &three)]
        ),
        "ppo records no mmd in Hopper-v2"
    );
    let than_two = "of = 'algorithm=ppo'\nis = 'below'\nthan = 'algorithm=mcpo'";
    let two = [
        mcpo(ENV, 1e-4, &three),
        mcpo(ENV, 1e-2, &three),
        ppo(ENV, &three),
    ];
    assert_eq!(
        reason(than_two, &two),
        "the runs that they are compared with differ in d"
    );
    let demonstration = "of = 'algorithm=mcpo'\nis = 'above'\nthan = 'demonstration'";
    assert!(reason(demonstration, &[mcpo(ENV, 1e-4, &three)]).contains("is not recorded"));
}

#[test]
fn a_difference_holds_is_contradicted_or_says_nothing() {
    let than_ppo = |returns: &[f64]| {
        verdict(
            ABOVE_PPO,
            &[mcpo(ENV, 1e-4, returns), ppo(ENV, &[100.0, 110.0, 90.0])],
        )
    };
    assert_eq!(than_ppo(&[500.0, 510.0, 490.0]), ClaimVerdict::Holds);
    assert_eq!(than_ppo(&[20.0, 10.0, 0.0]), ClaimVerdict::Contradicted);
    assert_eq!(
        than_ppo(&[90.0, 120.0, 105.0]),
        ClaimVerdict::Inconclusive(None)
    );
    // The margin is 669 here.
    let by_a_fifth = format!("{ABOVE_PPO}\nmargin = 0.2");
    let runs = [
        mcpo(ENV, 1e-4, &[500.0, 510.0, 490.0]),
        ppo(ENV, &[100.0, 110.0, 90.0]),
    ];
    assert_eq!(verdict(&by_a_fifth, &runs), ClaimVerdict::Contradicted);
    let not_worse = "of = 'algorithm=ppo'\nis = 'above'\nthan = 'algorithm=mcpo'\nmargin = -0.2";
    assert_eq!(verdict(not_worse, &runs), ClaimVerdict::Holds);
    assert_eq!(
        verdict(
            "of = 'algorithm=ppo'\nis = 'below'\nthan = 'algorithm=mcpo'",
            &runs
        ),
        ClaimVerdict::Holds
    );
    let like = "of = 'algorithm=ppo'\nis = 'like'\nthan = 'algorithm=mcpo'\nmargin";
    assert_eq!(
        verdict(&format!("{like} = 0.2"), &runs),
        ClaimVerdict::Holds
    );
    assert_eq!(
        verdict(&format!("{like} = 0.05"), &runs),
        ClaimVerdict::Contradicted
    );
}

/// `scipy.stats.ttest_ind([500, 540, 490], [100, 130, 80, 90], equal_var=False)` (SciPy 1.17.1),
/// its `confidence_interval(0.95)` and `pvalue`.
#[test]
fn the_numbers_are_those_of_scipy() {
    let runs = [
        mcpo(ENV, 1e-4, &[500.0, 540.0, 490.0]),
        ppo(ENV, &[100.0, 130.0, 80.0, 90.0]),
    ];
    let rows = judged(ABOVE_PPO, &runs);
    let found = rows[0].difference.expect("enough seeds");
    assert!((found.mean - 410.0).abs() < 1e-9, "{found:?}");
    assert!(
        (found.low - 357.28989259648824).abs() < 1e-6
            && (found.high - 462.71010740351176).abs() < 1e-6,
        "{found:?}"
    );
    let (opposite, itself) = rows[0].p.expect("judged");
    assert!(
        (opposite - 3.4244216830404264e-05).abs() < 1e-9 && itself == 1.0,
        "{opposite} {itself}"
    );
    assert_eq!(
        (
            rows[0].improvement,
            rows[0].seeds.found,
            rows[0].than.map(|than| than.found)
        ),
        (Some(1.0), 3, Some(4))
    );
}

#[test]
fn environments_and_settings_are_rows_that_allow_for_each_other() {
    let close = [100.0, 120.0, 110.0];
    let runs = [
        mcpo(ENV, 1e-4, &[140.0, 150.0, 155.0]),
        mcpo(ENV, 1e-2, &close),
        ppo(ENV, &close),
        mcpo("Ant-v2", 1e-4, &[1.0, 2.0, 3.0]),
        ppo("Ant-v2", &[1.0, 2.5, 3.0]),
        mcpo("Walker2d-v2", 1e-4, &[1.0, 2.0, 3.0]),
    ];
    let rows = judged(ABOVE_PPO, &runs);
    let places: Vec<_> = rows
        .iter()
        .map(|row| (row.env.as_deref(), row.setting.as_str()))
        .collect();
    let one = "d = 10⁻⁴";
    assert_eq!(
        places,
        [
            (Some(ENV), one),
            (Some("Ant-v2"), one),
            (Some(ENV), "d = 10⁻²")
        ],
        "no PPO in Walker2d"
    );
    let alone = judged(ABOVE_PPO, &[runs[0].clone(), runs[2].clone()])[0]
        .p
        .expect("judged")
        .0;
    assert!((rows[0].p.expect("judged").0 - 3.0 * alone).abs() < 1e-12);
}

#[test]
fn over_all_environments_each_weighs_the_same() {
    // Expert - Random is 3346.71 in Hopper-v2 and 3342.68 in Ant-v2.
    let runs = [
        mcpo(ENV, 1e-4, &[334.671, 334.671, 334.671]),
        ppo(ENV, &[0.0; 3]),
        mcpo("Ant-v2", 1e-4, &[1002.804, 1002.804, 1002.804]),
        ppo("Ant-v2", &[0.0; 3]),
    ];
    let rows = judged(
        &format!("{ABOVE_PPO}\nenvironments = 'overall'\nmargin = 0.15"),
        &runs,
    );
    assert_eq!(
        (rows.len(), &rows[0].env, rows[0].environments),
        (1, &None, 2)
    );
    assert!(
        (rows[0].difference.expect("judged").mean - 0.2).abs() < 1e-9 && rows[0].limit == 0.15,
        "{rows:?}"
    );
    assert_eq!(rows[0].verdict, ClaimVerdict::Holds);
}

#[test]
fn runs_on_both_sides_are_those_that_the_others_are_compared_with() {
    let runs = [
        mcpo(ENV, 1e-4, &[1.0, 2.0, 3.0]),
        mcpo(ENV, 1e-2, &[5.0, 6.0, 7.0]),
    ];
    let rows = judged(
        "of = 'algorithm=mcpo'\nis = 'above'\nthan = 'd=0.0001'",
        &runs,
    );
    assert_eq!(
        rows.iter()
            .map(|row| row.difference.map(|found| found.mean))
            .collect::<Vec<_>>(),
        [Some(4.0)]
    );
}

#[test]
fn a_demonstrations_return_is_a_level() {
    let learned = |returns: &[f64]| {
        mcpo(ENV, 1e-4, returns)
            .into_iter()
            .map(|run| run.demonstrated(Some("a"), Some(974.5)))
            .collect::<Vec<_>>()
    };
    let above = "of = 'algorithm=mcpo'\nis = 'above'\nthan = 'demonstration'";
    assert_eq!(
        verdict(above, &[learned(&[1000.0, 1010.0, 1005.0])]),
        ClaimVerdict::Holds
    );
    assert_eq!(
        verdict(above, &[learned(&[900.0, 910.0, 905.0])]),
        ClaimVerdict::Contradicted
    );
}

#[test]
fn a_failed_run_takes_away_what_it_could_have_changed() {
    let mut good = mcpo(ENV, 1e-4, &[500.0, 510.0, 490.0, 505.0]);
    let others = ppo(ENV, &[100.0, 110.0, 90.0]);
    assert_eq!(
        verdict(ABOVE_PPO, &[good.clone(), others.clone()]),
        ClaimVerdict::Holds
    );
    good.push(fixture::mcpo(ENV, 1e-4, 1e-3, 4).failed("diverged"));
    good.push(fixture::mcpo(ENV, 1e-4, 1e-3, 5).failed("diverged"));
    let rows = judged(ABOVE_PPO, &[good, others]);
    assert_eq!(
        rows[0].verdict,
        ClaimVerdict::Inconclusive(None),
        "{rows:?}"
    );
    assert_eq!(
        rows[0].seeds,
        Count {
            found: 4,
            planned: 6
        }
    );
    assert!(
        rows[0]
            .difference
            .is_some_and(|found| found.mean > 400.0 && found.low < 100.0),
        "{rows:?}"
    );
}

#[test]
fn a_kept_constraint_is_a_share_over_seeds() {
    let run = |seed, met: &[f64]| {
        let column = |values: Vec<f64>| {
            (1..)
                .map(|row| 10 * row)
                .zip(values)
                .collect::<Vec<(u64, f64)>>()
        };
        fixture::mcpo(ENV, 1.0, 0.0, seed)
            .finished(&[(100, &[1.0])])
            .progress("mmd", &column(met.to_vec()))
            .progress("d_k", &column(vec![1.0; met.len()]))
    };
    let kept: Vec<Run> = (0..3)
        .map(|seed| run(seed, &[2.0, 0.9, 0.8, 0.7]))
        .collect();
    let rows = judged(
        "of = 'algorithm=mcpo'\nis = 'kept'",
        std::slice::from_ref(&kept),
    );
    assert_eq!(
        (&rows[0].verdict, rows[0].limit),
        (&ClaimVerdict::Holds, 0.95)
    );
    assert_eq!((rows[0].improvement, rows[0].than), (None, None));
    let broken: Vec<Run> = (0..3)
        .map(|seed| run(seed, &[0.9, 2.0, 0.8, 2.0]))
        .collect();
    assert_eq!(
        verdict("of = 'algorithm=mcpo'\nis = 'kept'", &[broken]),
        ClaimVerdict::Contradicted
    );
    assert_eq!(
        verdict("of = 'algorithm=mcpo'\nis = 'kept'\nshare = 1.0", &[kept]),
        ClaimVerdict::Inconclusive(None)
    );
}
