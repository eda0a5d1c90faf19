#![no_main]
//! A demonstration: Parquet, pickle or .npz, by its first bytes.

use mcpo_run::{
    demo::{Demonstration, import},
    env::EnvId,
};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = mcpo_run_fuzz::file(bytes);
    let _ = Demonstration::read(&path);
    let _ = import::import(&path, EnvId::InvertedPendulum);
});
