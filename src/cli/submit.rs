//! `mcpo-run submit PATH... --engine slurm`.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::{chosen::Chosen, demo::counted, plan::seconds_of, print};
use crate::{
    record::{now, write_atomically},
    schedule::{
        cost::CostModel,
        preflight,
        slurm::{
            self,
            jobs::Asked,
            places::places,
            program,
            script::{self, Chunk, Request},
        },
        state::{Planned, RunState},
        submission::Submission,
    },
    spec::{ExperimentSpec, Memory, Name, SbatchOption, Slurm, Time},
};

/// A system that runs jobs beyond one machine.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Engine {
    /// Slurm, by `sbatch`
    Slurm,
}

/// The arguments of `submit`.
#[derive(Debug, clap::Args)]
pub struct SubmitArguments {
    #[command(flatten)]
    chosen: Chosen,
    /// What runs the jobs
    #[arg(long, value_enum)]
    engine: Engine,
    /// Runs of an element, the unit that the cluster starts [default: slurm.pack of the file, or 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pack: Option<u16>,
    /// The partition [default: slurm.partition of the file]
    #[arg(long, value_name = "NAME")]
    partition: Option<Name>,
    /// The account that is charged [default: slurm.account of the file]
    #[arg(long, value_name = "NAME")]
    account: Option<Name>,
    /// The time limit of an element, such as 90 (minutes) or 4:00:00 [default: slurm.time of the
    /// file]
    #[arg(long, value_name = "TIME")]
    time: Option<Time>,
    /// The memory of an element, such as 2G [default: slurm.memory of the file]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Cores of an element, which its runs share [default: slurm.cpus of the file, or 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    cpus: Option<u16>,
    /// The most elements that run at a time [default: slurm.throttle of the file, or no limit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    throttle: Option<u16>,
    /// Another option of sbatch, such as --sbatch=--exclusive; may be repeated
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<SbatchOption>,
    /// Retry a failed run up to K times, each time from its last checkpoint
    #[arg(long, value_name = "K", default_value_t = 0)]
    retries: u32,
    /// Set aside (rename) what was recorded with other settings or is damaged, and start again
    #[arg(long)]
    fresh: bool,
    /// Log every iteration
    #[arg(long, short)]
    verbose: bool,
    /// Show what would be submitted, and stop
    #[arg(long)]
    dry_run: bool,
}

/// Submits the missing runs of every experiment.
pub fn run(arguments: &SubmitArguments) -> anyhow::Result<ExitCode> {
    let Engine::Slurm = arguments.engine;
    let chosen = &arguments.chosen;
    let files = chosen.load_files()?;
    let specs: Vec<ExperimentSpec> = files.iter().map(|(_, spec)| spec.clone()).collect();
    let planned = chosen.planned(&specs)?;
    // A dry run must not set anything aside, as `prepare` may.
    let states = match arguments.dry_run {
        true => planned
            .iter()
            .map(Planned::state)
            .collect::<Result<Vec<_>, _>>()?,
        false => preflight::prepare(&planned, &chosen.results, arguments.fresh)?,
    };
    let costs = CostModel::of(&planned, &states);
    // The path is made absolute, since nodes do not know the folder in which this was called.
    let results =
        std::path::absolute(&chosen.results).context("cannot tell where the results are")?;
    if results.as_os_str().as_encoded_bytes().contains(&b'\\') {
        bail!(
            "{} has a backslash in its name, and Slurm cannot write logs there",
            results.display()
        );
    }
    let folder = std::env::current_dir().context("cannot tell which folder this is")?;
    for (path, spec) in &files {
        let of_it = |(run, _): &(&Planned, &RunState)| run.spec.experiment == spec.name;
        let runs: Vec<(&Planned, &RunState)> = planned.iter().zip(&states).filter(of_it).collect();
        let experiment = Experiment {
            arguments,
            path,
            spec,
            results: &results,
            folder: &folder,
        };
        experiment.submit(&runs, &costs)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The experiment of one submission.
struct Experiment<'a> {
    arguments: &'a SubmitArguments,
    /// The matrix file.
    path: &'a Path,
    spec: &'a ExperimentSpec,
    /// The folder of all results, as an absolute path.
    results: &'a Path,
    /// The folder in which relative paths start.
    folder: &'a Path,
}

impl Experiment<'_> {
    /// Submits those of `runs` that have not finished, that no process works on and that the
    /// cluster does not have yet.
    fn submit(&self, runs: &[(&Planned, &RunState)], costs: &CostModel) -> anyhow::Result<()> {
        let name = &self.spec.name;
        // Failed and interrupted runs are due again, as those that never began are.
        let open = runs
            .iter()
            .filter(|(_, state)| !matches!(state, RunState::Finished(_) | RunState::Running(_)));
        let mut due: Vec<(&Planned, &RunState)> = open.copied().collect();
        let plans: Vec<&Planned> = due.iter().map(|(run, _)| *run).collect();
        let places = places(self.results, name, &plans)?;
        // Runs that the cluster already has must not be submitted twice.
        due.retain(|(run, _)| {
            !places
                .get(&run.spec.id)
                .is_some_and(|place| place.is_taken())
        });
        if due.is_empty() {
            let finished = runs
                .iter()
                .filter(|(_, state)| matches!(state, RunState::Finished(_)))
                .count();
            let rest = match runs.len() - finished {
                0 => String::new(),
                n => format!(", {n} running or queued"),
            };
            return print(&format!(
                "{name}: nothing to submit: {finished} of {} finished{rest}\n",
                counted(runs.len(), "run")
            ));
        }
        // Longest first, so that no long run is left alone at the end.
        due.sort_by(|a, b| seconds_of(b.0, b.1, costs).total_cmp(&seconds_of(a.0, a.1, costs)));
        let due: Vec<&Planned> = due.into_iter().map(|(run, _)| run).collect();
        let pack = self
            .arguments
            .pack
            .map(usize::from)
            .or(self.spec.slurm.pack.map(|pack| pack.size()))
            .unwrap_or(1);
        let elements: Vec<Vec<&Planned>> = due.chunks(pack).map(<[_]>::to_vec).collect();
        let request = self.request();
        let most = slurm::most_elements();
        let Some(chunks) = script::chunks(elements.len(), most, request.throttle) else {
            let (elements, throttle) = (elements.len(), request.throttle.unwrap_or_default());
            bail!(
                "{elements} elements are more arrays of {most}, the cluster's most, than may run \
                 at a time ({throttle}); --pack N puts more runs into an element"
            );
        };
        if self.arguments.dry_run {
            return self.show(&request, &chunks);
        }
        self.send(&request, &chunks, &elements)
    }

    /// The request to the cluster: that of the command line, and where it is silent the file's.
    fn request(&self) -> Request {
        let Slurm {
            partition,
            account,
            time,
            memory,
            throttle,
            grace,
            sbatch,
            ..
        } = &self.spec.slurm;
        let given = self.arguments;
        let option =
            |name: &str, value: Option<&str>| value.map(|value| format!("--{name}={value}"));
        let mut options: Vec<String> = [
            option(
                "partition",
                given
                    .partition
                    .as_ref()
                    .or(partition.as_ref())
                    .map(Name::as_str),
            ),
            option(
                "account",
                given
                    .account
                    .as_ref()
                    .or(account.as_ref())
                    .map(Name::as_str),
            ),
            option(
                "time",
                given.time.as_ref().or(time.as_ref()).map(Time::as_str),
            ),
            option(
                "mem",
                given
                    .memory
                    .as_ref()
                    .or(memory.as_ref())
                    .map(Memory::as_str),
            ),
            option("cpus-per-task", Some(&self.cpus().to_string())),
        ]
        .into_iter()
        .flatten()
        .collect();
        // Free options come last, and the command line's after the file's: of one that is given
        // twice, sbatch obeys the last.
        options.extend(
            sbatch
                .iter()
                .chain(&given.sbatch)
                .map(|option| option.as_str().to_owned()),
        );
        let throttle = given
            .throttle
            .map(usize::from)
            .or(throttle.map(|throttle| throttle.size()));
        Request {
            options,
            throttle,
            grace: grace.map_or(GRACE, |grace| grace.get()),
        }
    }

    fn cpus(&self) -> usize {
        self.arguments
            .cpus
            .map(usize::from)
            .or(self.spec.slurm.cpus.map(|cpus| cpus.size()))
            .unwrap_or(1)
    }

    /// The command-line arguments that write the report.
    fn report(&self) -> Vec<OsString> {
        let mut report: Vec<OsString> = vec!["--results".into(), self.results.into()];
        for (option, values) in [
            ("--set", &self.arguments.chosen.set),
            ("--axis", &self.arguments.chosen.axis),
        ] {
            report.extend(
                values
                    .iter()
                    .map(|value| format!("{option}={value}").into()),
            );
        }
        report.extend(["--".into(), self.path.into()]);
        report
    }

    /// Freezes the plan, and hands it to the cluster.
    fn send(
        &self,
        request: &Request,
        chunks: &[Chunk],
        elements: &[Vec<&Planned>],
    ) -> anyhow::Result<()> {
        let (name, arguments) = (&self.spec.name, self.arguments);
        let folder = self.make_folder()?;
        // The program and the plan are frozen first, since elements may start as soon as they are
        // sent.
        let program = program::frozen(self.results)?;
        Submission::new(
            name,
            self.results,
            self.folder,
            self.cpus(),
            arguments.retries,
            arguments.verbose,
        )
        .freeze(&folder, elements)?;
        write_atomically(&folder.join("array.sh"), &script::array(&program, &folder))?;
        write_atomically(
            &folder.join("collect.sh"),
            &script::collect(&program, self.folder, &self.report()),
        )?;
        let mut jobs = Vec::new();
        for chunk in chunks {
            let job = slurm::sbatch(&script::sbatch_array(request, *chunk, name, &folder))
                .with_context(|| {
                    format!(
                        "{} of {} elements were sent; the same command sends the rest",
                        chunk.first,
                        elements.len()
                    )
                })?;
            // Each array is noted as soon as it is sent, so that the same command can send the rest
            // after a failure.
            Asked::Array {
                job: job.clone(),
                first: chunk.first,
                count: chunk.count,
            }
            .add(&folder)?;
            jobs.push(job);
        }
        let job = slurm::sbatch(&script::sbatch_collect(request, &jobs, name, &folder))
            .context("everything was sent except the report, which `mcpo-run report` writes")?;
        Asked::Collect { job: job.clone() }.add(&folder)?;
        let runs = counted(elements.iter().map(Vec::len).sum(), "run");
        let elements = counted(elements.len(), "element");
        print(&format!(
            "{name}: {runs} in {elements} submitted as job {}, the report as job {job}; logs in \
             {}\n",
            jobs.join(", "),
            folder.join("log").display(),
        ))
    }

    /// Creates a new folder for a submission.
    fn make_folder(&self) -> anyhow::Result<PathBuf> {
        let all = Submission::all(self.results, &self.spec.name)?;
        let folder = all.join(now().replace(['-', ':'], ""));
        fs::create_dir_all(&all).with_context(|| format!("cannot create {}", all.display()))?;
        let folders = std::iter::once(folder.clone()).chain((2..).map(|n| {
            let mut name = folder.clone().into_os_string();
            name.push(format!("-{n}"));
            name.into()
        }));
        for folder in folders {
            match fs::create_dir(&folder) {
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
                made => {
                    // Slurm does not start a program if the folder of its log is missing.
                    made.and_then(|()| fs::create_dir(folder.join("log")))
                        .with_context(|| format!("cannot create {}", folder.display()))?;
                    return Ok(folder);
                }
            }
        }
        unreachable!("there are numbers without end")
    }

    /// Shows what would be submitted.
    fn show(&self, request: &Request, chunks: &[Chunk]) -> anyhow::Result<()> {
        let folder = Submission::all(self.results, &self.spec.name)?.join("NEW");
        let program = self.results.join(".programs").join("mcpo-run");
        let line = |arguments: &[OsString]| {
            let words: Vec<String> = arguments
                .iter()
                .map(|word| String::from_utf8_lossy(&script::quoted(word)).into_owned())
                .collect();
            format!("sbatch {}\n", words.join(" "))
        };
        let mut text = String::new();
        for chunk in chunks {
            text.push_str(&line(&script::sbatch_array(
                request,
                *chunk,
                &self.spec.name,
                &folder,
            )));
        }
        let jobs: Vec<String> = (1..=chunks.len()).map(|n| format!("JOB{n}")).collect();
        text.push_str(&line(&script::sbatch_collect(
            request,
            &jobs,
            &self.spec.name,
            &folder,
        )));
        for (name, script) in [
            ("array.sh", script::array(&program, &folder)),
            (
                "collect.sh",
                script::collect(&program, self.folder, &self.report()),
            ),
        ] {
            text.push_str(&format!("\n# {name}\n{}", String::from_utf8_lossy(&script)));
        }
        print(&text)
    }
}

/// The default number of seconds before its time limit at which an element stops.
const GRACE: u64 = 120;
