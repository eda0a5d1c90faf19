//! Types that a file names by a word from a known list.

use serde::de::Error;

use super::names::nearest_label;
use crate::fit::objection;

/// A type whose values have names in a file.
pub(super) trait Named: Sized {
    /// The kind of value in messages, such as `axis`.
    const WHAT: &str;

    /// The value called `name`; `None` where there is none.
    fn named(name: &str) -> Option<Self>;

    /// Every name, for a message that offers them.
    fn known() -> Vec<String>;
}

/// The value called `name`.
///
/// # Errors
///
/// There is none; the message tells the known names.
pub(super) fn named<T: Named, E: Error>(name: &str) -> Result<T, E> {
    T::named(name).ok_or_else(|| {
        let known = T::known();
        let label = nearest_label(T::WHAT, name, known.iter().map(String::as_str));
        E::custom(objection(
            &format!("unknown {} `{name}`", T::WHAT),
            label.as_deref(),
        ))
    })
}

/// Makes a [`Named`] type read and write as its name, which its `Display` gives.
macro_rules! by_name {
    ($type:ident) => {
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(
                deserializer: D,
            ) -> Result<Self, D::Error> {
                $crate::spec::named::named(&<String as serde::Deserialize>::deserialize(
                    deserializer,
                )?)
            }
        }

        impl schemars::JsonSchema for $type {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($type).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({ "type": "string" })
            }
        }

        #[cfg(test)]
        impl From<&str> for $type {
            fn from(name: &str) -> Self {
                <Self as $crate::spec::named::Named>::named(name).expect("a known name")
            }
        }
    };
}
pub(super) use by_name;
