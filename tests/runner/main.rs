//! The runner, by the program itself on small matrices.

mod campaigns;
mod extension;
mod faults;
mod machines;
mod processes;
mod reproduction;
mod sharing;
mod workbench;
