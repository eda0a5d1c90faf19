//! `mcpo-run verify PATH --against DIR`.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::{
    chosen::Chosen,
    print,
    recompute::{Inexact, NOT_REPRODUCED, compute, inexact},
    told,
};
use crate::{
    record::{
        Manifest, Outcome, RunPaths,
        compare::{self, Exactness, TOLERANCE},
    },
    schedule::{state::Planned, stop::INTERRUPTED},
};

/// The arguments of `verify`.
#[derive(Debug, clap::Args)]
pub struct VerifyArguments {
    /// A matrix file
    path: PathBuf,
    /// The folder that holds the recorded `runs/` of this experiment
    #[arg(long, value_name = "DIR")]
    against: PathBuf,
    /// Only the runs that match, such as env=Hopper-v2,algorithm=mcpo
    #[arg(long, value_name = "KEY=VALUE,...")]
    only: Vec<String>,
    /// Keep what is computed in this folder of results, and resume from what it holds [default: a
    /// temporary one]
    #[arg(long, value_name = "DIR")]
    results: Option<PathBuf>,
    /// Runs at a time, one process each [default: the physical cores]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Write the record to DIR, which must not exist yet: rows and manifests without hosts, command
    /// lines, logs or policies
    #[arg(long)]
    record: bool,
    /// Insist on the same bits where the record was made on this class of machine: a record that
    /// other versions of the program or of MuJoCo made is then a difference
    #[arg(long, conflicts_with = "record")]
    exact: bool,
    /// Show only failures
    #[arg(long, short)]
    quiet: bool,
}

/// Runs the matrix, and compares it with the record or writes the record.
pub fn run(arguments: &VerifyArguments) -> anyhow::Result<ExitCode> {
    let against = &arguments.against;
    if arguments.record && against.exists() {
        bail!(
            "{} already exists; remove it to record it again",
            against.display()
        );
    }
    if !arguments.record && !against.join("runs").is_dir() {
        bail!(
            "{} holds no recorded runs (there is no {}/runs)",
            against.display(),
            against.display()
        );
    }
    // Kept until the comparison is done: dropping it removes the folder.
    let temporary = tempfile::tempdir().context("cannot make a temporary folder")?;
    let results = arguments
        .results
        .clone()
        .unwrap_or_else(|| temporary.path().to_owned());
    let chosen = Chosen {
        paths: vec![arguments.path.clone()],
        set: Vec::new(),
        axis: Vec::new(),
        only: arguments.only.clone(),
        results,
    };
    let specs = chosen.load()?;
    if specs.len() != 1 {
        bail!(
            "{} holds {} experiments; one can be compared with one record",
            arguments.path.display(),
            specs.len()
        );
    }
    let planned = chosen.planned(&specs)?;
    if compute(&planned, &chosen.results, arguments.jobs, arguments.quiet)?.interrupted {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    if arguments.record {
        return record(&planned, against);
    }
    let mut lines = Vec::new();
    let mut elsewhere = BTreeSet::new();
    for run in &planned {
        match difference(
            run,
            &against.join("runs").join(&run.spec.id),
            arguments.exact,
            &mut elsewhere,
        ) {
            Ok(None) => {}
            Ok(Some(difference)) => lines.push(format!("{}: {difference}\n", run.spec.id)),
            // A damaged record of one run does not keep the others from being compared.
            Err(error) => lines.push(format!("{}: {}\n", run.spec.id, told(&error))),
        }
    }
    let differ = lines.len();
    // With `--only`, records of other runs are expected.
    if arguments.only.is_empty() {
        let known: BTreeSet<&str> = planned.iter().map(|run| run.spec.id.as_str()).collect();
        let more = recorded_ids(&against.join("runs"), "")?;
        lines.extend(
            more.iter()
                .filter(|id| !known.contains(id.as_str()))
                .map(|id| {
                    format!(
                        "{id}: recorded, but no run of {}\n",
                        arguments.path.display()
                    )
                }),
        );
    }
    let how = match elsewhere.first() {
        None => "to the bit".to_owned(),
        Some(reason) => format!("within {TOLERANCE} in the first iteration, since {reason}"),
    };
    let name = &specs[0].name;
    let all = planned.len();
    lines.push(format!(
        "{name}: {} of {all} runs are as recorded, {how}\n",
        all - differ
    ));
    print(&lines.concat())?;
    // The summary's own line is always there.
    Ok(if lines.len() == 1 {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(NOT_REPRODUCED)
    })
}

/// The difference between `run` and its record in the folder `recorded`. Where the bits of a run
/// cannot be compared, the reason is added to `elsewhere`. Where they must be compared, a record
/// made by other versions is a difference.
///
/// # Errors
///
/// A file of either is missing or damaged.
fn difference(
    run: &Planned,
    recorded: &Path,
    exact: bool,
    elsewhere: &mut BTreeSet<String>,
) -> anyhow::Result<Option<String>> {
    let Some(before) = Manifest::read(&RunPaths::manifest(recorded))? else {
        return Ok(Some("nothing is recorded for it".to_owned()));
    };
    // Asked first, since the files of another run differ anyway.
    let keys = run.differences(&before.stamp);
    if !keys.is_empty() {
        return Ok(Some(format!(
            "another run is recorded; it differs in {}",
            keys.join(", ")
        )));
    }
    let now = run.paths.ended()?.context("it did not finish")?;
    match (&before.outcome, &now.outcome) {
        (Outcome::Finished, Outcome::Finished) => {}
        (_, Outcome::Failed { error, .. }) => return Ok(Some(format!("failed: {error}"))),
        (Outcome::Failed { error, .. }, Outcome::Finished) => {
            return Ok(Some(format!(
                "recorded as failed ({error}), but finished now"
            )));
        }
        (before, now) => return Ok(Some(format!("recorded as {before:?}, now {now:?}"))),
    }
    // The record's own files are checked first, so that damage is not reported as a difference.
    before.check_tables(recorded)?;
    let exactness = match inexact(&before, &now.stamp) {
        None => Exactness::Bits,
        Some(Inexact::Versions(reason)) if exact => {
            return Ok(Some(format!("{reason}: it must be recorded again")));
        }
        Some(Inexact::Versions(reason) | Inexact::Machine(reason)) => {
            elsewhere.insert(reason);
            Exactness::FirstIteration
        }
    };
    Ok(compare::runs(recorded, &run.paths.complete, exactness)?
        .map(|difference| difference.to_string()))
}

/// The ids of the runs that are recorded in `folder`.
fn recorded_ids(folder: &Path, prefix: &str) -> anyhow::Result<Vec<String>> {
    let mut ids = Vec::new();
    let entries =
        fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("cannot read {}", folder.display()))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // Links are not followed, since they may lead in a circle.
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_folder && !RunPaths::is_aside(&name) {
            let id = format!("{prefix}{name}");
            let is_run = RunPaths::manifest(&entry.path()).exists();
            ids.extend(if is_run {
                vec![id]
            } else {
                recorded_ids(&entry.path(), &format!("{id}/"))?
            });
        }
    }
    ids.sort();
    Ok(ids)
}

/// Makes `against` the record of `planned`, all of which must have finished.
fn record(planned: &[Planned], against: &Path) -> anyhow::Result<ExitCode> {
    for run in planned {
        let manifest = run
            .paths
            .ended()?
            .filter(|manifest| manifest.outcome == Outcome::Finished);
        let manifest = manifest
            .with_context(|| format!("{} did not finish; nothing is recorded", run.spec.id))?;
        if !manifest.is_of_one_class() {
            bail!(
                "{} was computed on more than one class of machine: nobody could repeat its bits",
                run.spec.id
            );
        }
        let folder = against.join("runs").join(&run.spec.id);
        fs::create_dir_all(&folder)
            .with_context(|| format!("cannot create {}", folder.display()))?;
        for file in [RunPaths::progress, RunPaths::evaluations] {
            let (from, to) = (file(&run.paths.complete), file(&folder));
            fs::copy(&from, &to)
                .with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
        }
        Manifest {
            attempts: Vec::new(),
            ..manifest
        }
        .write(&RunPaths::manifest(&folder))?;
    }
    print(&format!(
        "{} runs recorded in {}\n",
        planned.len(),
        against.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_set_aside_is_no_record() {
        let folder = tempfile::tempdir().expect("a folder");
        for run in ["E/ppo/seed-0", "E/ppo/seed-0.old-1", "E/ppo/seed-1.partial"] {
            let run = folder.path().join(run);
            fs::create_dir_all(&run).expect("created");
            fs::write(RunPaths::manifest(&run), "{}").expect("written");
        }
        let ids = recorded_ids(folder.path(), "").expect("readable");
        assert_eq!(ids, ["E/ppo/seed-0"]);
    }
}
