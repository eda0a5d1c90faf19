//! The one number of a run that a claim compares.

use crate::{
    measured::{Column, Iteration, Measure, progress},
    report::{
        curve::mean,
        over_seeds::{columns_of, seed_values},
        recorded::{Recording, Run},
    },
    spec::{Claim, Part, Relation},
};

/// The part of the steps that counts as the end of a column.
const END: f64 = 0.1;

/// The constraint counts as violated where D exceeds the tolerance by more than this share of it.
/// MCPO judges in the same way, since its corrections end near the bound, on either side.
const D_MARGIN: f64 = 1e-3;

/// The number of `run` that `claim` compares; `None` where the run did not finish, or the number is
/// missing or not finite.
pub fn of(run: &Run, claim: &Claim) -> Option<f64> {
    let recording = run.recording()?;
    let number = match (claim.is, claim.at) {
        (Relation::Kept, _) => share_kept(recording),
        (_, Part::End) if claim.on == Measure::Return => Some(mean(&recording.final_returns())),
        (_, Part::End) => end(&seed_values(recording, claim.on)),
        (_, Part::Area) => area(&seed_values(recording, claim.on)),
    };
    number.filter(|number| number.is_finite())
}

/// The columns of progress that `claim` is judged by.
pub fn columns(claim: &Claim) -> Vec<&'static Column<Iteration>> {
    match claim.is {
        Relation::Kept => vec![&progress::MMD, &progress::TOLERANCE],
        Relation::Above | Relation::Below | Relation::Like => columns_of(claim.on),
    }
}

/// The mean over the last tenth of the steps.
fn end(values: &[(u64, f64)]) -> Option<f64> {
    let last = values.last()?.0 as f64;
    let late: Vec<f64> = values
        .iter()
        .filter(|(steps, _)| *steps as f64 >= (1.0 - END) * last)
        .map(|(_, value)| *value)
        .collect();
    Some(mean(&late))
}

/// The area under the values from the first to the last, divided by the steps between them; a
/// single value stands for itself.
pub fn area(values: &[(u64, f64)]) -> Option<f64> {
    let (first, last) = (values.first()?, values.last()?);
    let pairs = values
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0) as f64 * (pair[0].1 + pair[1].1) / 2.0);
    let length = (last.0 - first.0) as f64;
    Some(if length > 0.0 {
        pairs.sum::<f64>() / length
    } else {
        first.1
    })
}

/// The share of iterations that met the constraint, among those after the first that did. 0 where
/// none ever met it; `None` where there is no such constraint, or no iteration after the first that
/// met it.
fn share_kept(recording: &Recording) -> Option<f64> {
    let (mmd, tolerance) = (
        recording.progress.get(&progress::MMD)?,
        recording.progress.get(&progress::TOLERANCE)?,
    );
    let met: Vec<bool> = mmd
        .iter()
        .zip(tolerance)
        .filter_map(|(mmd, d)| Some((*mmd)? <= (1.0 + D_MARGIN) * (*d)?))
        .collect();
    let Some(first) = met.iter().position(|met| *met) else {
        return (!met.is_empty()).then_some(0.0);
    };
    let after = &met[first + 1..];
    (!after.is_empty())
        .then(|| after.iter().filter(|met| **met).count() as f64 / after.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    fn claim(text: &str) -> Claim {
        toml::from_str(&format!("name = 'c'\nof = 'algorithm=mcpo'\n{text}")).expect("a claim")
    }

    #[test]
    fn what_did_not_finish_or_is_no_number_has_none() {
        let run = || fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0);
        let above = claim("is = 'above'\nthan = 'algorithm=ppo'\nat = 'area'");
        assert_eq!(of(&run(), &above), None);
        assert_eq!(of(&run().failed("diverged"), &above), None);
        assert_eq!(
            of(&run().finished(&[(50, &[f64::NAN]), (100, &[1.0])]), &above),
            None
        );
        let kl = claim("is = 'above'\nthan = 'algorithm=ppo'\non = 'kl'");
        assert_eq!(
            of(&run().finished(&[(100, &[1.0])]), &kl),
            None,
            "it was not recorded"
        );
    }

    #[test]
    fn returns_are_of_the_final_evaluation_or_of_the_area() {
        let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[
            (0, &[0.0]),
            (25, &[4.0, 8.0]),
            (100, &[10.0, 14.0]),
        ]);
        assert_eq!(
            of(&run, &claim("is = 'above'\nthan = 'demonstration'")),
            Some(12.0)
        );
        // Trapezoids: 25 * (0 + 6) / 2 + 75 * (6 + 12) / 2, over 100.
        assert_eq!(
            of(
                &run,
                &claim("is = 'above'\nthan = 'demonstration'\nat = 'area'")
            ),
            Some(7.5)
        );
        let once =
            fixture::run("random", "env = ['Hopper-v2']\nseed = [0]").finished(&[(0, &[3.0, 5.0])]);
        assert_eq!(
            of(
                &once,
                &claim("is = 'above'\nthan = 'demonstration'\nat = 'area'")
            ),
            Some(4.0)
        );
    }

    #[test]
    fn the_end_of_a_column_is_its_last_tenth() {
        let rows: Vec<(u64, f64)> = (1..=20).map(|row| (5 * row, row as f64)).collect();
        let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0)
            .finished(&[(100, &[1.0])])
            .progress("kl", &rows);
        // Steps 90, 95 and 100.
        assert_eq!(
            of(
                &run,
                &claim("is = 'below'\nthan = 'algorithm=ppo'\non = 'kl'")
            ),
            Some(19.0)
        );
    }

    #[test]
    fn a_constraint_is_kept_from_the_iteration_on_in_which_it_is_first_met() {
        let kept = |mmd: &[f64], d: f64| {
            let column = |values: Vec<f64>| {
                (1..)
                    .map(|row| 10 * row)
                    .zip(values)
                    .collect::<Vec<(u64, f64)>>()
            };
            let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0)
                .finished(&[(100, &[1.0])])
                .progress("mmd", &column(mmd.to_vec()))
                .progress("d_k", &column(vec![d; mmd.len()]));
            of(&run, &claim("is = 'kept'"))
        };
        assert_eq!(
            kept(&[5.0, 3.0, 0.9, 0.8, 1.2, 1.0, 0.7], 1.0),
            Some(0.75),
            "3 of the 4 after the third"
        );
        assert_eq!(
            kept(&[0.5, 1.000_9, 1.001_1], 1.0),
            Some(0.5),
            "a thousandth above is as good as met"
        );
        assert_eq!(kept(&[5.0, 4.0], 1.0), Some(0.0), "it was never met");
        assert_eq!(kept(&[5.0, 0.5], 1.0), None, "there is no iteration after");
        let ppo = fixture::ppo("Hopper-v2", 0)
            .finished(&[(100, &[1.0])])
            .progress("kl", &[(10, 0.5)]);
        assert_eq!(
            of(&ppo, &claim("is = 'kept'")),
            None,
            "it has no constraint"
        );
    }
}
