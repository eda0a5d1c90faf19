//! The `mcpo-run` program: see `mcpo-run --help`.

fn main() -> std::process::ExitCode {
    mcpo_run::cli::main()
}
