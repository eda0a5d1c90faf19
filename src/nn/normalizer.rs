//! The running normaliser of observations (Welford, 1962).

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Running mean and variance of observations; normalised observations are clipped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Normalizer {
    count: f64,
    mean: Vec<f64>,
    /// Sum of squared deviations from the mean.
    deviations: Vec<f64>,
    clip: f64,
}

impl Normalizer {
    /// Added to the standard deviation. A feature that never varied stays 0 until it does, and the
    /// clip bounds it when it first moves.
    pub const EPSILON: f64 = 1e-8;

    /// The weight of one column of a [`held`](Self::held) normaliser. It is so large that a run of
    /// 1e8 steps after a demonstration of 100 moves mean and variance by only a millionth of the
    /// distance to its own.
    pub const HELD: f64 = 1e12;

    /// A normaliser of observations of `dim` numbers that has seen none: until it has seen two, it
    /// only clips. Normalised numbers are clipped to `[-clip, clip]`.
    pub fn new(dim: usize, clip: f64) -> Self {
        Self {
            count: 0.0,
            mean: vec![0.0; dim],
            deviations: vec![0.0; dim],
            clip,
        }
    }

    /// A normaliser that has seen the columns of `observations` (`[dim x n]`), from the first on.
    pub fn from_columns(observations: &DMatrix<f64>, clip: f64) -> Self {
        let mut normalizer = Self::new(observations.nrows(), clip);
        observations
            .as_slice()
            .chunks_exact(observations.nrows().max(1))
            .for_each(|column| normalizer.update(column));
        normalizer
    }

    /// A normaliser that stays in units of the columns of `observations` (`[dim x n]`), whatever it
    /// sees later: each column counts for [`HELD`](Self::HELD) observations.
    /// A number that never varies there keeps its own unit.
    pub fn held(observations: &DMatrix<f64>, clip: f64) -> Self {
        let mut normalizer = Self::from_columns(observations, clip);
        let count = normalizer.count * Self::HELD;
        let variances = normalizer
            .std()
            .into_iter()
            .zip(&normalizer.mean)
            .map(|(std, mean)| {
                // The deviation of a constant is only the rounding of its mean.
                let varies = std > 1e-12 * mean.abs().max(1.0);
                if varies { std * std } else { 1.0 }
            });
        normalizer.deviations = variances.map(|variance| variance * (count - 1.0)).collect();
        normalizer.count = count;
        normalizer
    }

    /// Adds one raw observation (`[dim]`) to the statistics.
    pub fn update(&mut self, observation: &[f64]) {
        assert_eq!(
            observation.len(),
            self.mean.len(),
            "length of an observation"
        );
        self.count += 1.0;
        for ((mean, deviations), x) in self
            .mean
            .iter_mut()
            .zip(&mut self.deviations)
            .zip(observation)
        {
            let from_old_mean = x - *mean;
            *mean += from_old_mean / self.count;
            *deviations += from_old_mean * (x - *mean);
        }
    }

    /// Writes the normalised observation (`[dim]`): `(x - mean) / (std + EPSILON)`, clipped.
    pub fn normalize(&self, observation: &[f64], normalized: &mut [f32]) {
        assert_eq!(
            observation.len(),
            self.mean.len(),
            "length of an observation"
        );
        assert_eq!(
            normalized.len(),
            self.mean.len(),
            "length of a normalised observation"
        );
        if self.count < 2.0 {
            for (y, x) in normalized.iter_mut().zip(observation) {
                *y = x.clamp(-self.clip, self.clip) as f32;
            }
            return;
        }
        let moments = self.mean.iter().zip(&self.deviations);
        for ((y, x), (mean, deviations)) in normalized.iter_mut().zip(observation).zip(moments) {
            let std = (deviations / (self.count - 1.0)).sqrt();
            *y = ((x - mean) / (std + Self::EPSILON)).clamp(-self.clip, self.clip) as f32;
        }
    }

    /// The normalised `observations` (`[dim x n]`).
    pub fn normalize_columns(&self, observations: &DMatrix<f64>) -> DMatrix<f32> {
        let mut normalized = DMatrix::zeros(observations.nrows(), observations.ncols());
        for (raw, column) in observations.column_iter().zip(
            normalized
                .as_mut_slice()
                .chunks_exact_mut(observations.nrows()),
        ) {
            self.normalize(raw.as_slice(), column);
        }
        normalized
    }

    /// The mean of the observations seen `[dim]`.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The standard deviation of the observations seen `[dim]` (by n - 1); ones before two
    /// observations.
    pub fn std(&self) -> Vec<f64> {
        if self.count < 2.0 {
            return vec![1.0; self.mean.len()];
        }
        self.deviations
            .iter()
            .map(|deviations| (deviations / (self.count - 1.0)).sqrt())
            .collect()
    }

    /// The number of observations seen.
    pub fn count(&self) -> u64 {
        self.count as u64
    }

    /// The greatest magnitude of a normalised number.
    pub fn clip(&self) -> f64 {
        self.clip
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Observations whose third number never varies and whose second has a mean far larger than its
    /// deviation.
    fn observations() -> DMatrix<f64> {
        DMatrix::from_fn(3, 500, |i, j| match i {
            0 => (j as f64 * 0.7).sin() * 3.0 - 1.0,
            1 => 1e6 + (j as f64 * 1.3).cos() * 1e-2,
            _ => 4.2,
        })
    }

    #[test]
    #[should_panic(expected = "length of an observation")]
    fn refuses_an_observation_of_another_length() {
        Normalizer::new(3, 10.0).update(&[1.0]);
    }

    #[test]
    fn only_clips_until_two_were_seen() {
        let mut normalizer = Normalizer::new(2, 5.0);
        let mut y = [0.0; 2];
        for count in 0..2 {
            assert_eq!(normalizer.count(), count);
            assert_eq!(normalizer.std(), [1.0, 1.0]);
            normalizer.normalize(&[7.0, -2.5], &mut y);
            assert_eq!(y, [5.0, -2.5]);
            normalizer.update(&[1.0, 2.0]);
        }
        normalizer.update(&[3.0, 6.0]);
        normalizer.normalize(&[7.0, -2.5], &mut y);
        assert_ne!(y, [5.0, -2.5]);
    }

    #[test]
    fn agrees_with_two_passes() {
        let seen = observations();
        let normalizer = Normalizer::from_columns(&seen, 10.0);
        assert_eq!(normalizer.count(), 500);
        for (i, row) in seen.row_iter().enumerate() {
            let mean = row.iter().sum::<f64>() / 500.0;
            let std = (row.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 499.0).sqrt();
            // The second feature's mean is 1e8 deviations away from zero: eight of sixteen digits
            // are left.
            assert!((normalizer.mean()[i] - mean).abs() <= 1e-13 * mean.abs() + 1e-15);
            assert!(
                (normalizer.std()[i] - std).abs() <= 1e-7 * std + 1e-12,
                "{} {std}",
                normalizer.std()[i]
            );
        }
    }

    #[test]
    fn normalised_numbers_have_mean_zero_and_variance_one_and_are_clipped() {
        let seen = observations();
        let normalizer = Normalizer::from_columns(&seen, 1.2);
        let unclipped = Normalizer::from_columns(&seen, 10.0);
        let (mut sum, mut squares, mut y, mut z) = (0.0, 0.0, [0.0; 3], [0.0; 3]);
        for column in seen.column_iter() {
            normalizer.normalize(column.as_slice(), &mut y);
            unclipped.normalize(column.as_slice(), &mut z);
            assert_eq!(y, z.map(|z| z.clamp(-1.2, 1.2)));
            sum += f64::from(z[0]);
            squares += f64::from(z[0]).powi(2);
        }
        // f32 rounding of 500 numbers.
        assert!(sum.abs() < 1e-4, "{sum}");
        assert!((squares / 499.0 - 1.0).abs() < 1e-6, "{squares}");
    }

    #[test]
    fn a_held_normaliser_keeps_its_units() {
        let seen = observations();
        let (running, mut held) = (
            Normalizer::from_columns(&seen, 10.0),
            Normalizer::held(&seen, 10.0),
        );
        let normalized = |normalizer: &Normalizer, x: &[f64]| {
            let mut y = [f32::NAN; 3];
            normalizer.normalize(x, &mut y);
            y
        };
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        for x in seen.column_iter() {
            assert!(
                near(
                    normalized(&running, x.as_slice()),
                    normalized(&held, x.as_slice())
                ),
                "{x}"
            );
        }
        assert!(
            (normalized(&held, &[0.0, 1e6, 5.0])[2] - 0.8).abs() < 1e-6,
            "a constant has its own unit"
        );
        let (before, mut moving) = (held.clone(), running);
        for i in 0..100_000 {
            let x = [
                30.0 * f64::from(i).sin(),
                1e6 + f64::from(i % 7),
                4.2 + f64::from(i % 3),
            ];
            held.update(&x);
            moving.update(&x);
        }
        let x = [1.0, 1e6 + 5e-3, 4.7];
        assert!(near(normalized(&held, &x), normalized(&before, &x)));
        assert!(!near(normalized(&moving, &x), normalized(&before, &x)));
    }

    #[test]
    fn a_feature_that_never_varied_is_zero_then_bounded() {
        let normalizer = Normalizer::from_columns(&observations(), 10.0);
        let mut y = [f32::NAN; 3];
        normalizer.normalize(&[0.0, 1e6, 4.2], &mut y);
        assert!(y[2].abs() < 1e-6, "{}", y[2]);
        normalizer.normalize(&[0.0, 1e6, 5.2], &mut y);
        assert_eq!(y[2], 10.0);
    }
}
