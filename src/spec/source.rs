//! Reads the layers, and finds where in them a key was written.

use std::{
    io,
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::Deserialize;
use toml::{
    Spanned,
    de::{DeTable, DeValue, ValueDeserializer},
};

use super::{
    Overrides,
    error::{Place, SpecError},
    layers,
};
use crate::{
    env::EnvId,
    fit::Step,
    intake::{self, Links},
};

/// The longest matrix that is read, bytes; no person writes a longer one.
const LONGEST: u64 = 4 << 20;

/// Phrases in toml's messages about slips that cause others, up to the end of a list, an inline
/// table or a text.
const CONTAINERS: [&str; 7] = [
    "array element",
    "in array",
    "unclosed array",
    "inline table",
    "key-value pair",
    "multi-line",
    "the list above",
];

/// toml's message about a block's header without end, a slip that affects one line.
const HEADER: &str = "unclosed array table";

/// The text of one layer.
pub(super) struct Layer {
    /// The file; `None` for a variable or an argument.
    pub(super) path: Option<PathBuf>,
    /// Its name in messages.
    name: String,
    text: Arc<str>,
}

impl Layer {
    /// A file that was read.
    pub(super) fn file(path: &Path, text: &str) -> Self {
        Self {
            path: Some(path.to_owned()),
            name: path.display().to_string(),
            text: text.into(),
        }
    }

    /// A layer that is no file.
    fn other(name: String, text: &str) -> Self {
        Self {
            path: None,
            name,
            text: text.into(),
        }
    }

    /// The place of `span` in this layer.
    pub(super) fn place(&self, span: Range<usize>) -> Place {
        match &self.path {
            Some(path) => Place::File {
                path: path.clone(),
                text: Arc::clone(&self.text),
                span,
            },
            None => Place::Layer(self.name.clone()),
        }
    }

    /// The folder at which relative paths in it start.
    pub(super) fn folder(&self) -> &Path {
        self.path
            .as_deref()
            .and_then(Path::parent)
            .unwrap_or(Path::new(""))
    }

    /// The parsed layer, and every syntax error in it.
    pub(super) fn parse(&self) -> (Source<'_>, Vec<SpecError>) {
        let (tree, mut errors) = DeTable::parse_recoverable(&self.text);
        let mut told: Vec<SpecError> = Vec::new();
        let mut open = false;
        // In the file's order, since later errors may follow from earlier ones.
        errors.sort_by_key(|error| error.span().map_or(0, |span| span.start));
        for error in errors {
            let span = error.span().unwrap_or(0..0);
            let starts_line = self
                .text
                .get(..span.start)
                .unwrap_or_default()
                .rsplit('\n')
                .next()
                .is_some_and(|before| before.trim().is_empty());
            let is_assigned = self
                .text
                .get(span.end..)
                .unwrap_or_default()
                .trim_start()
                .starts_with('=');
            let is_key =
                |message: &str| is_assigned && message.starts_with("string values must be quoted");
            let (message, label) = match error.message().split_once(", expected ") {
                // toml's message about `key =` with nothing behind it.
                Some(_)
                    if span.is_empty()
                        && error.message().starts_with("string values must be quoted") =>
                {
                    (
                        "a value is missing".to_owned(),
                        Some("expected a value".to_owned()),
                    )
                }
                // The next key was taken for one more element.
                Some((message, _))
                    if starts_line
                        && (message.starts_with("missing comma between array")
                            || is_key(message)) =>
                {
                    (
                        "the list above is not closed".to_owned(),
                        Some("expected `]` before this line, or `,`".to_owned()),
                    )
                }
                Some((message, expected)) => {
                    (message.to_owned(), Some(format!("expected {expected}")))
                }
                None => (error.message().to_owned(), None),
            };
            let error = SpecError {
                message,
                place: self.place(span),
                label,
                help: None,
                about: Vec::new(),
            };
            // Errors after a slip on the same line, or inside a list, table or text that does not
            // end, are its consequences.
            if open || told.last().is_some_and(|last| last.line() == error.line()) {
                continue;
            }
            open = error.message != HEADER
                && CONTAINERS
                    .iter()
                    .any(|container| error.message.contains(container));
            told.push(error);
        }
        (Source { layer: self, tree }, told)
    }
}

/// One layer, parsed.
pub(super) struct Source<'a> {
    pub(super) layer: &'a Layer,
    pub(super) tree: Spanned<DeTable<'a>>,
}

/// The path to the dotted `key`.
pub(super) fn steps(key: &str) -> Vec<Step> {
    key.split('.').map(|key| Step::Key(key.into())).collect()
}

impl Source<'_> {
    /// The bytes of the value at the end of `way`; `None` if this layer does not have it.
    pub(super) fn span(&self, way: &[Step]) -> Option<Range<usize>> {
        let (last, before) = way.split_last()?;
        let value = match before.split_first() {
            None => match last {
                Step::Key(key) => self.tree.get_ref().get(key.as_str()),
                Step::Index(_) => None,
            },
            Some((Step::Key(first), between)) => {
                let first = self.tree.get_ref().get(first.as_str())?;
                between
                    .iter()
                    .chain([last])
                    .try_fold(first, |value, step| inner(step, value))
            }
            Some((Step::Index(_), _)) => None,
        };
        value.map(Spanned::span)
    }

    /// The bytes of the value at the end of `way` under the table of `env`, by whichever of its
    /// names.
    pub(super) fn environment_span(&self, env: EnvId, way: &[Step]) -> Option<Range<usize>> {
        let environments = self
            .tree
            .get_ref()
            .get("environments")?
            .get_ref()
            .as_table()?;
        let (name, _) = environments.iter().find(|(name, _)| {
            name.get_ref()
                .parse::<EnvId>()
                .is_ok_and(|known| known == env)
        })?;
        let whole = [
            Step::Key("environments".into()),
            Step::Key(name.get_ref().to_string()),
        ];
        self.span(
            &whole
                .into_iter()
                .chain(way.iter().cloned())
                .collect::<Vec<_>>(),
        )
    }
}

/// The value at the end of `step` in `value`.
pub(super) fn inner<'v, 'a>(
    step: &Step,
    value: &'v Spanned<DeValue<'a>>,
) -> Option<&'v Spanned<DeValue<'a>>> {
    match step {
        Step::Key(key) => value.get_ref().get(key.as_str()),
        Step::Index(index) => value.get_ref().get(*index),
    }
}

/// `value` without its spans.
pub(super) fn plain_value(value: &Spanned<DeValue<'_>>) -> Option<toml::Value> {
    toml::Value::deserialize(ValueDeserializer::from(value.clone())).ok()
}

/// The file at `path` and those that it extends, weakest first, and the errors in their names.
///
/// `text` is the file's content, if it is not to be read from `path`.
pub(super) fn files(path: &Path, text: Option<&str>) -> (Vec<Layer>, Vec<SpecError>) {
    let mut chain: Vec<Layer> = Vec::new();
    let mut seen: Vec<PathBuf> = Vec::new();
    let mut next = match text
        .map(|text| Ok(text.to_owned()))
        .unwrap_or_else(|| read(path))
    {
        Ok(text) => Some(Layer::file(path, &text)),
        Err(reason) => {
            let place = Place::Layer(path.display().to_string());
            return (
                chain,
                vec![SpecError {
                    message: reason,
                    place,
                    label: None,
                    help: None,
                    about: Vec::new(),
                }],
            );
        }
    };
    let mut errors = Vec::new();
    while let Some(layer) = next.take() {
        // Canonical paths, so that a cycle is noticed under another name too.
        seen.extend(
            layer
                .path
                .as_ref()
                .map(|path| path.canonicalize().unwrap_or_else(|_| path.clone())),
        );
        if let Some((base, span)) = extended(&layer) {
            let base = layer.folder().join(base);
            let refuse = |message| SpecError {
                message,
                place: layer.place(span),
                label: None,
                help: None,
                about: Vec::new(),
            };
            match read(&base) {
                Err(reason) => errors.push(refuse(format!(
                    "cannot extend {}: {reason}",
                    base.display()
                ))),
                // Otherwise a cycle of files would be read for ever.
                Ok(_) if base.canonicalize().is_ok_and(|base| seen.contains(&base)) => {
                    errors.push(refuse(format!(
                        "{} ends up extending itself",
                        base.display()
                    )));
                }
                Ok(text) => next = Some(Layer::file(&base, &text)),
            }
        }
        chain.push(layer);
    }
    // The file read last is the weakest.
    chain.reverse();
    (chain, errors)
}

/// The file that `layer` extends, and the place that says so.
fn extended(layer: &Layer) -> Option<(PathBuf, Range<usize>)> {
    let (source, _) = layer.parse();
    let value = source.tree.get_ref().get("extends")?;
    Some((value.get_ref().as_str()?.into(), value.span()))
}

fn read(path: &Path) -> Result<String, String> {
    let bytes = intake::read(path, Links::Follow, LONGEST).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => "there is no such file".to_owned(),
        io::ErrorKind::InvalidInput => error.to_string(),
        _ => format!("cannot read it: {error}"),
    })?;
    String::from_utf8(bytes).map_err(|error| {
        let before = String::from_utf8_lossy(&error.as_bytes()[..error.utf8_error().valid_up_to()])
            .into_owned();
        let line = before.matches('\n').count() + 1;
        let column = before
            .rsplit('\n')
            .next()
            .unwrap_or_default()
            .chars()
            .count()
            + 1;
        format!(
            "it is not UTF-8 text: line {line}, column {column} is not the start of a character"
        )
    })
}

/// The most parts of a key.
const DEEPEST: usize = 8;

/// The layers stronger than any file: environment variables, then `--set`.
pub(super) fn overriding(overrides: &Overrides, variables: bool) -> (Vec<Layer>, Vec<SpecError>) {
    let mut layers = Vec::new();
    let mut errors = Vec::new();
    let mut refuse = |name: &str, message: String, label: &str| {
        errors.push(SpecError {
            message,
            place: Place::Layer(name.into()),
            label: Some(label.into()),
            help: None,
            about: Vec::new(),
        });
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
                errors.push(SpecError {
                    message: format!("the axis `{key}` is given twice"),
                    place: Place::Layer(name),
                    label: Some(format!(
                        "write all of its values in one `--axis {key}=VALUE,VALUE...`"
                    )),
                    help: None,
                    about: Vec::new(),
                })
            }
            Some((key, values)) if !key.is_empty() => {
                let text = format!("{} = {}", quoted(key), list(values));
                lists.push(AxisList {
                    key: key.into(),
                    layer: Layer::other(name, &text),
                });
            }
            _ => errors.push(SpecError {
                message: "not of the form KEY=VALUE,VALUE...".into(),
                place: Place::Layer(name),
                label: Some("such as `seed=0,1`".into()),
                help: None,
                about: Vec::new(),
            }),
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
