//! Powers of two and tanh of whole slices.
//!
//! Both take a multiple of the period out of the argument (Cody and Waite, 1980) and evaluate a
//! polynomial. Every lane does what a single number would, so the bits do not depend on where in a
//! slice a number stands, nor on the width of the registers; only CPUs without fused multiplication
//! (x86 before 2013) give other last bits, as with the products.

use pulp::{Arch, Simd, WithSimd};

/// Replaces each x by 2^x, where x is 0 or below: above 0 counts as 0, and below -126 as -126, so
/// that every result is a normal number, 1 at most. NaN stays NaN.
///
/// Relative error at most 2e-7.
pub fn exp2_nonpositive(values: &mut [f32]) {
    Arch::new().dispatch(Exp2 { values });
}

/// Replaces each number by its hyperbolic tangent.
///
/// At most 2.7 units in the last place from the exact result, near zero too; odd to the bit, 1 in
/// magnitude from 9.02 on and never beyond; NaN stays NaN. Where the argument grows, no value falls
/// by more than 2 units.
pub fn tanh(values: &mut [f32]) {
    Arch::new().dispatch(Tanh { values });
}

struct Exp2<'a> {
    values: &'a mut [f32],
}

impl WithSimd for Exp2<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.values.iter_mut().for_each(|x| *x = exp2_of::<S>(*x));
    }
}

struct Tanh<'a> {
    values: &'a mut [f32],
}

impl WithSimd for Tanh<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.values.iter_mut().for_each(|x| *x = tanh_of::<S>(*x));
    }
}

/// `a b + c`, rounded once if `S` has vectors: with one lane there is no fused instruction, and
/// imitating it is slow.
#[inline(always)]
pub(super) fn mul_add<S: Simd>(a: f32, b: f32, c: f32) -> f32 {
    if S::F32_LANES == 1 {
        a * b + c
    } else {
        a.mul_add(b, c)
    }
}

/// 1.5 2^23: adding it leaves the nearest integer in the low bits, in every instruction set.
const SHIFT: f32 = 12_582_912.0;

/// 2^n, for n in -126..=127, from `n + SHIFT`: the shift to the left leaves only n.
#[inline(always)]
fn power_of_two(shifted: f32) -> f32 {
    f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()))
}

#[inline(always)]
pub(super) fn exp2_of<S: Simd>(x: f32) -> f32 {
    #[expect(
        clippy::approx_constant,
        reason = "the minimax polynomial's, three units in the last place below ln 2"
    )]
    const SLOPE: f32 = 0.693_147;
    // The comparison is written so that NaN passes through.
    let x = if x > 0.0 { 0.0 } else { x };
    let x = if x < -126.0 { -126.0 } else { x };
    // x = n + f with integer n and |f| <= 1/2, exactly.
    let shifted = x + SHIFT;
    let f = x - (shifted - SHIFT);
    // The relative error of this minimax polynomial is 9.2e-8 before rounding; 2^0 is 1.
    let p = 1.326_472_7e-3;
    let p = mul_add::<S>(p, f, 9.671_512e-3);
    let p = mul_add::<S>(p, f, 5.550_733_7e-2);
    let p = mul_add::<S>(p, f, 0.240_222_42);
    let p = mul_add::<S>(p, f, SLOPE);
    let p = mul_add::<S>(p, f, 1.0);
    p * power_of_two(shifted)
}

#[inline(always)]
pub(super) fn tanh_of<S: Simd>(x: f32) -> f32 {
    const HALF_LN_2: f32 = 0.5 * std::f32::consts::LN_2;
    // tanh |x| = m / (m + 1), where m is half of e^2|x| - 1.
    let y = x.abs();
    let y = if y > 9.5 { 9.5 } else { y }; // NaN passes
    // 2 y = n ln 2 + 2 r with integer n and |r| <= 0.1733. One constant's rounding, times n, errs
    // by 6e-9 at most where tanh is not yet 1 by as much.
    let shifted = mul_add::<S>(y, 2.0 * std::f32::consts::LOG2_E, SHIFT);
    let r = mul_add::<S>(shifted - SHIFT, -HALF_LN_2, y);
    // (e^2r - 1) / 2 = r + r^2 q: the relative error of this minimax polynomial is 1.4e-8 before
    // rounding.
    let q = 4.442_407e-2;
    let q = mul_add::<S>(q, r, 0.133_864_3);
    let q = mul_add::<S>(q, r, 0.333_337_6);
    let q = mul_add::<S>(q, r, 0.666_661_74);
    let q = mul_add::<S>(q, r, 0.999_999_96);
    let small = mul_add::<S>(r * r, q, r);
    // m = 2^n (e^2r - 1) / 2 + (2^n - 1) / 2, which loses nothing near zero.
    let power = power_of_two(shifted);
    let m = mul_add::<S>(power, small, mul_add::<S>(power, 0.5, -0.5));
    (m / (m + 1.0)).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every 997th number of f32, of both signs: about 4.3 million, with zeros, subnormals,
    /// infinities and NaN among them.
    fn numbers() -> Vec<f32> {
        let mut numbers: Vec<f32> = (0..=u32::MAX).step_by(997).map(f32::from_bits).collect();
        // Where the interesting things happen, much denser.
        numbers.extend((-2_000_000..2_000_000).map(|i| i as f32 * 1e-5 * 1.000_03));
        numbers
    }

    /// f32's distance between numbers of the size of `y`, down to the smallest normal ones.
    fn unit(y: f64) -> f64 {
        let exponent = y.abs().log2().floor().max(-126.0) as i32;
        2f64.powi(exponent - 23)
    }

    /// The largest distance of `function` from `exact`, in units of the last place, and where it
    /// is. Asserts that both are NaN at the same places.
    fn worst_error(
        function: impl Fn(f32) -> f32,
        exact: fn(f64) -> f64,
        arguments: &[f32],
    ) -> (f64, f32) {
        let mut worst = (0.0, 0.0);
        for &x in arguments {
            let (y, exact) = (function(x), exact(f64::from(x)));
            assert_eq!(y.is_nan(), exact.is_nan(), "at {x}: {y}");
            let error = (f64::from(y) - exact).abs() / unit(exact);
            if error > worst.0 {
                worst = (error, x);
            }
        }
        worst
    }

    /// The fused and the unfused arithmetic, number by number. (Without their instructions the
    /// fused one is slow.)
    #[cfg(target_arch = "x86_64")]
    type Fused = pulp::x86::V3;
    #[cfg(target_arch = "aarch64")]
    type Fused = pulp::aarch64::Neon;
    type Unfused = pulp::Scalar;

    /// Whether this CPU fuses.
    fn is_fused() -> bool {
        !matches!(Arch::new(), Arch::Scalar)
    }

    #[test]
    fn exp2_is_within_its_bound() {
        let clamped = |x: f64| {
            if x.is_nan() {
                x
            } else {
                x.clamp(-126.0, 0.0).exp2()
            }
        };
        for (name, function) in [
            ("fused", exp2_of::<Fused> as fn(f32) -> f32),
            ("unfused", exp2_of::<Unfused>),
        ] {
            for x in numbers() {
                let (y, exact) = (f64::from(function(x)), clamped(f64::from(x)));
                assert_eq!(y.is_nan(), exact.is_nan(), "{name} at {x}: {y}");
                assert!(
                    x.is_nan() || (y / exact - 1.0).abs() <= 2e-7,
                    "{name} at {x}: {y}, {exact}"
                );
            }
        }
    }

    #[test]
    fn exp2_at_the_ends() {
        let mut values = [
            0.0,
            -0.0,
            1e-30,
            3.0,
            f32::INFINITY,
            -1.0,
            -125.0,
            -126.0,
            -1e30,
            f32::NEG_INFINITY,
        ];
        exp2_nonpositive(&mut values);
        let least = f32::MIN_POSITIVE;
        assert_eq!(
            values,
            [
                1.0,
                1.0,
                1.0,
                1.0,
                1.0,
                0.5,
                2.0 * least,
                least,
                least,
                least
            ]
        );
        // Whatever a NaN carries.
        let mut values: Vec<f32> = (0..1 << 12)
            .map(|bits| f32::from_bits(0x7fc0_0000 | bits))
            .collect();
        exp2_nonpositive(&mut values);
        assert!(values.iter().all(|x| x.is_nan()));
    }

    #[test]
    fn tanh_is_within_its_bound() {
        for (name, function) in [
            ("fused", tanh_of::<Fused> as fn(f32) -> f32),
            ("unfused", tanh_of::<Unfused>),
        ] {
            let (error, x) = worst_error(function, f64::tanh, &numbers());
            assert!(error <= 2.7, "{name}: {error} at {x}");
        }
    }

    #[test]
    fn tanh_never_falls_by_more_than_its_rounding_and_ends_at_1() {
        // Every number from where tanh x is still x up to beyond 1's beginning, some at a time.
        let (first, last) = (2e-8f32.to_bits(), 9.6f32.to_bits());
        let (mut before, mut largest_fall) = (0, 0);
        for start in (first..last).step_by(1 << 16) {
            let mut values: Vec<f32> = (start..last.min(start + (1 << 16)))
                .map(f32::from_bits)
                .collect();
            tanh(&mut values);
            for value in values {
                largest_fall = largest_fall.max(before - value.to_bits() as i32);
                before = value.to_bits() as i32;
            }
        }
        assert!(largest_fall <= 2, "by {largest_fall} units");
        let mut values: Vec<f32> = (9.02f32.to_bits()..=f32::INFINITY.to_bits())
            .step_by(97)
            .map(f32::from_bits)
            .collect();
        tanh(&mut values);
        assert!(values.iter().all(|&y| y == 1.0));
    }

    #[test]
    fn tanh_is_odd_bounded_and_exact_at_the_ends() {
        let arguments: Vec<f32> = numbers().into_iter().filter(|x| !x.is_nan()).collect();
        let (mut plus, mut minus) = (
            arguments.clone(),
            arguments.iter().map(|x| -x).collect::<Vec<_>>(),
        );
        tanh(&mut plus);
        tanh(&mut minus);
        assert!(
            plus.iter()
                .zip(&minus)
                .all(|(p, m)| p.to_bits() == (-m).to_bits())
        );
        assert!(plus.iter().all(|y| y.abs() <= 1.0));
        let mut ends = [
            0.0,
            -0.0,
            30.0,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MIN_POSITIVE / 4.0,
        ];
        tanh(&mut ends);
        assert_eq!(
            ends.map(f32::to_bits),
            [0.0, -0.0, 1.0, 1.0, -1.0, f32::MIN_POSITIVE / 4.0].map(f32::to_bits)
        );
        // What is too small to be changed.
        for x in (0..2e-8f32.to_bits()).step_by(9973).map(f32::from_bits) {
            let mut value = [x];
            tanh(&mut value);
            assert_eq!(value[0].to_bits(), x.to_bits());
        }
    }

    #[test]
    fn bits_depend_neither_on_the_place_in_the_slice_nor_on_the_width_of_registers() {
        let numbers: Vec<f32> = (0..1000).map(|i| (i as f32 - 500.0) * 0.0137).collect();
        let exp2 = (
            exp2_nonpositive as fn(&mut [f32]),
            [exp2_of::<Fused> as fn(f32) -> f32, exp2_of::<Unfused>],
        );
        for (function, [fused, unfused]) in [exp2, (tanh, [tanh_of::<Fused>, tanh_of::<Unfused>])] {
            let mut together = numbers.clone();
            function(&mut together);
            let of_one = if is_fused() { fused } else { unfused };
            for (i, &x) in numbers.iter().enumerate() {
                let mut alone = [x];
                function(&mut alone);
                assert_eq!(alone[0].to_bits(), together[i].to_bits());
                // By instructions for one number.
                assert_eq!(of_one(x).to_bits(), together[i].to_bits());
            }
        }
    }
}
