//! The expected duration of a run: from recorded speeds where there are any, and otherwise from the
//! costs of physics and networks.

use std::collections::BTreeMap;

use super::state::{Planned, RunState};
use crate::{env::EnvId, plan::RunSpec, record::Manifest};

/// The expected duration of runs.
#[derive(Debug, Clone, Default)]
pub struct CostModel {
    /// Total seconds and work of finished runs, by environment and algorithm.
    recorded: BTreeMap<(EnvId, String), (f64, u64)>,
}

impl CostModel {
    /// The costs by the recorded speeds of the `planned` runs, in these `states`, that have
    /// finished, be it with fewer steps than are planned now.
    pub fn of(planned: &[Planned], states: &[RunState]) -> Self {
        let mut costs = Self::default();
        for (run, state) in planned.iter().zip(states) {
            if let RunState::Finished(manifest)
            | RunState::ToExtend {
                shorter: manifest, ..
            } = state
            {
                costs.learn(&run.spec, manifest);
            }
        }
        costs
    }

    /// Takes a finished run into account.
    fn learn(&mut self, spec: &RunSpec, manifest: &Manifest) {
        let (seconds, work) = self.recorded.entry(key(spec)).or_default();
        *seconds += manifest.seconds;
        *work += if !spec.algorithm.trains() {
            1
        } else {
            manifest.env_steps
        };
    }

    /// The expected seconds of `spec` in one process on one core.
    pub fn seconds(&self, spec: &RunSpec) -> f64 {
        let steps = spec.budget.env_steps.get() as f64;
        match self.recorded.get(&key(spec)) {
            Some(&(seconds, runs)) if !spec.algorithm.trains() => seconds / runs as f64,
            Some(&(seconds, recorded)) if recorded > 0 => steps * seconds / recorded as f64,
            _ if !spec.algorithm.trains() => {
                let longest = spec
                    .evaluation
                    .final_episodes
                    .get()
                    .saturating_mul(spec.max_steps);
                longest as f64 * spec.env.physics_seconds()
            }
            _ => steps * (spec.env.physics_seconds() + network_seconds(spec)),
        }
    }
}

fn key(spec: &RunSpec) -> (EnvId, String) {
    (spec.env, spec.algorithm_name().to_owned())
}

/// Seconds that the networks take for one environment step.
fn network_seconds(spec: &RunSpec) -> f64 {
    let hidden: Vec<f64> = spec
        .network
        .hidden
        .iter()
        .map(|width| width.get() as f64)
        .collect();
    let inside: f64 = hidden.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let outside = 20.0 * hidden.iter().sum::<f64>(); // an input and an output of some 20 numbers
    let operations = 2.0 * (inside + outside) * spec.algorithm.about().passes;
    operations / 1e11 // f32 operations per second on one core
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        quantity::constant,
        schedule::tests::{planned, spec},
        spec::Algorithm,
    };

    #[test]
    fn recorded_speeds_replace_the_guess_for_their_own_kind_of_run() {
        let (mut model, spec) = (CostModel::default(), spec("a", 0));
        let guess = model.seconds(&spec);
        assert!(guess > 0.0);
        let mut manifest = Manifest::new(planned(std::path::Path::new("r"), "a", 0).stamp);
        (manifest.seconds, manifest.env_steps) = (100.0, spec.budget.env_steps.get() / 2);
        model.learn(&spec, &manifest);
        assert!(
            (model.seconds(&spec) - 200.0).abs() < 1e-9,
            "{}",
            model.seconds(&spec)
        );
        let elsewhere = RunSpec {
            env: EnvId::Ant,
            ..spec.clone()
        };
        assert_eq!(
            model.seconds(&elsewhere),
            CostModel::default().seconds(&elsewhere)
        );
    }

    #[test]
    fn the_heavier_task_is_expected_to_take_longer() {
        let model = CostModel::default();
        let on = |env| {
            model.seconds(&RunSpec {
                env,
                ..spec("a", 0)
            })
        };
        assert!(
            on(EnvId::Ant) > on(EnvId::HalfCheetah)
                && on(EnvId::HalfCheetah) > on(EnvId::MountainCar)
        );
    }

    #[test]
    fn runs_without_training_take_as_long_whatever_their_budget() {
        for algorithm in ["random", "bc"] {
            let mut model = CostModel::default();
            let of = |env_steps| {
                let mut spec = spec("a", 0);
                spec.algorithm = Algorithm::defaults(algorithm, spec.env).expect("its name");
                spec.budget.env_steps = constant(env_steps);
                spec
            };
            assert!(model.seconds(&of(1024)) > 0.0);
            assert_eq!(
                model.seconds(&of(1024)),
                model.seconds(&of(1 << 30)),
                "{algorithm}"
            );
            let mut manifest = Manifest::new(planned(std::path::Path::new("r"), "a", 0).stamp);
            manifest.seconds = 3.0;
            model.learn(&of(1024), &manifest);
            assert_eq!(model.seconds(&of(1 << 30)), 3.0, "{algorithm}");
        }
    }
}
