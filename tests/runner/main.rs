//! The runner, by the program itself on small matrices.

mod campaigns;
mod extension;
mod faults;
mod reproduction;
mod sharing;
mod workbench;
