//! `mcpo-run schema`.

use std::process::ExitCode;

use super::print;
use crate::spec;

/// Prints the JSON Schema of matrix files.
pub fn run() -> anyhow::Result<ExitCode> {
    print(&format!(
        "{}\n",
        serde_json::to_string_pretty(&spec::schema())?
    ))?;
    Ok(ExitCode::SUCCESS)
}
