//! Assembles a demonstration from named arrays.

use nalgebra::DMatrix;

use super::{
    ArraysError, Imported, NAMES,
    arrays::{Array, Arrays, Named},
    episodes::Episodes,
    infer_ends,
};
use crate::{
    demo::Demonstration,
    env::{EnvId, Pose},
};

/// The names that other programs use for a step's quantities; [`Episodes`] knows those that mark
/// episodes.
const OBSERVATIONS: &[&str] = &["observation", "observations", "obs", "observation.state"];
const ACTIONS: &[&str] = &["action", "actions", "acts"];
const REWARDS: &[&str] = &["reward", "rewards", "rews", "next.reward"];
const QPOS: &[&str] = &["qpos", "infos/qpos"];
const QVEL: &[&str] = &["qvel", "infos/qvel"];

/// The most steps of a demonstration.
pub(super) const MAX_STEPS: usize = 1 << 21;

/// The demonstration of `env` from the arrays called `names`, which `named` looks up.
///
/// # Errors
///
/// Arrays are missing, of unequal lengths, too large, or contradict each other.
pub(super) fn assemble<'n>(
    env: EnvId,
    names: impl IntoIterator<Item = &'n str>,
    named: &Named<'_>,
) -> Result<Imported, ArraysError> {
    let mut arrays = Arrays::new(named);
    // Other arrays may have one more row after each episode, so the actions say how many steps there
    // are.
    let actions = arrays.required(ACTIONS)?;
    let n = actions.rows();
    if n == 0 {
        return Err(ArraysError::NoSteps);
    }
    if n > MAX_STEPS {
        return Err(ArraysError::TooManySteps(n));
    }
    let episodes = Episodes::of(&mut arrays, n, env.max_steps())?;
    let mut assembly = Assembly {
        arrays,
        n,
        episodes,
        after_last: false,
        losses: Vec::new(),
    };
    let mut steps = Steps {
        actions: actions.into_columns(),
        observations: assembly.observations()?,
        poses: assembly.poses()?,
        rewards: assembly.rewards()?,
    };
    if steps.end_in_no_steps(&assembly.episodes) {
        assembly.drop_last_rows(&mut steps);
    }
    Ok(assembly.finish(env, steps, names))
}

/// The steps of all episodes, one after another.
struct Steps {
    /// `[observation, n]`.
    observations: DMatrix<f64>,
    /// `[action, n]`.
    actions: DMatrix<f64>,
    /// `[n]`.
    rewards: Option<Vec<f64>>,
    /// `[n]`.
    poses: Option<Vec<Pose>>,
}

impl Steps {
    /// Whether the last row of each of the `episodes` is the observation after its last step, as in
    /// RLDS: the action and reward of these rows mean nothing and are 0, and those of other rows
    /// are not.
    fn end_in_no_steps(&self, episodes: &Episodes) -> bool {
        if !episodes.last_rows_are_marked {
            return false;
        }
        let last = episodes.last_rows();
        let long = last
            .iter()
            .zip(&episodes.starts)
            .all(|(last, start)| last > start);
        let is_zero = |row: usize| {
            self.actions.column(row).iter().all(|&a| a == 0.0)
                && self.rewards.as_ref().is_none_or(|r| r[row] == 0.0)
        };
        long && last.iter().all(|&row| is_zero(row))
            && self.actions.iter().any(|&action| action != 0.0)
    }
}

/// A file whose steps are being assembled.
struct Assembly<'a> {
    arrays: Arrays<'a>,
    /// The number of rows of the actions.
    n: usize,
    episodes: Episodes,
    /// Whether an observation after each episode's last step was left out.
    after_last: bool,
    losses: Vec<String>,
}

impl Assembly<'_> {
    fn observations(&mut self) -> Result<DMatrix<f64>, ArraysError> {
        let observations = self.arrays.required(OBSERVATIONS)?;
        self.of_steps("observations", observations)
    }

    /// The poses; absent unless both halves are there.
    fn poses(&mut self) -> Result<Option<Vec<Pose>>, ArraysError> {
        // Both are looked up even if one is missing, so that it does not count as unused.
        let (qpos, qvel) = (self.arrays.first(QPOS)?, self.arrays.first(QVEL)?);
        let (qpos, qvel) = match (qpos, qvel) {
            (Some((_, qpos)), Some((_, qvel))) => {
                (self.of_steps("qpos", qpos)?, self.of_steps("qvel", qvel)?)
            }
            (one, other) => {
                let alone = one.or(other).map_or_else(String::new, |(name, _)| {
                    format!(" (`{name}` alone is not enough)")
                });
                self.losses.push(format!(
                    "poses are not recorded{alone}; the demonstration cannot be verified by replay"
                ));
                return Ok(None);
            }
        };
        let pairs = qpos.column_iter().zip(qvel.column_iter());
        let poses = pairs.map(|(q, v)| Pose {
            qpos: q.as_slice().to_vec(),
            qvel: v.as_slice().to_vec(),
        });
        Ok(Some(poses.collect()))
    }

    fn rewards(&mut self) -> Result<Option<Vec<f64>>, ArraysError> {
        let rewards = self.arrays.of_each_step(REWARDS, self.n)?;
        if rewards.is_none() {
            self.losses.push("rewards are not recorded".into());
        }
        Ok(rewards.map(|(_, rewards)| rewards))
    }

    /// The `array` called `name` with one column a step. If it has one row more for each episode,
    /// the row after the episode's last step is left out: it has no place in the format.
    fn of_steps(&mut self, name: &'static str, array: Array) -> Result<DMatrix<f64>, ArraysError> {
        let (n, rows, count) = (self.n, array.rows(), self.episodes.count());
        let columns = array.into_columns();
        if rows == n {
            return Ok(columns);
        }
        if rows != n + count {
            return Err(ArraysError::Rows {
                name,
                found: rows,
                steps: n,
                episodes: count,
            });
        }
        self.after_last = true;
        // Each episode before has one row more, too, and moves the place by one.
        let behind: Vec<_> = self
            .episodes
            .last_rows()
            .iter()
            .enumerate()
            .map(|(i, last)| last + i + 1)
            .collect();
        Ok(columns.remove_columns_at(&behind))
    }

    /// Leaves out each episode's last row, which is no step.
    fn drop_last_rows(&mut self, steps: &mut Steps) {
        let rows = self.episodes.last_rows();
        let without = |matrix: &mut DMatrix<f64>| {
            *matrix = std::mem::take(matrix).remove_columns_at(&rows);
        };
        without(&mut steps.observations);
        without(&mut steps.actions);
        steps.rewards = steps.rewards.take().map(|all| without_rows(all, &rows));
        steps.poses = steps.poses.take().map(|all| without_rows(all, &rows));
        self.episodes.drop_last_rows();
        self.after_last = true;
    }

    /// The demonstration of `env`, and whatever of the file's arrays, called `names`, is not in it.
    fn finish<'n>(
        self,
        env: EnvId,
        steps: Steps,
        names: impl IntoIterator<Item = &'n str>,
    ) -> Imported {
        let Self {
            arrays,
            n,
            episodes,
            after_last,
            mut losses,
        } = self;
        if after_last {
            losses.push(
                "the observation after each episode's last step has no place in the format".into(),
            );
        }
        let mut demonstration = Demonstration {
            observations: steps.observations,
            actions: steps.actions,
            rewards: steps.rewards,
            episode_starts: episodes.starts,
            terminated: episodes.terminated,
            truncated: episodes.truncated,
            poses: steps.poses,
            provenance: vec![],
        };
        if !episodes.ends_are_told {
            infer_ends(&mut demonstration, env, &mut losses);
        }
        losses.extend(not_used(&arrays.unused(names)));
        let joined = (!episodes.are_told).then(|| {
            format!("nothing says where episodes begin; all {n} steps are taken as one episode")
        });
        Imported {
            demonstration,
            losses,
            warnings: joined.into_iter().collect(),
        }
    }
}

/// `all` but those at the places `rows`, which rise.
fn without_rows<T>(all: Vec<T>, rows: &[usize]) -> Vec<T> {
    all.into_iter()
        .enumerate()
        .filter(|(row, _)| rows.binary_search(row).is_err())
        .map(|(_, item)| item)
        .collect()
}

/// The loss of the arrays called `unused`; absent if there are none.
fn not_used(unused: &[&str]) -> Option<String> {
    let more = if unused.len() > NAMES { " ..." } else { "" };
    (!unused.is_empty()).then(|| {
        format!(
            "not used: {}{more}",
            unused[..unused.len().min(NAMES)].join(", ")
        )
    })
}
