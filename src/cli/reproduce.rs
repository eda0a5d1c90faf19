//! `mcpo-run reproduce FILE`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::{
    print,
    recompute::{Inexact, NOT_REPRODUCED, compute, inexact},
    show::provenance,
};
use crate::{
    plan,
    record::{
        Manifest, Outcome, RunPaths,
        compare::{self, Difference, Exactness, TOLERANCE},
        rows,
    },
    schedule::{preflight, stop::INTERRUPTED},
};

/// The arguments of `reproduce`.
#[derive(Debug, clap::Args)]
pub struct ReproduceArguments {
    /// A run's folder, or any result file: *.parquet and *.safetensors are compared alone, the
    /// others with their folder
    file: PathBuf,
    /// Show only failures
    #[arg(long, short)]
    quiet: bool,
}

/// Runs the run again in a temporary folder, and compares.
pub fn run(arguments: &ReproduceArguments) -> anyhow::Result<ExitCode> {
    let path = &arguments.file;
    let (stamp, manifest) = provenance(path)?;
    if let Some(manifest) = &manifest
        && manifest.outcome != Outcome::Finished
    {
        bail!(
            "the run of {} did not finish: there is nothing to compare with",
            path.display()
        );
    }
    let mut spec = plan::recorded(&stamp.spec).with_context(|| {
        format!(
            "{} was written by another version of this program",
            path.display()
        )
    })?;
    // A relative path starts in the folder where the run was planned, or here if the record does
    // not name it.
    let beside = RunPaths::results_of(path, &spec.experiment, &spec.id);
    let folder = stamp
        .origin
        .as_ref()
        .zip(beside)
        .and_then(|(origin, results)| origin.folder_beside(&results));
    if let Some(folder) = folder.filter(|folder| folder.is_dir()) {
        spec.demonstration = spec.demonstration.map(|path| folder.join(path));
    }
    // Elsewhere than the record, which stays as it is.
    let results = tempfile::tempdir().context("cannot make a temporary folder")?;
    let planned = preflight::plan(vec![spec], results.path())?;
    let [run] = &planned[..] else {
        unreachable!("one specification is one run")
    };
    // The demonstration's file may have changed since the run was recorded.
    let differences = run.differences(&stamp);
    if !differences.is_empty() {
        let file = run
            .spec
            .demonstration
            .as_deref()
            .unwrap_or(Path::new(""))
            .display();
        bail!(
            "{} cannot be reproduced: {} differs ({file})",
            path.display(),
            differences.join(", ")
        );
    }
    check_readable(path, manifest.as_ref())?;
    // A mesh beside a user's model may be gone, which says nothing about the run.
    run.spec
        .env
        .build()
        .with_context(|| format!("{} cannot be reproduced", path.display()))?;
    let summary = compute(&planned, results.path(), None, arguments.quiet)?;
    if summary.interrupted {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    // A file that lies alone has no manifest, only its stamp.
    let whole = manifest.unwrap_or_else(|| Manifest::new(stamp));
    let (exactness, how) = match inexact(&whole, &run.stamp) {
        None => (Exactness::Bits, "to the bit".to_owned()),
        Some(Inexact::Machine(reason) | Inexact::Versions(reason)) => (
            Exactness::FirstIteration,
            format!("within {TOLERANCE} in the first iteration, since {reason}"),
        ),
    };
    let difference = match summary.failed.first() {
        Some((_, error)) => Some(format!("failed: {error}")),
        None => {
            compared(path, &run.paths.complete, exactness)?.map(|difference| difference.to_string())
        }
    };
    let (id, code) = (
        &run.spec.id,
        if difference.is_some() {
            NOT_REPRODUCED
        } else {
            0
        },
    );
    print(&match difference {
        Some(difference) => format!("{id}: {difference}\n{id}: not reproduced, {how}\n"),
        None => format!("{id}: reproduced, {how}\n"),
    })?;
    Ok(ExitCode::from(code))
}

/// Checks what will be compared, so that damage is told before anything is trained.
///
/// # Errors
///
/// A table is damaged.
fn check_readable(path: &Path, manifest: Option<&Manifest>) -> anyhow::Result<()> {
    if path
        .extension()
        .is_some_and(|extension| extension == "parquet")
    {
        // Every column is read, as later when it is compared.
        compare::tables(path, path, Exactness::Bits)?;
    } else if path.is_dir()
        && let Some(manifest) = manifest
    {
        manifest.check_tables(path)?;
    }
    Ok(())
}

/// The difference between `path`, a file or folder of a run, and its counterpart in `computed`.
fn compared(
    path: &Path,
    computed: &Path,
    exactness: Exactness,
) -> anyhow::Result<Option<Difference>> {
    Ok(
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("parquet") => {
                // The file may have been renamed, but its columns show which table it is.
                let table = if rows::read_progress(path).is_ok() {
                    RunPaths::progress
                } else {
                    RunPaths::evaluations
                };
                compare::tables(path, &table(computed), exactness)?
            }
            Some("safetensors") if exactness == Exactness::FirstIteration => {
                bail!(
                    "{} was computed in another numeric class; no policy has the same numbers in \
                     both",
                    path.display()
                )
            }
            Some("safetensors") => {
                let kept = RunPaths::kept_after(path)
                    .map(|env_steps| RunPaths::kept_policy(computed, env_steps));
                compare::policies(path, &kept.unwrap_or_else(|| RunPaths::policy(computed)))?
            }
            _ => {
                let folder = if path.is_dir() {
                    path
                } else {
                    path.parent().unwrap_or(Path::new("."))
                };
                compare::runs(folder, computed, exactness)?
            }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_table_is_told_before_anything_is_trained() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("progress.parquet");
        let mut bytes =
            std::fs::read("results/ci/runs/InvertedPendulum-v2/bc/seed-0/progress.parquet")
                .expect("it is committed");
        std::fs::write(&path, &bytes).expect("written");
        check_readable(&path, None).expect("it is whole");
        // Within a column that is not asked for when rows are read.
        bytes[200] ^= 0xff;
        std::fs::write(&path, &bytes).expect("written");
        let error = check_readable(&path, None).expect_err("it is damaged");
        assert!(error.to_string().contains("progress.parquet"), "{error}");
        // A policy and a log are compared when there is something to compare them with.
        check_readable(&folder.path().join("policy.safetensors"), None).expect("not looked at");
    }
}
