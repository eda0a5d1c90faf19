//! The expected best of `k` samples, where the other side has published its one best.
//!
//! Somebody drew `k` samples and tells the greatest alone, P. We have `n` samples of mean m and
//! standard deviation S. Did both draw from the same distribution? What is compared is the mean of
//! the greatest of `k`, theirs and ours, and D = ours - theirs.
//!
//! # Derivation
//!
//! Let the samples be normal, of one deviation sigma on both sides, of means mu and mu'. The
//! greatest of k standard normal numbers, M, is below x with probability Phi(x)^k; let c be its
//! mean. Then
//!
//! ```text
//! P = mu' + sigma M          m = mu + sigma Z / sqrt(n)          S = sigma W
//! D = (mu + c sigma) - (mu' + c sigma)
//! ```
//!
//! with Z standard normal, (n - 1) W^2 chi-squared with n - 1 degrees of freedom, and M, Z, W
//! independent. Hence
//!
//! ```text
//! (P + D - m) / S = (M - Z / sqrt(n)) / W
//! ```
//!
//! whose right side holds no unknown: as Student's t does, it gives exact intervals for D. Its
//! distribution F is an integral over Z and W, and `F((P + x - m) / S)` is the confidence that D is
//! below x. Where n grows, Z / sqrt(n) and W - 1 vanish, and M stays: that P is one draw limits
//! what any number of our samples can tell.
//!
//! P may have an error of its own beside the samples' deviation, normal with deviation e. It joins
//! Z / sqrt(n), as e W / S in units of sigma, which makes F a generalised pivot (Weerahandi, 1993),
//! exact where e is 0.
//!
//! The normal distribution is needed: of samples of any distribution, P lies above all n of ours
//! with probability k / (k + n), so without it "ours is worse" could not be said below 95 samples
//! (k = 5, 5 %). A distribution whose rare samples are far above the others (a seed in ten
//! succeeds) often gives only low samples to us and a high P, and ours is then called worse.

use super::{mean_and_variance, normal};

/// A published result: the greatest of `k` samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedBest {
    /// The number of samples that it is the greatest of.
    pub k: i32,
    /// The greatest, P.
    pub value: f64,
    /// The standard deviation e of its own error, which the samples that it is compared with do not
    /// have; 0 for none.
    pub error: f64,
}

/// The statistics of normal samples that count here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Samples {
    /// The number of samples, at least two.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation, with n - 1.
    pub deviation: f64,
}

impl Samples {
    /// The statistics of `values`; `None` for fewer than two.
    pub fn of(values: &[f64]) -> Option<Self> {
        let (mean, variance) = mean_and_variance(values)?;
        Some(Self {
            n: values.len(),
            mean,
            deviation: variance.sqrt(),
        })
    }
}

impl PublishedBest {
    /// The confidence that ours, the expected best of k samples such as `ours`, exceeds theirs by
    /// less than `limit`. It rises with the limit from 0 to 1.
    pub fn confidence_below(&self, ours: Samples, limit: f64) -> f64 {
        let x = self.value + limit - ours.mean;
        if ours.deviation == 0.0 {
            return match x.partial_cmp(&0.0) {
                _ if self.error > 0.0 => normal::cdf(x / self.error),
                Some(std::cmp::Ordering::Less) => 0.0,
                Some(std::cmp::Ordering::Greater) => 1.0,
                _ => 0.5,
            };
        }
        let below = |w: f64| {
            let sigma = ours.deviation / w;
            self.best_below(x, sigma, (sigma / (ours.n as f64).sqrt()).hypot(self.error))
        };
        mean_over_deviations(ours.n, below)
    }

    /// The probability that sigma M is below x by more than a normal number of deviation `noise`.
    fn best_below(&self, x: f64, sigma: f64, noise: f64) -> f64 {
        // Either factor can be integrated over; the other must be the smoother one.
        if noise <= sigma {
            normal::mean(|z| normal::cdf((x - noise * z) / sigma).powi(self.k))
        } else {
            self.mean_over_best(|best| normal::cdf((x - sigma * best) / noise))
        }
    }

    /// The mean of `f` over the greatest of k standard normal numbers.
    fn mean_over_best(&self, f: impl Fn(f64) -> f64) -> f64 {
        normal::mean(|best| f64::from(self.k) * normal::cdf(best).powi(self.k - 1) * f(best))
    }

    /// The two-sided interval of D at `confidence`, with equal probabilities outside on both sides.
    pub fn interval(&self, ours: Samples, confidence: f64) -> (f64, f64) {
        super::check_confidence(confidence);
        let middle = ours.mean + self.mean_over_best(|best| best) * ours.deviation - self.value;
        let scale = ours.deviation.hypot(self.error);
        let quantile = |share| {
            solve(
                |limit| self.confidence_below(ours, limit) - share,
                middle,
                scale,
            )
        };
        let tail = (1.0 - confidence) / 2.0;
        (quantile(tail), quantile(1.0 - tail))
    }
}

/// The mean of `f` over W, where (n - 1) W^2 is chi-squared with v = n - 1 degrees of freedom: the
/// trapezoid rule over u = ln W, whose density is proportional to exp(v u - v exp(2 u) / 2).
fn mean_over_deviations(n: usize, f: impl Fn(f64) -> f64) -> f64 {
    /// The greatest weight that is left out on either side is exp(-FAR) of the middle's.
    const FAR: f64 = 20.0;
    let freedom = n as f64 - 1.0;
    let step = 0.5 / (2.0 * freedom).sqrt();
    let exponent = |u: f64| freedom * (u - ((2.0 * u).exp() - 1.0) / 2.0);
    let side = |direction: f64, from: i32| {
        let points = (from..).map(move |index| direction * step * f64::from(index));
        points
            .map(|u| (u, exponent(u)))
            .take_while(|(_, exponent)| *exponent > -FAR)
    };
    let add = |(sum, all): (f64, f64), (u, exponent): (f64, f64)| {
        (sum + exponent.exp() * f(u.exp()), all + exponent.exp())
    };
    let (sum, all) = side(-1.0, 1).chain(side(1.0, 0)).fold((0.0, 0.0), add);
    sum / all
}

/// Finds where the rising `f` is 0, to a millionth of `scale`. The search starts at `middle`, which
/// is the answer if the scale is 0.
fn solve(f: impl Fn(f64) -> f64, middle: f64, scale: f64) -> f64 {
    if scale == 0.0 {
        return middle;
    }
    let end = |direction: f64| {
        let ends = (0..60).map(|doublings| middle + direction * scale * 2.0_f64.powi(doublings));
        ends.map(|x| (x, f(x))).find(|(_, y)| y * direction >= 0.0)
    };
    let (Some(mut low), Some(mut high)) = (end(-1.0), end(1.0)) else {
        return f64::NAN;
    };
    // Regula falsi, and the half of the interval where that stays on one side (the Illinois rule).
    let mut kept = 0.0;
    while high.0 - low.0 > 1e-6 * scale {
        let share = (-low.1 / (high.1 - low.1)).clamp(1e-3, 1.0 - 1e-3);
        let x = low.0 + (high.0 - low.0) * if share.is_nan() { 0.5 } else { share };
        if x <= low.0 || x >= high.0 {
            break; // there is no number between them
        }
        let y = f(x);
        if y < 0.0 {
            low = (x, y);
            high.1 *= if kept < 0.0 { 0.5 } else { 1.0 };
        } else {
            high = (x, y);
            low.1 *= if kept > 0.0 { 0.5 } else { 1.0 };
        }
        kept = if y < 0.0 { -1.0 } else { 1.0 };
    }
    (low.0 + high.0) / 2.0
}

/// The mean of the greatest of `k` samples drawn without replacement from `values`: the unbiased
/// estimator of the expected best of k for any distribution (Tang et al., 2020). `None` for fewer
/// than k values.
pub fn expected_best(values: &[f64], k: usize) -> Option<f64> {
    let n = values.len();
    if k == 0 || n < k {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    // The i-th of n is the greatest of k with probability C(i - 1, k - 1) / C(n, k); this counts
    // from the last one down.
    let mut share = k as f64 / n as f64;
    let mut sum = 0.0;
    for rank in (k..=n).rev() {
        sum += share * sorted[rank - 1];
        share *= (rank - k) as f64 / (rank - 1).max(1) as f64;
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(n: usize, mean: f64, deviation: f64) -> Samples {
        Samples { n, mean, deviation }
    }

    const FIVE: PublishedBest = PublishedBest {
        k: 5,
        value: 0.0,
        error: 0.0,
    };

    #[test]
    fn equal_samples_leave_the_published_error_alone() {
        let ours = samples(5, 1000.0, 0.0);
        let printed = |error| PublishedBest {
            value: 990.0,
            error,
            ..FIVE
        };
        assert_eq!(
            [9.0, 10.0, 11.0].map(|limit| printed(0.0).confidence_below(ours, limit)),
            [0.0, 0.5, 1.0]
        );
        assert_eq!(printed(0.0).interval(ours, 0.9), (10.0, 10.0));
        let (low, high) = printed(5.0).interval(ours, 0.9);
        // `scipy.stats.norm.ppf(0.95)` is 1.6448536.
        assert!(
            (high - 10.0 - 5.0 * 1.6448536).abs() < 1e-4 && (low + high - 20.0).abs() < 1e-4,
            "{low} {high}"
        );
        // What differs in its last bits only is as good as equal.
        let (low, high) = printed(0.0).interval(samples(5, 1000.0, 1e-13), 0.9);
        assert!(
            (low - 10.0).abs() < 1e-9 && (high - 10.0).abs() < 1e-9,
            "{low} {high}"
        );
    }

    /// By `scipy.integrate.quad` over z and w (SciPy 1.17.1): `norm.pdf(z) * norm.cdf((x - noise *
    /// z) / sigma)**5`, with noise `hypot(sigma / sqrt(n), error)` and sigma `1 / w`, and
    /// `chi.pdf(w * sqrt(n - 1), n - 1) * sqrt(n - 1)`.
    #[test]
    fn confidences_are_those_of_quadrature() {
        for (n, limit, exact, with_an_error_of_2) in [
            (3, -1.0, 0.01599414621507631, 0.14386616002271224),
            (3, 0.5, 0.21625041769118755, 0.33057281740605926),
            (3, 3.0, 0.8160856062586991, 0.7009853617921603),
            (5, -1.0, 0.005585402387636914, 0.14654599822135272),
            (5, 0.5, 0.20043672725382017, 0.3506862270868306),
            (5, 3.0, 0.9021783720542678, 0.7553566562403532),
            (20, -1.0, 0.000517370164939997, 0.15095638321608248),
            (20, 0.5, 0.17160518924016419, 0.37119678582507226),
            (20, 3.0, 0.9791773547685526, 0.7984706562084679),
        ] {
            let at = |error| {
                PublishedBest { error, ..FIVE }.confidence_below(samples(n, 0.0, 1.0), limit)
            };
            let (found, noisy) = (at(0.0), at(2.0));
            assert!((found - exact).abs() < 1e-7, "{n} {limit}: {found}");
            assert!(
                (noisy - with_an_error_of_2).abs() < 1e-7,
                "{n} {limit}: {noisy}"
            );
        }
    }

    /// `scipy.optimize.brentq` of the same; shifted and stretched, the interval goes along.
    #[test]
    fn intervals_are_those_of_quadrature() {
        for (n, low, high) in [
            (3, -0.3114594233995442, 6.302949655586064),
            (5, -0.12922981525707963, 3.787851376419593),
            (20, 0.057981132302226665, 2.574331238410482),
        ] {
            let found = FIVE.interval(samples(n, 0.0, 1.0), 0.9);
            assert!(
                (found.0 - low).abs() < 1e-5 && (found.1 - high).abs() < 1e-5,
                "{n}: {found:?}"
            );
            let found = PublishedBest {
                value: 300.0,
                ..FIVE
            }
            .interval(samples(n, 100.0, 20.0), 0.9);
            let wanted = (20.0 * low - 200.0, 20.0 * high - 200.0);
            assert!(
                (found.0 - wanted.0).abs() < 1e-3 && (found.1 - wanted.1).abs() < 1e-3,
                "{n}: {found:?}"
            );
        }
    }

    #[test]
    fn with_samples_without_end_the_published_draw_is_what_is_unknown() {
        let far = samples(1_000_000, 0.0, 1.0);
        for limit in [-0.5_f64, 0.2, 1.2, 2.5] {
            // The greatest of five is below x with probability Phi(x)^5.
            let (found, wanted) = (
                FIVE.confidence_below(far, limit),
                normal::cdf(limit).powi(5),
            );
            assert!((found - wanted).abs() < 1e-5, "{limit}: {found} {wanted}");
        }
    }

    /// The mean of the greatest of every choice of k: `mean(max(c) for c in
    /// itertools.combinations(x, k))`.
    #[test]
    fn the_expected_best_is_the_mean_over_all_choices() {
        let x = [3.0, -1.0, 7.5, 2.0, 2.0, 11.0, 0.5];
        assert_eq!(expected_best(&x, 8), None);
        for (k, wanted) in [(1, 25.0 / 7.0), (2, 6.0), (5, 205.5 / 21.0), (7, 11.0)] {
            let found = expected_best(&x, k).expect("enough");
            assert!((found - wanted).abs() < 1e-12, "{k}: {found} {wanted}");
        }
    }
}
