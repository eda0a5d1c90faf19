//! The command line.

mod demo;
mod report;

/// TODO
pub fn main() -> std::process::ExitCode {
    std::process::ExitCode::SUCCESS
}
