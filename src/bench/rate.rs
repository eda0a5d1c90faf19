//! The best rates of f32 products and of tanh on this core.

use nalgebra::DMatrix;
use serde::Serialize;

use super::clock::timed;
use crate::arithmetic::{
    product::{product, product_nt},
    tanh,
};

/// Shapes (m, k, n) of products of the usual networks on some and on many samples, forwards and for
/// the weights' gradient, and one that every kernel likes.
const SHAPES: [(usize, usize, usize); 4] = [
    (400, 300, 256),
    (400, 300, 1024),
    (300, 256, 400),
    (384, 384, 384),
];

/// The number of values of one call of tanh: few enough for the nearest cache, which the tile of a
/// product is in when a layer's tanh could take it up.
const TANHS: usize = 4096;

/// CPU seconds of one timing; the best of many timings counts.
const LEAST: f64 = 2e-3;

/// Timings of one kernel at a time.
const TIMINGS: usize = 5;

/// A kernel that computes `c = a b`, with `b^T` at hand.
type Kernel =
    fn(a: &DMatrix<f32>, b: &DMatrix<f32>, b_transposed: &DMatrix<f32>, c: &mut DMatrix<f32>);

/// This crate's two kernels, and matrixmultiply's, which is nalgebra's.
const KERNELS: [(&str, Kernel); 3] = [
    ("product", |a, b, _, c| {
        product(a.as_view(), b.as_view(), 0.0, c.as_view_mut())
    }),
    ("product_nt", |a, _, b_transposed, c| {
        product_nt(a.as_view(), b_transposed.as_view(), 0.0, c.as_view_mut())
    }),
    ("matrixmultiply", |a, b, _, c| c.gemm(1.0, a, b, 0.0)),
];

/// The fastest so far.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Rate {
    /// Operations of products a second of CPU time.
    pub flops_per_s: f64,
    /// Which product reached it: `product 400 x 300 x 256`.
    pub product: String,
    /// Values of tanh a second of CPU time.
    pub tanhs_per_s: f64,
}

impl Rate {
    /// Runs every product and tanh for a while, and keeps the best rates.
    pub fn measure(&mut self) {
        self.measure_products();
        let mut values: Vec<f32> = (0..TANHS).map(|i| (i as f32).sin()).collect();
        let tanhs_per_s = TANHS as f64 * calls_per_s(|| tanh(&mut values));
        self.tanhs_per_s = self.tanhs_per_s.max(tanhs_per_s);
    }

    fn measure_products(&mut self) {
        for (m, k, n) in SHAPES {
            let fill = |rows, columns| {
                DMatrix::from_fn(rows, columns, |i, j| ((i * 7 + j * 3) as f32).sin())
            };
            let (a, b, mut c) = (fill(m, k), fill(k, n), DMatrix::zeros(m, n));
            let b_transposed = b.transpose();
            for (name, kernel) in KERNELS {
                let calls_per_s = calls_per_s(|| kernel(&a, &b, &b_transposed, &mut c));
                let flops_per_s = calls_per_s * 2.0 * (m * k * n) as f64;
                if flops_per_s > self.flops_per_s {
                    self.flops_per_s = flops_per_s;
                    self.product = format!("{name} {m} x {k} x {n}");
                }
            }
        }
    }
}

/// How often a second of CPU time `kernel` can run, by the best timing.
fn calls_per_s(mut kernel: impl FnMut()) -> f64 {
    let timing = || {
        let (mut calls, mut cpu) = (0.0, 0.0);
        while cpu < LEAST {
            cpu += timed(&mut kernel).1.cpu;
            calls += 1.0;
        }
        calls / cpu
    };
    std::iter::repeat_with(timing)
        .take(TIMINGS)
        .fold(0.0, f64::max)
}
