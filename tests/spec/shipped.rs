//! What the repository ships: every experiment, and every example of the documentation.

use std::{fs, path::Path};

use mcpo_run::{
    plan::plan,
    spec::{self, Algorithm, Overrides},
};
use serde_json::Value;

#[test]
fn every_shipped_experiment_has_a_plan() {
    let mut found = 0;
    let folders = ["experiments", "experiments/studies"];
    for entry in folders
        .into_iter()
        .flat_map(|folder| fs::read_dir(folder).expect("the folder is there"))
    {
        let path = entry.expect("its entries can be read").path();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let spec =
                spec::load(&path, &Overrides::default()).expect("a shipped experiment is valid");
            assert!(
                !plan(&spec).expect("and has a plan").is_empty(),
                "{}",
                path.display()
            );
            found += 1;
        }
    }
    assert!(found >= 3, "{found} experiments");
}

#[test]
fn the_ablation_is_table_5() {
    let spec = spec::load(
        Path::new("experiments/ablation.toml"),
        &Overrides::default(),
    )
    .expect("it is valid");
    let runs = plan(&spec).expect("it has a plan");
    let rows = [
        (1e0, 0.0),
        (1e-1, 0.0),
        (1e-3, 0.0),
        (1e-6, 0.0),
        (1e-3, 2e-3),
        (1e-3, 1e-3),
        (1e-3, 1e-6),
    ];
    assert_eq!(runs.len(), rows.len() * 5);
    for (d, epsilon) in rows {
        let row = runs
            .iter()
            .filter(|run| run.d() == Some(d) && run.epsilon() == Some(epsilon));
        let seeds: Vec<u64> = row.map(|run| run.seed.0).collect();
        assert_eq!(seeds, [0, 1, 2, 3, 4], "d = {d}, epsilon = {epsilon}");
    }
    assert!(
        runs.iter()
            .all(|run| run.budget.env_steps.get() == 1_000_000)
    );
    assert_eq!(runs[0].id, "HalfCheetah-v2/mcpo-d=1-epsilon=0/seed-0");
}

#[test]
fn every_example_in_the_documentation_is_valid() {
    let text = fs::read_to_string("experiments/format.md").expect("the documentation is there");
    let examples: Vec<&str> = text
        .split("```toml\n")
        .skip(1)
        .filter_map(|rest| rest.split("```").next())
        .collect();
    assert!(examples.len() >= 6, "{} examples", examples.len());
    for example in examples {
        // A fragment shows some tables; what an experiment needs beside them goes around it.
        let mut whole = String::new();
        let mut head = example.lines().take_while(|line| !line.starts_with('['));
        if !head.any(|line| line.starts_with("name")) {
            whole.push_str("name = \"example\"\n");
        }
        let has = |table: &str| example.lines().any(|line| line.starts_with(table));
        let mut after = String::new();
        if !has("[budget]") && !has("extends") {
            after.push_str("\n[budget]\nenv_steps = 100_000\n");
        }
        if !has("[[matrix]]") && !has("extends") {
            after.push_str(
                "\n[[matrix]]\nseed = [0]\nenv = [\"HalfCheetah-v2\"]\nalgorithm = [\"mcpo\"]\n",
            );
        }
        whole.push_str(example);
        whole.push_str(&after);
        spec::parse(
            Path::new("experiments/example.toml"),
            &whole,
            &Overrides::default(),
        )
        .expect("a valid example");
    }
}

#[test]
fn every_key_is_documented() {
    let text = fs::read_to_string("experiments/format.md").expect("the documentation is there");
    let schema = spec::schema();
    let documented = |section: &str, keys: Vec<String>| {
        let heading = format!("\n## {section}");
        let start = text
            .find(&heading)
            .unwrap_or_else(|| panic!("no section {section}"))
            + heading.len();
        let section = text[start..].split("\n## ").next().unwrap_or_default();
        for key in keys {
            // A part that is documented elsewhere has one row: `ppo.*`, or `*` for all of it.
            let part = key
                .split_once('.')
                .map_or("*".to_owned(), |(part, _)| format!("{part}.*"));
            let documented = [key.as_str(), &part, "*"]
                .iter()
                .any(|key| section.contains(&format!("| `{key}` |")));
            assert!(documented, "{key} is not documented");
        }
    };
    for name in Algorithm::names() {
        documented(
            &format!("`[algorithms.{name}]`"),
            leaves(&schema["properties"]["algorithms"]["properties"][name], ""),
        );
    }
    documented("`[slurm]`", leaves(&schema["properties"]["slurm"], ""));
    let own = [
        "name",
        "description",
        "extends",
        "matrix",
        "algorithms",
        "environments",
        "slurm",
    ];
    let lists = ["figures", "tables", "settings", "claims"];
    let all = leaves(&schema, "");
    let setting = |key: &String| {
        let first = key.split('.').next().unwrap_or_default();
        !own.contains(&first) && !lists.contains(&first)
    };
    documented("Settings", all.into_iter().filter(setting).collect());
    for list in lists {
        documented(
            &format!("`[[{list}]]`"),
            leaves(&schema["properties"][list]["items"], ""),
        );
    }
}

/// The dotted keys of all values that `schema` knows.
fn leaves(schema: &Value, prefix: &str) -> Vec<String> {
    let properties = schema["properties"].as_object().into_iter().flatten();
    let leaves = properties.flat_map(|(key, inner)| {
        let path = format!("{prefix}{key}");
        if inner.get("properties").is_some() {
            leaves(inner, &format!("{path}."))
        } else {
            vec![path]
        }
    });
    leaves.collect()
}
