//! InvertedPendulum-v2: a pole on a cart.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, height, shipped};

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "InvertedPendulum-v2",
    paper_name: Some("Pendulum-v2"),
    max_steps: 1000,
    default_reward: || height(0.59),
    revision: 1,
    microseconds: 9.0,
    is_f32_in_gymnasium: false,
    versions: &[
        Version::same(4),
        Version::other(
            5,
            "v5 pays 0 instead of 1 for the step in which the pole falls",
        )
        .not_paying(1.0),
    ],
    body: Body::Robot(LazyLock::new(|| {
        shipped(include_str!("inverted_pendulum.toml"), MODEL)
    })),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/inverted_pendulum.xml"
));
