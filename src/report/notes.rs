//! Notes for a reader of the numbers: budget, seeds, readings of the MMD, failures.

use std::collections::{BTreeMap, BTreeSet};

use crate::spec::{Key, Relation};

use super::{
    amount::{count, steps},
    axis,
    cell::{Cell, Row},
    claims::ClaimRow,
    comparable,
    recorded::{Run, State, demonstrated_return},
    reference,
};

/// Below this many seeds an interval says little about the algorithm.
const ENOUGH_SEEDS: usize = 10;

/// How to read differences and verdicts.
const VERDICTS: &str = "Difference: ours less the paper's in the expected best of five seeds, its \
    90 % interval; seeds are taken to be normal, and the paper's to deviate as ours do. \
    Reproduced: within a tenth of the paper's Expert - Random. Better, worse: beyond it, at 5 % \
    after Holm's correction over all cells of the report. Runs that failed count a second time at \
    the random policy's return; a verdict holds both ways.";

/// The notes of a table over `runs`, whose rows are `rows`.
pub fn of_table(runs: &[&Run], rows: &[Row]) -> Vec<String> {
    let cells: Vec<&Cell> = rows
        .iter()
        .flat_map(|row| row.cells.iter().flatten())
        .collect();
    let mut notes = vec![finished(runs.iter().copied(), runs.len())];
    notes.push(
        "Ours: mean ± half-width of the 95 % Student t interval over seeds, of the dense return of \
         the final evaluation (a seed's value is the mean over its episodes)."
            .to_owned(),
    );
    if cells.iter().any(|cell| cell.paper.is_some()) {
        notes.push(format!(
            "The paper's: mean ± standard deviation over 50 episodes under the best policy of five \
             seeds; {}.",
            best_seed(
                cells
                    .iter()
                    .filter(|cell| cell.paper.is_some())
                    .map(|cell| cell.seeds)
            )
        ));
    }
    if cells.iter().any(|cell| cell.comparison.is_some()) {
        notes.push(VERDICTS.to_owned());
    }
    // A set: a parameter is named once, however many cells depart in it.
    let departures: BTreeSet<&str> = cells
        .iter()
        .flat_map(|cell| &cell.departures)
        .map(String::as_str)
        .collect();
    if !departures.is_empty() {
        let list = departures.into_iter().collect::<Vec<_>>().join(", ");
        notes.push(format!(
            "The paper's values are of its setting, which the defaults are as far as it is known; \
             runs that depart from them have none beside them: {list}."
        ));
    }
    // A table of one column is a list, which has no column for demonstrations.
    let in_a_column = |row: &Row| row.cells.len() > 1 && row.demo.or(row.paper_demo).is_some();
    if rows.iter().any(in_a_column) {
        notes.push(
            "Demo: dense return of the demonstration, the mean over its episodes.".to_owned(),
        );
    } else {
        notes.extend(demonstrations(
            runs,
            cells.iter().any(|cell| cell.paper.is_some()),
        ));
    }
    let budget = span(runs, |run| run.spec.budget.env_steps.get(), steps);
    notes.push(
        if runs.iter().any(|run| run.spec.trains_noticeably_longer()) {
            let training: Vec<&Run> = runs
                .iter()
                .copied()
                // Runs that do not train in the environment would make the least of the span 0.
                .filter(|run| run.spec.trained_steps() > 0)
                .collect();
            let trained = span(&training, |run| run.spec.trained_steps(), steps);
            format!(
                "Budget: {budget} environment steps; trained for {trained}, \
                 since rollouts are whole."
            )
        } else {
            format!("Budget: {budget} environment steps.")
        },
    );
    let short = |run: &Run| run.spec.budget.env_steps.get() < reference::assumed_budget(&run.spec);
    let short: Vec<&Run> = runs.iter().copied().filter(|run| short(run)).collect();
    if !short.is_empty() && cells.iter().any(|cell| cell.paper.is_some()) {
        let assumed = span(&short, |run| reference::assumed_budget(&run.spec), steps);
        notes.push(format!(
            "The paper prints no length: its values are compared with runs of {assumed} steps, a \
             choice of this program; shorter ones stand beside them without a verdict."
        ));
    }
    let episodes = span(
        runs,
        |run| run.spec.evaluation.final_episodes.get(),
        |episodes| episodes.to_string(),
    );
    notes.push(format!(
        "Final evaluation: {episodes} episodes with the mean action."
    ));
    notes.extend(few_seeds(cells.iter().map(|cell| cell.seeds)));
    notes.extend(readings(runs));
    notes.extend(failures(runs));
    notes
}

/// The notes of claims whose rows are `rows`.
pub fn of_claims(rows: &[ClaimRow]) -> Vec<String> {
    let mut notes = vec![
        "Difference: mean over seeds of the first runs less that of the others, with Welch's \
         interval; over several environments in units of the paper's Expert - Random. Above: the \
         share of pairs of seeds in which the first is above the other."
            .to_owned(),
        "A claim holds, or is contradicted, at 5 % after Holm's correction over its rows; p is the \
         smaller of both p values. Runs that failed count a second time at the random policy's \
         return; a verdict holds both ways."
            .to_owned(),
    ];
    if rows.iter().any(|row| row.claim.is == Relation::Kept) {
        notes.push(
            "Share: of the iterations after the first in which the constraint was met, those in \
             which MMD² was at most a thousandth above the tolerance in force; mean over seeds \
             with Student's interval."
                .to_owned(),
        );
    }
    notes.extend(few_seeds(
        rows.iter()
            .flat_map(|row| [Some(row.seeds), row.than])
            .flatten()
            .map(|count| count.found),
    ));
    notes
}

/// `2 of 4 runs finished.`, and how many runs were recorded under another specification, with the
/// keys that differ.
pub fn finished<'a>(runs: impl Iterator<Item = &'a Run>, planned: usize) -> String {
    let (mut finished, mut differing) = (0, 0);
    let mut keys: Vec<String> = Vec::new();
    for run in runs {
        match &run.state {
            State::Finished(_) => finished += 1,
            State::Differs { changes } => {
                differing += 1;
                keys.extend(
                    changes
                        .iter()
                        .map(|change| format!("`{}`", comparable::key(change))),
                );
            }
            State::Missing | State::Failed { .. } => {}
        }
    }
    keys.sort();
    keys.dedup();
    let left_out = match differing {
        0 => String::new(),
        1 => format!("; 1 was recorded with another {}", listed(&keys)),
        _ => format!("; {differing} were recorded with another {}", listed(&keys)),
    };
    format!(
        "{finished} of {} finished{left_out}.",
        count(planned, "run")
    )
}

/// The first few entries of a list, and the number of the others.
pub fn listed(list: &[String]) -> String {
    const SHOWN: usize = 6;
    let shown = list[..list.len().min(SHOWN)].join(", ");
    if list.len() > SHOWN {
        format!("{shown} and {} more", list.len() - SHOWN)
    } else {
        shown
    }
}

/// How our best seed, chosen from `seeds` seeds per cell, compares with the paper's best of five.
fn best_seed(seeds: impl Iterator<Item = usize>) -> String {
    let seeds: BTreeSet<usize> = seeds.filter(|seeds| *seeds > 0).collect();
    match (seeds.first(), seeds.last()) {
        (Some(5), Some(5)) | (None, _) => "best seed is ours in the same way".to_owned(),
        (Some(1), Some(1)) => "best seed is ours of one seed alone".to_owned(),
        (Some(fewest), Some(most)) if fewest < most => {
            format!("best seed is ours of {fewest} to {most} seeds")
        }
        (Some(seeds), _) => format!("best seed is ours of {seeds} seeds"),
    }
}

/// A warning about intervals where some cell has few finished `seeds`. Cells without any do not
/// count, since they have no interval.
fn few_seeds(seeds: impl Iterator<Item = usize>) -> Option<String> {
    let fewest = seeds.filter(|seeds| *seeds > 0).min()?;
    (fewest < ENOUGH_SEEDS).then(|| {
        format!(
            "Fewer than {ENOUGH_SEEDS} seeds ({fewest}): the intervals hold for normal samples \
             only, and say little of small differences."
        )
    })
}

/// The returns of the demonstrations, for a table without a column for them; with the paper's where
/// it `compares`.
fn demonstrations(runs: &[&Run], compares: bool) -> Option<String> {
    let told = |group: &axis::Group<'_>| {
        let env = group.runs[0].spec.env.name();
        let ours = demonstrated_return(&group.runs)?;
        let paper = reference::returns(env).filter(|_| compares);
        let paper = paper.map_or(String::new(), |paper| {
            format!(" (the paper's {:.2})", paper.demo)
        });
        Some(format!("{env} {ours:.2}{paper}"))
    };
    let list: Vec<String> = axis::group(runs, &[Key::Env])
        .iter()
        .filter_map(told)
        .collect();
    (!list.is_empty()).then(|| format!("Dense return of the demonstration: {}.", list.join(", ")))
}

/// Which reading of the MMD each algorithm used.
fn readings(runs: &[&Run]) -> Option<String> {
    let mut readings: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let key = Key::parse("mmd.samples");
    for run in runs {
        if let Some(samples) = key.as_ref().and_then(|key| run.value(key)) {
            let name = axis::display_name(run.spec.algorithm_name()).to_owned();
            readings
                .entry(name)
                .or_default()
                .insert(axis::Notation::Digits.label(&samples));
        }
    }
    let list: Vec<String> = readings
        .into_iter()
        .map(|(name, samples)| {
            format!(
                "{name} {}",
                samples.into_iter().collect::<Vec<_>>().join(" and ")
            )
        })
        .collect();
    (!list.is_empty()).then(|| format!("Samples of the MMD: {}.", list.join(", ")))
}

/// One note per failed run, with its error.
fn failures(runs: &[&Run]) -> Vec<String> {
    let failed = runs.iter().filter_map(|run| match &run.state {
        State::Failed { error } => Some(format!("Failed: {}: {error}", run.spec.id)),
        State::Missing | State::Differs { .. } | State::Finished(_) => None,
    });
    failed.collect()
}

/// The range of a number over `runs`: one value, or the least and the greatest.
fn span(runs: &[&Run], number: impl Fn(&Run) -> u64, text: impl Fn(u64) -> String) -> String {
    let numbers: BTreeSet<u64> = runs.iter().map(|run| number(run)).collect();
    match (numbers.first(), numbers.last()) {
        (Some(least), Some(most)) if least < most => format!("{} to {}", text(*least), text(*most)),
        (Some(only), _) => text(*only),
        (None, _) => "no".to_owned(),
    }
}

#[cfg(test)]
mod tests;
