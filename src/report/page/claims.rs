//! The claims on the page: one line per claim, which opens to show the numbers of its rows.

use super::{
    parts::{files, notes, plural, prose, verdict},
    table,
};
use crate::report::{
    claims::{ClaimRow, ClaimVerdict, ClaimsData},
    text,
};

/// The width of an interval's picture, in its own units.
const WIDTH: f64 = 160.0;
const HEIGHT: f64 = 14.0;

/// All claims.
pub fn body(data: &ClaimsData) -> String {
    let claims: String = data.by_claim().map(claim).collect();
    format!(
        "{claims}{}{}",
        notes("Notes", &data.notes),
        files("claims", &[".csv", ".tex", ".md"])
    )
}

/// The number of claims that hold everywhere, and words on the others.
pub fn counts(data: &ClaimsData) -> (String, String) {
    let all: Vec<&str> = data.by_claim().map(worst).collect();
    let of = |verdict: &str| all.iter().filter(|found| **found == verdict).count();
    let words = format!(
        "hold, {} contradicted, {} inconclusive",
        of("contradicted"),
        of("inconclusive")
    );
    (format!("{} of {}", of("holds"), all.len()), words)
}

/// The verdict on a claim over all of its rows: contradicted where one row contradicts it, and held
/// where all rows hold.
fn worst(rows: &[ClaimRow]) -> &'static str {
    match () {
        () if rows
            .iter()
            .any(|row| row.verdict == ClaimVerdict::Contradicted) =>
        {
            "contradicted"
        }
        () if rows.iter().all(|row| row.verdict == ClaimVerdict::Holds) => "holds",
        () => "inconclusive",
    }
}

fn claim(rows: &[ClaimRow]) -> String {
    let (claim, overall) = (&rows[0].claim, text::claims::overall(rows));
    let told = if rows.len() > 1 {
        format!("<span class=\"places\">{}</span>", prose(&overall))
    } else {
        String::new()
    };
    format!(
        "<details class=\"claim\">\n\
         <summary>{mark}<span class=\"name\">{name}</span>{told}</summary>\n\
         <p>{compared}, over {places}.</p>\n{table}</details>\n",
        mark = verdict(worst(rows)),
        name = prose(&claim.name),
        compared = prose(&sentence(&text::claims::compared(rows))),
        places = format_args!("{} {}", rows.len(), plural(rows.len(), "row")),
        table = numbers(rows),
    )
}

/// `text` with a capital.
fn sentence(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |first| {
        first.to_uppercase().chain(characters).collect()
    })
}

/// The numbers of the rows, with pictures of their intervals on one scale.
fn numbers(rows: &[ClaimRow]) -> String {
    let grid = text::claims::grid_of(rows);
    let ends = rows
        .iter()
        .filter_map(|row| Some((row.difference?, row.limit)));
    let values: Vec<f64> = ends
        .flat_map(|(it, limit)| [it.low, it.high, it.mean, limit])
        .collect();
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| {
            (a.min(x), b.max(x))
        });
    // The first column is the claim, which the table's label already names.
    let head: String = grid.headers[1..]
        .iter()
        .zip(&grid.numeric[1..])
        .map(|(header, numeric)| {
            // The column of pictures stands beside the intervals, and needs no name.
            let picture = if header == "95 % interval" {
                "<th scope=\"col\"></th>"
            } else {
                ""
            };
            format!(
                "<th scope=\"col\"{}>{}</th>{picture}",
                if *numeric { " class=\"n\"" } else { "" },
                prose(header)
            )
        })
        .collect();
    let line = |(row, cells): (&ClaimRow, &Vec<String>)| {
        let [_, place, difference, interval, above, seeds, p, told] = cells.as_slice() else {
            return String::new();
        };
        let numbers: String = [above, seeds, p]
            .map(|cell| format!("<td class=\"n\">{}</td>", prose(cell)))
            .concat();
        format!(
            "<tr><th scope=\"row\">{}</th><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td>{}</td>{numbers}<td>{}</td></tr>\n",
            prose(place),
            prose(difference),
            prose(interval),
            picture(row, low, high),
            verdict(told)
        )
    };
    let rows_of_table: String = rows.iter().zip(&grid.rows).map(line).collect();
    table::table(&rows[0].claim.name, true, &head, &rows_of_table)
}

/// The interval of a row between `low` and `high`, and a line where the claim's limit is.
fn picture(row: &ClaimRow, low: f64, high: f64) -> String {
    let Some(it) = row.difference.filter(|_| high > low) else {
        return String::new();
    };
    let at = |x: f64| 4.0 + (WIDTH - 8.0) * (x - low) / (high - low);
    let middle = HEIGHT / 2.0;
    format!(
        "<svg class=\"interval\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" aria-hidden=\"true\">\
         <line class=\"limit\" x1=\"{limit:.1}\" x2=\"{limit:.1}\" y1=\"0\" y2=\"{HEIGHT}\"/>\
         <line x1=\"{:.1}\" x2=\"{:.1}\" y1=\"{middle}\" y2=\"{middle}\"/>\
         <circle cx=\"{:.1}\" cy=\"{middle}\" r=\"3\"/></svg>",
        at(it.low),
        at(it.high),
        at(it.mean),
        limit = at(row.limit),
    )
}
