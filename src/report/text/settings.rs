//! A table of settings as Markdown, LaTeX and CSV.

use super::{Grid, markdown_grid, tex};
use crate::{escape, report::settings::SettingsData};

/// The table as Markdown.
pub fn markdown(data: &SettingsData) -> String {
    let notes: String = data
        .notes
        .iter()
        .map(|note| format!("\n- {}", escape::markdown(note)))
        .collect();
    format!(
        "# {}\n\n{}{notes}\n",
        escape::markdown(&data.title),
        markdown_grid(&grid(data))
    )
}

/// The table for LaTeX: bare, and as a float.
pub fn latex(name: &str, data: &SettingsData) -> [String; 2] {
    let grid = grid(data);
    [
        tex::tabular(&grid),
        tex::float(name, &data.title, &data.notes, &grid),
    ]
}

/// The table as CSV, with the same cells as the grid.
///
/// # Errors
///
/// None that the csv crate gives for a buffer in memory.
pub fn csv(data: &SettingsData) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in [&data.headers].into_iter().chain(&data.rows) {
        writer.write_record(line.iter().map(|cell| escape::csv(cell)))?;
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}

/// The table as a grid.
pub fn grid(data: &SettingsData) -> Grid {
    let (headers, rows) = (data.headers.clone(), data.rows.clone());
    let numeric = (0..headers.len())
        .map(|column| column >= data.names)
        .collect();
    Grid {
        headers,
        rows,
        names: data.names,
        numeric,
    }
}
