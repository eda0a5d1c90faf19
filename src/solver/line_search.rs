//! Backtracking line search: the first of a halving sequence of fractions of a step that is accepted.

use super::{Step, Theta};

/// What [`backtrack`] found.
#[derive(Debug, Clone, PartialEq)]
pub enum Search<A, R> {
    /// A trial was accepted.
    Accepted {
        /// The fraction of the step that it took: 1, 1/2, 1/4 ...
        fraction: f64,
        /// Trials judged, the accepted one included.
        trials: usize,
        /// The accepted point `[dim]`.
        theta: Theta,
        /// What the judge said of it.
        verdict: A,
    },
    /// No trial was accepted.
    Rejected {
        /// Why, trial by trial; empty when no trial was allowed.
        reasons: Vec<R>,
    },
}

/// Judges `theta + fraction * step` for the fractions 1, 1/2, 1/4 ... (`judge` is given both) and stops at the first that is
/// accepted, or after `trials` of them. The starting point is only read, so that a rejected search cannot have moved it.
pub fn backtrack<A, R>(
    theta: &Theta,
    step: &Step,
    trials: usize,
    mut judge: impl FnMut(&Theta, f64) -> Result<A, R>,
) -> Search<A, R> {
    let mut trial = theta.clone();
    let mut fraction = 1.0;
    let mut reasons = Vec::new();
    for judged in 1..=trials {
        trial.place(theta, step, fraction);
        match judge(&trial, fraction) {
            Ok(verdict) => return Search::Accepted { fraction, trials: judged, theta: trial, verdict },
            Err(reason) => reasons.push(reason),
        }
        fraction *= 0.5;
    }
    Search::Rejected { reasons }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start() -> (Theta, Step) {
        (Theta::new(vec![1.0, 2.0]), Step::new(vec![8.0, -8.0]))
    }

    #[test]
    fn a_rejected_search_gives_every_reason_in_order() {
        let (theta, step) = start();
        let found: Search<(), f32> = backtrack(&theta, &step, 4, |trial, _| Err(trial.as_slice()[0]));
        assert_eq!(found, Search::Rejected { reasons: vec![9.0, 5.0, 3.0, 2.0] });
        assert_eq!(theta, start().0);
    }

    #[test]
    fn without_trials_nothing_is_judged() {
        let (theta, step) = start();
        let found: Search<(), ()> = backtrack(&theta, &step, 0, |_, _| panic!("no trial was allowed"));
        assert_eq!(found, Search::Rejected { reasons: vec![] });
    }

    #[test]
    fn the_first_accepted_fraction_wins() {
        let (theta, step) = start();
        let mut judged = 0;
        let found = backtrack(&theta, &step, 10, |trial, _| {
            judged += 1;
            let x = trial.as_slice()[0];
            if x < 4.0 { Ok(x) } else { Err("too far") }
        });
        let theta = Theta::new(vec![3.0, 0.0]);
        assert_eq!(found, Search::Accepted { fraction: 0.25, trials: 3, theta, verdict: 3.0 });
        assert_eq!(judged, 3);
    }

    #[test]
    fn a_whole_step_needs_one_trial() {
        let (theta, step) = start();
        let found: Search<(), ()> = backtrack(&theta, &step, 1, |_, _| Ok(()));
        let theta = Theta::new(vec![9.0, -6.0]);
        assert_eq!(found, Search::Accepted { fraction: 1.0, trials: 1, theta, verdict: () });
    }
}
