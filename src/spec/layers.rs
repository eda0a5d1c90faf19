//! The layers that make up a specification, weakest first, merged by figment, which is named in
//! this module alone.

use std::collections::BTreeMap;

use figment::{
    Figment,
    providers::{Env, Serialized},
};

use super::catalog::Catalog;

/// Prefix of the environment variables that set keys.
const PREFIX: &str = "MCPO_";

/// Variables that the program reads itself, and that set no key.
const OWN: [&str; 1] = ["results"];

/// The environment variables that set keys, in order of names: the variable, the parts of its key,
/// and its text.
pub(super) fn variables() -> BTreeMap<String, (Vec<String>, String)> {
    let provider = Env::prefixed(PREFIX).split("__");
    let named = provider.iter().map(|(key, text)| {
        let key = key.as_str();
        let name = format!("{PREFIX}{}", key.replace('.', "__").to_uppercase());
        (
            name,
            (key.split('.').map(str::to_owned).collect::<Vec<_>>(), text),
        )
    });
    named
        .filter(|(_, (key, _))| !matches!(key.as_slice(), [own] if OWN.contains(&own.as_str())))
        .collect()
}

/// Merges all layers, key by key; lists and choices are replaced whole.
///
/// A layer wins over every weaker one, whichever table it uses. So a general `budget.env_steps`
/// replaces what weaker layers set under `environments."Ant-v2"`, and `--set` reaches every run.
pub(super) fn merge(layers: impl IntoIterator<Item = toml::Table>) -> toml::Table {
    let mut merged = toml::Table::new();
    for layer in layers {
        shadow(&mut merged, &layer);
        let figment =
            Figment::from(Serialized::defaults(&merged)).merge(Serialized::defaults(&layer));
        merged = figment
            .extract()
            .expect("tables of TOML merge into a table of TOML");
    }
    merged
}

/// Removes from `weaker` the keys of single environments that `stronger` sets for all.
fn shadow(weaker: &mut toml::Table, stronger: &toml::Table) {
    let Some(toml::Value::Table(environments)) = weaker.get_mut("environments") else {
        return;
    };
    let general = stronger.iter().filter(|(key, _)| {
        *key == "algorithms" || Catalog::get().settings.schema(&[key.as_str()]).is_some()
    });
    for (key, value) in general {
        for (_, environment) in environments.iter_mut() {
            if let toml::Value::Table(environment) = environment {
                remove(environment, key, value);
            }
        }
    }
}

/// Removes `key` from `table`; if its value and `value` are both tables, only the keys of `value`.
fn remove(table: &mut toml::Table, key: &str, value: &toml::Value) {
    match (table.get_mut(key), value) {
        (Some(toml::Value::Table(inner)), toml::Value::Table(over)) => {
            over.iter()
                .for_each(|(key, value)| remove(inner, key, value));
        }
        _ => {
            table.remove(key);
        }
    }
}
