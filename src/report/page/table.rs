//! Tables on the page.

use super::{
    Contents,
    parts::{files, notes, prose, verdict},
};
use crate::{
    escape,
    report::{
        statistics::StatisticsData,
        text::{self, Grid},
    },
};

/// All tables: of returns, and of settings.
pub fn body(page: &Contents<'_>) -> String {
    let returns = page.tables.iter().map(|(name, data)| {
        let (matrix, list) = text::grids(data);
        let list = html(&list, &data.title, true);
        let shown = match matrix {
            None => list,
            Some(matrix) => {
                let whole = "Every cell, with its seeds and verdict";
                let matrix = html(&matrix, &data.title, false);
                format!(
                    "{matrix}<details class=\"more\"><summary>{whole}</summary>\n{list}</details>\n"
                )
            }
        };
        let links = files(name, &[".csv", "-seeds.csv", ".tex", ".md"]);
        article(
            name,
            &data.title,
            &format!("{shown}{}{links}", notes("Notes", &data.notes)),
        )
    });
    let settings = page.settings.iter().map(|(name, data)| {
        let shown = html(&text::settings::grid(data), &data.title, false);
        let links = files(name, &[".csv", ".tex", ".md"]);
        article(
            name,
            &data.title,
            &format!("{shown}{}{links}", notes("Notes", &data.notes)),
        )
    });
    returns.chain(settings).collect()
}

/// The summaries over environments.
pub fn statistics(data: &StatisticsData) -> String {
    let shown = html(&text::statistics::grid(data), text::statistics::TITLE, true);
    let links = files("statistics", &[".csv", ".tex", ".md"]);
    format!("{shown}{}{links}", notes("Notes", &data.notes))
}

fn article(name: &str, title: &str, body: &str) -> String {
    format!(
        "<article id=\"{}\">\n<h3>{}</h3>\n{body}</article>\n",
        escape::html(name),
        prose(title)
    )
}

/// A grid as an HTML table. Where it is `sortable`, its rows can be ordered by any column. A table
/// wider than the page scrolls on its own.
pub fn html(grid: &Grid, label: &str, sortable: bool) -> String {
    let class = |column: usize| {
        if grid.numeric[column] {
            " class=\"n\""
        } else {
            ""
        }
    };
    let head = |(column, text): (usize, &String)| {
        format!("<th scope=\"col\"{}>{}</th>", class(column), prose(text))
    };
    let is_verdict = |column: usize| grid.headers[column] == "verdict";
    let cell = |(column, text): (usize, &String)| match column {
        _ if is_verdict(column) && !text.is_empty() => format!("<td>{}</td>", verdict(text)),
        _ if column < grid.names => format!("<th scope=\"row\">{}</th>", prose(text)),
        _ => format!("<td{}>{}</td>", class(column), prose(text)),
    };
    let row = |row: &Vec<String>| {
        format!(
            "<tr>{}</tr>\n",
            row.iter().enumerate().map(cell).collect::<String>()
        )
    };
    table(
        label,
        sortable,
        &grid
            .headers
            .iter()
            .enumerate()
            .map(head)
            .collect::<String>(),
        &grid.rows.iter().map(row).collect::<String>(),
    )
}

/// An HTML table with this head and these rows.
pub fn table(label: &str, sortable: bool, head: &str, rows: &str) -> String {
    let class = if sortable { " class=\"sortable\"" } else { "" };
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">\n<table{class}>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</div>\n",
        escape::html(label)
    )
}
