//! Every run on the page: a grid by state, a table with links to the files of each, and the
//! failures.

use std::{
    collections::{BTreeSet, HashMap},
    path::Path,
};

use super::{
    Contents,
    parts::{plural, prose},
    table,
};
use crate::{
    escape,
    report::{
        amount,
        axis::{self, Group},
        curve::mean,
        recorded::{Run, State},
        text::alone,
    },
    spec::Key,
};

/// The place of each run in the plan, by its id.
type Places<'a> = HashMap<&'a str, usize>;

/// The state of a run, as its square shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// It used its budget.
    Finished,
    /// It has rows and has not ended.
    UnderWay,
    /// It ended in an error.
    Failed,
    /// It was recorded with other settings.
    Differs,
    /// Nothing is recorded.
    Missing,
}

impl Kind {
    /// In the order of the legend.
    pub const ALL: [Self; 5] = [
        Self::Finished,
        Self::UnderWay,
        Self::Failed,
        Self::Differs,
        Self::Missing,
    ];

    /// The state of `run`.
    pub fn of(run: &Run) -> Self {
        match &run.state {
            State::Finished(_) => Self::Finished,
            State::Failed { .. } => Self::Failed,
            State::Differs { .. } => Self::Differs,
            State::Missing if run.under_way.is_some() => Self::UnderWay,
            State::Missing => Self::Missing,
        }
    }

    /// The state's class in the page's style sheet.
    pub fn class(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::UnderWay => "under-way",
            Self::Failed => "failed",
            Self::Differs => "differs",
            Self::Missing => "missing",
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::UnderWay => "under way",
            Self::Failed => "failed",
            Self::Differs => "left out: other settings",
            Self::Missing => "to do",
        }
    }

    /// The mark in its square, so that colour is not the only difference.
    fn mark(self) -> &'static str {
        match self {
            Self::Finished => "✓",
            Self::UnderWay => "…",
            Self::Failed => "✕",
            Self::Differs => "≠",
            Self::Missing => "·",
        }
    }
}

/// The grid and the table of all runs.
pub fn body(page: &Contents<'_>) -> String {
    let kinds = Kind::ALL
        .into_iter()
        .filter(|kind| page.runs.iter().any(|run| Kind::of(run) == *kind));
    let legend: String = kinds
        .map(|kind| {
            let count = page.runs.iter().filter(|run| Kind::of(run) == kind).count();
            format!(
                "<li><span class=\"run {}\">{}</span> {count} {}</li>\n",
                kind.class(),
                kind.mark(),
                kind.word()
            )
        })
        .collect();
    let head = ["run", "state", "return", "steps", "seconds", "files"];
    let numeric = |name: &str| ["return", "steps", "seconds"].contains(&name);
    let head = head.map(|name| {
        format!(
            "<th scope=\"col\"{}>{name}</th>",
            if numeric(name) { " class=\"n\"" } else { "" }
        )
    });
    let rows: String = page
        .runs
        .iter()
        .enumerate()
        .map(|(index, run)| row(page.home, index, run))
        .collect();
    format!(
        "<ul class=\"states\">\n{legend}</ul>\n{}<details class=\"more\" id=\"all-runs\">\
         <summary>All {} {}, with links to their logs and data</summary>\n{}</details>\n",
        grid(page.runs),
        page.runs.len(),
        plural(page.runs.len(), "run"),
        table::table("All runs", true, &head.concat(), &rows)
    )
}

/// Settings by seeds: one square per run, environment by environment.
fn grid(runs: &[Run]) -> String {
    let seeds: BTreeSet<u64> = runs.iter().map(|run| run.spec.seed.0).collect();
    let all: Vec<&Run> = runs.iter().collect();
    let places: Places<'_> = runs
        .iter()
        .enumerate()
        .map(|(index, run)| (run.spec.id.as_str(), index))
        .collect();
    let mut keys = vec![Key::Algorithm];
    keys.extend(axis::hidden_axes(&all, &[Key::Env, Key::Algorithm]));
    let envs = axis::group(&all, &[Key::Env]);
    let body = envs.iter().map(|env| {
        let settings = axis::group(&env.runs, &keys);
        let labels = axis::labels(&keys, &settings);
        let rows = settings.iter().zip(labels).map(|(setting, label)| {
            let cells = seeds.iter().map(|seed| squares(setting, *seed, &places));
            format!(
                "<tr><th scope=\"row\">{}</th>{}</tr>\n",
                prose(&label.text),
                cells.collect::<String>()
            )
        });
        format!(
            "<tbody>\n<tr><th scope=\"rowgroup\" colspan=\"{}\">{}</th></tr>\n{}</tbody>\n",
            seeds.len() + 1,
            escape::html(env.runs[0].spec.env.name()),
            rows.collect::<String>()
        )
    });
    let head: String = seeds
        .iter()
        .map(|seed| format!("<th scope=\"col\">{seed}</th>"))
        .collect();
    format!(
        "<div class=\"scroll grid\" tabindex=\"0\" role=\"region\" \
         aria-label=\"Runs by setting and seed\">\n<table>\n\
         <thead><tr><th scope=\"col\">seed</th>{head}</tr></thead>\n{}</table>\n</div>\n",
        body.collect::<String>()
    )
}

/// The squares of the runs of `setting` with this seed, which lead to their rows.
fn squares(setting: &Group<'_>, seed: u64, places: &Places<'_>) -> String {
    let runs = setting.runs.iter().filter(|run| run.spec.seed.0 == seed);
    let square = |run: &&Run| {
        let kind = Kind::of(run);
        let told = match returned(run) {
            Some(value) => format!("seed {seed}: {}, return {}", kind.word(), alone(value)),
            None => format!("seed {seed}: {}", kind.word()),
        };
        format!(
            "<a class=\"run {}\" href=\"#r{}\" title=\"{told}\" aria-label=\"{told}\">{}</a>",
            kind.class(),
            places[run.spec.id.as_str()],
            kind.mark()
        )
    };
    format!("<td>{}</td>", runs.map(square).collect::<String>())
}

/// The mean return of the run's final evaluation.
fn returned(run: &Run) -> Option<f64> {
    Some(mean(&run.recording()?.final_returns()))
}

fn row(home: &Path, index: usize, run: &Run) -> String {
    let kind = Kind::of(run);
    let detail = match (&run.state, &run.under_way) {
        (State::Missing, Some(so_far)) => {
            let whole = run.spec.budget.env_steps.get();
            format!(
                "{}, {} of {} steps",
                kind.word(),
                amount::steps(so_far.env_steps),
                amount::steps(whole)
            )
        }
        (State::Differs { changes }, _) => format!("{}: {}", kind.word(), changes.join("; ")),
        _ => kind.word().to_owned(),
    };
    let number = |value: Option<f64>| {
        format!(
            "<td class=\"n\">{}</td>",
            value.map_or(String::new(), alone)
        )
    };
    let trace = run.trace.as_ref();
    format!(
        "<tr id=\"r{index}\"><th scope=\"row\">{}</th>\
         <td><span class=\"run {}\">{}</span> {}</td>{}{}{}<td>{}</td></tr>\n",
        escape::html(&run.spec.id),
        kind.class(),
        kind.mark(),
        prose(&detail),
        number(returned(run)),
        number(trace.map(|trace| trace.env_steps as f64)),
        number(trace.map(|trace| trace.seconds.round())),
        links(home, run)
    )
}

/// Links to those of the run's files that exist.
fn links(home: &Path, run: &Run) -> String {
    const FILES: [(&str, &str); 4] = [
        ("log.txt", "log"),
        ("progress.parquet", "progress"),
        ("evaluations.parquet", "evaluations"),
        ("run.json", "record"),
    ];
    let folders = [run.spec.id.clone(), format!("{}.partial", run.spec.id)];
    let Some(folder) = folders
        .into_iter()
        .find(|folder| home.join("runs").join(folder).is_dir())
    else {
        return String::new();
    };
    let there = FILES
        .iter()
        .filter(|(file, _)| home.join("runs").join(&folder).join(file).is_file());
    let link = |(file, word): &(&str, &str)| {
        format!(
            "<a href=\"{}\">{word}</a>",
            escape::link(&format!("../runs/{folder}/{file}"))
        )
    };
    there.map(link).collect::<Vec<_>>().join(" ")
}

/// The failed runs, each with its cause and the end of its log.
pub fn failures(page: &Contents<'_>) -> String {
    let failed = page.runs.iter().filter_map(|run| match &run.state {
        State::Failed { error } => Some((run, error)),
        State::Missing | State::Differs { .. } | State::Finished(_) => None,
    });
    let one = |(run, error): (&Run, &String)| {
        let tail = run.trace.iter().flat_map(|trace| &trace.log_tail);
        let tail: String = tail
            .map(|line| format!("{}\n", escape::html(line)))
            .collect();
        let tail = match tail.as_str() {
            "" => String::new(),
            tail => {
                format!(
                    "<details class=\"more\"><summary>The end of its log</summary>\n\
                     <pre>{tail}</pre></details>\n"
                )
            }
        };
        let (id, links) = (escape::html(&run.spec.id), links(page.home, run));
        format!(
            "<article class=\"failure\">\n<h3>{id}</h3>\n<p>{}</p>\n\
             {tail}<p class=\"files\">{links}</p>\n</article>\n",
            prose(error)
        )
    };
    failed.map(one).collect()
}
