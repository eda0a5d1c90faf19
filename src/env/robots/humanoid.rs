//! Humanoid-v2: two legs, two arms, in space, with inertias and forces among its 376 observations.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, metres, shipped};

const HUMANOID5: &str =
    "v5 observes 348 numbers instead of 376, and pays no 5 for the step in which it falls";

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "Humanoid-v2",
    paper_name: None,
    max_steps: 1000,
    default_reward: || metres(1.0),
    revision: 1,
    microseconds: 300.0,
    is_f32_in_gymnasium: false,
    versions: &[
        Version::same(3),
        Version::other(4, "v4 has no cost of contacts"),
        Version::other(5, HUMANOID5).observing(348).not_paying(5.0),
    ],
    body: Body::Robot(LazyLock::new(|| {
        shipped(include_str!("humanoid.toml"), MODEL)
    })),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/humanoid.xml"
));
