//! Hopper-v2: one leg, in a plane.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, metres, shipped};

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "Hopper-v2",
    paper_name: None,
    max_steps: 1000,
    default_reward: || metres(1.0),
    revision: 1,
    microseconds: 58.0,
    is_f32_in_gymnasium: false,
    versions: &[
        Version::same(3),
        Version::same(4),
        Version::other(5, "v5 pays no 1 for the step in which it falls").not_paying(1.0),
    ],
    body: Body::Robot(LazyLock::new(|| {
        shipped(include_str!("hopper.toml"), MODEL)
    })),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/hopper.xml"
));
