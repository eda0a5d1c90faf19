//! InvertedDoublePendulum-v2: two poles, one on the other, on a cart.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, height, shipped};

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "InvertedDoublePendulum-v2",
    paper_name: Some("DoublePendulum-v2"),
    max_steps: 1000,
    default_reward: || height(0.89),
    revision: 1,
    microseconds: 29.0,
    is_f32_in_gymnasium: false,
    versions: &[
        Version::same(4),
        Version::other(5, "v5 observes 9 numbers instead of 11, and pays no 10 for the step in which the poles fall")
            .observing(9)
            .not_paying(10.0),
    ],
    body: Body::Robot(LazyLock::new(|| shipped(include_str!("inverted_double_pendulum.toml"), MODEL))),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/inverted_double_pendulum.xml"
));
