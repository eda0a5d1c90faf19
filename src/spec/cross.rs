//! The check of how values go together, in every combination that a matrix makes.

use std::mem;

use super::{
    Algorithm, Block, ExperimentSpec, Parameter, ResolveError, Settings,
    error::{Place, SpecError},
    source::{AxisList, Source, Step, steps},
};
use crate::env::{EnvId, Reward};

/// No campaign has more runs; a longer list is a slip of the pen.
const MOST_RUNS: usize = 100_000;

/// A specification, with what it was read from.
pub(super) struct Draft<'a> {
    pub(super) spec: &'a ExperimentSpec,
    /// Where each block stands in the file's list.
    pub(super) indices: &'a [usize],
    /// The layers, weakest first.
    pub(super) sources: &'a [Source<'a>],
    /// The lists that replace axes.
    pub(super) axes: &'a [AxisList],
}

/// What does not go together.
struct Conflict {
    message: String,
    label: Option<String>,
    help: Option<String>,
    /// The parameters at fault; the first that is written anywhere is pointed at.
    parameters: Vec<Parameter>,
}

/// What cross-checks find.
#[derive(Default)]
pub(super) struct Findings {
    pub(super) errors: Vec<SpecError>,
    /// Demonstrations that are not there: runs cannot start, though a report can still be drawn.
    pub(super) missing: Vec<SpecError>,
}

impl Draft<'_> {
    /// Everything that does not go together; of several combinations with one fault at one place, the first.
    pub(super) fn check(&self) -> Findings {
        let mut findings = Findings::default();
        let runs = self.spec.matrix.iter().map(Block::size).fold(0, usize::saturating_add);
        if runs > MOST_RUNS {
            let message = format!("the matrix has {runs} runs; {MOST_RUNS} are the most");
            findings.errors.push(self.at_matrix(message));
            return findings;
        }
        for (block, index) in self.spec.matrix.iter().zip(self.indices) {
            for (env, algorithm, axes) in block.combinations() {
                match self.spec.resolve(env, algorithm, &axes) {
                    Ok((settings, algorithm)) => {
                        for conflict in conflicts(env, &settings, &algorithm) {
                            add(&mut findings.errors, self.locate(conflict, *index, block, env, algorithm.name()));
                        }
                        if let Some(conflict) = missing_demonstration(env, &settings, &algorithm) {
                            add(&mut findings.missing, self.locate(conflict, *index, block, env, algorithm.name()));
                        }
                    }
                    Err(error @ ResolveError::NoBudget { .. }) => {
                        // A budget that is written but wrong has its own message.
                        let written = self.sources.iter().any(|source| source.mentions("env_steps"));
                        if !written {
                            let mut error = self.at_start(error.to_string());
                            error.label = Some("write `[budget]` and under it `env_steps = ...`".into());
                            add(&mut findings.errors, error);
                        }
                    }
                    // Values that are wrong by themselves have their own messages; they were left out of the draft.
                    Err(error) => add(&mut findings.errors, self.at_matrix(error.to_string())),
                }
            }
        }
        findings
    }

    /// `message` about the file as a whole.
    pub(super) fn at_start(&self, message: String) -> SpecError {
        let place = match self.sources.iter().rfind(|source| source.layer.path.is_some()) {
            Some(file) => file.layer.place(0..0),
            None => Place::Layer("the specification".into()),
        };
        SpecError { message, place, label: None, help: None }
    }

    fn at_matrix(&self, message: String) -> SpecError {
        let place = self.place(&[Step::Key("matrix".into()), Step::Index(0)]);
        SpecError { place: place.unwrap_or_else(|| self.at_start(String::new()).place), ..self.at_start(message) }
    }

    /// The strongest layer's value at the end of `way`.
    fn place(&self, way: &[Step]) -> Option<Place> {
        self.sources.iter().rev().find_map(|source| Some(source.layer.place(source.span(way)?)))
    }

    fn locate(&self, conflict: Conflict, index: usize, block: &Block, env: EnvId, algorithm: &str) -> SpecError {
        let in_block = |key: &str| {
            let way = [Step::Key("matrix".into()), Step::Index(index)];
            let quoted: Vec<Step> = way.iter().cloned().chain([Step::Key(key.into())]).collect();
            let nested: Vec<Step> = way.iter().cloned().chain(steps(key)).collect();
            match self.axes.iter().find(|axis| axis.key == key) {
                Some(axis) => Some(axis.layer.place(0..0)),
                None => self.place(&quoted).or_else(|| self.place(&nested)),
            }
        };
        let written = |parameter: &Parameter| {
            let same = |key: &str| {
                Parameter::find(key).is_some_and(|axis| {
                    axis == *parameter
                        || axis.hyperparameter_of(algorithm).is_some()
                            && axis.hyperparameter_of(algorithm) == parameter.hyperparameter_of(algorithm)
                })
            };
            let axis = block.axes.iter().find(|(key, _)| same(key)).and_then(|(key, _)| in_block(key));
            axis.or_else(|| {
                let way = match (parameter, parameter.hyperparameter_of(algorithm)) {
                    (Parameter::Setting(key), _) => steps(key),
                    (_, Some(key)) => steps(&format!("algorithms.{algorithm}.{key}")),
                    _ => return None,
                };
                self.sources.iter().rev().find_map(|source| {
                    let span = source.environment_span(env, &way).or_else(|| source.span(&way))?;
                    Some(source.layer.place(span))
                })
            })
        };
        let place = conflict.parameters.iter().find_map(written).or_else(|| in_block("env"));
        let place = place.unwrap_or_else(|| self.at_start(String::new()).place);
        let message = format!("{env}, {algorithm}: {}", conflict.message);
        SpecError { message, place, label: conflict.label, help: conflict.help }
    }
}

/// Adds `error` unless its place has one of the same kind, for another environment or algorithm.
fn add(errors: &mut Vec<SpecError>, error: SpecError) {
    if !errors.iter().any(|known| known.place == error.place && known.label == error.label) {
        errors.push(error);
    }
}

/// What a run of these settings could not do.
fn conflicts(env: EnvId, settings: &Settings, algorithm: &Algorithm) -> Vec<Conflict> {
    let setting = |key: &str| Parameter::Setting(key.into());
    let (steps, environments) = (settings.rollout.steps.get(), settings.rollout.environments.get());
    let budget = settings.budget.env_steps.get();
    let mut conflicts = Vec::new();
    let mut conflict = |message: String, label: &str, parameters: Vec<Parameter>| {
        conflicts.push(Conflict { message, label: Some(label.into()), help: None, parameters });
    };

    let sparse = env.sparse_reward();
    if settings.reward != Reward::Dense && mem::discriminant(&settings.reward) != mem::discriminant(&sparse) {
        conflict(
            "it has no such reward".into(),
            &format!("expected `dense` or {}", reward_name(&sparse)),
            vec![setting("reward")],
        );
    }
    if budget < steps {
        conflict(
            format!("budget.env_steps {budget} is smaller than one rollout, rollout.steps {steps}"),
            "expected at least one rollout",
            vec![setting("budget.env_steps"), setting("rollout.steps")],
        );
    }
    if steps % environments != 0 {
        conflict(
            format!("rollout.steps {steps} cannot be shared among rollout.environments {environments}"),
            "expected a multiple of the environments",
            vec![setting("rollout.steps"), setting("rollout.environments")],
        );
    }
    let minibatch = algorithm.hyperparameters().get("minibatch").and_then(toml::Value::as_integer);
    if let Some(minibatch) = minibatch.and_then(|size| u64::try_from(size).ok()).filter(|size| *size > steps) {
        conflict(
            format!("minibatch {minibatch} is larger than the rollout, rollout.steps {steps}"),
            "expected a minibatch no larger than the rollout",
            vec![Parameter::Shared("minibatch".into()), setting("rollout.steps")],
        );
    }
    conflicts
}

/// The demonstration that a run needs and that is not there.
fn missing_demonstration(env: EnvId, settings: &Settings, algorithm: &Algorithm) -> Option<Conflict> {
    if !algorithm.uses_demonstration() || settings.demonstrations.is_file() {
        return None;
    }
    Some(Conflict {
        message: format!("its demonstration {} is not there", settings.demonstrations.display()),
        label: Some(format!("needs {}", settings.demonstrations.display())),
        help: Some(format!(
            "`mcpo-run demo collect` or `demo import` writes one; `environments.\"{env}\".demonstrations` names another"
        )),
        parameters: vec![Parameter::Setting("demonstrations".into())],
    })
}

/// The tag of a reward.
fn reward_name(reward: &Reward) -> String {
    match toml::Value::try_from(reward) {
        Ok(toml::Value::String(name)) => format!("`{name}`"),
        Ok(toml::Value::Table(table)) => table.keys().map(|key| format!("`{key}`")).collect(),
        _ => String::new(),
    }
}
