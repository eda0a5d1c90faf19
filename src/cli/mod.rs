//! The command line: one file per subcommand.
//!
//! Owns what a user types and sees, and the exit codes. Knows nothing that another program could
//! want to know: everything else is in the modules that it calls. Start at [`main`].
//!
//! Exit codes: 0 all good; 1 some runs failed; 2 usage or configuration; 3 a verdict or a claim
//! failed, where `--strict` asks; 4 not reproduced; 130 interrupted, and resumable.

mod bench;
mod cancel;
mod chosen;
mod compare;
mod completions;
mod demo;
mod duration;
mod environment;
mod eval;
mod man;
mod plan;
mod recompute;
mod report;
mod reproduce;
mod run;
mod schema;
mod show;
mod status;
mod submit;
mod verify;
mod worker;

use std::{
    io::{self, IsTerminal, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{CommandFactory, Parser, Subcommand};

use crate::escape;
use chosen::{Chosen, InvalidFiles};

/// Declarative experiments in reinforcement learning from imperfect demonstrations.
///
/// `mcpo-run PATH...` runs whatever is missing of the experiments in PATH and writes their reports.
#[derive(Debug, Parser)]
#[command(name = "mcpo-run", version, arg_required_else_help = true)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    disable_help_subcommand = true
)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunArguments,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
enum Command {
    /// Run what is missing, then write the reports (the default)
    Run(run::RunArguments),
    /// Show every run, its id, its state and its cost; start nothing
    Plan(plan::PlanArguments),
    /// Show what has finished, is running, has failed (and why) and is still to do, and the time
    /// left; also during a campaign
    Status(Chosen),
    /// Submit what is missing to a cluster, and exit
    Submit(submit::SubmitArguments),
    /// Cancel the runs that a cluster has; those under way write a checkpoint
    Cancel(Chosen),
    /// Write tables, claims and figures from recorded files alone
    Report(report::ReportArguments),
    /// Compare two experiments, or two folders of results, cell by cell
    ///
    /// A cell of B is reproduced where its difference from A's is within a tenth of the paper's
    /// Expert - Random, better or worse where it lies beyond that.
    Compare(compare::CompareArguments),
    /// Run a matrix and compare it with its record; exit with 4 where it is not reproduced
    ///
    /// Within one numeric class (CPU features, C library, engine and algorithms) every row and the
    /// policy must have the same bits, except for measured times; elsewhere the first iteration
    /// must be within 5 %.
    Verify(verify::VerifyArguments),
    /// Repeat the run that a result comes from, and compare; exit with 4 where it is not reproduced
    Reproduce(reproduce::ReproduceArguments),
    /// Play episodes with a saved policy
    Eval(eval::EvalArguments),
    /// Measure how fast training is, where its time goes, and how close it comes to what this core
    /// can do
    Bench(bench::BenchArguments),
    /// Collect, import, verify or show demonstrations
    #[command(subcommand)]
    Demo(demo::DemoCommand),
    /// Show where a result file comes from
    Show(show::ShowArguments),
    /// Print the completions for a shell
    Completions(completions::CompletionsArguments),
    /// Print the manual page, of the program or of one command
    Man(man::ManArguments),
    /// Print the JSON Schema of matrix files, for editors
    Schema,
    /// Do a job (what `run` and a cluster start)
    #[command(hide = true)]
    Worker(worker::WorkerArguments),
}

/// Runs the command that the command line names.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            drop(error.print()); // nobody listens
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    dispatch(arguments).unwrap_or_else(|error| {
        complain(&error);
        ExitCode::from(2)
    })
}

fn dispatch(arguments: Arguments) -> anyhow::Result<ExitCode> {
    match arguments.command.unwrap_or(Command::Run(arguments.run)) {
        Command::Run(arguments) => run::run(&arguments),
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Status(chosen) => status::run(&chosen),
        Command::Submit(arguments) => submit::run(&arguments),
        Command::Cancel(chosen) => cancel::run(&chosen),
        Command::Report(arguments) => report::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Reproduce(arguments) => reproduce::run(&arguments),
        Command::Eval(arguments) => eval::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Demo(command) => demo::run(command),
        Command::Show(arguments) => show::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Man(arguments) => man::run(&arguments),
        Command::Schema => schema::run(),
        Command::Worker(arguments) => worker::run(&arguments),
    }
}

/// The command line's definition, for completions and the manual.
fn definition() -> clap::Command {
    Arguments::command()
}

/// Reports an error on stderr.
fn complain(error: &anyhow::Error) {
    let text = match error.downcast_ref::<InvalidFiles>() {
        Some(invalid) => invalid.render(io::stderr().is_terminal()),
        None => escape::terminal(&told(error))
            .lines()
            .map(|line| format!("error: {line}\n"))
            .collect(),
    };
    drop(io::stderr().write_all(text.as_bytes())); // nobody listens
}

/// An error with its causes, except those that the text before them already contains.
fn told(error: &anyhow::Error) -> String {
    error
        .chain()
        .map(ToString::to_string)
        .fold(String::new(), |told, cause| match told.as_str() {
            "" => cause,
            before if before.contains(&cause) => told,
            before => format!("{before}: {cause}"),
        })
}

/// The file or folder that a user named, with links resolved. Links that are found within a folder
/// are not followed.
fn named(path: &Path) -> PathBuf {
    if path.is_symlink() {
        path.canonicalize().unwrap_or_else(|_| path.to_owned())
    } else {
        path.to_owned()
    }
}

/// Writes a result to stdout, without characters that would control the terminal. A reader that has
/// seen enough (`| head`) is not an error.
fn print(text: &str) -> anyhow::Result<()> {
    match io::stdout().write_all(escape::terminal(text).as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
