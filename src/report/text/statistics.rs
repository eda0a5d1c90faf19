//! Summaries over environments as text: one row per method.

use super::{
    Grid,
    csv::{number, value, written},
    markdown_grid, tex,
};
use crate::{
    escape,
    report::statistics::{Method, StatisticsData},
    spec::Key,
    stats::Estimate,
};

/// The title of the table.
pub const TITLE: &str = "Summary over environments";

/// The table as Markdown.
pub fn markdown(data: &StatisticsData) -> String {
    let notes: String = data
        .notes
        .iter()
        .map(|note| format!("- {}\n", escape::markdown(note)))
        .collect();
    format!("# {TITLE}\n\n{}\n{notes}", markdown_grid(&grid(data)))
}

/// The table for LaTeX, as [`latex`](super::latex) writes a table called `name`.
pub fn latex(name: &str, data: &StatisticsData) -> [String; 2] {
    let grid = grid(data);
    [
        tex::tabular(&grid),
        tex::float(name, TITLE, &data.notes, &grid),
    ]
}

/// The table as a grid.
pub fn grid(data: &StatisticsData) -> Grid {
    let compares = data.methods.len() > 1;
    let above = format!("{} above", data.methods[data.base].label.text);
    let all = [
        "method",
        "IQM",
        "median",
        "mean",
        "gap",
        "area",
        "half",
        &above,
        "environments",
        "runs",
    ];
    // Of one method alone, there is none for the base to be above.
    let shown = |header: &str| compares || header != above;
    let row = |method: &Method| {
        let of = &method.aggregates;
        let cells = [
            method.label.text.clone(),
            within(&of.iqm),
            within(&of.median),
            within(&of.mean),
            within(&of.optimality_gap),
            method.area.map_or(String::new(), two),
            // The median is infinite where most runs never came so far.
            if method.half.is_finite() {
                format!("{:.0} %", 100.0 * method.half)
            } else {
                "never".to_owned()
            },
            method.below_base.as_ref().map_or(String::new(), within),
            method.environments.to_string(),
            method.scores.to_string(),
        ];
        all.iter()
            .zip(cells)
            .filter(|(header, _)| shown(header))
            .map(|(_, cell)| cell)
            .collect()
    };
    let rows: Vec<Vec<String>> = data.methods.iter().map(row).collect();
    let headers: Vec<String> = all
        .iter()
        .filter(|header| shown(header))
        .map(|header| (*header).to_owned())
        .collect();
    let numeric = (0..headers.len()).map(|column| column > 0).collect();
    Grid {
        headers,
        rows,
        names: 1,
        numeric,
    }
}

/// An estimate with its interval, as `0.72 (0.67 to 0.77)`.
fn within(estimate: &Estimate) -> String {
    format!(
        "{} ({} to {})",
        two(estimate.value),
        two(estimate.low),
        two(estimate.high)
    )
}

/// A number with two digits after the point, and a true minus.
fn two(value: f64) -> String {
    format!("{:.2}", if value.abs() < 5e-3 { 0.0 } else { value }).replace('-', "−")
}

/// The table with every number in full.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn csv(data: &StatisticsData) -> Result<Vec<u8>, csv::Error> {
    let names = ["iqm", "median", "mean", "optimality_gap", "base_above"];
    let ends = names
        .iter()
        .flat_map(|name| ["", "_low", "_high"].map(|end| format!("{name}{end}")));
    let others = ["area", "half_of_budget", "environments", "runs"].map(str::to_owned);
    let headers: Vec<String> = data
        .keys
        .iter()
        .map(Key::to_string)
        .chain(ends)
        .chain(others)
        .collect();
    let row = |method: &Method| {
        let of = &method.aggregates;
        let all = [
            Some(of.iqm),
            Some(of.median),
            Some(of.mean),
            Some(of.optimality_gap),
            method.below_base,
        ];
        let ends = all.iter().flat_map(|estimate| {
            let end = |end: fn(&Estimate) -> f64| number(estimate.as_ref().map(end));
            [end(|it| it.value), end(|it| it.low), end(|it| it.high)]
        });
        let counts = [method.environments.to_string(), method.scores.to_string()];
        let keys = method.label.values.iter().map(value);
        keys.chain(ends)
            .chain([number(method.area), number(Some(method.half))])
            .chain(counts)
            .collect()
    };
    written(
        &headers.iter().map(String::as_str).collect::<Vec<_>>(),
        data.methods.iter().map(row),
    )
}
