//! `[slurm]`: the resources that `mcpo-run submit` asks a cluster for. No run depends on it.

use serde::{Deserialize, Serialize};

use crate::quantity::{Count, constant};

/// `[slurm]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slurm {
    /// The partition; the cluster's default when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub partition: Option<Name>,
    /// The account that is charged; the user's default when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub account: Option<Name>,
    /// The time limit of an element, as Slurm writes it: `90` (minutes), `4:00:00` or `2-12` (days
    /// and hours); the partition's when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub time: Option<Time>,
    /// The memory of an element, such as `2G`; the cluster's default when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub memory: Option<Memory>,
    /// Cores of an element, which its runs share. Default 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub cpus: Option<Count>,
    /// The most elements that run at a time; no limit when absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub throttle: Option<Count>,
    /// Runs of an element. Default 1.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub pack: Option<Count>,
    /// Seconds before the time limit at which runs write a checkpoint and stop, to resume when the
    /// element is started again. Default 120.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub grace: Option<Count>,
    /// Other options of `sbatch`, such as `["--constraint=avx512", "--exclusive"]`.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub sbatch: Vec<SbatchOption>,
}

impl Slurm {
    /// A valid value, every key given.
    pub(super) fn specimen() -> Self {
        Self {
            partition: Some(Name("p".to_owned())),
            account: Some(Name("a".to_owned())),
            time: Some(Time("1:00:00".to_owned())),
            memory: Some(Memory("2G".to_owned())),
            cpus: Some(constant(1)),
            throttle: Some(constant(1)),
            pack: Some(constant(1)),
            grace: Some(constant(120)),
            sbatch: vec![SbatchOption("--exclusive".to_owned())],
        }
    }
}

/// Defines a type for texts that `$is` accepts.
/// A text that is none of what is expected in its place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{}` is not {expected}", text.escape_debug())]
pub struct NotOne {
    text: String,
    expected: String,
}

macro_rules! text {
    ($(#[$docs:meta])* $name:ident, $is:expr, $expected:expr) => {
        $(#[$docs])*
        #[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
        #[serde(try_from = "String", into = "String")]
        #[schemars(with = "String")]
        pub struct $name(String);

        impl $name {
            /// The text as it was written.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl TryFrom<String> for $name {
            type Error = NotOne;

            fn try_from(text: String) -> Result<Self, NotOne> {
                let is: fn(&str) -> bool = $is;
                let is_line =
                    !text.chars().any(char::is_control) && (1..=1000).contains(&text.len());
                if is_line && is(&text) {
                    Ok(Self(text))
                } else {
                    Err(NotOne { text, expected: $expected.into() })
                }
            }
        }

        impl std::str::FromStr for $name {
            type Err = NotOne;

            fn from_str(text: &str) -> Result<Self, NotOne> {
                text.to_owned().try_into()
            }
        }

        impl From<$name> for String {
            fn from($name(text): $name) -> Self {
                text
            }
        }
    };
}

text! {
    /// The name of something in the cluster.
    Name, |_| true, "a name: one line of at most 1000 bytes"
}

text! {
    /// A time limit as Slurm writes it.
    Time, is_time, "a time as Slurm writes it, such as 90 (minutes), 4:00:00 or 2-12:00:00"
}

text! {
    /// An amount of memory as Slurm writes it.
    Memory, is_memory, "an amount of memory such as 500M or 2G"
}

text! {
    /// One option of `sbatch` with its value.
    SbatchOption, is_free,
    format!(
        "an option of sbatch such as --constraint=avx512; these are set by the program: {}",
        OWN.join(", ")
    )
}

/// The options of `sbatch` that the program sets itself.
const OWN: [&str; 13] = [
    "--array",
    "--chdir",
    "--comment",
    "--dependency",
    "--error",
    "--input",
    "--job-name",
    "--no-requeue",
    "--open-mode",
    "--output",
    "--parsable",
    "--signal",
    "--wrap",
];

fn is_free(text: &str) -> bool {
    let name = text.split('=').next().unwrap_or_default();
    let letters = name.strip_prefix("--").unwrap_or_default();
    let is_name = letters.starts_with(|c: char| c.is_ascii_lowercase())
        && letters
            .chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
    // sbatch accepts the beginning of an option's name for the whole name.
    is_name && !OWN.iter().any(|own| own.starts_with(name))
}

fn is_time(text: &str) -> bool {
    let (days, time) = text
        .split_once('-')
        .map_or(("0", text), |(days, time)| (days, time));
    let is_number =
        |text: &str| (1..=9).contains(&text.len()) && text.bytes().all(|c| c.is_ascii_digit());
    is_number(days) && time.split(':').count() <= 3 && time.split(':').all(is_number)
}

fn is_memory(text: &str) -> bool {
    let number = text.strip_suffix(['K', 'M', 'G', 'T']).unwrap_or(text);
    (1..=15).contains(&number.len()) && number.bytes().all(|c| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_memory_are_slurms() {
        for text in ["90", "4:00:00", "90:30", "2-12", "2-12:30", "2-12:30:00"] {
            assert!(text.parse::<Time>().is_ok(), "{text}");
        }
        for text in [
            "", "2h", "1:2:3:4", "-1", "1-", ":1", "1 ", "90\n", "$(date)",
        ] {
            assert!(text.parse::<Time>().is_err(), "{text}");
        }
        assert!(
            ["500M", "2G", "1024"]
                .iter()
                .all(|text| text.parse::<Memory>().is_ok())
        );
        assert!(
            ["", "G", "2GB", "-2G", "2 G", "2G\n--wrap=x"]
                .iter()
                .all(|text| text.parse::<Memory>().is_err())
        );
    }

    #[test]
    fn other_options_are_options_and_none_of_the_programs_own() {
        for text in [
            "--constraint=avx512",
            "--exclusive",
            "--gres=gpu:1",
            "--mail-type=END,FAIL",
            "--reservation=$(x)",
        ] {
            assert!(text.parse::<SbatchOption>().is_ok(), "{text}");
        }
        for text in [
            "",
            "-p x",
            "--",
            "x",
            "--array=0-3",
            "--arr=0-3",
            "--wrap=x",
            "--a b",
            "--exclusive\n--wrap=x",
            "--X",
        ] {
            assert!(text.parse::<SbatchOption>().is_err(), "{text}");
        }
    }
}
