//! Kernel values from products of points.
//!
//! Owns how exponents are computed: a product `x.y` and two norms, `x.y - |x|^2 / 2 - |y|^2 / 2`;
//! again from differences where that formula cancels. Start at [`Points`] and [`from_products`].

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DVector};
use pulp::{Arch, Simd, WithSimd};

use super::Kernel;
use crate::arithmetic::exp2_nonpositive;

/// A squared distance below this share of `|x|^2 + |y|^2` has lost digits to cancellation (about
/// `4e-7 (|x|^2 + |y|^2)` absolute), so it is computed again from the differences.
/// The other distances have a relative error below 1e-4.
const CLOSE: f32 = 0.01;

/// Points, one a column, moved and scaled.
/// Moving a common centre to 0 keeps norms small, and so cancellation.
/// The scale is such that their kernel is `2^(-|x - y|^2 / 2)`.
#[derive(Debug, Clone)]
pub(super) struct Points {
    /// The points `[dim x n]`.
    columns: DMatrix<f32>,
    /// The same, one a row `[n x dim]`.
    rows: DMatrix<f32>,
    /// `-|x|^2 / 2` of each point x `[n]`.
    norms: Vec<f32>,
    /// The factor that the points were scaled by.
    scale: f64,
}

impl Points {
    /// The points of `points` (`[dim x n]`), moved by `centre` (`[dim]`) and scaled for `kernel`.
    pub(super) fn new(points: &DMatrix<f32>, centre: &DVector<f32>, kernel: Kernel) -> Self {
        assert_eq!(
            points.nrows(),
            centre.len(),
            "points and their target have the same dimension"
        );
        // exp(-k d^2) = 2^(-(s d)^2 / 2).
        let scale = (2.0 * kernel.scale * std::f64::consts::LOG2_E).sqrt();
        Self::moved(points.clone(), 0, centre, scale)
    }

    /// The same points with other last coordinates, `last` (`[k x n]`), moved by those of `centre`.
    pub(super) fn with_last(&self, last: &DMatrix<f32>, centre: &DVector<f32>) -> Self {
        let first = self.dim() - last.nrows();
        let mut columns = self.columns.clone();
        columns.rows_mut(first, last.nrows()).copy_from(last);
        Self::moved(columns, first, centre, self.scale)
    }

    /// The points of `columns` (`[dim x n]`), moved and scaled from the row `first` on.
    fn moved(mut columns: DMatrix<f32>, first: usize, centre: &DVector<f32>, scale: f64) -> Self {
        let squared = |x: &f32| f64::from(*x) * f64::from(*x);
        let mut norms = Vec::with_capacity(columns.ncols());
        for mut column in columns.column_iter_mut() {
            for (x, &centre) in column.iter_mut().zip(centre).skip(first) {
                *x = ((f64::from(*x) - f64::from(centre)) * scale) as f32;
            }
            norms.push((-0.5 * column.iter().map(squared).sum::<f64>()) as f32);
        }
        Self {
            rows: columns.transpose(),
            columns,
            norms,
            scale,
        }
    }

    /// The number of points.
    pub(super) fn len(&self) -> usize {
        self.norms.len()
    }

    /// The number of coordinates of a point.
    pub(super) fn dim(&self) -> usize {
        self.columns.nrows()
    }

    /// The factor that the points were scaled by, along each axis.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// The `coordinates` of the points of a range, centred and scaled, one point a column
    /// `[coordinates x range]`.
    pub(super) fn columns(
        &self,
        coordinates: Range<usize>,
        range: Range<usize>,
    ) -> DMatrixView<'_, f32> {
        self.columns.view(
            (coordinates.start, range.start),
            (coordinates.len(), range.len()),
        )
    }

    /// The same, one point a row `[range x coordinates]`.
    pub(super) fn rows(
        &self,
        coordinates: Range<usize>,
        range: Range<usize>,
    ) -> DMatrixView<'_, f32> {
        self.rows.view(
            (range.start, coordinates.start),
            (range.len(), coordinates.len()),
        )
    }
}

/// Some points of a set: those of a block's rows, or of its columns.
#[derive(Clone, Copy)]
pub(super) struct Side<'a> {
    points: &'a Points,
    range: &'a Range<usize>,
}

impl<'a> Side<'a> {
    /// The points of `range`.
    pub(super) fn of(points: &'a Points, range: &'a Range<usize>) -> Self {
        Self { points, range }
    }

    fn norms(self) -> &'a [f32] {
        &self.points.norms[self.range.clone()]
    }

    /// The coordinates of the point `i` of the range.
    fn point(self, i: usize) -> &'a [f32] {
        let dim = self.points.dim();
        &self.points.columns.as_slice()[(self.range.start + i) * dim..][..dim]
    }
}

/// Whose norms are added to a product first. A pair has the same bits in a block and in the block's
/// transpose if it is the same point's.
#[derive(Clone, Copy)]
pub(super) enum First {
    Rows,
    Columns,
}

/// Turns the products `x.y` of a block in `values` (`[rows x columns]`) into kernel values.
pub(super) fn from_products(rows: Side<'_>, columns: Side<'_>, first: First, values: &mut [f32]) {
    Arch::new().dispatch(Exponents {
        rows,
        columns,
        first,
        values,
    });
    exp2_nonpositive(values);
}

struct Exponents<'a> {
    rows: Side<'a>,
    columns: Side<'a>,
    first: First,
    /// Products, which become exponents `[rows x columns]`.
    values: &'a mut [f32],
}

impl WithSimd for Exponents<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let norms = self.rows.norms();
        let (vectors, rest) = S::as_simd_f32s(norms);
        let mut lowest = simd.splat_f32s(0.0);
        for &norms in vectors {
            lowest = simd.min_f32s(norms, lowest);
        }
        let lowest = rest
            .iter()
            .copied()
            .fold(simd.reduce_min_f32s(lowest), f32::min);
        for (j, values) in self.values.chunks_exact_mut(norms.len()).enumerate() {
            let norm = self.columns.norms()[j];
            let highest = match self.first {
                First::Rows => add_norms(simd, values, norms, norm, |x_y, own, norm| {
                    simd.add_f32s(simd.add_f32s(x_y, own), norm)
                }),
                First::Columns => add_norms(simd, values, norms, norm, |x_y, own, norm| {
                    simd.add_f32s(simd.add_f32s(x_y, norm), own)
                }),
            };
            // An exponent that cancels does so beside the lowest norm too. A NaN shows nothing here,
            // and needs no correction.
            if cancels(highest, lowest, norm) {
                correct(simd, self.rows, norm, self.columns.point(j), values);
            }
        }
    }
}

/// Adds to the products of one column in `values` their rows' `norms` and the column's `norm`, as
/// `sum` does. Returns the highest sum.
#[inline(always)]
fn add_norms<S: Simd>(
    simd: S,
    values: &mut [f32],
    norms: &[f32],
    norm: f32,
    sum: impl Fn(S::f32s, S::f32s, S::f32s) -> S::f32s,
) -> f32 {
    let norm = simd.splat_f32s(norm);
    let (values, last_values) = S::as_mut_simd_f32s(values);
    let (norms, last_norms) = S::as_simd_f32s(norms);
    let mut highest = simd.splat_f32s(f32::NEG_INFINITY);
    for (value, &own) in values.iter_mut().zip(norms) {
        *value = sum(*value, own, norm);
        highest = simd.max_f32s(*value, highest);
    }
    let mut highest = simd.reduce_max_f32s(highest);
    if !last_values.is_empty() {
        let value = simd.partial_load_f32s(last_values);
        let own = simd.partial_load_f32s(last_norms);
        simd.partial_store_f32s(last_values, sum(value, own, norm));
        highest = last_values.iter().copied().fold(highest, f32::max);
    }
    highest
}

/// Whether an exponent has lost digits, given the norms of its two points.
#[inline(always)]
fn cancels(exponent: f32, one: f32, other: f32) -> bool {
    exponent > CLOSE * (one + other)
}

/// Recomputes the exponents between the points of `rows` and `y`, of the norm `norm`, that have
/// lost digits.
#[inline(always)]
fn correct<S: Simd>(simd: S, rows: Side<'_>, norm: f32, y: &[f32], exponents: &mut [f32]) {
    let vectors = S::as_simd_f32s(rows.norms()).0;
    let (close, other) = (simd.splat_f32s(CLOSE), simd.splat_f32s(norm));
    for (v, &own) in vectors.iter().enumerate() {
        let lanes = v * S::F32_LANES..(v + 1) * S::F32_LANES;
        let limit = simd.mul_f32s(close, simd.add_f32s(own, other));
        let exponent = S::as_simd_f32s(&exponents[lanes.clone()]).0[0];
        if simd.first_true_m32s(simd.greater_than_f32s(exponent, limit)) < S::F32_LANES {
            correct_each(rows, lanes, norm, y, exponents);
        }
    }
    let rest = vectors.len() * S::F32_LANES..exponents.len();
    correct_each(rows, rest, norm, y, exponents);
}

/// Does that for the rows of `range`, one by one.
fn correct_each(rows: Side<'_>, range: Range<usize>, norm: f32, y: &[f32], exponents: &mut [f32]) {
    for i in range {
        if cancels(exponents[i], rows.norms()[i], norm) {
            exponents[i] = -0.5 * squared_distance(rows.point(i), y);
        }
    }
}

/// `|x - y|^2` from the differences.
pub(super) fn squared_distance(x: &[f32], y: &[f32]) -> f32 {
    x.iter().zip(y).map(|(a, b)| (a - b) * (a - b)).sum()
}
