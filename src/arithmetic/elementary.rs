//! exp and tanh of whole slices.
//!
//! Both reduce the argument by multiples of ln 2 (Cody and Waite, 1980) and evaluate the same polynomial. No fused
//! multiplication and addition is used and every lane does what a single number would, so the bits depend neither on the
//! CPU nor on where in a slice a number stands.

use pulp::{Arch, Simd, WithSimd};

/// Replaces each number by its exponential.
///
/// Relative error at most 1.2e-7 where the result is a normal number, half a unit in the last place more than the exact
/// result's own rounding where it is subnormal; infinities and NaN go where they should.
pub fn exp(values: &mut [f32]) {
    Arch::new().dispatch(Each { values, function: exp_of });
}

/// Replaces each number by its hyperbolic tangent.
///
/// Relative error at most 2e-7, near zero too; odd to the bit and never beyond 1 in magnitude; NaN stays NaN.
pub fn tanh(values: &mut [f32]) {
    Arch::new().dispatch(Each { values, function: tanh_of });
}

/// Calls the function with the widest vectors of this CPU. (A type of its own instead of a closure, because a closure's
/// call is inlined only where the compiler sees fit, and else stays narrow.)
struct Each<'a, F> {
    values: &'a mut [f32],
    function: F,
}

impl<F: Fn(f32) -> f32> WithSimd for Each<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.values.iter_mut().for_each(|x| *x = (self.function)(*x));
    }
}

/// `x = n ln 2 + r` with integer n and |r| <= 0.3467, for |x| < 120: gives n and r.
#[inline(always)]
fn reduce(x: f32) -> (i32, f32) {
    /// 1.5 2^23: adding it leaves the nearest integer in the low bits, in every instruction set.
    const SHIFT: f32 = 12_582_912.0;
    /// The first 15 bits of ln 2, so that n times it is exact, and the rest.
    const LN_2_HIGH: f32 = 0.693_145_75;
    const LN_2_LOW: f32 = 1.428_606_8e-6;
    let shifted = x * std::f32::consts::LOG2_E + SHIFT;
    let n = shifted - SHIFT;
    (shifted.to_bits().wrapping_sub(SHIFT.to_bits()) as i32, x - n * LN_2_HIGH - n * LN_2_LOW)
}

/// `e^r - 1` for |r| <= 0.3467: the relative error of this minimax polynomial is 2.4e-10 before rounding.
#[inline(always)]
fn exp_m1_reduced(r: f32) -> f32 {
    let q = 1.984_588_2e-4_f32;
    let q = q * r + 1.394_066_8e-3;
    let q = q * r + 8.333_39e-3;
    let q = q * r + 4.166_636e-2;
    let q = q * r + 0.166_666_66;
    let q = q * r + 0.5;
    r + r * r * q
}

/// 2^n, for n in -126..=127.
#[inline(always)]
fn power_of_two(n: i32) -> f32 {
    f32::from_bits((n.wrapping_add(127) as u32) << 23)
}

#[inline(always)]
fn exp_of(x: f32) -> f32 {
    // Beyond these the result is infinity or zero; written so that NaN passes.
    let x = if x > 89.0 { 89.0 } else { x };
    let x = if x < -104.0 { -104.0 } else { x };
    let (n, r) = reduce(x);
    // In two factors, since 2^n alone may be no normal number.
    let half = n >> 1;
    (1.0 + exp_m1_reduced(r)) * power_of_two(half) * power_of_two(n.wrapping_sub(half))
}

#[inline(always)]
pub(super) fn tanh_of(x: f32) -> f32 {
    // tanh |x| = (e^2|x| - 1) / (e^2|x| + 1), by e^2|x| - 1 = 2^n (e^r - 1) + (2^n - 1), which loses nothing near zero.
    let doubled = 2.0 * x.abs();
    let doubled = if doubled > 19.0 { 19.0 } else { doubled }; // tanh is 1 from 18.1 on; NaN passes
    let (n, r) = reduce(doubled);
    let power = power_of_two(n);
    let exp_m1 = power * exp_m1_reduced(r) + (power - 1.0);
    (exp_m1 / (exp_m1 + 2.0)).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every 997th number of f32, of both signs: about 4.3 million, with zeros, subnormals, infinities and NaN among them.
    fn numbers() -> Vec<f32> {
        let mut numbers: Vec<f32> = (0..=u32::MAX).step_by(997).map(f32::from_bits).collect();
        // Where the interesting things happen, much denser.
        numbers.extend((-2_000_000..2_000_000).map(|i| i as f32 * 1e-5 * 1.000_03));
        numbers
    }

    fn worst_relative_error(function: fn(&mut [f32]), exact: fn(f64) -> f64, counts: fn(f64) -> bool) -> (f64, f32) {
        let arguments = numbers();
        let mut values = arguments.clone();
        function(&mut values);
        let mut worst = (0.0, 0.0);
        for (&x, &y) in arguments.iter().zip(&values) {
            let exact = exact(f64::from(x));
            assert_eq!(y.is_nan(), exact.is_nan(), "at {x}: {y}");
            if counts(exact) {
                let error = (f64::from(y) / exact - 1.0).abs();
                if error > worst.0 || error.is_nan() {
                    worst = (error, x);
                }
            }
        }
        worst
    }

    #[test]
    fn exp_is_within_its_bound_where_the_result_is_normal() {
        let normal = |y: f64| y >= f64::from(f32::MIN_POSITIVE) && y <= f64::from(f32::MAX);
        let (error, x) = worst_relative_error(exp, f64::exp, normal);
        assert!(error <= 1.2e-7, "{error} at {x}");
    }

    #[test]
    fn exp_at_the_ends() {
        let mut values = [f32::NEG_INFINITY, -1e30, -104.0, -0.0, 0.0, 88.8, 1e30, f32::INFINITY, f32::NAN];
        exp(&mut values);
        assert_eq!(values[..8], [0.0, 0.0, 0.0, 1.0, 1.0, f32::INFINITY, f32::INFINITY, f32::INFINITY]);
        assert!(values[8].is_nan());
        // Subnormal results, in units of the smallest: at most one away from the exact one.
        for i in 0..1000 {
            let x = -103.9 + 16.5 * i as f32 / 1000.0;
            let mut value = [x];
            exp(&mut value);
            let exact = f64::from(x).exp() / 2f64.powi(-149);
            assert!((f64::from(value[0]) / 2f64.powi(-149) - exact).abs() <= 1.0, "at {x}");
        }
    }

    #[test]
    fn tanh_is_within_its_bound() {
        // Zero is exact (below); the smallest subnormals have no relative precision to lose, since tanh x = x there.
        let (error, x) = worst_relative_error(tanh, f64::tanh, |y| y != 0.0 && !y.is_nan());
        assert!(error <= 2e-7, "{error} at {x}");
    }

    #[test]
    fn tanh_is_odd_bounded_and_exact_at_the_ends() {
        let arguments: Vec<f32> = numbers().into_iter().filter(|x| !x.is_nan()).collect();
        let (mut plus, mut minus) = (arguments.clone(), arguments.iter().map(|x| -x).collect::<Vec<_>>());
        tanh(&mut plus);
        tanh(&mut minus);
        assert!(plus.iter().zip(&minus).all(|(p, m)| p.to_bits() == (-m).to_bits()));
        assert!(plus.iter().all(|y| y.abs() <= 1.0));
        let mut ends = [0.0, -0.0, 30.0, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE / 4.0];
        tanh(&mut ends);
        assert_eq!(ends.map(f32::to_bits), [0.0, -0.0, 1.0, 1.0, -1.0, f32::MIN_POSITIVE / 4.0].map(f32::to_bits));
    }

    #[test]
    fn bits_depend_neither_on_the_place_in_the_slice_nor_on_the_instructions() {
        let numbers: Vec<f32> = (0..1000).map(|i| (i as f32 - 500.0) * 0.0137).collect();
        for (function, of_one) in [(exp as fn(&mut [f32]), exp_of as fn(f32) -> f32), (tanh, tanh_of)] {
            let mut together = numbers.clone();
            function(&mut together);
            for (i, &x) in numbers.iter().enumerate() {
                let mut alone = [x];
                function(&mut alone);
                assert_eq!(alone[0].to_bits(), together[i].to_bits());
                // By the instructions that every CPU of this kind has.
                assert_eq!(of_one(x).to_bits(), together[i].to_bits());
            }
        }
    }
}
