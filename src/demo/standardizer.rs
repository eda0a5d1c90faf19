//! Observations in units of a demonstration: the coordinates in which the kernel measures
//! distances.

use nalgebra::DMatrix;

/// Subtracts the mean of a demonstration's observations and divides by their standard deviation.
/// Clips far beyond where the kernel is 0, so that no distance overflows.
///
/// It is fixed by the demonstration: a distance whose unit followed the agent could not be held to
/// a tolerance. An agent that stands still has seen next to no variation. In units of that, the
/// demonstration's states lie so far apart that the kernel sees each of them alone, and MMD^2 stays
/// below 2/m whatever the policy does at them.
#[derive(Debug, Clone, PartialEq)]
pub struct Standardizer {
    mean: Vec<f64>,
    scale: Vec<f64>,
}

impl Standardizer {
    const CLIP: f64 = 1e3;

    /// A standardizer in units of `observations` (`[dim x m]`). A number that never varies there
    /// keeps its own unit (as in scikit-learn's `StandardScaler`).
    pub fn new(observations: &DMatrix<f64>) -> Self {
        let m = observations.ncols().max(1) as f64;
        let (mut mean, mut scale) = (Vec::new(), Vec::new());
        for row in observations.row_iter() {
            let centre = row.iter().sum::<f64>() / m;
            let std = (row.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / m).sqrt();
            // The deviation of a constant is only the rounding of its mean.
            let varies = std > 1e-12 * centre.abs().max(1.0);
            mean.push(centre);
            scale.push(if varies { 1.0 / std } else { 1.0 });
        }
        Self { mean, scale }
    }

    /// The standardised `observations` (`[dim x n]`).
    pub fn standardize(&self, observations: &DMatrix<f64>) -> DMatrix<f32> {
        assert_eq!(
            observations.nrows(),
            self.mean.len(),
            "length of an observation"
        );
        DMatrix::from_fn(observations.nrows(), observations.ncols(), |i, j| {
            let standardized = (observations[(i, j)] - self.mean[i]) * self.scale[i];
            standardized.clamp(-Self::CLIP, Self::CLIP) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_varying_number_has_mean_0_and_variance_1_and_a_constant_keeps_its_unit() {
        let observations = DMatrix::from_row_slice(
            3,
            4,
            &[1.0, 2.0, 3.0, 6.0, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0],
        );
        let standardizer = Standardizer::new(&observations);
        let columns = standardizer.standardize(&observations);
        let row = columns.row(0);
        assert!(
            row.sum().abs() < 1e-6 && (row.norm_squared() / 4.0 - 1.0).abs() < 1e-6,
            "{row}"
        );
        assert!(
            columns.rows(1, 2).iter().all(|x| x.abs() < 1e-12),
            "{columns}"
        );
        let moved =
            standardizer.standardize(&DMatrix::from_column_slice(3, 1, &[3.0, 0.6, -1e300]));
        assert_eq!(moved.as_slice(), [0.0, 0.5, -1e3]);
    }
}
