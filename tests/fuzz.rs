//! The targets of `fuzz/`, compiled without the fuzzer, so that none of them falls behind the
//! library; each is shown a few bytes of its kind.

use std::{collections::BTreeSet, fs, path::PathBuf, sync::LazyLock};

extern crate self as libfuzzer_sys;
extern crate self as mcpo_run_fuzz;

/// A target as a function of bytes.
#[macro_export]
macro_rules! fuzz_target {
    (|$bytes:ident: &[u8]| $body:block) => {
        pub fn run($bytes: &[u8]) $body
    };
    (|$text:ident: &str| $body:block) => {
        pub fn run(bytes: &[u8]) {
            if let Ok($text) = std::str::from_utf8(bytes) $body
        }
    };
}

/// As in `fuzz/src/lib.rs`.
pub fn file(bytes: &[u8]) -> PathBuf {
    static FOLDER: LazyLock<tempfile::TempDir> =
        LazyLock::new(|| tempfile::tempdir().expect("a folder"));
    let path = FOLDER.path().join("hostile");
    fs::write(&path, bytes).expect("written");
    path
}

macro_rules! targets {
    ($($name:ident in $path:literal;)*) => {
        $(
            #[path = $path]
            #[expect(unused_attributes, reason = "`no_main` is for the program that a target is on its own")]
            mod $name;
        )*
        const TARGETS: &[(&str, fn(&[u8]))] = &[$((stringify!($name), $name::run)),*];
    };
}

targets! {
    checkpoint in "../fuzz/targets/checkpoint.rs";
    demonstration in "../fuzz/targets/demonstration.rs";
    manifest in "../fuzz/targets/manifest.rs";
    matrix in "../fuzz/targets/matrix.rs";
    policy in "../fuzz/targets/policy.rs";
    results in "../fuzz/targets/results.rs";
}

#[test]
fn every_target_is_here_and_in_the_fuzzers_manifest() {
    let files: BTreeSet<String> = fs::read_dir("fuzz/targets")
        .expect("the targets are there")
        .map(|entry| {
            entry
                .expect("readable")
                .path()
                .file_stem()
                .expect("a name")
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    let here = TARGETS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(files, here);
    let manifest = fs::read_to_string("fuzz/Cargo.toml").expect("it is there");
    for name in files {
        assert!(
            manifest.contains(&format!("path = \"targets/{name}.rs\"")),
            "{name}"
        );
    }
}

#[test]
fn every_target_takes_what_it_is_shown() {
    let table = fs::read("tests/reference/pyarrow_snappy.parquet").expect("it is there");
    let matrix = fs::read("experiments/ci.toml").expect("it is there");
    for (_, run) in TARGETS {
        for bytes in [
            &b""[..],
            b"{}",
            b"PAR1PAR1",
            &table,
            &table[..table.len() / 2],
            &matrix,
        ] {
            run(bytes);
        }
    }
}
