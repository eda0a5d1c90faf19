use super::*;

/// Expert - Random is 1000, so the margin is 100.
const SCALE: Scale = Scale {
    random: 0.0,
    distance: 1000.0,
};

fn verdict(values: &[f64], failed: usize, mean: f64, std: f64) -> Verdict {
    let mut cell =
        Comparison::new(values, failed, PaperValue { mean, std }, SCALE).expect("enough seeds");
    settle(&mut [&mut cell]).remove(0)
}

/// Five seeds of deviation 10 around 500: their expected best is about 512.
const SEEDS: [f64; 5] = [500.0, 510.0, 490.0, 512.247_448_7, 487.752_551_3];

#[test]
fn the_difference_of_the_expected_best_decides() {
    assert_eq!(verdict(&SEEDS, 0, 512.0, 10.0), Verdict::Reproduced);
    assert_eq!(verdict(&SEEDS, 0, 900.0, 10.0), Verdict::Worse);
    assert_eq!(verdict(&SEEDS, 0, 100.0, 10.0), Verdict::Better);
    assert_eq!(
        verdict(&[1000.0; 5], 0, 1000.0, 0.0),
        Verdict::Reproduced,
        "both are exact"
    );
    assert_eq!(verdict(&[1000.0; 5], 0, 850.0, 0.0), Verdict::Better);
    assert_eq!(
        Comparison::new(
            &[1.0],
            0,
            PaperValue {
                mean: 1.0,
                std: 0.0
            },
            SCALE
        ),
        None
    );
}

#[test]
fn what_would_decide_is_told_with_its_number_of_seeds() {
    let reason = |values: &[f64], failed, mean, std| match verdict(values, failed, mean, std) {
        Verdict::Inconclusive(reason) => reason,
        other => panic!("{other:?}"),
    };
    let noisy: Vec<f64> = SEEDS.iter().map(|x| 500.0 + 6.0 * (x - 500.0)).collect();
    let told = reason(&noisy, 0, 570.0, 10.0);
    let seeds: usize = told
        .strip_suffix(" seeds would decide")
        .and_then(|n| n.parse().ok())
        .expect(&told);
    // That many seeds of this mean and deviation decide it, and one less do not.
    let cell = Comparison::new(
        &noisy,
        0,
        PaperValue {
            mean: 570.0,
            std: 10.0,
        },
        SCALE,
    )
    .expect("enough seeds");
    let apart = |n| cell.not_within(Samples { n, ..cell.ways[0] });
    assert!(
        seeds > 5 && apart(seeds) <= ALPHA && apart(seeds - 1) > ALPHA,
        "{told}"
    );

    let wild: Vec<f64> = SEEDS.iter().map(|x| 500.0 + 30.0 * (x - 500.0)).collect();
    assert_eq!(
        reason(&wild, 0, 850.0, 10.0),
        "no number of seeds would decide: the paper's value is one draw",
        "a deviation of 300 in the paper's draw is beyond a margin of 100"
    );
    // An error of 1000 / sqrt(50) = 141 in the paper's own value is too.
    assert_eq!(
        reason(&SEEDS, 0, 512.0, 1000.0),
        "no number of seeds would decide: the paper's value is one draw"
    );
}

#[test]
fn a_verdict_holds_with_the_failed_runs_at_the_random_policys_return_too() {
    assert_eq!(verdict(&SEEDS, 0, 900.0, 10.0), Verdict::Worse);
    let told = verdict(&SEEDS, 2, 512.0, 10.0);
    assert!(matches!(told, Verdict::Inconclusive(_)), "{told:?}");
    let interval = |failed| {
        Comparison::new(
            &SEEDS,
            failed,
            PaperValue {
                mean: 512.0,
                std: 10.0,
            },
            SCALE,
        )
        .expect("enough")
        .interval()
    };
    let (without, with) = (interval(0), interval(2));
    assert!(
        with.0 <= without.0 && with.1 > without.1 + 100.0,
        "{without:?} {with:?}"
    );
}

#[test]
fn more_cells_need_more_evidence() {
    let cell = || {
        Comparison::new(
            &SEEDS,
            0,
            PaperValue {
                mean: 660.0,
                std: 10.0,
            },
            SCALE,
        )
        .expect("enough seeds")
    };
    let (mut alone, mut p) = (cell(), 0.0);
    assert_eq!(settle(&mut [&mut alone]), [Verdict::Worse]);
    for family in [1, 10, 50] {
        let mut others: Vec<Comparison> = (1..family)
            .map(|_| {
                Comparison::new(
                    &SEEDS,
                    0,
                    PaperValue {
                        mean: 512.0,
                        std: 10.0,
                    },
                    SCALE,
                )
                .expect("enough")
            })
            .collect();
        let mut one = cell();
        let mut cells: Vec<&mut Comparison> = others.iter_mut().chain([&mut one]).collect();
        settle(&mut cells);
        assert!(
            (one.p - (family as f64 * alone.p).min(1.0)).abs() < 1e-12 && one.p > p,
            "{family}"
        );
        p = one.p;
    }
    assert!(p > ALPHA, "the same cell among fifty");
}
