#![no_main]
//! A table of results.

use mcpo_run::record::{compare, rows};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = mcpo_run_fuzz::file(bytes);
    let _ = rows::read_progress(&path);
    let _ = rows::read_evaluations(&path);
    let _ = rows::read_keys(&path);
    let _ = rows::read_stamp(&path);
    let _ = compare::tables(&path, &path, compare::Exactness::Bits);
});
