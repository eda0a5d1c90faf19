//! Tables as text: Markdown, LaTeX, CSV and the terminal.
//!
//! Owns the layout of a table's cells. Knows nothing of where the numbers come from. Start at
//! [`markdown`]; [`Grid`] is what all formats but CSV show.

pub mod claims;
pub mod compare;
mod csv;
mod digits;
pub mod settings;
pub mod statistics;
mod terminal;
mod tex;

pub use csv::{csv, curves_csv, number, seeds_csv, value, written};
pub use terminal::terminal;

use super::{
    amount, axis, cell::Cell, reference::PaperValue, table::TableData, verdict::Comparison,
};
use crate::{escape, spec::Key};
pub use digits::alone;
use digits::{between, plus_minus};

/// The most digits after the point of our own numbers.
const OUR_DECIMALS: usize = 4;
/// The digits after the point that the paper prints.
const PAPER_DECIMALS: usize = 2;

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

/// The table as Markdown, aligned so that it is readable as plain text.
pub fn markdown(data: &TableData) -> String {
    let mut text = format!("# {}\n\n", escape::markdown(&data.title));
    if data.columns.len() > 1 {
        text.push_str(&markdown_grid(&matrix(data)));
        text.push('\n');
    }
    text.push_str(&markdown_grid(&list(data, true)));
    text.push('\n');
    for note in &data.notes {
        text.push_str(&format!("- {}\n", escape::markdown(note)));
    }
    text
}

/// The table for LaTeX: bare, and as a float called `name`. Where it is compared with the paper,
/// environments are called as there.
pub fn latex(name: &str, data: &TableData) -> [String; 2] {
    let mut grid = compact(data);
    if let Some(column) = data
        .row_keys
        .iter()
        .position(|key| *key == Key::Env)
        .filter(|_| compares(data))
    {
        grid.rows
            .iter_mut()
            .for_each(|row| row[column] = axis::paper_name(&row[column]).to_owned());
    }
    let notes: Vec<String> = seeds(data)
        .into_iter()
        .chain(data.notes.iter().cloned())
        .collect();
    [
        tex::tabular(&grid),
        tex::float(name, &data.title, &notes, &grid),
    ]
}

/// The table as two grids: rows by columns, where there are several columns; and one row per cell.
pub fn grids(data: &TableData) -> (Option<Grid>, Grid) {
    (
        (data.columns.len() > 1).then(|| matrix(data)),
        list(data, true),
    )
}

/// The number of seeds per cell, as `n = 5 seeds a cell.`
fn seeds(data: &TableData) -> Option<String> {
    let seeds = || {
        data.rows
            .iter()
            .flat_map(|row| row.cells.iter().flatten())
            .map(|cell| cell.seeds)
    };
    match (seeds().min()?, seeds().max()?) {
        (fewest, most) if fewest < most => Some(format!("n = {fewest} to {most} seeds a cell.")),
        (_, most) => Some(format!("n = {} a cell.", amount::count(most, "seed"))),
    }
}

/// Whether any value of the paper stands in the table.
fn compares(data: &TableData) -> bool {
    data.rows.iter().any(|row| {
        row.cells.iter().flatten().any(|cell| cell.paper.is_some()) || row.paper_demo.is_some()
    })
}

/// The single grid for LaTeX and the terminal: the matrix where there are several columns,
/// otherwise the list.
fn compact(data: &TableData) -> Grid {
    if data.columns.len() > 1 {
        matrix(data)
    } else {
        list(data, false)
    }
}

/// The headers above the names of the rows.
fn row_headers(data: &TableData) -> Vec<String> {
    data.row_keys.iter().map(axis::key_label).collect()
}

/// The grid of rows by columns, with the paper's values below each row of ours.
fn matrix(data: &TableData) -> Grid {
    let mut headers = row_headers(data);
    let compares = compares(data);
    let has_demo = data
        .rows
        .iter()
        .any(|row| row.demo.or(row.paper_demo).is_some());
    if compares {
        headers.push(String::new());
    }
    let names = headers.len();
    if has_demo {
        headers.push("Demo".to_owned());
    }
    headers.extend(data.columns.iter().map(|column| column.text.clone()));
    let demo = |value: Option<f64>| has_demo.then(|| value.map_or(String::new(), alone));
    let mut rows = Vec::new();
    for row in &data.rows {
        let mut ours = row.labels.clone();
        if compares {
            ours.push("ours".to_owned());
        }
        ours.extend(demo(row.demo));
        ours.extend(row.cells.iter().map(|cell| match cell {
            None => String::new(),
            Some(cell) if cell.seeds < cell.planned => {
                format!("{} ({})", our_value(cell), of(cell))
            }
            Some(cell) => our_value(cell),
        }));
        rows.push(ours);
        if compares {
            let mut paper = vec![String::new(); row.labels.len()];
            paper.push("paper".to_owned());
            paper.extend(demo(row.paper_demo));
            paper.extend(row.cells.iter().map(|cell| paper_value(cell.as_ref())));
            rows.push(paper);
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

/// The grid of one row per cell, with each seed's value where `each_seed` asks for it.
fn list(data: &TableData, each_seed: bool) -> Grid {
    let several = data.columns.len() > 1;
    let has = |what: fn(&Cell) -> bool| {
        data.rows
            .iter()
            .any(|row| row.cells.iter().flatten().any(what))
    };
    let (compares, differs) = (
        has(|cell| cell.paper.is_some()),
        has(|cell| cell.comparison.is_some()),
    );
    // With as many seeds as the paper has, the expected best is simply the best one.
    let expects = has(|cell| cell.seeds > PaperValue::SEEDS && cell.comparison.is_some());
    let mut headers = row_headers(data);
    if several {
        headers.extend(data.column_keys.first().map(axis::key_label));
    }
    let names = headers.len();
    let asked = [
        ("ours", true),
        ("seeds", true),
        ("each seed", each_seed),
        ("best seed", true),
        ("expected best", expects),
        ("paper", compares),
        ("difference", differs),
        ("verdict", compares),
    ];
    headers.extend(
        asked
            .into_iter()
            .filter(|(_, shown)| *shown)
            .map(|(header, _)| header.to_owned()),
    );
    let mut rows = Vec::new();
    for row in &data.rows {
        for (column, cell) in data.columns.iter().zip(&row.cells) {
            let Some(cell) = cell else { continue };
            let mut line = row.labels.clone();
            if several {
                line.push(column.text.clone());
            }
            line.extend([our_value(cell), of(cell)]);
            if each_seed {
                line.push(
                    cell.values
                        .iter()
                        .map(|(_, value)| alone(*value))
                        .collect::<Vec<_>>()
                        .join(", "),
                );
            }
            line.push(cell.best.map_or(String::new(), |best| {
                plus_minus(best.mean, best.std, OUR_DECIMALS)
            }));
            if expects {
                let expected = cell
                    .comparison
                    .as_ref()
                    .and_then(|comparison| comparison.expected_best);
                line.push(expected.map_or(String::new(), alone));
            }
            if compares {
                line.push(paper_value(Some(cell)));
                if differs {
                    let interval = cell.comparison.as_ref().map(Comparison::interval);
                    line.push(interval.map_or(String::new(), |(low, high)| between(low, high)));
                }
                line.push(
                    cell.verdict
                        .as_ref()
                        .map_or(String::new(), |verdict| verdict.text()),
                );
            }
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

fn our_value(cell: &Cell) -> String {
    match cell.ours {
        None => "–".to_owned(),
        Some(ours) if cell.seeds < 2 => alone(ours.mean),
        Some(ours) => plus_minus(ours.mean, (ours.high - ours.low) / 2.0, OUR_DECIMALS),
    }
}

fn paper_value(cell: Option<&Cell>) -> String {
    let paper = cell.and_then(|cell| cell.paper);
    paper.map_or(String::new(), |paper| {
        plus_minus(paper.mean, paper.std, PAPER_DECIMALS)
    })
}

/// The seeds of a cell, as `4 of 5 seeds`, or `5 seeds` where none is missing.
fn of(cell: &Cell) -> String {
    if cell.seeds < cell.planned {
        format!("{} of {}", cell.seeds, amount::count(cell.planned, "seed"))
    } else {
        amount::count(cell.seeds, "seed")
    }
}

fn markdown_grid(grid: &Grid) -> String {
    let escaped = |cell: &String| escape::markdown(cell);
    let lines: Vec<Vec<String>> = [&grid.headers]
        .into_iter()
        .chain(&grid.rows)
        .map(|row| row.iter().map(escaped).collect())
        .collect();
    let width = |column: usize| {
        lines
            .iter()
            .map(|line| line[column].chars().count())
            .max()
            .unwrap_or(0)
            .max(3)
    };
    let widths: Vec<usize> = (0..grid.headers.len()).map(width).collect();
    let mut text = String::new();
    for (index, line) in lines.iter().enumerate() {
        for (column, (cell, &width)) in line.iter().zip(&widths).enumerate() {
            let padded = if grid.numeric[column] {
                format!("{cell:>width$}")
            } else {
                format!("{cell:<width$}")
            };
            text.push_str(&format!("| {padded} "));
        }
        text.push_str("|\n");
        if index == 0 {
            for (column, width) in widths.iter().enumerate() {
                let rule = "-".repeat(width - 1);
                text.push_str(&if grid.numeric[column] {
                    format!("| {rule}: ")
                } else {
                    format!("| :{rule} ")
                });
            }
            text.push_str("|\n");
        }
    }
    text
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{
        report::{fixture, recorded::Run},
        spec::Table,
    };

    /// A table of `runs`.
    pub fn made_up(rows: &[&str], columns: &str, reference: &str, runs: &[Run]) -> TableData {
        let table = Table {
            name: "t".into(),
            title: "50 % & more".into(),
            rows: rows.iter().map(|row| (*row).into()).collect(),
            columns: columns.into(),
            only: None,
            reference: Some(reference.into()),
        };
        let mut data = TableData::of_report(&[(&table, runs.iter().collect())]).remove(0);
        data.notes.truncate(1);
        data
    }

    fn comparison() -> TableData {
        let mcpo = |seed| fixture::mcpo("Hopper-v2", 1e-4, 1e-3, seed);
        made_up(
            &["env"],
            "algorithm",
            "table3",
            &[
                fixture::ppo("Hopper-v2", 0).finished(&[(100, &[-10.0, 20.0])]),
                fixture::ppo("Hopper-v2", 1).failed("training diverged"),
                mcpo(0)
                    .finished(&[(100, &[1800.0, 1802.0])])
                    .demonstrated(Some("a"), Some(974.42)),
                mcpo(1)
                    .finished(&[(100, &[1803.0, 1803.0])])
                    .demonstrated(Some("a"), Some(974.42)),
                fixture::ppo("Ant-v2", 0),
            ],
        )
    }

    fn ablation() -> TableData {
        made_up(
            &["d", "epsilon"],
            "algorithm",
            "table5",
            &[
                fixture::mcpo("HalfCheetah-v2", 1.0, 0.0, 0).finished(&[(100, &[-600.25])]),
                fixture::mcpo("HalfCheetah-v2", 1e-3, 2e-3, 0).finished(&[(100, &[120.5])]),
            ],
        )
    }

    #[test]
    fn markdown_has_the_matrix_and_every_cell() {
        let expected = "\
# 50 % &amp; more

| environment |       |   Demo |              PPO |       MCPO |
| :---------- | :---- | -----: | ---------------: | ---------: |
| Hopper-v2   | ours  | 974.42 | 5 (1 of 2 seeds) |  1802 ± 13 |
|             | paper | 969.71 |          17 ± 14 | 1898 ± 904 |
| Ant-v2      | ours  |        |  – (0 of 1 seed) |            |
|             | paper |   1942 |     −2333 ± 2194 |            |

| environment | algorithm |      ours |        seeds |  each seed | best seed |        paper | verdict                               |
| :---------- | :-------- | --------: | -----------: | ---------: | --------: | -----------: | :------------------------------------ |
| Hopper-v2   | PPO       |         5 | 1 of 2 seeds |          5 |    5 ± 21 |      17 ± 14 | not comparable: 1 seed; 3 are needed  |
| Hopper-v2   | MCPO      | 1802 ± 13 |      2 seeds | 1801, 1803 |  1803 ± 0 |   1898 ± 904 | not comparable: 2 seeds; 3 are needed |
| Ant-v2      | PPO       |         – |  0 of 1 seed |            |           | −2333 ± 2194 | not comparable: no finished run       |

- 3 of 5 runs finished.
";
        assert_eq!(markdown(&comparison()), expected);
    }

    #[test]
    fn a_single_column_is_shown_as_a_list() {
        let expected = "\
# 50 % &amp; more

| d    | ε      |    ours |  seeds | each seed | best seed |      paper | verdict                              |
| :--- | :----- | ------: | -----: | --------: | --------: | ---------: | :----------------------------------- |
| 1    | 0      | −600.25 | 1 seed |   −600.25 |   −600.25 | −587 ± 987 | not comparable: 1 seed; 3 are needed |
| 10⁻³ | 2·10⁻³ |   120.5 | 1 seed |     120.5 |     120.5 | 2943 ± 100 | not comparable: 1 seed; 3 are needed |

- 2 of 2 runs finished.
";
        assert_eq!(markdown(&ablation()), expected);
    }

    #[test]
    fn latex_has_the_papers_names_its_label_and_n() {
        let [bare, float] = latex("table-5", &ablation());
        assert!(
            bare.contains(
                "\\begin{tabular}{llrrrr@{}ll}\n\\toprule\nd & $\\epsilon$ & ours & seeds"
            ),
            "{bare}"
        );
        assert!(
            bare.contains("10$^{-3}$ & 2$\\cdot$10$^{-3}$ & 120.5 & 1 seed"),
            "{bare}"
        );
        assert!(bare.contains("$-$587 & ${}\\pm{}$987"), "{bare}");
        assert!(
            float.contains("\\caption{50 \\% \\& more}\n\\label{tab:table-5}"),
            "{float}"
        );
        assert!(float.contains("n = 1 seed a cell."), "{float}");
        let pendulum = fixture::ppo("InvertedPendulum-v2", 0).finished(&[(100, &[1.0])]);
        let [bare, _] = latex("t", &made_up(&["env"], "algorithm", "table3", &[pendulum]));
        assert!(
            bare.contains("\nPendulum-v2 & ") && !bare.contains("Inverted"),
            "{bare}"
        );
        let [bare, _] = latex("t", &comparison());
        assert!(
            bare.contains("Hopper-v2 & ours & 974.42 & 5 & ~(1 of 2 seeds)"),
            "{bare}"
        );
        assert!(
            bare.contains(" & paper & 969.71 & 17 & ${}\\pm{}$14"),
            "{bare}"
        );
    }

    #[test]
    fn csv_has_one_row_a_cell_and_every_number_in_full() {
        let bytes = csv(&comparison()).expect("written");
        let text = String::from_utf8(bytes).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(
            lines[0].starts_with("env,algorithm,mean,low,high,seeds,planned_seeds,"),
            "{text}"
        );
        assert!(
            lines[1].starts_with("Hopper-v2,ppo,5,,,1,2,0,5,21.213203435596427,2,17.09,13.54,"),
            "{text}"
        );
        assert!(
            lines[2].starts_with("Hopper-v2,mcpo,1802,1789.29"),
            "{text}"
        );
        assert!(lines[2].ends_with(",100,974.42,969.71"), "{text}");
        assert!(lines[3].ends_with(
            "ppo,,,,0,1,,,,,-2332.95,2193.85,,,,,,not comparable: no finished run,100,,1942.05"
        ));
    }
}
