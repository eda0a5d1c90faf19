//! `mcpo-run demo verify FILE --env ENV`.

use std::{path::PathBuf, process::ExitCode};

use super::{super::print, size};
use crate::{
    demo::{Demonstration, verify},
    env::EnvId,
    quantity::NonNegative,
};

/// Which file, in which environment.
#[derive(Debug, clap::Args)]
pub struct VerifyArguments {
    /// The demonstration (*.parquet, with poses)
    file: PathBuf,
    /// The environment, such as Hopper-v2
    #[arg(long, value_name = "ENV")]
    env: EnvId,
    /// The greatest deviation of an observation's number or a reward that is agreement
    #[arg(long, value_name = "X", default_value = "1e-9", value_parser = tolerance)]
    tolerance: NonNegative,
}

fn tolerance(text: &str) -> Result<NonNegative, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    NonNegative::try_from(number).map_err(|error| error.to_string())
}

/// Replays the demonstration and prints the greatest deviations.
pub fn run(arguments: &VerifyArguments) -> anyhow::Result<ExitCode> {
    let (path, env, tolerance) = (&arguments.file, arguments.env, arguments.tolerance.get());
    let demonstration = Demonstration::read(path)?;
    let deviation = verify(&demonstration, path, env)?;
    let agrees = deviation.observation <= tolerance
        && deviation.reward.is_none_or(|reward| reward <= tolerance)
        && deviation.ends == 0;
    let reward = deviation.reward.map_or_else(|| "not recorded".to_owned(), |reward| format!("{reward:e}"));
    let verdict = if agrees { "agrees with" } else { "DIFFERS from" };
    print(&format!(
        "{file} in {env}: {size}\ngreatest deviation of an observation  {observation:e}\ngreatest deviation of a reward        \
         {reward}\nepisodes that end otherwise           {ends}\nthe replay {verdict} the recording (tolerance {tolerance:e})\n",
        file = path.display(),
        size = size(&demonstration),
        observation = deviation.observation,
        ends = deviation.ends,
    ))?;
    Ok(ExitCode::from(if agrees { 0 } else { 4 }))
}
