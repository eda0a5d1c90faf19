//! Checks one layer, key by key, each value by itself. How values go together is checked by
//! `combinations`.

mod claims;
mod matrix;
mod report;

use std::{borrow::Cow, ops::Range};

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{
    Algorithm, Parameter,
    arguments::AxisList,
    catalog::{Catalog, Refusal, Section},
    error::SpecError,
    layer::Layer,
    names::{nearest, nearest_label},
    robots::{Robots, is_robots_alone},
    source::{Source, plain_value},
};
use crate::{
    env::{EnvError, EnvId},
    fit::{Step, date_in_words},
};

/// Keys of the file that are neither settings nor hyperparameters.
pub(super) const ROOT_KEYS: [&str; 11] = [
    "name",
    "description",
    "extends",
    "matrix",
    "algorithms",
    "environments",
    "figures",
    "tables",
    "settings",
    "claims",
    "slurm",
];
/// The lists that every block has.
pub(super) const BLOCK_KEYS: [&str; 3] = ["seed", "env", "algorithm"];

type Value<'a> = Spanned<DeValue<'a>>;

/// The valid part of a layer, and the errors of the rest.
pub(super) struct Checked {
    pub(super) table: toml::Table,
    pub(super) errors: Vec<SpecError>,
}

/// Checks every value of `source` by itself.
/// The lists in `axes` replace those of its blocks, and are checked in their place.
/// `robots` are the robots that the file describes.
pub(super) fn check(source: &Source<'_>, axes: &[AxisList], robots: &Robots) -> Checked {
    let mut checker = Checker {
        layer: source.layer,
        axes,
        robots,
        errors: Vec::new(),
        bad: Vec::new(),
        way: Vec::new(),
    };
    checker.root(source.tree.get_ref());
    let Checker {
        errors, mut bad, ..
    } = checker;
    let mut table = plain_value(&Spanned::new(
        source.tree.span(),
        DeValue::Table(source.tree.get_ref().clone()),
    ));
    // Later elements first, so that the earlier ones keep their index.
    bad.sort_by(|a, b| b.cmp(a));
    bad.dedup();
    if let Some(table) = &mut table {
        bad.iter().for_each(|way| remove(table, way));
    }
    let table = match table {
        Some(toml::Value::Table(table)) => table,
        _ => toml::Table::new(),
    };
    Checked { table, errors }
}

/// Removes the value at the end of `way`.
fn remove(value: &mut toml::Value, way: &[Step]) {
    match (value, way) {
        (toml::Value::Table(table), [Step::Key(key)]) => {
            table.remove(key);
        }
        (toml::Value::Array(array), [Step::Index(index)]) if *index < array.len() => {
            array.remove(*index);
        }
        (toml::Value::Table(table), [Step::Key(key), rest @ ..]) => {
            if let Some(inner) = table.get_mut(key) {
                remove(inner, rest);
            }
        }
        (toml::Value::Array(array), [Step::Index(index), rest @ ..]) => {
            if let Some(inner) = array.get_mut(*index) {
                remove(inner, rest);
            }
        }
        _ => {}
    }
}

struct Checker<'a> {
    layer: &'a Layer,
    axes: &'a [AxisList],
    robots: &'a Robots,
    errors: Vec<SpecError>,
    /// The paths of wrong values.
    bad: Vec<Vec<Step>>,
    /// The path of the value being checked.
    way: Vec<Step>,
}

impl<'a> Checker<'a> {
    /// Reports the value being checked as wrong, and marks it for removal.
    fn wrong(&mut self, span: Range<usize>, message: impl Into<String>, label: Option<String>) {
        self.bad.push(self.way.clone());
        self.note(span, message, label);
    }

    /// Reports a mistake, but keeps the value being checked.
    fn note(&mut self, span: Range<usize>, message: impl Into<String>, label: Option<String>) {
        let place = self.layer.place(span);
        let key = |step: &Step| match step {
            Step::Key(key) => Some(key.clone()),
            Step::Index(_) => None,
        };
        let about = self.way.iter().filter_map(key).collect();
        self.errors.push(SpecError {
            message: message.into(),
            place,
            label,
            help: None,
            about,
        });
    }

    fn wrong_type(&mut self, value: &Value<'_>, what: &str, expected: &str) {
        let message = format!("{what} cannot be {}", article(value.get_ref()));
        self.wrong(value.span(), message, Some(format!("expected {expected}")));
    }

    /// A suggestion for an unknown name; none after the first errors, since nobody reads so many.
    fn hint(&self, known: impl FnOnce() -> Option<String>) -> Option<String> {
        const MOST: usize = 100;
        (self.errors.len() < MOST).then(known).flatten()
    }

    /// Notes that the last reported mistake concerns `key`, which was probably meant.
    fn meant(&mut self, key: Option<String>) {
        if let Some(error) = self.errors.last_mut() {
            error.about.extend(key);
        }
    }

    fn within(&mut self, step: Step, check: impl FnOnce(&mut Self)) {
        self.way.push(step);
        check(self);
        self.way.pop();
    }

    fn key(&mut self, key: &str, check: impl FnOnce(&mut Self)) {
        self.within(Step::Key(key.into()), check);
    }

    fn root(&mut self, table: &DeTable<'_>) {
        let settings = &Catalog::get().settings;
        for (key, value) in table {
            let (span, key) = (key.span(), key.get_ref().as_ref());
            self.key(key, |this| match key {
                "name" => this.name(value),
                "description" if !value.get_ref().is_str() => {
                    this.wrong_type(value, "`description`", "a string")
                }
                "description" => {}
                "extends" if this.layer.path.is_none() => {
                    this.wrong(span, "`extends` can only be written in a file", None);
                }
                "extends" if !value.get_ref().is_str() => {
                    this.wrong_type(value, "`extends`", "the name of a file")
                }
                "extends" => {}
                "matrix"
                    if value
                        .get_ref()
                        .as_array()
                        .is_some_and(|blocks| blocks.is_empty()) =>
                {
                    let label = "write a `[[matrix]]` block".to_owned();
                    this.wrong(value.span(), "`matrix` is empty", Some(label));
                }
                "matrix" => {
                    this.tables(value, "matrix", |this, block, span| this.block(block, span))
                }
                "algorithms" => this.table(value, "`algorithms`", Self::algorithms),
                "environments" => this.table(value, "`environments`", Self::environments),
                "figures" => {
                    this.figures_or_tables(value, "figures", "figure", &Catalog::get().figure)
                }
                "tables" => this.figures_or_tables(value, "tables", "table", &Catalog::get().table),
                "settings" => this.figures_or_tables(
                    value,
                    "settings",
                    "table",
                    &Catalog::get().settings_table,
                ),
                "claims" => this.claims(value),
                "slurm" => this.section(&Catalog::get().slurm, &[key], value),
                _ if settings.schema(&[key]).is_some() => this.section(settings, &[key], value),
                _ => {
                    // Settings stand at the top of a file, beside its own keys.
                    let known = || {
                        ROOT_KEYS
                            .into_iter()
                            .chain(settings.keys(&[]).into_iter().flatten())
                    };
                    let meant = this.hint(|| nearest(key, known()).map(str::to_owned));
                    let label = this.hint(|| match Parameter::find(key) {
                        Some(Parameter::Shared(_)) => Some(
                            "a hyperparameter: it belongs under `[algorithms.NAME]` or in a block \
                             of the matrix"
                                .into(),
                        ),
                        _ if Catalog::get().algorithm(key).is_some() => {
                            Some(format!("write `algorithms.{key}`"))
                        }
                        _ => nearest_label("key", key, known()),
                    });
                    this.wrong(span, format!("unknown key `{key}`"), label);
                    this.meant(meant);
                }
            });
        }
        self.different_files(table);
    }

    /// Checks a name that becomes a file's or a folder's.
    fn name(&mut self, value: &Value<'_>) {
        match value.get_ref().as_str() {
            None => self.wrong_type(value, "a name", "a string"),
            Some(name) if is_file_name(name) => {}
            Some(name) => self.wrong(
                value.span(),
                format!("`{}` cannot name a file", name.escape_debug()),
                Some(
                    "expected letters, digits, `.`, `_` and `-`, not starting with `.`, \
                     at most 100 of them"
                        .into(),
                ),
            ),
        }
    }

    fn table(
        &mut self,
        value: &Value<'_>,
        what: &str,
        check: impl FnOnce(&mut Self, &DeTable<'_>),
    ) {
        match value.get_ref().as_table() {
            Some(table) => check(self, table),
            None => self.wrong_type(value, what, "a table"),
        }
    }

    /// Checks a list of tables, `[[key]]`.
    fn tables(
        &mut self,
        value: &Value<'_>,
        key: &str,
        check: impl Fn(&mut Self, &DeTable<'_>, Range<usize>),
    ) {
        let Some(elements) = value.get_ref().as_array() else {
            return self.wrong_type(
                value,
                &format!("`{key}`"),
                &format!("blocks, each headed `[[{key}]]`"),
            );
        };
        for (index, element) in elements.iter().enumerate() {
            self.within(Step::Index(index), |this| {
                match element.get_ref().as_table() {
                    Some(table) => check(this, table, element.span()),
                    None => this.note(
                        element.span(),
                        format!("an element of `{key}` must be a table"),
                        None,
                    ),
                }
            });
        }
    }

    /// Checks the value at `path` of `section`, or every value of the table there.
    fn section(&mut self, section: &Section, path: &[&str], value: &Value<'_>) {
        let title = path.join(".");
        match section.keys(path) {
            None => {
                if let Err(refusals) = section.check(path, value) {
                    self.refused(&title, refusals);
                }
            }
            Some(known) => {
                let known: Vec<&str> = known.collect();
                self.table(value, &format!("`{title}`"), |this, table| {
                    for (key, value) in table {
                        this.key(key.get_ref(), |this| {
                            if known.contains(&key.get_ref().as_ref()) {
                                let path: Vec<&str> = path
                                    .iter()
                                    .copied()
                                    .chain([key.get_ref().as_ref()])
                                    .collect();
                                this.section(section, &path, value);
                            } else {
                                this.unknown_key(
                                    key,
                                    &format!(" in `{title}`"),
                                    known.iter().copied(),
                                );
                            }
                        });
                    }
                });
            }
        }
    }

    /// Reports what is wrong with the value of `key`.
    fn refused(&mut self, key: &str, refusals: Vec<Refusal>) {
        for refusal in refusals {
            let message = if refusal.says_all {
                refusal.message
            } else {
                format!("`{key}`: {}", refusal.message)
            };
            self.wrong(refusal.span, message, refusal.label);
        }
    }

    fn unknown_key<'k>(
        &mut self,
        key: &Spanned<Cow<'_, str>>,
        whose: &str,
        known: impl Iterator<Item = &'k str> + Clone,
    ) {
        let meant = self.hint(|| nearest(key.get_ref(), known.clone()).map(str::to_owned));
        let label = self.hint(|| nearest_label("key", key.get_ref(), known));
        self.wrong(
            key.span(),
            format!("unknown key `{}`{whose}", key.get_ref()),
            label,
        );
        self.meant(meant);
    }

    /// Checks `[algorithms]`, of the file or of an environment.
    fn algorithms(&mut self, table: &DeTable<'_>) {
        for (name, value) in table {
            self.key(name.get_ref(), |this| {
                match Catalog::get().algorithm(name.get_ref()) {
                    Some(section) => {
                        this.table(
                            value,
                            &format!("`algorithms.{}`", name.get_ref()),
                            |this, table| {
                                for (key, value) in table {
                                    this.key(key.get_ref(), |this| {
                                        if section.schema(&[key.get_ref()]).is_some() {
                                            this.section(section, &[key.get_ref()], value);
                                        } else {
                                            let whose = format!(" of `{}`", name.get_ref());
                                            this.unknown_key(
                                                key,
                                                &whose,
                                                section
                                                    .keys(&[])
                                                    .into_iter()
                                                    .flatten()
                                                    .collect::<Vec<_>>()
                                                    .into_iter(),
                                            );
                                        }
                                    });
                                }
                            },
                        );
                    }
                    None => this.unknown_algorithm(name.get_ref(), name.span()),
                }
            });
        }
    }

    fn unknown_algorithm(&mut self, name: &str, span: Range<usize>) {
        let label = nearest_label("algorithm", name, Algorithm::names());
        self.wrong(span, format!("unknown algorithm `{name}`"), label);
    }

    /// The environment called `name`; reports an error where there is none.
    fn environment(&mut self, name: &str, span: Range<usize>) -> Option<EnvId> {
        match self.robots.find(name) {
            Ok(env) => return Some(env),
            // A robot with mistakes of its own is already reported.
            Err(None) => self.bad.push(self.way.clone()),
            Err(Some(EnvError::UnknownEnvironment { name, known })) => {
                self.wrong(span, format!("unknown environment `{name}`"), Some(known));
            }
            Err(Some(other)) => self.wrong(span, other.to_string(), None),
        }
        None
    }

    fn environments(&mut self, table: &DeTable<'_>) {
        let mut seen = Vec::new();
        for (name, value) in table {
            self.key(name.get_ref(), |this| {
                let name_text = name.get_ref().as_ref();
                let env = this.environment(name_text, name.span());
                if env.is_none() && !this.robots.has(name_text) {
                    return;
                }
                if env.is_some_and(|env| seen.contains(&env)) {
                    this.wrong(
                        name.span(),
                        format!("{name_text} has two tables, under two of its names"),
                        None,
                    );
                }
                seen.extend(env);
                let name = env.map_or(name_text, |env| env.name());
                this.table(
                    value,
                    &format!("`environments.\"{name}\"`"),
                    |this, table| this.of_environment(name, table),
                );
            });
        }
    }

    /// Checks the table of the environment called `name`: settings, and a robot's own keys.
    fn of_environment(&mut self, name: &str, table: &DeTable<'_>) {
        let Catalog {
            settings, robot, ..
        } = Catalog::get();
        let is_robot = self.robots.has(name);
        let first_of_robots = table
            .keys()
            .filter(|key| is_robots_alone(key.get_ref()))
            .map(|key| key.span().start)
            .min();
        for (key, value) in table {
            let text = key.get_ref().as_ref();
            self.key(text, |this| match text {
                "algorithms" => this.table(value, "`algorithms`", Self::algorithms),
                _ if settings.schema(&[text]).is_some() => this.section(settings, &[text], value),
                _ if is_robot && robot.schema(&[text]).is_some() => {
                    this.section(robot, &[text], value)
                }
                _ if is_robots_alone(text) => {
                    this.bad.push(this.way.clone());
                    // The mistake is the name: one, however many keys follow from it.
                    if first_of_robots == Some(key.span().start) {
                        let label = "a robot of your own needs a name of its own".to_owned();
                        let message =
                            format!("`{text}` cannot be set: {name} ships with the program");
                        this.note(key.span(), message, Some(label));
                    }
                }
                _ => {
                    let robots = robot.keys(&[]).into_iter().flatten().filter(|_| is_robot);
                    let known = settings
                        .keys(&[])
                        .into_iter()
                        .flatten()
                        .chain(["algorithms"])
                        .chain(robots);
                    let known: Vec<&str> = known.collect();
                    this.unknown_key(key, &format!(" of {name}"), known.into_iter());
                }
            });
        }
    }
}

/// Whether `name` can be the name of a file or folder anywhere.
pub(super) fn is_file_name(name: &str) -> bool {
    let safe = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    (1..=100).contains(&name.len()) && !name.starts_with('.') && name.chars().all(safe)
}

fn article(value: &DeValue<'_>) -> String {
    match value {
        DeValue::Array(_) => "a list".into(),
        DeValue::Boolean(_) => "true or false".into(),
        DeValue::Integer(_) => "a whole number".into(),
        DeValue::Float(_) => "a number with a point".into(),
        DeValue::Datetime(date) => format!("a {}", date_in_words(date)),
        DeValue::String(_) | DeValue::Table(_) => format!("a {}", value.type_str()),
    }
}
