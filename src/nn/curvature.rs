//! The Gauss-Newton product of a network: there and back in half the operations of a JVP and a VJP.
//!
//! The derivative J of the few outputs by the hidden layers' sums is computed once for a forward
//! pass, as if each output were propagated back alone. After that, neither way needs the hidden
//! weights: a change of a layer's weights moves the outputs through J at once, and the outputs'
//! derivative comes back through it. With two hidden layers of h that leaves two products with h x
//! h matrices of the four.

use nalgebra::DMatrix;

use super::{
    Mlp,
    mlp::{add_gradient, add_to_columns},
    pass::{
        Kept, Pass, Scratch, columns, columns_mut, cut, first, grow, matrix, matrix_mut,
        sum_over_chunks,
    },
};
use crate::arithmetic::{
    product::product, product_of_columns, tanh_cotangent, tanh_tangent, threads, transpose,
};

/// Samples whose sensitivities are computed together; few enough for the cache.
const SENSITIVE: usize = 32;

impl Mlp {
    /// Writes `J^T W J x` to `result` (`[parameters]`, as `x`), where J is the derivative of all
    /// samples' outputs by the parameters, and W is diagonal, `weights` (`[out]`) in each sample.
    /// `pass` is that of the last [`forward`](Mlp::forward) on the same `inputs` and parameters.
    pub(super) fn gauss_newton(
        &self,
        inputs: &DMatrix<f32>,
        pass: &mut Pass,
        weights: &[f32],
        x: &[f32],
        result: &mut [f32],
    ) {
        pass.check(self.widths(), inputs);
        assert_eq!(x.len(), self.parameters().len(), "length of the vector");
        assert_eq!(
            result.len(),
            self.parameters().len(),
            "length of the result"
        );
        assert_eq!(weights.len(), pass.output_dim, "a weight for each output");
        self.transpose(pass);
        self.sense(pass);
        let Pass {
            samples,
            activations,
            transposed,
            sensitivities,
            rooms,
            ..
        } = pass;
        sum_over_chunks(*samples, rooms, result, |chunk, scratch, result, beta| {
            let kept = Kept {
                widths: self.widths(),
                inputs: inputs.as_slice(),
                activations,
                chunk,
            };
            self.move_outputs(&kept, transposed, x, scratch);
            through_sensitivities(&kept, sensitivities, weights, scratch);

            let Scratch {
                hidden,
                output,
                output_weights,
                ..
            } = scratch;
            let cotangent = first(output, weights.len(), kept.chunk.len());
            let layer = hidden.len();
            // The last hidden layer has no sensitivities: the output weights alone lead back to it.
            if let Some(last) = hidden.last_mut() {
                let width = self.widths()[layer];
                let last = &mut last[..width * kept.chunk.len()];
                product(
                    matrix(&transposed[layer], width),
                    cotangent,
                    0.0,
                    matrix_mut(last, width),
                );
                tanh_cotangent(last, kept.flat_input(layer));
            }
            add_gradient(&kept, hidden, cotangent, output_weights, result, beta);
        });
    }

    /// Computes the changes along `x`.
    /// `scratch.hidden` gets the changes of each hidden layer's sums by that layer's own
    /// parameters, those of the last layer times tanh's slope.
    /// `scratch.output` gets the outputs' changes by the output layer and the last hidden one.
    fn move_outputs(
        &self,
        kept: &Kept<'_>,
        transposed: &[Vec<f32>],
        x: &[f32],
        scratch: &mut Scratch,
    ) {
        let n = kept.chunk.len();
        let Scratch {
            hidden,
            output,
            output_weights,
            ..
        } = scratch;
        let last = hidden.len();
        for (layer, (weights, biases)) in self.layers_of(x).enumerate() {
            let (width, fan_in) = weights.shape();
            if layer < last {
                let here = &mut hidden[layer][..width * n];
                product(weights, kept.input(layer), 0.0, matrix_mut(here, width));
                if layer + 1 < last {
                    add_to_columns(here, biases);
                } else {
                    tanh_tangent(here, biases, kept.flat_input(last));
                }
            } else {
                let output = &mut output[..width * n];
                // Transposed, since a product whose result has few rows is slow.
                transpose(weights, matrix_mut(output_weights, fan_in));
                product_of_columns(
                    matrix(output_weights, fan_in),
                    kept.input(layer),
                    0.0,
                    matrix_mut(output, width),
                );
                if let Some(below) = hidden.last() {
                    let weights = matrix(&transposed[layer], fan_in);
                    product_of_columns(
                        weights,
                        first(below, fan_in, n),
                        1.0,
                        matrix_mut(output, width),
                    );
                }
                add_to_columns(output, biases);
            }
        }
    }

    /// Computes [`Pass::sensitivities`], from the last hidden layer's down; that layer's are the
    /// output weights times tanh's slopes.
    fn sense(&self, pass: &mut Pass) {
        if pass.is_sensitive {
            return;
        }
        pass.is_sensitive = true;
        let [_, hidden @ .., outputs] = self.widths() else {
            return;
        };
        // A single hidden layer has none below it, so there is nothing to keep.
        let Some((last, lower @ [_, ..])) = hidden.split_last() else {
            return;
        };
        let Pass {
            samples,
            activations,
            transposed,
            sensitivities,
            rooms,
            ..
        } = pass;
        sensitivities.resize_with(lower.len(), Vec::new);
        for (sensitivity, width) in sensitivities.iter_mut().zip(lower) {
            grow(sensitivity, width * outputs * *samples);
        }
        let layers = sensitivities
            .iter_mut()
            .zip(lower.iter().map(|width| width * outputs));
        threads::share(
            rooms,
            cut(layers, *samples, SENSITIVE),
            |room, (range, mut layers)| {
                grow(&mut room.sensitivity, last * outputs * SENSITIVE);
                let of_last = &mut room.sensitivity[..last * outputs * range.len()];
                for sample in of_last.chunks_exact_mut(last * outputs) {
                    sample.copy_from_slice(&transposed[lower.len() + 1]);
                }
                times_slopes(
                    of_last,
                    columns(&activations[lower.len()], *last, &range),
                    *last,
                    *outputs,
                );
                for (layer, &width) in lower.iter().enumerate().rev() {
                    let (here, above) = layers.split_at_mut(layer + 1);
                    let above = matrix(
                        above.first().map_or(&*of_last, |above| above),
                        hidden[layer + 1],
                    );
                    product(
                        matrix(&transposed[layer + 1], width),
                        above,
                        0.0,
                        matrix_mut(here[layer], width),
                    );
                    times_slopes(
                        here[layer],
                        columns(&activations[layer], width, &range),
                        width,
                        *outputs,
                    );
                }
            },
        );
    }
}

/// Multiplies each sample's `outputs` columns of `width` by tanh's slopes where its `activations`
/// (`[width x n]`) are.
fn times_slopes(sensitivities: &mut [f32], activations: &[f32], width: usize, outputs: usize) {
    let samples = sensitivities
        .chunks_exact_mut(width * outputs)
        .zip(activations.chunks_exact(width));
    for (columns, activation) in samples {
        columns
            .chunks_exact_mut(width)
            .for_each(|column| tanh_cotangent(column, activation));
    }
}

/// Completes the changes of the outputs by those of the lower hidden layers' sums, weighs them, and
/// takes them back to those layers: sample by sample, so that the sensitivities, far more than a
/// cache holds, are read once.
fn through_sensitivities(
    kept: &Kept<'_>,
    sensitivities: &[Vec<f32>],
    weights: &[f32],
    scratch: &mut Scratch,
) {
    let outputs = weights.len();
    let Scratch { hidden, output, .. } = scratch;
    for (i, (sample, output)) in kept
        .chunk
        .clone()
        .zip(output.chunks_exact_mut(outputs))
        .enumerate()
    {
        let layers = || {
            kept.widths[1..]
                .iter()
                .zip(sensitivities)
                .map(|(&width, all)| {
                    (
                        width,
                        matrix(columns(all, width * outputs, &(sample..sample + 1)), width),
                    )
                })
        };
        for ((width, sensitivity), change) in layers().zip(&*hidden) {
            let change = matrix(columns(change, width, &(i..i + 1)), width);
            product_of_columns(sensitivity, change, 1.0, matrix_mut(output, outputs));
        }
        output
            .iter_mut()
            .zip(weights)
            .for_each(|(x, weight)| *x *= weight);
        for ((width, sensitivity), change) in layers().zip(&mut *hidden) {
            let change = columns_mut(change, width, &(i..i + 1));
            product(
                sensitivity,
                matrix(output, outputs),
                0.0,
                matrix_mut(change, width),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{mlp::tests::numbers, pass::CHUNK},
        *,
    };
    use crate::rng::{Seed, Stream};

    /// There by a JVP and back by a VJP, which are checked against finite differences.
    #[test]
    fn it_is_a_jvp_and_a_vjp_for_any_number_of_layers() {
        for widths in [
            &[3, 2][..],
            &[3, 9, 2],
            &[3, 9, 7, 2],
            &[3, 9, 7, 11, 1],
            &[2, 5, 4, 3, 6, 4],
        ] {
            let n = CHUNK + 37;
            let network = Mlp::new(widths, 1.0, &mut Seed(4).stream(Stream::Network, 0));
            let inputs = DMatrix::from_vec(widths[0], n, numbers(widths[0] * n, 1));
            let outputs = widths[widths.len() - 1];
            let weights: Vec<f32> = (1..=outputs).map(|j| 0.3 * j as f32).collect();
            let x = numbers(network.parameters().len(), 2);
            let (mut pass, mut result) = (Pass::default(), vec![f32::NAN; x.len()]);
            network.forward(&inputs, &mut pass);
            network.gauss_newton(&inputs, &mut pass, &weights, &x, &mut result);
            let mut again = vec![f32::NAN; x.len()];
            network.gauss_newton(&inputs, &mut pass, &weights, &x, &mut again);
            assert_eq!(result, again);

            let (mut change, mut expected) = (DMatrix::zeros(outputs, n), vec![f32::NAN; x.len()]);
            network.jvp(&inputs, &mut pass, &x, &mut change);
            change
                .column_iter_mut()
                .for_each(|mut column| column.iter_mut().zip(&weights).for_each(|(x, w)| *x *= w));
            network.vjp(&inputs, &mut pass, &change, &mut expected);
            let scale = expected
                .iter()
                .fold(0.0f32, |largest, x| largest.max(x.abs()));
            for (found, wanted) in result.iter().zip(&expected) {
                // Both round sums of 293 samples through a few layers.
                assert!(
                    (found - wanted).abs() < 1e-5 * scale,
                    "{widths:?}: {found}, {wanted}"
                );
            }
        }
    }
}
