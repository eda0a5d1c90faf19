//! The Gaussian kernel `k(x, y) = exp(-|x - y|^2 / (2 sigma^2))`.

use serde::{Deserialize, Serialize};

use crate::quantity::Positive;

/// How sigma is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bandwidth {
    /// This sigma.
    Fixed(Positive),
    /// The median distance between the demonstration's points.
    Median,
}

/// A Gaussian kernel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kernel {
    /// `1 / (2 sigma^2)`.
    pub scale: f64,
}
