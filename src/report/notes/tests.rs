use super::*;
use crate::report::fixture;

#[test]
fn notes_name_budget_readings_and_failures() {
    let runs = [
        fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).failed("out of memory"),
        fixture::ppo("Hopper-v2", 1).finished(&[(100, &[1.0])]),
    ];
    let notes = of_table(&runs.iter().collect::<Vec<_>>(), &[]).join("\n");
    assert!(notes.contains("1 of 2 runs finished."), "{notes}");
    assert!(
        notes.contains("Budget: 100 environment steps; trained for 1.02k to 4.1k"),
        "{notes}"
    );
    assert!(
        notes.contains("Samples of the MMD: MCPO demo_states."),
        "{notes}"
    );
    assert!(
        notes.contains(&format!("Failed: {}: out of memory", runs[0].spec.id)),
        "{notes}"
    );
}

#[test]
fn intervals_of_few_seeds_are_warned_of_though_other_cells_have_many() {
    assert_eq!(few_seeds([10, 15].into_iter()), None);
    assert_eq!(
        few_seeds([0, 0].into_iter()),
        None,
        "there are no intervals"
    );
    assert!(
        few_seeds([0, 3].into_iter())
            .is_some_and(|note| note.starts_with("Fewer than 10 seeds (3)"))
    );
    assert!(
        few_seeds([15, 5].into_iter())
            .is_some_and(|note| note.starts_with("Fewer than 10 seeds (5)"))
    );
}

#[test]
fn finished_seeds_are_counted_not_planned_ones() {
    let runs: Vec<Run> = (0..12)
        .map(|seed| fixture::ppo("Hopper-v2", seed))
        .collect();
    let few = |finished: usize| {
        let ended = |(index, run): (usize, &Run)| match index < finished {
            true => run.clone().finished(&[(100, &[1.0])]),
            false => run.clone(),
        };
        let runs: Vec<Run> = runs.iter().enumerate().map(ended).collect();
        let table = crate::spec::Table {
            name: "t".into(),
            title: "T".into(),
            rows: vec!["env".into()],
            columns: "algorithm".into(),
            only: None,
            reference: Some("table3".into()),
        };
        crate::report::TableData::of_report(&[(&table, runs.iter().collect())])[0]
            .notes
            .join("\n")
    };
    assert!(
        few(3).contains("Fewer than 10 seeds (3)")
            && few(3).contains("best seed is ours of 3 seeds.")
    );
    assert!(few(5).contains("best seed is ours in the same way."));
    assert!(!few(10).contains("Fewer than"), "{}", few(10));
}

#[test]
fn what_was_recorded_otherwise_is_counted_with_its_key() {
    let differs = |changes: &[&str]| {
        let changes = changes.iter().map(|change| (*change).to_owned()).collect();
        Run::new(
            fixture::ppo("Hopper-v2", 0).spec,
            State::Differs { changes },
        )
    };
    let runs = [
        fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])]),
        differs(&["ppo.clip: 0.2 -> 0.9"]),
        differs(&["ppo.clip: 0.2 -> 0.9"]),
        fixture::ppo("Hopper-v2", 1),
    ];
    assert_eq!(
        finished(runs.iter(), 4),
        "1 of 4 runs finished; 2 were recorded with another `ppo.clip`."
    );
    let both = differs(&["ppo.clip: 0.2 -> 0.9", "reward: 1 -> 2"]);
    assert_eq!(
        finished([both].iter(), 1),
        "0 of 1 run finished; 1 was recorded with another `ppo.clip`, `reward`."
    );
}

#[test]
fn demonstrations_without_a_column_are_named() {
    let run = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(100, &[1.0])]);
    assert_eq!(demonstrations(&[&run], true), None, "it is not recorded");
    let (run, other) = (
        run.demonstrated(Some("a"), Some(974.5)),
        fixture::ppo("Ant-v2", 0),
    );
    let told = |compares| demonstrations(&[&run, &other], compares).expect("one is known");
    assert_eq!(
        told(false),
        "Dense return of the demonstration: Hopper-v2 974.50."
    );
    assert_eq!(
        told(true),
        "Dense return of the demonstration: Hopper-v2 974.50 (the paper's 969.71)."
    );
    // A table of one column is a list, which has no such column.
    let notes = |columns| {
        let row = Row {
            labels: vec![],
            values: vec![],
            demo: Some(974.5),
            paper_demo: None,
            cells: vec![None; columns],
        };
        of_table(&[&run], &[row]).join("\n")
    };
    assert!(
        notes(1).contains("Hopper-v2 974.50") && !notes(1).contains("Demo: "),
        "{}",
        notes(1)
    );
    assert!(
        notes(2).contains("Demo: ") && !notes(2).contains("974"),
        "{}",
        notes(2)
    );
}

#[test]
fn steps_are_short() {
    let text: Vec<_> = [7, 999, 20_000, 8_192, 300_000, 3_000_000, 1_500_000]
        .map(steps)
        .into();
    assert_eq!(text, ["7", "999", "20k", "8.19k", "300k", "3M", "1.5M"]);
}
