//! A tanh layer's activations and their derivatives, each in one pass over memory.
//!
//! Matrices are flat, column after column, one column a sample. The slope `1 - h^2` is rounded
//! once, which keeps its digits where h is near 1; a CPU without fused multiplication rounds it
//! twice.

use pulp::{Arch, Simd, WithSimd};

use super::elementary::{mul_add, tanh_of};

/// Activations from a layer's sums: replaces each column x of `values` (`[rows x n]`) by `tanh(x +
/// bias)`, with the errors of [`tanh`](super::tanh).
pub fn tanh_biased(values: &mut [f32], bias: &[f32]) {
    Arch::new().dispatch(Biased { values, bias });
}

/// The activations' derivative along a direction: replaces each column x of `values` (`[rows x n]`)
/// by `(x + bias) (1 - h^2)`, where `bias` is the bias's part of the direction, and h the same
/// column of `activations` (`[rows x n]`).
pub fn tanh_tangent(values: &mut [f32], bias: &[f32], activations: &[f32]) {
    assert_eq!(
        values.len(),
        activations.len(),
        "an activation for each value"
    );
    Arch::new().dispatch(Tangent {
        values,
        bias,
        activations,
    });
}

/// The derivative by the layer's sums, from the one by its activations: replaces each x of `values`
/// by `x (1 - h^2)`, where h is the same element of `activations`.
pub fn tanh_cotangent(values: &mut [f32], activations: &[f32]) {
    assert_eq!(
        values.len(),
        activations.len(),
        "an activation for each value"
    );
    Arch::new().dispatch(Cotangent {
        values,
        activations,
    });
}

struct Biased<'a> {
    values: &'a mut [f32],
    bias: &'a [f32],
}

impl WithSimd for Biased<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for column in self.values.chunks_exact_mut(self.bias.len()) {
            column
                .iter_mut()
                .zip(self.bias)
                .for_each(|(x, b)| *x = tanh_of::<S>(*x + b));
        }
    }
}

struct Tangent<'a> {
    values: &'a mut [f32],
    bias: &'a [f32],
    activations: &'a [f32],
}

impl WithSimd for Tangent<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let rows = self.bias.len();
        for (column, activations) in self
            .values
            .chunks_exact_mut(rows)
            .zip(self.activations.chunks_exact(rows))
        {
            for ((x, b), h) in column.iter_mut().zip(self.bias).zip(activations) {
                *x = (*x + b) * slope::<S>(*h);
            }
        }
    }
}

struct Cotangent<'a> {
    values: &'a mut [f32],
    activations: &'a [f32],
}

impl WithSimd for Cotangent<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.values
            .iter_mut()
            .zip(self.activations)
            .for_each(|(x, h)| *x *= slope::<S>(*h));
    }
}

/// The slope of tanh where its value is `h`.
#[inline(always)]
fn slope<S: Simd>(h: f32) -> f32 {
    mul_add::<S>(-h, h, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 37;

    /// A matrix of five columns and a bias, without a pattern.
    fn problem() -> (Vec<f32>, Vec<f32>) {
        (
            (0..ROWS * 5).map(|i| (i as f32 * 1.7).cos()).collect(),
            (0..ROWS).map(|i| (i as f32).sin()).collect(),
        )
    }

    #[test]
    #[should_panic(expected = "an activation for each value")]
    fn refuses_activations_of_another_length() {
        tanh_cotangent(&mut [1.0, 2.0], &[0.5]);
    }

    #[test]
    fn tanh_biased_is_tanh_of_the_sum() {
        let (mut values, bias) = problem();
        let mut expected: Vec<f32> = values
            .iter()
            .zip(bias.iter().cycle())
            .map(|(x, b)| x + b)
            .collect();
        super::super::tanh(&mut expected);
        tanh_biased(&mut values, &bias);
        assert_eq!(values, expected);
    }

    #[test]
    fn derivatives_are_those_of_tanh() {
        let (sums, bias) = problem();
        let mut activations = sums.clone();
        super::super::tanh(&mut activations);
        let (mut tangent, mut cotangent) = (sums.clone(), sums.clone());
        tanh_tangent(&mut tangent, &bias, &activations);
        tanh_cotangent(&mut cotangent, &activations);
        for (i, &x) in sums.iter().enumerate() {
            let slope = 1.0 / f64::from(x).cosh().powi(2);
            assert!((f64::from(cotangent[i]) - f64::from(x) * slope).abs() < 1e-6);
            assert!((f64::from(tangent[i]) - f64::from(x + bias[i % ROWS]) * slope).abs() < 1e-6);
        }
    }

    #[test]
    fn a_slope_keeps_its_digits_where_tanh_is_nearly_1() {
        let activation = 1.0 - 1001.0 * 0.5 * f32::EPSILON;
        let mut slope = [1.0];
        tanh_cotangent(&mut slope, &[activation]);
        let exact = (1.0 - f64::from(activation).powi(2)) as f32;
        // Rounded twice it is a multiple of half a unit in the last place of 1.
        assert_ne!((exact / (0.5 * f32::EPSILON)).fract(), 0.0);
        assert!(
            slope[0] == exact || matches!(Arch::new(), Arch::Scalar),
            "{}, {exact}",
            slope[0]
        );
    }
}
