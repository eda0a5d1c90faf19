//! The texts of a specification, and the files among them.

use std::{
    io,
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use toml::de::DeTable;

use super::{
    error::{Place, SpecError},
    source::Source,
    syntax,
};
use crate::intake::{self, Links};

/// The longest matrix that is read, bytes; no person writes a longer one.
const LONGEST: u64 = 4 << 20;

/// The text of one layer.
pub(super) struct Layer {
    /// The file; `None` for a variable or an argument.
    pub(super) path: Option<PathBuf>,
    /// Its name in messages.
    name: String,
    pub(super) text: Arc<str>,
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
    pub(super) fn other(name: String, text: &str) -> Self {
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
        let (tree, errors) = DeTable::parse_recoverable(&self.text);
        (Source { layer: self, tree }, syntax::slips(self, errors))
    }
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
            return (chain, vec![SpecError::new(reason.to_string(), place, None)]);
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
            let refuse = |message| SpecError::new(message, layer.place(span), None);
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

/// Why a file is no layer.
#[derive(Debug, thiserror::Error)]
enum Unreadable {
    #[error("there is no such file")]
    Missing,
    /// It is too long, or no regular file.
    #[error("{0}")]
    Unfit(io::Error),
    #[error("cannot read it: {0}")]
    Refused(io::Error),
    #[error("it is not UTF-8 text: line {line}, column {column} is not the start of a character")]
    NoText { line: usize, column: usize },
}

fn read(path: &Path) -> Result<String, Unreadable> {
    let bytes = intake::read(path, Links::Follow, LONGEST).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => Unreadable::Missing,
        io::ErrorKind::InvalidInput => Unreadable::Unfit(error),
        _ => Unreadable::Refused(error),
    })?;
    String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let before = String::from_utf8_lossy(valid);
        Unreadable::NoText {
            line: before.matches('\n').count() + 1,
            column: before
                .rsplit('\n')
                .next()
                .unwrap_or_default()
                .chars()
                .count()
                + 1,
        }
    })
}
