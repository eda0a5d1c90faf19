use super::*;
use nalgebra::DMatrix;

/// Numbers in -1..1 without a pattern.
fn matrix(rows: usize, columns: usize, seed: u32) -> DMatrix<f32> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    DMatrix::from_fn(rows, columns, |_, _| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    })
}

/// Plain loops in f64.
fn assert_is_product(
    a: &DMatrix<f32>,
    b: &DMatrix<f32>,
    beta: f32,
    before: &DMatrix<f32>,
    c: &DMatrix<f32>,
) {
    for i in 0..a.nrows() {
        for j in 0..b.ncols() {
            let sum: f64 = (0..a.ncols())
                .map(|l| f64::from(a[(i, l)]) * f64::from(b[(l, j)]))
                .sum();
            let exact = sum + f64::from(beta) * f64::from(before[(i, j)]);
            // Rounding of k additions of numbers below 1, each at most 2^-24 of the sum's
            // magnitude.
            let tolerance = 1e-7 * a.ncols() as f64 + 1e-6;
            assert!(
                (f64::from(c[(i, j)]) - exact).abs() <= tolerance,
                "({i}, {j})"
            );
        }
    }
}

#[test]
#[should_panic(expected = "inner dimensions")]
fn refuses_shapes_that_do_not_fit() {
    let (a, b, mut c) = (matrix(2, 3, 1), matrix(4, 2, 2), matrix(2, 2, 3));
    product(a.as_view(), b.as_view(), 0.0, c.as_view_mut());
}

#[test]
fn all_agree_with_plain_loops() {
    for (m, k, n) in [
        (1, 1, 1),
        (3, 2, 5),
        (17, 300, 8),
        (40, 17, 33),
        (6, 400, 70),
        (65, 515, 9),
    ] {
        for beta in [0.0, 1.0, -0.5] {
            let (a, b, before) = (matrix(m, k, 1), matrix(k, n, 2), matrix(m, n, 3));
            let mut c = before.clone();
            product(a.as_view(), b.as_view(), beta, c.as_view_mut());
            assert_is_product(&a, &b, beta, &before, &c);
            let mut c = before.clone();
            product_tn(a.transpose().as_view(), b.as_view(), beta, c.as_view_mut());
            assert_is_product(&a, &b, beta, &before, &c);
            let mut c = before.clone();
            product_nt(a.as_view(), b.transpose().as_view(), beta, c.as_view_mut());
            assert_is_product(&a, &b, beta, &before, &c);
            let (with_ones, before) = (
                b.clone().insert_column(n, 1.0),
                before.insert_column(n, 0.3),
            );
            let mut c = before.clone();
            product_nt_and_sum(a.as_view(), b.transpose().as_view(), beta, c.as_view_mut());
            assert_is_product(&a, &with_ones, beta, &before, &c);
        }
    }
}

#[test]
fn views_into_larger_matrices_leave_the_rest_alone() {
    let (a, b, mut c) = (matrix(9, 8, 1), matrix(7, 10, 2), matrix(12, 11, 3));
    let (inner_a, inner_b) = (a.view((1, 2), (5, 4)), b.view((2, 3), (4, 6)));
    let before = c.clone();
    product(inner_a, inner_b, 1.0, c.view_mut((3, 4), (5, 6)));
    let part = |m: &DMatrix<f32>| m.view((3, 4), (5, 6)).into_owned();
    assert_is_product(
        &inner_a.into_owned(),
        &inner_b.into_owned(),
        1.0,
        &part(&before),
        &part(&c),
    );
    c.view_mut((3, 4), (5, 6)).copy_from(&part(&before));
    assert_eq!(c, before);
}

#[test]
fn zero_beta_ignores_what_was_there() {
    let (a, b) = (matrix(5, 4, 1), matrix(4, 6, 2));
    let mut c = DMatrix::from_element(5, 6, f32::NAN);
    product(a.as_view(), b.as_view(), 0.0, c.as_view_mut());
    assert!(c.iter().all(|x| x.is_finite()));
    // Also when there is nothing to sum.
    let mut c = DMatrix::from_element(5, 6, f32::NAN);
    product(
        DMatrix::zeros(5, 0).as_view(),
        DMatrix::zeros(0, 6).as_view(),
        0.0,
        c.as_view_mut(),
    );
    assert!(c.iter().all(|&x| x == 0.0));
}

#[test]
fn bits_of_a_column_do_not_depend_on_how_many_pass_together() {
    for (m, k) in [(300, 17), (400, 300), (6, 400), (1, 400), (64, 600)] {
        let (a, b) = (matrix(m, k, 1), matrix(k, 1000, 2));
        let transposed = a.transpose();
        for beta in [0.0, 1.0] {
            let before = matrix(m, 1000, 3);
            let mut all = before.clone();
            product(a.as_view(), b.as_view(), beta, all.as_view_mut());
            for n in [1, 2, 5, 6, 7, 64] {
                let some_b = b.columns(0, n);
                let mut some = before.columns(0, n).into_owned();
                product(a.as_view(), some_b, beta, some.as_view_mut());
                assert_eq!(some, all.columns(0, n), "{m} x {k}, {n} columns");
                let mut some = before.columns(0, n).into_owned();
                product_tn(transposed.as_view(), some_b, beta, some.as_view_mut());
                assert_eq!(some, all.columns(0, n), "transposed {m} x {k}, {n} columns");
            }
        }
    }
}

#[test]
fn a_product_that_goes_on_from_another_has_the_bits_of_one() {
    for (m, k, n) in [(240, 23, 16), (17, 9, 5), (48, 30, 1), (6, 2, 13)] {
        let (a, b) = (matrix(m, k, 1), matrix(k, n, 2));
        let (mut whole, mut start) = (DMatrix::zeros(m, n), DMatrix::zeros(m, n));
        product(a.as_view(), b.as_view(), 0.0, whole.as_view_mut());
        let first = k / 2;
        product(
            a.columns_range(..first),
            b.rows_range(..first),
            0.0,
            start.as_view_mut(),
        );
        let mut rest = DMatrix::from_element(m, n, f32::NAN);
        product_onto(
            start.as_view(),
            a.columns_range(first..),
            b.rows_range(first..),
            rest.as_view_mut(),
        );
        assert_eq!(rest, whole, "{m} x {k} x {n}");
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn bits_do_not_depend_on_the_width_of_registers() {
    let Some(narrow) = pulp::x86::V3::try_new() else {
        return;
    };
    for (m, k, n) in [(100, 17, 13), (6, 300, 9), (35, 64, 1)] {
        let (a, b, before) = (matrix(m, k, 1), matrix(k, n, 2), matrix(m, n, 3));
        let (mut with_narrow, mut with_best) = (before.clone(), before.clone());
        let right = Right::Plain(b.as_view());
        Simd::vectorize(
            narrow,
            Product {
                a: a.as_view(),
                right,
                start: Zero,
                beta: 1.0,
                c: with_narrow.as_view_mut(),
            },
        );
        product(a.as_view(), b.as_view(), 1.0, with_best.as_view_mut());
        assert_eq!(with_narrow, with_best, "{m} x {k} x {n}");
    }
}
