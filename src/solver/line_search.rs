//! Backtracking line search over fractions 1, 1/2, 1/4 ... of a step: the first that is accepted. A
//! fraction is corrected for the curvature of a constraint before it is given up.
//!
//! Where a linear constraint is active, the step runs along the tangent of the curved one, and
//! curvature carries it over the bound. Halving alone then stalls, at steps so small that their
//! square is within what the constraint forgives (the Maratos effect; Nocedal and Wright, 2006,
//! section 18.3). The correction moves the trial back along `w = H^-1 b`, the shortest way in H's
//! norm.

use super::{Step, Theta};

/// The result of [`backtrack`].
#[derive(Debug, Clone, PartialEq)]
pub enum Search<A, R> {
    /// A trial was accepted.
    Accepted {
        /// The fraction of the step that it took: 1, 1/2, 1/4 ...
        fraction: f64,
        /// The number of trials judged, the accepted one included.
        trials: usize,
        /// The number of corrections of the accepted trial.
        corrections: usize,
        /// The accepted point `[dim]`.
        theta: Theta,
        /// The judge's verdict on it.
        verdict: A,
    },
    /// No trial was accepted.
    Rejected {
        /// The reasons, trial by trial; empty if no trial was allowed.
        reasons: Vec<R>,
    },
}

/// A trial, as the judge sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial<'a> {
    /// The trial's point.
    pub theta: &'a Theta,
    /// The fraction of the step that it took.
    pub fraction: f64,
    /// Whether it can still be corrected: an [excess](Refused::Excess) is then moved away and the
    /// trial judged again.
    pub correctable: bool,
}

/// A refusal of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refused<R> {
    /// The trial is refused for this reason, and the fraction is halved.
    Because(R),
    /// The constraint's value exceeds its bound by this much; only for a trial that is correctable.
    Excess(f64),
}

/// The way back to a constraint.
#[derive(Debug, Clone, PartialEq)]
pub struct WayBack {
    /// `w = H^-1 b` `[dim]`, where b is the constraint's gradient.
    pub direction: Step,
    /// `b.w`: the slope of the constraint's value along w, to first order.
    pub slope: f64,
}

/// Judges `theta + fraction * step` for the fractions 1, 1/2, 1/4 ... and stops at the first that
/// is accepted, or after `trials` of them.
/// The starting point is only read, so a rejected search cannot have moved it.
pub fn backtrack<A, R>(
    theta: &Theta,
    step: &Step,
    trials: usize,
    mut judge: impl FnMut(Trial<'_>) -> Result<A, R>,
) -> Search<A, R> {
    let judge = |trial: Trial<'_>| judge(trial).map_err(Refused::Because);
    backtrack_corrected(theta, step, trials, 0, || None, judge)
}

/// As [`backtrack`], where a trial that exceeds a constraint is first corrected, up to
/// `corrections` times: moved by `-excess / (b.w) w` and judged again.
/// `way_back` is asked for at the first excess, and at most once.
pub fn backtrack_corrected<A, R>(
    theta: &Theta,
    step: &Step,
    trials: usize,
    corrections: usize,
    way_back: impl FnOnce() -> Option<WayBack>,
    mut judge: impl FnMut(Trial<'_>) -> Result<A, Refused<R>>,
) -> Search<A, R> {
    let mut unasked = Some(way_back);
    let mut way_back = None;
    let mut trial = theta.clone();
    let mut fraction = 1.0;
    let mut reasons = Vec::new();
    for judged in 1..=trials {
        // Each trial begins at theta: what corrected a longer step is not carried over.
        trial.place(theta, step, fraction);
        let mut corrected = 0;
        loop {
            let correctable = corrected < corrections && (unasked.is_some() || way_back.is_some());
            match judge(Trial {
                theta: &trial,
                fraction,
                correctable,
            }) {
                Ok(verdict) => {
                    return Search::Accepted {
                        fraction,
                        trials: judged,
                        corrections: corrected,
                        theta: trial,
                        verdict,
                    };
                }
                Err(Refused::Because(reason)) => {
                    reasons.push(reason);
                    break;
                }
                Err(Refused::Excess(excess)) => {
                    assert!(correctable, "an excess is told of correctable trials alone");
                    if let Some(ask) = unasked.take() {
                        // Without a positive slope the way does not lead back.
                        way_back = ask().filter(|way: &WayBack| way.slope > 0.0);
                    }
                    // Without a way back, the same trial is judged again as not correctable.
                    if let Some(WayBack { direction, slope }) = &way_back {
                        trial.advance(direction, -excess / slope);
                        corrected += 1;
                    }
                }
            }
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
        let found: Search<(), f32> =
            backtrack(&theta, &step, 4, |trial| Err(trial.theta.as_slice()[0]));
        assert_eq!(
            found,
            Search::Rejected {
                reasons: vec![9.0, 5.0, 3.0, 2.0]
            }
        );
        assert_eq!(theta, start().0);
    }

    #[test]
    fn without_trials_nothing_is_judged() {
        let (theta, step) = start();
        let found: Search<(), ()> = backtrack(&theta, &step, 0, |_| panic!("no trial was allowed"));
        assert_eq!(found, Search::Rejected { reasons: vec![] });
    }

    #[test]
    fn the_first_accepted_fraction_wins() {
        let (theta, step) = start();
        let mut judged = 0;
        let found = backtrack(&theta, &step, 10, |trial| {
            judged += 1;
            let x = trial.theta.as_slice()[0];
            if x < 4.0 { Ok(x) } else { Err("too far") }
        });
        let theta = Theta::new(vec![3.0, 0.0]);
        assert_eq!(
            found,
            Search::Accepted {
                fraction: 0.25,
                trials: 3,
                corrections: 0,
                theta,
                verdict: 3.0
            }
        );
        assert_eq!(judged, 3);
    }

    #[test]
    fn a_whole_step_needs_one_trial() {
        let (theta, step) = start();
        let found: Search<(), ()> = backtrack(&theta, &step, 1, |_| Ok(()));
        let theta = Theta::new(vec![9.0, -6.0]);
        assert_eq!(
            found,
            Search::Accepted {
                fraction: 1.0,
                trials: 1,
                corrections: 0,
                theta,
                verdict: ()
            }
        );
    }

    /// A step of at most `length` that brings `(x, y)` to the right on the disc `x^2 + y^2 <= 1`,
    /// from its lowest point: the tangent there, which leaves the disc at once.
    fn along_the_circle(length: f32, corrections: usize) -> (Search<f64, &'static str>, usize) {
        let theta = Theta::new(vec![0.0, -1.0]);
        let mut judged = 0;
        // H is the identity: w = b = grad(x^2 + y^2) = (0, -2), b.w = 4.
        let way_back = || {
            Some(WayBack {
                direction: Step::new(vec![0.0, -2.0]),
                slope: 4.0,
            })
        };
        let found = backtrack_corrected(
            &theta,
            &Step::new(vec![length, 0.0]),
            10,
            corrections,
            way_back,
            |trial| {
                judged += 1;
                let [x, y] = *trial.theta.as_slice() else {
                    unreachable!("two numbers")
                };
                let excess = f64::from(x).powi(2) + f64::from(y).powi(2) - 1.0;
                match excess {
                    e if e <= 1e-6 => Ok(f64::from(x)),
                    e if trial.correctable => Err(Refused::Excess(e)),
                    _ => Err(Refused::Because("outside")),
                }
            },
        );
        (found, judged)
    }

    #[test]
    fn along_a_curved_constraint_halving_stalls_and_correction_does_not() {
        let (halved, judged) = along_the_circle(0.4, 0);
        match halved {
            Search::Accepted { verdict, .. } => assert!(verdict < 0.01 * 0.4, "{verdict}"),
            Search::Rejected { ref reasons } => assert_eq!(reasons.len(), 10),
        }
        assert!(judged >= 9);
        let (corrected, judged) = along_the_circle(0.4, 5);
        let Search::Accepted {
            fraction,
            corrections,
            verdict,
            ..
        } = corrected
        else {
            panic!("{corrected:?}")
        };
        assert_eq!(
            (fraction, verdict),
            (1.0, f64::from(0.4_f32)),
            "the whole way"
        );
        assert!(
            corrections >= 2 && judged == corrections + 1,
            "{corrections} of {judged}"
        );
    }

    #[test]
    fn without_a_way_back_a_trial_is_judged_uncorrectable() {
        let (theta, step) = start();
        for way in [
            None,
            Some(WayBack {
                direction: Step::new(vec![1.0, 0.0]),
                slope: f64::NAN,
            }),
        ] {
            let mut asked = 0;
            let mut uncorrectable = 0;
            let way_back = || {
                asked += 1;
                way
            };
            let found: Search<(), _> =
                backtrack_corrected(&theta, &step, 3, 2, way_back, |trial| {
                    if trial.correctable {
                        return Err(Refused::Excess(1.0));
                    }
                    uncorrectable += 1;
                    Err(Refused::Because("too far"))
                });
            assert_eq!(
                found,
                Search::Rejected {
                    reasons: vec!["too far"; 3]
                }
            );
            assert_eq!((asked, uncorrectable), (1, 3));
        }
    }
}
