//! The JSON Schema and the parser, held to each other.

use mcpo_run::{
    env::EnvId,
    quantity::constant,
    spec::{self, Algorithm, Settings},
};
use serde_json::Value;

use super::{LEAST, parse};

/// The names that serde itself knows for the table `path` of `specimen`, from its complaint about a name that it cannot
/// know.
fn fields<T: serde::Serialize + serde::de::DeserializeOwned>(specimen: &T, path: &[&str]) -> Vec<String> {
    let mut whole = toml::Table::try_from(specimen).expect("a specimen is TOML");
    let mut table = &mut whole;
    for key in path {
        table = table.get_mut(*key).and_then(toml::Value::as_table_mut).expect("a table on the way");
    }
    table.insert("no such name".into(), toml::Value::Boolean(true));
    let error = whole.try_into::<T>().err().expect("unknown names are refused").message().to_owned();
    let mut names: Vec<String> = error.split('`').skip(3).step_by(2).map(str::to_owned).collect();
    names.sort();
    names
}

/// The keys that the schema knows at `pointer`.
fn keys(schema: &Value, pointer: &str) -> Vec<String> {
    let table = schema.pointer(pointer).unwrap_or_else(|| panic!("no {pointer} in the schema"));
    assert_eq!(table["additionalProperties"], false, "{pointer} lets unknown keys pass");
    let mut keys: Vec<String> =
        table["properties"].as_object().into_iter().flatten().map(|(key, _)| key.clone()).collect();
    keys.sort();
    keys
}

#[test]
fn the_schema_knows_the_settings_that_serde_knows() {
    let schema = spec::schema();
    let settings = Settings::for_env(EnvId::Ant, constant(1));
    for table in ["budget", "rollout", "evaluation", "network", "checkpoint"] {
        assert_eq!(keys(&schema, &format!("/properties/{table}")), fields(&settings, &[table]), "{table}");
    }
    let root = keys(&schema, "");
    for key in fields(&settings, &[]) {
        assert!(root.contains(&key), "{key}");
    }
}

#[test]
fn the_schema_knows_the_hyperparameters_that_serde_knows() {
    let schema = spec::schema();
    for name in Algorithm::names() {
        let algorithm = Algorithm::defaults(name, EnvId::Ant).expect("a registered name");
        assert_eq!(keys(&schema, &format!("/properties/algorithms/properties/{name}")), fields(&algorithm, &[name]));
    }
    let mcpo = Algorithm::defaults("mcpo", EnvId::Ant).expect("a registered name");
    let mmd = "/properties/algorithms/properties/mcpo/properties/mmd";
    assert_eq!(keys(&schema, mmd), fields(&mcpo, &["mcpo", "mmd"]));
}

/// A key with a value that its type allows, in TOML: its own default, or one for a type that has none.
fn example(schema: &Value) -> &'static str {
    if let Some(choices) = schema.get("enum").or_else(|| schema.get("oneOf")).and_then(Value::as_array) {
        let first =
            choices[0].as_str().or_else(|| choices[0]["enum"][0].as_str()).or_else(|| choices[0]["const"].as_str());
        return match first {
            Some("dense") => "\"dense\"",
            Some("mcpo") => "\"mcpo\"",
            Some("demo_states") => "\"demo_states\"",
            Some("v") => "\"v\"",
            _ => "\"median\"",
        };
    }
    let kind = schema["type"].as_str().or_else(|| schema["type"][0].as_str());
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
            assert!(errors.iter().all(|error| !error.message.contains("unknown")), "{key}: {errors}");
        }
    }
    let refused = parse(&format!("{LEAST}\"no such name\" = [1]\n")).expect_err("no schema knows it");
    assert!(refused.iter().all(|error| error.message.contains("unknown axis")), "{refused}");
}

#[test]
fn every_key_of_the_shipped_experiments_is_in_the_schema() {
    let schema = spec::schema();
    for name in ["ablation", "smoke", "demos"] {
        let text = std::fs::read_to_string(format!("experiments/{name}.toml")).expect("it is there");
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
        toml::Value::Array(values) => values.iter().for_each(|value| known(&schema["items"], value, path)),
        _ => {}
    }
}
