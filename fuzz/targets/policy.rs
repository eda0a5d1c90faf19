#![no_main]
//! A policy.

use mcpo_run::record::policy;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = mcpo_run_fuzz::file(bytes);
    let _ = policy::digest(&path);
    let _ = policy::read(&path);
});
