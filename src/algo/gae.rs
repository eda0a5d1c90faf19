//! Generalised advantage estimation (Schulman et al., 2016) over segments.

use nalgebra::DMatrix;

use super::{Batch, SegmentEnd, revision::Part};
use crate::nn::{Mlp, Pass};

/// Raise its revision when what this file computes changes.
pub static PART: Part = Part {
    name: "gae",
    revision: 1,
    uses: &[],
};

/// Advantages and the value network's targets, one a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Advantages {
    /// GAE's advantages `[n]`.
    pub advantages: Vec<f64>,
    /// Advantages plus values: lambda-returns `[n]`.
    pub returns: Vec<f64>,
}

/// Advantages of `batch` for per-sample `rewards` (`[n]`), with `value` as baseline.
/// A segment that was cut bootstraps from the value of the observation after it; one that
/// terminated has no such value.
pub fn estimate(
    batch: &Batch,
    rewards: &[f64],
    value: &Mlp,
    discount: f64,
    lambda: f64,
    pass: &mut Pass,
) -> Advantages {
    let last_values = bootstrap_values(batch, value, pass);
    value.forward(&batch.observations, pass);
    let values = pass.output();
    let mut advantages = vec![0.0; batch.len()];
    let mut returns = vec![0.0; batch.len()];
    for (segment, &last_value) in batch.segments.iter().zip(&last_values) {
        let mut next_value = last_value;
        let mut advantage = 0.0;
        for i in segment.range.clone().rev() {
            let value = f64::from(values[(0, i)]);
            let delta = rewards[i] + discount * next_value - value;
            advantage = delta + discount * lambda * advantage;
            advantages[i] = advantage;
            returns[i] = advantage + value;
            next_value = value;
        }
    }
    Advantages {
        advantages,
        returns,
    }
}

/// The value after each segment; zero if it terminated.
fn bootstrap_values(batch: &Batch, value: &Mlp, pass: &mut Pass) -> Vec<f64> {
    let columns: Vec<&[f32]> = batch
        .segments
        .iter()
        .filter_map(|segment| match &segment.end {
            SegmentEnd::Terminated => None,
            SegmentEnd::Bootstrapped { last_observation } => Some(last_observation.as_slice()),
        })
        .collect();
    if columns.is_empty() {
        return vec![0.0; batch.segments.len()];
    }
    value.forward(
        &DMatrix::from_vec(batch.observations.nrows(), columns.len(), columns.concat()),
        pass,
    );
    let mut values = pass
        .output()
        .iter()
        .map(|&v| f64::from(v))
        .collect::<Vec<_>>()
        .into_iter();
    batch
        .segments
        .iter()
        .map(|segment| match segment.end {
            SegmentEnd::Terminated => 0.0,
            SegmentEnd::Bootstrapped { .. } => {
                values.next().expect("one value for each cut segment")
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        algo::{Segment, reference},
        rng::{Seed, Stream},
    };

    const DISCOUNT: f64 = 0.9;
    const LAMBDA: f64 = 0.7;

    /// Two environments: the first terminates after 2 of its 4 steps and goes on, the second is cut
    /// at the end.
    fn batch() -> Batch {
        let observations =
            DMatrix::from_fn(3, 7, |row, column| ((row * 7 + column) as f32 * 0.7).sin());
        let cut = |shift: f32| SegmentEnd::Bootstrapped {
            last_observation: vec![0.1 + shift, -0.4, 0.3],
        };
        Batch {
            raw_observations: DMatrix::zeros(1, 0),
            observations,
            means: DMatrix::zeros(1, 0),
            actions: DMatrix::zeros(1, 7),
            rewards: vec![1.0, -2.0, 0.5, 3.0, 0.0, 1.5, -1.0],
            segments: vec![
                Segment {
                    range: 0..2,
                    end: SegmentEnd::Terminated,
                },
                Segment {
                    range: 2..4,
                    end: cut(0.0),
                },
                Segment {
                    range: 4..7,
                    end: cut(0.5),
                },
            ],
        }
    }

    #[test]
    fn advantages_and_returns_are_numpys() {
        let reference = reference::reference();
        let (batch, agent) = (reference.batch(), reference.agent(&reference.policy));
        let got = estimate(
            &batch,
            &batch.rewards,
            &agent.value,
            0.9,
            0.7,
            &mut Pass::default(),
        );
        reference::assert_near(
            &got.advantages,
            &reference.gae.advantages,
            reference::ROUNDING,
        );
        reference::assert_near(&got.returns, &reference.gae.returns, reference::ROUNDING);
    }

    /// The definition: the sum over later steps of (discount lambda)^l times the TD error, term by
    /// term.
    #[test]
    fn advantages_are_the_discounted_sums_of_td_errors() {
        let batch = batch();
        let value = Mlp::new(&[3, 5, 1], 1.0, &mut Seed(3).stream(Stream::Network, 0));
        let mut pass = Pass::default();
        let got = estimate(&batch, &batch.rewards, &value, DISCOUNT, LAMBDA, &mut pass);
        let mut value_of = |observation: &[f32]| {
            value.forward(&DMatrix::from_column_slice(3, 1, observation), &mut pass);
            f64::from(pass.output()[(0, 0)])
        };
        for segment in &batch.segments {
            for start in segment.range.clone() {
                let mut expected = 0.0;
                for i in start..segment.range.end {
                    let here = value_of(batch.observations.column(i).as_slice());
                    let next = match &segment.end {
                        _ if i + 1 < segment.range.end => {
                            value_of(batch.observations.column(i + 1).as_slice())
                        }
                        SegmentEnd::Terminated => 0.0,
                        SegmentEnd::Bootstrapped { last_observation } => value_of(last_observation),
                    };
                    let td_error = batch.rewards[i] + DISCOUNT * next - here;
                    expected += (DISCOUNT * LAMBDA).powi((i - start) as i32) * td_error;
                }
                assert!(
                    (got.advantages[start] - expected).abs() < 1e-12,
                    "sample {start}"
                );
                let value = value_of(batch.observations.column(start).as_slice());
                assert!(
                    (got.returns[start] - expected - value).abs() < 1e-12,
                    "sample {start}"
                );
            }
        }
    }
}
