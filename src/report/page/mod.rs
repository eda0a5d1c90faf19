//! The report as one web page, `index.html`: a file that opens offline, runs its own script alone
//! and fetches nothing.
//!
//! Owns the page's order and its head. Knows nothing of how numbers come about: it shows the
//! content of a report's other files, and every run with its state. All content is in the text
//! itself; the script adds values under the pointer, switches and sorting. Start at [`html`].

mod claims;
mod figure;
mod numbers;
mod parts;
mod policy;
mod provenance;
mod runs;
mod table;
#[cfg(test)]
mod tests;

use std::path::Path;

use super::{
    amount,
    claims::ClaimsData,
    curve::CurveData,
    recorded::{Run, State},
    settings::SettingsData,
    statistics::StatisticsData,
    table::TableData,
    verdict::Verdict,
};
use crate::{escape, spec::ExperimentSpec};
use parts::{plural, prose, section};

/// The contents of a page.
pub struct Contents<'a> {
    /// The experiment.
    pub spec: &'a ExperimentSpec,
    /// The experiment's folder; the page lies in a folder within it.
    pub home: &'a Path,
    /// The command that made the report.
    pub command: String,
    /// The state of the experiment: finished, failed and left-out runs, a line each.
    pub state: &'a [String],
    /// The runs, in the plan's order.
    pub runs: &'a [Run],
    /// The claims; `None` where the file makes none.
    pub claims: Option<&'a ClaimsData>,
    /// The tables of returns, with their names.
    pub tables: Vec<(&'a str, &'a TableData)>,
    /// The tables of what was set, with their names.
    pub settings: Vec<(&'a str, SettingsData)>,
    /// The summaries over environments; `None` where there are none.
    pub statistics: Option<&'a StatisticsData>,
    /// The figures.
    pub figures: Vec<Figure<'a>>,
}

/// A figure of the page.
pub struct Figure<'a> {
    /// The name of its files.
    pub name: &'a str,
    /// The title above the figure.
    pub title: &'a str,
    /// The text below the figure.
    pub caption: String,
    /// The drawing: curves or a picture.
    pub shows: Shows,
    /// The formats in which it lies beside the page.
    pub files: Vec<&'static str>,
}

/// The drawing of a figure.
pub enum Shows {
    /// Curves, which are drawn anew for the page.
    Curves(Box<CurveData>),
    /// A picture, as SVG.
    Picture(String),
}

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// The page; the same bytes for the same contents.
pub fn html(page: &Contents<'_>) -> String {
    let sections = [
        (
            "claims",
            "Claims",
            page.claims.map_or(String::new(), claims::body),
        ),
        ("tables", "Tables", table::body(page)),
        ("figures", "Figures", figure::body(&page.figures)),
        (
            "statistics",
            "Statistics",
            page.statistics.map_or(String::new(), table::statistics),
        ),
        ("runs", "Runs", runs::body(page)),
        ("failures", "Failures", runs::failures(page)),
        ("provenance", "Provenance", provenance::body(page)),
    ];
    // An empty section has no place in the page, and none in its menu.
    let filled = || sections.iter().filter(|(_, _, body)| !body.is_empty());
    let links: String = filled()
        .map(|(id, title, _)| format!("<a href=\"#{id}\">{title}</a>\n"))
        .collect();
    let bodies: String = filled()
        .map(|(id, title, body)| section(id, title, body))
        .collect();
    let (name, description) = (escape::html(&page.spec.name), prose(&page.spec.description));
    // A policy in a `meta` element holds for what follows it, so it stands before the style.
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta name=\"generator\" content=\"mcpo-run {version}\">\n\
         <title>{name}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <a class=\"skip\" href=\"#content\">Skip to the content</a>\n\
         <header>\n<p class=\"kind\">Report of an experiment</p>\n<h1>{name}</h1>\n\
         <p class=\"lead\">{description}</p>\n{summary}</header>\n\
         <nav aria-label=\"Sections\">\n{links}</nav>\n\
         <main id=\"content\">\n{bodies}</main>\n\
         <script type=\"application/json\" id=\"data\">{data}</script>\n\
         <script>{SCRIPT}</script>\n</body>\n</html>\n",
        policy = policy::content_security(),
        version = env!("CARGO_PKG_VERSION"),
        summary = summary(page),
        data = escape::script(&numbers::data(&page.figures)),
    )
}

/// The experiment's progress and its results, in a few words.
fn summary(page: &Contents<'_>) -> String {
    let count = |is: fn(&State) -> bool| page.runs.iter().filter(|run| is(&run.state)).count();
    let finished = count(|state| matches!(state, State::Finished(_)));
    let failed = count(|state| matches!(state, State::Failed { .. }));
    let mut tiles = vec![tile(
        "runs",
        "Runs",
        &format!("{finished} of {}", page.runs.len()),
        "finished",
        bar(page.runs),
    )];
    if let Some(claims) = page.claims {
        let (numbers, words) = claims::counts(claims);
        tiles.push(tile("claims", "Claims", &numbers, &words, String::new()));
    }
    let verdicts: Vec<&Verdict> = page
        .tables
        .iter()
        .flat_map(|(_, table)| &table.rows)
        .flat_map(|row| row.cells.iter().flatten())
        .filter_map(|cell| cell.verdict.as_ref())
        .collect();
    if !verdicts.is_empty() {
        let of = |is: fn(&Verdict) -> bool| verdicts.iter().filter(|verdict| is(verdict)).count();
        let reproduced = of(|verdict| *verdict == Verdict::Reproduced);
        let beyond = of(|verdict| matches!(verdict, Verdict::Better | Verdict::Worse));
        let words = format!("of the paper's values reproduced, {beyond} beyond the margin");
        tiles.push(tile(
            "tables",
            "Values",
            &format!("{reproduced} of {}", verdicts.len()),
            &words,
            String::new(),
        ));
    }
    if failed > 0 {
        tiles.push(tile(
            "failures",
            "Failures",
            &failed.to_string(),
            &plural(failed, "run"),
            String::new(),
        ));
    }
    // The first line repeats the first tile, and says more only where runs were left out.
    let told = format!(
        "{finished} of {} finished.",
        amount::count(page.runs.len(), "run")
    );
    let lines = page.state.iter().filter(|line| **line != told);
    let lines: String = lines
        .map(|line| format!("<li>{}</li>\n", prose(line)))
        .collect();
    let lines = if lines.is_empty() {
        lines
    } else {
        format!("<ul class=\"state\">\n{lines}</ul>\n")
    };
    format!(
        "<ul class=\"tiles\">\n{}</ul>\n{lines}\
         <p class=\"command\"><span>Made by</span> <code>{}</code></p>\n",
        tiles.concat(),
        escape::html(&page.command)
    )
}

fn tile(target: &str, title: &str, number: &str, words: &str, more: String) -> String {
    format!(
        "<li><a href=\"#{target}\"><span class=\"what\">{title}</span> <strong>{number}</strong> \
         <span>{words}</span>{more}</a></li>\n"
    )
}

/// The shares of the runs' states as a bar.
fn bar(runs: &[Run]) -> String {
    let mut x = 0;
    let parts = runs::Kind::ALL.map(|kind| {
        let count = runs
            .iter()
            .filter(|run| runs::Kind::of(run) == kind)
            .count();
        let (from, width) = (x, 1000 * count / runs.len().max(1));
        x += width;
        match width {
            0 => String::new(),
            _ => format!(
                "<rect class=\"{}\" x=\"{from}\" width=\"{width}\" height=\"8\"/>",
                kind.class()
            ),
        }
    });
    let parts = parts.concat();
    format!(
        "<svg class=\"bar\" viewBox=\"0 0 1000 8\" preserveAspectRatio=\"none\" \
         aria-hidden=\"true\">{parts}</svg>"
    )
}
