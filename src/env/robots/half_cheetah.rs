//! HalfCheetah-v2: two legs and a trunk, in a plane; it never ends.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, metres, shipped};

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "HalfCheetah-v2",
    paper_name: None,
    max_steps: 1000,
    default_reward: || metres(10.0),
    revision: 1,
    microseconds: 25.0,
    is_f32_in_gymnasium: false,
    versions: &[Version::same(3), Version::same(4), Version::same(5)],
    body: Body::Robot(LazyLock::new(|| {
        shipped(include_str!("half_cheetah.toml"), MODEL)
    })),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/half_cheetah.xml"
));
