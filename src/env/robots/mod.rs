//! The robots that ship: a table and a descriptor each.
//!
//! A table (`hopper.toml`) is of the kind that a user could write; its descriptor holds what only
//! the paper and Gym know of it.

pub(super) mod ant;
pub(super) mod half_cheetah;
pub(super) mod hopper;
pub(super) mod humanoid;
pub(super) mod inverted_double_pendulum;
pub(super) mod inverted_pendulum;
pub(super) mod reacher;
pub(super) mod swimmer;
pub(super) mod walker2d;
