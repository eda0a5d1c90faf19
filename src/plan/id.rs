//! The names of runs: readable, and safe as the names of folders.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Component, Path, PathBuf},
};

use toml::Value;

/// The longest name; a longer one is cut, and told apart by a digest.
const LONGEST: usize = 120;

/// The name of the folder of `algorithm` under `axes`: `mcpo-d=0.001-epsilon=0`.
pub(super) fn folder(algorithm: &str, axes: &BTreeMap<String, Value>) -> String {
    let prefix = format!("{algorithm}.");
    let axes = axes.iter().map(|(key, value)| {
        format!(
            "-{}={}",
            key.strip_prefix(&prefix).unwrap_or(key),
            safe(&short(value))
        )
    });
    let name: String = std::iter::once(algorithm.to_owned()).chain(axes).collect();
    if name.len() <= LONGEST {
        return name;
    }
    let digest = blake3::hash(name.as_bytes()).to_hex();
    format!("{}-{}", &name[..LONGEST - 17], &digest[..16])
}

/// A value in few characters: `0.001`, `1e-6`, `0` for `0.0`, `300x400`, `sparse2-15`.
pub(super) fn short(value: &Value) -> String {
    match value {
        Value::Float(number) if number.fract() == 0.0 && number.abs() < 1e15 => {
            format!("{number:.0}")
        }
        Value::Float(number) => format!("{number:?}"),
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(short).collect::<Vec<_>>().join("x"),
        Value::Table(table) => {
            let parts = table.iter().map(|(name, value)| match value {
                // A choice with one field is told by its value alone.
                Value::Table(fields) => {
                    let fields = fields.values().map(short).collect::<Vec<_>>();
                    format!("{name}-{}", fields.join("-"))
                }
                _ => format!("{name}-{}", short(value)),
            });
            parts.collect::<Vec<_>>().join("-")
        }
        other => other.to_string(),
    }
}

/// The name of the file `path` among `all`: its name without the ending, and as many of its folders
/// as tell it apart from the others; `good/Hopper-v2` beside `poor/Hopper-v2`.
pub(super) fn among(path: &Path, all: &BTreeSet<PathBuf>) -> String {
    let parts = |path: &Path| -> Vec<String> {
        let stem = path.with_extension("");
        stem.components()
            .filter(|part| matches!(part, Component::Normal(_) | Component::ParentDir))
            .map(|part| part.as_os_str().to_string_lossy().into_owned())
            .collect()
    };
    let own = parts(path);
    let others: Vec<Vec<String>> = all
        .iter()
        .filter(|other| *other != path)
        .map(|other| parts(other))
        .collect();
    let enough = (1..own.len()).find(|&n| {
        let end = &own[own.len() - n..];
        !others.iter().any(|other| other.ends_with(end))
    });
    own[own.len() - enough.unwrap_or(own.len())..].join("/")
}

/// `text` with every character that could mean something to a file system replaced.
fn safe(text: &str) -> String {
    text.chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || "._-+".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(axes: &[(&str, Value)]) -> String {
        folder(
            "mcpo",
            &axes
                .iter()
                .map(|(key, value)| ((*key).to_owned(), value.clone()))
                .collect(),
        )
    }

    #[test]
    fn names_lead_nowhere_else() {
        let name = name(&[("x", Value::String("../../etc/passwd\n\0".into()))]);
        assert_eq!(name, "mcpo-x=.._.._etc_passwd__");
        assert!(!name.contains('/'));
    }

    #[test]
    fn numbers_are_short_and_exact() {
        let axes = [
            ("d", Value::Float(1e-6)),
            ("epsilon", Value::Float(0.0)),
            ("mcpo.max_kl", Value::Float(0.01)),
        ];
        assert_eq!(name(&axes), "mcpo-d=1e-6-epsilon=0-max_kl=0.01");
        let hidden = Value::Array(vec![Value::Integer(300), Value::Integer(400)]);
        assert_eq!(
            name(&[("network.hidden", hidden)]),
            "mcpo-network.hidden=300x400"
        );
        let reward: toml::Table =
            toml::from_str("r = { sparse2 = { distance = 15.0, mode = 'beyond' } }").expect("TOML");
        assert_eq!(
            name(&[("reward", reward["r"].clone())]),
            "mcpo-reward=sparse2-15-beyond"
        );
    }

    #[test]
    fn files_are_called_by_what_tells_them_apart() {
        let called = |paths: &[&str]| {
            let all: BTreeSet<PathBuf> = paths.iter().map(PathBuf::from).collect();
            paths
                .iter()
                .map(|path| among(Path::new(path), &all))
                .collect::<Vec<_>>()
        };
        assert_eq!(
            called(&["x/good/Ant-v2.parquet", "x/poor/Ant-v2.parquet"]),
            ["good/Ant-v2", "poor/Ant-v2"]
        );
        assert_eq!(called(&["x/a.parquet", "x/b.parquet"]), ["a", "b"]);
        assert_eq!(called(&["a.parquet"]), ["a"]);
        assert_eq!(
            called(&["a.parquet", "x/a.parquet", "y/x/a.parquet"]),
            ["a", "x/a", "y/x/a"]
        );
    }

    #[test]
    fn long_names_stay_apart() {
        let long = |end: &str| name(&[("x", Value::String(format!("{}{end}", "y".repeat(500))))]);
        assert!(long("a").len() <= LONGEST && long("a") != long("b"));
    }
}
