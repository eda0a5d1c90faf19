//! The value of `--env`.

use std::path::PathBuf;

use crate::{
    env::EnvId,
    spec::{self, Overrides},
};

/// An environment as the command line names it.
#[derive(Debug, Clone)]
pub(super) struct Named {
    /// The environment.
    pub(super) env: EnvId,
    /// The matrix file that describes it, for a user's robot.
    pub(super) file: Option<PathBuf>,
}

/// The environment that `text` names: one that ships, `Hopper-v2`, or a robot of one's own with the
/// matrix file that describes it, `robot.toml:Sled`.
///
/// # Errors
///
/// There is none of this name, or something is wrong in the file.
pub(super) fn named(text: &str) -> Result<Named, String> {
    let (name, file) = match text.rsplit_once(':') {
        Some((file, name)) if file.ends_with(".toml") => (name, Some(PathBuf::from(file))),
        _ => (text, None),
    };
    if let Some(file) = &file {
        spec::load(file, &Overrides::default())
            .map_err(|errors| format!("{}:\n{errors}", file.display()))?;
    }
    let env = name
        .parse()
        .map_err(|error: crate::env::EnvError| error.to_string())?;
    Ok(Named { env, file })
}

/// The same without the file.
///
/// # Errors
///
/// As for [`named`].
pub(super) fn environment(text: &str) -> Result<EnvId, String> {
    named(text).map(|named| named.env)
}
