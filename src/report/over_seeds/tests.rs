use super::*;

fn seed(reach: u64, recording: &Recording) -> Seed<'_> {
    Seed {
        number: 0,
        recording,
        reach,
        under_way: Some(reach),
    }
}

#[test]
fn as_many_seeds_are_drawn_as_make_the_most_of_seeds_times_steps() {
    let recording = Recording::default();
    let chosen = |reaches: &[u64]| {
        let all: Vec<Seed<'_>> = reaches
            .iter()
            .map(|&reach| seed(reach, &recording))
            .collect();
        drawn(&all)
            .iter()
            .map(|seed| seed.reach)
            .collect::<Vec<_>>()
    };
    assert_eq!(
        chosen(&[100, 10, 90, 100]),
        [100, 90, 100],
        "the one that has just begun would cut the others short"
    );
    assert_eq!(chosen(&[100, 60, 60, 60, 60]), [100, 60, 60, 60, 60]);
    assert_eq!(chosen(&[100, 50]), [100, 50], "of equals the more");
    assert_eq!(chosen(&[]), [0; 0]);
}

#[test]
fn smoothing_reaches_equally_far_to_both_sides_and_over_no_gap() {
    let averaging = |smooth, log| Averaging {
        log,
        band: Band::T,
        smooth,
    };
    let line: Vec<(u64, f64)> = (0..9).map(|x| (x * 10, x as f64)).collect();
    let straight = smoothed(&line, averaging(40, false));
    assert_eq!(
        straight,
        (0..9).map(f64::from).collect::<Vec<_>>(),
        "a straight line stays one, at its ends too"
    );
    let peak = [(10, 0.0), (20, 0.0), (30, 3.0), (40, 0.0), (50, 0.0)];
    assert_eq!(
        smoothed(&peak, averaging(20, false)),
        [0.0, 1.0, 1.0, 1.0, 0.0]
    );
    assert_eq!(
        smoothed(&peak, averaging(0, false)),
        [0.0, 0.0, 3.0, 0.0, 0.0]
    );
    let broken = [(10, 1.0), (20, 2.0), (30, f64::NAN), (40, 4.0), (50, 5.0)];
    let values = smoothed(&broken, averaging(1000, false));
    assert_eq!(
        [values[0], values[1], values[3], values[4]],
        [1.0, 2.0, 4.0, 5.0]
    );
    assert_eq!(
        smoothed(&[(1, 0.1), (2, 10.0), (3, 10.0)], averaging(2, true))[1],
        1.0 / 3.0,
        "of log10"
    );
}

#[test]
fn bands_are_what_they_are_called() {
    let samples = [1.0, 3.0, 5.0, 7.0];
    let ends = |kind| band(&samples, 4.0, kind, 10).expect("a band");
    // Sample variance 20 / 3.
    let std = (20.0_f64 / 3.0).sqrt();
    assert_eq!(ends(Band::Std), (4.0 - std, 4.0 + std));
    // t(0.975, 3) = 3.182446305.
    assert!((ends(Band::T).1 - 4.0 - 3.182446305284263 * std / 2.0).abs() < 1e-9);
    // The mean of four draws from four values has 256 equally likely outcomes: P(mean <= 1.5) =
    // 5 / 256 < 2.5 %, and P(mean <= 2) = 15 / 256; by symmetry above.
    assert_eq!(ends(Band::Bootstrap), (2.0, 6.0));
    assert_eq!(band(&samples, 4.0, Band::Seeds, 10), None);
    assert_eq!(band(&[1.0], 1.0, Band::Std, 10), None);
}
