//! The standard normal distribution, and integrals against it.

use std::f64::consts::{SQRT_2, TAU};

use statrs::function::erf::erfc;

/// Half-width and step of the trapezoid rule.
/// The weight beyond is below 1e-9.
/// So is the error of the sum for integrands as smooth as the fifth power of [`cdf`], since it
/// falls as exp(-2 pi^2 / step^2 / 6).
const REACH: f64 = 6.4;
const STEP: f64 = 0.4;

/// The probability that a standard normal number is below `x`.
pub fn cdf(x: f64) -> f64 {
    0.5 * erfc(-x / SQRT_2)
}

/// The density at `x`.
pub fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / TAU.sqrt()
}

/// The mean of `f` over a standard normal number; `f` must change little over less than a unit.
pub fn mean(f: impl Fn(f64) -> f64) -> f64 {
    let steps = (REACH / STEP).round() as i32;
    (-steps..=steps)
        .map(|index| STEP * f64::from(index))
        .map(|z| STEP * density(z) * f(z))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.stats.norm.cdf([-3, -0.5, 0, 2])` (SciPy 1.17.1).
    #[test]
    fn probabilities_are_those_of_scipy() {
        let wanted = [
            (-3.0, 0.0013498980316300933),
            (-0.5, 0.3085375387259869),
            (0.0, 0.5),
            (2.0, 0.9772498680518208),
        ];
        for (x, wanted) in wanted {
            assert!((cdf(x) - wanted).abs() < 1e-11, "{x}");
        }
    }

    #[test]
    fn the_moments_of_the_normal_distribution_come_out() {
        for (power, moment) in [(0, 1.0), (1, 0.0), (2, 1.0), (4, 3.0)] {
            assert!((mean(|z| z.powi(power)) - moment).abs() < 1e-6, "{power}");
        }
    }
}
