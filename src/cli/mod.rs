//! The command line.

/// TODO
pub fn main() -> std::process::ExitCode {
    std::process::ExitCode::SUCCESS
}
