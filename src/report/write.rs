//! The files of a report.

mod draft;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use draft::Draft;

use super::{
    ClaimsData, ReportError, Scope, TableData, axis, claims, curve,
    files::Files,
    identity::Identities,
    notes,
    page::{self, Contents},
    recorded::{self, Loaded, Run, State},
    settings::SettingsData,
    statistics::StatisticsData,
};
use crate::{
    env::EnvId,
    escape,
    plan::{self, RunSpec},
    record,
    spec::{ExperimentSpec, Figure, Key, Reference, Selection, Table},
};

/// The report of one experiment, as it was written.
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

/// Makes the report of `spec`, or of the part of it that `scope` selects, from the records under
/// `results`. Writes it to `results/<experiment>/report`, or beside it ([`Scope::folder`]). Removes
/// files of an earlier report that this one no longer has.
///
/// An experiment without figures or tables of its own gets learning curves and a table of all of
/// its runs. A run that cannot be read is a failed one.
///
/// # Errors
///
/// Nothing is recorded, the scope matches no run, or the disk refuses.
pub fn write(spec: &ExperimentSpec, results: &Path, scope: &Scope) -> Result<Written, ReportError> {
    let (home, whole, plan) = planned(spec, results, scope)?;
    // Looks are those of the whole plan, so that a series has the same one in a part of it.
    let identities = identities(&whole);
    let figures = figures(spec);
    // Only the columns of progress that are drawn or judged are read.
    let drawn = figures.iter().filter_map(|figure| figure.y.measure());
    let of_claims = spec.claims.iter().flat_map(claims::measure::columns);
    let columns: Vec<_> = drawn.flat_map(curve::columns).chain(of_claims).collect();
    let Loaded { mut runs, remarks } = recorded::load(&plan, results, &columns)?;
    let count = runs.len();
    let untouched = leave_out_untouched(&mut runs);
    let tables = tables(spec, &runs);
    let mut draft = Draft::new(Files::in_folder(home.join(scope.folder()))?);

    let judged = (!spec.claims.is_empty()).then(|| ClaimsData::new(&spec.claims, &runs));
    judged.iter().try_for_each(|claims| draft.claims(claims))?;
    let asked = tables
        .iter()
        .map(|table| (table, selected(&runs, table.only.as_ref())));
    // Verdicts are corrected over the cells of all tables, so these are made together.
    let made = TableData::of_report(&asked.collect::<Vec<_>>());
    for (table, data) in tables.iter().zip(&made) {
        draft.table(&table.name, data)?;
    }
    let mut settings = Vec::new();
    for table in &spec.settings_tables {
        let data = SettingsData::new(table, &selected(&runs, table.only.as_ref()));
        draft.settings(&table.name, &data)?;
        settings.push((table.name.as_str(), data));
    }
    let mut shown = Vec::new();
    for figure in &figures {
        shown.push(draft.figure(figure, &runs, &identities)?);
    }
    let statistics = StatisticsData::new(&runs, &identities);
    if let Some(data) = &statistics {
        shown.push(draft.statistics(data)?);
    }
    let Draft {
        mut files,
        body,
        unknown,
    } = draft;
    let mut state = vec![finished(&runs, count, &untouched)];
    state.extend(scope.heading());
    state.extend(remarks);
    state.extend(left_out(&runs));
    state.extend(failed(&runs));
    if !unknown.is_empty() {
        let unknown: String = unknown.into_iter().collect();
        state.push(format!(
            "The figures' font has no {unknown}: a PNG shows boxes, an SVG what its reader's fonts \
             have."
        ));
    }
    let contents = Contents {
        spec,
        home: &home,
        command: scope.command(&spec.file, results),
        state: &state,
        runs: &runs,
        claims: judged.as_ref(),
        tables: tables
            .iter()
            .map(|table| table.name.as_str())
            .zip(&made)
            .collect(),
        settings,
        statistics: statistics.as_ref(),
        figures: shown,
    };
    files.write("index", "html", page::html(&contents).as_bytes())?;
    let lines: String = state[1..]
        .iter()
        .map(|line| format!("- {}\n", escape::markdown(line)))
        .collect();
    let first = escape::markdown(&state[0]);
    let (name, description) = (&spec.name, escape::markdown(&spec.description));
    let page = format!("# {name}\n\n{description}\n\n{first}\n\n{lines}{body}");
    files.write("README", "md", page.as_bytes())?;
    // Files of an earlier report are removed only after all of this one are written.
    files.close()?;
    // Runs of untouched environments are no longer in `runs`, and count as open.
    let open = count
        - runs
            .iter()
            .filter(|run| !matches!(run.state, State::Missing))
            .count();
    Ok(Written {
        files: files.written,
        tables: made,
        claims: judged,
        open,
        state: state.join("\n- "),
    })
}

/// The folder of `spec` under `results`, its runs, and those of them that `scope` selects.
///
/// # Errors
///
/// Nothing is recorded, or the scope matches no run.
pub fn planned(
    spec: &ExperimentSpec,
    results: &Path,
    scope: &Scope,
) -> Result<(PathBuf, Vec<RunSpec>, Vec<RunSpec>), ReportError> {
    let whole = plan::plan(spec)?;
    let home = record::experiment_folder(results, &spec.name)?;
    if !home.join("runs").is_dir() {
        return Err(ReportError::NothingRecorded {
            experiment: spec.name.clone(),
            results: results.to_owned(),
        });
    }
    let mut plan = whole.clone();
    if let Some(selection) = scope.selection()? {
        plan.retain(|run| selection.matches(run));
        if plan.is_empty() {
            let (runs, only) = (whole.len(), scope.only.join(","));
            return Err(ReportError::NoneMatch {
                experiment: spec.name.clone(),
                runs,
                only,
            });
        }
    }
    Ok((home, whole, plan))
}

/// The figures of an experiment; its learning curves where it has neither figures nor tables.
pub fn figures(spec: &ExperimentSpec) -> Vec<Figure> {
    if !(spec.figures.is_empty() && spec.tables.is_empty()) {
        return spec.figures.clone();
    }
    vec![Figure {
        series: vec![Key::Algorithm],
        reference: Some(Reference::Table3),
        ..Figure::returns("returns", format!("{}: learning curves", spec.name))
    }]
}

/// The looks of the file's series. Seeds have no look of their own.
pub fn identities(plan: &[RunSpec]) -> Identities {
    let cells: BTreeMap<&str, &RunSpec> = plan
        .iter()
        .map(|run| {
            (
                run.id
                    .rsplit_once('/')
                    .map_or(run.id.as_str(), |(cell, _)| cell),
                run,
            )
        })
        .collect();
    let runs: Vec<Run> = cells
        .into_values()
        .map(|run| Run::new(run.clone(), State::Missing))
        .collect();
    Identities::new(&runs.iter().collect::<Vec<_>>())
}

/// The tables of an experiment; where it has neither figures nor tables, one of all `runs`:
/// algorithms as columns, and as rows the environments and whatever else varies.
fn tables(spec: &ExperimentSpec, runs: &[Run]) -> Vec<Table> {
    if !(spec.figures.is_empty() && spec.tables.is_empty()) {
        return spec.tables.clone();
    }
    let runs: Vec<&Run> = runs.iter().collect();
    let settings = axis::hidden_axes(&runs, &[Key::Env, Key::Algorithm]);
    vec![Table {
        name: "returns".to_owned(),
        title: format!("{}: returns at the end of training", spec.name),
        rows: [vec![Key::Env], settings].concat(),
        columns: Key::Algorithm,
        only: None,
        reference: Some(Reference::Table3),
    }]
}

/// The runs that `only` selects; all where it is absent.
pub fn selected<'a>(runs: &'a [Run], only: Option<&Selection>) -> Vec<&'a Run> {
    runs.iter()
        .filter(|run| only.is_none_or(|selection| run.is_in(selection)))
        .collect()
}

/// Removes the environments in which no run has ended, unless none has ended anywhere, and returns
/// their names. So a user who has run one environment gets no empty rows and panels for the others.
fn leave_out_untouched(runs: &mut Vec<Run>) -> Vec<&'static str> {
    let ended = |run: &Run| !matches!(run.state, State::Missing) || run.under_way.is_some();
    let touched: BTreeSet<EnvId> = runs
        .iter()
        .filter(|run| ended(run))
        .map(|run| run.spec.env)
        .collect();
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

/// `12 of 35 runs finished.`, with the number of runs recorded under other settings, and the
/// environments in which none has ended.
fn finished(runs: &[Run], planned: usize, untouched: &[&str]) -> String {
    let counts = notes::finished(runs.iter(), planned);
    match untouched {
        [] => counts,
        names => format!(
            "{counts} Left out, since no run of theirs has ended: {}.",
            names.join(", ")
        ),
    }
}

/// The runs recorded under another specification: one line per set of differences.
fn left_out(runs: &[Run]) -> Vec<String> {
    let mut groups: BTreeMap<&[String], Vec<String>> = BTreeMap::new();
    for run in runs {
        if let State::Differs { changes } = &run.state {
            groups.entry(changes).or_default().push(run.spec.id.clone());
        }
    }
    let line = |(changes, ids): (&[String], Vec<String>)| {
        format!(
            "left out, recorded with {}: {}",
            changes.join("; "),
            notes::listed(&ids)
        )
    };
    groups.into_iter().map(line).collect()
}

/// A line for each run that failed.
fn failed(runs: &[Run]) -> impl Iterator<Item = String> {
    runs.iter().filter_map(|run| match &run.state {
        State::Failed { error } => {
            Some(format!("{} failed: {}", run.spec.id, escape::plain(error)))
        }
        State::Missing | State::Differs { .. } | State::Finished(_) => None,
    })
}

#[cfg(test)]
mod tests;
