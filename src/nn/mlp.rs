//! A multilayer perceptron with tanh hidden layers and a linear output, with parameters in one flat vector.

use nalgebra::{DMatrix, DMatrixView};
use serde::{Deserialize, Serialize};

use crate::rng::Rng;

/// A network's shape and parameters: for each layer the weights (column-major `[out x in]`), then the biases (`[out]`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mlp {
    widths: Vec<usize>,
    parameters: Vec<f32>,
}

/// What a forward pass leaves for the derivatives: every layer's activations, and room to work in. Reused between passes,
/// it allocates only when a batch is larger than any before.
#[derive(Debug, Clone, Default)]
pub struct Pass {}

impl Pass {
    /// The output of the last forward pass `[out x n]`.
    pub fn output(&self) -> DMatrixView<'_, f32> {
        todo!()
    }
}

impl Mlp {
    /// A network with layers of `widths` (input, hidden ..., output); weights uniform in +-1/sqrt(fan-in), those of the
    /// output layer times `output_scale`; hidden biases likewise uniform, output biases zero.
    pub fn new(widths: &[usize], output_scale: f32, rng: &mut Rng) -> Self {
        let _ = (widths, output_scale, rng);
        todo!()
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
        std::iter::empty() // TODO
    }

    /// Runs `inputs` (`[in x n]`) through the network; the outputs are in [`Pass::output`].
    pub fn forward(&self, inputs: &DMatrix<f32>, pass: &mut Pass) {
        let _ = (inputs, pass);
        todo!()
    }

    /// Writes the gradient (`[parameters]`) of the sum over samples of `cotangent . output` (`cotangent` is `[out x n]`).
    /// `pass` is that of the last [`forward`](Mlp::forward) on the same `inputs` and parameters.
    pub fn vjp(&self, inputs: &DMatrix<f32>, pass: &mut Pass, cotangent: &DMatrix<f32>, gradient: &mut [f32]) {
        let _ = (inputs, pass, cotangent, gradient);
        todo!()
    }

    /// Writes the directional derivative of the outputs (`[out x n]`) along `tangent` (`[parameters]`).
    /// `pass` is that of the last [`forward`](Mlp::forward) on the same `inputs` and parameters.
    pub fn jvp(&self, inputs: &DMatrix<f32>, pass: &mut Pass, tangent: &[f32], output_tangent: &mut DMatrix<f32>) {
        let _ = (inputs, pass, tangent, output_tangent);
        todo!()
    }
}
