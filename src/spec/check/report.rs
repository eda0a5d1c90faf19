//! Checks figures and tables.

use std::collections::HashSet;

use toml::{
    Spanned,
    de::{DeArray, DeTable, DeValue},
};

use super::{Checker, Value};
use crate::{fit::Step, spec::catalog::Section};

impl Checker<'_> {
    /// Checks `[[figures]]` or `[[tables]]`.
    pub(super) fn figures_or_tables(
        &mut self,
        value: &Value<'_>,
        key: &str,
        what: &str,
        section: &Section,
    ) {
        self.shown_tables(value, key, what, section, Self::shown);
    }

    /// Checks a list of tables of one type with unique names; `check` looks at each value that has
    /// the right type.
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
                this.note(
                    span.clone(),
                    format!("this {what} has no `{required}`"),
                    None,
                );
            }
            for (key, value) in table {
                let text = key.get_ref().as_ref();
                this.key(text, |this| {
                    if section.schema(&[text]).is_none() {
                        let known: Vec<&str> = section.keys(&[]).into_iter().flatten().collect();
                        return this.unknown_key(key, &format!(" of a {what}"), known.into_iter());
                    }
                    let before = this.errors.len();
                    this.each(section, text, value);
                    // A value of the wrong type is reported once, and not looked at further.
                    if this.errors.len() == before {
                        check(this, text, value);
                    }
                });
            }
        });
        let names = value
            .get_ref()
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(|table| table.get_ref().get("name"));
        let mut seen = HashSet::new();
        for name in names {
            let text = name.get_ref().as_str().unwrap_or_default();
            // Some file systems do not tell small letters from capitals.
            let file = text.to_ascii_lowercase();
            let of_statistics = key != "claims" && file.starts_with("statistics");
            let of_tables = || {
                file == "claims"
                    || ["-curves", "-float", "-seeds"]
                        .iter()
                        .any(|end| file.ends_with(end))
            };
            if key != "claims" && file == "readme"
                || of_statistics
                || ["tables", "settings"].contains(&key) && of_tables()
            {
                let message = format!("`{text}` is the name of one of the report's own files");
                self.note(name.span(), message, Some("another name is needed".into()));
            } else if !seen.insert(file) {
                self.note(name.span(), format!("two {key} are called `{text}`"), None);
            }
        }
    }

    /// Checks that no table of returns has the name of a table of settings: both are written to
    /// files of the same kinds.
    pub(super) fn different_files(&mut self, root: &DeTable<'_>) {
        let names = |key: &str| {
            let tables = root
                .get(key)
                .and_then(|value| value.get_ref().as_array())
                .into_iter()
                .flatten();
            let names = tables.filter_map(|table| table.get_ref().get("name"));
            names
                .filter_map(|name| Some((name.span(), name.get_ref().as_str()?.to_owned())))
                .collect::<Vec<_>>()
        };
        let tables: HashSet<String> = names("tables")
            .into_iter()
            .map(|(_, name)| name.to_ascii_lowercase())
            .collect();
        for (span, name) in names("settings") {
            if tables.contains(&name.to_ascii_lowercase()) {
                self.note(
                    span,
                    format!("a table of returns is also called `{name}`"),
                    None,
                );
            }
        }
    }

    /// Checks a value of a figure or table, which has the right type already.
    fn shown(&mut self, key: &str, value: &Value<'_>) {
        if key == "name" {
            self.name(value);
        }
    }

    /// Checks the value at `key` of `section`. Each element of a list is checked by itself, so that
    /// every mistake is found.
    fn each(&mut self, section: &Section, key: &str, value: &Value<'_>) {
        match value.get_ref().as_array() {
            Some(elements) if !elements.is_empty() && section.takes_lists(key) => {
                for (index, element) in elements.iter().enumerate() {
                    let mut alone = DeArray::new();
                    alone.push(element.clone());
                    let alone = Spanned::new(element.span(), DeValue::Array(alone));
                    self.within(Step::Index(index), |this| {
                        this.section(section, &[key], &alone)
                    });
                }
            }
            _ => self.section(section, &[key], value),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::spec::{Overrides, parse};

    /// What is said of `more` below a good matrix.
    fn errors(more: &str) -> String {
        let matrix = "[[matrix]]\nseed = [0]\nenv = ['Hopper-v2']\nalgorithm = ['mcpo']\n";
        let text = format!("name = 'x'\nbudget.env_steps = 4096\n{matrix}{more}");
        let parsed = parse(Path::new("x.toml"), &text, &Overrides::default());
        parsed.map_or_else(|errors| errors.render(false), |_| String::new())
    }

    #[test]
    fn how_a_figure_is_drawn_is_checked_where_it_is_written() {
        let figure = |more: &str| {
            errors(&format!(
                "[[figures]]\nname = 'f'\ntitle = ''\ny = 'mmd'\nseries = []\n{more}"
            ))
        };
        for good in [
            "panels = 'd'",
            "panels = ['epsilon=0', 'd=1e-3']",
            "width = 'full'",
            "width = 6",
            "band = 'seeds'",
        ] {
            assert_eq!(figure(good), "", "{good}");
        }
        for (bad, told) in [
            ("panels = 'tolerance'", "unknown axis `tolerance`"),
            (
                "panels = ['epsilon']",
                "`epsilon` is not of the form KEY=VALUE or KEY!=VALUE",
            ),
            ("panels = []", "at least one panel"),
            ("width = 'page'", "unknown width `page`"),
            ("width = 0.1", "0.1 is out of range"),
            ("band = 'sem'", "band"),
            ("smooth = 0", "smooth"),
            ("reference = 'table9'", "unknown reference `table9`"),
        ] {
            assert!(figure(bad).contains(told), "{bad}: {}", figure(bad));
        }
    }

    #[test]
    fn tables_of_settings_show_what_there_is_and_have_files_of_their_own() {
        let settings =
            |more: &str| errors(&format!("[[settings]]\nname = 't'\ntitle = ''\n{more}"));
        assert_eq!(
            settings("show = ['d', 'max_steps', 'actions']\nrows = ['env']"),
            ""
        );
        assert!(settings("show = ['tolerance']").contains("unknown parameter `tolerance`"));
        let table =
            "show = []\n[[tables]]\nname = 't'\ntitle = ''\nrows = ['env']\ncolumns = 'algorithm'";
        assert!(
            settings(table).contains("a table of returns is also called `t`"),
            "{}",
            settings(table)
        );
        let floats = errors("[[settings]]\nname = 't-float'\ntitle = ''\nshow = []");
        assert!(
            floats.contains("`t-float` is the name of one of the report's own files"),
            "{floats}"
        );
    }

    #[test]
    fn each_wrong_element_of_a_list_is_told_and_the_others_stand() {
        let series = |list: &str| {
            let found = errors(&format!(
                "[[figures]]\nname = 'f'\ntitle = ''\ny = 'mmd'\nseries = {list}\n"
            ));
            found.matches("unknown axis").count()
        };
        assert_eq!(
            [
                series("['epsilom', 'd', 'seeed']"),
                series("['seeed']"),
                series("['d']"),
                series("[]")
            ],
            [2, 1, 0, 0]
        );
    }
}
