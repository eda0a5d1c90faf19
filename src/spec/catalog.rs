//! Every key that a matrix can set, and the check of one value at a time.
//!
//! A key is checked by putting its value, alone, into a valid specimen of its type and reading
//! that. So every wrong value of a file is found, not just the first, and the types themselves
//! decide what is allowed.

use std::{borrow::Cow, collections::BTreeSet, ops::Range, sync::LazyLock};

use schemars::{JsonSchema, SchemaGenerator, generate::SchemaSettings};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value as Json;
use toml::{
    Spanned,
    de::{DeTable, DeValue, Deserializer},
};

use super::{
    Claim, Figure, Settings, SettingsTable, Slurm, Table,
    names::{date_in_words, plain, told_apart},
};
use crate::{
    algo::{Entry, catalogue},
    env::{EnvId, robot::Robot},
    quantity::constant,
};

/// A table of the file whose keys are the fields of one type.
pub(super) struct Section {
    /// The JSON Schema of the type, with nothing left to references.
    schema: Json,
    /// The dotted keys of all values.
    leaves: BTreeSet<String>,
    /// A valid value of the type as TOML text.
    specimen: String,
    read: Box<Read>,
}

/// Reads a table, and tells what is wrong with it.
type Read = dyn Fn(Spanned<DeTable<'_>>) -> Result<(), toml::de::Error> + Send + Sync;

/// Why a value was refused.
#[derive(Debug, PartialEq)]
pub(super) struct Refusal {
    pub(super) message: String,
    /// Whether the message names its subject; if not, the key's name must precede it.
    pub(super) says_all: bool,
    pub(super) label: Option<String>,
    /// The bytes of the value, or of its wrong part.
    pub(super) span: Range<usize>,
}

impl Section {
    /// The section of the type `T`.
    pub(super) fn of<T: Serialize + DeserializeOwned + JsonSchema + 'static>(specimen: &T) -> Self {
        Self::new(
            generator().into_root_schema_for::<T>().to_value(),
            text(specimen),
            Box::new(read::<T>),
        )
    }

    /// The section of an algorithm's hyperparameters.
    fn algorithm(entry: &'static dyn Entry) -> Self {
        let mut schema = entry.schema(generator());
        schema
            .as_object_mut()
            .and_then(|fields| fields.remove("title"));
        let specimen = text(&entry.defaults(EnvId::HalfCheetah).hyperparameters());
        Self::new(
            schema,
            specimen,
            Box::new(|table| entry.read(Deserializer::from(table)).map(drop)),
        )
    }

    fn new(schema: Json, specimen: String, read: Box<Read>) -> Self {
        let mut leaves = BTreeSet::new();
        collect_leaves(&schema, "", &mut leaves);
        Self {
            schema,
            leaves,
            specimen,
            read,
        }
    }

    /// The JSON Schema of the key at `path`; `None` when there is no such key.
    pub(super) fn schema(&self, path: &[&str]) -> Option<&Json> {
        path.iter().try_fold(&self.schema, |schema, key| {
            schema.get("properties")?.get(key)
        })
    }

    /// The keys of the table at `path`; `None` when a value belongs there.
    pub(super) fn keys(&self, path: &[&str]) -> Option<impl Iterator<Item = &str>> {
        Some(
            self.schema(path)?
                .get("properties")?
                .as_object()?
                .keys()
                .map(String::as_str),
        )
    }

    /// Whether a list may stand at `key`.
    pub(super) fn takes_lists(&self, key: &str) -> bool {
        let is_list = |schema: &Json| schema["type"] == "array";
        let forms = |schema: &Json| {
            schema["anyOf"]
                .as_array()
                .is_some_and(|forms| forms.iter().any(is_list))
        };
        self.schema(&[key])
            .is_some_and(|schema| is_list(schema) || forms(schema))
    }

    /// The keys without which a table of this type is incomplete.
    pub(super) fn required(&self) -> impl Iterator<Item = &str> {
        self.schema["required"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Json::as_str)
    }

    /// The dotted keys of all values.
    pub(super) fn leaves(&self) -> &BTreeSet<String> {
        &self.leaves
    }

    /// Whether `value` may stand at `path`.
    pub(super) fn check<'a>(
        &'a self,
        path: &[&str],
        value: &Spanned<DeValue<'a>>,
    ) -> Result<(), Refusal> {
        let mut candidate =
            DeTable::parse(&self.specimen).expect("what was written as TOML is TOML");
        put(candidate.get_mut(), path, value.clone());
        (self.read)(candidate).map_err(|error| {
            let whole = value.span();
            let part = error
                .span()
                .filter(|part| whole.start <= part.start && part.end <= whole.end);
            let span = part.unwrap_or(whole);
            if let Some((message, label)) = told_apart(error.message()) {
                return Refusal {
                    message,
                    says_all: true,
                    label,
                    span,
                };
            }
            let (message, label) = match (
                date_at(value, &span),
                error.message().strip_prefix("invalid type: map,"),
            ) {
                (Some(date), Some(expected)) => plain(&format!("invalid type: {date},{expected}")),
                _ => plain(error.message()),
            };
            Refusal {
                message,
                says_all: false,
                label,
                span,
            }
        })
    }

    /// Merges `over` into `under`, key by key; a choice such as a reward is replaced whole.
    pub(super) fn merge(&self, under: &mut toml::Table, over: &toml::Table) {
        self.merge_at(&mut Vec::new(), under, over);
    }

    fn merge_at<'a>(
        &self,
        path: &mut Vec<&'a str>,
        under: &mut toml::Table,
        over: &'a toml::Table,
    ) {
        for (key, value) in over {
            path.push(key);
            match (under.get_mut(key), value) {
                (Some(toml::Value::Table(below)), toml::Value::Table(above))
                    if self.keys(path).is_some() =>
                {
                    self.merge_at(path, below, above);
                }
                _ => {
                    under.insert(key.clone(), value.clone());
                }
            }
            path.pop();
        }
    }
}

/// What of a file only `submit` reads.
#[derive(serde::Serialize, serde::Deserialize, JsonSchema)]
struct Submitted {
    /// What `mcpo-run submit` asks a cluster for.
    slurm: Slurm,
}

/// The sections of a file.
pub(super) struct Catalog {
    pub(super) settings: Section,
    pub(super) figure: Section,
    pub(super) table: Section,
    pub(super) claim: Section,
    pub(super) settings_table: Section,
    /// The whole file as a section, for the sake of its one key `slurm`.
    pub(super) slurm: Section,
    /// The keys that describe a user's robot.
    pub(super) robot: Section,
    algorithms: Vec<(&'static str, Section)>,
}

impl Catalog {
    /// The catalog, shared by the whole process.
    pub(super) fn get() -> &'static Self {
        static CATALOG: LazyLock<Catalog> = LazyLock::new(|| Catalog {
            settings: Section::of(&Settings::defaults(EnvId::HalfCheetah, "ppo", constant(1))),
            figure: Section::of(&Figure::returns("figure", "Figure".to_owned())),
            table: Section::of(&Table::specimen()),
            claim: Section::of(&Claim::specimen()),
            settings_table: Section::of(&SettingsTable::specimen()),
            robot: Section::of(&Robot::specimen()),
            slurm: Section::of(&Submitted {
                slurm: Slurm::specimen(),
            }),
            algorithms: catalogue::all()
                .map(|entry| (entry.about().name, Section::algorithm(entry)))
                .collect(),
        });
        &CATALOG
    }

    /// The hyperparameters of an algorithm; `None` when there is none of that name.
    pub(super) fn algorithm(&self, name: &str) -> Option<&Section> {
        self.algorithms
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, section)| section)
    }

    /// All algorithms.
    pub(super) fn algorithms(&self) -> impl Iterator<Item = &(&'static str, Section)> {
        self.algorithms.iter()
    }
}

/// Makes JSON Schemas with every type written out where it is used.
fn generator() -> SchemaGenerator {
    let settings = SchemaSettings::draft2020_12().with(|settings| {
        settings.inline_subschemas = true;
        settings.meta_schema = None;
    });
    settings.into_generator()
}

/// `value` as TOML text.
fn text<T: Serialize>(value: &T) -> String {
    toml::to_string(value).expect("our own types are TOML")
}

fn read<T: DeserializeOwned>(table: Spanned<DeTable<'_>>) -> Result<(), toml::de::Error> {
    T::deserialize(Deserializer::from(table)).map(drop)
}

/// The date in `value` at the bytes `span`, written as `date 2024-01-01`.
fn date_at(value: &Spanned<DeValue<'_>>, span: &Range<usize>) -> Option<String> {
    match value.get_ref() {
        DeValue::Datetime(date) if value.span() == *span => {
            Some(format!("{} {date}", date_in_words(date)))
        }
        DeValue::Array(elements) => elements.iter().find_map(|element| date_at(element, span)),
        DeValue::Table(table) => table.iter().find_map(|(_, value)| date_at(value, span)),
        _ => None,
    }
}

/// Puts `value` at `path`, making tables on the way.
fn put<'a>(table: &mut DeTable<'a>, path: &[&str], value: Spanned<DeValue<'a>>) {
    let Some((key, rest)) = path.split_first() else {
        return;
    };
    if rest.is_empty() {
        match table.get_mut(*key) {
            Some(old) => *old = value,
            None => {
                table.insert(Spanned::new(0..0, Cow::Owned((*key).to_owned())), value);
            }
        }
    } else if let Some(DeValue::Table(inner)) = table.get_mut(*key).map(Spanned::get_mut) {
        put(inner, rest, value);
    }
}

fn collect_leaves(schema: &Json, prefix: &str, leaves: &mut BTreeSet<String>) {
    for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
        let path = if prefix.is_empty() {
            key.clone()
        } else {
            format!("{prefix}.{key}")
        };
        if inner.get("properties").is_some() {
            collect_leaves(inner, &path, leaves);
        } else {
            leaves.insert(path);
        }
    }
}
