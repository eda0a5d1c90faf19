//! The Gaussian kernel `k(x, y) = exp(-|x - y|^2 / (2 sigma^2))`.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::exponents::squared_distance;
use crate::quantity::Positive;

/// How sigma is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bandwidth {
    /// Sigma is this number.
    Fixed(Positive),
    /// The median distance between the demonstration's points.
    Median,
}

/// A Gaussian kernel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Kernel {
    /// `1 / (2 sigma^2)`.
    pub scale: f64,
}

impl Kernel {
    /// The kernel of `bandwidth` for the demonstration's `points` (`[dim x m]`, one column a
    /// point).
    ///
    /// [`Bandwidth::Median`] is the median heuristic (Gretton et al., 2012): sigma is the median
    /// distance between two points. It looks at no more than [`MEDIAN_POINTS`] points, evenly
    /// spaced in the demonstration's order, so that a long demonstration costs no more. Distances
    /// of 0 do not count; if there is no other, sigma is 1.
    pub fn new(bandwidth: Bandwidth, points: &DMatrix<f32>) -> Self {
        let sigma = match bandwidth {
            Bandwidth::Fixed(sigma) => sigma.get(),
            Bandwidth::Median => median_distance(points).unwrap_or(1.0),
        };
        Self {
            scale: 0.5 / (sigma * sigma),
        }
    }
}

/// How many points the median heuristic looks at: half a million distances, 2 MB.
pub const MEDIAN_POINTS: usize = 1000;

/// The median of the distances above 0 between points.
fn median_distance(points: &DMatrix<f32>) -> Option<f64> {
    let n = points.ncols().min(MEDIAN_POINTS);
    let chosen: Vec<_> = (0..n)
        .map(|i| points.column(i * points.ncols() / n))
        .collect();
    let mut squared: Vec<f32> = Vec::with_capacity(n * n.saturating_sub(1) / 2);
    for (i, x) in chosen.iter().enumerate() {
        squared.extend(
            chosen[..i]
                .iter()
                .map(|y| squared_distance(x.as_slice(), y.as_slice()))
                .filter(|&d| d > 0.0),
        );
    }
    if squared.is_empty() {
        return None;
    }
    let middle = squared.len() / 2;
    let even = squared.len().is_multiple_of(2);
    let (below, &mut upper, _) = squared.select_nth_unstable_by(middle, f32::total_cmp);
    let upper = f64::from(upper).sqrt();
    match below.iter().copied().max_by(f32::total_cmp) {
        Some(lower) if even => Some((upper + f64::from(lower).sqrt()) / 2.0),
        _ => Some(upper),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::constant;

    fn sigma(bandwidth: Bandwidth, points: &[f32]) -> f64 {
        let kernel = Kernel::new(bandwidth, &DMatrix::from_row_slice(1, points.len(), points));
        (0.5 / kernel.scale).sqrt()
    }

    #[test]
    fn where_there_is_no_distance_sigma_is_1() {
        assert_eq!(sigma(Bandwidth::Median, &[2.0]), 1.0);
        assert_eq!(sigma(Bandwidth::Median, &[2.0, 2.0, 2.0]), 1.0);
    }

    #[test]
    fn the_median_is_that_of_all_distances() {
        // Distances 1, 3, 2: odd. 1, 3, 7, 2, 6, 4: even, (3 + 4) / 2. Equal points do not count.
        assert!((sigma(Bandwidth::Median, &[0.0, 1.0, 3.0]) - 2.0).abs() < 1e-6);
        assert!((sigma(Bandwidth::Median, &[0.0, 1.0, 3.0, 7.0]) - 3.5).abs() < 1e-6);
        assert!((sigma(Bandwidth::Median, &[5.0, 5.0, 5.0, 8.0]) - 3.0).abs() < 1e-6);
        assert!((sigma(Bandwidth::Fixed(constant(0.3)), &[0.0, 1.0]) - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_long_demonstration_is_thinned_over_its_whole_length() {
        // On an even line the median distance is (1 - 1/sqrt(2)) of its length, however it is
        // thinned.
        let line: Vec<f32> = (0..20_000).map(|i| i as f32 / 20_000.0).collect();
        assert!((sigma(Bandwidth::Median, &line) - (1.0 - 0.5f64.sqrt())).abs() < 1e-3);
    }
}
