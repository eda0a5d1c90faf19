//! A sum in its parts.

use serde::{Serialize, Serializer};

/// Numbers by name, in the order in which they first came.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parts(Vec<(String, f64)>);

impl Parts {
    /// Adds `number` to what `name` has.
    pub(super) fn add(&mut self, name: &str, number: f64) {
        match self.0.iter_mut().find(|(known, _)| known == name) {
            Some((_, sum)) => *sum += number,
            None => self.0.push((name.to_owned(), number)),
        }
    }

    /// The names and numbers, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, number)| (name.as_str(), *number))
    }

    /// The sum of all.
    pub fn sum(&self) -> f64 {
        self.iter().map(|(_, number)| number).sum()
    }
}

impl Serialize for Parts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter())
    }
}
