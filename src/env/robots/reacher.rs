//! Reacher-v2: an arm of two links in a plane, whose tip is to come to a target.

use std::sync::{LazyLock, OnceLock};

use crate::env::Reward;
use crate::env::catalog::{Body, Descriptor, Version, shipped};

const REACHER5: &str = "v5 observes 10 numbers instead of 11, and pays for the distance after the step instead of before it";

pub(in crate::env) static DESCRIPTOR: Descriptor = Descriptor {
    name: "Reacher-v2",
    paper_name: None,
    max_steps: 50,
    default_reward: || Reward::Sparse1,
    revision: 1,
    microseconds: 20.0,
    is_f32_in_gymnasium: false,
    versions: &[Version::same(4), Version::other(5, REACHER5).observing(10)],
    body: Body::Robot(LazyLock::new(|| {
        shipped(include_str!("reacher.toml"), MODEL)
    })),
    spaces: OnceLock::new(),
};

const MODEL: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/third_party/models/reacher.xml"
));
