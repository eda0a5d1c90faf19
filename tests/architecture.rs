//! The direction of the arrows: which module may use which.
//!
//! The table is the design's, with these deviations. `arithmetic`, the products and elementary
//! functions at the machine's rate, `escape`, text from outside made harmless for where it is
//! shown, `fit`, TOML values read into types, `intake`, files from outside, and `parquet`, the
//! reader of tables that believes none of their claims, are bottom modules of their own. `measured`, the rows and the catalogue of their
//! columns, stands below `spec`, which asks it what can be drawn. `plan` uses `env`, since a run
//! holds its environment and its reward. `record` and `schedule` use what rows and policies are
//! made of, since they are `train`'s sink, and `schedule` reads demonstrations before anything
//! starts. `bench`, which measures training, stands beside `schedule`. `report` uses `plan` and
//! `env`, since selections and recorded runs are theirs, `rng` for what it resamples, and `solver`
//! for the sketch of its step.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use mcpo_run::algo::{catalogue, revision::Part};

/// Each module with those that it may use.
const MAY_USE: &[(&str, &[&str])] = &[
    ("rng", &[]),
    ("quantity", &[]),
    ("escape", &[]),
    ("fit", &[]),
    ("intake", &[]),
    ("parquet", &[]),
    ("arithmetic", &[]),
    ("solver", &["arithmetic", "quantity"]),
    ("stats", &["rng"]),
    ("nn", &["arithmetic", "solver", "quantity", "rng"]),
    ("env", &["intake", "quantity", "rng"]),
    (
        "demo",
        &["arithmetic", "env", "intake", "parquet", "quantity", "rng"],
    ),
    (
        "algo",
        &[
            "arithmetic",
            "demo",
            "env",
            "fit",
            "nn",
            "solver",
            "quantity",
            "rng",
        ],
    ),
    ("measured", &["algo"]),
    (
        "spec",
        &[
            "algo", "demo", "env", "fit", "intake", "measured", "nn", "quantity", "rng",
        ],
    ),
    ("plan", &["env", "spec", "quantity", "rng"]),
    (
        "train",
        &[
            "algo",
            "arithmetic",
            "demo",
            "env",
            "measured",
            "nn",
            "plan",
            "quantity",
            "rng",
            "solver",
            "spec",
            "stats",
        ],
    ),
    (
        "record",
        &[
            "algo", "env", "intake", "measured", "nn", "parquet", "plan", "quantity", "rng",
            "train",
        ],
    ),
    (
        "schedule",
        &[
            "algo",
            "arithmetic",
            "demo",
            "env",
            "escape",
            "intake",
            "plan",
            "record",
            "train",
        ],
    ),
    (
        "bench",
        &[
            "algo",
            "arithmetic",
            "demo",
            "env",
            "plan",
            "quantity",
            "record",
            "rng",
            "spec",
            "train",
        ],
    ),
    (
        "report",
        &[
            "env", "escape", "measured", "plan", "record", "rng", "solver", "spec", "stats",
        ],
    ),
    (
        "cli",
        &[
            "algo",
            "arithmetic",
            "bench",
            "demo",
            "env",
            "escape",
            "nn",
            "plan",
            "quantity",
            "record",
            "report",
            "rng",
            "schedule",
            "solver",
            "spec",
            "stats",
            "train",
        ],
    ),
];

/// What `algo` may name of `env`: it never steps one.
const SPACES: [&str; 2] = ["EnvId", "Spaces"];

/// Crates that could be replaced: the one place that names each.
const NAMED_ONCE: [(&str, &str); 3] = [
    ("mujoco_rs", "env/mujoco"),
    ("figment", "spec/layers"),
    ("plotters", "report/figure"),
];

/// Names that say nothing.
const EMPTY_NAMES: [&str; 7] = [
    "utils", "util", "common", "helpers", "types", "core", "manager",
];

/// A source file that is not for tests alone: its module path and its text without comments and
/// tests.
struct Source {
    path: PathBuf,
    module: Vec<String>,
    code: String,
}

fn sources() -> Vec<Source> {
    let mut files = Vec::new();
    collect(Path::new("src"), &mut files);
    let mut tests = BTreeSet::new();
    let mut sources: Vec<Source> = files
        .into_iter()
        .map(|path| {
            let module = path
                .strip_prefix("src")
                .expect("it was found there")
                .with_extension("");
            let module: Vec<String> = module
                .iter()
                .map(|part| part.to_string_lossy().into_owned())
                .filter(|part| part != "mod")
                .collect();
            let (code, test_files) =
                code(&fs::read_to_string(&path).expect("a source file can be read"));
            tests.extend(
                test_files
                    .into_iter()
                    .map(|name| [module.as_slice(), &[name]].concat()),
            );
            Source { path, module, code }
        })
        .collect();
    sources.retain(|source| {
        !(0..=source.module.len()).any(|length| tests.contains(&source.module[..length]))
    });
    sources
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the sources are there") {
        let path = entry.expect("their entries can be read").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// `text` without its tests and line comments, and the names of the files beside it that are for
/// tests alone.
///
/// Tests within a file stand at its end; the line `mod tests;` may stand anywhere.
fn code(text: &str) -> (String, Vec<String>) {
    let mut lines = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default().trim_end());
    let (mut code, mut test_files) = (Vec::new(), Vec::new());
    while let Some(line) = lines.next() {
        let tests = if line.trim_start() == "#[cfg(test)]" {
            lines.next()
        } else {
            None
        };
        let name = tests
            .and_then(|item| item.rsplit_once("mod "))
            .map(|(_, name)| name);
        match name {
            Some(name) if name.ends_with('{') => break,
            Some(name) => test_files.push(name.trim_end_matches(';').to_owned()),
            None => code.extend([Some(line), tests].into_iter().flatten()),
        }
    }
    (code.join("\n"), test_files)
}

/// The paths that begin at `start` in `code`, which stands behind a `::`: one, or those between
/// braces.
fn paths(code: &str) -> Vec<String> {
    let Some(inside) = code.strip_prefix('{') else {
        let end = code
            .find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'))
            .unwrap_or(code.len());
        let path = code[..end].trim_end_matches(':').to_owned();
        // `env::{EnvId, Reward}` is two paths.
        return match code[end..].strip_prefix('{') {
            Some(_) if code[..end].ends_with("::") => paths(&code[end..])
                .into_iter()
                .map(|inner| format!("{path}::{inner}"))
                .collect(),
            _ => vec![path],
        };
    };
    let mut depth = 0;
    let mut all = Vec::new();
    let mut start = 0;
    for (at, c) in inside.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' if depth == 0 => {
                all.extend(paths(inside[start..at].trim()));
                start = at + 1;
            }
            '}' => {
                all.extend(paths(inside[start..at].trim()));
                break;
            }
            _ => {}
        }
    }
    all.retain(|path| !path.is_empty());
    all
}

/// Every path that a source takes from the root of the crate.
fn from_root(source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in source.code.match_indices("crate::") {
        found.extend(paths(&source.code[at + "crate::".len()..]));
    }
    let climb = "super::".repeat(source.module.len());
    for (at, _) in source.code.match_indices(&climb) {
        // A longer chain would be found at each of its steps.
        if !source.code[..at].ends_with("super::") {
            found.extend(paths(&source.code[at + climb.len()..]));
        }
    }
    found
}

#[test]
fn modules_use_only_what_their_row_allows() {
    let mut wrong = BTreeSet::new();
    for source in sources()
        .iter()
        .filter(|source| !["lib", "main"].contains(&source.module[0].as_str()))
    {
        let own = source.module[0].as_str();
        let Some((_, allowed)) = MAY_USE.iter().find(|(module, _)| *module == own) else {
            wrong.insert(format!(
                "{}: the module `{own}` has no row",
                source.path.display()
            ));
            continue;
        };
        for path in from_root(source) {
            let mut parts = path.split("::");
            let used = parts.next().unwrap_or_default();
            if used != own && !allowed.contains(&used) {
                wrong.insert(format!("{}: {own} -> {used}", source.path.display()));
            }
            if own == "algo"
                && used == "env"
                && !parts.next().is_some_and(|name| SPACES.contains(&name))
            {
                wrong.insert(format!(
                    "{}: algo may not name {path}",
                    source.path.display()
                ));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "not allowed:\n{}",
        wrong.into_iter().collect::<Vec<_>>().join("\n")
    );
}

#[test]
fn a_crate_that_could_be_replaced_is_named_in_one_place() {
    for (name, place) in NAMED_ONCE {
        for source in sources() {
            let module = source.module.join("/");
            let names = source.code.contains(&format!("{name}::"));
            assert!(
                !names || module.starts_with(place),
                "{} names {name}, which is {place}'s",
                source.path.display()
            );
        }
    }
}

#[test]
fn no_module_has_a_name_that_says_nothing() {
    for source in sources() {
        for part in &source.module {
            assert!(
                !EMPTY_NAMES.contains(&part.as_str()),
                "{}",
                source.path.display()
            );
        }
    }
}

#[test]
fn the_rows_lead_downwards() {
    // Each module may use only those above it in the table, so there is no circle.
    for (index, (module, allowed)) in MAY_USE.iter().enumerate() {
        for used in *allowed {
            assert!(
                MAY_USE[..index].iter().any(|(above, _)| above == used),
                "{module} -> {used}"
            );
        }
    }
}

#[test]
fn every_form_of_a_path_is_read() {
    let read = |module: &[&str], text: &str| {
        let module = module.iter().map(|part| (*part).to_owned()).collect();
        from_root(&Source {
            path: PathBuf::new(),
            module,
            code: code(text).0,
        })
    };
    assert_eq!(read(&["a"], "use crate::env::EnvId;"), ["env::EnvId"]);
    assert_eq!(read(&["a"], "let x = crate::rng::Seed(1);"), ["rng::Seed"]);
    assert_eq!(
        read(
            &["a"],
            "use crate::{\n    env::{EnvId, Reward},\n    nn,\n    rng::Seed,\n};"
        ),
        ["env::EnvId", "env::Reward", "nn", "rng::Seed"]
    );
    assert_eq!(
        read(&["a", "b"], "use super::super::env::{EnvId}; use super::c;"),
        ["env::EnvId"]
    );
    assert_eq!(
        read(
            &["a"],
            "// use crate::nn;\n#[cfg(test)]\nmod tests {\n    use crate::nn;\n}"
        ),
        Vec::<String>::new()
    );
    assert_eq!(
        read(
            &["a"],
            "#[cfg(test)]\nmod tests;\nuse crate::nn;\n#[cfg(test)]\nuse crate::rng;"
        ),
        ["nn", "rng"]
    );
    assert_eq!(code("mod a;\n#[cfg(test)]\npub(crate) mod b;").1, ["b"]);
}

/// What a part of `algo` takes from another without depending on its numbers.
const TAKES: [(&str, &str); 2] = [
    ("cloning", "critic"), // puts rows side by side
    ("gail", "pofd"),      // the choice between two updates
];

/// What of `algo` has no revision: what computes nothing, and `tolerance`, which is MCPO's alone
/// and counts as its own.
const UNCOUNTED: [&str; 9] = [
    "algorithm",
    "batch",
    "catalogue",
    "definition",
    "operations",
    "random",
    "revision",
    "stopwatch",
    "tolerance",
];

/// The parts of all algorithms, by name.
fn parts() -> BTreeMap<&'static str, &'static Part> {
    let mut parts = BTreeMap::new();
    let mut wanted: Vec<&Part> = catalogue::all()
        .filter_map(|entry| entry.about().part)
        .collect();
    while let Some(part) = wanted.pop() {
        parts.insert(part.name, part);
        wanted.extend(part.uses);
    }
    parts
}

#[test]
fn a_part_of_an_algorithm_counts_what_it_uses_into_its_revision() {
    let parts = parts();
    for source in sources()
        .iter()
        .filter(|source| source.module[0] == "algo" && source.module.len() == 2)
    {
        let own = source.module[1].as_str();
        let Some(part) = parts.get(own) else {
            assert!(UNCOUNTED.contains(&own), "{own} counts into no revision");
            continue;
        };
        let uses: BTreeSet<&str> = part.uses.iter().map(|part| part.name).collect();
        let taken = TAKES
            .iter()
            .filter(|(user, _)| *user == own)
            .map(|(_, taken)| *taken);
        let mut used: BTreeSet<String> = BTreeSet::new();
        for (at, _) in source.code.match_indices("super::") {
            let first = |path: String| path.split("::").next().unwrap_or_default().to_owned();
            used.extend(
                paths(&source.code[at + "super::".len()..])
                    .into_iter()
                    .map(first),
            );
        }
        let found: BTreeSet<&str> = used
            .iter()
            .map(String::as_str)
            .filter(|name| parts.contains_key(name))
            .collect();
        assert_eq!(
            found,
            uses.iter().copied().chain(taken).collect(),
            "what {own} uses"
        );
    }
}
