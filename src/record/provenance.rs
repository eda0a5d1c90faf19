//! The origin of a result, which every file of a run carries.

use std::{
    env, fs,
    path::{self, Component, Path, PathBuf},
    time::SystemTime,
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{executable::Executable, repository::Git};

/// The origin of a run, as JSON under the key [`Stamp::KEY`] in the metadata of all its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stamp {
    /// The resolved specification (a [`crate::plan::RunSpec`]; kept as JSON, so that files of older
    /// programs stay readable).
    pub spec: Value,
    /// The hash of everything that decides the numbers.
    pub fingerprint: String,
    /// BLAKE3 of the demonstration's file, for a run that uses one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub demonstration: Option<String>,
    /// The content of that demonstration; absent in files of older programs.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub demonstrated: Option<Demonstrated>,
    /// The program and machine that computed it.
    pub build: Build,
    /// The caller of the program; not in policies, whose bytes depend on nothing but the run.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub origin: Option<Origin>,
}

impl Stamp {
    /// The key in the metadata of Parquet and safetensors files.
    pub const KEY: &str = "mcpo-run";

    /// The stamp without the parts that differ from call to call.
    pub fn without_origin(&self) -> Self {
        Self {
            origin: None,
            ..self.clone()
        }
    }
}

/// A demonstration in numbers, for readers who have the results alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Demonstrated {
    /// The number of episodes.
    pub episodes: usize,
    /// The number of steps over all episodes.
    pub steps: usize,
    /// The mean over its episodes of their dense returns; absent where its file has no rewards.
    pub mean_return: Option<f64>,
}

/// A program and a class of machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Build {
    /// The program's version.
    pub program: String,
    /// BLAKE3 of the executable file.
    pub executable: Executable,
    /// The versions that matter for numbers, as they entered the fingerprint.
    pub versions: Value,
    /// The processor's [`cpu_class`].
    pub cpu_class: String,
    /// Digest of values of the system's elementary functions, whose last bits differ between
    /// versions of the C library.
    #[serde(default)]
    pub libm: String,
}

impl Build {
    /// The class of machine: together with the specification and the versions it decides a run's
    /// last bits.
    pub fn machine(&self) -> (&str, &str) {
        (&self.cpu_class, &self.libm)
    }

    /// This program on this machine, with the fingerprint's `versions`.
    pub fn current(versions: Value) -> Self {
        Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            executable: Executable::This,
            versions,
            cpu_class: cpu_class(),
            libm: libm(),
        }
    }
}

/// The caller of the program, and the place of the call.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// The machine's name.
    pub host: String,
    /// The processor's model.
    pub cpu: String,
    /// The command line.
    pub command_line: Vec<String>,
    /// When the command was called, UTC (RFC 3339).
    pub called: String,
    /// The folder of the call, where relative paths of the specification start, as seen from the
    /// folder of results.
    /// Absent if neither folder holds the other, and in files of the oldest programs.
    /// Older programs wrote it as an absolute path.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub folder: Option<PathBuf>,
    /// The commit of the folder of the call, and whether files there differ from it; absent outside
    /// a repository.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub git: Option<Git>,
}

impl Origin {
    /// This process, which writes into the folder `results`.
    pub fn current(results: &Path) -> Self {
        Self {
            host: host(),
            cpu: cpu_model().unwrap_or_else(unknown),
            command_line: env::args_os()
                .map(|argument| argument.to_string_lossy().into_owned())
                .collect(),
            called: now(),
            folder: env::current_dir()
                .ok()
                .and_then(|folder| seen_from(results, &folder)),
            git: Git::of(Path::new(".")),
        }
    }
}

/// The relative path from the folder `results` to `folder`, which reveals nothing above both;
/// `None` if neither holds the other.
fn seen_from(results: &Path, folder: &Path) -> Option<PathBuf> {
    let results = path::absolute(results).ok()?;
    let up = |below: &Path| -> Option<PathBuf> {
        let step = |part| matches!(part, Component::Normal(_)).then_some("..");
        below.components().map(step).collect()
    };
    let inside = || folder.strip_prefix(&results).ok().map(Path::to_owned);
    results
        .strip_prefix(folder)
        .ok()
        .and_then(up)
        .or_else(inside)
}

/// This machine's name.
pub(super) fn host() -> String {
    read_line("/proc/sys/kernel/hostname")
        .or_else(|| env::var("HOSTNAME").ok())
        .unwrap_or_else(unknown)
}

impl Origin {
    /// The folder of the call, if `results` is the folder of results now; `None` if it is not
    /// known.
    pub fn folder_beside(&self, results: &Path) -> Option<PathBuf> {
        let mut folder = path::absolute(results).ok()?;
        for part in self.folder.as_deref()?.components() {
            match part {
                // Upwards by name: behind a link the way up would lead elsewhere.
                Component::ParentDir => drop(folder.pop()),
                part => folder.push(part),
            }
        }
        Some(folder)
    }

    /// This call, as seen on this machine.
    pub fn here(self) -> Self {
        Self {
            host: super::Owner::node(),
            cpu: cpu_model().unwrap_or_else(unknown),
            ..self
        }
    }
}

fn unknown() -> String {
    "unknown".to_owned()
}

fn read_line(path: &str) -> Option<String> {
    Some(fs::read_to_string(path).ok()?.lines().next()?.to_owned())
}

fn cpu_model() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// The architecture and the instructions that change last bits, such as `x86_64 fma avx2`.
#[cfg(target_arch = "x86_64")]
pub fn cpu_class() -> String {
    let mut class = "x86_64".to_owned();
    let has = [
        ("fma", std::arch::is_x86_feature_detected!("fma")),
        ("avx2", std::arch::is_x86_feature_detected!("avx2")),
        ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
    ];
    for (name, _) in has.iter().filter(|(_, has)| *has) {
        class.push(' ');
        class.push_str(name);
    }
    class
}

/// The architecture.
#[cfg(not(target_arch = "x86_64"))]
pub fn cpu_class() -> String {
    env::consts::ARCH.to_owned()
}

/// The first digits of the BLAKE3 digest of a thousand values of each elementary function that
/// environments, networks and updates call.
fn libm() -> String {
    let functions: [fn(f64) -> f64; 6] =
        [f64::exp, f64::exp_m1, f64::ln, f64::sin, f64::cos, |x| {
            x.powf(1.7)
        }];
    let single: [fn(f32) -> f32; 2] = [f32::exp, f32::ln];
    let mut hasher = blake3::Hasher::new();
    for place in 1..=1000 {
        let x = std::hint::black_box(f64::from(place) / 1001.0); // no compiler's own value
        for function in functions {
            hasher.update(&function(x).to_le_bytes());
        }
        for function in single {
            hasher.update(&function(x as f32).to_le_bytes());
        }
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// The time now, UTC, to the second: `2026-11-22T11:16:23Z`.
pub fn now() -> String {
    let seconds = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |elapsed| elapsed.as_secs());
    rfc3339(seconds)
}

/// A Unix time as a date and time (Hinnant, 2013, `civil_from_days`).
fn rfc3339(unix_seconds: u64) -> String {
    let days = unix_seconds / 86_400 + 719_468; // since 0000-03-01
    let era = days / 146_097;
    let day_of_era = days % 146_097;
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 {
        march_month + 3
    } else {
        march_month - 9
    };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let (hour, minute, second) = (
        unix_seconds / 3_600 % 24,
        unix_seconds / 60 % 60,
        unix_seconds % 60,
    );
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(folder: &str) -> Origin {
        Origin {
            folder: Some(folder.into()),
            ..Origin::current(Path::new("results"))
        }
    }

    #[test]
    fn the_folder_of_a_call_is_told_without_what_lies_above_it() {
        let home = Path::new("/home/somebody/work");
        let seen = |results: &str| seen_from(Path::new(results), home);
        assert_eq!(seen("/home/somebody/work/results"), Some("..".into()));
        assert_eq!(seen("/home/somebody/work/a/b"), Some("../..".into()));
        assert_eq!(seen("/home/somebody/work"), Some("".into()));
        assert_eq!(seen("/home/somebody"), Some("work".into()));
        assert_eq!(seen("/scratch/results"), None);
    }

    #[test]
    fn the_folder_of_a_call_is_found_where_the_results_are_now() {
        let now = |folder: &str| origin(folder).folder_beside(Path::new("/elsewhere/work/results"));
        assert_eq!(now(".."), Some("/elsewhere/work".into()));
        assert_eq!(now("work"), Some("/elsewhere/work/results/work".into()));
        assert_eq!(
            now("/home/somebody/work"),
            Some("/home/somebody/work".into()),
            "an older program's record"
        );
        let unknown = Origin {
            folder: None,
            ..origin("")
        };
        assert_eq!(unknown.folder_beside(Path::new("results")), None);
    }

    #[test]
    fn times_are_civil_dates() {
        // From `date -u -d @N`: the epoch, a leap day, the end of a century that is a leap year,
        // the day after it.
        assert_eq!(rfc3339(0), "1970-01-01T00:00:00Z");
        assert_eq!(rfc3339(1_709_210_096), "2024-02-29T12:34:56Z");
        assert_eq!(rfc3339(951_827_199), "2000-02-29T12:26:39Z");
        assert_eq!(rfc3339(4_107_542_399), "2100-02-28T23:59:59Z");
        assert_eq!(rfc3339(4_107_542_400), "2100-03-01T00:00:00Z");
    }
}
