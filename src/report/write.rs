//! The files of a report.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use crate::{
    env::EnvId,
    plan::{self, RunSpec, Selection},
    record::{self, RecordError},
    spec::{ExperimentSpec, Figure, Table},
};

use super::{
    CurveData, ReportError, TableData, figure, notes,
    recorded::{self, Run, State},
    text,
};

/// What was written of one experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The files, in order.
    pub files: Vec<PathBuf>,
    /// The tables.
    pub tables: Vec<TableData>,
    /// `12 of 35 runs finished`, with what failed.
    pub state: String,
}

/// Makes the report of `spec` from what is recorded under `results`, and writes it to `results/<experiment>/report`.
///
/// An experiment without figures or tables of its own gets learning curves and a table of all of its runs. Tables come
/// first, so that a figure which cannot be drawn does not withhold them.
///
/// Errors: a recorded file is damaged, a figure asks for what no run has, or the disk refuses.
pub fn write(spec: &ExperimentSpec, results: &Path) -> Result<Written, ReportError> {
    let (figures, tables) = wanted(spec);
    let plan = plan::plan(spec)?;
    let progress = figures.iter().any(|figure| figure.y != "return");
    let mut runs = recorded::load(&plan, results, progress)?;
    let folder = record::experiment_folder(results, &spec.name)?.join("report");
    fs::create_dir_all(&folder).map_err(|source| RecordError::Io { action: "create", path: folder.clone(), source })?;
    let mut files = Files { folder, written: Vec::new() };
    let planned = runs.len();
    let untouched = leave_out_untouched(&mut runs);
    let state = state(&runs, planned, &untouched);
    let mut page = format!("# {}\n\n{}\n\n{state}\n", spec.name, spec.description);

    let mut made = Vec::new();
    for table in &tables {
        let data = TableData::new(table, &selected(&runs, table.only.as_deref())?);
        let markdown = text::markdown(&data);
        files.write(&table.name, "md", markdown.as_bytes())?;
        files.write(&table.name, "tex", text::latex(&data).as_bytes())?;
        files.write(&table.name, "csv", &text::csv(&data)?)?;
        page.push_str(&format!("\n#{markdown}"));
        made.push(data);
    }
    for figure in &figures {
        let data = CurveData::new(figure, &selected(&runs, figure.only.as_deref())?)?;
        let picture = figure::draw(&data);
        files.write(&figure.name, "png", &picture.png().map_err(ReportError::Draw)?)?;
        files.write(&figure.name, "svg", picture.svg().map_err(ReportError::Draw)?.as_bytes())?;
        files.write(&format!("{}-curves", figure.name), "csv", &text::curves_csv(&data)?)?;
        page.push_str(&format!("\n## {}\n\n![{}]({}.png)\n", figure.title, figure.title, figure.name));
    }
    files.write("README", "md", page.as_bytes())?;
    Ok(Written { files: files.written, tables: made, state })
}

struct Files {
    folder: PathBuf,
    written: Vec<PathBuf>,
}

impl Files {
    fn write(&mut self, name: &str, extension: &str, bytes: &[u8]) -> Result<(), RecordError> {
        let path = self.folder.join(format!("{name}.{extension}"));
        record::write_atomically(&path, bytes)?;
        self.written.push(path);
        Ok(())
    }
}

/// The figures and tables of an experiment, or one of each where it has none.
fn wanted(spec: &ExperimentSpec) -> (Vec<Figure>, Vec<Table>) {
    if !(spec.figures.is_empty() && spec.tables.is_empty()) {
        return (spec.figures.clone(), spec.tables.clone());
    }
    let algorithm = "algorithm".to_owned();
    let figure = Figure {
        name: "returns".to_owned(),
        title: format!("{}: learning curves", spec.name),
        y: "return".to_owned(),
        series: vec![algorithm.clone()],
        only: None,
        log_y: false,
    };
    let table = Table {
        name: "returns".to_owned(),
        title: format!("{}: returns at the end of training", spec.name),
        rows: vec!["env".to_owned()],
        columns: algorithm,
        only: None,
        reference: Some("table3".to_owned()),
    };
    (vec![figure], vec![table])
}

/// The runs that `only` means; all where it is absent.
fn selected<'a>(runs: &'a [Run], only: Option<&str>) -> Result<Vec<&'a Run>, ReportError> {
    let selection = only.map(Selection::parse).transpose()?;
    let meant = |spec: &RunSpec| selection.as_ref().is_none_or(|selection| selection.matches(spec));
    Ok(runs.iter().filter(|run| meant(&run.spec)).collect())
}

/// Takes away the environments of which no run has ended, unless that is so of all, and names them: who asked for one
/// environment alone gets no empty rows and panels of the others.
fn leave_out_untouched(runs: &mut Vec<Run>) -> Vec<&'static str> {
    let ended = |run: &Run| !matches!(run.state, State::Missing);
    let touched: BTreeSet<EnvId> = runs.iter().filter(|run| ended(run)).map(|run| run.spec.env).collect();
    if touched.is_empty() {
        return Vec::new();
    }
    let mut untouched: Vec<&str> = Vec::new();
    runs.retain(|run| {
        let (keep, name) = (touched.contains(&run.spec.env), run.spec.env.name());
        if !keep && !untouched.contains(&name) {
            untouched.push(name);
        }
        keep
    });
    untouched
}

/// `12 of 35 runs finished.`, of which environments none has ended, and a line for each run that failed.
fn state(runs: &[Run], planned: usize, untouched: &[&str]) -> String {
    let finished = runs.iter().filter(|run| run.recording().is_some()).count();
    let failed: Vec<String> = runs
        .iter()
        .filter_map(|run| match &run.state {
            State::Failed { error } => Some(format!("\n- {} failed: {}", run.spec.id, error.replace('\n', " "))),
            State::Missing | State::Finished(_) => None,
        })
        .collect();
    let left_out = match untouched {
        [] => String::new(),
        names => format!(" Left out, since no run of theirs has ended: {}.", names.join(", ")),
    };
    format!("{finished} of {} finished.{left_out}{}", notes::count(planned, "run"), failed.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        report::fixture,
        spec::{self, Overrides},
    };

    /// The matrix that the made-up runs are of, with `more` below it.
    fn experiment(more: &str) -> ExperimentSpec {
        let text = format!(
            r#"
            name = "made-up"
            description = "Two seeds of each"
            budget.env_steps = 100
            rollout = {{ steps = 10, environments = 1 }}
            evaluation = {{ every = 50, episodes = 2, final_episodes = 2 }}
            algorithms.mcpo.minibatch = 10
            algorithms.ppo.minibatch = 10
            [[matrix]]
            seed = [0, 1]
            env = ["Hopper-v2"]
            algorithm = ["mcpo", "ppo"]
            d = [1e-4]
            epsilon = [1e-3]
            {more}
            "#
        );
        spec::parse(Path::new("made-up.toml"), &text, &Overrides::default()).expect("a valid file")
    }

    fn record_some(results: &Path) {
        let evaluations: [(u64, &[f64]); 2] = [(50, &[10.0, 12.0]), (100, &[1500.0, 1600.0])];
        fixture::record(&fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 0).finished(&evaluations), results);
        fixture::record(&fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1).failed("training diverged"), results);
        fixture::record(&fixture::ppo("Hopper-v2", 0).finished(&evaluations), results);
    }

    #[test]
    fn a_column_that_no_run_has_is_an_error_after_the_tables() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let more = "[[figures]]\nname = \"f\"\ntitle = \"\"\ny = \"case\"\nseries = []\n\
                    [[tables]]\nname = \"t\"\ntitle = \"\"\nrows = [\"env\"]\ncolumns = \"algorithm\"";
        let error = write(&experiment(more), folder.path()).expect_err("text cannot be drawn");
        assert!(error.to_string().contains("`case`"), "{error}");
        assert!(folder.path().join("made-up/report/t.md").exists());
    }

    #[test]
    fn environments_of_which_no_run_has_ended_are_left_out_and_named() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let more = "[[matrix]]\nseed = [0]\nenv = [\"Ant-v2\"]\nalgorithm = [\"ppo\"]";
        let written = write(&experiment(more), folder.path()).expect("written");
        let start = "2 of 5 runs finished. Left out, since no run of theirs has ended: Ant-v2.\n- Hopper-v2/";
        assert!(written.state.starts_with(start), "{}", written.state);
        assert_eq!(written.tables[0].rows.len(), 1);
    }

    #[test]
    fn nothing_recorded_still_makes_a_report() {
        let folder = tempfile::tempdir().expect("a folder");
        let written = write(&experiment(""), folder.path()).expect("written");
        assert_eq!(written.state, "0 of 4 runs finished.");
        assert!(written.files.iter().all(|file| file.exists()));
    }

    #[test]
    fn an_experiment_without_figures_gets_curves_and_a_table_the_same_bytes_twice() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let spec = experiment("");
        let written = write(&spec, folder.path()).expect("written");
        let names: Vec<_> = written.files.iter().filter_map(|file| file.file_name()?.to_str()).collect();
        let expected = [
            "returns.md",
            "returns.tex",
            "returns.csv",
            "returns.png",
            "returns.svg",
            "returns-curves.csv",
            "README.md",
        ];
        assert_eq!(names, expected);
        assert_eq!(
            written.state,
            format!(
                "2 of 4 runs finished.\n- {} failed: training diverged",
                fixture::mcpo("Hopper-v2", 1e-4, 1e-3, 1).spec.id
            )
        );
        let read = || written.files.iter().map(|file| fs::read(file).expect("readable")).collect::<Vec<_>>();
        let first = read();
        write(&spec, folder.path()).expect("written again");
        assert!(first == read(), "the same recordings gave other bytes");
        assert!(first[3].starts_with(b"\x89PNG"));
        let table = String::from_utf8(first[0].clone()).expect("text");
        assert!(table.contains("1 of 2 seeds"), "{table}");
    }

    #[test]
    fn only_selects_runs() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let more = "[[tables]]\nname = \"t\"\ntitle = \"\"\nrows = [\"env\"]\ncolumns = \"algorithm\"\nonly = \"algorithm=ppo\"";
        let written = write(&experiment(more), folder.path()).expect("written");
        assert_eq!(written.tables[0].columns, ["PPO"]);
    }
}
