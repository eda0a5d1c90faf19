//! Syntax errors in plain words.
//!
//! toml's parser gives no kinds of errors, but texts alone; they are matched here, and nowhere else.

use std::ops::Range;

use super::{error::SpecError, layer::Layer};

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

/// The beginning of toml's message about a word without quotation marks, or about nothing where a
/// value has to be.
const UNQUOTED: &str = "string values must be quoted";

/// The beginning of toml's message about a comma that is missing in a list.
const NO_COMMA: &str = "missing comma between array";

/// toml's message about a block's header without end, a slip that affects one line.
const HEADER: &str = "unclosed array table";

/// The `errors` of toml's parser in `layer`, without those that only follow from others.
pub(super) fn slips(layer: &Layer, mut errors: Vec<toml::de::Error>) -> Vec<SpecError> {
    let mut told: Vec<SpecError> = Vec::new();
    let mut open = false;
    // In the file's order, since later errors may follow from earlier ones.
    errors.sort_by_key(|error| error.span().map_or(0, |span| span.start));
    for error in errors {
        let span = error.span().unwrap_or(0..0);
        let (message, label) = words(error.message(), &layer.text, span.clone());
        let error = SpecError::new(message, layer.place(span), label);
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
    told
}

/// toml's `message` about the bytes `span` of `text`, and a label for the caret.
fn words(message: &str, text: &str, span: Range<usize>) -> (String, Option<String>) {
    let (before, after) = (
        text.get(..span.start).unwrap_or_default(),
        text.get(span.end..).unwrap_or_default(),
    );
    let Some((said, expected)) = message.split_once(", expected ") else {
        return (message.to_owned(), None);
    };
    let is_unquoted = said.starts_with(UNQUOTED);
    if is_unquoted && span.is_empty() {
        return (
            "a value is missing".to_owned(),
            Some("expected a value".to_owned()),
        );
    }
    // The next line's key was taken for one more element.
    let starts_line = before
        .rsplit('\n')
        .next()
        .is_some_and(|before| before.trim().is_empty());
    let is_key = is_unquoted && after.trim_start().starts_with('=');
    if starts_line && (is_key || said.starts_with(NO_COMMA)) {
        return (
            "the list above is not closed".to_owned(),
            Some("expected `]` before this line, or `,`".to_owned()),
        );
    }
    (said.to_owned(), Some(format!("expected {expected}")))
}
