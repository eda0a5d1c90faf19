//! The value of `--env`.

use std::path::Path;

use crate::{
    env::EnvId,
    spec::{self, Overrides},
};

/// The environment that `text` names: one that ships, `Hopper-v2`, or a robot of one's own with the
/// matrix file that describes it, `robot.toml:Sled`.
///
/// # Errors
///
/// There is none of this name, or something is wrong in the file.
pub(super) fn environment(text: &str) -> Result<EnvId, String> {
    let (name, file) = match text.rsplit_once(':') {
        Some((file, name)) if file.ends_with(".toml") => (name, Some(file)),
        _ => (text, None),
    };
    if let Some(file) = file {
        spec::load(Path::new(file), &Overrides::default())
            .map_err(|errors| format!("{file}:\n{errors}"))?;
    }
    name.parse()
        .map_err(|error: crate::env::EnvError| error.to_string())
}
