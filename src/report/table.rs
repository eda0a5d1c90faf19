//! Tables as numbers, before anything is written.
//!
//! Owns which runs share a row, a column and a cell; what a cell says of them is [`Cell`]'s. Knows
//! nothing of Markdown or LaTeX. Start at [`TableData::of_report`].
//!
//! The paper's value stands only beside runs with the paper's setting: `paper_value` says which
//! those are. The module `verdict` compares the two, unless there are fewer than three finished
//! seeds, or fewer steps than [`reference::assumed_budget`].

use std::collections::HashMap;

use super::{
    axis::{self, Label},
    cell::{Cell, Row},
    notes,
    recorded::{Run, demonstrated_return},
    reference, verdict,
};
use crate::spec::{Key, Table};

/// One table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableData {
    /// The title above the table.
    pub title: String,
    /// The keys that distinguish rows, as the file names them.
    pub row_keys: Vec<Key>,
    /// The keys that distinguish columns: first those that were asked for, then whatever else
    /// varies.
    pub column_keys: Vec<Key>,
    /// One label per column.
    pub columns: Vec<Label>,
    /// The rows, in the plan's order.
    pub rows: Vec<Row>,
    /// Budget, seeds, readings and failures, a sentence each.
    pub notes: Vec<String>,
}

impl TableData {
    /// All tables of a report, each with the runs that its `only` selects, in the plan's order.
    /// Their verdicts are corrected for the number of all cells.
    pub fn of_report(tables: &[(&Table, Vec<&Run>)]) -> Vec<Self> {
        let mut made: Vec<Self> = tables
            .iter()
            .map(|(table, runs)| Self::without_verdicts(table, runs))
            .collect();
        let cells = made
            .iter_mut()
            .flat_map(|table| &mut table.rows)
            .flat_map(|row| row.cells.iter_mut().flatten());
        let (mut compared, verdicts): (Vec<_>, Vec<_>) = cells
            .filter_map(|cell| Some((cell.comparison.as_mut()?, &mut cell.verdict)))
            .unzip();
        for (place, verdict) in verdicts.into_iter().zip(verdict::settle(&mut compared)) {
            *place = Some(verdict);
        }
        made
    }

    fn without_verdicts(table: &Table, runs: &[&Run]) -> Self {
        let mut column_keys = vec![table.columns.clone()];
        let known: Vec<Key> = table.rows.iter().chain(&column_keys).cloned().collect();
        // Runs that differ in another axis must not share a cell: an environment becomes a key of
        // rows, any other axis a key of columns.
        let (env, others): (Vec<_>, Vec<_>) = axis::hidden_axes(runs, &known)
            .into_iter()
            .partition(|key| *key == Key::Env);
        let row_keys: Vec<Key> = env.into_iter().chain(table.rows.iter().cloned()).collect();
        column_keys.extend(others);

        let columns = axis::group(runs, &column_keys);
        let numbered = columns.iter().enumerate();
        let column_of: HashMap<&str, usize> = numbered
            .flat_map(|(index, column)| {
                column
                    .runs
                    .iter()
                    .map(move |run| (run.spec.id.as_str(), index))
            })
            .collect();
        let groups = axis::group(runs, &row_keys);
        let labels = axis::value_labels(&groups);
        // A row that spans environments has no single demonstration.
        let one_env = row_keys.contains(&Key::Env);
        let rows = groups.iter().zip(labels).map(|(row, labels)| {
            let mut cells: Vec<Vec<&Run>> = vec![Vec::new(); columns.len()];
            for run in &row.runs {
                cells[column_of[run.spec.id.as_str()]].push(run);
            }
            let paper = reference::returns(row.runs[0].spec.env.name())
                .filter(|_| one_env && table.reference.is_some());
            Row {
                labels: labels.into_iter().map(Option::unwrap_or_default).collect(),
                values: row.values.clone(),
                demo: demonstrated_return(&row.runs).filter(|_| one_env),
                paper_demo: paper.map(|row| row.demo),
                cells: cells
                    .iter()
                    .map(|runs| (!runs.is_empty()).then(|| Cell::new(table.reference, runs)))
                    .collect(),
            }
        });
        let rows: Vec<Row> = rows.collect();
        Self {
            title: table.title.clone(),
            columns: axis::labels(&column_keys, &columns),
            notes: notes::of_table(runs, &rows),
            row_keys,
            column_keys,
            rows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        report::{cell::Best, fixture, verdict::Verdict},
        spec::Reference,
    };

    fn comparison() -> Table {
        Table {
            name: "t".into(),
            title: "T".into(),
            rows: vec!["env".into()],
            columns: "algorithm".into(),
            only: None,
            reference: Some(Reference::Table3),
        }
    }

    fn table(table: &Table, runs: &[Run]) -> TableData {
        TableData::of_report(&[(table, runs.iter().collect())]).remove(0)
    }

    fn only_cell(data: &TableData) -> &Cell {
        data.rows[0].cells[0].as_ref().expect("a cell")
    }

    #[test]
    fn a_failed_run_is_counted_and_named() {
        let runs = [
            fixture::ppo("Hopper-v2", 0).finished(&[(100, &[10.0, 20.0])]),
            fixture::ppo("Hopper-v2", 1).failed("training diverged"),
        ];
        let data = table(&comparison(), &runs);
        let cell = only_cell(&data);
        assert_eq!((cell.seeds, cell.planned), (1, 2));
        assert_eq!(
            cell.ours.map(|ours| (ours.mean, ours.low, ours.high)),
            Some((15.0, 15.0, 15.0))
        );
        assert!(matches!(
            &cell.verdict,
            Some(Verdict::NotComparable(reason)) if reason.contains("1 seed")
        ));
        assert!(
            data.notes
                .iter()
                .any(|note| note.contains("training diverged")),
            "{:?}",
            data.notes
        );
    }

    #[test]
    fn a_length_that_the_paper_does_not_print_is_told_beside_its_values_alone() {
        let told = |of: Table| {
            let runs = [fixture::ppo("Hopper-v2", 0).finished(&[(100, &[10.0])])];
            table(&of, &runs)
                .notes
                .iter()
                .any(|note| note.contains("runs of 3M steps, a choice of this program"))
        };
        assert!(told(comparison()));
        assert!(!told(Table {
            reference: None,
            ..comparison()
        }));
    }

    #[test]
    fn a_seed_with_a_nan_on_the_way_keeps_its_place_in_its_cell() {
        let run = |seed, middle| {
            let returns: [(u64, &[f64]); 2] = [(50, &[middle]), (100, &[seed as f64])];
            fixture::ppo("Hopper-v2", seed)
                .finished(&returns)
                .progress("value_loss", &[(10, middle)])
        };
        let data = table(&comparison(), &[run(1, 1.0), run(2, f64::NAN), run(3, 1.0)]);
        let cell = only_cell(&data);
        assert_eq!(
            (cell.seeds, cell.ours.map(|ours| ours.mean)),
            (3, Some(2.0))
        );
    }

    #[test]
    fn a_cell_without_finished_runs_has_no_numbers() {
        let data = table(&comparison(), &[fixture::ppo("Hopper-v2", 0)]);
        let cell = only_cell(&data);
        assert_eq!(
            (cell.ours, cell.best, cell.seeds, cell.planned),
            (None, None, 0, 1)
        );
        assert_eq!(
            cell.verdict,
            Some(Verdict::NotComparable("no finished run".into()))
        );
    }

    #[test]
    fn only_the_last_evaluation_counts_and_seeds_are_the_samples() {
        let runs = [
            fixture::ppo("Hopper-v2", 0).finished(&[(50, &[900.0]), (100, &[1.0, 3.0])]),
            fixture::ppo("Hopper-v2", 1).finished(&[(50, &[900.0]), (100, &[5.0, 7.0])]),
            fixture::ppo("Hopper-v2", 2).finished(&[(50, &[900.0]), (100, &[3.0, 5.0])]),
        ];
        let data = table(&comparison(), &runs);
        let cell = only_cell(&data);
        // Samples 2, 6, 4: mean 4, standard error 2 / sqrt(3), and t(0.975, 2) = 4.302652730.
        let ours = cell.ours.expect("finished");
        let half = 4.302652729911275 * 2.0 / 3.0_f64.sqrt();
        assert!(
            (ours.mean - 4.0).abs() < 1e-12 && (ours.high - 4.0 - half).abs() < 1e-6,
            "{ours:?}"
        );
        assert_eq!(
            cell.best,
            Some(Best {
                seed: 1,
                mean: 6.0,
                std: 2.0_f64.sqrt(),
                episodes: 2
            })
        );
        assert_eq!(
            cell.verdict,
            Some(Verdict::NotComparable("100 of 3M steps".into()))
        );
    }

    #[test]
    fn settings_that_share_a_cell_become_columns_of_their_own() {
        let runs = [
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0),
            fixture::mcpo("Hopper-v2", 1e-2, 1e-3, 0),
            fixture::ppo("Hopper-v2", 0),
        ];
        let data = table(&comparison(), &runs);
        let columns: Vec<&str> = data
            .columns
            .iter()
            .map(|column| column.text.as_str())
            .collect();
        assert_eq!(columns, ["MCPO, d = 10⁻⁴", "MCPO, d = 10⁻²", "PPO"]);
        let papers: Vec<_> = data.rows[0]
            .cells
            .iter()
            .flatten()
            .map(|cell| cell.paper.map(|p| p.mean))
            .collect();
        assert_eq!(
            papers,
            [Some(1897.69), None, Some(17.09)],
            "only Table 2's setting is the paper's MCPO"
        );
        assert!(
            data.notes
                .iter()
                .any(|note| note.ends_with("have none beside them: mcpo.d.")),
            "{:?}",
            data.notes
        );
    }

    #[test]
    fn an_ablation_compares_with_table_5() {
        let rows = vec!["d".into(), "epsilon".into()];
        let ablation = Table {
            rows,
            reference: Some(Reference::Table5),
            ..comparison()
        };
        let runs = [
            fixture::mcpo("HalfCheetah-v2", 1e-3, 1e-3, 0),
            fixture::mcpo("HalfCheetah-v2", 1e-6, 0.0, 0),
        ];
        let data = table(&ablation, &runs);
        assert_eq!(data.row_keys, ["d".into(), "epsilon".into()]);
        assert_eq!(
            data.rows
                .iter()
                .map(|row| row.labels.join(" "))
                .collect::<Vec<_>>(),
            ["10⁻³ 10⁻³", "10⁻⁶ 0"]
        );
        assert_eq!(
            only_cell(&data).paper.map(|paper| paper.mean),
            Some(3286.78)
        );
        assert_eq!((data.rows[0].demo, data.rows[0].paper_demo), (None, None));
    }

    #[test]
    fn the_demonstrations_return_stands_beside_the_papers() {
        let mcpo = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(100, &[1.0])]);
        let runs = [
            fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])]),
            mcpo,
        ];
        let demos = |table_of: &Table, runs: &[Run]| {
            let data = table(table_of, runs);
            let told = data.notes.iter().any(|note| note.starts_with("Demo: "));
            (data.rows[0].demo, data.rows[0].paper_demo, told)
        };
        assert_eq!(
            demos(&comparison(), &runs),
            (None, Some(969.71), true),
            "ours is not recorded"
        );
        let runs = runs.map(|run| run.demonstrated(Some("a"), Some(974.5)));
        assert_eq!(
            demos(&comparison(), &runs),
            (Some(974.5), Some(969.71), true)
        );
        assert_eq!(
            demos(
                &Table {
                    reference: None,
                    ..comparison()
                },
                &runs
            ),
            (Some(974.5), None, true)
        );
        assert_eq!(
            demos(&comparison(), &runs[1..]),
            (Some(974.5), Some(969.71), false),
            "a list has no such column"
        );
        let by_algorithm = Table {
            rows: vec!["algorithm".into()],
            columns: "env".into(),
            ..comparison()
        };
        assert_eq!(
            demos(&by_algorithm, &runs),
            (None, None, false),
            "a row is not one environment"
        );
    }
}
