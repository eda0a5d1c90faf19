//! The keys that can be axes: any setting, and any hyperparameter.

use std::fmt;

use super::catalog::{Catalog, Section};

/// A setting or hyperparameter, as an axis, a figure or a selection names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Parameter {
    /// `budget.env_steps`, `reward`: a setting of every run.
    Setting(String),
    /// `d`: a hyperparameter of every algorithm that has it.
    Shared(String),
    /// `mcpo.max_kl`: a hyperparameter of one algorithm.
    Own {
        /// The algorithm.
        algorithm: &'static str,
        /// The key among its hyperparameters.
        key: String,
    },
}

/// The type of a parameter's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Any number.
    Number,
    /// A whole number.
    Whole,
    /// True or false.
    Truth,
    /// A word, a list or a choice.
    Text,
}

impl Parameter {
    /// The parameter called `name`; `None` when there is none.
    pub(crate) fn find(name: &str) -> Option<Self> {
        let catalog = Catalog::get();
        if has(&catalog.settings, name) {
            return Some(Self::Setting(name.into()));
        }
        if let Some((algorithm, key)) = name.split_once('.')
            && let Some((algorithm, section)) =
                catalog.algorithms().find(|(known, _)| *known == algorithm)
        {
            return has(section, key).then(|| Self::Own {
                algorithm,
                key: key.into(),
            });
        }
        catalog
            .algorithms()
            .any(|(_, section)| has(section, name))
            .then(|| Self::Shared(name.into()))
    }

    /// Its key among the settings or an algorithm's hyperparameters.
    pub(crate) fn key(&self) -> &str {
        match self {
            Self::Setting(key) | Self::Shared(key) | Self::Own { key, .. } => key,
        }
    }

    /// The last part of its key: `max_kl` of `mcpo.max_kl`.
    pub(crate) fn last_part(&self) -> &str {
        self.key().rsplit('.').next().unwrap_or_default()
    }

    /// Every name that [`find`](Self::find) knows.
    pub(crate) fn names() -> Vec<String> {
        let catalog = Catalog::get();
        let mut names: Vec<String> = catalog.settings.leaves().iter().cloned().collect();
        for (_, section) in catalog.algorithms() {
            names.extend(section.leaves().iter().cloned());
        }
        for (algorithm, section) in catalog.algorithms() {
            names.extend(
                section
                    .leaves()
                    .iter()
                    .map(|key| format!("{algorithm}.{key}")),
            );
        }
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The key among the hyperparameters of `algorithm`; `None` when it has none such.
    pub(crate) fn hyperparameter_of(&self, algorithm: &str) -> Option<&str> {
        match self {
            Self::Setting(_) => None,
            Self::Shared(key) => Catalog::get()
                .algorithm(algorithm)
                .filter(|section| has(section, key))
                .map(|_| key.as_str()),
            Self::Own {
                algorithm: own,
                key,
            } => (*own == algorithm).then_some(key),
        }
    }

    /// Whether it is the same parameter as `other` in runs of `algorithm`.
    pub(crate) fn is(&self, other: &Self, algorithm: &str) -> bool {
        match (
            self.hyperparameter_of(algorithm),
            other.hyperparameter_of(algorithm),
        ) {
            (Some(own), Some(others)) => own == others,
            _ => self == other,
        }
    }

    /// The type of its values.
    pub(crate) fn kind(&self) -> Kind {
        let catalog = Catalog::get();
        let mut algorithms = catalog.algorithms();
        let (section, key) = match self {
            Self::Setting(key) => (Some(&catalog.settings), key),
            Self::Shared(key) => (
                algorithms
                    .map(|(_, section)| section)
                    .find(|section| has(section, key)),
                key,
            ),
            Self::Own { algorithm, key } => (
                algorithms
                    .find(|(name, _)| name == algorithm)
                    .map(|(_, section)| section),
                key,
            ),
        };
        let path: Vec<&str> = key.split('.').collect();
        let schema = section.and_then(|section| section.schema(&path));
        let null = &serde_json::Value::Null;
        // A choice such as `d`, a number or a share, counts as its first form: tables and curves
        // show that one.
        let types = schema.map_or(null, |schema| match &schema["type"] {
            serde_json::Value::Null => &schema["oneOf"][0]["type"],
            types => types,
        });
        // A value that may be absent has the type `["number", "null"]`.
        match types
            .as_str()
            .or_else(|| types.as_array()?.first()?.as_str())
        {
            Some("number") => Kind::Number,
            Some("integer") => Kind::Whole,
            Some("boolean") => Kind::Truth,
            _ => Kind::Text,
        }
    }

    /// Whether runs of `algorithm` have it.
    pub(crate) fn applies_to(&self, algorithm: &str) -> bool {
        matches!(self, Self::Setting(_)) || self.hyperparameter_of(algorithm).is_some()
    }
}

impl fmt::Display for Parameter {
    /// Its name, as [`find`](Self::find) knows it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Setting(key) | Self::Shared(key) => f.write_str(key),
            Self::Own { algorithm, key } => write!(f, "{algorithm}.{key}"),
        }
    }
}

/// Whether `section` has a value, not a table, at the dotted `key`.
fn has(section: &Section, key: &str) -> bool {
    section.leaves().contains(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_found_by_their_names_alone() {
        for unknown in [
            "", "mmd", "mcpo", "mcpo.mmd", "ppo.d", "budget", "mcpo.d.x", "seed",
        ] {
            assert_eq!(Parameter::find(unknown), None, "{unknown}");
        }
        assert_eq!(
            Parameter::find("reward"),
            Some(Parameter::Setting("reward".into()))
        );
        assert_eq!(Parameter::find("d"), Some(Parameter::Shared("d".into())));
        let own = Parameter::Own {
            algorithm: "mcpo",
            key: "mmd.samples".into(),
        };
        assert_eq!(Parameter::find("mcpo.mmd.samples"), Some(own));
        for name in Parameter::names() {
            assert_eq!(
                Parameter::find(&name).map(|found| found.to_string()),
                Some(name)
            );
        }
    }

    #[test]
    fn a_parameter_is_of_the_kind_that_its_values_are() {
        for (name, kind) in [
            ("d", Kind::Number),
            ("mcpo.max_d", Kind::Number),
            ("mcpo.max_kl", Kind::Number),
            ("rollout.steps", Kind::Whole),
            ("checkpoint.keep_policy_every", Kind::Whole),
            ("ppo.normalize_advantages", Kind::Truth),
            ("mmd.samples", Kind::Text),
            ("mmd.bandwidth", Kind::Text),
            ("reward", Kind::Text),
            ("network.hidden", Kind::Text),
        ] {
            assert_eq!(Parameter::find(name).expect("known").kind(), kind, "{name}");
        }
    }

    #[test]
    fn a_shared_hyperparameter_applies_where_it_exists() {
        let d = Parameter::find("d").expect("MCPO has it");
        assert!(d.applies_to("mcpo") && !d.applies_to("ppo"));
        let discount = Parameter::find("discount").expect("both have it");
        assert!(discount.applies_to("mcpo") && discount.applies_to("ppo"));
        assert!(
            !Parameter::find("ppo.discount")
                .expect("PPO has it")
                .applies_to("mcpo")
        );
    }
}
