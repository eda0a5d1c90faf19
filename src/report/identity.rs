//! The look of each series, the same in all figures of an experiment.
//!
//! Owns the place of every combination of algorithm and settings among the looks. Knows nothing of
//! colours. Start at
//! [`Identities::new`].
//!
//! A look belongs to the series itself, not to its place in the file or in a figure. An algorithm's
//! own look, the same in all experiments, is that of its default setting; its other settings take
//! the looks that no algorithm of the experiment has, in ascending order of their values.

use std::{cmp::Ordering, collections::BTreeSet};

use super::{axis, recorded::Run};
use crate::spec::{Algorithm, Key};

/// After this many looks, the colours repeat; `figure::look` makes the rest of them.
const COLORS: usize = 12;

/// A run's identity, apart from environment and seed: its algorithm, and the value of each key
/// where that is not the default.
type Identity = Vec<Option<toml::Value>>;

/// The identities of an experiment's runs, and the look of each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Identities {
    keys: Vec<Key>,
    looks: Vec<(Identity, usize)>,
}

impl Identities {
    /// The identities of an experiment with `runs`. They are all of the file's runs, so that a
    /// report of some of them gives them the same looks.
    pub fn new(runs: &[&Run]) -> Self {
        let hidden = axis::hidden_axes(runs, &[Key::Env, Key::Algorithm]);
        let keys: Vec<Key> = [vec![Key::Algorithm], hidden].concat();
        let mut identities: Vec<(Identity, Option<usize>)> = Vec::new();
        for run in runs {
            let identity = identity(&keys, run);
            if !identities.iter().any(|(known, _)| *known == identity) {
                identities.push((identity, own_look(run)));
            }
        }
        identities.sort_by(|left, right| ascending(&left.0, &right.0));
        let present: Vec<usize> = identities.iter().filter_map(|(_, own)| *own).collect();
        let mut free = (0..).filter(|look| !present.contains(look));
        let mut taken: Vec<usize> = Vec::new();
        let looks = identities.into_iter().map(|(identity, own)| {
            let look = own
                .filter(|look| !taken.contains(look))
                .or_else(|| free.next())
                .unwrap_or_default();
            taken.push(look);
            (identity, look)
        });
        Self {
            looks: looks.collect(),
            keys,
        }
    }

    /// The look of each series, given one run of each. Where series differ in environment or seed
    /// alone, the first keeps the look and the others take unused ones. The same holds for series
    /// of one colour in a figure that has a colour for each.
    pub fn looks<'a>(&self, series: impl Iterator<Item = &'a Run>) -> Vec<usize> {
        let wanted: Vec<Option<usize>> = series.map(|run| self.of(run)).collect();
        let as_one = |look: usize| {
            if wanted.len() <= COLORS {
                look % COLORS
            } else {
                look
            }
        };
        let of_somebody: BTreeSet<usize> =
            wanted.iter().flatten().map(|&look| as_one(look)).collect();
        let mut left = (0..).filter(|&look| !of_somebody.contains(&as_one(look)));
        let mut given: BTreeSet<usize> = BTreeSet::new();
        let own = wanted
            .iter()
            .map(|look| look.filter(|&look| given.insert(as_one(look))));
        own.filter_map(|own| own.or_else(|| left.next())).collect()
    }

    fn of(&self, run: &Run) -> Option<usize> {
        let wanted = identity(&self.keys, run);
        self.looks
            .iter()
            .find(|(known, _)| *known == wanted)
            .map(|(_, look)| *look)
    }
}

/// The look of the run's algorithm, its place in the catalogue.
fn own_look(run: &Run) -> Option<usize> {
    Algorithm::names().position(|name| name == run.spec.algorithm_name())
}

fn identity(keys: &[Key], run: &Run) -> Identity {
    keys.iter()
        .map(|key| {
            run.value(key)
                .filter(|_| *key == Key::Algorithm || run.departs_in(key))
        })
        .collect()
}

/// Orders numbers by size and all else by how it is written. Absent values come first, so that a
/// default does.
fn ascending(left: &[Option<toml::Value>], right: &[Option<toml::Value>]) -> Ordering {
    let number = |value: &toml::Value| {
        value
            .as_float()
            .or_else(|| value.as_integer().map(|whole| whole as f64))
    };
    let compare = |(left, right): (&Option<toml::Value>, &Option<toml::Value>)| match (left, right)
    {
        (Some(left), Some(right)) => match (number(left), number(right)) {
            (Some(left), Some(right)) => left.total_cmp(&right),
            _ => left.to_string().cmp(&right.to_string()),
        },
        _ => left.is_some().cmp(&right.is_some()),
    };
    left.iter()
        .zip(right)
        .map(compare)
        .find(|order| order.is_ne())
        .unwrap_or(Ordering::Equal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    fn looks(runs: &[Run], of: &[&Run]) -> Vec<usize> {
        Identities::new(&runs.iter().collect::<Vec<_>>()).looks(of.iter().copied())
    }

    #[test]
    fn a_look_belongs_to_an_algorithm_wherever_it_stands() {
        let (mcpo, ppo) = (
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0),
            fixture::ppo("Hopper-v2", 0),
        );
        assert_eq!(looks(&[mcpo.clone(), ppo.clone()], &[&mcpo, &ppo]), [0, 1]);
        assert_eq!(looks(&[ppo.clone(), mcpo.clone()], &[&ppo, &mcpo]), [1, 0]);
        assert_eq!(looks(std::slice::from_ref(&ppo), &[&ppo]), [1], "alone too");
    }

    #[test]
    fn a_look_belongs_to_a_setting_wherever_it_stands() {
        let run = |d, epsilon| fixture::mcpo("HalfCheetah-v2", d, epsilon, 0);
        let runs = [
            run(1.0, 0.0),
            run(1e-3, 0.0),
            run(1e-3, 1e-3),
            run(1e-6, 0.0),
        ];
        let all: Vec<&Run> = runs.iter().collect();
        assert_eq!(
            looks(&runs, &all),
            [3, 1, 0, 2],
            "the default has MCPO's own, the others follow their values"
        );
        let mut reversed = runs.clone();
        reversed.reverse();
        assert_eq!(looks(&reversed, &all), [3, 1, 0, 2]);
        assert_eq!(
            looks(&runs, &all[1..2]),
            [1],
            "in a figure of one curve too"
        );
        // Table 2 has other values for each environment: they are one setting, the default.
        let walker = fixture::mcpo("Walker2d-v2", 1e-2, 1e-3, 0);
        let with_walker = [&runs[..], std::slice::from_ref(&walker)].concat();
        assert_eq!(looks(&with_walker, &[&walker]), [0]);
    }

    #[test]
    fn colours_return_only_where_a_figure_has_more_series_than_colours() {
        let runs: Vec<Run> = (1..=14)
            .map(|d| fixture::mcpo("HalfCheetah-v2", f64::from(d), 0.0, 0))
            .collect();
        let of = |places: &[usize]| {
            looks(
                &runs,
                &places.iter().map(|&place| &runs[place]).collect::<Vec<_>>(),
            )
        };
        assert_eq!(
            of(&[0, 12, 1]),
            [0, 2, 1],
            "the thirteenth has the first one's colour"
        );
        assert_eq!(
            of(&(0..14).collect::<Vec<_>>()),
            (0..14).collect::<Vec<_>>()
        );
    }

    #[test]
    fn series_that_differ_in_nothing_but_their_seed_do_not_look_alike() {
        let runs = [0, 1, 2].map(|seed| fixture::ppo("Hopper-v2", seed));
        assert_eq!(looks(&runs, &runs.iter().collect::<Vec<_>>()), [1, 0, 2]);
    }
}
