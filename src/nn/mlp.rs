//! A multilayer perceptron with tanh hidden layers and a linear output, with parameters in one flat
//! vector.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use super::pass::{
    CHUNK, Kept, Pass, Scratch, chunks, columns, columns_mut, cut, first, matrix, matrix_mut,
    sum_over_chunks,
};
use crate::{
    arithmetic::{
        product::{product, product_nt, product_nt_and_sum},
        product_of_columns, tanh_biased, tanh_cotangent, tanh_tangent, threads, transpose,
    },
    rng::Rng,
};

/// The sum over a chunk's samples is a product with these.
static ONES: [f32; CHUNK] = [1.0; CHUNK];

/// A network's shape and parameters: for each layer the weights (column-major `[out x in]`), then
/// the biases (`[out]`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mlp {
    widths: Vec<usize>,
    parameters: Vec<f32>,
}

impl Mlp {
    /// A network with layers of `widths` (input, hidden ..., output); weights uniform in
    /// +-1/sqrt(fan-in), those of the output layer times `output_scale`; hidden biases likewise
    /// uniform, output biases zero.
    pub fn new(widths: &[usize], output_scale: f32, rng: &mut Rng) -> Self {
        assert!(
            widths.len() >= 2 && !widths.contains(&0),
            "a network needs an input and an output: {widths:?}"
        );
        let mut parameters = Vec::with_capacity(widths.windows(2).map(block_len).sum());
        for (layer, shape) in widths.windows(2).enumerate() {
            let is_output = layer + 2 == widths.len();
            let bound = 1.0 / (shape[0] as f32).sqrt();
            let scale = if is_output { output_scale } else { 1.0 };
            parameters
                .extend((0..shape[0] * shape[1]).map(|_| scale * rng.random_range(-bound..=bound)));
            if is_output {
                parameters.extend((0..shape[1]).map(|_| 0.0));
            } else {
                parameters.extend((0..shape[1]).map(|_| rng.random_range(-bound..=bound)));
            }
        }
        Self {
            widths: widths.to_vec(),
            parameters,
        }
    }

    /// Input, hidden and output widths.
    pub fn widths(&self) -> &[usize] {
        &self.widths
    }

    /// All parameters in one vector.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// All parameters in one vector, to be changed.
    pub fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// Each layer's weights `[out x in]` and biases `[out]`, from the input on.
    pub fn layers(&self) -> impl Iterator<Item = (DMatrixView<'_, f32>, &[f32])> {
        self.layers_of(&self.parameters)
    }

    /// The layers of any vector that is laid out like the parameters.
    pub(super) fn layers_of<'a>(
        &'a self,
        mut flat: &'a [f32],
    ) -> impl Iterator<Item = (DMatrixView<'a, f32>, &'a [f32])> {
        self.widths.windows(2).map(move |shape| {
            let (block, rest) = flat.split_at(block_len(shape));
            flat = rest;
            let (weights, biases) = block.split_at(shape[0] * shape[1]);
            (DMatrixView::from_slice(weights, shape[1], shape[0]), biases)
        })
    }

    /// Runs `inputs` (`[in x n]`) through the network; the outputs are in [`Pass::output`].
    pub fn forward(&self, inputs: &DMatrix<f32>, pass: &mut Pass) {
        assert_eq!(
            inputs.nrows(),
            self.widths[0],
            "height of the network's inputs"
        );
        pass.prepare(&self.widths, inputs.ncols());
        let Pass {
            activations,
            transposed,
            rooms,
            ..
        } = pass;
        if let (Some((weights, _)), Some(transposed)) =
            (self.layers().last(), transposed.last_mut())
        {
            transpose(weights, matrix_mut(transposed, weights.ncols()));
        }
        let output_weights = transposed.last().map_or(&[][..], Vec::as_slice);
        let input_of = |chunk: &Range<usize>| columns(inputs.as_slice(), self.widths[0], chunk);
        let layers = activations.iter_mut().zip(self.widths[1..].iter().copied());
        if rooms.len() > 1 {
            threads::share(
                rooms,
                cut(layers, inputs.ncols(), CHUNK),
                |_, (chunk, layers)| {
                    self.forward_chunk(input_of(&chunk), output_weights, layers.into_iter());
                },
            );
        } else {
            for chunk in chunks(inputs.ncols()) {
                let layers = activations.iter_mut().zip(&self.widths[1..]);
                let layers = layers.map(|(values, &width)| columns_mut(values, width, &chunk));
                self.forward_chunk(input_of(&chunk), output_weights, layers);
            }
        }
    }

    /// Runs the `inputs` of one chunk through the network to the activations of each of `layers`,
    /// from the input on. `output_weights` are the output layer's, transposed.
    fn forward_chunk<'a>(
        &self,
        inputs: &'a [f32],
        output_weights: &[f32],
        layers: impl Iterator<Item = &'a mut [f32]>,
    ) {
        let mut input = inputs;
        let output_layer = self.widths.len() - 2;
        for ((layer, (weights, biases)), output) in self.layers().enumerate().zip(layers) {
            let (width, fan_in) = weights.shape();
            if layer == output_layer {
                product_of_columns(
                    matrix(output_weights, fan_in),
                    matrix(input, fan_in),
                    0.0,
                    matrix_mut(output, width),
                );
                add_to_columns(output, biases);
            } else {
                product(
                    weights,
                    matrix(input, fan_in),
                    0.0,
                    matrix_mut(output, width),
                );
                tanh_biased(output, biases);
            }
            input = output;
        }
    }

    /// Writes the gradient (`[parameters]`) of the sum over samples of `cotangent . output`
    /// (`cotangent` is `[out x n]`). `pass` is that of the last [`forward`](Mlp::forward) on the
    /// same `inputs` and parameters.
    pub fn vjp(
        &self,
        inputs: &DMatrix<f32>,
        pass: &mut Pass,
        cotangent: &DMatrix<f32>,
        gradient: &mut [f32],
    ) {
        pass.check(&self.widths, inputs);
        assert_eq!(
            cotangent.shape(),
            (pass.output_dim, pass.samples),
            "shape of the cotangent"
        );
        assert_eq!(
            gradient.len(),
            self.parameters.len(),
            "length of the gradient"
        );
        self.transpose(pass);
        let Pass {
            samples,
            activations,
            transposed,
            rooms,
            ..
        } = pass;
        sum_over_chunks(
            *samples,
            rooms,
            gradient,
            |chunk,
             Scratch {
                 hidden,
                 output_weights,
                 ..
             },
             gradient,
             beta| {
                let kept = Kept {
                    widths: &self.widths,
                    inputs: inputs.as_slice(),
                    activations,
                    chunk,
                };
                let cotangent = matrix(
                    columns(cotangent.as_slice(), cotangent.nrows(), &kept.chunk),
                    cotangent.nrows(),
                );
                // Down to the first hidden layer: nobody needs the derivative by the inputs.
                for layer in (1..transposed.len()).rev() {
                    let (here, above) = hidden.split_at_mut(layer);
                    let derivative = above.first().map_or(cotangent, |above| {
                        first(above, self.widths[layer + 1], kept.chunk.len())
                    });
                    let here = &mut here[layer - 1][..self.widths[layer] * kept.chunk.len()];
                    let weights = matrix(&transposed[layer], self.widths[layer]);
                    product(
                        weights,
                        derivative,
                        0.0,
                        matrix_mut(here, self.widths[layer]),
                    );
                    tanh_cotangent(here, kept.flat_input(layer));
                }
                add_gradient(&kept, hidden, cotangent, output_weights, gradient, beta);
            },
        );
    }

    /// Computes all of [`Pass::transposed`].
    pub(super) fn transpose(&self, pass: &mut Pass) {
        if !pass.is_transposed {
            for ((weights, _), transposed) in self.layers().zip(&mut pass.transposed) {
                transpose(weights, matrix_mut(transposed, weights.ncols()));
            }
            pass.is_transposed = true;
        }
    }

    /// Writes the directional derivative of the outputs (`[out x n]`) along `tangent`
    /// (`[parameters]`). `pass` is that of the last [`forward`](Mlp::forward) on the same `inputs`
    /// and parameters.
    pub fn jvp(
        &self,
        inputs: &DMatrix<f32>,
        pass: &mut Pass,
        tangent: &[f32],
        output_tangent: &mut DMatrix<f32>,
    ) {
        pass.check(&self.widths, inputs);
        assert_eq!(
            tangent.len(),
            self.parameters.len(),
            "length of the tangent"
        );
        assert_eq!(
            output_tangent.shape(),
            (pass.output_dim, pass.samples),
            "shape of the output's tangent"
        );
        let Pass {
            samples,
            activations,
            rooms,
            ..
        } = pass;
        let hidden = &mut rooms[0].hidden;
        for chunk in chunks(*samples) {
            let kept = Kept {
                widths: &self.widths,
                inputs: inputs.as_slice(),
                activations,
                chunk,
            };
            let layers = self.layers().zip(self.layers_of(tangent));
            for (layer, ((weights, _), (weights_tangent, biases_tangent))) in layers.enumerate() {
                let (width, fan_in) = weights.shape();
                let (below, here) = hidden.split_at_mut(layer);
                let is_output = here.is_empty();
                let here = match here.first_mut() {
                    None => columns_mut(output_tangent.as_mut_slice(), width, &kept.chunk),
                    Some(here) => &mut here[..width * kept.chunk.len()],
                };
                product(
                    weights_tangent,
                    kept.input(layer),
                    0.0,
                    matrix_mut(here, width),
                );
                if let Some(below) = below.last() {
                    product(
                        weights,
                        first(below, fan_in, kept.chunk.len()),
                        1.0,
                        matrix_mut(here, width),
                    );
                }
                if is_output {
                    add_to_columns(here, biases_tangent);
                } else {
                    tanh_tangent(here, biases_tangent, kept.flat_input(layer + 1));
                }
            }
        }
    }
}

/// Adds the gradient of the chunk `kept` to `beta` times `gradient`, from the derivatives by each
/// layer's sums: `hidden` (`[width x CHUNK]`) and `cotangent` (`[out x chunk]`). A sum over a
/// chunk's samples is complete before it is added (a test checks the bits). `room` is for the
/// output's weights. The old content of `gradient` is ignored if `beta` is zero.
pub(super) fn add_gradient(
    kept: &Kept<'_>,
    hidden: &[Vec<f32>],
    cotangent: DMatrixView<'_, f32>,
    room: &mut [f32],
    mut gradient: &mut [f32],
    beta: f32,
) {
    for (layer, shape) in kept.widths.windows(2).enumerate() {
        let (fan_in, width) = (shape[0], shape[1]);
        let block;
        (block, gradient) = gradient.split_at_mut(block_len(shape));
        match hidden.get(layer) {
            // The biases, which lie behind the weights, are weights of an input of 1.
            Some(derivative) => {
                let derivative = first(derivative, width, kept.chunk.len());
                product_nt_and_sum(
                    derivative,
                    kept.input(layer),
                    beta,
                    matrix_mut(block, width),
                );
            }
            // As the transposed product, since a product whose result has few rows is slow.
            None => {
                let (by_weights, by_biases) = block.split_at_mut(fan_in * width);
                product_nt(kept.input(layer), cotangent, 0.0, matrix_mut(room, fan_in));
                for (row, by_weight) in by_weights.chunks_exact_mut(width).enumerate() {
                    let sums = by_weight.iter_mut().zip(room[row..].iter().step_by(fan_in));
                    if beta == 0.0 {
                        sums.for_each(|(sum, x)| *sum = *x);
                    } else {
                        sums.for_each(|(sum, x)| *sum = x + beta * *sum);
                    }
                }
                let ones = matrix(&ONES[..kept.chunk.len()], kept.chunk.len());
                product(cotangent, ones, beta, matrix_mut(by_biases, width));
            }
        }
    }
}

/// Parameters of one layer of this shape (fan-in, width).
fn block_len(shape: &[usize]) -> usize {
    (shape[0] + 1) * shape[1]
}

/// Adds `bias` to each column.
pub(super) fn add_to_columns(values: &mut [f32], bias: &[f32]) {
    for column in values.chunks_exact_mut(bias.len()) {
        column.iter_mut().zip(bias).for_each(|(x, b)| *x += b);
    }
}

#[cfg(test)]
pub(super) mod tests;
