//! Finds the models that are embedded and lets the binary find MuJoCo wherever it is started from.

use std::{env, path::Path};

fn main() {
    println!("cargo::rerun-if-changed=third_party/fetched");
    println!("cargo::rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    // The last that was added stands for all.
    if !Path::new("third_party/models/humanoid.xml").exists() {
        println!(
            "cargo::error=third_party/models is not there yet: run `make setup` first (it fetches MuJoCo and the models)"
        );
    }
    if let Ok(folder) = env::var("MUJOCO_DYNAMIC_LINK_DIR") {
        // Beside the binary first, so that a binary shipped with its library works, then where it
        // was linked.
        println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN:{folder}");
    }
}
