//! Walker2d-v2: two legs, in a plane.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, metres, shipped};

const WALKER5: &str = "v5 pays no 1 for the step in which it falls, and gives both feet the friction 1.9 (here the right one has 0.9)";

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "Walker2d-v2",
    paper_name: None,
    max_steps: 1000,
    default_reward: || metres(1.0),
    revision: 1,
    microseconds: 82.0,
    is_f32_in_gymnasium: false,
    versions: &[
        Version::same(3),
        Version::same(4),
        Version::other(5, WALKER5)
            .not_paying(1.0)
            .moving_otherwise(),
    ],
    body: Body::Robot(LazyLock::new(|| {
        shipped(include_str!("walker2d.toml"), MODEL)
    })),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/walker2d.xml"
));
