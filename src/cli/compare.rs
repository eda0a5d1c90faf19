//! `mcpo-run compare A B`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::{
    chosen::InvalidFiles,
    print,
    report::{CONTRADICTED, terminal_width},
};
use crate::{
    plan::{self, Selection},
    report::{self, CompareData, Run, Verdict, compare_text},
    spec::{self, Overrides},
};

/// The arguments of `compare`.
#[derive(Debug, clap::Args)]
pub struct CompareArguments {
    /// A matrix file, or a folder that holds recorded `runs/`
    #[arg(value_name = "A")]
    first: PathBuf,
    /// The same, to be judged by the first
    #[arg(value_name = "B")]
    second: PathBuf,
    /// Only the runs that match, such as env=Hopper-v2,algorithm=mcpo
    #[arg(long, value_name = "KEY=VALUE,...")]
    only: Vec<String>,
    /// The folder of all results, for matrix files
    #[arg(
        long,
        value_name = "DIR",
        default_value = "results",
        env = "MCPO_RESULTS"
    )]
    results: PathBuf,
    /// Exit with 3 where a cell of B is better or worse
    #[arg(long)]
    strict: bool,
}

/// Compares the two sides, and prints the comparison.
pub fn run(arguments: &CompareArguments) -> anyhow::Result<ExitCode> {
    let selection = (!arguments.only.is_empty())
        .then(|| Selection::parse(&arguments.only.join(",")))
        .transpose();
    let selection = selection.context("--only")?;
    let side = |path: &Path| -> anyhow::Result<Vec<Run>> {
        let (mut runs, remarks) = recorded(path, &arguments.results)?;
        print(
            &remarks
                .iter()
                .map(|remark| format!("{}: {remark}\n", path.display()))
                .collect::<String>(),
        )?;
        runs.retain(|run| {
            selection
                .as_ref()
                .is_none_or(|selection| run.is_in(selection))
        });
        if runs.is_empty() {
            bail!("{} has no run to compare", path.display());
        }
        Ok(runs)
    };
    let data = CompareData::new(&side(&arguments.first)?, &side(&arguments.second)?);
    let (first, second) = (arguments.first.display(), arguments.second.display());
    print(&format!(
        "A: {first}\nB: {second}\n\n{}",
        compare_text::shown(&data, terminal_width())
    ))?;
    let differs = data
        .rows
        .iter()
        .any(|row| matches!(row.verdict, Verdict::Better | Verdict::Worse));
    Ok(if arguments.strict && differs {
        ExitCode::from(CONTRADICTED)
    } else {
        ExitCode::SUCCESS
    })
}

/// The runs of a matrix file under `results`, or those in a folder; with remarks.
fn recorded(path: &Path, results: &Path) -> anyhow::Result<(Vec<Run>, Vec<String>)> {
    if path.is_dir() {
        if !path.join("runs").is_dir() {
            bail!(
                "{} holds no `runs`; name the folder of one experiment, such as results/comparison",
                path.display()
            );
        }
        return Ok(report::in_folder(path)?);
    }
    let spec =
        spec::load(path, &Overrides::default()).map_err(|errors| InvalidFiles(vec![errors]))?;
    let loaded = report::load(&plan::plan(&spec)?, results, &[])?;
    Ok((loaded.runs, loaded.remarks))
}
