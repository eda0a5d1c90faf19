//! Arrays by name, as `.npz` files and Parquet tables of others hold them, put together to a demonstration.

use std::cell::Cell;

use nalgebra::DMatrix;

use super::{Imported, MAX_NUMBERS, infer_ends};
use crate::{
    demo::Demonstration,
    env::{EnvId, Pose},
};

/// Numbers in rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    rows: usize,
    /// Row after row.
    numbers: Vec<f64>,
}

impl Array {
    /// `numbers` in `rows`; in none where there is no number, however many rows a file claims.
    pub(super) fn new(rows: usize, numbers: Vec<f64>) -> Self {
        Self { rows: if numbers.is_empty() { 0 } else { rows }, numbers }
    }

    fn into_columns(self) -> DMatrix<f64> {
        DMatrix::from_vec(self.numbers.len().checked_div(self.rows).unwrap_or(0), self.rows, self.numbers)
    }
}

/// The names that others give to what a step holds.
const OBSERVATIONS: &[&str] = &["observation", "observations", "obs"];
const ACTIONS: &[&str] = &["action", "actions", "acts"];
const REWARDS: &[&str] = &["reward", "rewards", "rews"];
const TERMINATED: &[&str] = &["terminated", "terminals", "terminal", "terminations", "dones", "done"];
const TRUNCATED: &[&str] = &["truncated", "timeouts", "truncations"];
const EPISODES: &[&str] = &["episode", "episodes", "episode_id"];
const QPOS: &[&str] = &["qpos", "infos/qpos"];
const QVEL: &[&str] = &["qvel", "infos/qvel"];
/// Where `imitation` splits its arrays into trajectories.
const SPLITS: &[&str] = &["indices"];

/// The demonstration of `env` that the arrays are which `named` finds.
pub(super) fn assemble(env: EnvId, named: impl Fn(&str) -> Result<Option<Array>, String>) -> Result<Imported, String> {
    let found = Cell::new(0);
    let first = |names: &[&str]| -> Result<Option<Array>, String> {
        for name in names {
            if let Some(array) = named(name)? {
                found.set(found.get() + array.numbers.len());
                if found.get() > MAX_NUMBERS {
                    return Err(format!("it holds more than {MAX_NUMBERS} numbers"));
                }
                return Ok(Some(array));
            }
        }
        Ok(None)
    };
    let required = |names: &[&str]| first(names)?.ok_or_else(|| format!("it has none of {}", names.join(", ")));
    let mut losses = Vec::new();
    let actions = required(ACTIONS)?;
    let n = actions.rows;
    if n == 0 {
        return Err("it has no steps".into());
    }
    let of_each_step = |names: &[&str]| match first(names)? {
        Some(array) if array.rows != n => Err(format!("`{}` has {} rows for {n} actions", names[0], array.rows)),
        found => Ok(found.map(|array| array.numbers)),
    };
    let flags =
        |names: &[&str]| Ok::<_, String>(first(names)?.map(|array| array.numbers.iter().map(|&x| x != 0.0).collect()));
    let (mut terminated, mut truncated): (Option<Vec<bool>>, Option<Vec<bool>>) =
        (flags(TERMINATED)?, flags(TRUNCATED)?);

    // Where episodes start: as the file says, or after each end.
    let told = match (first(SPLITS)?, of_each_step(EPISODES)?) {
        (Some(splits), _) => {
            let starts: Vec<_> = std::iter::once(0).chain(splits.numbers.iter().map(|&at| at as usize)).collect();
            let orderly = starts.is_sorted_by(|a, b| a < b) && starts.iter().all(|&start| start < n);
            if !orderly {
                return Err("its `indices` do not rise within its actions".into());
            }
            Some(starts)
        }
        (None, Some(episodes)) => {
            Some((0..n).filter(|&i| i == 0 || episodes[i] != episodes[i - 1]).collect::<Vec<_>>())
        }
        (None, None) => None,
    };

    // `imitation` keeps one flag a trajectory and the observation after its last step.
    let trajectories = told.as_ref().map_or(1, Vec::len);
    if let (Some(flags), Some(starts)) = (&mut terminated, &told)
        && flags.len() == trajectories
        && trajectories != n
    {
        let (mut at_step, mut cut) = (vec![false; n], vec![false; n]);
        for (i, &flag) in flags.iter().enumerate() {
            let last = starts.get(i + 1).copied().unwrap_or(n) - 1;
            (at_step[last], cut[last]) = (flag, !flag);
        }
        (*flags, truncated) = (at_step, Some(cut));
    }
    for (what, flags) in [("terminated", &terminated), ("truncated", &truncated)] {
        if let Some(flags) = flags.as_ref().filter(|flags| flags.len() != n) {
            return Err(format!("`{what}` has {} rows for {n} actions", flags.len()));
        }
    }
    let ends_told = terminated.is_some() || truncated.is_some();
    let (terminated, truncated) = (terminated.unwrap_or(vec![false; n]), truncated.unwrap_or(vec![false; n]));
    let episode_starts =
        told.unwrap_or_else(|| (0..n).filter(|&i| i == 0 || terminated[i - 1] || truncated[i - 1]).collect());

    let mut observations = required(OBSERVATIONS)?.into_columns();
    if observations.ncols() == n + episode_starts.len() {
        let after_last: Vec<_> =
            (1..=episode_starts.len()).map(|i| episode_starts.get(i).copied().unwrap_or(n) + i - 1).collect();
        observations = observations.remove_columns_at(&after_last);
        losses.push("the observation after each episode's last step has no place in the format".into());
    }
    let rewards = of_each_step(REWARDS)?;
    if rewards.is_none() {
        losses.push("rewards are not recorded".into());
    }
    let poses = match (first(QPOS)?, first(QVEL)?) {
        (Some(qpos), Some(qvel)) => {
            let (qpos, qvel) = (qpos.into_columns(), qvel.into_columns());
            let pairs = qpos.column_iter().zip(qvel.column_iter());
            Some(pairs.map(|(q, v)| Pose { qpos: q.as_slice().to_vec(), qvel: v.as_slice().to_vec() }).collect())
        }
        _ => {
            losses.push("poses are not recorded; the demonstration cannot be verified by replay".into());
            None
        }
    };
    let actions = actions.into_columns();
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
    if !ends_told {
        infer_ends(&mut demonstration, env, &mut losses);
    }
    Ok(Imported { demonstration, losses })
}

/// The numbers that `bytes` are when numpy calls their type `name` (`f8`, `b1` ...) and their bytes come lowest first or
/// last; absent for types that hold no numbers and where bytes are left over.
pub(super) fn decode(name: &str, little: bool, bytes: &[u8]) -> Option<Vec<f64>> {
    fn words<const N: usize>(bytes: &[u8], little: bool, of: fn([u8; N]) -> f64) -> Option<Vec<f64>> {
        let (words, []) = bytes.as_chunks::<N>() else { return None };
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
