//! `mcpo-run demo verify FILE --env ENV`.

use std::{path::PathBuf, process::ExitCode};

use super::{super::print, size};
use crate::{
    demo::{At, Demonstration, Tolerance, verify},
    env::EnvId,
    quantity::NonNegative,
};

/// The arguments of `demo verify`.
#[derive(Debug, clap::Args)]
pub struct VerifyArguments {
    /// The demonstration (*.parquet, with poses)
    file: PathBuf,
    /// The environment, such as Hopper-v2, or robot.toml:NAME for a robot of one's own
    #[arg(long, value_name = "ENV", value_parser = super::super::environment::environment)]
    env: EnvId,
    /// The largest deviation of an observation's number or a reward that still counts as agreement
    /// [default: 1e-9; 1e-5 in MountainCar, and 1e-6 for rewards under f32 actions, which Gymnasium
    /// computes in f32]
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = tolerance)]
    tolerance: Option<NonNegative>,
}

fn tolerance(text: &str) -> Result<NonNegative, String> {
    let number: f64 = text
        .parse()
        .map_err(|_| format!("`{text}` is not a number"))?;
    NonNegative::try_from(number).map_err(|error| error.to_string())
}

/// The place of a deviation, as ` in episode 2, step 17`; empty where there is none.
fn place(at: Option<At>) -> String {
    at.map_or_else(String::new, |At { episode, step, .. }| {
        format!(" in episode {episode}, step {step}")
    })
}

/// Replays the demonstration and prints the greatest deviations.
pub fn run(arguments: &VerifyArguments) -> anyhow::Result<ExitCode> {
    let (path, env) = (&arguments.file, arguments.env);
    let demonstration = Demonstration::read(path)?;
    let replay = verify(&demonstration, path, env)?;
    let deviation = replay.deviation;
    let tolerance = arguments.tolerance.map(NonNegative::get).map_or_else(
        || Tolerance::of(&demonstration, env),
        |both| Tolerance {
            observation: both,
            reward: both,
        },
    );
    let agrees = tolerance.holds(&deviation);
    // Where nothing deviates, there is no place of the greatest deviation.
    let reward = deviation.reward.map_or_else(
        || "not recorded".to_owned(),
        |reward| {
            format!(
                "{reward:e}{}",
                place((reward > 0.0).then_some(replay.reward_at))
            )
        },
    );
    let number = replay.observation_at.number;
    let observation_at = match place((deviation.observation > 0.0).then_some(replay.observation_at))
    {
        nowhere if nowhere.is_empty() => nowhere,
        place => format!("{place}, number {number}"),
    };
    // The recording may be of another version of the environment, which is named if it fits.
    let version = replay
        .version(env, &tolerance)
        .filter(|_| !agrees)
        .map_or_else(String::new, |(version, difference)| {
            format!(
                "it deviates as a recording of {}-v{version} does: {difference}\n",
                env.family()
            )
        });
    let verdict = if agrees {
        "agrees with"
    } else {
        "DIFFERS from"
    };
    print(&format!(
        "{file} in {env}: {size}\n\
         greatest deviation of an observation  {observation:e}{observation_at} \
         (tolerance {observation_tolerance:e})\n\
         greatest deviation of a reward        {reward} (tolerance {reward_tolerance:e})\n\
         episodes that end otherwise           {ends}{end_at}\n\
         the replay {verdict} the recording\n{version}",
        file = path.display(),
        size = size(&demonstration),
        observation = deviation.observation,
        observation_tolerance = tolerance.observation,
        reward_tolerance = tolerance.reward,
        ends = deviation.ends,
        end_at = place(replay.end_at),
    ))?;
    Ok(ExitCode::from(if agrees { 0 } else { 4 }))
}
