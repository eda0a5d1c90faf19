//! The experiments and runs that a command is about, as most commands take them.

use std::{
    collections::BTreeMap,
    fmt, fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};

use crate::{
    plan::{self, RunSpec, Selection},
    schedule::{preflight, state::Planned},
    spec::{self, ExperimentSpec, Overrides, SpecErrors},
};

/// The experiments and runs that a user chose.
#[derive(Debug, clap::Args)]
pub struct Chosen {
    /// Matrix files, or folders of them
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Set a key of the file, such as budget.env_steps=100000
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Replace the list of an axis in every block that has it, such as seed=0,1
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub axis: Vec<String>,
    /// Only the runs that match, such as env=Hopper-v2,algorithm=mcpo
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub only: Vec<String>,
    /// The folder of all results
    #[arg(
        long,
        value_name = "DIR",
        default_value = "results",
        env = "MCPO_RESULTS"
    )]
    pub results: PathBuf,
}

/// Everything that is wrong in the chosen files.
#[derive(Debug)]
pub struct InvalidFiles(pub(super) Vec<SpecErrors>);

impl InvalidFiles {
    /// All errors, with lines and carets.
    pub fn render(&self, terminal: bool) -> String {
        self.0
            .iter()
            .map(|errors| errors.render(terminal))
            .collect()
    }
}

impl fmt::Display for InvalidFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for InvalidFiles {}

impl Chosen {
    /// Reads the experiments from the chosen files.
    ///
    /// # Errors
    ///
    /// Any of the files is wrong, or two experiments share a name.
    pub fn load(&self) -> anyhow::Result<Vec<ExperimentSpec>> {
        Ok(self
            .load_files()?
            .into_iter()
            .map(|(_, spec)| spec)
            .collect())
    }

    /// The experiments as [`load`](Self::load) reads them, each with its file.
    pub fn load_files(&self) -> anyhow::Result<Vec<(PathBuf, ExperimentSpec)>> {
        let overrides = Overrides {
            set: self.set.clone(),
            axis: self.axis.clone(),
        };
        let (mut specs, mut invalid) = (Vec::new(), Vec::new());
        let mut names: BTreeMap<String, PathBuf> = BTreeMap::new();
        for path in self.files()? {
            match spec::load(&path, &overrides) {
                Err(errors) => invalid.push(errors),
                Ok(spec) => {
                    if let Some(other) = names.insert(spec.name.clone(), path.clone()) {
                        let (name, other) = (&spec.name, other.display());
                        bail!(
                            "{other} and {} both call their experiment `{name}`",
                            path.display()
                        );
                    }
                    specs.push((path, spec));
                }
            }
        }
        if invalid.is_empty() {
            Ok(specs)
        } else {
            Err(InvalidFiles(invalid).into())
        }
    }

    /// The runs of `specs` that the user chose.
    ///
    /// # Errors
    ///
    /// The selection cannot be understood, or matches no run.
    pub fn runs(&self, specs: &[ExperimentSpec]) -> anyhow::Result<Vec<RunSpec>> {
        let selection = (!self.only.is_empty())
            .then(|| Selection::parse(&self.only.join(",")))
            .transpose();
        let selection = selection.context("--only")?;
        let mut runs = Vec::new();
        for spec in specs {
            runs.extend(plan::plan(spec).with_context(|| spec.name.clone())?);
        }
        let all = runs.len();
        if let Some(selection) = selection {
            runs.retain(|run| selection.matches(run));
        }
        if runs.is_empty() {
            bail!(
                "none of the {all} runs match --only {}",
                self.only.join(",")
            );
        }
        Ok(runs)
    }

    /// The chosen runs with their places and fingerprints, for which the demonstrations must exist.
    ///
    /// # Errors
    ///
    /// As for [`runs`](Self::runs), or a demonstration cannot be used.
    pub fn planned(&self, specs: &[ExperimentSpec]) -> anyhow::Result<Vec<Planned>> {
        let runs = self.runs(specs)?;
        let needed: Vec<&Path> = runs
            .iter()
            .filter_map(|run| run.demonstration.as_deref())
            .collect();
        let missing: Vec<SpecErrors> = specs
            .iter()
            .filter_map(|spec| spec.ready(needed.iter().copied()).err())
            .collect();
        if !missing.is_empty() {
            return Err(InvalidFiles(missing).into());
        }
        Ok(preflight::plan(runs, &self.results)?)
    }

    /// A hint for when nothing is recorded under [`results`](Self::results): the folder beside the
    /// files that holds results of these experiments.
    pub fn elsewhere(&self, specs: &[ExperimentSpec]) -> String {
        let holds = |folder: &Path| {
            specs
                .iter()
                .any(|spec| folder.join(&spec.name).join("runs").is_dir())
        };
        let beside = specs
            .iter()
            .flat_map(|spec| [spec.folder.join("results"), spec.folder.join("../results")]);
        let nothing = format!("nothing is recorded under {}", self.results.display());
        match beside
            .into_iter()
            .filter(|_| !holds(&self.results))
            .find(|folder| holds(folder))
        {
            Some(folder) => format!(
                "{nothing}; {} holds results: --results names it\n",
                folder.display()
            ),
            None => format!("{nothing}\n"),
        }
    }

    /// The files that the user named, and those in the folders that the user named.
    fn files(&self) -> anyhow::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for path in &self.paths {
            if path.is_dir() {
                files.extend(matrices(path)?);
            } else if path.exists() || path.extension().is_some() {
                files.push(path.clone());
            } else {
                bail!(
                    "there is no file, folder or command `{}`{}",
                    path.display(),
                    nearest_command(path)
                );
            }
        }
        Ok(files)
    }
}

/// The matrix files of a folder, by name.
fn matrices(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries =
        fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.is_file()
                && path
                    .extension()
                    .is_some_and(|extension| extension == "toml")
        })
        .collect();
    files.sort();
    if files.is_empty() {
        bail!("{} holds no matrix file (*.toml)", folder.display());
    }
    Ok(files)
}

/// `; did you mean ...` for a word that resembles a command.
fn nearest_command(word: &Path) -> String {
    let definition = super::definition();
    let word = word.to_string_lossy();
    let commands = definition
        .get_subcommands()
        .filter(|command| !command.is_hide_set())
        .map(clap::Command::get_name);
    let nearest = commands
        .map(|name| (strsim::damerau_levenshtein(&word, name), name))
        .min();
    match nearest.filter(|&(distance, name)| distance <= name.len() / 2) {
        None => String::new(),
        Some((0, name)) => format!("; the command `{name}` must come first: `mcpo-run {name} ...`"),
        Some((_, name)) => format!("; did you mean `{name}`?"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(paths: &[&Path]) -> Chosen {
        Chosen {
            paths: paths.iter().map(|path| path.to_path_buf()).collect(),
            set: Vec::new(),
            axis: Vec::new(),
            only: Vec::new(),
            results: PathBuf::from("results"),
        }
    }

    #[test]
    fn a_mistyped_command_is_recognised() {
        let message = chosen(&[Path::new("statsu")])
            .files()
            .expect_err("no such file")
            .to_string();
        assert!(message.ends_with("did you mean `status`?"), "{message}");
        let message = chosen(&[Path::new("plan")])
            .files()
            .expect_err("no such file")
            .to_string();
        assert!(
            message.ends_with("the command `plan` must come first: `mcpo-run plan ...`"),
            "{message}"
        );
        let message = chosen(&[Path::new("zzzzzzzzzz")])
            .files()
            .expect_err("no such file")
            .to_string();
        assert!(!message.contains("did you mean"), "{message}");
    }

    #[test]
    fn a_folder_means_its_matrix_files_by_name() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(chosen(&[folder.path()]).files().is_err(), "an empty folder");
        for name in ["b.toml", "a.toml", "README.md"] {
            fs::write(folder.path().join(name), "").expect("written");
        }
        fs::create_dir(folder.path().join("c.toml")).expect("made");
        let files = chosen(&[folder.path()]).files().expect("readable");
        assert_eq!(
            files,
            [folder.path().join("a.toml"), folder.path().join("b.toml")]
        );
    }
}
