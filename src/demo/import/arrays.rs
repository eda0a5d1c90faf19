//! Assembles a demonstration from named arrays, as `.npz` files and other programs' Parquet tables
//! hold them.

use std::collections::BTreeSet;

use nalgebra::DMatrix;

use super::{Imported, MAX_NUMBERS, NAMES, episodes::Episodes, infer_ends};
use crate::{
    demo::Demonstration,
    env::{EnvId, Pose},
};

/// Numbers in rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    rows: usize,
    /// The numbers, row after row.
    numbers: Vec<f64>,
}

impl Array {
    /// `numbers` in `rows`; without numbers the array has no rows, however many a file claims.
    pub(super) fn new(rows: usize, numbers: Vec<f64>) -> Self {
        Self {
            rows: if numbers.is_empty() { 0 } else { rows },
            numbers,
        }
    }

    /// The number of rows.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The numbers, row after row.
    pub(super) fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// The array with each row as a column.
    fn into_columns(self) -> DMatrix<f64> {
        DMatrix::from_vec(
            self.numbers.len().checked_div(self.rows).unwrap_or(0),
            self.rows,
            self.numbers,
        )
    }
}

/// The names that other programs use for a step's quantities; [`Episodes`] knows those that mark
/// episodes.
const OBSERVATIONS: &[&str] = &["observation", "observations", "obs", "observation.state"];
const ACTIONS: &[&str] = &["action", "actions", "acts"];
const REWARDS: &[&str] = &["reward", "rewards", "rews", "next.reward"];
const QPOS: &[&str] = &["qpos", "infos/qpos"];
const QVEL: &[&str] = &["qvel", "infos/qvel"];

/// The most steps of a demonstration.
const MAX_STEPS: usize = 1 << 21;

/// Looks up an array by its name; `None` where there is none.
type Named<'a> = dyn Fn(&str) -> Result<Option<Array>, String> + 'a;

/// A file's arrays, with a record of which were asked for.
pub(super) struct Arrays<'a> {
    named: &'a Named<'a>,
    used: BTreeSet<&'static str>,
    /// The count of numbers that were read.
    read: usize,
}

impl<'a> Arrays<'a> {
    pub(super) fn new(named: &'a Named<'a>) -> Self {
        Self {
            named,
            used: BTreeSet::new(),
            read: 0,
        }
    }

    /// The first array that has one of `names`, and its name.
    pub(super) fn first(
        &mut self,
        names: &[&'static str],
    ) -> Result<Option<(&'static str, Array)>, String> {
        for &name in names {
            if let Some(array) = (self.named)(name)? {
                self.read += array.numbers.len();
                if self.read > MAX_NUMBERS {
                    return Err(format!("it holds more than {MAX_NUMBERS} numbers"));
                }
                self.used.insert(name);
                return Ok(Some((name, array)));
            }
        }
        Ok(None)
    }

    fn required(&mut self, names: &[&'static str]) -> Result<Array, String> {
        self.first(names)?
            .map(|(_, array)| array)
            .ok_or_else(|| format!("it has none of {}", names.join(", ")))
    }

    /// As [`first`](Self::first), for an array that has a number for each of `n` steps.
    pub(super) fn of_each_step(
        &mut self,
        names: &[&'static str],
        n: usize,
    ) -> Result<Option<(&'static str, Vec<f64>)>, String> {
        match self.first(names)? {
            Some((name, array)) if array.numbers.len() != n => Err(format!(
                "`{name}` has {} numbers for {n} actions",
                array.numbers.len()
            )),
            found => Ok(found.map(|(name, array)| (name, array.numbers))),
        }
    }

    /// The `names` that were never asked for.
    fn unused<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Vec<&'n str> {
        // A column `obs_3` belongs to `obs`.
        let stem = |name: &'n str| {
            name.rsplit_once('_')
                .filter(|(_, place)| place.parse::<usize>().is_ok())
        };
        let is_used = |name: &str| self.used.contains(name);
        let all = names
            .into_iter()
            .filter(|name| !is_used(name) && !stem(name).is_some_and(|(stem, _)| is_used(stem)));
        all.collect()
    }
}

/// The demonstration of `env` from the arrays called `names`, which `named` looks up.
///
/// # Errors
///
/// Arrays are missing, of unequal lengths, too large, or contradict each other.
pub(super) fn assemble<'n>(
    env: EnvId,
    names: impl IntoIterator<Item = &'n str>,
    named: &Named<'_>,
) -> Result<Imported, String> {
    let mut arrays = Arrays::new(named);
    let (mut losses, mut warnings) = (Vec::new(), Vec::new());
    let actions = arrays.required(ACTIONS)?;
    let n = actions.rows;
    if n == 0 {
        return Err("it has no steps".into());
    }
    if n > MAX_STEPS {
        return Err(format!("it has {n} steps; at most {MAX_STEPS} are read"));
    }
    let mut episodes = Episodes::of(&mut arrays, n, env.max_steps())?;
    let mut after_last = false;
    // An array has one row a step; if it has one more after each episode, that row has no place in
    // the format.
    let mut of_steps = |what: &str, array: Array| {
        let (rows, count) = (array.rows, episodes.count());
        let mut columns = array.into_columns();
        if rows == n + count && rows != n {
            after_last = true;
            let behind: Vec<_> = episodes
                .last_rows()
                .iter()
                .enumerate()
                .map(|(i, last)| last + i + 1)
                .collect();
            columns = columns.remove_columns_at(&behind);
        } else if rows != n {
            let episodes = if count == 1 {
                "1 episode".to_owned()
            } else {
                format!("{count} episodes")
            };
            return Err(format!(
                "`{what}` has {rows} rows for {n} actions in {episodes}"
            ));
        }
        Ok(columns)
    };
    let mut observations = of_steps("observations", arrays.required(OBSERVATIONS)?)?;
    let (qpos, qvel) = (arrays.first(QPOS)?, arrays.first(QVEL)?);
    let mut poses = match (qpos, qvel) {
        (Some((_, qpos)), Some((_, qvel))) => {
            let (qpos, qvel) = (of_steps("qpos", qpos)?, of_steps("qvel", qvel)?);
            let pairs = qpos.column_iter().zip(qvel.column_iter());
            Some(
                pairs
                    .map(|(q, v)| Pose {
                        qpos: q.as_slice().to_vec(),
                        qvel: v.as_slice().to_vec(),
                    })
                    .collect(),
            )
        }
        (one, other) => {
            let alone = one.or(other).map_or_else(String::new, |(name, _)| {
                format!(" (`{name}` alone is not enough)")
            });
            losses.push(format!(
                "poses are not recorded{alone}; the demonstration cannot be verified by replay"
            ));
            None::<Vec<Pose>>
        }
    };
    let mut actions = actions.into_columns();
    let mut rewards = arrays.of_each_step(REWARDS, n)?.map(|(_, rewards)| rewards);
    if rewards.is_none() {
        losses.push("rewards are not recorded".into());
    }
    // In RLDS an episode's last row is no step: it holds the observation after the last one.
    if episodes.last_rows_are_marked
        && last_rows_are_no_steps(&episodes, &actions, rewards.as_deref())
    {
        let rows = episodes.last_rows();
        observations = observations.remove_columns_at(&rows);
        actions = actions.remove_columns_at(&rows);
        let keep = |row: usize| rows.binary_search(&row).is_err();
        rewards = rewards.map(|all| {
            (0..n)
                .filter(|&row| keep(row))
                .map(|row| all[row])
                .collect()
        });
        poses = poses.map(|all| {
            all.into_iter()
                .enumerate()
                .filter(|(row, _)| keep(*row))
                .map(|(_, pose)| pose)
                .collect()
        });
        episodes.drop_last_rows();
        after_last = true;
    }
    if after_last {
        losses.push(
            "the observation after each episode's last step has no place in the format".into(),
        );
    }
    let (are_told, ends_are_told) = (episodes.are_told, episodes.ends_are_told);
    let Episodes {
        starts: episode_starts,
        terminated,
        truncated,
        ..
    } = episodes;
    let mut demonstration = Demonstration {
        observations,
        actions,
        rewards,
        episode_starts,
        terminated,
        truncated,
        poses,
        provenance: vec![],
    };
    if !ends_are_told {
        infer_ends(&mut demonstration, env, &mut losses);
    }
    if !are_told {
        warnings.push(format!(
            "nothing says where episodes begin; all {n} steps are taken as one episode"
        ));
    }
    let unused = arrays.unused(names);
    if !unused.is_empty() {
        let more = if unused.len() > NAMES { " ..." } else { "" };
        losses.push(format!(
            "not used: {}{more}",
            unused[..unused.len().min(NAMES)].join(", ")
        ));
    }
    Ok(Imported {
        demonstration,
        losses,
        warnings,
    })
}

/// Whether the last row of each episode is the observation after its last step, as in RLDS: the
/// action and reward of these rows mean nothing and are 0, and those of other rows are not.
fn last_rows_are_no_steps(
    episodes: &Episodes,
    actions: &DMatrix<f64>,
    rewards: Option<&[f64]>,
) -> bool {
    let last = episodes.last_rows();
    let long = last
        .iter()
        .zip(&episodes.starts)
        .all(|(last, start)| last > start);
    let is_zero = |row: usize| {
        actions.column(row).iter().all(|&a| a == 0.0) && rewards.is_none_or(|r| r[row] == 0.0)
    };
    long && last.iter().all(|&row| is_zero(row)) && actions.iter().any(|&action| action != 0.0)
}

/// The numbers in `bytes`, whose numpy type is `name` (`f8`, `b1` ...), lowest byte first if
/// `little`; absent for types that hold no numbers, and if bytes are left over.
pub(super) fn decode(name: &str, little: bool, bytes: &[u8]) -> Option<Vec<f64>> {
    fn words<const N: usize>(
        bytes: &[u8],
        little: bool,
        of: fn([u8; N]) -> f64,
    ) -> Option<Vec<f64>> {
        let (words, []) = bytes.as_chunks::<N>() else {
            return None;
        };
        let in_order = |mut word: [u8; N]| {
            if !little {
                word.reverse();
            }
            of(word)
        };
        Some(words.iter().copied().map(in_order).collect())
    }
    match name {
        "f8" => words(bytes, little, f64::from_le_bytes),
        "f4" => words(bytes, little, |word| f32::from_le_bytes(word).into()),
        "i8" => words(bytes, little, |word| i64::from_le_bytes(word) as f64),
        "i4" => words(bytes, little, |word| i32::from_le_bytes(word).into()),
        "i2" => words(bytes, little, |word| i16::from_le_bytes(word).into()),
        "i1" => words(bytes, little, |word| i8::from_le_bytes(word).into()),
        "u8" => words(bytes, little, |word| u64::from_le_bytes(word) as f64),
        "u4" => words(bytes, little, |word| u32::from_le_bytes(word).into()),
        "u2" => words(bytes, little, |word| u16::from_le_bytes(word).into()),
        "u1" | "b1" => words(bytes, little, |word| u8::from_le_bytes(word).into()),
        _ => None,
    }
}
