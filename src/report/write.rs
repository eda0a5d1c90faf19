//! The files of a report.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use crate::{
    env::EnvId,
    escape,
    plan::{self, RunSpec, Selection},
    record,
    spec::{ExperimentSpec, Figure, STEP, Table, Width},
};

use super::{
    ClaimsData, CurveData, ReportError, Scope, TableData, axis, claims, figure,
    files::Files,
    identity::Identities,
    notes,
    page::{self, Contents, Shows},
    recorded::{self, Loaded, Run, State},
    settings::SettingsData,
    statistics::StatisticsData,
    text,
};

/// The name of the files of claims.
const CLAIMS: &str = "claims";
/// Those of the files of summaries over environments.
const STATISTICS: &str = "statistics";
const PROFILE: &str = "statistics-profile";

/// What was written of one experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The files, in order.
    pub files: Vec<PathBuf>,
    /// The tables.
    pub tables: Vec<TableData>,
    /// The claims; `None` where the file makes none.
    pub claims: Option<ClaimsData>,
    /// Runs that have neither finished nor failed.
    pub open: usize,
    /// `12 of 35 runs finished`, with what failed and what was left out.
    pub state: String,
}

/// Makes the report of `spec`, or of the part of it that `scope` says, from what is recorded under `results`, and writes it to
/// `results/<experiment>/report`, or beside it ([`Scope::folder`]). Files of an earlier report that this one has not are removed.
///
/// An experiment without figures or tables of its own gets learning curves and a table of all of its runs. A run that cannot be
/// read is a failed one.
///
/// Errors: nothing is recorded, the scope means no run, or the disk refuses.
pub fn write(spec: &ExperimentSpec, results: &Path, scope: &Scope) -> Result<Written, ReportError> {
    let (home, whole, plan) = planned(spec, results, scope)?;
    let identities = identities(&whole);
    let figures = figures(spec);
    let progress = figures.iter().any(|figure| figure.y != "return") || spec.claims.iter().any(claims::needs_progress);
    let Loaded { mut runs, remarks } = recorded::load(&plan, results, progress)?;
    let count = runs.len();
    let untouched = leave_out_untouched(&mut runs);
    let tables = tables(spec, &runs);
    let mut files = Files::in_folder(home.join(scope.folder()))?;

    let mut body = String::new();
    let judged = (!spec.claims.is_empty()).then(|| ClaimsData::new(&spec.claims, &runs)).transpose()?;
    if let Some(claims) = &judged {
        let markdown = text::claims::markdown(claims);
        files.write(CLAIMS, "md", markdown.as_bytes())?;
        files.latex(CLAIMS, text::claims::latex(CLAIMS, claims))?;
        files.write(CLAIMS, "csv", &text::claims::csv(claims)?)?;
        body.push_str(&format!("\n#{markdown}"));
    }
    let asked = tables.iter().map(|table| Ok((table, selected(&runs, table.only.as_deref())?)));
    let made = TableData::of_report(&asked.collect::<Result<Vec<_>, ReportError>>()?);
    for (table, data) in tables.iter().zip(&made) {
        let markdown = text::markdown(data);
        files.write(&table.name, "md", markdown.as_bytes())?;
        files.latex(&table.name, text::latex(&table.name, data))?;
        files.write(&table.name, "csv", &text::csv(data)?)?;
        files.write(&format!("{}-seeds", table.name), "csv", &text::seeds_csv(data)?)?;
        body.push_str(&format!("\n#{markdown}"));
    }
    let mut settings = Vec::new();
    for table in &spec.settings_tables {
        let data = SettingsData::new(table, &selected(&runs, table.only.as_deref())?);
        let markdown = text::settings::markdown(&data);
        files.write(&table.name, "md", markdown.as_bytes())?;
        files.latex(&table.name, text::settings::latex(&table.name, &data))?;
        files.write(&table.name, "csv", &text::settings::csv(&data)?)?;
        body.push_str(&format!("\n#{markdown}"));
        settings.push((table.name.as_str(), data));
    }
    let (mut unknown, mut shown) = (BTreeSet::new(), Vec::new());
    for figure in &figures {
        let (picture, caption, curves) = if figure.y == STEP {
            (figure::step::draw(figure.width.map(Width::inches))?, String::new(), None)
        } else {
            let data = CurveData::new(figure, &selected(&runs, figure.only.as_deref())?, &identities)?;
            files.write(&format!("{}-curves", figure.name), "csv", &text::curves_csv(&data)?)?;
            (figure::draw(&data), figure::notes(&data).all(), Some(data))
        };
        unknown.extend(picture.without_glyph());
        let svg = picture.svg().map_err(ReportError::Draw)?;
        files.write(&figure.name, "png", &picture.png().map_err(ReportError::Draw)?)?;
        files.write(&figure.name, "svg", svg.as_bytes())?;
        let title = escape::markdown(&figure.title);
        body.push_str(&format!("\n## {title}\n\n![{title}]({}.png)\n", figure.name));
        if figure.width.is_some() {
            files.write(&figure.name, "pdf", &picture.pdf().map_err(ReportError::Draw)?)?;
            body.push_str(&format!("\n{}\n", escape::markdown(&caption))); // which print does not have in the picture
        }
        shown.push(page::Figure {
            name: &figure.name,
            title: &figure.title,
            caption,
            files: figure_files(figure),
            shows: curves.map_or(Shows::Picture(svg), |data| Shows::Curves(Box::new(data))),
        });
    }
    let statistics = StatisticsData::new(&runs, &identities);
    if let Some(data) = &statistics {
        let markdown = text::statistics::markdown(data);
        files.write(STATISTICS, "md", markdown.as_bytes())?;
        files.latex(STATISTICS, text::statistics::latex(STATISTICS, data))?;
        files.write(STATISTICS, "csv", &text::statistics::csv(data)?)?;
        files.write(&format!("{PROFILE}-curves"), "csv", &text::curves_csv(&data.profile)?)?;
        let picture = figure::draw(&data.profile);
        files.write(PROFILE, "png", &picture.png().map_err(ReportError::Draw)?)?;
        files.write(PROFILE, "svg", picture.svg().map_err(ReportError::Draw)?.as_bytes())?;
        let title = &data.profile.title;
        body.push_str(&format!("\n#{markdown}\n## {title}\n\n![{title}]({PROFILE}.png)\n"));
        shown.push(page::Figure {
            name: PROFILE,
            title,
            caption: figure::notes(&data.profile).all(),
            files: vec![".png", ".svg", "-curves.csv"],
            shows: Shows::Curves(Box::new(data.profile.clone())),
        });
    }
    let mut state = vec![finished(&runs, count, &untouched)];
    state.extend(scope.heading());
    state.extend(remarks);
    state.extend(left_out(&runs));
    state.extend(failed(&runs));
    if !unknown.is_empty() {
        let unknown: String = unknown.into_iter().collect();
        state.push(format!(
            "The figures' font has no {unknown}: a PNG shows boxes, an SVG what its reader's fonts have."
        ));
    }
    let contents = Contents {
        spec,
        home: &home,
        command: scope.command(&spec.file, results),
        state: &state,
        runs: &runs,
        claims: judged.as_ref(),
        tables: tables.iter().map(|table| table.name.as_str()).zip(&made).collect(),
        settings,
        statistics: statistics.as_ref(),
        figures: shown,
    };
    files.write("index", "html", page::html(&contents).as_bytes())?;
    let lines: String = state[1..].iter().map(|line| format!("- {}\n", escape::markdown(line))).collect();
    let first = escape::markdown(&state[0]);
    let (name, description) = (&spec.name, escape::markdown(&spec.description));
    let page = format!("# {name}\n\n{description}\n\n{first}\n\n{lines}{body}");
    files.write("README", "md", page.as_bytes())?;
    files.close()?;
    let open = count - runs.iter().filter(|run| !matches!(run.state, State::Missing)).count();
    Ok(Written { files: files.written, tables: made, claims: judged, open, state: state.join("\n- ") })
}

/// The folder of `spec` under `results`, its runs, and those of them that `scope` means.
///
/// Errors: nothing is recorded, or the scope means no run.
pub fn planned(
    spec: &ExperimentSpec,
    results: &Path,
    scope: &Scope,
) -> Result<(PathBuf, Vec<RunSpec>, Vec<RunSpec>), ReportError> {
    let whole = plan::plan(spec)?;
    let home = record::experiment_folder(results, &spec.name)?;
    if !home.join("runs").is_dir() {
        return Err(ReportError::NothingRecorded { experiment: spec.name.clone(), results: results.to_owned() });
    }
    let mut plan = whole.clone();
    if let Some(selection) = scope.selection()? {
        plan.retain(|run| selection.matches(run));
        if plan.is_empty() {
            let (runs, only) = (whole.len(), scope.only.join(","));
            return Err(ReportError::NoneMatch { experiment: spec.name.clone(), runs, only });
        }
    }
    Ok((home, whole, plan))
}

/// How the names of the files of `figure` end.
fn figure_files(figure: &Figure) -> Vec<&'static str> {
    let (numbers, print) = (figure.y != STEP, figure.width.is_some());
    let all = [(".png", true), (".svg", true), (".pdf", print), ("-curves.csv", numbers)];
    all.into_iter().filter(|(_, has)| *has).map(|(extension, _)| extension).collect()
}

/// The figures of an experiment; its learning curves where it has neither figures nor tables.
pub fn figures(spec: &ExperimentSpec) -> Vec<Figure> {
    if !(spec.figures.is_empty() && spec.tables.is_empty()) {
        return spec.figures.clone();
    }
    vec![Figure {
        series: vec!["algorithm".to_owned()],
        reference: Some("table3".to_owned()),
        ..Figure::returns("returns", format!("{}: learning curves", spec.name))
    }]
}

/// The looks of the file's series: seeds apart, which have none.
pub fn identities(plan: &[RunSpec]) -> Identities {
    let cells: BTreeMap<&str, &RunSpec> =
        plan.iter().map(|run| (run.id.rsplit_once('/').map_or(run.id.as_str(), |(cell, _)| cell), run)).collect();
    let runs: Vec<Run> = cells.into_values().map(|run| Run::new(run.clone(), State::Missing)).collect();
    Identities::new(&runs.iter().collect::<Vec<_>>())
}

/// The tables of an experiment; where it has neither figures nor tables, one of all `runs`: algorithms as columns, and as rows
/// the environments and whatever else varies.
fn tables(spec: &ExperimentSpec, runs: &[Run]) -> Vec<Table> {
    if !(spec.figures.is_empty() && spec.tables.is_empty()) {
        return spec.tables.clone();
    }
    let (env, algorithm) = ("env".to_owned(), "algorithm".to_owned());
    let runs: Vec<&Run> = runs.iter().collect();
    let settings = axis::hidden_axes(&runs, &[env.clone(), algorithm.clone()]);
    vec![Table {
        name: "returns".to_owned(),
        title: format!("{}: returns at the end of training", spec.name),
        rows: [vec![env], settings].concat(),
        columns: algorithm,
        only: None,
        reference: Some("table3".to_owned()),
    }]
}

/// The runs that `only` means; all where it is absent.
pub fn selected<'a>(runs: &'a [Run], only: Option<&str>) -> Result<Vec<&'a Run>, ReportError> {
    let selection = only.map(Selection::parse).transpose()?;
    Ok(runs.iter().filter(|run| selection.as_ref().is_none_or(|selection| run.is_in(selection))).collect())
}

/// Takes away the environments of which no run has ended, unless that is so of all, and names them: who asked for one
/// environment alone gets no empty rows and panels of the others.
fn leave_out_untouched(runs: &mut Vec<Run>) -> Vec<&'static str> {
    let ended = |run: &Run| !matches!(run.state, State::Missing) || run.under_way.is_some();
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

/// `12 of 35 runs finished.`, with how many were recorded otherwise, and of which environments none has ended.
fn finished(runs: &[Run], planned: usize, untouched: &[&str]) -> String {
    let counts = notes::finished(runs.iter(), planned);
    match untouched {
        [] => counts,
        names => format!("{counts} Left out, since no run of theirs has ended: {}.", names.join(", ")),
    }
}

/// What was recorded by another specification: a line for each that differs in its own way.
fn left_out(runs: &[Run]) -> Vec<String> {
    let mut groups: BTreeMap<&[String], Vec<String>> = BTreeMap::new();
    for run in runs {
        if let State::Differs { changes } = &run.state {
            groups.entry(changes).or_default().push(run.spec.id.clone());
        }
    }
    let line = |(changes, ids): (&[String], Vec<String>)| {
        format!("left out, recorded with {}: {}", changes.join("; "), notes::listed(&ids))
    };
    groups.into_iter().map(line).collect()
}

/// A line for each run that failed.
fn failed(runs: &[Run]) -> impl Iterator<Item = String> {
    runs.iter().filter_map(|run| match &run.state {
        State::Failed { error } => Some(format!("{} failed: {}", run.spec.id, escape::plain(error))),
        State::Missing | State::Differs { .. } | State::Finished(_) => None,
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

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

    /// One of its runs, missing.
    fn run(algorithm: &str, seed: u64) -> Run {
        let mut plan = plan::plan(&experiment("")).expect("a plan");
        plan.retain(|spec| spec.algorithm_name() == algorithm && spec.seed.0 == seed);
        Run::new(plan.remove(0), State::Missing)
    }

    fn record_some(results: &Path) {
        let evaluations: [(u64, &[f64]); 2] = [(50, &[10.0, 12.0]), (100, &[1500.0, 1600.0])];
        fixture::record(&run("mcpo", 0).finished(&evaluations), results);
        fixture::record(&run("mcpo", 1).failed("training diverged"), results);
        fixture::record(&run("ppo", 0).finished(&evaluations), results);
    }

    fn report(spec: &ExperimentSpec, results: &Path) -> Written {
        write(spec, results, &Scope::default()).expect("written")
    }

    #[test]
    fn a_wrong_folder_is_an_error_and_gets_no_report() {
        let folder = tempfile::tempdir().expect("a folder");
        let wrong = folder.path().join("wrong");
        let error = write(&experiment(""), &wrong, &Scope::default()).expect_err("nothing is there");
        assert!(error.to_string().contains("made-up: nothing is recorded under ") && !wrong.exists(), "{error}");
    }

    #[test]
    fn a_part_is_reported_beside_the_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let whole = report(&experiment(""), folder.path());
        let page = fs::read(whole.files.last().expect("a page")).expect("readable");
        let of = |only: &str| Scope { only: vec![only.to_owned()], ..Scope::default() };
        let part = write(&experiment(""), folder.path(), &of("algorithm=ppo")).expect("written");
        assert!(part.files[0].ends_with("made-up/report-only-algorithm=ppo/returns.md"), "{:?}", part.files);
        assert!(part.state.starts_with("1 of 2 runs finished.") && part.state.contains("--only algorithm=ppo"));
        assert_eq!(part.tables[0].columns.len(), 1);
        assert!(
            fs::read(whole.files.last().expect("a page")).expect("readable") == page,
            "the whole report was overwritten"
        );
        let error = write(&experiment(""), folder.path(), &of("seed=7")).expect_err("there is no such run");
        assert_eq!(error.to_string(), "made-up: none of the 4 runs match --only seed=7");
    }

    #[test]
    fn what_an_earlier_report_alone_had_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let table = |name: &str| {
            format!("[[tables]]\nname = {name:?}\ntitle = \"\"\nrows = [\"env\"]\ncolumns = \"algorithm\"")
        };
        let old = report(&experiment(&table("old")), folder.path());
        let home = folder.path().join("made-up/report");
        let (own, outside) = (home.join("mine.md"), folder.path().join("made-up/outside.md"));
        fs::write(&own, "").expect("written");
        fs::write(&outside, "").expect("written");
        let list = home.join(".files");
        let hostile = fs::read_to_string(&list).expect("readable") + "../outside.md\n";
        fs::write(&list, hostile).expect("written");
        let new = report(&experiment(&table("new")), folder.path());
        assert!(old.files[..4].iter().all(|file| !file.exists()), "{:?}", old.files);
        assert!(new.files.iter().chain([&own, &outside]).all(|file| file.exists()));
    }

    #[test]
    fn runs_of_other_settings_are_left_out_and_named_once() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let spec = experiment(
            "[environments.Hopper-v2.algorithms.mcpo]\nmax_kl = 0.25\n[[figures]]\nname=\"f\"\ntitle=\"\"\ny=\"return\"\nseries=[]",
        );
        let written = report(&spec, folder.path());
        let start = "1 of 4 runs finished; 2 were recorded with another `mcpo.max_kl`.";
        assert!(written.state.starts_with(start), "{}", written.state);
        assert_eq!(written.state.matches("mcpo.max_kl: 0.005 -> 0.25").count(), 1, "{}", written.state);
        let curves = fs::read_to_string(&written.files[0]).expect("readable");
        assert!(!curves.contains("mcpo"), "{curves}");
    }

    #[test]
    fn a_sweep_has_settings_as_rows() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let sweep = "[[matrix]]\nseed = [0]\nenv = [\"Hopper-v2\"]\nalgorithm = [\"mcpo\"]\nd = [1e-1, 1e-2, 1.0]";
        let table = &report(&experiment(sweep), folder.path()).tables[0];
        assert_eq!((&table.row_keys, &table.column_keys), (&vec!["env".into(), "d".into()], &vec!["algorithm".into()]));
        let labels: Vec<String> = table.rows.iter().map(|row| row.labels.join(" ")).collect();
        assert_eq!(labels, ["Hopper-v2 10⁻⁴", "Hopper-v2 ", "Hopper-v2 10⁻¹", "Hopper-v2 10⁻²", "Hopper-v2 1"]);
    }

    #[test]
    fn text_from_outside_is_shown_and_not_obeyed() {
        let folder = tempfile::tempdir().expect("a folder");
        let evil = "\x1b[31m|<script>\n=cmd()";
        fixture::record(&run("mcpo", 0).failed(evil), folder.path());
        let mut spec = experiment("");
        spec.description = evil.to_owned();
        let written = report(&spec, folder.path());
        assert!(written.state.contains("failed: \\u{1b}[31m|<script> =cmd()"), "{}", written.state);
        let page = fs::read_to_string(written.files.last().expect("a page")).expect("readable");
        assert!(!page.contains('\x1b') && !page.contains("<script>") && page.contains("\\|&lt;script&gt;"), "{page}");
        let tex = fs::read_to_string(&written.files[2]).expect("readable");
        assert!(!tex.contains('\x1b') && tex.contains("$|$$<$script$>$"), "{tex}");
    }

    #[cfg(unix)]
    #[test]
    fn a_report_is_not_written_through_a_link() {
        let (folder, elsewhere) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        record_some(folder.path());
        fs::write(elsewhere.path().join("README.md"), "precious").expect("written");
        std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("made-up/report")).expect("linked");
        let error = write(&experiment(""), folder.path(), &Scope::default()).expect_err("refused");
        let refused = error.to_string();
        assert!(refused.contains("made-up/report is not a folder to write a report into: it is a link"), "{refused}");
        assert_eq!(fs::read_to_string(elsewhere.path().join("README.md")).expect("readable"), "precious");
    }

    #[test]
    fn environments_of_which_no_run_has_ended_are_left_out_and_named() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let more = "[[matrix]]\nseed = [0]\nenv = [\"Ant-v2\"]\nalgorithm = [\"ppo\"]";
        let written = report(&experiment(more), folder.path());
        let start = "2 of 5 runs finished. Left out, since no run of theirs has ended: Ant-v2.\n- Hopper-v2/";
        assert!(written.state.starts_with(start), "{}", written.state);
        assert_eq!(written.tables[0].rows.len(), 1);
    }

    #[test]
    fn a_campaign_of_which_nothing_has_ended_has_a_report() {
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir_all(folder.path().join("made-up/runs")).expect("made");
        let written = report(&experiment(""), folder.path());
        assert_eq!(written.state, "0 of 4 runs finished.");
        assert!(written.files.iter().all(|file| file.exists()));
    }

    #[test]
    fn an_experiment_without_figures_gets_curves_and_a_table_the_same_bytes_twice() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let spec = experiment("");
        let written = report(&spec, folder.path());
        let names: Vec<_> = written.files.iter().filter_map(|file| file.file_name()?.to_str()).collect();
        let expected = [
            "returns.md",
            "returns.tex",
            "returns-float.tex",
            "returns.csv",
            "returns-seeds.csv",
            "returns-curves.csv",
            "returns.png",
            "returns.svg",
            "index.html",
            "README.md",
        ];
        assert_eq!(names, expected);
        assert_eq!(
            written.state,
            format!("2 of 4 runs finished.\n- {} failed: training diverged", run("mcpo", 1).spec.id)
        );
        let read = || written.files.iter().map(|file| fs::read(file).expect("readable")).collect::<Vec<_>>();
        let first = read();
        report(&spec, folder.path());
        assert!(first == read(), "the same recordings gave other bytes");
        assert!(first[6].starts_with(b"\x89PNG"));
        let table = String::from_utf8(first[0].clone()).expect("text");
        assert!(table.contains("1 of 2 seeds"), "{table}");
    }

    #[test]
    fn only_selects_runs() {
        let folder = tempfile::tempdir().expect("a folder");
        record_some(folder.path());
        let more = "[[tables]]\nname = \"t\"\ntitle = \"\"\nrows = [\"env\"]\ncolumns = \"algorithm\"\nonly = \"algorithm=ppo\"";
        let written = report(&experiment(more), folder.path());
        assert_eq!(written.tables[0].columns.len(), 1);
        assert_eq!(written.tables[0].columns[0].text, "PPO");
    }
}
