//! The value of the paper, if any, that runs can be compared with.
//!
//! Owns that rule. Knows nothing of intervals or verdicts. Start at [`PaperSide::of`].
//!
//! The paper's value belongs to the paper's setting, and that is the default of every parameter, as
//! far as we know it: the paper's tables, and our readings where it is silent
//! (`experiments/method.md`). So the paper's value stands beside runs where every parameter that
//! decides what is learned is at its default: the algorithm's hyperparameters, the reward, the time
//! limit, the networks and the rollouts. The length of a run does not count here, since verdicts
//! account for it; nor do evaluations, checkpoints, or the demonstration, which is never the
//! paper's. In the ablation, d and epsilon are Table 5's.

use std::collections::BTreeSet;

use super::{
    recorded::Run,
    reference::{self, PaperValue},
};

/// The paper's side of runs that differ in their seeds alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PaperSide {
    /// The paper's value; `None` where it has none for these runs.
    pub value: Option<PaperValue>,
    /// The parameters that differ from the paper's, where it has a value for the algorithm. If
    /// there are any, `value` is `None`.
    pub departures: BTreeSet<String>,
}

impl PaperSide {
    /// The paper's side of `runs`.
    ///
    /// Where `ablation` is asked for, MCPO in Table 5's environment gets Table 5's value for its d
    /// and epsilon. All other runs get the value of Tables 3 and 4. The caller has to choose
    /// because the paper's tables disagree about the one setting that both have.
    pub fn of(runs: &[&Run], ablation: bool) -> Self {
        let Some(spec) = runs.first().map(|run| &run.spec) else {
            return Self::default();
        };
        let (env, algorithm) = (spec.env.name(), spec.algorithm_name());
        let of_ablation = ablation && env == reference::ABLATION_ENV && algorithm == "mcpo";
        let value = if of_ablation {
            spec.d()
                .zip(spec.epsilon())
                .and_then(|(d, epsilon)| reference::ablation(d, epsilon))
        } else {
            reference::returns(env).and_then(|row| row.of(algorithm))
        };
        if value.is_none() {
            return Self::default();
        }
        let own =
            |key: &&String| !(of_ablation && ["mcpo.d", "mcpo.epsilon"].contains(&key.as_str()));
        let departures: BTreeSet<String> = runs
            .iter()
            .flat_map(|run| run.departures())
            .filter(own)
            .cloned()
            .collect();
        Self {
            value: value.filter(|_| departures.is_empty()),
            departures,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{env::EnvId, report::fixture};

    fn value(run: &Run, ablation: bool) -> Option<f64> {
        PaperSide::of(&[run], ablation)
            .value
            .map(|value| value.mean)
    }

    #[test]
    fn runs_that_depart_from_the_defaults_have_none() {
        let mmd_il = |more: &str| {
            fixture::run(
                "mmd_il",
                &format!("env = [\"Hopper-v2\"]\nseed = [0]\n{more}"),
            )
        };
        assert_eq!(value(&mmd_il(""), false), Some(118.66));
        for (more, departures) in [
            (
                "\"mmd.bandwidth\" = [\"median\"]",
                &["mmd_il.mmd.bandwidth"][..],
            ),
            (
                "\"mmd.samples\" = [\"demo_states\"]\n\"mmd_il.trpo.max_kl\" = [0.1]",
                &["mmd_il.mmd.samples", "mmd_il.trpo.max_kl"],
            ),
            ("\"network.hidden\" = [[64, 64]]", &["network.hidden"]),
            ("\"evaluation.episodes\" = [7]", &[]),
        ] {
            let (run, other) = (mmd_il(more), mmd_il(""));
            let side = PaperSide::of(&[&other, &run], false);
            assert_eq!(
                side.departures.iter().collect::<Vec<_>>(),
                departures,
                "{more}"
            );
            assert_eq!(side.value.is_some(), departures.is_empty(), "{more}");
        }
        let trpo = fixture::run("trpo", "env = [\"Hopper-v2\"]\nseed = [0]\nmax_kl = [0.1]");
        assert_eq!(
            PaperSide::of(&[&trpo], false),
            PaperSide::default(),
            "the paper has no TRPO"
        );
    }

    #[test]
    fn the_default_constraint_is_table_2s() {
        for env in EnvId::ALL {
            let spec = fixture::run("mcpo", &format!("env = [\"{env}\"]\nseed = [0]")).spec;
            let table2 = reference::constraint(env.name()).expect("a row");
            assert_eq!(
                (spec.d(), spec.epsilon()),
                (Some(table2.d), Some(table2.epsilon)),
                "{env}"
            );
        }
    }

    #[test]
    fn table_5_is_the_reference_of_an_ablation_and_table_3_of_a_comparison() {
        let run = fixture::mcpo("HalfCheetah-v2", 1e-3, 1e-3, 0);
        assert_eq!(
            (value(&run, true), value(&run, false)),
            (Some(3286.78), Some(3541.23))
        );
        assert_eq!(
            value(&fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0), true),
            Some(-586.52)
        );
        assert_eq!(
            value(&fixture::mcpo("HalfCheetah-v2", 1e-2, 0.0, 0), true),
            None,
            "Table 5 has no such row"
        );
        assert_eq!(
            value(&fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0), false),
            None
        );
        let axes =
            "env = [\"HalfCheetah-v2\"]\nseed = [0]\nd = [1.0]\nepsilon = [0.0]\nmax_kl = [0.1]";
        let side = PaperSide::of(&[&fixture::run("mcpo", axes)], true);
        assert_eq!(
            (side.value, side.departures),
            (None, ["mcpo.max_kl".to_owned()].into())
        );
    }
}
