//! Numbers that cannot be out of range.
//!
//! Owns the bounds of everything a user writes as a number, so that a bad value is refused where it
//! is written. Knows nothing of what the numbers mean. Start at [`Positive`].

use std::fmt;

use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, Unexpected},
};

/// A number outside the range of its type.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{value} is out of range; expected {expected}")]
pub struct OutOfRange {
    value: f64,
    expected: &'static str,
}

impl OutOfRange {
    /// The same as an error of serde's.
    pub fn refusal<E: Error>(&self) -> E {
        E::invalid_value(Unexpected::Float(self.value), &self.expected)
    }
}

macro_rules! bounded {
    ($(#[$doc:meta])* $name:ident, $expected:literal, $test:expr, $($bound:literal = $limit:literal),+) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, schemars::JsonSchema)]
        #[serde(into = "f64")]
        #[schemars(extend($($bound = $limit),+))]
        pub struct $name(f64);

        impl $name {
            /// The number as it is.
            pub const fn get(self) -> f64 {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = OutOfRange;

            fn try_from(value: f64) -> Result<Self, OutOfRange> {
                let inside: fn(f64) -> bool = $test;
                if inside(value) { Ok(Self(value)) } else { Err(OutOfRange { value, expected: $expected }) }
            }
        }

        impl From<$name> for f64 {
            fn from(quantity: $name) -> f64 {
                quantity.0
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Self::try_from(f64::deserialize(deserializer)?).map_err(|error| error.refusal())
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

bounded! {
    /// A finite number above 0.
    Positive, "a finite number above 0", |x| x.is_finite() && x > 0.0, "exclusiveMinimum" = 0
}
bounded! {
    /// A finite number that is 0 or above.
    NonNegative, "a finite number, 0 or above", |x| x.is_finite() && x >= 0.0, "minimum" = 0
}
bounded! {
    /// A number in [0, 1].
    UnitInterval, "a number from 0 to 1", |x| (0.0..=1.0).contains(&x), "minimum" = 0, "maximum" = 1
}
bounded! {
    /// A discount factor, in [0, 1).
    Discount, "a number from 0 to below 1", |x| (0.0..1.0).contains(&x), "minimum" = 0, "exclusiveMaximum" = 1
}

/// A whole number of things, or none.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, schemars::JsonSchema,
)]
#[serde(into = "i64")]
pub struct CountOrNone(u64);

impl CountOrNone {
    /// The number as it is.
    pub const fn get(self) -> u64 {
        self.0
    }

    /// The number as a size in memory.
    pub const fn size(self) -> usize {
        self.0 as usize
    }
}

impl TryFrom<i64> for CountOrNone {
    type Error = OutOfRange;

    fn try_from(value: i64) -> Result<Self, OutOfRange> {
        let expected = "a whole number, 0 or above";
        u64::try_from(value).map(Self).map_err(|_| OutOfRange {
            value: value as f64,
            expected,
        })
    }
}

impl<'de> Deserialize<'de> for CountOrNone {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        whole(deserializer)
    }
}

impl From<CountOrNone> for i64 {
    fn from(count: CountOrNone) -> i64 {
        count.0 as i64
    }
}

/// Steps taken in an environment; at least one.
pub type EnvSteps = Count;

/// A whole number of things, at least one.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, schemars::JsonSchema,
)]
#[serde(into = "i64")]
#[schemars(extend("minimum" = 1))]
pub struct Count(u64);

impl Count {
    /// The number as it is.
    pub const fn get(self) -> u64 {
        self.0
    }

    /// The number as a size in memory.
    pub const fn size(self) -> usize {
        self.0 as usize
    }
}

impl TryFrom<i64> for Count {
    type Error = OutOfRange;

    fn try_from(value: i64) -> Result<Self, OutOfRange> {
        match u64::try_from(value) {
            Ok(count) if count > 0 => Ok(Self(count)),
            _ => Err(OutOfRange {
                value: value as f64,
                expected: "a whole number, 1 or above",
            }),
        }
    }
}

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        whole(deserializer)
    }
}

impl From<Count> for i64 {
    fn from(count: Count) -> i64 {
        count.0 as i64
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A bounded whole number as serde reads it.
fn whole<'de, D: Deserializer<'de>, T>(deserializer: D) -> Result<T, D::Error>
where
    T: TryFrom<i64, Error = OutOfRange>,
{
    let value = i64::deserialize(deserializer)?;
    T::try_from(value)
        .map_err(|error| D::Error::invalid_value(Unexpected::Signed(value), &error.expected))
}

/// The bounded number `value`, for defaults in code; panics when it is out of range, since that is
/// our own mistake.
pub fn constant<T, V>(value: V) -> T
where
    T: TryFrom<V, Error = OutOfRange>,
{
    T::try_from(value).unwrap_or_else(|error| panic!("a default in the source: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_refused() {
        for bad in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            assert!(Positive::try_from(bad).is_err(), "{bad}");
        }
        for bad in [-1e-9, f64::NAN, f64::INFINITY] {
            assert!(NonNegative::try_from(bad).is_err(), "{bad}");
        }
        for bad in [-1e-9, 1.0 + 1e-9, f64::NAN] {
            assert!(UnitInterval::try_from(bad).is_err(), "{bad}");
        }
        assert!(Discount::try_from(1.0).is_err());
        assert!(Count::try_from(0).is_err() && Count::try_from(-5).is_err());
    }

    #[test]
    fn numbers_in_range_come_back_unchanged() {
        assert_eq!(Discount::try_from(0.99).map(f64::from), Ok(0.99));
        assert_eq!(Count::try_from(3_000_000).map(Count::get), Ok(3_000_000));
    }
}
