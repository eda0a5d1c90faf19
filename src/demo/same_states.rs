//! The sums over kernel values between samples and a target that share their states.
//!
//! Sample i is the target's point i with another action. So the product of two points' states is
//! the same for two samples (x_i, x_j), for a point and a sample (y_i, x_j), and for the same pair
//! the other way round (x_i, y_j): it is computed once for the three. Owns that order of
//! computation. The bits are those of [`pairs::within`](super::pairs::within) and
//! [`pairs::between`](super::pairs::between). Start at [`sums`].

use std::{mem, ops::Range};

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};

use super::{
    block::{Block, COLUMNS, ROWS, RowSums},
    exponents::{First, Points, Side, from_products},
    mmd::{Sums, WeightedSums},
    pairs::{blocks, forget_own, strips},
};
use crate::arithmetic::product::{product, product_onto};

/// The sums for `samples`, which differ from the points of `target` by their last `action_dim`
/// coordinates alone; fills `weighted` too, for the gradient.
pub(super) fn sums(
    target: &Points,
    samples: &Points,
    action_dim: usize,
    mut weighted: Option<&mut WeightedSums>,
) -> Sums {
    let mut sums = Sums::zeros(samples.len());
    let states = 0..samples.dim() - action_dim;
    let actions = states.end..samples.dim();
    let mut of_states = [0.0; ROWS * COLUMNS];
    let mut buffer = [0.0; ROWS * COLUMNS];
    let mut to_target = RowSums::new();
    let (mut of_samples, mut of_target) = (Chains::new(action_dim), Chains::new(action_dim));
    for j in blocks(samples.len()) {
        for i in blocks(j.end) {
            let mirrored = i != j;
            for columns in strips(&j) {
                let size = i.len() * columns.len();
                let (of_states, values) = (&mut of_states[..size], &mut buffer[..size]);
                product(
                    samples.rows(states.clone(), i.clone()),
                    samples.columns(states.clone(), columns.clone()),
                    0.0,
                    DMatrixViewMut::from_slice(of_states, i.len(), columns.len()),
                );
                let of_states = DMatrixView::from_slice(of_states, i.len(), columns.len());
                let kernel = |x: &Points, y: &Points, first: First, values: &mut [f32]| {
                    product_onto(
                        of_states,
                        x.rows(actions.clone(), i.clone()),
                        y.columns(actions.clone(), columns.clone()),
                        DMatrixViewMut::from_slice(values, i.len(), columns.len()),
                    );
                    from_products(Side::of(x, &i), Side::of(y, &columns), first, values);
                };

                kernel(samples, samples, First::Rows, values);
                if !mirrored {
                    forget_own(&i, &columns, values);
                }
                let block = Block::new(&i, &columns, values);
                block.add_column_sums(&mut sums.to_samples);
                if mirrored {
                    block.add_row_sums(&mut sums.to_samples);
                }
                if let Some(WeightedSums {
                    of_samples: sums, ..
                }) = &mut weighted
                {
                    block.add_weighted(samples.columns(actions.clone(), i.clone()), sums);
                    if mirrored {
                        of_samples.go_on(samples, &actions, &block);
                    }
                }

                kernel(target, samples, First::Rows, values);
                let block = Block::new(&i, &columns, values);
                block.add_column_sums(&mut sums.to_target);
                if let Some(WeightedSums {
                    of_target: sums, ..
                }) = &mut weighted
                {
                    block.add_weighted(target.columns(actions.clone(), i.clone()), sums);
                }

                if mirrored {
                    kernel(samples, target, First::Columns, values);
                    let block = Block::new(&i, &columns, values);
                    to_target.add(&block);
                    if weighted.is_some() {
                        of_target.go_on(target, &actions, &block);
                    }
                }
            }
            if mirrored {
                to_target.take(&mut sums.to_target[i.clone()]);
                if let Some(weighted) = &mut weighted {
                    of_samples.take(weighted.of_samples.columns_range_mut(i.clone()));
                    of_target.take(weighted.of_target.columns_range_mut(i));
                }
            }
        }
    }
    sums
}

/// The weighted sums for the rows of a block over all its columns, strip after strip: chains, as in
/// one product, that go on from strip to strip.
struct Chains {
    /// So far `[ROWS x action_dim]`.
    sums: DMatrix<f32>,
    /// Where the next ones are written.
    next: DMatrix<f32>,
}

impl Chains {
    fn new(action_dim: usize) -> Self {
        let zeros = DMatrix::zeros(ROWS, action_dim);
        Self {
            sums: zeros.clone(),
            next: zeros,
        }
    }

    /// Adds the `actions` of `points`, which are the block's columns, weighted by its values.
    fn go_on(&mut self, points: &Points, actions: &Range<usize>, block: &Block<'_>) {
        let rows = ..block.rows.len();
        product_onto(
            self.sums.rows_range(rows),
            block.values,
            points.rows(actions.clone(), block.columns.clone()),
            self.next.rows_range_mut(rows),
        );
        mem::swap(&mut self.sums, &mut self.next);
    }

    /// Adds the chains to the `sums` of their rows `[action_dim x rows]`, and starts anew.
    fn take(&mut self, mut sums: DMatrixViewMut<'_, f32>) {
        for (mut sum, chains) in sums.column_iter_mut().zip(self.sums.row_iter()) {
            sum += chains.transpose();
        }
        self.sums.fill(0.0);
    }
}
