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
pub(in crate::nn) fn plain_output(widths: &[usize], parameters: &[f64], input: &[f32]) -> Vec<f64> {
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
    let (mut gradient, mut output_tangent) = (vec![f32::NAN; tangent.len()], DMatrix::zeros(2, n));
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
        let (mut pass, mut gradient) = (Pass::default(), vec![f32::NAN; network.parameters.len()]);
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
