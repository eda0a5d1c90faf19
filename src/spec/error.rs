//! The mistakes in a specification, and where each was written.

use std::{cmp::Ordering, fmt, ops::Range, path::PathBuf, sync::Arc};

use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource, SourceCode,
};

/// Where a mistake was written.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// A place in a file.
    File {
        /// The file, as it was named.
        path: PathBuf,
        /// All of its text.
        text: Arc<str>,
        /// The bytes in question.
        span: Range<usize>,
    },
    /// In a layer that is no file, or in a file that could not be read.
    Layer(String),
}

/// One mistake.
#[derive(Debug, Clone, PartialEq)]
pub struct SpecError {
    /// The mistake in words: lower case, with the value.
    pub message: String,
    /// Where it was written.
    pub place: Place,
    /// The expected value or the nearest known name; shown at the caret.
    pub label: Option<String>,
    /// Further help for the reader.
    pub help: Option<String>,
    /// The keys that the mistake concerns: those on the path to it, and the one that was probably
    /// meant.
    pub(super) about: Vec<String>,
}

impl SpecError {
    /// The mistake `message` at `place`, with a label for the caret.
    pub(super) fn new(message: impl Into<String>, place: Place, label: Option<String>) -> Self {
        Self {
            message: message.into(),
            place,
            label,
            help: None,
            about: Vec::new(),
        }
    }

    /// Line, counted from 1; absent where the place is no file.
    pub fn line(&self) -> Option<usize> {
        self.before().map(|before| before.matches('\n').count() + 1)
    }

    /// Column in characters, counted from 1; absent where the place is no file.
    pub fn column(&self) -> Option<usize> {
        self.before().map(|before| {
            before
                .rsplit('\n')
                .next()
                .unwrap_or_default()
                .chars()
                .count()
                + 1
        })
    }

    /// The text before the mistake.
    fn before(&self) -> Option<&str> {
        match &self.place {
            Place::File { text, span, .. } => Some(text.get(..span.start).unwrap_or(text)),
            Place::Layer(_) => None,
        }
    }

    /// The mistake without its source text, if its line or a neighbouring one is too long to be
    /// shown with a caret.
    fn without_text(&self) -> Option<Self> {
        const LONGEST: usize = 4000;
        let Place::File { path, text, span } = &self.place else {
            return None;
        };
        let (before, after) = (self.before()?, text.get(span.start..).unwrap_or_default());
        let beside = before.rsplit('\n').take(2).chain(after.split('\n').take(2));
        let is_long = beside.into_iter().any(|line| line.len() > LONGEST);
        let (line, column) = (self.line()?, self.column()?);
        let place = Place::Layer(format!("{}:{line}:{column}", path.display()));
        is_long.then(|| Self {
            place,
            ..self.clone()
        })
    }

    /// Orders mistakes by place: files first, each from top to bottom.
    pub(super) fn order(&self, other: &Self) -> Ordering {
        match (&self.place, &other.place) {
            (
                Place::File {
                    path: a, span: i, ..
                },
                Place::File {
                    path: b, span: j, ..
                },
            ) => a.cmp(b).then(i.start.cmp(&j.start)),
            (Place::File { .. }, Place::Layer(_)) => Ordering::Less,
            (Place::Layer(_), Place::File { .. }) => Ordering::Greater,
            (Place::Layer(a), Place::Layer(b)) => a.cmp(b),
        }
    }
}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Place::File { .. } => f.write_str(&self.message),
            Place::Layer(layer) => write!(f, "{layer}: {}", self.message),
        }
    }
}

/// The most mistakes that are shown: among more, one causes the others, or the reader wants to
/// begin somewhere.
const MOST_SHOWN: usize = 50;

/// Every mistake that was found, in the order of the files; at least one.
#[derive(Clone, PartialEq)]
pub struct SpecErrors(Vec<SpecError>);

impl SpecErrors {
    /// `errors` in the order of their places, without duplicates; `Ok` when there are none.
    pub(super) fn none_or(mut errors: Vec<SpecError>) -> Result<(), Self> {
        errors.sort_by(SpecError::order);
        errors.dedup();
        if errors.is_empty() {
            Ok(())
        } else {
            Err(Self(errors))
        }
    }

    /// The mistakes.
    pub fn iter(&self) -> std::slice::Iter<'_, SpecError> {
        self.0.iter()
    }

    /// The first mistakes for people, each with its line and a caret, and then their total number.
    /// Has colours and box drawing if `terminal`, and is plain ASCII if not.
    pub fn render(&self, terminal: bool) -> String {
        let theme = if terminal {
            GraphicalTheme::unicode()
        } else {
            GraphicalTheme::none()
        };
        let handler = GraphicalReportHandler::new_themed(theme)
            .with_links(false)
            .with_width(100);
        let mut text = String::new();
        for (index, error) in self.0.iter().take(MOST_SHOWN).enumerate() {
            let bare = error.without_text();
            let shown = Shown::new(bare.as_ref().unwrap_or(error));
            text.push_str(if index > 0 { "\n" } else { "" });
            if handler.render_report(&mut text, &shown).is_err() {
                text.push_str(&error.to_string());
            }
        }
        if self.0.len() > 1 {
            let shown = if self.0.len() > MOST_SHOWN {
                format!(", of which {MOST_SHOWN} are shown")
            } else {
                String::new()
            };
            text.push_str(&format!("\n{} errors{shown}\n", self.0.len()));
        }
        text
    }
}

impl<'a> IntoIterator for &'a SpecErrors {
    type Item = &'a SpecError;
    type IntoIter = std::slice::Iter<'a, SpecError>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl fmt::Display for SpecErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.render(false).trim_end())
    }
}

impl fmt::Debug for SpecErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `expect` in a test prints this too, so it should be readable.
        write!(f, "\n{self}")
    }
}

impl std::error::Error for SpecErrors {}

/// A mistake in the form that miette renders.
#[derive(Debug)]
struct Shown<'a> {
    error: &'a SpecError,
    source: Option<NamedSource<Arc<str>>>,
}

impl<'a> Shown<'a> {
    fn new(error: &'a SpecError) -> Self {
        let source = match &error.place {
            Place::File { path, text, .. } => {
                Some(NamedSource::new(path.to_string_lossy(), Arc::clone(text)))
            }
            Place::Layer(_) => None,
        };
        Self { error, source }
    }
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl std::error::Error for Shown<'_> {}

impl Diagnostic for Shown<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        // Without a line there is no caret to write the label at.
        let help = match &self.error.place {
            Place::File { .. } => self.error.help.clone(),
            Place::Layer(_) => {
                let parts: Vec<&str> = [&self.error.label, &self.error.help]
                    .into_iter()
                    .flatten()
                    .map(String::as_str)
                    .collect();
                (!parts.is_empty()).then(|| parts.join("; "))
            }
        };
        help.map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|source| source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        match &self.error.place {
            Place::File { text, span, .. } => {
                // A span over several lines would show them all; its first line is enough to find
                // it.
                let first = text
                    .get(span.clone())
                    .unwrap_or_default()
                    .lines()
                    .next()
                    .unwrap_or_default();
                let label = LabeledSpan::new_primary_with_span(
                    self.error.label.clone(),
                    (span.start, first.len()),
                );
                Some(Box::new(std::iter::once(label)))
            }
            Place::Layer(_) => None,
        }
    }
}
