use super::*;
use crate::report::fixture;

fn texts(keys: &[Key], groups: &[Group<'_>]) -> Vec<String> {
    labels(keys, groups)
        .into_iter()
        .map(|label| label.text)
        .collect()
}

#[test]
fn a_value_beside_its_kind_reads_as_words() {
    let value: toml::Table = toml::from_str("bandwidth = { fixed = 1.0 }").expect("TOML");
    assert_eq!(Notation::Digits.label(&value["bandwidth"]), "fixed 1");
    let value: Result<toml::Table, _> =
        toml::from_str("reward = { sparse2 = { distance = 5.0, mode = 'milestone' } }");
    let value = value.expect("TOML");
    assert_eq!(
        Notation::Digits.label(&value["reward"]),
        "SPARSE2 distance 5, mode milestone"
    );
}

#[test]
fn runs_that_differ_in_more_than_the_seed_are_told_apart() {
    let runs = [
        fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0),
        fixture::mcpo("HalfCheetah-v2", 1e-3, 0.0, 0),
        fixture::ppo("HalfCheetah-v2", 0),
    ];
    let runs: Vec<&Run> = runs.iter().collect();
    assert_eq!(
        hidden_axes(&runs, &[Key::Env]),
        [Key::Algorithm, "d".into()]
    );
    assert_eq!(
        hidden_axes(&runs, &[Key::Env, Key::Algorithm, "d".into()]),
        []
    );
}

#[test]
fn an_axis_bound_to_the_environment_is_not_hidden_within_one() {
    let runs = [
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0),
        fixture::mcpo("Ant-v2", 1e-5, 1e-3, 0),
    ];
    let runs: Vec<&Run> = runs.iter().collect();
    assert_eq!(hidden_axes(&runs, &[Key::Env]), []);
}

#[test]
fn the_defaults_of_all_environments_are_one_value_where_none_was_chosen() {
    let relative = |env: &str| {
        fixture::run(
            "mcpo",
            &format!("env = [{env:?}]\nseed = [0]\nd = [{{ relative = 0.01 }}]"),
        )
    };
    let (hopper, ant) = (
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0),
        fixture::mcpo("Ant-v2", 1e-5, 1e-3, 0),
    );
    let keys = [Key::Algorithm, "d".into()];
    let told = |runs: &[&Run], keys: &[Key]| texts(keys, &group(runs, keys));
    let (of_hopper, of_ant) = (relative("Hopper-v2"), relative("Ant-v2"));
    assert_eq!(
        told(&[&hopper, &of_hopper, &ant, &of_ant], &keys),
        ["MCPO", "d = relative 0.01"]
    );
    let rows = [Key::Env, "d".into()];
    assert_eq!(
        group(&[&hopper, &of_hopper, &ant, &of_ant], &rows).len(),
        4,
        "each environment's own, where it is named"
    );
    // Ant's 1e-4 is chosen, and Hopper's the default: they are asked for as one value.
    let (swapped, chosen) = (
        fixture::mcpo("Ant-v2", 1e-4, 1e-3, 0),
        fixture::mcpo("Hopper-v2", 1e-5, 1e-3, 0),
    );
    assert_eq!(
        told(&[&hopper, &chosen, &swapped, &ant], &keys),
        ["d = 10⁻⁴", "d = 10⁻⁵"]
    );
}

#[test]
fn groups_keep_the_order_of_the_plan_and_collect_seeds() {
    let runs = [
        fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0),
        fixture::mcpo("HalfCheetah-v2", 1e-6, 0.0, 0),
        fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 1),
    ];
    let runs: Vec<&Run> = runs.iter().collect();
    let keys = ["d".into(), "epsilon".into()];
    let groups = group(&runs, &keys);
    assert_eq!(
        groups
            .iter()
            .map(|group| group.runs.len())
            .collect::<Vec<_>>(),
        [2, 1]
    );
    assert_eq!(texts(&keys, &groups), ["d = 1", "d = 10⁻⁶"]);
}

#[test]
fn labels_leave_out_an_axis_that_a_run_does_not_have() {
    let runs = [
        fixture::mcpo("Ant-v2", 1e-5, 1e-3, 0),
        fixture::ppo("Ant-v2", 0),
    ];
    let runs: Vec<&Run> = runs.iter().collect();
    let keys = [Key::Algorithm, "epsilon".into()];
    assert_eq!(
        texts(&keys, &group(&runs, &keys)),
        ["MCPO, ε = 10⁻³", "PPO"]
    );
    let only_env = [Key::Env];
    assert_eq!(texts(&only_env, &group(&runs, &only_env)), ["Ant-v2"]);
}

#[test]
fn numbers_of_one_axis_are_short_exact_and_of_one_notation() {
    let labels = |numbers: &[f64]| {
        let values: Vec<toml::Value> = numbers.iter().map(|number| (*number).into()).collect();
        let notation = Notation::of(&values);
        values
            .iter()
            .map(|value| notation.label(value))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        labels(&[0.0, 1.0, 0.1, 15.0, -0.05]),
        ["0", "1", "0.1", "15", "−0.05"]
    );
    assert_eq!(
        labels(&[1.0, 0.1, 1e-3, 0.0, 15.0]),
        ["1", "10⁻¹", "10⁻³", "0", "1.5·10¹"]
    );
    assert_eq!(labels(&[2e-3, -1e-6, 1e6]), ["2·10⁻³", "−10⁻⁶", "10⁶"]);
}
