//! Every key that a matrix can set, and the check of one value at a time.
//!
//! A key is checked by putting its value, alone, into a valid specimen of its type and reading
//! that. So every wrong value of a file is found, not just the first, and the types themselves
//! decide what is allowed.

use std::{collections::BTreeSet, ops::Range, sync::LazyLock};

use schemars::{JsonSchema, SchemaGenerator, generate::SchemaSettings};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value as Json;
use toml::{Spanned, de::DeValue};

use super::{
    Claim, Figure, Settings, SettingsTable, Slurm, Table,
    names::words,
    source::{inner, plain_value},
};
use crate::{
    algo::{Entry, catalogue},
    env::{EnvId, robot::Robot},
    fit::{self, Fault, Mistake, Step},
    quantity::constant,
};

/// A table of the file whose keys are the fields of one type.
pub(super) struct Section {
    /// The JSON Schema of the type, with nothing left to references.
    schema: Json,
    /// The dotted keys of all values.
    leaves: BTreeSet<String>,
    /// A valid value of the type.
    specimen: toml::Table,
    read: Box<Read>,
}

/// Reads a table, and tells what is wrong with it.
type Read = dyn Fn(toml::Table) -> Result<(), Mistake> + Send + Sync;

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
            table(specimen),
            Box::new(|table| fit::read::<T>(table.into()).map(drop)),
        )
    }

    /// The section of an algorithm's hyperparameters.
    fn algorithm(entry: &'static dyn Entry) -> Self {
        let mut schema = entry.schema(generator());
        schema
            .as_object_mut()
            .and_then(|fields| fields.remove("title"));
        let specimen = entry.defaults(EnvId::HalfCheetah).hyperparameters();
        Self::new(
            schema,
            specimen,
            Box::new(|table| entry.read(table).map(drop)),
        )
    }

    fn new(schema: Json, specimen: toml::Table, read: Box<Read>) -> Self {
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
    ///
    /// # Errors
    ///
    /// It does not fit; of a list, every element that does not.
    pub(super) fn check(
        &self,
        path: &[&str],
        value: &Spanned<DeValue<'_>>,
    ) -> Result<(), Vec<Refusal>> {
        let Err(refusal) = self.check_whole(path, value) else {
            return Ok(());
        };
        let elements = value.get_ref().as_array().into_iter().flatten();
        let alone = elements.filter_map(|element| {
            let list = DeValue::Array(std::iter::once(element.clone()).collect());
            let refusal = self
                .check_whole(path, &Spanned::new(value.span(), list))
                .err()?;
            // A list may be too short, or its elements may be wrong only together.
            (refusal.span != value.span()).then_some(refusal)
        });
        let alone: Vec<Refusal> = alone.collect();
        Err(if alone.is_empty() {
            vec![refusal]
        } else {
            alone
        })
    }

    fn check_whole(&self, path: &[&str], value: &Spanned<DeValue<'_>>) -> Result<(), Refusal> {
        let Some(plain) = plain_value(value) else {
            // All else that the parser lets pass is a value.
            let (number, expected, span) =
                too_large(value).unwrap_or(("a number".to_owned(), "a smaller one", value.span()));
            return Err(Refusal {
                message: format!("{number} is out of range"),
                says_all: false,
                label: Some(format!("expected {expected}")),
                span,
            });
        };
        let mut candidate = self.specimen.clone();
        put(&mut candidate, path, plain);
        (self.read)(candidate).map_err(|Mistake { fault, way }| {
            let (message, label) = words(&fault);
            let name = match &fault {
                Fault::UnknownKey { key: name, .. } | Fault::UnknownName { name, .. } => {
                    Some(name.as_str())
                }
                _ => None,
            };
            Refusal {
                message,
                says_all: matches!(fault, Fault::Objection { .. }),
                label,
                // A mistake outside of the value is one of the value too.
                span: way
                    .get(path.len()..)
                    .map_or(value.span(), |way| span(value, way, name)),
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

/// `value` as a table.
fn table<T: Serialize>(value: &T) -> toml::Table {
    toml::Table::try_from(value).expect("our own types are TOML")
}

/// A number in `value` that no type holds, as it is written, with what would do, and its bytes.
fn too_large(value: &Spanned<DeValue<'_>>) -> Option<(String, &'static str, Range<usize>)> {
    match value.get_ref() {
        DeValue::Integer(number) => {
            let fits = i64::from_str_radix(number.as_str(), number.radix()).is_ok();
            let expected = "a whole number that fits in 64 bits, or one with a point";
            (!fits).then(|| (number.to_string(), expected, value.span()))
        }
        DeValue::Float(number) => {
            let fits = plain_value(value).is_some();
            let expected = "a number that is not beyond 1.8e308";
            (!fits).then(|| (number.to_string(), expected, value.span()))
        }
        DeValue::Array(elements) => elements.iter().find_map(too_large),
        DeValue::Table(table) => table.values().find_map(too_large),
        _ => None,
    }
}

/// The bytes of what is at the end of `way` in `value`, or of the last that is there on the way; of
/// the key `name`, if that is there.
fn span(value: &Spanned<DeValue<'_>>, way: &[Step], name: Option<&str>) -> Range<usize> {
    let key = |name| {
        let table = value.get_ref().as_table()?;
        table.get_key_value(name).map(|(key, _)| key.span())
    };
    match way {
        [] => name.and_then(key).unwrap_or(value.span()),
        [Step::Key(last)] if name == Some(last) => key(last).unwrap_or(value.span()),
        [step, rest @ ..] => {
            inner(step, value).map_or(value.span(), |inner| span(inner, rest, name))
        }
    }
}

/// Puts `value` at `path`, making tables on the way.
fn put(table: &mut toml::Table, path: &[&str], value: toml::Value) {
    let Some((key, rest)) = path.split_first() else {
        return;
    };
    if rest.is_empty() {
        table.insert((*key).to_owned(), value);
    } else if let Some(toml::Value::Table(inner)) = table.get_mut(*key) {
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
