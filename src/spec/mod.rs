//! The matrix file: from TOML text to a typed specification.
//!
//! Owns the format, the layers that make it up, and the errors that point at a line. Knows nothing
//! of how runs are made or trained. Start at [`load`] and [`ExperimentSpec`]; the format is
//! documented in `experiments/format.md`.

mod arguments;
mod assemble;
mod catalog;
mod check;
mod claim;
mod combinations;
mod drawn;
mod error;
mod figure;
mod key;
mod layer;
mod layers;
mod measured;
mod named;
mod names;
mod parameter;
mod resolve;
mod robots;
mod schema;
mod selection;
mod settings;
mod slurm;
mod source;
mod syntax;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

pub use crate::algo::Algorithm;
pub use claim::{Claim, Environments, Part, Relation, Versus};
pub use drawn::{Band, Panels, Width};
pub use error::{Place, SpecError, SpecErrors};
pub use figure::{Figure, Reference, SettingsTable, Shown, Table};
pub use key::Key;
pub use measured::Drawing;
pub(crate) use parameter::Kind;
pub use parameter::Parameter;
pub use resolve::ResolveError;
pub use schema::schema;
pub use selection::{Selection, SelectionError};
pub use settings::{Budget, Checkpoint, Evaluation, Network, Rollout, Settings};
pub use slurm::{Memory, Name, SbatchOption, Slurm, Time};

use crate::env::EnvId;

/// One experiment file, after its layers are merged.
///
/// Settings and hyperparameters are still TOML tables here, already checked key by key. Their
/// defaults depend on the environment, so [`resolve`](ExperimentSpec::resolve) gives them types run
/// by run.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentSpec {
    /// Name of the experiment, and of its folder under the results.
    pub name: String,
    /// A sentence for readers.
    pub description: String,
    /// The settings of all runs ([`Settings`]), as far as they are given.
    pub settings: toml::Table,
    /// `[algorithms]`: hyperparameters by the algorithm's name, where given.
    pub algorithms: toml::Table,
    /// `[environments.NAME]`: settings and `algorithms` for one environment.
    pub environments: BTreeMap<EnvId, toml::Table>,
    /// The blocks of the matrix, in order.
    pub matrix: Vec<Block>,
    /// `[[figures]]`.
    pub figures: Vec<Figure>,
    /// `[[tables]]`.
    pub tables: Vec<Table>,
    /// `[[claims]]`.
    pub claims: Vec<Claim>,
    /// `[[settings]]`.
    pub settings_tables: Vec<SettingsTable>,
    /// The file, as it was named on the command line.
    pub file: PathBuf,
    /// `[slurm]`: the resources that its elements ask a cluster for.
    pub slurm: Slurm,
    /// The folder of the file.
    pub folder: PathBuf,
    /// Demonstrations that do not exist.
    missing: Vec<(PathBuf, SpecError)>,
}

/// One `[[matrix]]` block: every combination of its lists is one run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Block {
    /// Seeds.
    pub seed: Vec<u64>,
    /// Environments.
    pub env: Vec<EnvId>,
    /// Algorithms, by name.
    pub algorithm: Vec<String>,
    /// Other axes (`d`, `epsilon`, `mcpo.max_kl` ...), in the file's order.
    pub axes: Vec<Axis>,
}

/// One list of a block.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The parameter that it varies.
    pub parameter: Parameter,
    /// Its values, in the file's order.
    pub values: Vec<toml::Value>,
}

/// Values from the command line, which win over the file and the environment variables.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Overrides {
    /// `--set`: `KEY=VALUE`, the key as in the file (`budget.env_steps=100000`).
    pub set: Vec<String>,
    /// `--axis`: `KEY=VALUE,VALUE...`, replaces the list of that axis in every block that has it.
    pub axis: Vec<String>,
}

/// The specification in the file at `path`, over the files that it extends and under `MCPO_...`
/// variables and `overrides`.
///
/// # Errors
///
/// Everything that is wrong in any layer, and everything that does not go together.
pub fn load(path: &Path, overrides: &Overrides) -> Result<ExperimentSpec, SpecErrors> {
    assemble::assemble(path, None, overrides)
}

/// Like [`load`], for `text` as if it stood at `path`, and without environment variables.
///
/// # Errors
///
/// As for [`load`].
pub fn parse(path: &Path, text: &str, overrides: &Overrides) -> Result<ExperimentSpec, SpecErrors> {
    assemble::assemble(path, Some(text), overrides)
}

/// One combination of a block without its seed: environment, algorithm, and the values of the axes
/// that apply to it.
pub type Combination<'a> = (EnvId, &'a str, Vec<(&'a Parameter, &'a toml::Value)>);

impl ExperimentSpec {
    /// The number of runs that the blocks name; a run that two of them name counts twice.
    pub fn named_runs(&self) -> usize {
        self.matrix
            .iter()
            .map(Block::size)
            .fold(0, usize::saturating_add)
    }

    /// Whether the runs that learn from these demonstrations can start.
    ///
    /// # Errors
    ///
    /// Those that do not exist, with the place that names them. A report needs none, so [`load`]
    /// does not refuse them.
    pub fn ready<'a>(
        &self,
        demonstrations: impl IntoIterator<Item = &'a Path>,
    ) -> Result<(), SpecErrors> {
        let needed: BTreeSet<&Path> = demonstrations.into_iter().collect();
        let missing = self
            .missing
            .iter()
            .filter(|(path, _)| needed.contains(path.as_path()));
        SpecErrors::none_or(missing.map(|(_, error)| error.clone()).collect())
    }
}

impl Block {
    /// Every combination without its seeds, in order: environment, algorithm, then the axes, the
    /// last one fastest.
    /// An axis that an algorithm does not have does not multiply its runs.
    pub fn combinations(&self) -> Vec<Combination<'_>> {
        let mut all = Vec::new();
        for &env in &self.env {
            for algorithm in &self.algorithm {
                let mut products: Vec<Vec<(&Parameter, &toml::Value)>> = vec![Vec::new()];
                for Axis { parameter, values } in self.applicable(algorithm) {
                    products = products
                        .into_iter()
                        .flat_map(|axes| {
                            values.iter().map(move |value| {
                                let mut axes = axes.clone();
                                axes.push((parameter, value));
                                axes
                            })
                        })
                        .collect();
                }
                all.extend(
                    products
                        .into_iter()
                        .map(|axes| (env, algorithm.as_str(), axes)),
                );
            }
        }
        all
    }

    /// The number of runs.
    fn size(&self) -> usize {
        let one = |algorithm| {
            self.applicable(algorithm)
                .map(|axis| axis.values.len())
                .fold(1, usize::saturating_mul)
        };
        let combinations = self
            .algorithm
            .iter()
            .map(|name| one(name))
            .fold(0, usize::saturating_add);
        combinations
            .saturating_mul(self.env.len())
            .saturating_mul(self.seed.len())
    }

    /// The axes that apply to `algorithm`.
    fn applicable(&self, algorithm: &str) -> impl Iterator<Item = &Axis> {
        self.axes
            .iter()
            .filter(move |axis| axis.parameter.applies_to(algorithm))
    }
}
