//! A table's cells in a grid of texts: rows by columns, or one row per cell.

use super::{
    super::{
        axis,
        cell::{Cell, Row},
        reference::PaperValue,
        table::TableData,
    },
    cell,
    digits::alone,
};

/// A table of texts.
pub struct Grid {
    /// The headers of the columns.
    pub headers: Vec<String>,
    /// The rows, each with one cell per header.
    pub rows: Vec<Vec<String>>,
    /// The number of leading columns that name a row.
    pub names: usize,
    /// Whether each column holds numbers, which are aligned right.
    pub numeric: Vec<bool>,
}

/// The single grid for LaTeX and the terminal: the matrix where there are several columns,
/// otherwise the list.
pub fn compact(data: &TableData) -> Grid {
    if data.columns.len() > 1 {
        matrix(data)
    } else {
        list(data, false)
    }
}

/// Whether any value of the paper stands in the table.
pub fn compares(data: &TableData) -> bool {
    data.rows.iter().any(|row| {
        row.cells.iter().flatten().any(|cell| cell.paper.is_some()) || row.paper_demo.is_some()
    })
}

/// The headers above the names of the rows.
fn row_headers(data: &TableData) -> Vec<String> {
    data.row_keys.iter().map(axis::key_label).collect()
}

/// The grid of rows by columns, with the paper's values below each row of ours.
pub fn matrix(data: &TableData) -> Grid {
    let mut headers = row_headers(data);
    let compares = compares(data);
    if compares {
        headers.push(String::new());
    }
    let names = headers.len();
    let has_demo = data
        .rows
        .iter()
        .any(|row| row.demo.or(row.paper_demo).is_some());
    if has_demo {
        headers.push("Demo".to_owned());
    }
    headers.extend(data.columns.iter().map(|column| column.text.clone()));
    let line = |mut labels: Vec<String>, whose: &str, demo: Option<f64>, cells: Vec<String>| {
        if compares {
            labels.push(whose.to_owned());
        }
        if has_demo {
            labels.push(demo.map_or(String::new(), alone));
        }
        labels.extend(cells);
        labels
    };
    let mut rows = Vec::new();
    for row in &data.rows {
        let ours = texts(row, ours_with_missing_seeds);
        rows.push(line(row.labels.clone(), "ours", row.demo, ours));
        if compares {
            // The labels stand in the row above.
            let empty = vec![String::new(); row.labels.len()];
            let paper = texts(row, cell::paper);
            rows.push(line(empty, "paper", row.paper_demo, paper));
        }
    }
    let numeric = (0..headers.len()).map(|column| column >= names).collect();
    Grid {
        headers,
        rows,
        names,
        numeric,
    }
}

/// The text of each cell of a row; empty where there is no cell.
fn texts(row: &Row, text: fn(&Cell) -> String) -> Vec<String> {
    row.cells
        .iter()
        .map(|cell| cell.as_ref().map_or(String::new(), text))
        .collect()
}

/// Our value, and the number of seeds unless all have finished.
fn ours_with_missing_seeds(cell: &Cell) -> String {
    let ours = cell::ours(cell);
    if cell.seeds < cell.planned {
        format!("{ours} ({})", cell::seeds(cell))
    } else {
        ours
    }
}

/// The grid of one row per cell, with each seed's value where `each_seed` asks for it.
pub fn list(data: &TableData, each_seed: bool) -> Grid {
    let several = data.columns.len() > 1;
    let mut headers = row_headers(data);
    if several {
        headers.extend(data.column_keys.first().map(axis::key_label));
    }
    let names = headers.len();
    let shown = list_columns(data, each_seed);
    headers.extend(shown.iter().map(|(header, _)| (*header).to_owned()));
    let mut rows = Vec::new();
    for row in &data.rows {
        for (column, cell) in data.columns.iter().zip(&row.cells) {
            let Some(cell) = cell else { continue };
            let mut line = row.labels.clone();
            if several {
                line.push(column.text.clone());
            }
            line.extend(shown.iter().map(|(_, text)| text(cell)));
            rows.push(line);
        }
    }
    let numeric = headers
        .iter()
        .enumerate()
        .map(|(column, header)| column >= names && header != "verdict")
        .collect();
    Grid {
        headers,
        rows,
        names,
        numeric,
    }
}

/// A column of numbers: its header, and its text for a cell.
type Column = (&'static str, fn(&Cell) -> String);

/// The columns of a list behind the names, without those that would be empty.
fn list_columns(data: &TableData, each_seed: bool) -> Vec<Column> {
    let has = |what: fn(&Cell) -> bool| {
        data.rows
            .iter()
            .any(|row| row.cells.iter().flatten().any(what))
    };
    let compares = has(|cell| cell.paper.is_some());
    let differs = has(|cell| cell.comparison.is_some());
    // With as many seeds as the paper has, the expected best is simply the best one.
    let expects = has(|cell| cell.seeds > PaperValue::SEEDS && cell.comparison.is_some());
    let columns: [(bool, Column); 8] = [
        (true, ("ours", cell::ours)),
        (true, ("seeds", cell::seeds)),
        (each_seed, ("each seed", cell::each_seed)),
        (true, ("best seed", cell::best)),
        (expects, ("expected best", cell::expected_best)),
        (compares, ("paper", cell::paper)),
        (differs, ("difference", cell::difference)),
        (compares, ("verdict", cell::verdict)),
    ];
    columns
        .into_iter()
        .filter_map(|(shown, column)| shown.then_some(column))
        .collect()
}
