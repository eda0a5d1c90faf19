//! The origin of the page's numbers: the programs that computed them, the demonstrations, and the
//! commands to compute them again.

use std::collections::BTreeMap;

use super::{Contents, table};
use crate::{
    escape,
    record::Git,
    report::{
        recorded::{Run, Trace},
        text::{Grid, alone},
    },
};

/// The commands, the programs and machines, and the demonstrations.
pub fn body(page: &Contents<'_>) -> String {
    [
        commands(page),
        programs(page.runs),
        demonstrations(page.runs),
    ]
    .concat()
}

fn commands(page: &Contents<'_>) -> String {
    let file = page.spec.file.display();
    let results = page
        .home
        .parent()
        .filter(|results| *results != std::path::Path::new("results"));
    let option = results.map_or(String::new(), |results| {
        format!(" --results {}", results.display())
    });
    let finished = page.runs.iter().find(|run| run.recording().is_some());
    let again = finished.map(|run| {
        let folder = page.home.join("runs").join(&run.spec.id);
        (
            "one run trained again and compared with its record",
            format!("mcpo-run reproduce '{}'", folder.display()),
        )
    });
    let lines = [
        (
            "what is missing is run, then reported",
            format!("mcpo-run {file}{option}"),
        ),
        ("this report, from what is recorded", page.command.clone()),
    ];
    let line = |(what, command): (&str, String)| {
        format!(
            "<dt>{what}</dt><dd><code>{}</code></dd>\n",
            escape::html(&command)
        )
    };
    format!(
        "<dl class=\"commands\">\n{}</dl>\n",
        lines.into_iter().chain(again).map(line).collect::<String>()
    )
}

/// One row for each program and class of machine, with the number of runs.
fn programs(runs: &[Run]) -> String {
    let mut counts: BTreeMap<Vec<String>, usize> = BTreeMap::new();
    for trace in runs.iter().filter_map(|run| run.trace.as_ref()) {
        *counts.entry(computed_by(trace)).or_default() += 1;
    }
    let rows = counts.into_iter().map(|(mut cells, count)| {
        cells.push(count.to_string());
        cells
    });
    list(
        "What computed the runs",
        &[
            "program",
            "commit",
            "MuJoCo",
            "processor",
            "its class",
            "runs",
        ],
        rows.collect(),
    )
}

fn computed_by(trace: &Trace) -> Vec<String> {
    let commit = trace
        .git
        .as_ref()
        .map_or(String::new(), |Git { commit, dirty }| {
            let short: String = commit.chars().take(12).collect();
            if *dirty {
                format!("{short}, changed")
            } else {
                short
            }
        });
    vec![
        format!("mcpo-run {}", trace.program),
        commit,
        trace.mujoco.clone().unwrap_or_default(),
        trace.cpu.clone().unwrap_or_default(),
        trace.cpu_class.clone(),
    ]
}

/// One row for each demonstration that was learned from.
fn demonstrations(runs: &[Run]) -> String {
    let mut rows: BTreeMap<(&str, &str), Vec<String>> = BTreeMap::new();
    for run in runs {
        let Some(recording) = run.recording() else {
            continue;
        };
        let Some(digest) = &recording.demonstration else {
            continue;
        };
        let held = recording.demonstrated.as_ref();
        let env = run.spec.env.name();
        rows.entry((env, digest)).or_insert_with(|| {
            vec![
                env.to_owned(),
                held.map_or(String::new(), |held| held.episodes.to_string()),
                held.map_or(String::new(), |held| held.steps.to_string()),
                held.and_then(|held| held.mean_return)
                    .map_or(String::new(), alone),
                digest.chars().take(16).collect(),
            ]
        });
    }
    let headers = [
        "environment",
        "episodes",
        "steps",
        "mean return",
        "BLAKE3 of the file",
    ];
    list("Demonstrations", &headers, rows.into_values().collect())
}

/// A table under its title; nothing without rows.
fn list(title: &str, headers: &[&str], rows: Vec<Vec<String>>) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let numbers = ["runs", "episodes", "steps", "mean return"];
    let numeric = headers
        .iter()
        .map(|header| numbers.contains(header))
        .collect();
    let headers = headers.iter().map(|header| (*header).to_owned()).collect();
    format!(
        "<h3>{title}</h3>\n{}",
        table::html(
            &Grid {
                headers,
                rows,
                names: 1,
                numeric
            },
            title,
            false
        )
    )
}
