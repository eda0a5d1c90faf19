//! Declarative experiments in reinforcement learning from imperfect demonstrations.
//!
//! A directory of TOML matrices goes in; Parquet results, learning curves and tables come out. The
//! modules are the way of the data:
//!
//! ```text
//! experiments/*.toml -> spec -> plan -> schedule -> train (algo x env x nn x demo) -> record -> report
//!   what is written     typed   runs    processes           one loop               parquet   figures, tables
//! ```
//!
//! MCPO's update, the reason this crate exists, is [`algo::mcpo`]; the quadratic problem inside it
//! is [`solver::dual`]. The environments, the demonstrations, the MMD and the solver can be used
//! without the runner.

pub mod algo;
pub mod arithmetic;
pub mod bench;
pub mod cli;
pub mod demo;
pub mod env;
pub mod escape;
pub mod fit;
mod intake;
pub mod measured;
pub mod nn;
mod parquet;
pub mod plan;
pub mod quantity;
pub mod record;
pub mod report;
pub mod rng;
pub mod schedule;
pub mod solver;
pub mod spec;
pub mod stats;
pub mod train;
