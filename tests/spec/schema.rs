//! The JSON Schema and the parser, held to each other.

use mcpo_run::{
    env::EnvId,
    fit::{self, Fault, Mistake},
    quantity::constant,
    spec::{self, Algorithm, Settings},
};
use serde_json::Value;

use super::{LEAST, parse};

/// The names that serde itself knows for the table `path` of a type, from its complaint about a
/// name that it cannot know; `read` reads the type, and `whole` is a value of it.
fn fields<T>(
    mut whole: toml::Table,
    path: &[&str],
    read: impl FnOnce(toml::Table) -> Result<T, Mistake>,
) -> Vec<String> {
    let mut table = &mut whole;
    for key in path {
        table = table
            .get_mut(*key)
            .and_then(toml::Value::as_table_mut)
            .expect("a table on the way");
    }
    table.insert("no such name".into(), toml::Value::Boolean(true));
    let mistake = read(whole).err().expect("unknown names are refused");
    let Fault::UnknownKey { known, .. } = mistake.fault else {
        panic!("{mistake}");
    };
    let mut names: Vec<String> = known.iter().map(|name| (*name).to_owned()).collect();
    names.sort();
    names
}

/// The keys that the schema knows at `pointer`.
fn keys(schema: &Value, pointer: &str) -> Vec<String> {
    let table = schema
        .pointer(pointer)
        .unwrap_or_else(|| panic!("no {pointer} in the schema"));
    assert_eq!(
        table["additionalProperties"], false,
        "{pointer} lets unknown keys pass"
    );
    let mut keys: Vec<String> = table["properties"]
        .as_object()
        .into_iter()
        .flatten()
        .map(|(key, _)| key.clone())
        .collect();
    keys.sort();
    keys
}

#[test]
fn the_schema_knows_the_settings_that_serde_knows() {
    let schema = spec::schema();
    let settings = Settings::defaults(EnvId::Ant, "ppo", constant(1));
    let settings = toml::Table::try_from(settings).expect("settings are TOML");
    let read = |table: toml::Table| fit::read::<Settings>(table.into());
    for table in ["budget", "rollout", "evaluation", "network", "checkpoint"] {
        assert_eq!(
            keys(&schema, &format!("/properties/{table}")),
            fields(settings.clone(), &[table], read),
            "{table}"
        );
    }
    let root = keys(&schema, "");
    for key in fields(settings.clone(), &[], read) {
        assert!(root.contains(&key), "{key}");
    }
}

/// Those of `keys` that serde knows among the hyperparameters of `algorithm`, whatever it says of a
/// value that fits none of them. Where structs share fields, it does not list the names it knows.
fn known_to_serde<'a>(
    algorithm: &Algorithm,
    keys: impl Iterator<Item = &'a String>,
) -> Vec<&'a String> {
    let is_known = |key: &&String| {
        let mut table = algorithm.hyperparameters();
        table.insert((*key).clone(), toml::Value::Array(Vec::new()));
        let read = Algorithm::from_hyperparameters(algorithm.name(), table).expect("it is known");
        let mistake = read.expect_err("no value is an empty list");
        // Serde's flattened structs object in words of their own.
        !matches!(mistake.fault, Fault::UnknownKey { .. })
            && !mistake.to_string().contains("unknown field")
    };
    keys.filter(is_known).collect()
}

#[test]
fn the_schema_knows_the_hyperparameters_that_serde_knows() {
    let schema = spec::schema();
    for name in Algorithm::names() {
        let algorithm = Algorithm::defaults(name, EnvId::Ant).expect("a registered name");
        let in_schema = keys(
            &schema,
            &format!("/properties/algorithms/properties/{name}"),
        );
        let other = "no such name".to_owned();
        assert_eq!(
            known_to_serde(&algorithm, in_schema.iter().chain([&other])),
            in_schema.iter().collect::<Vec<_>>(),
            "{name}"
        );
        let written = algorithm.hyperparameters();
        assert!(
            written.keys().all(|key| in_schema.contains(key)),
            "{name}: {written}"
        );
    }
    let mcpo = Algorithm::defaults("mcpo", EnvId::Ant).expect("a registered name");
    let mmd = "/properties/algorithms/properties/mcpo/properties/mmd";
    let read = |table| Algorithm::from_hyperparameters("mcpo", table).expect("it is known");
    assert_eq!(
        keys(&schema, mmd),
        fields(mcpo.hyperparameters(), &["mmd"], read)
    );
}

/// A key with a value that its type allows, in TOML: its own default, or one for a type that has
/// none.
fn example(schema: &Value) -> &'static str {
    if let Some(choices) = schema
        .get("enum")
        .or_else(|| schema.get("oneOf"))
        .and_then(Value::as_array)
    {
        let first = choices[0]
            .as_str()
            .or_else(|| choices[0]["enum"][0].as_str())
            .or_else(|| choices[0]["const"].as_str());
        return match first {
            Some("dense") => "\"dense\"",
            Some("mcpo") => "\"mcpo\"",
            Some("demo_states") => "\"demo_states\"",
            Some("v") => "\"v\"",
            _ => "\"median\"",
        };
    }
    let kind = schema["type"]
        .as_str()
        .or_else(|| schema["type"][0].as_str());
    match kind.unwrap_or_default() {
        "integer" => "8",
        "number" => "0.5",
        "boolean" => "true",
        "array" => "[8]",
        _ => "\"x\"",
    }
}

#[test]
fn the_parser_knows_every_axis_of_the_schema() {
    let schema = spec::schema();
    let block = &schema["properties"]["matrix"]["items"];
    for (key, list) in block["properties"].as_object().into_iter().flatten() {
        if ["seed", "env", "algorithm"].contains(&key.as_str()) {
            continue;
        }
        let text = format!("{LEAST}\"{key}\" = [{}]\n", example(&list["items"]));
        if let Err(errors) = parse(&text) {
            // The value may not go together with others; the key is known all the same.
            assert!(
                errors
                    .iter()
                    .all(|error| !error.message.contains("unknown")),
                "{key}: {errors}"
            );
        }
    }
    let refused =
        parse(&format!("{LEAST}\"no such name\" = [1]\n")).expect_err("no schema knows it");
    assert!(
        refused
            .iter()
            .all(|error| error.message.contains("unknown axis")),
        "{refused}"
    );
}

#[test]
fn every_key_of_the_shipped_experiments_is_in_the_schema() {
    let schema = spec::schema();
    for name in ["ablation", "comparison", "smoke", "demos"] {
        let text =
            std::fs::read_to_string(format!("experiments/{name}.toml")).expect("it is there");
        let table: toml::Table = toml::from_str(&text).expect("it is TOML");
        known(&schema, &toml::Value::Table(table), name);
    }
}

fn known(schema: &Value, value: &toml::Value, path: &str) {
    match value {
        toml::Value::Table(table) if schema.get("properties").is_some() => {
            for (key, value) in table {
                let inner = schema["properties"].get(key);
                known(
                    inner.unwrap_or_else(|| panic!("{path}.{key} is not in the schema")),
                    value,
                    &format!("{path}.{key}"),
                );
            }
        }
        toml::Value::Array(values) => values
            .iter()
            .for_each(|value| known(&schema["items"], value, path)),
        _ => {}
    }
}

/// Why `value` is not what `schema` allows, by the keywords that the schema uses; any other is an
/// error of the test.
fn flaw(schema: &Value, value: &Value) -> Option<String> {
    const ANNOTATIONS: [&str; 8] = [
        "description",
        "title",
        "default",
        "$schema",
        "format",
        "items",
        "additionalProperties",
        "patternProperties",
    ];
    if *schema == Value::Bool(false) {
        return Some(format!("{value} may not stand here"));
    }
    let fields = schema.as_object()?;
    let is = |kind: &str| match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        other => panic!("the type {other}"),
    };
    let names = |list: &Value| {
        list.as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    fields
        .iter()
        .find_map(|(keyword, rule)| {
            let number = value.as_f64().zip(rule.as_f64());
            let broken = match keyword.as_str() {
                "type" => !rule
                    .as_str()
                    .map_or_else(|| names(rule).iter().any(|kind| is(kind)), is),
                "enum" => !rule.as_array()?.contains(value),
                "const" => rule != value,
                "minimum" => number.is_some_and(|(value, limit)| value < limit),
                "maximum" => number.is_some_and(|(value, limit)| value > limit),
                "exclusiveMinimum" => number.is_some_and(|(value, limit)| value <= limit),
                "exclusiveMaximum" => number.is_some_and(|(value, limit)| value >= limit),
                "minItems" => value
                    .as_array()
                    .is_some_and(|list| (list.len() as u64) < rule.as_u64().unwrap_or(0)),
                "uniqueItems" => value.as_array().is_some_and(|list| {
                    list.iter()
                        .enumerate()
                        .any(|(i, one)| list[..i].contains(one))
                }),
                "required" => {
                    value.is_object() && names(rule).iter().any(|key| value.get(key).is_none())
                }
                "pattern"
                    if rule
                        .as_str()
                        .is_some_and(|pattern| pattern.contains("-v[0-9]")) =>
                {
                    value.as_str().is_some_and(has_version)
                }
                "pattern" => value.as_str().is_some_and(|text| {
                    text.contains('/') || text.starts_with('.') || text.is_empty()
                }),
                "oneOf" => {
                    rule.as_array()?
                        .iter()
                        .filter(|choice| flaw(choice, value).is_none())
                        .count()
                        != 1
                }
                "anyOf" => rule
                    .as_array()?
                    .iter()
                    .all(|choice| flaw(choice, value).is_some()),
                "properties" => {
                    let of = |(key, value): (&String, &Value)| {
                        flaw(rule.get(key)?, value).map(|flaw| format!("{key}: {flaw}"))
                    };
                    return value.as_object()?.iter().find_map(of);
                }
                known if ANNOTATIONS.contains(&known) => false,
                other => panic!("the keyword {other}"),
            };
            broken.then(|| format!("{value} breaks {keyword} {rule}"))
        })
        .or_else(|| {
            let list = value.as_array().zip(schema.get("items"));
            list.and_then(|(list, items)| list.iter().find_map(|value| flaw(items, value)))
        })
        .or_else(|| {
            let closed = schema["additionalProperties"] == false;
            let unknown = |(key, value): (&String, &Value)| {
                let named = schema["patternProperties"]
                    .as_object()
                    .and_then(|patterns| patterns.values().next());
                match named.filter(|_| !has_version(key)) {
                    _ if !closed || schema["properties"].get(key).is_some() => None,
                    Some(named) => flaw(named, value),
                    None => Some(format!("unknown {key}")),
                }
            };
            value.as_object()?.iter().find_map(unknown)
        })
}

/// Whether `name` ends in a Gym version.
fn has_version(name: &str) -> bool {
    name.rsplit_once("-v")
        .is_some_and(|(_, number)| number.parse::<u32>().is_ok())
}

/// Mistakes that only the whole of a file shows, or that are no matter of types.
const BEYOND_A_SCHEMA: [&str; 23] = [
    "too_many_episodes",
    "names_of_other_files",
    "claim_of_a_demonstrations_column",
    "claim_of_unknown_runs",
    "claim_with_a_margin_that_is_none",
    "axis_given_twice",
    "axis_that_no_algorithm_has",
    "budget_below_one_rollout",
    "environment_twice",
    "extends_a_folder",
    "extends_a_missing_file",
    "extends_itself",
    "figure_of_unknown_runs",
    "minibatch_above_the_rollout",
    "missing_budget",
    "reward_of_another_environment",
    "rollout_that_does_not_divide",
    "selection_without_a_value",
    "two_figures_of_one_name",
    "nothing",
    "dates",
    "number_that_is_none",
    "extends_in_a_circle",
];

#[test]
fn an_editor_finds_what_the_parser_finds() {
    let schema = spec::schema();
    let json = |text: &str| {
        toml::from_str::<toml::Table>(text)
            .ok()
            .and_then(|table| serde_json::to_value(table).ok())
    };
    let mut found = 0;
    for (name, _) in super::mistakes_are_told::MISTAKES
        .iter()
        .filter(|(name, _)| !BEYOND_A_SCHEMA.contains(name))
    {
        let text = std::fs::read_to_string(format!("tests/spec/mistakes/{name}.toml"))
            .expect("it is there");
        // What is not TOML, an editor finds without a schema.
        let Some(value) = json(&text) else { continue };
        assert!(
            flaw(&schema, &value).is_some(),
            "{name}: the schema allows it"
        );
        found += 1;
    }
    assert!(found >= 35, "{found}");
    for name in ["ablation", "ci", "comparison", "demos", "smoke"] {
        let text =
            std::fs::read_to_string(format!("experiments/{name}.toml")).expect("it is there");
        assert_eq!(flaw(&schema, &json(&text).expect("TOML")), None, "{name}");
    }
    let own = std::fs::read_to_string("examples/robot/robot.toml").expect("it is there");
    assert_eq!(flaw(&schema, &json(&own).expect("TOML")), None);
    for (from, to) in [
        ("frame_skip", "frame_skpi"),
        ("clip = 10", "clip = -1"),
        ("alive = 1.0", "alife = 1.0"),
    ] {
        assert!(
            flaw(&schema, &json(&own.replace(from, to)).expect("TOML")).is_some(),
            "{to}"
        );
    }
    for (line, allowed) in [
        ("env = [\"Pendulum-v2\"]\nalgorithm = [\"ppo\"]", true),
        ("env = [\"Humanoid-v4\"]\nalgorithm = [\"ppo\"]", false),
        ("env = [\"Ant-v2\"]\nalgorithm = [\"sac\"]", false),
        ("env = [\"Ant-v2\"]\nalgorithm = [\"mcpo\"]\nd = [0]", false),
        (
            "env = [\"Ant-v2\"]\nalgorithm = [\"mcpo\"]\n\"mcpo.discount\" = [1.0]",
            false,
        ),
        (
            "env = [\"Ant-v2\"]\nalgorithm = [\"mcpo\"]\n\"mmd.bandwidth\" = [{ fixed = -1 }]",
            false,
        ),
        (
            "env = [\"Ant-v2\"]\nalgorithm = [\"mcpo\"]\n\"rollout.steps\" = [0]",
            false,
        ),
    ] {
        let text =
            format!("name = \"x\"\nbudget.env_steps = 100_000\n[[matrix]]\nseed = [0]\n{line}\n");
        assert_eq!(
            flaw(&schema, &json(&text).expect("TOML")).is_none(),
            allowed,
            "{line}"
        );
        assert_eq!(parse(&text).is_ok(), allowed, "{line}");
    }
}
