//! The JSON that rliable and marl-eval read.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value, json};

use super::method;
use crate::report::{curve::mean, recorded::Run, statistics};

/// The score and the return of each seed.
type Seeds = BTreeMap<u64, (f64, f64)>;

/// The JSON for rliable: for each method a matrix of runs by environments,
/// `numpy.array(data["scores"]["mcpo"])`. Rows are the seeds that finished in every environment in
/// which any seed of the method did; the others are named. Scores have the paper's Random at 0 and
/// its Expert at 1, `returns` are as measured.
pub fn rliable(runs: &[Run]) -> Value {
    let mut methods: BTreeMap<&str, BTreeMap<&str, Seeds>> = BTreeMap::new();
    for run in runs {
        let Some(recording) = run.recording() else {
            continue;
        };
        let value = mean(&recording.final_returns());
        // An environment that the paper does not have has no scale for a score.
        let Some(score) = statistics::score(run.spec.env, value) else {
            continue;
        };
        let of_env = methods
            .entry(method(run))
            .or_default()
            .entry(run.spec.env.name())
            .or_default();
        of_env.insert(run.spec.seed.0, (score, value));
    }
    let (mut scores, mut returns, mut tasks) = (Map::new(), Map::new(), Map::new());
    let mut left_out = Vec::new();
    for (name, envs) in methods {
        let all: BTreeSet<u64> = envs
            .values()
            .flat_map(|seeds| seeds.keys().copied())
            .collect();
        // The matrix has no empty cells, so a seed that lacks an environment is left out.
        let (whole, partial): (Vec<u64>, Vec<u64>) = all
            .into_iter()
            .partition(|seed| envs.values().all(|seeds| seeds.contains_key(seed)));
        let matrix = |of: fn(&(f64, f64)) -> f64| -> Vec<Vec<f64>> {
            whole
                .iter()
                .map(|seed| envs.values().map(|seeds| of(&seeds[seed])).collect())
                .collect()
        };
        scores.insert(name.to_owned(), json!(matrix(|pair| pair.0)));
        returns.insert(name.to_owned(), json!(matrix(|pair| pair.1)));
        tasks.insert(name.to_owned(), json!(envs.keys().collect::<Vec<_>>()));
        left_out.extend(
            partial
                .iter()
                .map(|seed| format!("{name}, seed {seed}: not in all environments")),
        );
    }
    json!({"scores": scores, "returns": returns, "environments": tasks, "left_out": left_out})
}

/// For marl-eval: environment, task, algorithm, run, and there each evaluation as a step, the last
/// one as the absolute metrics too.
pub fn marl_eval(experiment: &str, runs: &[Run]) -> Value {
    let mut tasks: Map<String, Value> = Map::new();
    for run in runs {
        let Some(recording) = run.recording() else {
            continue;
        };
        let mut steps: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
        for episode in &recording.evaluations {
            steps
                .entry(episode.env_steps)
                .or_default()
                .push(episode.dense_return);
        }
        let mut own: Map<String, Value> = steps
            .into_iter()
            .enumerate()
            .map(|(index, (env_steps, returns))| {
                let step =
                    json!({"step_count": env_steps, "mean_episode_return": [mean(&returns)]});
                (format!("step_{index}"), step)
            })
            .collect();
        let last = json!({"mean_episode_return": [mean(&recording.final_returns())]});
        own.insert("absolute_metrics".to_owned(), last);
        let task = tasks
            .entry(run.spec.env.name())
            .or_insert_with(|| json!({}));
        if let Some(algorithms) = task.as_object_mut() {
            let seeds = algorithms.entry(method(run)).or_insert_with(|| json!({}));
            seeds[format!("seed_{}", run.spec.seed.0)] = Value::Object(own);
        }
    }
    json!({experiment: tasks})
}
