//! What the command line and the environment set: layers stronger than any file, and lists of axes.

use toml::de::{DeTable, DeValue};

use super::{
    Overrides,
    error::{Place, SpecError},
    layer::Layer,
    layers,
    source::plain_value,
};

/// The most parts of a key.
const DEEPEST: usize = 8;

/// The layers stronger than any file: environment variables, then `--set`.
pub(super) fn overriding(overrides: &Overrides, variables: bool) -> (Vec<Layer>, Vec<SpecError>) {
    let mut layers = Vec::new();
    let mut errors = Vec::new();
    let mut refuse = |name: &str, message: String, label: &str| {
        errors.push(SpecError::new(
            message,
            Place::Layer(name.into()),
            Some(label.into()),
        ));
    };
    if variables {
        for (name, (key, text)) in layers::variables() {
            let name = format!("environment variable {name}");
            if key.len() > DEEPEST {
                refuse(
                    &name,
                    format!("a key of {} parts", key.len()),
                    "no key has so many",
                );
                continue;
            }
            let key: Vec<String> = key.iter().map(|part| quoted(part)).collect();
            layers.push(Layer::other(name, &assigned(&key.join("."), &text)));
        }
    }
    let mut set: Vec<(String, Vec<String>)> = Vec::new();
    for argument in &overrides.set {
        let name = format!("--set {argument}");
        let text = argument
            .split_once('=')
            .map(|(key, value)| assigned(key.trim(), value));
        let text = text.unwrap_or_default();
        let keys = DeTable::parse(&text)
            .map(|table| leaves(table.get_ref()))
            .unwrap_or_default();
        // What does not parse has no keys either.
        if keys.is_empty() {
            refuse(
                &name,
                "not of the form KEY=VALUE".into(),
                "such as `budget.env_steps=100000`",
            );
            continue;
        }
        // It is not clear which of two values is meant.
        match set.iter().find_map(|(before, known)| {
            keys.iter()
                .find(|key| known.contains(key))
                .map(|key| (before, key))
        }) {
            Some((before, key)) => refuse(
                &name,
                format!("`{key}` is set twice"),
                &format!("the first is `--set {before}`"),
            ),
            None => layers.push(Layer::other(name, &text)),
        }
        set.push((argument.clone(), keys));
    }
    (layers, errors)
}

/// The dotted keys of all values in `table`.
fn leaves(table: &DeTable<'_>) -> Vec<String> {
    let mut keys = Vec::new();
    for (key, value) in table {
        match value.get_ref() {
            DeValue::Table(inner) if !inner.is_empty() => {
                keys.extend(
                    leaves(inner)
                        .into_iter()
                        .map(|inner| format!("{}.{inner}", key.get_ref())),
                );
            }
            _ => keys.push(key.get_ref().to_string()),
        }
    }
    keys
}

/// `key = value` as a line of TOML.
/// A value that is not valid TOML becomes a string, so that values are read alike in a file, an
/// argument and a variable.
fn assigned(key: &str, value: &str) -> String {
    format!("{key} = {}", as_value(value))
}

/// `text` as a TOML value: unchanged if it is one, else as a string.
fn as_value(text: &str) -> String {
    let text = text.trim();
    if DeValue::parse(text).is_ok() {
        text.to_owned()
    } else {
        quoted(text)
    }
}

/// The pieces of `text` between commas, ignoring those within brackets, braces and quotation marks.
pub(super) fn pieces(text: &str) -> Vec<&str> {
    let (mut pieces, mut start, mut depth, mut quote) = (Vec::new(), 0, 0usize, None);
    for (at, c) in text.char_indices() {
        match (c, quote) {
            ('"' | '\'', None) => quote = Some(c),
            (_, Some(open)) => quote = quote.filter(|_| c != open),
            ('[' | '{', None) => depth += 1,
            (']' | '}', None) => depth = depth.saturating_sub(1),
            (',', None) if depth == 0 => {
                pieces.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    pieces.push(text[start..].trim());
    pieces
}

/// `text` as a value: TOML's, or else a string.
pub(super) fn value(text: &str) -> toml::Value {
    let text = text.trim();
    let parsed = DeValue::parse(text)
        .ok()
        .and_then(|value| plain_value(&value));
    parsed.unwrap_or_else(|| toml::Value::String(text.into()))
}

/// The list that replaces one axis in every block.
pub(super) struct AxisList {
    /// `seed`, `d` ...
    pub(super) key: String,
    /// `key = [ ... ]`.
    pub(super) layer: Layer,
}

/// The `--axis KEY=VALUE,VALUE...` arguments.
pub(super) fn axis_lists(overrides: &Overrides) -> (Vec<AxisList>, Vec<SpecError>) {
    let mut lists = Vec::new();
    let mut errors = Vec::new();
    for argument in &overrides.axis {
        let name = format!("--axis {argument}");
        match argument
            .split_once('=')
            .map(|(key, values)| (key.trim().trim_matches('"'), values))
        {
            Some((key, _)) if lists.iter().any(|list: &AxisList| list.key == key) => {
                errors.push(SpecError::new(
                    format!("the axis `{key}` is given twice"),
                    Place::Layer(name),
                    Some(format!(
                        "write all of its values in one `--axis {key}=VALUE,VALUE...`"
                    )),
                ))
            }
            Some((key, values)) if !key.is_empty() => {
                let text = format!("{} = {}", quoted(key), list(values));
                lists.push(AxisList {
                    key: key.into(),
                    layer: Layer::other(name, &text),
                });
            }
            _ => errors.push(SpecError::new(
                "not of the form KEY=VALUE,VALUE...",
                Place::Layer(name),
                Some("such as `seed=0,1`".into()),
            )),
        }
    }
    (lists, errors)
}

/// `values` as a TOML list: unchanged between brackets if that is valid, else with every invalid
/// value as a string.
fn list(values: &str) -> String {
    let whole = format!("[{values}]");
    if DeValue::parse(&whole).is_ok() {
        return whole;
    }
    let each: Vec<String> = pieces(values).into_iter().map(as_value).collect();
    format!("[{}]", each.join(", "))
}

/// `text` as a string in TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.trim().into()).to_string()
}

impl AxisList {
    /// The values of the list.
    pub(super) fn values(&self) -> Vec<toml::Value> {
        let (source, _) = self.layer.parse();
        let value = source
            .tree
            .get_ref()
            .get(self.key.as_str())
            .and_then(plain_value);
        value
            .and_then(|value| value.as_array().cloned())
            .unwrap_or_default()
    }
}
