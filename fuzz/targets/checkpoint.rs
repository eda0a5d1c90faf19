#![no_main]
//! A checkpoint, as it is and as the payload of one whose digest is right.

use mcpo_run::record::Checkpoint;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Checkpoint::read(&mcpo_run_fuzz::file(bytes), "f");
    let head = format!("mcpo-run checkpoint 2\nf\n{}\n", blake3::hash(bytes).to_hex());
    let _ = Checkpoint::read(&mcpo_run_fuzz::file(&[head.as_bytes(), bytes].concat()), "f");
});
