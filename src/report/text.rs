//! Tables as text: Markdown, LaTeX, CSV and the terminal.
//!
//! Owns the layout of a table's cells and the escapes of each format. Knows nothing of where the numbers come from. Start at
//! [`markdown`]; [`Grid`] is what all formats but CSV show.

use comfy_table::{
    Cell as TerminalCell, CellAlignment, ContentArrangement, LineStyle, Table as TerminalTable, presets,
};

use super::{
    curve::CurveData,
    notes,
    table::{Cell, Row, TableData},
};

/// A table of texts.
struct Grid {
    headers: Vec<String>,
    rows: Vec<Vec<String>>,
    /// Whether each column holds numbers, which are aligned right.
    numeric: Vec<bool>,
}

/// The table as Markdown, aligned so that it reads as text too.
pub fn markdown(data: &TableData) -> String {
    let mut text = format!("# {}\n\n", data.title);
    if data.columns.len() > 1 {
        text.push_str(&markdown_grid(&matrix(data)));
        text.push('\n');
    }
    text.push_str(&markdown_grid(&list(data)));
    text.push('\n');
    for note in &data.notes {
        text.push_str(&format!("- {}\n", note.replace('\n', " ")));
    }
    text
}

/// The table for LaTeX with the package booktabs; a `table` environment to `\input`.
pub fn latex(data: &TableData) -> String {
    let grid = compact(data);
    let alignment: String = grid.numeric.iter().map(|numeric| if *numeric { 'r' } else { 'l' }).collect();
    let line = |cells: &[String]| cells.iter().map(|cell| escape(cell)).collect::<Vec<_>>().join(" & ") + " \\\\\n";
    let mut text = String::from("% needs \\usepackage{booktabs}\n\\begin{table}\n\\centering\n");
    text.push_str(&format!("\\caption{{{}}}\n\\begin{{tabular}}{{{alignment}}}\n\\toprule\n", escape(&data.title)));
    text.push_str(&line(&grid.headers));
    text.push_str("\\midrule\n");
    for row in &grid.rows {
        text.push_str(&line(row));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n\n\\footnotesize\n");
    for note in &data.notes {
        text.push_str(&format!("{}\n", escape(&note.replace('\n', " "))));
    }
    text.push_str("\\end{table}\n");
    text
}

/// The table for a terminal of any width.
pub fn terminal(data: &TableData) -> String {
    let grid = compact(data);
    let mut table = TerminalTable::new();
    let lines_around_and_below_the_head = presets::UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none());
    table.load_style(lines_around_and_below_the_head).set_content_arrangement(ContentArrangement::Disabled);
    let cell = |column: usize, text: &String| {
        let alignment = if grid.numeric[column] { CellAlignment::Right } else { CellAlignment::Left };
        TerminalCell::new(text).set_alignment(alignment)
    };
    table.set_header(grid.headers.iter().enumerate().map(|(column, text)| cell(column, text)));
    for row in &grid.rows {
        table.add_row(row.iter().enumerate().map(|(column, text)| cell(column, text)));
    }
    let notes: Vec<String> = data.notes.iter().map(|note| format!("  {note}\n")).collect();
    format!("{}\n{table}\n{}", data.title, notes.concat())
}

/// The table as CSV: one row a cell, every number in full and in a column of its own.
///
/// Errors: none that the csv crate gives for a buffer in memory.
pub fn csv(data: &TableData) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let numbers = [
        "mean",
        "low",
        "high",
        "seeds",
        "planned_seeds",
        "best_seed",
        "best_mean",
        "best_std",
        "best_episodes",
        "paper_mean",
        "paper_std",
        "verdict",
        "env_steps",
        "demo",
        "paper_demo",
    ];
    writer.write_record(data.row_keys.iter().map(String::as_str).chain([data.column_key.as_str()]).chain(numbers))?;
    for row in &data.rows {
        for (column, cell) in data.columns.iter().zip(&row.cells) {
            let Some(cell) = cell else { continue };
            let number = |value: Option<f64>| value.filter(|x| x.is_finite()).map_or(String::new(), |x| x.to_string());
            let whole = |value: Option<u64>| value.map_or(String::new(), |x| x.to_string());
            let mut record: Vec<String> = row.labels.clone();
            record.push(column.clone());
            record.extend([
                number(cell.ours.map(|ours| ours.mean)),
                number(cell.ours.filter(|_| cell.seeds > 1).map(|ours| ours.low)),
                number(cell.ours.filter(|_| cell.seeds > 1).map(|ours| ours.high)),
                cell.seeds.to_string(),
                cell.planned.to_string(),
                whole(cell.best.map(|best| best.seed)),
                number(cell.best.map(|best| best.mean)),
                number(cell.best.map(|best| best.std)),
                whole(cell.best.map(|best| best.episodes as u64)),
                number(cell.paper.map(|paper| paper.mean)),
                number(cell.paper.map(|paper| paper.std)),
                cell.verdict.as_ref().map_or(String::new(), |verdict| verdict.text()),
                cell.env_steps.to_string(),
                number(row.demo),
                number(row.paper_demo),
            ]);
            writer.write_record(&record)?;
        }
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// The points of a figure as CSV: one row a point.
///
/// Errors: none that the csv crate gives for a buffer in memory.
pub fn curves_csv(data: &CurveData) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["env", "series", "env_steps", "mean", "low", "high", "seeds", "planned_seeds"])?;
    for panel in &data.panels {
        for (series, curve) in data.series.iter().zip(&panel.curves) {
            let Some(curve) = curve else { continue };
            for point in &curve.points {
                let end = |end: Option<f64>| end.map_or(String::new(), |end| end.to_string());
                writer.write_record([
                    &panel.title,
                    series,
                    &point.env_steps.to_string(),
                    &point.mean.to_string(),
                    &end(point.band.map(|band| band.0)),
                    &end(point.band.map(|band| band.1)),
                    &curve.seeds.to_string(),
                    &curve.planned.to_string(),
                ])?;
            }
        }
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// The one grid for LaTeX and the terminal: the matrix where there are several columns, else the list.
fn compact(data: &TableData) -> Grid {
    if data.columns.len() > 1 { matrix(data) } else { list(data) }
}

/// Rows by columns; below each row of ours, the paper's.
fn matrix(data: &TableData) -> Grid {
    let mut headers = data.row_keys.clone();
    let has_paper = |row: &Row| row.cells.iter().flatten().any(|cell| cell.paper.is_some()) || row.paper_demo.is_some();
    let compares = data.rows.iter().any(has_paper);
    let has_demo = data.rows.iter().any(|row| row.demo.or(row.paper_demo).is_some());
    if compares {
        headers.push(String::new());
    }
    let names = headers.len();
    if has_demo {
        headers.push("Demo".to_owned());
    }
    headers.extend(data.columns.iter().cloned());
    let mut rows = Vec::new();
    for row in &data.rows {
        let decimals = decimals(row);
        let mut ours = row.labels.clone();
        if compares {
            ours.push("ours".to_owned());
        }
        if has_demo {
            ours.push(row.demo.map_or(String::new(), |demo| number(demo, decimals)));
        }
        ours.extend(row.cells.iter().map(|cell| match cell {
            None => String::new(),
            Some(cell) if cell.seeds < cell.planned => {
                format!("{} ({})", our_value(cell, decimals), of(cell)).trim_start().to_owned()
            }
            Some(cell) => our_value(cell, decimals),
        }));
        rows.push(ours);
        if compares {
            let mut paper = vec![String::new(); row.labels.len()];
            paper.push("paper".to_owned());
            if has_demo {
                paper.push(row.paper_demo.map_or(String::new(), |demo| number(demo, decimals)));
            }
            paper.extend(row.cells.iter().map(|cell| paper_value(cell.as_ref(), decimals)));
            rows.push(paper);
        }
    }
    let numeric = (0..headers.len()).map(|column| column >= names).collect();
    Grid { headers, rows, numeric }
}

/// One row a cell.
fn list(data: &TableData) -> Grid {
    let several = data.columns.len() > 1;
    let compares = data.rows.iter().any(|row| row.cells.iter().flatten().any(|cell| cell.paper.is_some()));
    let mut headers = data.row_keys.clone();
    if several {
        headers.push(data.column_key.clone());
    }
    let names = headers.len();
    headers.extend(["ours", "seeds", "best seed"].map(str::to_owned));
    if compares {
        headers.extend(["paper", "verdict"].map(str::to_owned));
    }
    let mut rows = Vec::new();
    for row in &data.rows {
        let decimals = decimals(row);
        for (column, cell) in data.columns.iter().zip(&row.cells) {
            let Some(cell) = cell else { continue };
            let mut line = row.labels.clone();
            if several {
                line.push(column.clone());
            }
            line.extend([our_value(cell, decimals), of(cell)]);
            line.push(cell.best.map_or(String::new(), |best| plus_minus(best.mean, best.std, decimals)));
            if compares {
                line.push(paper_value(Some(cell), decimals));
                line.push(cell.verdict.as_ref().map_or(String::new(), |verdict| verdict.text()));
            }
            rows.push(line);
        }
    }
    let numeric = headers.iter().enumerate().map(|(column, header)| column >= names && header != "verdict").collect();
    Grid { headers, rows, numeric }
}

/// Digits after the point that every number of a row is shown with: fewer where the row's numbers are large.
fn decimals(row: &Row) -> usize {
    let numbers = row.cells.iter().flatten().flat_map(|cell| [cell.ours.map(|o| o.mean), cell.paper.map(|p| p.mean)]);
    match numbers.flatten().fold(0.0, |most: f64, x| most.max(x.abs())) {
        1000.0.. => 0,
        100.0.. => 1,
        _ => 2,
    }
}

fn our_value(cell: &Cell, decimals: usize) -> String {
    match cell.ours {
        None => "–".to_owned(),
        Some(ours) if cell.seeds < 2 => number(ours.mean, decimals),
        Some(ours) => plus_minus(ours.mean, (ours.high - ours.low) / 2.0, decimals),
    }
}

fn paper_value(cell: Option<&Cell>, decimals: usize) -> String {
    cell.and_then(|cell| cell.paper).map_or(String::new(), |paper| plus_minus(paper.mean, paper.std, decimals))
}

/// `4 of 5 seeds`, or `5 seeds` where none is lacking.
fn of(cell: &Cell) -> String {
    if cell.seeds < cell.planned {
        format!("{} of {}", cell.seeds, notes::count(cell.planned, "seed"))
    } else {
        notes::count(cell.seeds, "seed")
    }
}

fn plus_minus(mean: f64, spread: f64, decimals: usize) -> String {
    if spread.is_finite() {
        format!("{} ± {}", number(mean, decimals), number(spread, decimals))
    } else {
        number(mean, decimals)
    }
}

/// A number with a true minus, and no minus before zero.
fn number(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().any(|digit| digit.is_ascii_digit() && digit != '0') => format!("−{digits}"),
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

fn markdown_grid(grid: &Grid) -> String {
    let escaped = |cell: &String| cell.replace('|', "\\|").replace('\n', " ");
    let lines: Vec<Vec<String>> =
        [&grid.headers].into_iter().chain(&grid.rows).map(|row| row.iter().map(escaped).collect()).collect();
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0).max(3);
    let widths: Vec<usize> = (0..grid.headers.len()).map(width).collect();
    let mut text = String::new();
    for (index, line) in lines.iter().enumerate() {
        for (column, (cell, &width)) in line.iter().zip(&widths).enumerate() {
            let padded = if grid.numeric[column] { format!("{cell:>width$}") } else { format!("{cell:<width$}") };
            text.push_str(&format!("| {padded} "));
        }
        text.push_str("|\n");
        if index == 0 {
            for (column, width) in widths.iter().enumerate() {
                let rule = "-".repeat(width - 1);
                text.push_str(&if grid.numeric[column] { format!("| {rule}: ") } else { format!("| :{rule} ") });
            }
            text.push_str("|\n");
        }
    }
    text
}

/// `text` for LaTeX: its special characters, and the symbols that the tables use.
fn escape(text: &str) -> String {
    let mut escaped = String::new();
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => escaped.extend(['\\', character]),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '\\' => escaped.push_str("\\textbackslash{}"),
            '<' => escaped.push_str("$<$"),
            '>' => escaped.push_str("$>$"),
            '±' => escaped.push_str("$\\pm$"),
            '−' => escaped.push_str("$-$"),
            '–' => escaped.push_str("--"),
            '·' => escaped.push_str("$\\cdot$"),
            'ε' => escaped.push_str("$\\epsilon$"),
            _ => match lowered(character) {
                None => escaped.push(character),
                Some(first) => {
                    escaped.push_str("$^{");
                    escaped.push(first);
                    while let Some(next) = characters.peek().copied().and_then(lowered) {
                        escaped.push(next);
                        characters.next();
                    }
                    escaped.push_str("}$");
                }
            },
        }
    }
    escaped
}

/// The character that was raised to give `raised`.
fn lowered(raised: char) -> Option<char> {
    "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".chars().zip("-0123456789".chars()).find(|pair| pair.0 == raised).map(|pair| pair.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        report::{fixture, recorded::Run},
        spec::{Figure, Table},
    };

    fn made_up(rows: &[&str], columns: &str, reference: &str, runs: &[Run]) -> TableData {
        let table = Table {
            name: "t".into(),
            title: "50 % & more".into(),
            rows: rows.iter().map(|row| (*row).into()).collect(),
            columns: columns.into(),
            only: None,
            reference: Some(reference.into()),
        };
        let mut data = TableData::new(&table, &runs.iter().collect::<Vec<_>>());
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
                mcpo(0).finished(&[(100, &[1800.0, 1802.0])]).demonstrated(Some("a"), Some(974.42)),
                mcpo(1).finished(&[(100, &[1803.0, 1803.0])]).demonstrated(Some("a"), Some(974.42)),
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
# 50 % & more

| environment |       | Demo |              PPO |       MCPO |
| :---------- | :---- | ---: | ---------------: | ---------: |
| Hopper-v2   | ours  |  974 | 5 (1 of 2 seeds) |  1802 ± 13 |
|             | paper |  970 |          17 ± 14 | 1898 ± 904 |
| Ant-v2      | ours  |      |  – (0 of 1 seed) |            |
|             | paper | 1942 |     −2333 ± 2194 |            |

| environment | algorithm |      ours |        seeds | best seed |        paper | verdict                               |
| :---------- | :-------- | --------: | -----------: | --------: | -----------: | :------------------------------------ |
| Hopper-v2   | PPO       |         5 | 1 of 2 seeds |    5 ± 21 |      17 ± 14 | not comparable: 1 seed; 3 are needed  |
| Hopper-v2   | MCPO      | 1802 ± 13 |      2 seeds |  1803 ± 0 |   1898 ± 904 | not comparable: 2 seeds; 3 are needed |
| Ant-v2      | PPO       |         – |  0 of 1 seed |           | −2333 ± 2194 | not comparable: no finished run       |

- 3 of 5 runs finished.
";
        assert_eq!(markdown(&comparison()), expected);
    }

    #[test]
    fn a_single_column_is_shown_as_a_list() {
        let expected = "\
# 50 % & more

| d    | ε      |   ours |  seeds | best seed |          paper | verdict                              |
| :--- | :----- | -----: | -----: | --------: | -------------: | :----------------------------------- |
| 1    | 0      | −600.2 | 1 seed |    −600.2 | −586.5 ± 987.0 | not comparable: 1 seed; 3 are needed |
| 10⁻³ | 2·10⁻³ |    120 | 1 seed |       120 |     2943 ± 100 | not comparable: 1 seed; 3 are needed |

- 2 of 2 runs finished.
";
        assert_eq!(markdown(&ablation()), expected);
    }

    #[test]
    fn latex_escapes_what_it_must() {
        let text = latex(&ablation());
        assert!(text.contains("\\caption{50 \\% \\& more}"), "{text}");
        assert!(text.contains("\\begin{tabular}{llrrrrl}\n\\toprule\nd & $\\epsilon$ & ours & seeds"), "{text}");
        assert!(text.contains("10$^{-3}$ & 2$\\cdot$10$^{-3}$ & 120 & 1 seed"), "{text}");
        assert!(text.contains("$-$586.5 $\\pm$ 987.0"), "{text}");
        let text = latex(&comparison());
        assert!(text.contains("Hopper-v2 & ours & 974 & 5 (1 of 2 seeds)"), "{text}");
        assert!(text.contains(" & paper & 970 & 17 $\\pm$ 14"), "{text}");
        assert_eq!(escape("a_b\\c^d"), "a\\_b\\textbackslash{}c\\textasciicircum{}d");
    }

    #[test]
    fn csv_has_one_row_a_cell_and_every_number_in_full() {
        let bytes = csv(&comparison()).expect("written");
        let text = String::from_utf8(bytes).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(lines[0].starts_with("environment,algorithm,mean,low,high,seeds,planned_seeds,"), "{text}");
        assert!(lines[1].starts_with("Hopper-v2,PPO,5,,,1,2,0,5,21.213203435596427,2,17.09,13.54,"), "{text}");
        assert!(lines[2].starts_with("Hopper-v2,MCPO,1802,1789.29"), "{text}");
        assert!(lines[2].ends_with(",100,974.42,969.71"), "{text}");
        assert!(lines[3].ends_with("PPO,,,,0,1,,,,,-2332.95,2193.85,not comparable: no finished run,100,,1942.05"));
    }

    #[test]
    fn the_csv_of_curves_has_one_row_a_point() {
        let run = fixture::ppo("Hopper-v2", 0).finished(&[(50, &[1.0, 2.0]), (100, &[4.5])]);
        let (name, title, y) = ("f".into(), "F".into(), "return".into());
        let figure = Figure { name, title, y, series: vec!["algorithm".into()], only: None, log_y: false };
        let data = CurveData::new(&figure, &[&run]).expect("curves");
        let text = String::from_utf8(curves_csv(&data).expect("written")).expect("text");
        let expected = "env,series,env_steps,mean,low,high,seeds,planned_seeds\n\
                        Hopper-v2,PPO,50,1.5,,,1,1\nHopper-v2,PPO,100,4.5,,,1,1\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn the_terminal_shows_the_same_grid() {
        let text = terminal(&comparison());
        for expected in ["1802 ± 13", "5 (1 of 2 seeds)", "−2333 ± 2194", "3 of 5 runs finished."] {
            assert!(text.contains(expected), "{text}");
        }
    }

    #[test]
    fn zero_has_no_sign() {
        assert_eq!([number(-0.001, 2), number(-0.01, 2), number(12.345, 1)], ["0.00", "−0.01", "12.3"]);
    }
}
