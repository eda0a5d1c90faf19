#![no_main]
//! run.json.

use mcpo_run::record::Manifest;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Manifest::read(&mcpo_run_fuzz::file(bytes));
});
