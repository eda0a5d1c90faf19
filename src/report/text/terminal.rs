//! Tables on a terminal, folded into blocks where they are too wide for it.

use comfy_table::{Cell, CellAlignment, ContentArrangement, LineStyle, Table, presets};

use super::{Grid, compact};
use crate::{escape, report::TableData};

/// The table for a terminal of `width` columns.
pub fn terminal(data: &TableData, width: Option<usize>) -> String {
    folded(&data.title, &compact(data), &data.notes, width)
}

/// `grid` for a terminal of `width` columns (`None`: of any width). Where it does not fit, it is
/// split into blocks of as many columns as do, and each block repeats the columns that name a row.
pub(super) fn folded(title: &str, grid: &Grid, notes: &[String], width: Option<usize>) -> String {
    let blocks = blocks(grid, width.unwrap_or(usize::MAX));
    let tables: Vec<String> = blocks.iter().map(|columns| table(grid, columns)).collect();
    let notes: Vec<String> = notes
        .iter()
        .map(|note| format!("  {}\n", escape::plain(note)))
        .collect();
    format!(
        "{}\n{}\n{}",
        escape::plain(title),
        tables.join("\n"),
        notes.concat()
    )
}

/// The columns in each block of at most `width`. A column that alone is wider gets a block of its
/// own.
fn blocks(grid: &Grid, width: usize) -> Vec<Vec<usize>> {
    let names: Vec<usize> = (0..grid.names).collect();
    let mut blocks: Vec<Vec<usize>> = vec![names.clone()];
    for column in grid.names..grid.headers.len() {
        let wider: Vec<usize> = blocks
            .last()
            .into_iter()
            .flatten()
            .copied()
            .chain([column])
            .collect();
        let fits = wider.len() == names.len() + 1
            || table(grid, &wider).lines().map(columns_of).max() <= Some(width);
        match blocks.last_mut() {
            Some(last) if fits => *last = wider,
            _ => blocks.push(names.iter().copied().chain([column]).collect()),
        }
    }
    blocks
}

/// The width of a line on a terminal: every character of our tables takes one column.
fn columns_of(line: &str) -> usize {
    line.chars().count()
}

/// The table of these columns of the grid.
fn table(grid: &Grid, columns: &[usize]) -> String {
    let mut table = Table::new();
    let lines_around_and_below_the_head =
        presets::UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none());
    table
        .load_style(lines_around_and_below_the_head)
        .set_content_arrangement(ContentArrangement::Disabled);
    let cells = |row: &[String]| -> Vec<Cell> {
        let cell = |&column: &usize| {
            let alignment = if grid.numeric[column] {
                CellAlignment::Right
            } else {
                CellAlignment::Left
            };
            Cell::new(escape::plain(&row[column])).set_alignment(alignment)
        };
        columns.iter().map(cell).collect()
    };
    table.set_header(cells(&grid.headers));
    for row in &grid.rows {
        table.add_row(cells(row));
    }
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{fixture, recorded::Run, text::tests::made_up};

    fn wide() -> TableData {
        let run = |k: u32| {
            fixture::mcpo("Hopper-v2", f64::from(k), 0.0, 0)
                .finished(&[(100, &[f64::from(1000 + k)])])
        };
        let runs: Vec<Run> = (1..=12).map(run).collect();
        made_up(&["env"], "algorithm", "table3", &runs)
    }

    #[test]
    fn a_table_wider_than_the_terminal_is_folded_into_blocks() {
        let whole = terminal(&wide(), None);
        for width in [40, 60, 90] {
            let folded = terminal(&wide(), Some(width));
            let blocks = folded
                .lines()
                .filter(|line| line.contains("environment"))
                .count();
            assert!(blocks > 1, "{folded}");
            let rows: Vec<&str> = folded
                .lines()
                .filter(|line| line.contains("ours"))
                .collect();
            assert_eq!(rows.len(), blocks);
            assert!(
                rows.iter().all(|row| row.contains("Hopper-v2")),
                "each block says what its rows are: {folded}"
            );
            for k in 1..=12 {
                let (number, name) = (format!("{}", 1000 + k), format!("d = {k} "));
                assert_eq!(
                    folded.matches(&number).count(),
                    whole.matches(&number).count(),
                    "{folded}"
                );
                assert!(folded.contains(&name), "{folded}");
            }
            let tables = folded
                .lines()
                .filter(|line| line.contains("ours") || line.contains("environment"));
            assert!(
                tables.map(columns_of).all(|columns| columns <= width),
                "{folded}"
            );
        }
        assert_eq!(
            whole
                .lines()
                .filter(|line| line.contains("environment"))
                .count(),
            1
        );
    }

    #[test]
    fn the_terminal_shows_the_same_grid() {
        let runs = [
            fixture::ppo("Hopper-v2", 0).finished(&[(100, &[5.0])]),
            fixture::ppo("Hopper-v2", 1).failed("\x1b[2J"),
        ];
        let text = terminal(&made_up(&["env"], "algorithm", "table3", &runs), None);
        assert!(
            text.contains("1 of 2 seeds")
                && text.contains("17 ± 14")
                && text.contains("1 of 2 runs finished."),
            "{text}"
        );
        assert!(!text.contains('\x1b'), "{text}");
    }
}
