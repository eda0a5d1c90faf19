//! What a network keeps between its passes, and how a batch is cut.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};

/// Samples that pass together. Sums over samples run chunk by chunk in this order, each from zero, so that threads could
/// share the chunks and give the same bits. Large enough for the products' full rate, small enough for the cache.
pub(super) const CHUNK: usize = 256;

/// What a forward pass leaves for the derivatives: every layer's activations, and room to work in. Reused between passes,
/// it allocates only when a batch is larger than any before.
#[derive(Debug, Clone, Default)]
pub struct Pass {
    /// Samples of the last forward pass.
    pub(super) samples: usize,
    /// Height of the output.
    pub(super) output_dim: usize,
    /// Each layer's activations `[out x samples]`, and room beyond them for larger batches.
    pub(super) activations: Vec<Vec<f32>>,
    /// Each layer's weights, transposed `[in x out]`: the way back reads them so. Made when first needed.
    pub(super) transposed: Vec<Vec<f32>>,
    /// Whether [`transposed`](Self::transposed) is that of the last forward pass's parameters.
    pub(super) is_transposed: bool,
    /// Derivatives of two neighbouring hidden layers on one chunk.
    pub(super) scratch: [Vec<f32>; 2],
}

impl Pass {
    /// The output of the last forward pass `[out x n]`.
    pub fn output(&self) -> DMatrixView<'_, f32> {
        let output = self.activations.last().map_or(&[][..], |output| &output[..self.output_dim * self.samples]);
        DMatrixView::from_slice(output, self.output_dim, self.samples)
    }

    /// Makes room for `samples` in a network of `widths`.
    pub(super) fn prepare(&mut self, widths: &[usize], samples: usize) {
        let outputs = &widths[1..];
        let widest = outputs.iter().copied().max().unwrap_or(0);
        self.samples = samples;
        self.output_dim = outputs[outputs.len() - 1];
        self.is_transposed = false;
        self.transposed.resize_with(outputs.len(), Vec::new);
        self.activations.resize_with(outputs.len(), Vec::new);
        for (activation, width) in self.activations.iter_mut().zip(outputs) {
            grow(activation, width * samples);
        }
        for scratch in &mut self.scratch {
            grow(scratch, widest * samples.min(CHUNK));
        }
    }

    /// Asserts that the last forward pass was on as many samples, through a network of as many layers.
    pub(super) fn check(&self, widths: &[usize], inputs: &DMatrix<f32>) {
        assert_eq!(inputs.shape(), (widths[0], self.samples), "the inputs are those of the last forward pass");
        assert_eq!(self.activations.len(), widths.len() - 1, "the last forward pass was this network's");
    }
}

/// Where `samples` are cut.
pub(super) fn chunks(samples: usize) -> impl Iterator<Item = Range<usize>> {
    (0..samples).step_by(CHUNK).map(move |start| start..samples.min(start + CHUNK))
}

/// Columns `range` of a matrix of `height`, flat.
pub(super) fn columns<'a>(values: &'a [f32], height: usize, range: &Range<usize>) -> &'a [f32] {
    &values[height * range.start..height * range.end]
}

/// The same, to be written.
pub(super) fn columns_mut<'a>(values: &'a mut [f32], height: usize, range: &Range<usize>) -> &'a mut [f32] {
    &mut values[height * range.start..height * range.end]
}

/// `values` as a matrix of `height`.
pub(super) fn matrix(values: &[f32], height: usize) -> DMatrixView<'_, f32> {
    DMatrixView::from_slice(values, height, values.len() / height)
}

/// The same, to be written.
pub(super) fn matrix_mut(values: &mut [f32], height: usize) -> DMatrixViewMut<'_, f32> {
    let len = values.len() / height;
    DMatrixViewMut::from_slice(values, height, len)
}

/// Makes `room` at least `len` long.
fn grow(room: &mut Vec<f32>, len: usize) {
    if room.len() < len {
        room.resize(len, 0.0);
    }
}
