use std::path::Path;

use super::*;
use crate::spec::{Overrides, parse};

/// The plan of an experiment whose matrix is `matrix`.
pub(super) fn planned(matrix: &str) -> Vec<RunSpec> {
    let text = format!("name = 'test'\nbudget.env_steps = 100_000\n{matrix}");
    plan(&parse(Path::new("test.toml"), &text, &Overrides::default()).expect("a valid experiment"))
        .expect("a plan")
}

const TWO: &str =
    "[[matrix]]\nseed = [3, 1]\nenv = ['Ant-v2', 'Hopper-v2']\nalgorithm = ['ppo', 'mcpo']\n";

#[test]
fn runs_stand_in_the_order_of_the_file_with_the_seed_innermost() {
    let ids: Vec<String> = planned(&format!("{TWO}epsilon = [0.5, 0]\nd = [1, 2]\n"))
        .into_iter()
        .map(|run| run.id)
        .collect();
    let mut expected = Vec::new();
    for env in ["Ant-v2", "Hopper-v2"] {
        expected.extend([3, 1].map(|seed| format!("{env}/ppo/seed-{seed}")));
        for (epsilon, d) in [("0.5", 1), ("0.5", 2), ("0", 1), ("0", 2)] {
            expected.extend(
                [3, 1].map(|seed| format!("{env}/mcpo-d={d}-epsilon={epsilon}/seed-{seed}")),
            );
        }
    }
    assert_eq!(ids, expected);
}

#[test]
fn a_run_that_two_blocks_name_is_one() {
    let again = "[[matrix]]\nseed = [1, 2]\nenv = ['Ant-v2']\nalgorithm = ['ppo']\n";
    assert_eq!(planned(&format!("{TWO}{again}")).len(), 8 + 1);
    // Table 2's tolerance for Ant, written out, is the run that the first block names.
    let same = "[[matrix]]\nseed = [1]\nenv = ['Ant-v2']\nalgorithm = ['mcpo']\nd = [1e-5, 1e-4]\n";
    let runs = planned(&format!("{TWO}{same}"));
    assert_eq!(runs.len(), 8 + 1);
    assert_eq!(runs[8].id, "Ant-v2/mcpo-d=0.0001/seed-1");
}

#[test]
fn hyperparameters_come_from_the_nearest_that_says_anything() {
    let said = "[algorithms.mcpo]\nd = 0.5\nmax_kl = 0.1\nmmd.samples = 'rollout'\n\
                [environments.Ant-v2.algorithms.mcpo]\nd = 0.25\n\
                [environments.Hopper-v2.algorithms.mcpo]\nd = 0.75\n";
    let runs = planned(&format!("{TWO}max_kl = [0.2]\n{said}"));
    let mcpo = |env| {
        runs.iter()
            .find(|run| run.env == env && run.algorithm_name() == "mcpo")
            .expect("it is planned")
    };
    assert_eq!(
        (mcpo(EnvId::Ant).d(), mcpo(EnvId::Hopper).d()),
        (Some(0.25), Some(0.75))
    );
    assert_eq!(
        mcpo(EnvId::Ant).value("mcpo.max_kl"),
        Some(toml::Value::Float(0.2)),
        "the axis"
    );
    assert_eq!(
        mcpo(EnvId::Ant).value("mmd.samples"),
        Some(toml::Value::String("rollout".into())),
        "the file"
    );
    assert_eq!(
        mcpo(EnvId::Ant).value("mmd.estimator"),
        Some(toml::Value::String("v".into())),
        "the default"
    );
    assert_eq!(mcpo(EnvId::Ant).epsilon(), Some(1e-3), "Table 2");
}

#[test]
fn reports_find_d_and_epsilon_and_labels_on_every_run() {
    let runs = planned(TWO);
    let mcpo = runs
        .iter()
        .find(|run| run.algorithm_name() == "mcpo")
        .expect("it is planned");
    assert_eq!(mcpo.axes.keys().collect::<Vec<_>>(), ["d", "epsilon"]);
    assert_eq!(mcpo.label(), "mcpo d=1e-5 epsilon=0.001");
    assert_eq!(
        mcpo.demonstration.as_deref(),
        Some(Path::new("demos/Ant-v2.parquet"))
    );
    let ppo = &runs[0];
    assert_eq!(
        (ppo.d(), ppo.epsilon(), ppo.label().as_str()),
        (None, None, "ppo")
    );
    assert_eq!(ppo.demonstration, None);
    assert_eq!(ppo.value("mcpo.d"), None);
    assert_eq!(ppo.value("rollout.steps"), Some(toml::Value::Integer(4096)));
}

#[test]
fn the_expert_trains_on_the_dense_reward_whatever_is_said() {
    let runs = planned("[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['expert', 'ppo']\n");
    assert_eq!(runs[0].reward, Reward::Dense);
    assert_eq!(runs[1].reward, EnvId::Ant.sparse_reward());
}

#[test]
fn demonstrations_of_one_file_name_are_told_apart_in_the_names_of_runs() {
    let block = "[[matrix]]\nseed = [0]\nenv = ['Ant-v2']\nalgorithm = ['mcpo']\n";
    let ids = |matrix: &str| {
        planned(matrix)
            .into_iter()
            .map(|run| run.id)
            .collect::<Vec<_>>()
    };
    let apart = ["good_Ant-v2", "poor_Ant-v2"]
        .map(|name| format!("Ant-v2/mcpo-demonstrations={name}/seed-0"));
    assert_eq!(
        ids(&format!(
            "{block}demonstrations = ['good/{{env}}.parquet', 'poor/{{env}}.parquet']\n"
        )),
        apart
    );
    let each = ["good", "poor"]
        .map(|name| format!("{block}demonstrations = ['{name}/{{env}}.parquet']\n"));
    assert_eq!(ids(&each.concat()), apart);
    assert_eq!(ids(&each[0]), ["Ant-v2/mcpo-demonstrations=Ant-v2/seed-0"]);
    let labels: Vec<_> = planned(&each.concat()).iter().map(RunSpec::label).collect();
    assert!(
        labels[0].contains("demonstrations=good/Ant-v2"),
        "{labels:?}"
    );
}

#[test]
fn a_run_comes_back_from_json_as_it_was() {
    for run in planned(&format!(
        "{TWO}reward = ['dense', {{ sparse2 = {{ distance = 2.5 }} }}]\n"
    )) {
        let text = serde_json::to_string(&run).expect("it can be written");
        assert_eq!(
            serde_json::from_str::<RunSpec>(&text).expect("and read"),
            run
        );
    }
}
