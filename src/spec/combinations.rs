//! Checks how values go together, in every combination that a matrix makes.

use std::{mem, path::PathBuf};

use super::{
    Algorithm, Axis, Block, ExperimentSpec, Parameter, ResolveError, Settings,
    arguments::AxisList,
    error::{Place, SpecError},
    source::{Source, steps},
};
use crate::{
    env::{EnvId, Reward},
    fit::Step,
};

/// The most runs of a campaign; a longer list is taken for a slip. `plan` shows this many in 1.3 s
/// and 310 MB (AMD EPYC, 2.6 GHz).
const MOST_RUNS: usize = 20_000;

/// The most episodes of an evaluation, which keeps all of them in memory.
const MOST_EPISODES: u64 = 1_000_000;

/// The most steps of a rollout: of Ant's steps, this many fill the memory of a large machine.
const MOST_ROLLOUT_STEPS: u64 = 1 << 26;

/// A specification with its sources.
pub(super) struct Draft<'a> {
    pub(super) spec: &'a ExperimentSpec,
    /// Where each block stands in the file's list.
    pub(super) indices: &'a [usize],
    /// The layers, weakest first.
    pub(super) sources: &'a [Source<'a>],
    /// The lists that replace axes.
    pub(super) axes: &'a [AxisList],
    /// The errors of single values, which are left out of `spec`.
    pub(super) known: &'a [SpecError],
}

/// Settings that do not go together.
struct Conflict {
    message: String,
    label: Option<String>,
    help: Option<String>,
    /// The parameters at fault; the first that is written anywhere is pointed at.
    parameters: Vec<Parameter>,
}

/// The findings of the cross-checks.
#[derive(Default)]
pub(super) struct Findings {
    pub(super) errors: Vec<SpecError>,
    /// Demonstrations that do not exist: runs cannot start, though a report can still be drawn.
    pub(super) missing: Vec<(PathBuf, SpecError)>,
}

impl Draft<'_> {
    /// Finds everything that does not go together.
    /// If several combinations have the same fault at the same place, the first is reported.
    pub(super) fn check(&self) -> Findings {
        let mut findings = Findings {
            errors: self.missing_keys().collect(),
            missing: Vec::new(),
        };
        let runs = self.spec.named_runs();
        if runs > MOST_RUNS {
            let message = format!("the matrix has {runs} runs; at most {MOST_RUNS} are allowed");
            // So many combinations would take too long to check.
            findings.errors.push(self.at_matrix(message));
            return findings;
        }
        findings.errors.extend(self.hidden_arguments());
        for (block, index) in self.spec.matrix.iter().zip(self.indices) {
            for (env, algorithm, axes) in block.combinations() {
                match self.spec.resolve(env, algorithm, &axes) {
                    Ok((settings, algorithm)) => {
                        for conflict in conflicts(env, &settings, &algorithm) {
                            add(
                                &mut findings.errors,
                                self.locate(conflict, *index, block, env, algorithm.name()),
                            );
                        }
                        if let Some(conflict) = missing_demonstration(env, &settings, &algorithm)
                            && !findings
                                .missing
                                .iter()
                                .any(|(path, _)| *path == settings.demonstrations)
                        {
                            let error = self.locate(conflict, *index, block, env, algorithm.name());
                            findings.missing.push((settings.demonstrations, error));
                        }
                    }
                    Err(error @ ResolveError::NoBudget { .. }) => {
                        // A budget that is written but wrong, or under another name, has its own
                        // message.
                        let is_of_budget =
                            |key: &String| ["budget", "env_steps"].contains(&key.as_str());
                        if !self
                            .known
                            .iter()
                            .any(|known| known.about.iter().any(is_of_budget))
                        {
                            let mut error = self.at_start(error.to_string());
                            error.label =
                                Some("write `[budget]` and, under it, `env_steps = ...`".into());
                            add(&mut findings.errors, error);
                        }
                    }
                    // Values that are wrong by themselves have their own messages; they were left
                    // out of the draft.
                    Err(error) => add(&mut findings.errors, self.at_matrix(error.to_string())),
                }
            }
        }
        findings
    }

    /// The errors of required keys that no layer sets.
    fn missing_keys(&self) -> impl Iterator<Item = SpecError> {
        let keys = [
            ("name", "write `name = \"...\"`"),
            ("matrix", "write a `[[matrix]]` block"),
        ];
        let missing = |key: &str| {
            !self
                .sources
                .iter()
                .any(|source| source.tree.get_ref().contains_key(key))
        };
        keys.into_iter()
            .filter(move |(key, _)| missing(key))
            .map(|(key, how)| SpecError {
                label: Some(how.into()),
                ..self.at_start(format!("`{key}` is missing"))
            })
    }

    /// The errors of arguments and variables that set what every block varies: the axis would
    /// silently win.
    fn hidden_arguments(&self) -> Vec<SpecError> {
        let Some((first, others)) = self.spec.matrix.split_first() else {
            return Vec::new();
        };
        let has = |block: &Block, parameter: &Parameter| {
            block.axes.iter().any(|axis| axis.parameter == *parameter)
        };
        let mut errors = Vec::new();
        let everywhere = |axis: &&Axis| others.iter().all(|block| has(block, &axis.parameter));
        for Axis { parameter, .. } in first.axes.iter().filter(everywhere) {
            let ways: Vec<Vec<Step>> = match parameter {
                Parameter::Setting(key) => vec![steps(key)],
                _ => Algorithm::names()
                    .filter_map(|name| {
                        Some(steps(&format!(
                            "algorithms.{name}.{}",
                            parameter.hyperparameter_of(name)?
                        )))
                    })
                    .collect(),
            };
            let arguments = self
                .sources
                .iter()
                .filter(|source| source.layer.path.is_none());
            for source in
                arguments.filter(|source| ways.iter().any(|way| source.span(way).is_some()))
            {
                errors.push(SpecError::new(
                    format!("`{parameter}` is an axis of the matrix, whose values win"),
                    source.layer.place(0..0),
                    Some(format!("`--axis {parameter}=...` replaces its list")),
                ));
            }
        }
        errors
    }

    /// An error with `message` about the file as a whole.
    fn at_start(&self, message: String) -> SpecError {
        let place = match self
            .sources
            .iter()
            .rfind(|source| source.layer.path.is_some())
        {
            Some(file) => file.layer.place(0..0),
            None => Place::Layer("the specification".into()),
        };
        SpecError::new(message, place, None)
    }

    fn at_matrix(&self, message: String) -> SpecError {
        let place = self.place(&[Step::Key("matrix".into()), Step::Index(0)]);
        SpecError {
            place: place.unwrap_or_else(|| self.at_start(String::new()).place),
            ..self.at_start(message)
        }
    }

    /// The place of the strongest layer's value at the end of `way`.
    fn place(&self, way: &[Step]) -> Option<Place> {
        self.sources
            .iter()
            .rev()
            .find_map(|source| Some(source.layer.place(source.span(way)?)))
    }

    fn locate(
        &self,
        conflict: Conflict,
        index: usize,
        block: &Block,
        env: EnvId,
        algorithm: &str,
    ) -> SpecError {
        let in_block = |key: &str| match self.axes.iter().find(|axis| axis.key == key) {
            Some(axis) => Some(axis.layer.place(0..0)),
            None => self.place(&[
                Step::Key("matrix".into()),
                Step::Index(index),
                Step::Key(key.into()),
            ]),
        };
        let written = |parameter: &Parameter| {
            // An axis wins over every layer, so it is looked for first.
            let mut axes = block.axes.iter().map(|axis| &axis.parameter);
            let axis = axes
                .find(|axis| axis.is(parameter, algorithm))
                .and_then(|axis| in_block(&axis.to_string()));
            axis.or_else(|| {
                let way = match (parameter, parameter.hyperparameter_of(algorithm)) {
                    (Parameter::Setting(key), _) => steps(key),
                    (_, Some(key)) => steps(&format!("algorithms.{algorithm}.{key}")),
                    _ => return None,
                };
                self.sources.iter().rev().find_map(|source| {
                    let span = source
                        .environment_span(env, &way)
                        .or_else(|| source.span(&way))?;
                    Some(source.layer.place(span))
                })
            })
        };
        let place = conflict
            .parameters
            .iter()
            .find_map(written)
            // Where nobody wrote it, a default does not fit: the environment is nearest to the
            // cause.
            .or_else(|| in_block("env"));
        let place = place.unwrap_or_else(|| self.at_start(String::new()).place);
        let Conflict {
            message,
            label,
            help,
            ..
        } = conflict;
        SpecError {
            message,
            place,
            label,
            help,
            about: Vec::new(),
        }
    }
}

/// Adds `error` unless its place has one of the same kind, for another environment or algorithm.
fn add(errors: &mut Vec<SpecError>, error: SpecError) {
    if !errors
        .iter()
        .any(|known| known.place == error.place && known.label == error.label)
    {
        errors.push(error);
    }
}

/// The settings that would keep such a run from working.
fn conflicts(env: EnvId, settings: &Settings, algorithm: &Algorithm) -> Vec<Conflict> {
    let setting = |key: &str| Parameter::Setting(key.into());
    let (steps, environments) = (
        settings.rollout.steps.get(),
        settings.rollout.environments.get(),
    );
    let budget = settings.budget.env_steps.get();
    let mut conflicts = Vec::new();
    let mut conflict = |message: String, label: &str, parameters: Vec<Parameter>| {
        let message = format!("{env}, {}: {message}", algorithm.name());
        conflicts.push(Conflict {
            message,
            label: Some(label.into()),
            help: None,
            parameters,
        });
    };

    let sparse = env.sparse_reward();
    // The kind of reward must be the environment's; its thresholds may differ.
    if settings.reward != Reward::Dense
        && mem::discriminant(&settings.reward) != mem::discriminant(&sparse)
    {
        conflict(
            format!(
                "{} is not a reward of this environment",
                reward_name(&settings.reward)
            ),
            &match sparse {
                Reward::Dense => {
                    "expected `dense`; the robot's table names no `landmark`".to_owned()
                }
                _ => format!("expected `dense` or {}", reward_name(&sparse)),
            },
            vec![setting("reward")],
        );
    }
    if steps > MOST_ROLLOUT_STEPS {
        conflict(
            format!("a rollout of {steps} steps does not fit into memory"),
            "expected `rollout.steps` of at most 67108864",
            vec![setting("rollout.steps")],
        );
    }
    for (key, episodes) in [
        ("evaluation.episodes", settings.evaluation.episodes.get()),
        (
            "evaluation.final_episodes",
            settings.evaluation.final_episodes.get(),
        ),
    ] {
        if episodes > MOST_EPISODES {
            conflict(
                format!("{episodes} episodes of one evaluation do not end in time"),
                "expected 1000000 at most",
                vec![setting(key)],
            );
        }
    }
    // Rollouts are whole, so training would go on beyond such a budget.
    if budget < steps {
        conflict(
            format!("budget.env_steps {budget} is smaller than one rollout, rollout.steps {steps}"),
            "expected at least one rollout",
            vec![setting("budget.env_steps"), setting("rollout.steps")],
        );
    }
    if steps % environments != 0 {
        conflict(
            format!(
                "rollout.steps {steps} cannot be shared among rollout.environments {environments}"
            ),
            "expected a multiple of the environments",
            vec![setting("rollout.steps"), setting("rollout.environments")],
        );
    }
    for (key, minibatch) in minibatches(&algorithm.hyperparameters())
        .into_iter()
        .filter(|(_, size)| *size > steps)
    {
        conflict(
            format!("{key} {minibatch} is larger than the rollout, rollout.steps {steps}"),
            "expected a minibatch no larger than the rollout",
            vec![Parameter::Shared(key), setting("rollout.steps")],
        );
    }
    conflicts
}

/// The minibatches that are taken from rollouts, by their dotted keys: those beside a `gae_lambda`,
/// of the policy update that is chosen where there are two.
fn minibatches(hyperparameters: &toml::Table) -> Vec<(String, u64)> {
    let of = |table: &toml::Table| {
        let size = table
            .get("minibatch")
            .filter(|_| table.contains_key("gae_lambda"))?;
        size.as_integer().and_then(|size| u64::try_from(size).ok())
    };
    let chosen = hyperparameters
        .get("policy_update")
        .and_then(toml::Value::as_str);
    let own = of(hyperparameters).map(|size| ("minibatch".to_owned(), size));
    let parts = hyperparameters
        .iter()
        .filter(|(key, _)| chosen.is_none_or(|chosen| *key == chosen))
        .filter_map(|(key, part)| Some((format!("{key}.minibatch"), of(part.as_table()?)?)));
    own.into_iter().chain(parts).collect()
}

/// The error of a demonstration that a run needs and that does not exist.
fn missing_demonstration(
    env: EnvId,
    settings: &Settings,
    algorithm: &Algorithm,
) -> Option<Conflict> {
    if !algorithm.uses_demonstration() || settings.demonstrations.is_file() {
        return None;
    }
    Some(Conflict {
        message: format!(
            "the demonstration {} of {env} does not exist",
            settings.demonstrations.display()
        ),
        label: Some(format!("needs {}", settings.demonstrations.display())),
        help: Some(format!(
            "`mcpo-run demo collect` or `demo import` writes one; \
             `environments.\"{env}\".demonstrations` names another"
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
