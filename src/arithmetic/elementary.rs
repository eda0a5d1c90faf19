//! exp and tanh of whole slices.

/// Replaces each number by its exponential.
pub fn exp(values: &mut [f32]) {
    values.iter_mut().for_each(|x| *x = x.exp()); // TODO(nn helper): pulp
}

/// Replaces each number by its hyperbolic tangent.
pub fn tanh(values: &mut [f32]) {
    values.iter_mut().for_each(|x| *x = x.tanh()); // TODO(nn helper): pulp
}
