//! One of the algorithms with its hyperparameters, whatever their type.
//!
//! Owns the form that matrices and records give it, `{ "mcpo": { "d": 0.001, ... } }`, and leaves
//! everything else to its [`Definition`]. Start at [`Algorithm`].

use std::{collections::BTreeMap, fmt, sync::Arc};

use schemars::SchemaGenerator;
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, Error as _, MapAccess},
    ser::SerializeMap,
};
use serde_json::Value as Json;

use super::{
    AlgoError, catalogue, cloning,
    definition::{About, Definition, Learner, Start, Tunable},
    operations::{Counter, Operations},
    revision,
};
use crate::{
    env::EnvId,
    fit::{self, Mistake},
};

/// An algorithm with its hyperparameters; a copy shares them.
#[derive(Clone)]
pub struct Algorithm(Arc<dyn Configured>);

/// A definition, whatever the type of its hyperparameters.
pub trait Entry: Sync {
    /// Its name, its needs and its costs.
    fn about(&self) -> &About;

    /// The algorithm with its defaults for `env`.
    fn defaults(&'static self, env: EnvId) -> Algorithm;

    /// The JSON Schema of its hyperparameters.
    fn schema(&self, generator: SchemaGenerator) -> Json;

    /// The algorithm with the hyperparameters in `table`.
    ///
    /// # Errors
    ///
    /// A key is missing, unknown or out of range.
    fn read(&'static self, table: toml::Table) -> Result<Algorithm, Mistake>;

    /// The algorithm with the hyperparameters in `value`.
    ///
    /// # Errors
    ///
    /// A key is missing, unknown or out of range.
    fn read_json(&'static self, value: Json) -> Result<Algorithm, serde_json::Error>;
}

impl<H: Tunable> Entry for Definition<H> {
    fn about(&self) -> &About {
        &self.about
    }

    fn defaults(&'static self, env: EnvId) -> Algorithm {
        self.with((self.defaults)(env))
    }

    fn schema(&self, generator: SchemaGenerator) -> Json {
        generator.into_root_schema_for::<H>().to_value()
    }

    fn read(&'static self, table: toml::Table) -> Result<Algorithm, Mistake> {
        fit::read(table.into()).map(|hyperparameters| self.with(hyperparameters))
    }

    fn read_json(&'static self, value: Json) -> Result<Algorithm, serde_json::Error> {
        H::deserialize(value).map(|hyperparameters| self.with(hyperparameters))
    }
}

impl<H: Tunable> Definition<H> {
    /// The algorithm with these hyperparameters.
    pub fn with(&'static self, hyperparameters: H) -> Algorithm {
        Algorithm(Arc::new(Tuned {
            definition: self,
            hyperparameters,
        }))
    }
}

impl Algorithm {
    /// Its name, its needs and its costs.
    pub fn about(&self) -> &'static About {
        self.0.about()
    }

    /// Its name, as a matrix writes it.
    pub fn name(&self) -> &'static str {
        self.about().name
    }

    /// Whether it learns from a demonstration.
    pub fn uses_demonstration(&self) -> bool {
        self.about().demonstration
    }

    /// Whether it trains on the dense reward, whatever the environment's reward says.
    pub fn trains_on_dense_reward(&self) -> bool {
        self.about().dense
    }

    /// Whether it trains in the environment; other algorithms are only evaluated there.
    pub fn trains(&self) -> bool {
        self.about().trains
    }

    /// The revisions that its numbers depend on, by part.
    pub fn revisions(&self) -> BTreeMap<String, u32> {
        revision::of(self.about().part)
    }

    /// Its hyperparameters as TOML.
    pub fn hyperparameters(&self) -> toml::Table {
        self.0.toml()
    }

    /// The algorithm called `name` with these hyperparameters; `None` if no algorithm is called so.
    ///
    /// # Errors
    ///
    /// A key is missing, unknown or out of range.
    pub fn from_hyperparameters(name: &str, table: toml::Table) -> Option<Result<Self, Mistake>> {
        catalogue::find(name).map(|entry| entry.read(table))
    }

    /// The behaviour cloning of its agent before the first rollout; `None` if there is none.
    pub fn cloning(&self) -> Option<&cloning::Hyperparameters> {
        self.0.cloning()
    }

    /// The learner of a run, ready for its first rollout.
    ///
    /// # Errors
    ///
    /// The demonstration does not fit.
    pub fn start(&self, start: Start) -> Result<Learner, AlgoError> {
        self.0.start(start)
    }

    /// The work of an update, part by part, without the policy's passes of the rollout.
    pub(super) fn operations(&self, counter: &Counter<'_>) -> Vec<Operations> {
        self.0.operations(counter)
    }
}

/// A definition with hyperparameters of its type.
#[derive(Debug)]
struct Tuned<H: 'static> {
    definition: &'static Definition<H>,
    hyperparameters: H,
}

/// An algorithm with its hyperparameters, whatever their type.
trait Configured: fmt::Debug + Send + Sync {
    fn about(&self) -> &'static About;
    fn json(&self) -> Json;
    fn toml(&self) -> toml::Table;
    fn cloning(&self) -> Option<&cloning::Hyperparameters>;
    fn start(&self, start: Start) -> Result<Learner, AlgoError>;
    fn operations(&self, counter: &Counter<'_>) -> Vec<Operations>;
}

impl<H: Tunable> Configured for Tuned<H> {
    fn about(&self) -> &'static About {
        &self.definition.about
    }

    fn json(&self) -> Json {
        serde_json::to_value(&self.hyperparameters)
            .expect("hyperparameters are tables of numbers, names and lists")
    }

    fn toml(&self) -> toml::Table {
        toml::Table::try_from(&self.hyperparameters)
            .expect("hyperparameters are tables of numbers, names and lists")
    }

    fn cloning(&self) -> Option<&cloning::Hyperparameters> {
        self.definition
            .cloning
            .map(|cloning| cloning(&self.hyperparameters))
    }

    fn start(&self, start: Start) -> Result<Learner, AlgoError> {
        (self.definition.start)(self.hyperparameters.clone(), start)
    }

    fn operations(&self, counter: &Counter<'_>) -> Vec<Operations> {
        (self.definition.operations)(&self.hyperparameters, counter)
    }
}

impl fmt::Debug for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.name(), self.0.json())
    }
}

impl PartialEq for Algorithm {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name() && self.0.json() == other.0.json()
    }
}

impl Serialize for Algorithm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(1))?;
        map.serialize_entry(self.name(), &self.0.json())?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Algorithm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Tagged)
    }
}

/// Reads a table of one key, the algorithm's name.
struct Tagged;

impl<'de> de::Visitor<'de> for Tagged {
    type Value = Algorithm;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an algorithm with its hyperparameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Algorithm, A::Error> {
        let name: String = map
            .next_key()?
            .ok_or_else(|| A::Error::invalid_length(0, &self))?;
        let unknown = || {
            let names: Vec<String> = Algorithm::names().map(|name| format!("`{name}`")).collect();
            A::Error::custom(format!(
                "unknown algorithm `{name}`, expected one of {}",
                names.join(", ")
            ))
        };
        let entry = catalogue::find(&name).ok_or_else(unknown)?;
        let algorithm = entry
            .read_json(map.next_value()?)
            .map_err(A::Error::custom)?;
        match map.next_key::<String>()? {
            Some(_) => Err(A::Error::invalid_length(2, &self)),
            None => Ok(algorithm),
        }
    }
}
