//! The ways in which a file is no saved policy.

use safetensors::{Dtype, SafeTensorError};

use crate::record::Stamp;

/// Errors of a saved policy; the message names the tensor, where it is of one.
#[derive(Debug, thiserror::Error)]
pub enum PolicyError {
    /// It does not exist.
    #[error("there is no such file")]
    Missing,
    /// It is no safetensors file, or a number of the policy is in none.
    #[error(transparent)]
    Container(#[from] SafeTensorError),
    /// It does not say which run it is of.
    #[error("its metadata has no `{}`", Stamp::KEY)]
    NoStamp,
    /// The run that it is of cannot be understood, or not be written.
    #[error("its `{key}` is damaged: {0}", key = Stamp::KEY)]
    Stamp(#[source] serde_json::Error),
    /// A tensor is missing.
    #[error("`{0}` is missing")]
    NoTensor(String),
    /// A tensor has another number of dimensions, or more numbers than one.
    #[error("`{tensor}` has the shape {found:?}; {needed} was expected")]
    Shape {
        /// The tensor's name.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape that it should have, in words.
        needed: &'static str,
    },
    /// A layer is empty, or does not take what the layer before gives.
    #[error("`{tensor}` has the shape {found:?}, which does not follow {before:?}")]
    Layer {
        /// The name of its weights.
        tensor: String,
        /// Their shape, outputs and inputs.
        found: [usize; 2],
        /// The widths of the layers before.
        before: Vec<usize>,
    },
    /// A tensor has more or fewer numbers than the others allow.
    #[error("{quantity} has {found} numbers; {needed} would fit {other}")]
    Length {
        /// The tensor's name, or what it stands for.
        quantity: String,
        /// The count of its numbers.
        found: usize,
        /// The count that would fit.
        needed: usize,
        /// The thing that they must fit.
        other: &'static str,
    },
    /// A tensor is of another type.
    #[error("`{tensor}` is of type {found:?}; {needed:?} was expected")]
    WrongType {
        /// The tensor's name.
        tensor: String,
        /// Its type.
        found: Dtype,
        /// The type that it should have.
        needed: Dtype,
    },
    /// A number is NaN or infinite.
    #[error("`{tensor}` is not finite at {place}")]
    NotFinite {
        /// The tensor's name.
        tensor: String,
        /// The place of the first such number.
        place: usize,
    },
    /// Counts or sums of squares of the normaliser are below 0, or unequal in number.
    #[error("its normaliser's numbers do not fit together")]
    Normalizer,
    /// The normaliser cannot be made of its numbers, or taken apart into them.
    #[error("its normaliser cannot be converted: {0}")]
    NormalizerParts(#[source] serde_json::Error),
    /// It acts in another environment.
    #[error("it has {}; its environment has {}", numbers(*found), numbers(*needed))]
    Dimensions {
        /// The lengths of its observations and actions.
        found: (usize, usize),
        /// Those of the environment.
        needed: (usize, usize),
    },
}

fn numbers((observation, action): (usize, usize)) -> String {
    format!("observations of {observation} and actions of {action} numbers")
}
