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
        product_of_columns, tanh_biased, tanh_cotangent, tanh_tangent, threads,
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
            weights.transpose_to(&mut matrix_mut(transposed, weights.ncols()));
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
             gradient| {
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
                add_gradient(&kept, hidden, cotangent, output_weights, gradient);
            },
        );
    }

    /// Computes all of [`Pass::transposed`].
    pub(super) fn transpose(&self, pass: &mut Pass) {
        if !pass.is_transposed {
            for ((weights, _), transposed) in self.layers().zip(&mut pass.transposed) {
                weights.transpose_to(&mut matrix_mut(transposed, weights.ncols()));
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

/// Adds the gradient of the chunk `kept`, from the derivatives by each layer's sums: `hidden`
/// (`[width x CHUNK]`) and `cotangent` (`[out x chunk]`). A sum over a chunk's samples is complete
/// before it is added (a test checks the bits). `room` is for the output's weights.
pub(super) fn add_gradient(
    kept: &Kept<'_>,
    hidden: &[Vec<f32>],
    cotangent: DMatrixView<'_, f32>,
    room: &mut [f32],
    mut gradient: &mut [f32],
) {
    for (layer, shape) in kept.widths.windows(2).enumerate() {
        let (fan_in, width) = (shape[0], shape[1]);
        let block;
        (block, gradient) = gradient.split_at_mut(block_len(shape));
        match hidden.get(layer) {
            // The biases, which lie behind the weights, are weights of an input of 1.
            Some(derivative) => {
                let derivative = first(derivative, width, kept.chunk.len());
                product_nt_and_sum(derivative, kept.input(layer), 1.0, matrix_mut(block, width));
            }
            // As the transposed product, since a product whose result has few rows is slow.
            None => {
                let (by_weights, by_biases) = block.split_at_mut(fan_in * width);
                product_nt(kept.input(layer), cotangent, 0.0, matrix_mut(room, fan_in));
                for (row, by_weight) in by_weights.chunks_exact_mut(width).enumerate() {
                    by_weight
                        .iter_mut()
                        .zip(room[row..].iter().step_by(fan_in))
                        .for_each(|(sum, x)| *sum += x);
                }
                let ones = matrix(&ONES[..kept.chunk.len()], kept.chunk.len());
                product(cotangent, ones, 1.0, matrix_mut(by_biases, width));
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
pub(super) mod tests {
    use super::*;
    use crate::rng::{Seed, Stream};

    /// A small network and inputs of order one, `n` of them.
    pub(in crate::nn) fn small(n: usize) -> (Mlp, DMatrix<f32>) {
        let mut rng = Seed(3).stream(Stream::Network, 0);
        let mut network = Mlp::new(&[3, 7, 5, 2], 1.0, &mut rng);
        network
            .parameters
            .iter_mut()
            .for_each(|p| *p += rng.random_range(-0.3..0.3));
        (
            network,
            DMatrix::from_fn(3, n, |_, _| rng.random_range(-1.5..1.5)),
        )
    }

    /// Numbers in -1..1.
    pub(in crate::nn) fn numbers(len: usize, index: u32) -> Vec<f32> {
        let mut rng = Seed(4).stream(Stream::Update, index);
        (0..len).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    pub(in crate::nn) fn widened(values: &[f32]) -> Vec<f64> {
        values.iter().map(|&x| f64::from(x)).collect()
    }

    /// `a + scale b`.
    pub(in crate::nn) fn moved(a: &[f64], scale: f64, b: &[f32]) -> Vec<f64> {
        a.iter()
            .zip(b)
            .map(|(a, &b)| a + scale * f64::from(b))
            .collect()
    }

    /// The output for one input by plain loops in f64: what the fast passes must agree with, and
    /// smooth enough for finite differences: with steps of 1e-5 central differences err by 1e-10,
    /// from the third derivative and from rounding.
    pub(in crate::nn) fn plain_output(
        widths: &[usize],
        parameters: &[f64],
        input: &[f32],
    ) -> Vec<f64> {
        let (mut activation, mut rest) = (widened(input), parameters);
        for (layer, shape) in widths.windows(2).enumerate() {
            let (weights, tail) = rest.split_at(shape[0] * shape[1]);
            let (biases, tail) = tail.split_at(shape[1]);
            rest = tail;
            activation = (0..shape[1])
                .map(|i| {
                    let sum: f64 = (0..shape[0])
                        .map(|j| weights[j * shape[1] + i] * activation[j])
                        .sum();
                    let sum = sum + biases[i];
                    if layer + 2 == widths.len() {
                        sum
                    } else {
                        sum.tanh()
                    }
                })
                .collect();
        }
        activation
    }

    /// f32 rounding through three layers of a few terms each.
    pub(in crate::nn) const ROUNDING: f64 = 5e-6;

    #[test]
    #[should_panic(expected = "height of the network's inputs")]
    fn refuses_inputs_of_another_height() {
        small(1)
            .0
            .forward(&DMatrix::zeros(4, 1), &mut Pass::default());
    }

    #[test]
    #[should_panic(expected = "inputs are those of the last forward pass")]
    fn refuses_derivatives_without_a_forward_pass() {
        let (network, inputs) = small(2);
        let mut gradient = vec![0.0; network.parameters.len()];
        network.vjp(
            &inputs,
            &mut Pass::default(),
            &DMatrix::zeros(2, 2),
            &mut gradient,
        );
    }

    #[test]
    fn initial_parameters_are_bounded_by_the_fan_in() {
        let network = Mlp::new(
            &[4, 100, 9, 25],
            0.01,
            &mut Seed(1).stream(Stream::Network, 0),
        );
        assert_eq!(network.parameters.len(), 5 * 100 + 101 * 9 + 10 * 25);
        let bounds = [0.5, 0.1, 0.01 / 3.0];
        for ((layer, (weights, biases)), bound) in network.layers().enumerate().zip(bounds) {
            let largest = weights.amax();
            assert!(
                largest <= bound && largest > 0.95 * bound,
                "layer {layer}: {largest}"
            );
            assert!(weights.mean().abs() < 0.15 * bound);
            assert_eq!(biases.iter().all(|&b| b == 0.0), layer == 2);
            assert!(biases.iter().all(|b| b.abs() <= bound));
        }
        assert_eq!(
            network,
            Mlp::new(
                &[4, 100, 9, 25],
                0.01,
                &mut Seed(1).stream(Stream::Network, 0)
            )
        );
    }

    #[test]
    fn forward_agrees_with_plain_loops() {
        let (network, inputs) = small(20);
        let mut pass = Pass::default();
        network.forward(&inputs, &mut pass);
        for (input, output) in inputs.column_iter().zip(pass.output().column_iter()) {
            let plain = plain_output(
                &network.widths,
                &widened(&network.parameters),
                input.as_slice(),
            );
            assert!(
                output
                    .iter()
                    .zip(&plain)
                    .all(|(&y, p)| (f64::from(y) - p).abs() < ROUNDING)
            );
        }
    }

    #[test]
    fn a_sample_has_the_same_bits_alone_and_in_any_batch() {
        let mut rng = Seed(5).stream(Stream::Network, 0);
        let network = Mlp::new(&[17, 300, 40, 6], 1.0, &mut rng);
        let inputs = DMatrix::from_fn(17, CHUNK + 70, |_, _| rng.random_range(-3.0..3.0));
        let (mut together, mut some) = (Pass::default(), Pass::default());
        network.forward(&inputs, &mut together);
        for (start, n) in [
            (0, 1),
            (1, 2),
            (9, 5),
            (40, 8),
            (CHUNK - 3, 64),
            (CHUNK + 69, 1),
        ] {
            network.forward(&inputs.columns(start, n).into_owned(), &mut some);
            assert_eq!(some.output(), together.output().columns(start, n));
        }
    }

    #[test]
    fn a_pass_allocates_only_for_larger_batches() {
        let (network, inputs) = small(50);
        let mut pass = Pass::default();
        network.forward(&inputs, &mut pass);
        let places = |pass: &Pass| {
            pass.activations
                .iter()
                .map(|a| a.as_ptr())
                .collect::<Vec<_>>()
        };
        let before = places(&pass);
        network.forward(&inputs.columns(0, 3).into_owned(), &mut pass);
        assert_eq!(pass.output().shape(), (2, 3));
        assert_eq!(places(&pass), before);
        network.forward(&DMatrix::zeros(3, 0), &mut pass);
        assert_eq!(pass.output().shape(), (2, 0));
        let mut gradient = vec![f32::NAN; network.parameters.len()];
        network.vjp(
            &DMatrix::zeros(3, 0),
            &mut pass,
            &DMatrix::zeros(2, 0),
            &mut gradient,
        );
        assert!(gradient.iter().all(|&g| g == 0.0));
    }

    #[test]
    fn vjp_agrees_with_finite_differences() {
        let (network, inputs) = small(6);
        let cotangent = DMatrix::from_vec(2, 6, numbers(12, 0));
        let (mut pass, mut gradient) = (Pass::default(), vec![f32::NAN; network.parameters.len()]);
        network.forward(&inputs, &mut pass);
        network.vjp(&inputs, &mut pass, &cotangent, &mut gradient);
        let value = |parameters: &[f64]| -> f64 {
            let columns = inputs.column_iter().zip(cotangent.column_iter());
            let terms = columns.map(|(input, cotangent)| {
                let output = plain_output(&network.widths, parameters, input.as_slice());
                output
                    .iter()
                    .zip(cotangent.iter())
                    .map(|(y, &c)| y * f64::from(c))
                    .sum::<f64>()
            });
            terms.sum()
        };
        let mut parameters = widened(&network.parameters);
        for (i, &g) in gradient.iter().enumerate() {
            let (here, step) = (parameters[i], 1e-5);
            parameters[i] = here + step;
            let above = value(&parameters);
            parameters[i] = here - step;
            let below = value(&parameters);
            parameters[i] = here;
            let slope = (above - below) / (2.0 * step);
            assert!(
                (f64::from(g) - slope).abs() < ROUNDING,
                "parameter {i}: {g}, {slope}"
            );
        }
    }

    #[test]
    fn jvp_agrees_with_finite_differences() {
        let (network, inputs) = small(6);
        let tangent = numbers(network.parameters.len(), 1);
        let (mut pass, mut output_tangent) = (Pass::default(), DMatrix::zeros(2, 6));
        network.forward(&inputs, &mut pass);
        network.jvp(&inputs, &mut pass, &tangent, &mut output_tangent);
        let (parameters, step) = (widened(&network.parameters), 1e-5);
        for (input, tangents) in inputs.column_iter().zip(output_tangent.column_iter()) {
            let at = |step| {
                plain_output(
                    &network.widths,
                    &moved(&parameters, step, &tangent),
                    input.as_slice(),
                )
            };
            for ((above, below), &t) in at(step).iter().zip(at(-step)).zip(tangents.iter()) {
                let slope = (above - below) / (2.0 * step);
                assert!((f64::from(t) - slope).abs() < ROUNDING, "{t}, {slope}");
            }
        }
    }

    #[test]
    fn jvp_and_vjp_are_adjoint_beyond_one_chunk() {
        let n = 2 * CHUNK + 77;
        let (network, inputs) = small(n);
        let cotangent = DMatrix::from_vec(2, n, numbers(2 * n, 2));
        let tangent = numbers(network.parameters.len(), 3);
        let mut pass = Pass::default();
        let (mut gradient, mut output_tangent) =
            (vec![f32::NAN; tangent.len()], DMatrix::zeros(2, n));
        network.forward(&inputs, &mut pass);
        network.jvp(&inputs, &mut pass, &tangent, &mut output_tangent);
        network.vjp(&inputs, &mut pass, &cotangent, &mut gradient);
        let forward = crate::solver::dot(output_tangent.as_slice(), cotangent.as_slice());
        let backward = crate::solver::dot(&tangent, &gradient);
        // 4,000 terms of order one, each with f32 rounding.
        assert!(
            (forward - backward).abs() < 1e-5 * n as f64,
            "{forward}, {backward}"
        );
        assert!(
            forward.abs() > 1.0,
            "a product of zero would prove nothing: {forward}"
        );
    }

    #[test]
    fn a_gradient_is_the_sum_of_its_chunks_to_the_bit() {
        let n = 2 * CHUNK + 77;
        let (network, inputs) = small(n);
        let cotangent = DMatrix::from_vec(2, n, numbers(2 * n, 2));
        let gradient = |start, len| {
            let (inputs, cotangent) = (
                inputs.columns(start, len).into_owned(),
                cotangent.columns(start, len).into(),
            );
            let (mut pass, mut gradient) =
                (Pass::default(), vec![f32::NAN; network.parameters.len()]);
            network.forward(&inputs, &mut pass);
            network.vjp(&inputs, &mut pass, &cotangent, &mut gradient);
            gradient
        };
        let mut sum = gradient(0, CHUNK);
        for (start, len) in [(CHUNK, CHUNK), (2 * CHUNK, 77)] {
            sum.iter_mut()
                .zip(gradient(start, len))
                .for_each(|(sum, term)| *sum += term);
        }
        assert_eq!(sum, gradient(0, n));
    }
}
