//! The activations that a network keeps between its passes, and how a batch is cut into chunks.

use std::{mem, ops::Range};

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};

use crate::arithmetic::threads::{self, InOrder};

/// Samples that pass together. Sums over samples run chunk by chunk in this order, each from zero,
/// so that threads share the chunks and give the same bits. Large enough for the products' full
/// rate, small enough for the cache.
pub(super) const CHUNK: usize = 128;

/// Every layer's activations in a forward pass, kept for the derivatives, and room to work in.
/// Reused between passes, it allocates only when a batch is larger than any before.
#[derive(Debug, Clone, Default)]
pub struct Pass {
    /// The number of samples in the last forward pass.
    pub(super) samples: usize,
    /// The number of outputs.
    pub(super) output_dim: usize,
    /// Each layer's activations `[out x samples]`, and room beyond them for larger batches.
    pub(super) activations: Vec<Vec<f32>>,
    /// Each layer's weights, transposed `[in x out]`: the way back reads them so, and the output
    /// layer forward too. Those of the layers between are made when first needed.
    pub(super) transposed: Vec<Vec<f32>>,
    /// Whether [`transposed`](Self::transposed) is complete for the last forward pass's parameters.
    pub(super) is_transposed: bool,
    /// For each hidden layer but the last, the derivative of the outputs by its sums `[width x
    /// (output_dim x samples)]`, sample by sample. Made when first needed.
    pub(super) sensitivities: Vec<Vec<f32>>,
    /// Whether [`sensitivities`](Self::sensitivities) are those of the last forward pass.
    pub(super) is_sensitive: bool,
    /// Room for one chunk, for each thread that shares them.
    pub(super) rooms: Vec<Scratch>,
}

/// Room to work on one chunk.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    /// A derivative of each hidden layer `[width x CHUNK]`.
    pub(super) hidden: Vec<Vec<f32>>,
    /// A derivative of the outputs `[out x CHUNK]`.
    pub(super) output: Vec<f32>,
    /// Weights of the output layer, transposed `[in x out]`: of a direction or of a gradient.
    pub(super) output_weights: Vec<f32>,
    /// Derivatives of the outputs by the last hidden layer's sums, for a few samples.
    pub(super) sensitivity: Vec<f32>,
    /// A chunk's share of a sum over samples, where threads share it `[parameters]`.
    share: Vec<f32>,
}

impl Pass {
    /// The output of the last forward pass `[out x n]`.
    pub fn output(&self) -> DMatrixView<'_, f32> {
        let output = self
            .activations
            .last()
            .map_or(&[][..], |output| &output[..self.output_dim * self.samples]);
        DMatrixView::from_slice(output, self.output_dim, self.samples)
    }

    /// Makes room for `samples` in a network of `widths`.
    pub(super) fn prepare(&mut self, widths: &[usize], samples: usize) {
        let [_, hidden @ .., output] = widths else {
            unreachable!("a network has an input and an output")
        };
        self.samples = samples;
        self.output_dim = *output;
        (self.is_transposed, self.is_sensitive) = (false, false);
        self.transposed.resize_with(widths.len() - 1, Vec::new);
        self.activations.resize_with(widths.len() - 1, Vec::new);
        for (activation, width) in self.activations.iter_mut().zip(&widths[1..]) {
            grow(activation, width * samples);
        }
        for (transposed, shape) in self.transposed.iter_mut().zip(widths.windows(2)) {
            transposed.resize(shape[0] * shape[1], 0.0);
        }
        let threads = threads::count().min(samples.div_ceil(CHUNK)).max(1);
        self.rooms.resize_with(threads, Scratch::default);
        for Scratch {
            hidden: rooms,
            output: room,
            output_weights,
            ..
        } in &mut self.rooms
        {
            rooms.resize_with(hidden.len(), Vec::new);
            for (room, width) in rooms.iter_mut().zip(hidden) {
                grow(room, width * samples.min(CHUNK));
            }
            grow(room, output * samples.min(CHUNK));
            output_weights.resize(output * widths[widths.len() - 2], 0.0);
        }
    }

    /// Asserts that the last forward pass was on as many samples, through a network of as many
    /// layers.
    pub(super) fn check(&self, widths: &[usize], inputs: &DMatrix<f32>) {
        assert_eq!(
            inputs.shape(),
            (widths[0], self.samples),
            "the inputs are those of the last forward pass"
        );
        assert_eq!(
            self.activations.len(),
            widths.len() - 1,
            "the last forward pass was this network's"
        );
    }
}

/// The activations of one chunk.
pub(super) struct Kept<'a> {
    /// The network's widths.
    pub(super) widths: &'a [usize],
    /// The inputs of all samples `[in x n]`.
    pub(super) inputs: &'a [f32],
    /// Each layer's activations of all samples `[out x n]`.
    pub(super) activations: &'a [Vec<f32>],
    /// The chunk's samples.
    pub(super) chunk: Range<usize>,
}

impl<'a> Kept<'a> {
    /// The input of `layer`: the output of the layer below it `[in x chunk]`.
    pub(super) fn input(&self, layer: usize) -> DMatrixView<'a, f32> {
        matrix(self.flat_input(layer), self.widths[layer])
    }

    /// The input of `layer` as a slice.
    pub(super) fn flat_input(&self, layer: usize) -> &'a [f32] {
        let values = layer
            .checked_sub(1)
            .map_or(self.inputs, |below| &self.activations[below]);
        columns(values, self.widths[layer], &self.chunk)
    }
}

/// Writes to `sum` the total of what `add` adds for each chunk of `samples`, in their order, shared
/// by as many threads as there are `rooms`. `add` adds a chunk's sum, from zero, to its last
/// argument times the sum so far: 0 for a first chunk, whatever is there, and 1 for the others.
/// A thread's share of a chunk is a first one, so the bits are those of one thread.
pub(super) fn sum_over_chunks(
    samples: usize,
    rooms: &mut [Scratch],
    sum: &mut [f32],
    add: impl Fn(Range<usize>, &mut Scratch, &mut [f32], f32) + Sync,
) {
    if samples == 0 {
        return sum.fill(0.0);
    }
    if let [room] = rooms {
        return chunks(samples).for_each(|chunk| {
            let beta = if chunk.start == 0 { 0.0 } else { 1.0 };
            add(chunk, room, sum, beta);
        });
    }
    let len = sum.len();
    let sum = InOrder::new(sum);
    threads::share(
        rooms,
        chunks(samples).enumerate(),
        |room, (number, chunk)| {
            let mut share = mem::take(&mut room.share);
            let make = || {
                share.resize(len, 0.0);
                add(chunk, room, &mut share, 0.0);
                share
            };
            room.share = sum.in_turn(number, make, |sum, share| {
                if number == 0 {
                    sum.copy_from_slice(&share);
                } else {
                    sum.iter_mut().zip(&share).for_each(|(sum, x)| *sum += x);
                }
                share
            });
        },
    );
}

/// Cuts matrices of `heights`, one column a sample, at the chunks of `size` samples; returns each
/// chunk's part of each matrix.
pub(super) fn cut<'a>(
    matrices: impl Iterator<Item = (&'a mut Vec<f32>, usize)>,
    samples: usize,
    size: usize,
) -> impl Iterator<Item = (Range<usize>, Vec<&'a mut [f32]>)> {
    let mut pieces: Vec<_> = matrices
        .map(|(values, height)| values[..height * samples].chunks_mut(height * size))
        .collect();
    let ranges = (0..samples)
        .step_by(size)
        .map(move |start| start..samples.min(start + size));
    ranges.map(move |range| {
        (
            range,
            pieces.iter_mut().filter_map(Iterator::next).collect(),
        )
    })
}

/// The chunks of `samples`.
pub(super) fn chunks(samples: usize) -> impl Iterator<Item = Range<usize>> {
    (0..samples)
        .step_by(CHUNK)
        .map(move |start| start..samples.min(start + CHUNK))
}

/// Columns `range` of a matrix of `height`, as a slice.
pub(super) fn columns<'a>(values: &'a [f32], height: usize, range: &Range<usize>) -> &'a [f32] {
    &values[height * range.start..height * range.end]
}

/// Columns `range` of a matrix of `height`, as a slice to be written.
pub(super) fn columns_mut<'a>(
    values: &'a mut [f32],
    height: usize,
    range: &Range<usize>,
) -> &'a mut [f32] {
    &mut values[height * range.start..height * range.end]
}

/// `values` as a matrix of `height`.
pub(super) fn matrix(values: &[f32], height: usize) -> DMatrixView<'_, f32> {
    DMatrixView::from_slice(values, height, values.len() / height)
}

/// The first `len` columns of `values` as a matrix of `height`.
pub(super) fn first(values: &[f32], height: usize, len: usize) -> DMatrixView<'_, f32> {
    matrix(&values[..height * len], height)
}

/// `values` as a matrix of `height` to be written.
pub(super) fn matrix_mut(values: &mut [f32], height: usize) -> DMatrixViewMut<'_, f32> {
    let len = values.len() / height;
    DMatrixViewMut::from_slice(values, height, len)
}

/// Makes `room` at least `len` long.
pub(super) fn grow(room: &mut Vec<f32>, len: usize) {
    if room.len() < len {
        room.resize(len, 0.0);
    }
}
