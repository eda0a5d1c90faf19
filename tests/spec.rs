//! The matrix file.

use std::path::Path;

use mcpo_run::{
    plan::plan,
    spec::{self, Overrides},
};

#[test]
fn the_shipped_experiments_load_and_plan() {
    for (name, runs) in [("ablation", 35), ("smoke", 8), ("demos", 7)] {
        let path = Path::new("experiments").join(name).with_extension("toml");
        let spec = spec::load(&path, &Overrides::default()).expect("a shipped experiment is valid");
        let plan = plan(&spec).expect("and has a plan");
        assert_eq!(plan.len(), runs, "{name}");
    }
}
