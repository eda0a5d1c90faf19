//! The part or variant of an experiment that a report covers.
//!
//! Owns the name of the report's folder and what its heading says. Knows nothing of runs. A part of
//! the file's runs gets a folder of its own, so that it never takes the place of the whole report.

use std::path::Path;

use super::ReportError;
use crate::plan::Selection;

/// The longest name of a folder, beyond which a digest stands for the rest.
const LONGEST: usize = 100;

/// The options that a report was requested with, as they were typed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Scope {
    /// `--only`: the selection of runs.
    pub only: Vec<String>,
    /// `--axis`: lists in place of the file's.
    pub axis: Vec<String>,
    /// `--set`: values in place of the file's.
    pub set: Vec<String>,
}

impl Scope {
    /// The selection of runs; `None` for all.
    ///
    /// # Errors
    ///
    /// `--only` cannot be understood.
    pub fn selection(&self) -> Result<Option<Selection>, ReportError> {
        Ok((!self.only.is_empty())
            .then(|| Selection::parse(&self.only.join(",")))
            .transpose()?)
    }

    /// The folder's name: `report`, followed by the options where there are any
    /// (`report-only-seed=0`).
    pub fn folder(&self) -> String {
        let parts = [("only", &self.only), ("axis", &self.axis)];
        let given = parts.iter().filter(|(_, values)| !values.is_empty());
        let text: String = given
            .map(|(option, values)| format!("-{option}-{}", values.join(",")))
            .collect();
        let safe: String = text
            .chars()
            .map(|c| {
                if c.is_ascii_alphanumeric() || "._-+=,".contains(c) {
                    c
                } else {
                    '_'
                }
            })
            .collect();
        if safe == text && safe.len() <= LONGEST {
            return format!("report{safe}");
        }
        let cut = &safe[..safe.len().min(LONGEST)];
        format!("report{cut}-{:08x}", checksum(&text))
    }

    /// The command that makes this report of `file` from what is recorded under `results`.
    pub fn command(&self, file: &Path, results: &Path) -> String {
        let quoted = |text: &str| match text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "._-+=,/".contains(c))
        {
            true => text.to_owned(),
            false => format!("'{}'", text.replace('\'', "'\\''")),
        };
        let options = [
            ("--only", &self.only),
            ("--axis", &self.axis),
            ("--set", &self.set),
        ];
        let options = options
            .iter()
            .flat_map(|(name, values)| values.iter().map(move |value| (*name, value.clone())));
        let results =
            (results != Path::new("results")).then(|| ("--results", results.display().to_string()));
        let options = options
            .chain(results)
            .map(|(name, value)| format!(" {name} {}", quoted(&value)));
        format!(
            "mcpo-run report {}{}",
            quoted(&file.display().to_string()),
            options.collect::<String>()
        )
    }

    /// `Of --only seed=0 --set budget.env_steps=100 alone.`; `None` for the file as it stands.
    pub fn heading(&self) -> Option<String> {
        let parts = [
            ("--only", &self.only),
            ("--axis", &self.axis),
            ("--set", &self.set),
        ];
        let options: Vec<String> = parts
            .iter()
            .flat_map(|(option, values)| {
                values.iter().map(move |value| format!("{option} {value}"))
            })
            .collect();
        (!options.is_empty())
            .then(|| format!("This report is of the file with {}.", options.join(" ")))
    }
}

/// FNV-1a (Fowler, Noll and Vo): enough to tell a few names apart.
fn checksum(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |sum: u32, byte| {
        (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn only(text: &str) -> Scope {
        Scope {
            only: vec![text.to_owned()],
            ..Scope::default()
        }
    }

    #[test]
    fn a_part_has_a_folder_of_its_own_and_the_file_has_the_plain_one() {
        assert_eq!(Scope::default().folder(), "report");
        assert_eq!(
            Scope {
                set: vec!["d=1".into()],
                ..Scope::default()
            }
            .folder(),
            "report",
            "these are all of its runs"
        );
        assert_eq!(
            only("seed=0,env=Hopper-v2").folder(),
            "report-only-seed=0,env=Hopper-v2"
        );
        let both = Scope {
            axis: vec!["seed=0,1".into()],
            ..only("seed=0")
        };
        assert_eq!(both.folder(), "report-only-seed=0-axis-seed=0,1");
    }

    #[test]
    fn folders_of_hostile_or_long_selections_stay_apart_and_inside() {
        let folders = ["../../x", "../..?x", "..\u{0}/x"].map(|text| only(text).folder());
        assert!(
            folders
                .iter()
                .all(|folder| folder.starts_with("report-only-") && !folder.contains(['/', '\0']))
        );
        assert_ne!(folders[0], folders[1]);
        let long = |end: &str| only(&format!("env={}{end}", "x".repeat(500))).folder();
        assert!(long("a") != long("b") && long("a").len() < 130);
    }

    #[test]
    fn the_heading_names_the_options() {
        assert_eq!(Scope::default().heading(), None);
        let scope = Scope {
            set: vec!["budget.env_steps=100".into()],
            ..only("seed=0")
        };
        assert_eq!(
            scope.heading().as_deref(),
            Some("This report is of the file with --only seed=0 --set budget.env_steps=100.")
        );
    }
}
