//! A part of a plan, for a machine that knows its number among several.

use std::str::FromStr;

use super::{cost::CostModel, state::Planned};

/// Part `number` of `of` parts, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

/// A part that cannot be understood.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not of the form K/N with K from 1 to N, such as 3/16")]
pub struct ShardError(String);

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let refused = || ShardError(text.to_owned());
        let (number, of) = text.split_once('/').ok_or_else(refused)?;
        let whole = |text: &str| text.parse::<usize>().map_err(|_| refused());
        let (number, of) = (whole(number)?, whole(of)?);
        if (1..=of).contains(&number) {
            Ok(Self { number, of })
        } else {
            Err(refused())
        }
    }
}

impl Shard {
    /// The runs of this part, in the order of `planned`: the parts have no run in common, together
    /// hold all of them, and take about equally long. They depend on the plan alone and not on any
    /// record, so that machines that begin at different times agree on the parts.
    pub fn of(self, planned: Vec<Planned>) -> Vec<Planned> {
        let costs = CostModel::default();
        let seconds: Vec<f64> = planned.iter().map(|run| costs.seconds(&run.spec)).collect();
        let mut order: Vec<usize> = (0..planned.len()).collect();
        order.sort_by(|&a, &b| seconds[b].total_cmp(&seconds[a]));
        // The longest first, each to the part with the least work (Graham, 1969).
        let mut work = vec![0.0_f64; self.of];
        let mut part = vec![0; planned.len()];
        for run in order {
            let least = (0..self.of)
                .min_by(|&a, &b| work[a].total_cmp(&work[b]))
                .unwrap_or(0);
            work[least] += seconds[run];
            part[run] = least;
        }
        planned
            .into_iter()
            .zip(part)
            .filter(|(_, part)| part + 1 == self.number)
            .map(|(run, _)| run)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{quantity::constant, schedule::tests::planned};

    fn runs(lengths: &[i64]) -> Vec<Planned> {
        let results = std::path::Path::new("results");
        let run = |(seed, &length): (usize, &i64)| {
            let mut run = planned(results, "e", seed as u64);
            run.spec.budget.env_steps = constant(length);
            run
        };
        lengths.iter().enumerate().map(run).collect()
    }

    #[test]
    fn only_a_part_of_what_there_is_can_be_meant() {
        for text in [
            "", "1", "0/4", "5/4", "-1/4", "1/0", "1/4/2", "a/b", "1.0/4",
        ] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
        assert_eq!("3/16".parse(), Ok(Shard { number: 3, of: 16 }));
    }

    #[test]
    fn the_parts_are_the_whole_and_have_nothing_in_common() {
        let all = runs(&[700, 100, 100, 500, 300, 300, 200, 900, 100]);
        for of in [1, 2, 4, 9, 12] {
            let mut ids: Vec<String> = (1..=of)
                .flat_map(|number| Shard { number, of }.of(all.clone()))
                .map(|run| run.spec.id)
                .collect();
            ids.sort();
            assert_eq!(
                ids,
                all.iter()
                    .map(|run| run.spec.id.clone())
                    .collect::<Vec<_>>(),
                "of {of}"
            );
        }
    }

    #[test]
    fn the_parts_take_about_as_long() {
        let lengths = [900, 100, 100, 500, 300, 300, 200, 700, 100];
        let steps = |number| -> u64 {
            let part = Shard { number, of: 2 }.of(runs(&lengths));
            part.iter().map(|run| run.spec.budget.env_steps.get()).sum()
        };
        assert_eq!((steps(1), steps(2)), (1600, 1600));
    }
}
