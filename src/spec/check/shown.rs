//! The check of figures and tables.

use std::collections::HashSet;

use super::{BLOCK_KEYS, Checker, Value};
use crate::spec::{Parameter, Selection, catalog::Section, figure, names::nearest_label};

impl Checker<'_> {
    /// `[[figures]]` or `[[tables]]`.
    pub(super) fn figures_or_tables(&mut self, value: &Value<'_>, key: &str, what: &str, section: &Section) {
        self.shown_tables(value, key, what, section, Self::shown);
    }

    /// A list of tables of one type with names of their own; `check` looks at a value that has the right type.
    pub(super) fn shown_tables(
        &mut self,
        value: &Value<'_>,
        key: &str,
        what: &str,
        section: &Section,
        check: impl Fn(&mut Self, &str, &Value<'_>),
    ) {
        self.tables(value, key, |this, table, span| {
            for required in section.required().filter(|key| !table.contains_key(*key)) {
                this.note(span.clone(), format!("this {what} has no `{required}`"), None);
            }
            for (key, value) in table {
                let text = key.get_ref().as_ref();
                this.key(text, |this| {
                    if section.schema(&[text]).is_none() {
                        let known: Vec<&str> = section.keys(&[]).into_iter().flatten().collect();
                        return this.unknown_key(key, &format!(" of a {what}"), known.into_iter());
                    }
                    let before = this.errors.len();
                    this.section(section, &[text], value);
                    if this.errors.len() == before {
                        check(this, text, value);
                    }
                });
            }
        });
        let names = value.get_ref().as_array().into_iter().flatten().filter_map(|table| table.get_ref().get("name"));
        let mut seen = HashSet::new();
        for name in names {
            let text = name.get_ref().as_str().unwrap_or_default();
            // Some file systems do not tell small letters from capitals.
            let file = text.to_ascii_lowercase();
            let of_tables = || file == "claims" || ["-curves", "-seeds"].iter().any(|end| file.ends_with(end));
            if key != "claims" && file == "readme" || key == "tables" && of_tables() {
                let message = format!("`{text}` is the name of a file that every report has of its own");
                self.note(name.span(), message, Some("another name is needed".into()));
            } else if !seen.insert(file) {
                self.note(name.span(), format!("two {key} are called `{text}`"), None);
            }
        }
    }

    /// A value of a figure or table that has the right type.
    fn shown(&mut self, key: &str, value: &Value<'_>) {
        let one = value.get_ref().as_str();
        let many = value.get_ref().as_array().into_iter().flatten();
        match key {
            "name" => self.name(value),
            "series" | "rows" => many.for_each(|element| self.dimension(element)),
            "columns" => self.dimension(value),
            "y" if one.is_some_and(|column| figure::WORDS.contains(&column)) => {
                let message = format!("`{}` holds words; a figure draws numbers", one.unwrap_or_default());
                self.wrong(value.span(), message, None);
            }
            "y" => self.known("y", value, &figure::columns()),
            "reference" => self.known("reference", value, &figure::REFERENCES),
            "only" => {
                if let Some(Err(error)) = one.map(Selection::parse) {
                    self.wrong(value.span(), error.to_string(), None);
                }
            }
            _ => {}
        }
    }

    /// What runs can be told apart by.
    fn dimension(&mut self, value: &Value<'_>) {
        let names = Parameter::names();
        let known: Vec<&str> = BLOCK_KEYS.into_iter().chain(names.iter().map(String::as_str)).collect();
        self.known("axis", value, &known);
    }

    pub(super) fn known(&mut self, what: &str, value: &Value<'_>, known: &[&str]) {
        if let Some(name) = value.get_ref().as_str().filter(|name| !known.contains(name)) {
            self.wrong(
                value.span(),
                format!("unknown {what} `{name}`"),
                nearest_label(what, name, known.iter().copied()),
            );
        }
    }
}
