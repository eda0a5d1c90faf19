//! `mcpo-run demo verify FILE --env ENV`.

use std::{path::PathBuf, process::ExitCode};

use super::{super::print, size};
use crate::{
    demo::{Demonstration, Tolerance, verify},
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
    /// The greatest deviation of an observation's number or a reward that is agreement [default: 1e-9; 1e-5 in
    /// MountainCar, and 1e-6 for rewards under f32 actions, which Gymnasium computes in f32]
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = tolerance)]
    tolerance: Option<NonNegative>,
}

fn tolerance(text: &str) -> Result<NonNegative, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    NonNegative::try_from(number).map_err(|error| error.to_string())
}

/// Replays the demonstration and prints the greatest deviations.
pub fn run(arguments: &VerifyArguments) -> anyhow::Result<ExitCode> {
    let (path, env) = (&arguments.file, arguments.env);
    let demonstration = Demonstration::read(path)?;
    let deviation = verify(&demonstration, path, env)?;
    let tolerance = arguments
        .tolerance
        .map(NonNegative::get)
        .map_or_else(|| Tolerance::of(&demonstration, env), |both| Tolerance { observation: both, reward: both });
    let agrees = tolerance.holds(&deviation);
    let reward = deviation.reward.map_or_else(|| "not recorded".to_owned(), |reward| format!("{reward:e}"));
    let verdict = if agrees { "agrees with" } else { "DIFFERS from" };
    print(&format!(
        "{file} in {env}: {size}\n\
         greatest deviation of an observation  {observation:e} (tolerance {observation_tolerance:e})\n\
         greatest deviation of a reward        {reward} (tolerance {reward_tolerance:e})\n\
         episodes that end otherwise           {ends}\n\
         the replay {verdict} the recording\n",
        file = path.display(),
        size = size(&demonstration),
        observation = deviation.observation,
        observation_tolerance = tolerance.observation,
        reward_tolerance = tolerance.reward,
        ends = deviation.ends,
    ))?;
    Ok(ExitCode::from(if agrees { 0 } else { 4 }))
}
