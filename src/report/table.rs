//! Tables as numbers, before anything is written.
//!
//! Owns what is said of each cell: our mean over seeds with its interval, the best seed, the paper's value, and the verdict.
//! Knows nothing of Markdown or LaTeX. Start at [`TableData::of_report`].
//!
//! The paper's value stands beside runs of the paper's setting alone: [`Counterpart`] says which those are. How both are compared is
//! the module `verdict`'s. With fewer than three finished seeds, or fewer steps than [`reference::assumed_budget`], they are not.

use std::collections::{BTreeSet, HashMap};

use crate::stats::{Interval, t_interval};

use crate::spec::Table;

use super::{
    axis::{self, Label},
    counterpart::Counterpart,
    curve::{CONFIDENCE, mean},
    notes,
    recorded::{Run, State, demonstrated_return},
    reference::{self, PaperValue},
    verdict::{self, Comparison, SEEDS_FOR_VERDICT, Verdict},
};

/// One table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableData {
    /// Above the table.
    pub title: String,
    /// What the rows are told apart by, as the file names it.
    pub row_keys: Vec<String>,
    /// What the columns are told apart by: first what was asked for, then what else varies.
    pub column_keys: Vec<String>,
    /// One a column.
    pub columns: Vec<Label>,
    /// The rows, in the plan's order.
    pub rows: Vec<Row>,
    /// Budget, seeds, readings and failures, a sentence each.
    pub notes: Vec<String>,
}

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// What the value of each row key is called; empty where the runs do not have that axis.
    pub labels: Vec<String>,
    /// The value of each row key.
    pub values: Vec<Option<toml::Value>>,
    /// The return of the demonstration that the row's runs learned from, where the row is one environment.
    pub demo: Option<f64>,
    /// The same in the paper, where the table is compared with one of the paper's.
    pub paper_demo: Option<f64>,
    /// One a column; `None` where the matrix has no such run.
    pub cells: Vec<Option<Cell>>,
}

/// One cell: the runs of one row and column.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Mean over the finished seeds of their final evaluation's mean dense return, with its t interval.
    pub ours: Option<Interval>,
    /// The values of the finished seeds, each with its seed.
    pub values: Vec<(u64, f64)>,
    /// Finished seeds with a final evaluation.
    pub seeds: usize,
    /// Seeds that the plan has.
    pub planned: usize,
    /// The seed with the highest mean.
    pub best: Option<Best>,
    /// The paper's value.
    pub paper: Option<PaperValue>,
    /// The parameters that are not the paper's, which keep its value away.
    pub departures: BTreeSet<String>,
    /// Ours less the paper's, where they can be compared.
    pub comparison: Option<Comparison>,
    /// What that means; `None` where there is nothing to compare.
    pub verdict: Option<Verdict>,
    /// Environment steps of the shortest run.
    pub env_steps: u64,
}

/// The paper's way of evaluating: the best seed's policy alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// The seed.
    pub seed: u64,
    /// Mean dense return over its final episodes.
    pub mean: f64,
    /// Sample standard deviation over them; NaN for one episode.
    pub std: f64,
    /// How many episodes.
    pub episodes: usize,
}

impl TableData {
    /// All tables of a report, each with the runs that its `only` selects, in the plan's order. Their verdicts allow for each other.
    pub fn of_report(tables: &[(&Table, Vec<&Run>)]) -> Vec<Self> {
        let mut made: Vec<Self> = tables.iter().map(|(table, runs)| Self::without_verdicts(table, runs)).collect();
        let cells = made.iter_mut().flat_map(|table| &mut table.rows).flat_map(|row| row.cells.iter_mut().flatten());
        let (mut compared, verdicts): (Vec<_>, Vec<_>) =
            cells.filter_map(|cell| Some((cell.comparison.as_mut()?, &mut cell.verdict))).unzip();
        for (place, verdict) in verdicts.into_iter().zip(verdict::settle(&mut compared)) {
            *place = Some(verdict);
        }
        made
    }

    fn without_verdicts(table: &Table, runs: &[&Run]) -> Self {
        let mut column_keys = vec![table.columns.clone()];
        let known: Vec<String> = table.rows.iter().chain(&column_keys).cloned().collect();
        let (env, others): (Vec<_>, Vec<_>) = axis::hidden_axes(runs, &known).into_iter().partition(|key| key == "env");
        let row_keys: Vec<String> = env.into_iter().chain(table.rows.iter().cloned()).collect();
        column_keys.extend(others);

        let columns = axis::group(runs, &column_keys);
        let numbered = columns.iter().enumerate();
        let column_of: HashMap<&str, usize> = numbered
            .flat_map(|(index, column)| column.runs.iter().map(move |run| (run.spec.id.as_str(), index)))
            .collect();
        let groups = axis::group(runs, &row_keys);
        let labels = axis::value_labels(&groups);
        let one_env = row_keys.iter().any(|key| key == "env");
        let rows = groups.iter().zip(labels).map(|(row, labels)| {
            let mut cells: Vec<Vec<&Run>> = vec![Vec::new(); columns.len()];
            for run in &row.runs {
                cells[column_of[run.spec.id.as_str()]].push(run);
            }
            let paper =
                reference::returns(row.runs[0].spec.env.name()).filter(|_| one_env && table.reference.is_some());
            Row {
                labels: labels.into_iter().map(Option::unwrap_or_default).collect(),
                values: row.values.clone(),
                demo: demonstrated_return(&row.runs).filter(|_| one_env),
                paper_demo: paper.map(|row| row.demo),
                cells: cells
                    .iter()
                    .map(|runs| (!runs.is_empty()).then(|| Cell::new(table.reference.as_deref(), runs)))
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

impl Cell {
    fn new(reference: Option<&str>, runs: &[&Run]) -> Self {
        let seeds: Vec<(u64, Vec<f64>)> = runs
            .iter()
            .filter_map(|run| Some((run.spec.seed.0, run.recording()?.final_returns())))
            .filter(|(_, returns)| !returns.is_empty())
            .collect();
        let means: Vec<f64> = seeds.iter().map(|(_, returns)| mean(returns)).collect();
        let best = seeds.iter().zip(&means).max_by(|left, right| left.1.total_cmp(right.1));
        let best = best.map(|((seed, returns), &mean)| Best {
            seed: *seed,
            mean,
            std: (returns.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (returns.len() as f64 - 1.0)).sqrt(),
            episodes: returns.len(),
        });
        let ours = t_interval(&means, CONFIDENCE);
        let Counterpart { value: paper, departures } = match reference {
            Some(reference) => Counterpart::of(runs, reference == "table5"),
            None => Counterpart::default(),
        };
        let env_steps = runs.iter().map(|run| run.spec.budget.env_steps.get()).min().unwrap_or(0);
        let needed = reference::assumed_budget(&runs[0].spec);
        let reason = match ours {
            None => Some("no finished run".to_owned()),
            Some(_) if seeds.len() < SEEDS_FOR_VERDICT => {
                Some(format!("{}; {SEEDS_FOR_VERDICT} are needed", notes::count(seeds.len(), "seed")))
            }
            Some(_) if env_steps < needed => {
                Some(format!("{} of {} steps", notes::steps(env_steps), notes::steps(needed)))
            }
            Some(_) => None,
        };
        let failed = runs.iter().filter(|run| matches!(run.state, State::Failed { .. })).count();
        let comparison = paper.filter(|_| reason.is_none()).zip(reference::scale(runs[0].spec.env.name()));
        let comparison = comparison.and_then(|(paper, scale)| Comparison::new(&means, failed, paper, scale));
        let verdict = reason.filter(|_| paper.is_some()).map(Verdict::NotComparable);
        let values = seeds.iter().map(|(seed, _)| *seed).zip(means).collect();
        let (seeds, planned) = (seeds.len(), runs.len());
        Self { ours, values, seeds, planned, best, paper, departures, comparison, verdict, env_steps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture;

    fn comparison() -> Table {
        Table {
            name: "t".into(),
            title: "T".into(),
            rows: vec!["env".into()],
            columns: "algorithm".into(),
            only: None,
            reference: Some("table3".into()),
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
        assert_eq!(cell.ours.map(|ours| (ours.mean, ours.low, ours.high)), Some((15.0, 15.0, 15.0)));
        assert!(matches!(&cell.verdict, Some(Verdict::NotComparable(reason)) if reason.contains("1 seed")));
        assert!(data.notes.iter().any(|note| note.contains("training diverged")), "{:?}", data.notes);
    }

    #[test]
    fn a_length_that_the_paper_does_not_print_is_told_beside_its_values_alone() {
        let told = |of: Table| {
            let runs = [fixture::ppo("Hopper-v2", 0).finished(&[(100, &[10.0])])];
            table(&of, &runs).notes.iter().any(|note| note.contains("runs of 3M steps, a choice of this program"))
        };
        assert!(told(comparison()));
        assert!(!told(Table { reference: None, ..comparison() }));
    }

    #[test]
    fn a_seed_with_a_nan_on_the_way_keeps_its_place_in_its_cell() {
        let run = |seed, middle| {
            let returns: [(u64, &[f64]); 2] = [(50, &[middle]), (100, &[seed as f64])];
            fixture::ppo("Hopper-v2", seed).finished(&returns).progress("value_loss", &[(10, middle)])
        };
        let data = table(&comparison(), &[run(1, 1.0), run(2, f64::NAN), run(3, 1.0)]);
        let cell = only_cell(&data);
        assert_eq!((cell.seeds, cell.ours.map(|ours| ours.mean)), (3, Some(2.0)));
    }

    #[test]
    fn a_cell_without_finished_runs_has_no_numbers() {
        let data = table(&comparison(), &[fixture::ppo("Hopper-v2", 0)]);
        let cell = only_cell(&data);
        assert_eq!((cell.ours, cell.best, cell.seeds, cell.planned), (None, None, 0, 1));
        assert_eq!(cell.verdict, Some(Verdict::NotComparable("no finished run".into())));
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
        assert!((ours.mean - 4.0).abs() < 1e-12 && (ours.high - 4.0 - half).abs() < 1e-6, "{ours:?}");
        assert_eq!(cell.best, Some(Best { seed: 1, mean: 6.0, std: 2.0_f64.sqrt(), episodes: 2 }));
        assert_eq!(cell.verdict, Some(Verdict::NotComparable("100 of 3M steps".into())));
    }

    #[test]
    fn settings_that_share_a_cell_become_columns_of_their_own() {
        let runs = [
            fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0),
            fixture::mcpo("Hopper-v2", 1e-2, 1e-3, 0),
            fixture::ppo("Hopper-v2", 0),
        ];
        let data = table(&comparison(), &runs);
        let columns: Vec<&str> = data.columns.iter().map(|column| column.text.as_str()).collect();
        assert_eq!(columns, ["MCPO, d = 10⁻⁴", "MCPO, d = 10⁻²", "PPO"]);
        let papers: Vec<_> = data.rows[0].cells.iter().flatten().map(|cell| cell.paper.map(|p| p.mean)).collect();
        assert_eq!(papers, [Some(1897.69), None, Some(17.09)], "only Table 2's setting is the paper's MCPO");
        assert!(data.notes.iter().any(|note| note.ends_with("have none beside them: mcpo.d.")), "{:?}", data.notes);
    }

    #[test]
    fn an_ablation_compares_with_table_5() {
        let rows = vec!["d".into(), "epsilon".into()];
        let ablation = Table { rows, reference: Some("table5".into()), ..comparison() };
        let runs = [fixture::mcpo("HalfCheetah-v2", 1e-3, 1e-3, 0), fixture::mcpo("HalfCheetah-v2", 1e-6, 0.0, 0)];
        let data = table(&ablation, &runs);
        assert_eq!(data.row_keys, ["d", "epsilon"]);
        assert_eq!(data.rows.iter().map(|row| row.labels.join(" ")).collect::<Vec<_>>(), ["10⁻³ 10⁻³", "10⁻⁶ 0"]);
        assert_eq!(only_cell(&data).paper.map(|paper| paper.mean), Some(3286.78));
        assert_eq!((data.rows[0].demo, data.rows[0].paper_demo), (None, None));
    }

    #[test]
    fn the_demonstrations_return_stands_beside_the_papers() {
        let mcpo = fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&[(100, &[1.0])]);
        let runs = [fixture::ppo("Hopper-v2", 0).finished(&[(100, &[1.0])]), mcpo];
        let demos = |table_of: &Table, runs: &[Run]| {
            let data = table(table_of, runs);
            let told = data.notes.iter().any(|note| note.starts_with("Demo: "));
            (data.rows[0].demo, data.rows[0].paper_demo, told)
        };
        assert_eq!(demos(&comparison(), &runs), (None, Some(969.71), true), "ours is not recorded");
        let runs = runs.map(|run| run.demonstrated(Some("a"), Some(974.5)));
        assert_eq!(demos(&comparison(), &runs), (Some(974.5), Some(969.71), true));
        assert_eq!(demos(&Table { reference: None, ..comparison() }, &runs), (Some(974.5), None, true));
        assert_eq!(demos(&comparison(), &runs[1..]), (Some(974.5), Some(969.71), false), "a list has no such column");
        let by_algorithm = Table { rows: vec!["algorithm".into()], columns: "env".into(), ..comparison() };
        assert_eq!(demos(&by_algorithm, &runs), (None, None, false), "a row is not one environment");
    }
}
