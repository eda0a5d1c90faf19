//! Where the episodes of another program's file begin and end, from everything that the file says
//! about them.
//!
//! Each array that marks episodes is an account of them. Accounts that contradict each other or the
//! arrays are refused: if episodes were joined silently, their returns would be added up.

use std::collections::HashSet;

use super::{
    ArraysError, EpisodesError,
    arrays::{Array, Arrays},
};

/// Names of arrays that number the episodes: the number of the episode at each step.
const NUMBERS: &[&str] = &[
    "episode",
    "episodes",
    "episode_id",
    "episode_ids",
    "episode_index",
];
/// Names of arrays that count the steps of an episode: the place in the episode at each step.
const STEPS: &[&str] = &["step", "steps", "step_id", "frame_index", "timestep"];
/// Names of arrays that flag an episode's first step (`episode_starts` is Stable Baselines',
/// `is_first` RLDS's).
const FIRST: &[&str] = &["episode_starts", "episode_start", "is_first"];
/// Names of arrays that flag an episode's last row.
const LAST: &[&str] = &["is_last"];
/// The array of places where `imitation` splits its arrays into trajectories.
const SPLITS: &[&str] = &["indices"];
/// Names of arrays that flag steps at which the task ended the episode.
const TERMINATED: &[&str] = &[
    "terminated",
    "terminals",
    "terminal",
    "terminations",
    "is_terminal",
];
/// Names of arrays that flag steps at which a limit cut the episode.
const TRUNCATED: &[&str] = &["truncated", "timeouts", "truncations"];
/// Names of arrays that flag the end of an episode, by the task or by a limit.
const DONE: &[&str] = &["dones", "done", "next.done"];
/// The array of the episodes' returns, which `record_expert` of Stable Baselines writes.
const RETURNS: &[&str] = &["episode_returns"];

/// The episodes of a file.
pub(super) struct Episodes {
    /// The first row of each episode.
    pub(super) starts: Vec<usize>,
    /// Whether the task ended the episode at this step `[n]`.
    pub(super) terminated: Vec<bool>,
    /// Whether a limit cut the episode at this step `[n]`.
    pub(super) truncated: Vec<bool>,
    /// Whether the file says for each episode which of the two ended it.
    pub(super) ends_are_told: bool,
    /// Whether the file says where episodes begin or end.
    pub(super) are_told: bool,
    /// Whether rows were marked as the last of their episode.
    pub(super) last_rows_are_marked: bool,
}

impl Episodes {
    /// Reads the episodes from `arrays` of `n` steps.
    /// If only an episode's end is told, one of at least `limit` steps counts as cut.
    ///
    /// # Errors
    ///
    /// An array cannot describe the episodes of `n` steps, or two contradict each other.
    pub(super) fn of(arrays: &mut Arrays<'_>, n: usize, limit: u64) -> Result<Self, ArraysError> {
        let mut accounts = Accounts {
            n,
            found: Vec::new(),
        };
        if let Some((name, splits)) = arrays.first(SPLITS)? {
            let starts = std::iter::once(0.0).chain(splits.numbers().iter().copied());
            accounts.add(name, rising(name, starts, n)?)?;
        }
        if let Some((name, numbers)) = arrays.of_each_step(NUMBERS, n)? {
            accounts.add(name, changes(name, &numbers)?)?;
        }
        if let Some((name, steps)) = arrays.of_each_step(STEPS, n)? {
            accounts.add(name, restarts(name, &steps)?)?;
        }
        if let Some((name, first)) = arrays.of_each_step(FIRST, n)? {
            accounts.add(
                name,
                (0..n)
                    .filter(|&row| row == 0 || first[row] != 0.0)
                    .collect(),
            )?;
        }
        let last = arrays.of_each_step(LAST, n)?;
        if let Some((name, last)) = &last {
            accounts.add(name, after_each(n, |row| last[row] != 0.0))?;
        }
        // Accounts that differ were refused, so the first one stands for all.
        let told = accounts.found.first().map(|(_, starts)| starts.clone());

        let mut terminated = flags(arrays.first(TERMINATED)?);
        let mut truncated = flags(arrays.first(TRUNCATED)?);
        if let (Some((_, flags)), Some(starts)) = (&mut terminated, &told)
            && flags.len() == starts.len()
            && starts.len() != n
        {
            // `imitation` keeps one flag for each trajectory.
            let (mut at_step, mut cut) = (vec![false; n], vec![false; n]);
            for (i, &flag) in flags.iter().enumerate() {
                let last = starts.get(i + 1).copied().unwrap_or(n) - 1;
                (at_step[last], cut[last]) = (flag, !flag);
            }
            (*flags, truncated) = (at_step, Some(("the same", cut)));
        }
        let done = flags(arrays.first(DONE)?);
        for (name, flags) in [&terminated, &truncated, &done].into_iter().flatten() {
            if flags.len() != n {
                return Err(EpisodesError::Flags {
                    name,
                    found: flags.len(),
                    steps: n,
                }
                .into());
            }
        }
        let starts_told = told.is_some();
        let ends_told = terminated.is_some() || truncated.is_some();
        let is_set = |flags: &Option<(&str, Vec<bool>)>, row: usize| {
            flags.as_ref().is_some_and(|(_, flags)| flags[row])
        };
        let ends = |row| is_set(&terminated, row) || is_set(&truncated, row) || is_set(&done, row);
        let starts = told.unwrap_or_else(|| after_each(n, ends));
        let mut episodes = Self {
            are_told: starts_told || ends_told || done.is_some(),
            ends_are_told: ends_told,
            last_rows_are_marked: last.is_some(),
            terminated: (0..n).map(|row| is_set(&terminated, row)).collect(),
            truncated: (0..n).map(|row| is_set(&truncated, row)).collect(),
            starts,
        };
        if let Some((_, done)) = &done {
            episodes.finish(done, limit, terminated.is_some());
        }
        // Another number of returns shows that episodes were joined or split.
        if let Some((name, returns)) = arrays.first(RETURNS)?
            && returns.rows() != episodes.starts.len()
        {
            let (told, found) = (returns.rows(), episodes.starts.len());
            return Err(EpisodesError::Returns { name, told, found }.into());
        }
        Ok(episodes)
    }

    /// Classifies the steps that are `done` without a reason: cut after `limit` steps, else
    /// terminated; always cut if the file marks terminations separately.
    fn finish(&mut self, done: &[bool], limit: u64, terminations_are_told: bool) {
        let mut start = 0;
        for (row, _) in done.iter().enumerate().filter(|(_, done)| **done) {
            if !self.terminated[row] && !self.truncated[row] {
                let cut = terminations_are_told || (row + 1 - start) as u64 >= limit;
                (self.terminated[row], self.truncated[row]) = (!cut, cut);
            }
            start = row + 1;
        }
    }

    /// The number of episodes.
    pub(super) fn count(&self) -> usize {
        self.starts.len()
    }

    /// The last row of each episode.
    pub(super) fn last_rows(&self) -> Vec<usize> {
        let ends = self
            .starts
            .iter()
            .skip(1)
            .copied()
            .chain([self.terminated.len()]);
        ends.map(|end| end - 1).collect()
    }

    /// Removes each episode's last row, and moves its end to the row before.
    /// Each episode must have two rows or more.
    pub(super) fn drop_last_rows(&mut self) {
        let dropped = self.last_rows();
        for flags in [&mut self.terminated, &mut self.truncated] {
            dropped.iter().for_each(|&row| flags[row - 1] |= flags[row]);
            let mut row = 0..;
            flags.retain(|_| {
                row.next()
                    .is_some_and(|row| dropped.binary_search(&row).is_err())
            });
        }
        self.starts
            .iter_mut()
            .enumerate()
            .for_each(|(episode, start)| *start -= episode);
    }
}

/// The accounts of where episodes start.
struct Accounts {
    n: usize,
    found: Vec<(&'static str, Vec<usize>)>,
}

impl Accounts {
    /// Adds an account. Errors: it contradicts an earlier one.
    fn add(&mut self, name: &'static str, starts: Vec<usize>) -> Result<(), EpisodesError> {
        if let Some((other, before)) = self.found.first()
            && *before != starts
        {
            let row = (0..self.n)
                .find(|row| before.binary_search(row).is_ok() != starts.binary_search(row).is_ok());
            let row = row.unwrap_or_default();
            let (one, other) = if starts.contains(&row) {
                (name, *other)
            } else {
                (*other, name)
            };
            return Err(EpisodesError::Contradiction { one, other, row });
        }
        self.found.push((name, starts));
        Ok(())
    }
}

fn flags(found: Option<(&'static str, Array)>) -> Option<(&'static str, Vec<bool>)> {
    found.map(|(name, array)| (name, array.numbers().iter().map(|&x| x != 0.0).collect()))
}

/// Row 0, and the row after each row for which `ends` holds.
fn after_each(n: usize, ends: impl Fn(usize) -> bool) -> Vec<usize> {
    (0..n).filter(|&row| row == 0 || ends(row - 1)).collect()
}

/// `starts` as row numbers. Errors: they do not rise, or leave `n`.
fn rising(
    name: &'static str,
    starts: impl Iterator<Item = f64>,
    n: usize,
) -> Result<Vec<usize>, EpisodesError> {
    let rows: Option<Vec<usize>> = starts
        .map(|at| (at.fract() == 0.0 && at >= 0.0 && at < n as f64).then_some(at as usize))
        .collect();
    rows.filter(|rows| rows.is_sorted_by(|a, b| a < b))
        .ok_or(EpisodesError::Disorder(name))
}

/// The rows where the number of the episode changes. Errors: a number comes again.
fn changes(name: &'static str, numbers: &[f64]) -> Result<Vec<usize>, EpisodesError> {
    let mut seen = HashSet::new();
    let mut starts = Vec::new();
    for (row, &number) in numbers.iter().enumerate() {
        if row > 0 && number.to_bits() == numbers[row - 1].to_bits() {
            continue;
        }
        if !seen.insert(number.to_bits()) {
            return Err(EpisodesError::Apart { name, number, row });
        }
        starts.push(row);
    }
    Ok(starts)
}

/// The rows where the step within the episode starts over. Errors: it does not rise by one.
fn restarts(name: &'static str, steps: &[f64]) -> Result<Vec<usize>, EpisodesError> {
    let mut starts = Vec::new();
    for (row, &step) in steps.iter().enumerate() {
        if row > 0 && step == steps[row - 1] + 1.0 {
            continue;
        }
        if !step.is_finite() {
            return Err(EpisodesError::NoStep { name, step, row });
        }
        if step != steps[0] {
            return Err(EpisodesError::OutOfStep {
                name,
                step,
                row,
                next: steps[row - 1] + 1.0,
                first: steps[0],
            });
        }
        starts.push(row);
    }
    Ok(starts)
}
