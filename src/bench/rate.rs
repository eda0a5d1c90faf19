//! The best rate of f32 products on this core.

use nalgebra::DMatrix;
use serde::Serialize;

use super::clock::timed;
use crate::arithmetic::product::{product, product_nt};

/// Shapes (m, k, n) of products of the usual networks on some and on many samples, forwards and for
/// the weights' gradient, and one that every kernel likes.
const SHAPES: [(usize, usize, usize); 4] = [
    (400, 300, 256),
    (400, 300, 1024),
    (300, 256, 400),
    (384, 384, 384),
];

/// CPU seconds of one timing; the best of many timings counts.
const LEAST: f64 = 2e-3;

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

/// The fastest product so far.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Rate {
    /// Operations a second of CPU time.
    pub flops_per_s: f64,
    /// Which product reached it: `product 400 x 300 x 256`.
    pub product: String,
}

impl Rate {
    /// Runs every product for a while, and keeps the best rate.
    pub fn measure(&mut self) {
        for (m, k, n) in SHAPES {
            let fill = |rows, columns| {
                DMatrix::from_fn(rows, columns, |i, j| ((i * 7 + j * 3) as f32).sin())
            };
            let (a, b, mut c) = (fill(m, k), fill(k, n), DMatrix::zeros(m, n));
            let b_transposed = b.transpose();
            for (name, kernel) in KERNELS {
                for _ in 0..5 {
                    let (mut times, mut cpu) = (0.0, 0.0);
                    while cpu < LEAST {
                        cpu += timed(|| kernel(&a, &b, &b_transposed, &mut c)).1.cpu;
                        times += 1.0;
                    }
                    let flops_per_s = times * 2.0 * (m * k * n) as f64 / cpu;
                    if flops_per_s > self.flops_per_s {
                        *self = Self {
                            flops_per_s,
                            product: format!("{name} {m} x {k} x {n}"),
                        };
                    }
                }
            }
        }
    }
}
