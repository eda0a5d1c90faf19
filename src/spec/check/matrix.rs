//! The check of a block of the matrix.

use std::{collections::HashSet, ops::Range};

use toml::de::{DeArray, DeTable};

use super::{BLOCK_KEYS, Checker, Value};
use crate::{
    fit::Step,
    spec::{
        Algorithm, Parameter,
        catalog::{Catalog, Section},
        names::{list, nearest_label},
        source::plain_value,
    },
};

impl Checker<'_> {
    /// Checks one `[[matrix]]` block, whose header is at `span`.
    pub(super) fn block(&mut self, block: &DeTable<'_>, span: Range<usize>) {
        for key in BLOCK_KEYS
            .into_iter()
            .filter(|key| !block.contains_key(*key))
        {
            self.note(
                span.clone(),
                format!("this block has no `{key}`"),
                Some(format!("write `{key} = [...]`")),
            );
        }
        let algorithms = self.algorithms_of(block);
        let mut seen: Vec<(&str, Parameter)> = Vec::new();
        for (name, value) in block {
            let (span, key) = (name.span(), name.get_ref().as_ref());
            self.key(key, |this| {
                match this.axes.iter().find(|axis| axis.key == key) {
                    // The argument replaces the file's list, so mistakes are reported there.
                    Some(axis) => {
                        let (source, _) = axis.layer.parse();
                        let file = std::mem::replace(&mut this.layer, &axis.layer);
                        if let Some(value) = source.tree.get_ref().get(key) {
                            this.axis(key, span.clone(), value, &algorithms);
                        }
                        this.layer = file;
                    }
                    None => this.axis(key, span.clone(), value, &algorithms),
                }
                let Some(parameter) = Parameter::find(key) else {
                    return;
                };
                // `d` and `mcpo.d` are one number of MCPO.
                let same = |(_, other): &&(&str, Parameter)| {
                    algorithms.iter().any(|name| parameter.is(other, name))
                };
                if let Some((other, _)) = seen.iter().find(same) {
                    this.wrong(
                        span,
                        format!("the axes `{other}` and `{key}` are the same"),
                        None,
                    );
                }
                seen.push((key, parameter));
            });
        }
    }

    /// The known algorithms of a block, for the check of its axes.
    fn algorithms_of(&self, block: &DeTable<'_>) -> Vec<&'static str> {
        let replaced = self
            .axes
            .iter()
            .find(|axis| axis.key == "algorithm")
            .map(|axis| axis.layer.parse().0);
        let value = match &replaced {
            Some(source) => source.tree.get_ref().get("algorithm"),
            None => block.get("algorithm"),
        };
        let names: Vec<&str> = value
            .and_then(|value| value.get_ref().as_array())
            .into_iter()
            .flatten()
            .filter_map(|name| name.get_ref().as_str())
            .collect();
        Algorithm::names()
            .filter(|name| names.contains(name))
            .collect()
    }

    /// Checks one list of a block.
    fn axis(&mut self, key: &str, span: Range<usize>, value: &Value<'_>, algorithms: &[&str]) {
        let parameter = Parameter::find(key);
        if !BLOCK_KEYS.contains(&key) {
            let names = || Parameter::names();
            let had = |name: &&str| {
                Parameter::find(name).is_some_and(|known| {
                    algorithms
                        .iter()
                        .any(|algorithm| known.applies_to(algorithm))
                })
            };
            match &parameter {
                None => {
                    let label = self.hint(|| {
                        match value
                            .get_ref()
                            .as_table()
                            .and_then(|table| table.keys().next())
                        {
                            // TOML reads `mcpo.d` without quotation marks as a table `mcpo`.
                            Some(inner) => Some(format!(
                                "write `\"{key}.{}\" = [...]`, with quotation marks",
                                inner.get_ref()
                            )),
                            None => {
                                let names = names();
                                nearest_label(
                                    "axis",
                                    key,
                                    BLOCK_KEYS
                                        .into_iter()
                                        .chain(names.iter().map(String::as_str)),
                                )
                            }
                        }
                    });
                    return self.wrong(span, format!("unknown axis `{key}`"), label);
                }
                Some(parameter)
                    // Without an algorithm that is known, nothing can be said of what applies.
                    if !algorithms.is_empty()
                        && !algorithms.iter().any(|name| parameter.applies_to(name)) =>
                {
                    let label = self.hint(|| {
                        nearest_label(
                            "axis of these algorithms",
                            key,
                            names().iter().map(String::as_str).filter(had),
                        )
                    });
                    let message = format!(
                        "no algorithm of this block has `{key}`: it runs {}",
                        list(algorithms.iter().copied())
                    );
                    return self.wrong(span, message, label);
                }
                Some(_) => {}
            }
        }
        let Some(elements) = value.get_ref().as_array() else {
            return self.wrong_type(
                value,
                &format!("the axis `{key}`"),
                "a list, such as `[...]` with one value",
            );
        };
        if elements.is_empty() {
            return self.wrong(
                value.span(),
                format!("the list of `{key}` is empty, so there is nothing to run"),
                None,
            );
        }
        self.elements(key, elements, |this, element| match (key, &parameter) {
            ("seed", _) => this.seed(element),
            ("env", _) => match element.get_ref().as_str() {
                Some(name) => this
                    .environment(name, element.span())
                    .map(|env| env.to_string()),
                None => {
                    this.wrong_type(element, "an environment", "its name, a string");
                    None
                }
            },
            ("algorithm", _) => match element.get_ref().as_str() {
                Some(name) if Catalog::get().algorithm(name).is_some() => Some(name.into()),
                Some(name) => {
                    this.unknown_algorithm(name, element.span());
                    None
                }
                None => {
                    this.wrong_type(element, "an algorithm", "its name, a string");
                    None
                }
            },
            (_, Some(parameter)) => this.parameter(key, parameter, algorithms, element),
            // Such an axis was refused above.
            (_, None) => None,
        });
    }

    /// Checks each of `elements` with `check`, which returns its meaning, and that no two elements
    /// mean the same.
    fn elements(
        &mut self,
        key: &str,
        elements: &DeArray<'_>,
        mut check: impl FnMut(&mut Self, &Value<'_>) -> Option<String>,
    ) {
        let mut seen = HashSet::new();
        for (index, element) in elements.iter().enumerate() {
            self.within(Step::Index(index), |this| {
                let Some(meaning) = check(this, element) else {
                    return;
                };
                if let Some(meaning) = seen.replace(meaning) {
                    this.wrong(
                        element.span(),
                        format!("`{key}` lists {meaning} twice"),
                        None,
                    );
                }
            });
        }
    }

    fn seed(&mut self, element: &Value<'_>) -> Option<String> {
        let expected = "a whole number, 0 or above";
        match (plain_value(element), element.get_ref().as_integer()) {
            (Some(toml::Value::Integer(seed)), _) if seed >= 0 => Some(seed.to_string()),
            (_, Some(seed)) => {
                let message = format!("the seed {} is out of range", seed.as_str());
                self.wrong(
                    element.span(),
                    message,
                    Some(format!("expected {expected}, that fits in 64 bits")),
                );
                None
            }
            _ => {
                self.wrong_type(element, "a seed", expected);
                None
            }
        }
    }

    /// Checks one value of an axis for every algorithm of the block that has it.
    fn parameter(
        &mut self,
        name: &str,
        parameter: &Parameter,
        algorithms: &[&str],
        element: &Value<'_>,
    ) -> Option<String> {
        let catalog = Catalog::get();
        let places: Vec<(&Section, &str)> = match parameter {
            Parameter::Setting(key) => vec![(&catalog.settings, key.as_str())],
            _ => algorithms
                .iter()
                .filter_map(|algorithm| {
                    Some((
                        catalog.algorithm(algorithm)?,
                        parameter.hyperparameter_of(algorithm)?,
                    ))
                })
                .collect(),
        };
        for (section, key) in places {
            let path: Vec<&str> = key.split('.').collect();
            if let Err(refusals) = section.check(&path, element) {
                self.refused(name, refusals);
                return None;
            }
        }
        plain_value(element).map(|value| meaning(&value))
    }
}

/// A text that is the same for equal values: 1 and 1.0 are equal, as are 0.0 and -0.0, alone or
/// inside a list or table.
fn meaning(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(number) => (number + 0.0).to_string(),
        toml::Value::Array(values) => format!(
            "[{}]",
            values.iter().map(meaning).collect::<Vec<_>>().join(", ")
        ),
        toml::Value::Table(table) => {
            let fields: Vec<String> = table
                .iter()
                .map(|(key, value)| format!("{key} = {}", meaning(value)))
                .collect();
            format!("{{ {} }}", fields.join(", "))
        }
        other => other.to_string(),
    }
}
