//! Runs that take no training steps: behaviour cloning alone, and uniform actions.

use super::{
    Ending, RunSink, TrainError, build,
    evaluate::{self, Actor, Evaluation},
};
use crate::{algo::Agent, plan::RunSpec, rng::Stream};

/// Evaluates the outcome of `spec`: `agent`, or uniform actions without one.
/// That takes seconds, so there is no checkpoint.
///
/// # Errors
///
/// The environment cannot be built, the physics failed, or the sink failed.
///
/// The environment cannot be built, the physics failed, or the sink failed.
pub fn run(
    spec: &RunSpec,
    agent: Option<&Agent>,
    sink: &mut dyn RunSink,
) -> Result<Ending, TrainError> {
    let mut tasks = build::tasks(spec, spec.rollout.environments.size())?;
    let mut uniform = spec.seed.stream(Stream::Action, 0);
    let mut actor = agent.map_or(Actor::Uniform(&mut uniform), Actor::MeanAction);
    let count = spec.evaluation.final_episodes.get();
    let due = Evaluation {
        seed: spec.seed,
        index: evaluate::LAST,
        env_steps: 0,
        count,
        last: true,
    };
    let episodes = evaluate::evaluation(&mut actor, &mut tasks, due, &mut || sink.alive())?;
    sink.evaluation(&episodes)?;
    if let Some(agent) = agent {
        sink.policy(0, true, agent)?;
    }
    Ok(Ending::Finished)
}
