//! A parsed layer, and where in it a key was written.

use std::ops::Range;

use serde::Deserialize;
use toml::{
    Spanned,
    de::{DeTable, DeValue, ValueDeserializer},
};

use super::layer::Layer;
use crate::{env::EnvId, fit::Step};

/// One layer, parsed.
pub(super) struct Source<'a> {
    pub(super) layer: &'a Layer,
    pub(super) tree: Spanned<DeTable<'a>>,
}

/// The path to the dotted `key`.
pub(super) fn steps(key: &str) -> Vec<Step> {
    key.split('.').map(|key| Step::Key(key.into())).collect()
}

impl Source<'_> {
    /// The bytes of the value at the end of `way`; `None` if this layer does not have it.
    pub(super) fn span(&self, way: &[Step]) -> Option<Range<usize>> {
        let (last, before) = way.split_last()?;
        let value = match before.split_first() {
            None => match last {
                Step::Key(key) => self.tree.get_ref().get(key.as_str()),
                Step::Index(_) => None,
            },
            Some((Step::Key(first), between)) => {
                let first = self.tree.get_ref().get(first.as_str())?;
                between
                    .iter()
                    .chain([last])
                    .try_fold(first, |value, step| inner(step, value))
            }
            Some((Step::Index(_), _)) => None,
        };
        value.map(Spanned::span)
    }

    /// The bytes of the value at the end of `way` under the table of `env`, by whichever of its
    /// names.
    pub(super) fn environment_span(&self, env: EnvId, way: &[Step]) -> Option<Range<usize>> {
        let environments = self
            .tree
            .get_ref()
            .get("environments")?
            .get_ref()
            .as_table()?;
        let (name, _) = environments.iter().find(|(name, _)| {
            name.get_ref()
                .parse::<EnvId>()
                .is_ok_and(|known| known == env)
        })?;
        let whole = [
            Step::Key("environments".into()),
            Step::Key(name.get_ref().to_string()),
        ];
        self.span(
            &whole
                .into_iter()
                .chain(way.iter().cloned())
                .collect::<Vec<_>>(),
        )
    }
}

/// The value at the end of `step` in `value`.
pub(super) fn inner<'v, 'a>(
    step: &Step,
    value: &'v Spanned<DeValue<'a>>,
) -> Option<&'v Spanned<DeValue<'a>>> {
    match step {
        Step::Key(key) => value.get_ref().get(key.as_str()),
        Step::Index(index) => value.get_ref().get(*index),
    }
}

/// `value` without its spans.
pub(super) fn plain_value(value: &Spanned<DeValue<'_>>) -> Option<toml::Value> {
    toml::Value::deserialize(ValueDeserializer::from(value.clone())).ok()
}
