#![no_main]
//! A matrix file, up to the plan of its runs.

use std::path::Path;

use mcpo_run::{plan, spec};

libfuzzer_sys::fuzz_target!(|text: &str| {
    match spec::parse(Path::new("hostile.toml"), text, &spec::Overrides::default()) {
        Ok(spec) => drop(plan::plan(&spec)),
        Err(errors) => drop(errors.render(true)),
    }
});
