//! Users' robots: from the tables under `[environments]` that describe them to environments.
//!
//! Owns which tables these are, how the layers' keys for one robot become one table, and where its
//! mistakes are in a file. The meaning of the keys is in [`env::robot`](crate::env::robot); the
//! values that a key may have are `check`'s. Start at [`Robots::read`].

use std::{collections::BTreeMap, path::Path, sync::Arc};

use super::{
    catalog::Catalog,
    error::{Place, SpecError},
    names::words,
    source::{Source, plain_value},
};
use crate::{
    env::{EnvError, EnvId, robot::Robot},
    fit::{self, Mistake, Step},
};

/// The robots that the layers of one file describe.
#[derive(Default)]
pub(super) struct Robots {
    /// The robots by name; `None` for one with a mistake.
    known: BTreeMap<String, Option<EnvId>>,
    /// Why tables are no robots, for mistakes that the check of single values cannot see: a key
    /// that is missing within.
    pub(super) unread: Vec<SpecError>,
}

impl Robots {
    /// The robots that `sources`, weakest first, describe, and the mistakes of each as a whole.
    /// A mistake in a single value is reported by the check of its layer, not here.
    pub(super) fn read(sources: &[Source<'_>]) -> (Self, Vec<SpecError>) {
        let mut tables: BTreeMap<String, toml::Table> = BTreeMap::new();
        for source in sources {
            for (name, table) in written(source) {
                // A model is named relative to its own file, which another may extend.
                let folder = source.layer.folder();
                tables
                    .entry(name)
                    .or_default()
                    .extend(table.into_iter().map(|(key, value)| match value {
                        toml::Value::String(path) if key == MODEL => (
                            key,
                            toml::Value::String(folder.join(path).to_string_lossy().into_owned()),
                        ),
                        value => (key, value),
                    }));
            }
        }
        // For a name that ships, `check` refuses the keys that only a robot has.
        tables.retain(|name, table| !ships(name) && table.keys().any(|key| is_robots_alone(key)));
        let (mut robots, mut errors) = (Self::default(), Vec::new());
        for (name, table) in tables {
            let described = Described {
                name: &name,
                sources,
            };
            let missing = described.missing();
            let found = if missing.is_empty() {
                match fit::read(table.into()) {
                    Ok(robot) => described.environment(robot),
                    Err(error) => {
                        robots.unread.push(described.unread(&error));
                        Err(Vec::new())
                    }
                }
            } else {
                Err(missing)
            };
            robots
                .known
                // A robot with mistakes is known too, so that its name is not reported as unknown.
                .insert(name.clone(), found.as_ref().ok().copied());
            errors.extend(found.err().into_iter().flatten());
        }
        (robots, errors)
    }

    /// The environment called `name`: one of these robots, or one that ships.
    ///
    /// # Errors
    ///
    /// There is none; the error is `None` for a robot whose own mistakes are already reported.
    pub(super) fn find(&self, name: &str) -> Result<EnvId, Option<EnvError>> {
        match self.known.get(name) {
            Some(robot) => robot.ok_or(None),
            // A robot from another file is not known here.
            None => match name.parse::<EnvId>() {
                Ok(env) if !env.is_own() => Ok(env),
                _ => Err(Some(self.unknown(name))),
            },
        }
    }

    /// Whether the file describes a robot of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.known.contains_key(name)
    }

    fn unknown(&self, name: &str) -> EnvError {
        let own: Vec<&str> = self.known.keys().map(String::as_str).collect();
        EnvError::UnknownEnvironment {
            name: name.to_owned(),
            known: EnvId::known_instead(name, &own),
        }
    }
}

/// The key that names the model.
const MODEL: &str = "model";

/// Whether `key` is one that only a robot's table has.
pub(super) fn is_robots_alone(key: &str) -> bool {
    let catalog = Catalog::get();
    catalog.robot.schema(&[key]).is_some() && catalog.settings.schema(&[key]).is_none()
}

/// Whether an environment of this name ships.
fn ships(name: &str) -> bool {
    EnvId::known().any(|(known, _)| known == name)
}

/// The tables under `[environments]` in `source`, reduced to the keys of a robot's table.
fn written(source: &Source<'_>) -> Vec<(String, toml::Table)> {
    let environments = source
        .tree
        .get_ref()
        .get("environments")
        .and_then(|value| value.get_ref().as_table());
    let robot = &Catalog::get().robot;
    let tables = environments
        .into_iter()
        .flatten()
        .filter_map(|(name, value)| {
            let keys = value
                .get_ref()
                .as_table()?
                .iter()
                .filter(|(key, _)| robot.schema(&[key.get_ref()]).is_some());
            let table = keys
                .filter_map(|(key, value)| Some((key.get_ref().to_string(), plain_value(value)?)))
                .collect();
            Some((name.get_ref().to_string(), table))
        });
    tables.collect()
}

/// One robot, and where it is described.
struct Described<'a> {
    name: &'a str,
    sources: &'a [Source<'a>],
}

impl Described<'_> {
    /// The environment of `robot`.
    ///
    /// # Errors
    ///
    /// The mistakes of the robot as a whole.
    fn environment(&self, robot: Robot) -> Result<EnvId, Vec<SpecError>> {
        let model = robot.model.clone();
        EnvId::of_robot(self.name, robot).map_err(|error| vec![self.located(error, &model)])
    }

    /// The required keys that are nowhere written.
    fn missing(&self) -> Vec<SpecError> {
        let required = Catalog::get().robot.required();
        let is_written = |key: &str| {
            let way = ["environments", self.name, key].map(|key| Step::Key(key.to_owned()));
            self.sources
                .iter()
                .any(|source| source.span(&way).is_some())
        };
        required
            .filter(|key| !is_written(key))
            .map(|key| {
                let message = format!("the robot `{}` has no `{key}`", self.name);
                self.error(&[], message, Some(format!("write `{key} = ...`")))
            })
            .collect()
    }

    /// The `error` of a table that is no robot.
    fn unread(&self, Mistake { fault, way }: &Mistake) -> SpecError {
        let (message, label) = words(fault);
        self.error(way, format!("`{}`: {message}", self.name), label)
    }

    /// Places `error` where it was written: in the robot's table, or in its model.
    fn located(&self, error: EnvError, model: &Path) -> SpecError {
        match error {
            EnvError::Robot {
                key, index, flaw, ..
            } => {
                let way: Vec<Step> = std::iter::once(Step::Key(key.to_owned()))
                    .chain(index.map(Step::Index))
                    .collect();
                self.error(&way, format!("`{key}`: {flaw}"), None)
            }
            EnvError::Engine { message, .. } => {
                let message = message.trim_end().to_owned();
                let in_model = in_model(&message, model);
                let message = format!("MuJoCo refuses the model of `{}`: {message}", self.name);
                match in_model {
                    Some(place) => SpecError::new(message, place, None),
                    None => self.error(&[Step::Key(MODEL.to_owned())], message, None),
                }
            }
            // The table's header shows the name.
            error @ EnvError::BadName { .. } => self.error(&[], error.to_string(), None),
            EnvError::NameTaken { by, .. } => {
                let message = format!("`{}` is taken: {by} ships with the program", self.name);
                self.error(&[], message, Some("call the robot otherwise".to_owned()))
            }
            other => self.error(&[], other.to_string(), None),
        }
    }

    /// `message` at the end of `way` in the robot's table, or at the nearest key above it that is
    /// written; in the strongest layer that has it.
    fn error(&self, way: &[Step], message: String, label: Option<String>) -> SpecError {
        let table = [
            Step::Key("environments".to_owned()),
            Step::Key(self.name.to_owned()),
        ];
        let place = (0..=way.len()).rev().find_map(|length| {
            let way: Vec<Step> = table.iter().chain(&way[..length]).cloned().collect();
            self.sources
                .iter()
                .rev()
                .find_map(|source| Some(source.layer.place(source.span(&way)?)))
        });
        let place = place.unwrap_or_else(|| Place::Layer(self.name.to_owned()));
        SpecError::new(message, place, label)
    }
}

/// The line of the file `model` that MuJoCo's `message` names; `None` if it names none.
fn in_model(message: &str, model: &Path) -> Option<Place> {
    let (_, after) = message.rsplit_once("line ")?;
    let digits = after.split(|c: char| !c.is_ascii_digit()).next()?;
    let line: usize = digits.parse().ok()?;
    let text = std::fs::read_to_string(model).ok()?;
    let start = text
        .split_inclusive('\n')
        .take(line.checked_sub(1)?)
        .map(str::len)
        .sum::<usize>();
    let whole = text.get(start..)?.lines().next()?;
    let span = start + whole.len() - whole.trim_start().len()..start + whole.len();
    Some(Place::File {
        path: model.to_owned(),
        text: Arc::from(text),
        span,
    })
}
