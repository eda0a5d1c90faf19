//! `mcpo-run show FILE`.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, bail};

use super::{demo::counted, named, print};
use crate::record::{Demonstrated, Manifest, Outcome, RunPaths, Stamp, policy, rows};

/// The arguments of `show`.
#[derive(Debug, clap::Args)]
pub struct ShowArguments {
    /// A result file: *.parquet, *.safetensors, run.json, or anything in a run's folder
    file: PathBuf,
}

/// Prints where the file comes from.
pub fn run(arguments: &ShowArguments) -> anyhow::Result<ExitCode> {
    let path = &named(&arguments.file);
    let (stamp, manifest) = provenance(path)?;
    print(&render(path, &stamp, manifest.as_ref())?)?;
    Ok(ExitCode::SUCCESS)
}

/// The provenance of a result file or a run's folder, with the manifest of its run where there is
/// one beside it.
///
/// # Errors
///
/// There is no such file, it is damaged, or it carries no provenance.
pub(super) fn provenance(path: &Path) -> anyhow::Result<(Stamp, Option<Manifest>)> {
    let folder = if path.is_dir() {
        path
    } else {
        path.parent().unwrap_or(Path::new("."))
    };
    if !path.exists() {
        bail!("there is no file {}", path.display());
    }
    // Files in `policies/` belong to the run in the folder above.
    let manifests =
        [folder, &folder.join("..")].map(|folder| Manifest::read(&RunPaths::manifest(folder)));
    let manifest = manifests
        .into_iter()
        .find_map(Result::transpose)
        .transpose()?;
    let own = match path.extension().and_then(|extension| extension.to_str()) {
        Some("parquet") => Some(rows::read_stamp(path)?),
        Some("safetensors") => Some(policy::read(path)?.1),
        _ => None,
    };
    let beside = manifest.as_ref().map(|manifest| &manifest.stamp);
    let stamp = own.as_ref().or(beside).with_context(|| {
        format!(
            "{} carries no provenance, and there is no run.json beside it",
            path.display()
        )
    })?;
    // A policy does not record who started the run; the run's manifest does.
    let of_this_run = beside.filter(|beside| beside.fingerprint == stamp.fingerprint);
    let stamp = Stamp {
        origin: stamp
            .origin
            .clone()
            .or(of_this_run.and_then(|beside| beside.origin.clone())),
        ..stamp.clone()
    };
    let manifest = manifest.filter(|manifest| manifest.stamp.fingerprint == stamp.fingerprint);
    Ok((stamp, manifest))
}

/// The contents of a demonstration, as `1 episode, 300 steps, return 974.4220`.
fn held(demonstrated: &Demonstrated) -> String {
    let mean_return = match demonstrated.mean_return {
        Some(mean_return) if demonstrated.episodes == 1 => format!("return {mean_return:.4}"),
        Some(mean_return) => format!("return {mean_return:.4} in the mean"),
        None => "no rewards".to_owned(),
    };
    let (episodes, steps) = (
        counted(demonstrated.episodes, "episode"),
        counted(demonstrated.steps, "step"),
    );
    format!("{episodes}, {steps}, {mean_return}")
}

/// A word of a command line, quoted for a shell where it needs to be.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

fn render(path: &Path, stamp: &Stamp, manifest: Option<&Manifest>) -> anyhow::Result<String> {
    let mut rows = vec![("file", path.display().to_string())];
    // Keys are looked up one by one, since the specification may be of another version.
    for key in ["experiment", "id", "env"] {
        if let Some(value) = stamp.spec.get(key).and_then(serde_json::Value::as_str) {
            rows.push((key, value.to_owned()));
        }
    }
    if let Some(manifest) = manifest {
        rows.push((
            "outcome",
            match &manifest.outcome {
                Outcome::Begun => "begun, not finished".to_owned(),
                Outcome::Finished => {
                    format!(
                        "finished after {} steps in {:.0} s",
                        manifest.env_steps, manifest.seconds
                    )
                }
                Outcome::Failed { error, .. } => format!("failed: {error}"),
            },
        ));
        for attempt in &manifest.attempts {
            let ended = attempt.ended.as_deref().unwrap_or("no end");
            let error = attempt
                .error
                .as_ref()
                .map_or_else(String::new, |error| format!(": {error}"));
            let from = attempt.from_env_steps;
            // Records of older programs have no class.
            let class = if attempt.cpu_class.is_empty() {
                String::new()
            } else {
                format!(" ({})", attempt.cpu_class)
            };
            let host = &attempt.host;
            rows.push((
                "attempt",
                format!(
                    "{} to {ended} from step {from} on {host}{class}{error}",
                    attempt.began
                ),
            ));
        }
        if !manifest.is_of_one_class() {
            rows.push((
                "machines",
                "of more than one class: no machine can repeat its bits".to_owned(),
            ));
        }
    }
    let build = &stamp.build;
    rows.push(("fingerprint", stamp.fingerprint.clone()));
    rows.extend(
        stamp
            .demonstration
            .clone()
            .map(|digest| ("demo digest", digest)),
    );
    rows.extend(
        stamp
            .demonstrated
            .as_ref()
            .map(|demonstrated| ("demo", held(demonstrated))),
    );
    rows.push((
        "program",
        format!(
            "mcpo-run {}, executable {}",
            build.program,
            build.executable.digest()
        ),
    ));
    rows.push(("versions", build.versions.to_string()));
    rows.push((
        "cpu class",
        format!("{}, libm {}", build.cpu_class, build.libm),
    ));
    if let Some(origin) = &stamp.origin {
        rows.push(("host", format!("{}, {}", origin.host, origin.cpu)));
        // Quoted where a shell needs it, so that the line can be run again.
        let words: Vec<String> = origin
            .command_line
            .iter()
            .map(|word| quoted(word))
            .collect();
        rows.push(("command", words.join(" ")));
        rows.push(("called", origin.called.clone()));
        let git = origin.git.as_ref().map_or_else(
            || "no repository".to_owned(),
            |git| {
                format!(
                    "{}{}",
                    git.commit,
                    if git.dirty { ", with changes" } else { "" }
                )
            },
        );
        rows.push(("git", git));
    }
    let rows: String = rows
        .into_iter()
        .map(|(key, value)| format!("{key:<12} {value}\n"))
        .collect();
    Ok(format!(
        "{rows}spec\n{}\n",
        serde_json::to_string_pretty(&stamp.spec)?
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_can_be_pasted_into_a_shell() {
        for (word, expected) in [
            ("--set", "--set"),
            ("budget.env_steps=100", "budget.env_steps=100"),
            (
                "mmd.bandwidth={ fixed = 1 }",
                "'mmd.bandwidth={ fixed = 1 }'",
            ),
            ("it's", r"'it'\''s'"),
            ("$HOME;rm", "'$HOME;rm'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(word), expected);
        }
    }
}
