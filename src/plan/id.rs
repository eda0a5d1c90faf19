//! The names of runs: readable, and safe as the names of folders.

use std::{collections::BTreeMap, path::Path};

use toml::Value;

/// Longer names are cut, and told apart by a digest.
const LONGEST: usize = 120;

/// The name of the folder of `algorithm` under `axes`: `mcpo-d=0.001-epsilon=0`.
pub(super) fn folder(algorithm: &str, axes: &BTreeMap<String, Value>) -> String {
    let prefix = format!("{algorithm}.");
    let axes = axes
        .iter()
        .map(|(key, value)| format!("-{}={}", key.strip_prefix(&prefix).unwrap_or(key), safe(&short(key, value))));
    let name: String = std::iter::once(algorithm.to_owned()).chain(axes).collect();
    if name.len() <= LONGEST {
        return name;
    }
    let digest = blake3::hash(name.as_bytes()).to_hex();
    format!("{}-{}", &name[..LONGEST - 17], &digest[..16])
}

/// The value of the axis `key` in few characters: `0.001`, `1e-6`, `0` for `0.0`, `300x400`, `sparse2-15`.
pub(super) fn short(key: &str, value: &Value) -> String {
    match value {
        Value::Float(number) if number.fract() == 0.0 && number.abs() < 1e15 => format!("{number:.0}"),
        Value::Float(number) => format!("{number:?}"),
        Value::String(path) if key == "demonstrations" => {
            Path::new(path).file_stem().map_or_else(|| path.clone(), |stem| stem.to_string_lossy().into_owned())
        }
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(|value| short(key, value)).collect::<Vec<_>>().join("x"),
        Value::Table(table) => {
            let parts = table.iter().map(|(name, value)| match value {
                // The one field of a choice needs no name.
                Value::Table(fields) => {
                    let fields = fields.values().map(|value| short(key, value)).collect::<Vec<_>>();
                    format!("{name}-{}", fields.join("-"))
                }
                _ => format!("{name}-{}", short(key, value)),
            });
            parts.collect::<Vec<_>>().join("-")
        }
        other => other.to_string(),
    }
}

/// `text` with every character that could mean something to a file system replaced.
fn safe(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() || "._-+".contains(c) { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(axes: &[(&str, Value)]) -> String {
        folder("mcpo", &axes.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect())
    }

    #[test]
    fn names_lead_nowhere_else() {
        let name = name(&[("x", Value::String("../../etc/passwd\n\0".into()))]);
        assert_eq!(name, "mcpo-x=.._.._etc_passwd__");
        assert!(!name.contains('/'));
    }

    #[test]
    fn numbers_are_short_and_exact() {
        let axes = [("d", Value::Float(1e-6)), ("epsilon", Value::Float(0.0)), ("mcpo.max_kl", Value::Float(0.01))];
        assert_eq!(name(&axes), "mcpo-d=1e-6-epsilon=0-max_kl=0.01");
        let hidden = Value::Array(vec![Value::Integer(300), Value::Integer(400)]);
        assert_eq!(name(&[("network.hidden", hidden)]), "mcpo-network.hidden=300x400");
        let reward: toml::Table =
            toml::from_str("r = { sparse2 = { distance = 15.0, mode = 'beyond' } }").expect("TOML");
        assert_eq!(name(&[("reward", reward["r"].clone())]), "mcpo-reward=sparse2-15-beyond");
    }

    #[test]
    fn long_names_stay_apart() {
        let long = |end: &str| name(&[("x", Value::String(format!("{}{end}", "y".repeat(500))))]);
        assert!(long("a").len() <= LONGEST && long("a") != long("b"));
    }
}
