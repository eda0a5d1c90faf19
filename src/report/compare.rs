//! Two experiments, or two folders of results, cell by cell.
//!
//! Owns which cells of both belong together, and the test of their difference. Knows nothing of the
//! paper but its margin. Start at
//! [`CompareData::new`].
//!
//! A cell holds runs that differ in their seeds alone. Cells of one name belong together, and
//! otherwise those with the same settings. The verdict is reached as for a printed value, but with
//! Welch's interval in place of that for a single draw: two one-sided tests with a margin of a
//! tenth of the paper's Expert - Random (Schuirmann, 1987), and Holm's correction over all cells
//! for what lies beyond it. Runs that failed count a second time at the Random policy's return, and
//! a verdict holds both ways.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    ReportError, amount,
    curve::{CONFIDENCE, mean},
    notes,
    recorded::{self, Run, State},
    reference::{self, Scale},
    verdict::{ALPHA, SEEDS_FOR_VERDICT, Verdict},
};
use crate::{
    plan,
    record::{Manifest, RecordError, RunPaths},
    stats::{Contrast, Interval, holm, t_interval},
};

/// The greatest depth of folders that are searched within `runs`.
const DEEPEST: usize = 8;

/// The comparison of two experiments.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareData {
    /// One row per pair of cells, in the first experiment's order.
    pub rows: Vec<CompareRow>,
    /// Notes on how to read the numbers, and on cells that only one side has.
    pub notes: Vec<String>,
}

/// One cell on both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareRow {
    /// The cell's name, environment first.
    pub cell: String,
    /// Its name on the second side, where that differs.
    pub called: Option<String>,
    /// Either side's mean over finished seeds with its t interval.
    pub sides: [Option<Interval>; 2],
    /// Finished seeds of either side, and all that are planned or recorded.
    pub seeds: [(usize, usize); 2],
    /// The second mean less the first, with its 90 % interval over both ways to count failed runs.
    pub difference: Option<Interval>,
    /// The verdict on the second side, judged by the first.
    pub verdict: Verdict,
    /// The settings that differ, as `key: first -> second`.
    pub changes: Vec<String>,
}

/// The runs that lie in `folder/runs`, each as it was recorded, and remarks on what cannot be read.
///
/// # Errors
///
/// There is no such folder, or it cannot be read.
pub fn in_folder(folder: &Path) -> Result<(Vec<Run>, Vec<String>), ReportError> {
    let home = fs::canonicalize(folder).map_err(|source| io(folder, source))?;
    let root = home.join("runs");
    let mut manifests = Vec::new();
    find(&root, DEEPEST, &mut manifests).map_err(|source| io(&root, source))?;
    let (results, name) = (
        home.parent().unwrap_or(&home),
        home.file_name().unwrap_or_default().to_string_lossy(),
    );
    let (mut plan, mut remarks) = (Vec::new(), Vec::new());
    for file in manifests {
        let id = file
            .parent()
            .and_then(|run| run.strip_prefix(&root).ok())
            .unwrap_or(Path::new(""));
        let id = id.to_string_lossy().into_owned();
        let read = Manifest::read(&file).map_err(|error| error.to_string());
        let spec = read.and_then(|manifest| {
            let manifest = manifest.ok_or_else(|| "it has gone".to_owned())?;
            plan::recorded(&manifest.stamp.spec).map_err(|error| error.to_string())
        });
        match spec {
            Ok(spec) => plan.push(plan::RunSpec {
                experiment: name.clone().into_owned(),
                id,
                ..spec
            }),
            Err(reason) => remarks.push(format!("{id} is left out: {reason}")),
        }
    }
    let loaded = recorded::load(&plan, results, &[])?;
    remarks.extend(loaded.remarks);
    Ok((loaded.runs, remarks))
}

fn io(path: &Path, source: std::io::Error) -> RecordError {
    RecordError::Io {
        action: "read",
        path: path.to_owned(),
        source,
    }
}

/// The manifests of ended runs below `folder`, by name; links are not followed.
fn find(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let mut entries = fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    let manifest = RunPaths::manifest(folder);
    if manifest.is_file() && !manifest.is_symlink() {
        found.push(manifest);
    }
    for entry in entries {
        let ended = !RunPaths::is_aside(&entry.file_name().to_string_lossy());
        if depth > 0 && ended && entry.file_type()?.is_dir() {
            find(&entry.path(), depth - 1, found)?;
        }
    }
    Ok(())
}

/// Runs that differ in their seeds.
struct Cell<'a> {
    name: &'a str,
    runs: Vec<&'a Run>,
}

fn cells(runs: &[Run]) -> Vec<Cell<'_>> {
    let mut cells: Vec<Cell<'_>> = Vec::new();
    let mut known = std::collections::HashMap::new();
    for run in runs {
        let name = run
            .spec
            .id
            .rsplit_once('/')
            .map_or(run.spec.id.as_str(), |(cell, _)| cell);
        let index = *known.entry(name).or_insert(cells.len());
        if index == cells.len() {
            cells.push(Cell {
                name,
                runs: Vec::new(),
            });
        }
        cells[index].runs.push(run);
    }
    cells
}

impl CompareData {
    /// The cells of `second` against those of `first`.
    pub fn new(first: &[Run], second: &[Run]) -> Self {
        let (ours, theirs) = (cells(first), cells(second));
        let mut taken = vec![false; theirs.len()];
        let by_name: Vec<Option<usize>> = ours
            .iter()
            .map(|cell| theirs.iter().position(|other| other.name == cell.name))
            .collect();
        by_name
            .iter()
            .flatten()
            .for_each(|&index| taken[index] = true);
        let (mut rows, mut tests, mut alone) = (Vec::new(), Vec::new(), [Vec::new(), Vec::new()]);
        for (cell, named) in ours.iter().zip(by_name) {
            let same = |index: &usize| !taken[*index] && changes(cell, &theirs[*index]).is_empty();
            let Some(index) = named.or_else(|| (0..theirs.len()).find(same)) else {
                alone[0].push(cell.name.to_owned());
                continue;
            };
            taken[index] = true;
            let (row, test) = CompareRow::new(cell, &theirs[index]);
            rows.push(row);
            tests.push(test);
        }
        alone[1] = theirs
            .iter()
            .zip(&taken)
            .filter(|(_, taken)| !**taken)
            .map(|(cell, _)| cell.name.to_owned())
            .collect();
        settle(&mut rows, &tests);
        let notes = notes_of(&rows, &alone);
        Self { rows, notes }
    }
}

/// The settings of `theirs` that differ from `ours`, except seeds and budgets.
fn changes(ours: &Cell<'_>, theirs: &Cell<'_>) -> Vec<String> {
    let (ours, mut theirs) = (&ours.runs[0].spec, theirs.runs[0].spec.clone());
    theirs.seed = ours.seed;
    plan::differences(ours, &theirs)
}

/// The test of a row: its difference by both ways to count failed runs, and the margin.
struct Test {
    ways: Vec<Contrast>,
    margin: f64,
}

impl Test {
    fn greatest(&self, p: impl Fn(&Contrast) -> f64) -> f64 {
        self.ways.iter().map(p).fold(0.0, f64::max)
    }

    /// The p value of the hypothesis that the difference does not lie within the margin.
    fn not_within(&self) -> f64 {
        self.greatest(|way| {
            way.confidence_below(-self.margin)
                .max(1.0 - way.confidence_below(self.margin))
        })
    }

    /// The p value of the hypothesis that the difference does not lie beyond the margin, for this
    /// row alone; and the verdict for the side on which it would.
    fn beyond(&self) -> (f64, Verdict) {
        let worse = self.greatest(|way| 1.0 - way.confidence_below(-self.margin));
        let better = self.greatest(|way| way.confidence_below(self.margin));
        let (p, verdict) = if worse < better {
            (worse, Verdict::Worse)
        } else {
            (better, Verdict::Better)
        };
        ((2.0 * p).min(1.0), verdict)
    }
}

impl CompareRow {
    /// The row without its verdict, and its test where there can be one.
    fn new(ours: &Cell<'_>, theirs: &Cell<'_>) -> (Self, Option<Test>) {
        let sides = [ours, theirs];
        let values = sides.map(|cell| -> Vec<f64> {
            cell.runs
                .iter()
                .filter_map(|run| Some(mean(&run.recording()?.final_returns())))
                .collect()
        });
        let failed = sides.map(|cell| {
            cell.runs
                .iter()
                .filter(|run| matches!(run.state, State::Failed { .. }))
                .count()
        });
        let scale = reference::scale(ours.runs[0].spec.env.name());
        let fewest = values.iter().map(Vec::len).min().unwrap_or(0);
        let reason = match scale {
            None => Some("the paper has no margin for this environment".to_owned()),
            Some(_) if fewest < SEEDS_FOR_VERDICT => Some(format!(
                "{}; {SEEDS_FOR_VERDICT} are needed",
                amount::count(fewest, "seed")
            )),
            Some(_) => None,
        };
        let test = scale
            .filter(|_| reason.is_none())
            .and_then(|scale| test(&values, failed, scale));
        // Two one-sided tests at ALPHA: both reject exactly where this interval is within the
        // margin.
        let intervals = test
            .iter()
            .flat_map(|test| &test.ways)
            .map(|way| way.interval(1.0 - 2.0 * ALPHA));
        let difference = intervals.reduce(|all, one| Interval {
            mean: all.mean,
            low: all.low.min(one.low),
            high: all.high.max(one.high),
        });
        let row = Self {
            cell: ours.name.to_owned(),
            called: (ours.name != theirs.name).then(|| theirs.name.to_owned()),
            sides: [0, 1].map(|side| t_interval(&values[side], CONFIDENCE)),
            seeds: [0, 1].map(|side| (values[side].len(), sides[side].runs.len())),
            difference,
            // This stands unless `settle` finds a test of the row.
            verdict: Verdict::NotComparable(reason.unwrap_or_default()),
            changes: changes(ours, theirs),
        };
        (row, test)
    }
}

fn test(values: &[Vec<f64>; 2], failed: [usize; 2], scale: Scale) -> Option<Test> {
    let worst =
        [0, 1].map(|side| [values[side].clone(), vec![scale.random; failed[side]]].concat());
    let ways = if failed == [0, 0] {
        vec![values]
    } else {
        vec![values, &worst]
    };
    let contrast = |way: &&[Vec<f64>; 2]| Contrast::of(&[(1.0, &way[1]), (-1.0, &way[0])]);
    let ways = ways
        .iter()
        .map(contrast)
        .collect::<Option<Vec<Contrast>>>()?;
    Some(Test {
        ways,
        margin: scale.margin(),
    })
}

/// Sets the verdicts of the rows that were tested, corrected for their number.
fn settle(rows: &mut [CompareRow], tests: &[Option<Test>]) {
    let alone: Vec<f64> = tests.iter().flatten().map(|test| test.beyond().0).collect();
    let mut corrected = holm(&alone).into_iter();
    for (row, test) in rows.iter_mut().zip(tests) {
        let Some((test, p)) = test
            .as_ref()
            .and_then(|test| Some((test, corrected.next()?)))
        else {
            continue;
        };
        row.verdict = match p {
            _ if test.not_within() <= ALPHA => Verdict::Reproduced,
            p if p <= ALPHA => test.beyond().1,
            _ => Verdict::Inconclusive(
                "the interval is neither within the margin nor beyond it".to_owned(),
            ),
        };
    }
}

fn notes_of(rows: &[CompareRow], alone: &[Vec<String>; 2]) -> Vec<String> {
    let mut notes = vec![
        "A, B: mean ± half-width of the 95 % Student t interval over seeds, of the dense return of \
         the final evaluation. Difference: B less A, Welch's 90 % interval. Reproduced: within a \
         tenth of the paper's Expert - Random. Better, worse: B beyond it, at 5 % after Holm's \
         correction over all cells. Runs that failed count a second time at the random policy's \
         return; a verdict holds both ways."
            .to_owned(),
    ];
    for row in rows.iter().filter(|row| !row.changes.is_empty()) {
        notes.push(format!("{}: {}", row.cell, notes::listed(&row.changes)));
    }
    for (side, names) in ["A", "B"]
        .iter()
        .zip(alone)
        .filter(|(_, names)| !names.is_empty())
    {
        notes.push(format!("Only in {side}: {}.", notes::listed(names)));
    }
    notes
}

#[cfg(test)]
mod tests;
