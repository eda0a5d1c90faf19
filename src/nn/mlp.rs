//! A multilayer perceptron with tanh hidden layers and a linear output, with parameters in one flat vector.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use crate::{
    arithmetic::{
        product::{product, product_nt, product_tn},
        tanh_biased,
    },
    rng::Rng,
};

/// Samples that pass together. Sums over samples run chunk by chunk in this order, each from zero, so that threads could
/// share the chunks and give the same bits. Large enough for the products' full rate, small enough for the cache.
pub(super) const CHUNK: usize = 1024;

/// A network's shape and parameters: for each layer the weights (column-major `[out x in]`), then the biases (`[out]`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mlp {
    widths: Vec<usize>,
    parameters: Vec<f32>,
}

/// What a forward pass leaves for the derivatives: every layer's activations, and room to work in. Reused between passes,
/// it allocates only when a batch is larger than any before.
#[derive(Debug, Clone, Default)]
pub struct Pass {
    /// Samples of the last forward pass.
    samples: usize,
    /// Each layer's activations `[out x samples]`, and room beyond them for larger batches.
    activations: Vec<Vec<f32>>,
    /// Height of the output.
    output_dim: usize,
    /// Two hidden layers' derivatives on one chunk.
    scratch: [Vec<f32>; 2],
    /// One chunk's share of the gradient.
    partial: Vec<f32>,
}

impl Pass {
    /// The output of the last forward pass `[out x n]`.
    pub fn output(&self) -> DMatrixView<'_, f32> {
        let output = self.activations.last().map_or(&[][..], |output| &output[..self.output_dim * self.samples]);
        DMatrixView::from_slice(output, self.output_dim, self.samples)
    }

    /// Makes room for `samples` in layers of `widths`.
    fn prepare(&mut self, widths: &[usize], samples: usize) {
        let (outputs, widest) = (&widths[1..], widths[1..].iter().copied().max().unwrap_or(0));
        self.samples = samples;
        self.output_dim = outputs[outputs.len() - 1];
        self.activations.resize_with(outputs.len(), Vec::new);
        for (activation, width) in self.activations.iter_mut().zip(outputs) {
            grow(activation, width * samples);
        }
        for scratch in &mut self.scratch {
            grow(scratch, widest * samples.min(CHUNK));
        }
    }

    /// Asserts that the last forward pass was on as many samples, through a network of these `widths`.
    fn check(&self, widths: &[usize], inputs: &DMatrix<f32>) {
        assert_eq!(inputs.shape(), (widths[0], self.samples), "the inputs are those of the last forward pass");
        assert_eq!(self.activations.len(), widths.len() - 1, "the pass is this network's");
    }
}

impl Mlp {
    /// A network with layers of `widths` (input, hidden ..., output); weights uniform in +-1/sqrt(fan-in), those of the
    /// output layer times `output_scale`; hidden biases likewise uniform, output biases zero.
    pub fn new(widths: &[usize], output_scale: f32, rng: &mut Rng) -> Self {
        assert!(widths.len() >= 2 && !widths.contains(&0), "a network needs an input and an output: {widths:?}");
        let mut parameters = Vec::with_capacity(widths.windows(2).map(block_len).sum());
        for (layer, shape) in widths.windows(2).enumerate() {
            let is_output = layer + 2 == widths.len();
            let bound = 1.0 / (shape[0] as f32).sqrt();
            let scale = if is_output { output_scale } else { 1.0 };
            parameters.extend((0..shape[0] * shape[1]).map(|_| scale * rng.random_range(-bound..=bound)));
            if is_output {
                parameters.extend((0..shape[1]).map(|_| 0.0));
            } else {
                parameters.extend((0..shape[1]).map(|_| rng.random_range(-bound..=bound)));
            }
        }
        Self { widths: widths.to_vec(), parameters }
    }

    /// Input, hidden and output widths.
    pub fn widths(&self) -> &[usize] {
        &self.widths
    }

    /// All parameters, flat.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// All parameters, flat, to be changed.
    pub fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// Each layer's weights `[out x in]` and biases `[out]`, from the input on.
    pub fn layers(&self) -> impl Iterator<Item = (DMatrixView<'_, f32>, &[f32])> {
        self.layers_of(&self.parameters)
    }

    /// The same of any vector that is laid out like the parameters.
    fn layers_of<'a>(&'a self, mut flat: &'a [f32]) -> impl Iterator<Item = (DMatrixView<'a, f32>, &'a [f32])> {
        self.widths.windows(2).map(move |shape| {
            let (block, rest) = flat.split_at(block_len(shape));
            flat = rest;
            let (weights, biases) = block.split_at(shape[0] * shape[1]);
            (DMatrixView::from_slice(weights, shape[1], shape[0]), biases)
        })
    }

    /// Runs `inputs` (`[in x n]`) through the network; the outputs are in [`Pass::output`].
    pub fn forward(&self, inputs: &DMatrix<f32>, pass: &mut Pass) {
        assert_eq!(inputs.nrows(), self.widths[0], "height of the network's inputs");
        pass.prepare(&self.widths, inputs.ncols());
        for chunk in chunks(inputs.ncols()) {
            for (layer, (weights, biases)) in self.layers().enumerate() {
                let (width, fan_in) = weights.shape();
                let (below, here) = pass.activations.split_at_mut(layer);
                let is_output = here.len() == 1;
                let input = columns(below.last().map_or(inputs.as_slice(), Vec::as_slice), fan_in, &chunk);
                let output = columns_mut(&mut here[0], width, &chunk);
                product(weights, matrix(input, fan_in), 0.0, matrix_mut(output, width));
                if is_output {
                    add_to_columns(output, biases);
                } else {
                    tanh_biased(output, biases);
                }
            }
        }
    }

    /// Writes the gradient (`[parameters]`) of the sum over samples of `cotangent . output` (`cotangent` is `[out x n]`).
    /// `pass` is that of the last [`forward`](Mlp::forward) on the same `inputs` and parameters.
    pub fn vjp(&self, inputs: &DMatrix<f32>, pass: &mut Pass, cotangent: &DMatrix<f32>, gradient: &mut [f32]) {
        pass.check(&self.widths, inputs);
        assert_eq!(cotangent.shape(), (pass.output_dim, pass.samples), "shape of the cotangent");
        assert_eq!(gradient.len(), self.parameters.len(), "length of the gradient");
        if pass.samples == 0 {
            gradient.fill(0.0);
        }
        for chunk in chunks(pass.samples) {
            if chunk.start == 0 {
                self.vjp_chunk(inputs, pass, cotangent, &chunk, gradient);
            } else {
                let mut partial = std::mem::take(&mut pass.partial);
                partial.resize(gradient.len(), 0.0);
                self.vjp_chunk(inputs, pass, cotangent, &chunk, &mut partial);
                gradient.iter_mut().zip(&partial).for_each(|(sum, term)| *sum += term);
                pass.partial = partial;
            }
        }
    }

    /// The gradient of one chunk's sum.
    fn vjp_chunk(
        &self,
        inputs: &DMatrix<f32>,
        pass: &mut Pass,
        cotangent: &DMatrix<f32>,
        chunk: &Range<usize>,
        mut gradient: &mut [f32],
    ) {
        let at_zero = 0..chunk.len();
        let mut parameters = &self.parameters[..];
        for (layer, shape) in self.widths.windows(2).enumerate().rev() {
            let (fan_in, width) = (shape[0], shape[1]);
            let (weights, block);
            let start_of_block = parameters.len() - block_len(shape);
            (parameters, weights) = parameters.split_at(start_of_block);
            (gradient, block) = gradient.split_at_mut(start_of_block);

            // The derivative by this layer's sums; that of a hidden layer, the layer above left in the first scratch.
            let [here, below] = &mut pass.scratch;
            let derivative = match layer + 2 == self.widths.len() {
                true => columns(cotangent.as_slice(), width, chunk),
                false => columns(here, width, &at_zero),
            };
            let input = match layer {
                0 => columns(inputs.as_slice(), fan_in, chunk),
                _ => columns(&pass.activations[layer - 1], fan_in, chunk),
            };
            let (by_weights, by_biases) = block.split_at_mut(fan_in * width);
            product_nt(matrix(derivative, width), matrix(input, fan_in), 0.0, matrix_mut(by_weights, width));
            by_biases.fill(0.0);
            for column in derivative.chunks_exact(width) {
                by_biases.iter_mut().zip(column).for_each(|(sum, term)| *sum += term);
            }
            if layer > 0 {
                let weights = matrix(&weights[..fan_in * width], width);
                let below = columns_mut(below, fan_in, &at_zero);
                product_tn(weights, matrix(derivative, width), 0.0, matrix_mut(below, fan_in));
                multiply_by_tanh_derivative(below, input);
            }
            pass.scratch.swap(0, 1);
        }
    }

    /// Writes the directional derivative of the outputs (`[out x n]`) along `tangent` (`[parameters]`).
    /// `pass` is that of the last [`forward`](Mlp::forward) on the same `inputs` and parameters.
    pub fn jvp(&self, inputs: &DMatrix<f32>, pass: &mut Pass, tangent: &[f32], output_tangent: &mut DMatrix<f32>) {
        pass.check(&self.widths, inputs);
        assert_eq!(tangent.len(), self.parameters.len(), "length of the tangent");
        assert_eq!(output_tangent.shape(), (pass.output_dim, pass.samples), "shape of the output's tangent");
        for chunk in chunks(pass.samples) {
            let at_zero = 0..chunk.len();
            let layers = self.layers().zip(self.layers_of(tangent));
            for (layer, ((weights, _), (weights_tangent, biases_tangent))) in layers.enumerate() {
                let (width, fan_in) = weights.shape();
                let is_output = layer + 2 == self.widths.len();
                let [below, here] = &mut pass.scratch;
                let here = match is_output {
                    true => columns_mut(output_tangent.as_mut_slice(), width, &chunk),
                    false => columns_mut(here, width, &at_zero),
                };
                if layer == 0 {
                    let input = columns(inputs.as_slice(), fan_in, &chunk);
                    product(weights_tangent, matrix(input, fan_in), 0.0, matrix_mut(here, width));
                } else {
                    let input = columns(&pass.activations[layer - 1], fan_in, &chunk);
                    product(weights_tangent, matrix(input, fan_in), 0.0, matrix_mut(here, width));
                    let input_tangent = columns(below, fan_in, &at_zero);
                    product(weights, matrix(input_tangent, fan_in), 1.0, matrix_mut(here, width));
                }
                add_to_columns(here, biases_tangent);
                if !is_output {
                    multiply_by_tanh_derivative(here, columns(&pass.activations[layer], width, &chunk));
                }
                pass.scratch.swap(0, 1);
            }
        }
    }
}

/// Parameters of one layer of this shape (fan-in, width).
fn block_len(shape: &[usize]) -> usize {
    (shape[0] + 1) * shape[1]
}

/// Where `samples` are cut.
fn chunks(samples: usize) -> impl Iterator<Item = Range<usize>> {
    (0..samples).step_by(CHUNK).map(move |start| start..samples.min(start + CHUNK))
}

/// Makes `room` at least `len` long.
fn grow(room: &mut Vec<f32>, len: usize) {
    if room.len() < len {
        room.resize(len, 0.0);
    }
}

/// Columns `range` of a matrix of `height`, flat.
fn columns<'a>(values: &'a [f32], height: usize, range: &Range<usize>) -> &'a [f32] {
    &values[height * range.start..height * range.end]
}

/// The same, to be written.
fn columns_mut<'a>(values: &'a mut [f32], height: usize, range: &Range<usize>) -> &'a mut [f32] {
    &mut values[height * range.start..height * range.end]
}

/// `values` as a matrix of `height`.
fn matrix(values: &[f32], height: usize) -> DMatrixView<'_, f32> {
    DMatrixView::from_slice(values, height, values.len() / height)
}

/// The same, to be written.
fn matrix_mut(values: &mut [f32], height: usize) -> DMatrixViewMut<'_, f32> {
    let len = values.len() / height;
    DMatrixViewMut::from_slice(values, height, len)
}

/// Adds `bias` to each column.
fn add_to_columns(values: &mut [f32], bias: &[f32]) {
    for column in values.chunks_exact_mut(bias.len()) {
        column.iter_mut().zip(bias).for_each(|(x, b)| *x += b);
    }
}

/// Multiplies by `tanh' = 1 - tanh^2`, where `activations` are tanh's values.
fn multiply_by_tanh_derivative(values: &mut [f32], activations: &[f32]) {
    values.iter_mut().zip(activations).for_each(|(x, h)| *x *= 1.0 - h * h);
}
