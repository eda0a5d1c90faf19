//! The lines of a grid in Markdown.

use super::Grid;
use crate::escape;

/// `grid` as Markdown, with every column as wide as its widest cell.
pub fn markdown_grid(grid: &Grid) -> String {
    let escaped = |cell: &String| escape::markdown(cell);
    let lines: Vec<Vec<String>> = [&grid.headers]
        .into_iter()
        .chain(&grid.rows)
        .map(|row| row.iter().map(escaped).collect())
        .collect();
    let widths: Vec<usize> = (0..grid.headers.len())
        .map(|column| width(&lines, column))
        .collect();
    let rule: String = widths
        .iter()
        .zip(&grid.numeric)
        .map(|(width, numeric)| {
            let rule = "-".repeat(width - 1);
            if *numeric {
                format!("| {rule}: ")
            } else {
                format!("| :{rule} ")
            }
        })
        .chain(["|\n".to_owned()])
        .collect();
    let mut text = String::new();
    for (index, line) in lines.iter().enumerate() {
        for (column, (cell, &width)) in line.iter().zip(&widths).enumerate() {
            text.push_str(&if grid.numeric[column] {
                format!("| {cell:>width$} ")
            } else {
                format!("| {cell:<width$} ")
            });
        }
        text.push_str("|\n");
        if index == 0 {
            text.push_str(&rule);
        }
    }
    text
}

/// The width of a column, characters: at least 3, which the rule below its header needs.
fn width(lines: &[Vec<String>], column: usize) -> usize {
    lines
        .iter()
        .map(|line| line[column].chars().count())
        .max()
        .unwrap_or(0)
        .max(3)
}
