//! The files that the paper's authors published with their later code (github.com/id9502/RLFrame).
//!
//! A dictionary with `trajectory`, a list of episodes, each a list of steps with `s` and `a`; and
//! with `filter state dict`. Actions are raw; states went through the demonstrator's own filter,
//! `clip((x - mean) / std, -5, 5)`, which is undone with the mean, sum of squared errors and count
//! that the file keeps. What was clipped stays at the clip.

mod error;

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};

pub use error::TrajectoryError;

use super::{
    Imported, MAX_NUMBERS, NAMES, infer_ends,
    pickle::{Object, Pickle},
};
use crate::{demo::Demonstration, env::EnvId};

/// Where the demonstrator's filter clipped.
const CLIP: f64 = 5.0;

/// Reads the demonstration from `bytes`, a pickle.
pub(super) fn read(bytes: &[u8], env: EnvId) -> Result<Imported, TrajectoryError> {
    let pickle = Pickle::read(bytes)?;
    let root = pickle.root();
    let Some(Object::List(episodes)) = pickle.entry(root, "trajectory") else {
        return Err(TrajectoryError::NoEpisodes);
    };
    let (mut states, mut actions, mut episode_starts) = (Vec::new(), Vec::new(), Vec::new());
    let (mut state_dim, mut action_dim, mut ignored) = (None, None, BTreeSet::new());
    let (mut n, mut looked_at) = (0, 0);
    for (episode, &steps) in episodes.iter().enumerate() {
        let Object::List(steps) = pickle.get(steps) else {
            return Err(TrajectoryError::Episode(episode));
        };
        if steps.is_empty() {
            continue;
        }
        episode_starts.push(n);
        for (step, &entries) in steps.iter().enumerate() {
            let entry = pickle.get(entries);
            let Object::Dict(entries) = entry else {
                return Err(TrajectoryError::Step { step, episode });
            };
            // A list may hold one step many times, so the file's length does not bound its unfolded
            // size.
            looked_at += entries.len() + state_dim.unwrap_or(0) + action_dim.unwrap_or(0);
            if looked_at > MAX_NUMBERS {
                return Err(TrajectoryError::TooManyNumbers);
            }
            for (key, numbers, dim) in [
                ("s", &mut states, &mut state_dim),
                ("a", &mut actions, &mut action_dim),
            ] {
                let found = pickle
                    .entry(entry, key)
                    .and_then(|object| pickle.numbers(object));
                let found = found.ok_or(TrajectoryError::NoNumbers { key, step, episode })?;
                let dim = *dim.get_or_insert(found.len());
                if found.len() != dim {
                    return Err(TrajectoryError::Length {
                        key,
                        step,
                        episode,
                        found: found.len(),
                        before: dim,
                    });
                }
                numbers.extend(found);
            }
            for &(key, _) in entries {
                if let Object::Text(key) = pickle.get(key)
                    && !["s", "a"].contains(key)
                {
                    ignored.insert(*key);
                }
            }
            n += 1;
        }
    }
    let mut losses = Vec::new();
    let mut observations = DMatrix::from_vec(state_dim.unwrap_or(0), n, states);
    match pickle.entry(root, "filter state dict") {
        Some(filter) => unfilter(&pickle, filter, &mut observations, &mut losses)?,
        None => losses.push("the file has no filter; its states are taken as raw".into()),
    }
    if !ignored.is_empty() {
        let names: Vec<&str> = ignored.iter().copied().take(NAMES).collect();
        let more = if ignored.len() > NAMES { " ..." } else { "" };
        losses.push(format!(
            "steps hold more than states and actions, which is not read: {}{more}",
            names.join(", ")
        ));
    }
    let texts = ["env name", "policy", "config", "env config"];
    let text = |key| match pickle.entry(root, key) {
        Some(&Object::Text(text)) => Some(text),
        _ => None,
    };
    let provenance = texts
        .iter()
        .filter_map(|&key| Some((key.replace(' ', "_"), text(key)?.to_owned())));
    let mut demonstration = Demonstration {
        observations,
        actions: DMatrix::from_vec(action_dim.unwrap_or(0), n, actions),
        rewards: None,
        episode_starts,
        terminated: vec![false; n],
        truncated: vec![false; n],
        poses: None,
        provenance: provenance.collect(),
    };
    // The pickle does not say why an episode ended.
    infer_ends(&mut demonstration, env, &mut losses);
    losses.push("rewards and poses are not recorded".into());
    Ok(Imported {
        demonstration,
        losses,
        warnings: Vec::new(),
    })
}

/// Turns filtered states back into raw ones: `x = s std + mean`, `std = sqrt(errsum / (n - 1))`.
fn unfilter(
    pickle: &Pickle<'_>,
    filter: &Object<'_>,
    states: &mut DMatrix<f64>,
    losses: &mut Vec<String>,
) -> Result<(), TrajectoryError> {
    let dim = states.nrows();
    let numbers = |key: &'static str| {
        let numbers = pickle
            .entry(filter, key)
            .and_then(|object| pickle.numbers(object));
        let numbers = numbers.ok_or(TrajectoryError::NoStatistic(key))?;
        if numbers.len() == dim {
            Ok(DVector::from_vec(numbers))
        } else {
            Err(TrajectoryError::Statistic {
                key,
                found: numbers.len(),
                needed: dim,
            })
        }
    };
    let (mean, squared_errors) = (numbers("zfilter mean")?, numbers("zfilter errsum")?);
    let count = pickle
        .entry(filter, "zfilter n_step")
        .and_then(|object| pickle.number(object));
    let count = count
        .filter(|&count| count > 1.0)
        .ok_or(TrajectoryError::NoCount)?;
    let deviation = squared_errors.map(|sum| (sum / (count - 1.0)).sqrt());
    // Counted while the states are still in the filter's units.
    let clipped = states.iter().filter(|state| state.abs() >= CLIP).count();
    for mut state in states.column_iter_mut() {
        state.component_mul_assign(&deviation);
        state += &mean;
    }
    if clipped > 0 {
        losses.push(format!(
            "{clipped} of {} numbers in observations ({:.2} %) were clipped at {CLIP} standard deviations and cannot be recovered; they stay there",
            states.len(),
            100.0 * clipped as f64 / states.len() as f64
        ));
    }
    Ok(())
}
