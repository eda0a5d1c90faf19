//! Tables as text: Markdown, LaTeX, CSV and the terminal.
//!
//! Owns the layout of a table's cells. Knows nothing of where the numbers come from. Start at
//! [`markdown`]; all formats but CSV show a [`Grid`].

mod cell;
pub mod claims;
pub mod compare;
mod csv;
mod digits;
mod grid;
mod lines;
pub mod settings;
pub mod statistics;
mod terminal;
mod tex;

pub use csv::{csv, curves_csv, number, seeds_csv, value, written};
pub use terminal::terminal;

use super::{amount, axis, table::TableData};
use crate::{escape, spec::Key};
pub use digits::alone;
pub use grid::Grid;
use grid::{compact, compares, list, matrix};
use lines::markdown_grid;

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
