//! Reads TOML values into types; a value that does not fit is told by its parts.
//!
//! Serde's readers give a mistake as a finished sentence. This one keeps what was found, what was
//! expected, and the way to it, so that whoever shows it can find the line and choose the words.
//! Start at [`read`].

mod reader;

use std::fmt;

use serde::de::{DeserializeOwned, Error, Expected, Unexpected};
use toml::Value;

use reader::Reader;

/// A step on the path to a value.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// To the value of a key in a table.
    Key(String),
    /// To an element of a list, from 0.
    Index(usize),
}

/// A value that does not fit its type.
#[derive(Debug, Clone, PartialEq)]
pub struct Mistake {
    /// The mistake.
    pub fault: Fault,
    /// The path to the wrong value; for an unknown key, to that key.
    pub way: Vec<Step>,
}

/// The kinds of mistakes. Values and expectations are in words, as in "the string "a"" and
/// "a whole number".
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// A value of another type.
    Type {
        /// The value.
        found: String,
        /// The values that fit.
        expected: String,
    },
    /// A value of the right type outside its range.
    Range {
        /// The value.
        found: String,
        /// The values that fit.
        expected: String,
    },
    /// A list or a table of the wrong length.
    Length {
        /// Its length.
        found: usize,
        /// The lengths that fit.
        expected: String,
    },
    /// A key that the table does not have.
    UnknownKey {
        /// The key.
        key: String,
        /// The keys that it has.
        known: &'static [&'static str],
    },
    /// A name that is none of the choices.
    UnknownName {
        /// The name.
        name: String,
        /// The choices.
        known: &'static [&'static str],
    },
    /// A key without which a table is incomplete.
    MissingKey(&'static str),
    /// Neither a name nor a table, where one of them chooses.
    NoChoice {
        /// The choices.
        known: &'static [&'static str],
    },
    /// A table that chooses nothing or several things.
    NotOneChoice {
        /// The choices.
        known: &'static [&'static str],
    },
    /// The name of a choice to which more belongs.
    NameAlone {
        /// The name.
        name: String,
        /// The keys of the table that belongs to it; none if a single value does.
        keys: &'static [&'static str],
    },
    /// A choice to which nothing belongs, with something.
    NoFields {
        /// The name.
        name: String,
    },
    /// An objection of the type itself, which names its subject.
    Objection {
        /// The objection.
        message: String,
        /// The label for the caret.
        label: Option<String>,
    },
    /// Any other objection of the type.
    Other(String),
}

/// The value of type `T` that `value` describes.
///
/// # Errors
///
/// It does not fit.
pub fn read<T: DeserializeOwned>(value: Value) -> Result<T, Mistake> {
    T::deserialize(Reader(value))
}

/// The text of a custom serde error that [`read`] takes apart into an [objection](Fault) and its
/// label: serde passes a type's own words as one text.
pub fn objection(message: &str, label: Option<&str>) -> String {
    format!("{message}{LABEL}{}", label.unwrap_or_default())
}

/// The character between an objection and its label, which no message holds.
const LABEL: char = '\u{1f}';

impl Mistake {
    fn new(fault: Fault) -> Self {
        let way = Vec::new();
        Self { fault, way }
    }

    /// The same mistake, seen from the table or list one step above.
    fn under(mut self, step: Step) -> Self {
        self.way.insert(0, step);
        self
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for step in &self.way {
            match step {
                Step::Key(key) => write!(f, "{key}: ")?,
                Step::Index(index) => write!(f, "element {index}: ")?,
            }
        }
        match &self.fault {
            Fault::Type { found, expected } => {
                write!(f, "{found} does not belong here; expected {expected}")
            }
            Fault::Range { found, expected } => {
                write!(f, "{found} is out of range; expected {expected}")
            }
            Fault::Length { found, expected } => {
                write!(f, "a list of {found} does not fit; expected {expected}")
            }
            Fault::UnknownKey { key, .. } => write!(f, "unknown key `{key}`"),
            Fault::UnknownName { name, .. } => write!(f, "unknown name `{name}`"),
            Fault::MissingKey(key) => write!(f, "`{key}` is missing"),
            Fault::NoChoice { .. } => f.write_str("this is neither a name nor a table"),
            Fault::NotOneChoice { .. } => {
                f.write_str("this table does not hold exactly one choice")
            }
            Fault::NameAlone { name, .. } => write!(f, "more belongs to `{name}`"),
            Fault::NoFields { name } => write!(f, "nothing belongs to `{name}`"),
            Fault::Objection { message, .. } | Fault::Other(message) => f.write_str(message),
        }
    }
}

impl std::error::Error for Mistake {}

impl Error for Mistake {
    fn custom<T: fmt::Display>(message: T) -> Self {
        let text = message.to_string();
        Self::new(match text.split_once(LABEL) {
            Some((message, label)) => Fault::Objection {
                message: message.to_owned(),
                label: (!label.is_empty()).then(|| label.to_owned()),
            },
            None => Fault::Other(text),
        })
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let expected = kind(expected);
        Self::new(match found {
            // A whole number where one is expected, but written with a point.
            Unexpected::Float(number) if number.fract() == 0.0 => Fault::Type {
                found: format!("{number:.1}"),
                expected: if expected.starts_with("a whole number") {
                    format!("{expected}, such as {number:.0}")
                } else {
                    expected
                },
            },
            found => Fault::Type {
                found: in_words(found),
                expected,
            },
        })
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::new(Fault::Range {
            found: in_words(found),
            expected: kind(expected),
        })
    }

    fn invalid_length(found: usize, expected: &dyn Expected) -> Self {
        let expected = kind(expected);
        Self::new(Fault::Length { found, expected })
    }

    fn unknown_variant(name: &str, known: &'static [&'static str]) -> Self {
        let name = name.to_owned();
        Self::new(Fault::UnknownName { name, known })
    }

    fn unknown_field(key: &str, known: &'static [&'static str]) -> Self {
        let key = key.to_owned();
        Self::new(Fault::UnknownKey { key, known })
    }

    fn missing_field(key: &'static str) -> Self {
        Self::new(Fault::MissingKey(key))
    }
}

/// A value that was found, in words.
fn in_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(truth) => truth.to_string(),
        Unexpected::Unsigned(number) => number.to_string(),
        Unexpected::Signed(number) => number.to_string(),
        Unexpected::Float(number) => number.to_string(),
        Unexpected::Str(text) => format!("the string {text:?}"),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map => "a table".to_owned(),
        other => other.to_string(),
    }
}

/// The values that are expected, in a TOML user's words; serde names Rust's types.
fn kind(expected: &dyn Expected) -> String {
    let expected = expected.to_string();
    if let Some(length) = expected.strip_prefix("an array of length ") {
        return format!("{length} elements");
    }
    let words = match expected.as_str() {
        "f32" | "f64" => "a number",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or above",
        "a boolean" => "true or false",
        "a map" | "map" => "a table",
        "a sequence" => "a list",
        "path string" => "a string",
        other if other.starts_with("struct ") => "a table",
        other => other,
    };
    words.to_owned()
}

/// The kind of a date in words.
pub fn date_in_words(date: &toml::value::Datetime) -> &'static str {
    match (date.date, date.time) {
        (Some(_), None) => "date",
        (None, Some(_)) => "time",
        _ => "date and time",
    }
}
