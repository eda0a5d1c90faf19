//! Ant-v2: four legs, in space, with contact forces among its 111 observations.

use std::sync::{LazyLock, OnceLock};

use crate::env::catalog::{Body, Descriptor, Version, metres, shipped};

const ANT4: &str = "v4 observes 27 numbers instead of 111: the contact forces are left out unless they are asked for";
const ANT5: &str =
    "v5 observes 105 numbers instead of 111, and pays no 1 for the step in which it falls";

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "Ant-v2",
    paper_name: None,
    max_steps: 1000,
    default_reward: || metres(1.0),
    revision: 1,
    microseconds: 167.0,
    is_f32_in_gymnasium: false,
    versions: &[
        Version::same(3),
        Version::other(4, ANT4).observing(27),
        Version::other(5, ANT5).observing(105).not_paying(1.0),
    ],
    body: Body::Robot(LazyLock::new(|| shipped(include_str!("ant.toml"), MODEL))),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/ant.xml"
));
