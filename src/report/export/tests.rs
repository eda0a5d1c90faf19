//! What other programs are given; that they read it, `tests/report/read_exports.py` tries.

use std::path::Path;

use super::{tensorboard::crc32c, *};
use crate::{
    report::fixture,
    spec::{self, Overrides},
};

fn recorded(results: &Path) -> ExperimentSpec {
    let text = "name = \"made-up\"\ndescription = \"\"\nbudget.env_steps = 4096\n[[matrix]]\n\
        seed = [0, 1]\n\
        env = [\"Hopper-v2\", \"Ant-v2\"]\nalgorithm = [\"ppo\"]";
    for (env, seed, value) in [
        ("Hopper-v2", 0, 100.0),
        ("Hopper-v2", 1, 200.0),
        ("Ant-v2", 0, 300.0),
    ] {
        let run = fixture::ppo(env, seed)
            .budget(4096)
            .finished(&[(50, &[1.0, 3.0]), (100, &[value])]);
        fixture::record(&run.progress("kl", &[(50, 0.25), (100, 0.5)]), results);
    }
    spec::parse(Path::new("made-up.toml"), text, &Overrides::default()).expect("a valid file")
}

fn read(files: &[PathBuf], name: &str) -> Vec<u8> {
    let file = files
        .iter()
        .find(|file| file.ends_with(name))
        .unwrap_or_else(|| panic!("{name} of {files:?}"));
    fs::read(file).expect("readable")
}

/// RFC 3720, B.4, and the check value of every list of such sums.
#[test]
fn checksums_are_castagnolis() {
    assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
    assert_eq!(crc32c(b"123456789"), 0xe306_9283);
}

#[test]
fn a_seed_that_did_not_finish_everywhere_is_no_row_and_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let spec = recorded(folder.path());
    let formats = [Format::Rliable, Format::MarlEval, Format::Csv, Format::Json];
    let files = export(&spec, folder.path(), &Scope::default(), &formats).expect("written");
    let json = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&read(&files, name)).expect("JSON")
    };
    let rliable = json("rliable.json");
    assert_eq!(
        rliable["environments"]["ppo"],
        serde_json::json!(["Ant-v2", "Hopper-v2"])
    );
    assert_eq!(
        rliable["returns"]["ppo"],
        serde_json::json!([[300.0, 100.0]])
    );
    assert_eq!(
        rliable["left_out"],
        serde_json::json!(["ppo, seed 1: not in all environments"])
    );
    let marl = json("marl-eval.json");
    let hopper = &marl["made-up"]["Hopper-v2"]["ppo"]["seed_1"];
    assert_eq!(
        hopper["step_0"],
        serde_json::json!({"step_count": 50, "mean_episode_return": [2.0]})
    );
    assert_eq!(
        hopper["absolute_metrics"],
        serde_json::json!({"mean_episode_return": [200.0]})
    );
    let rows = String::from_utf8(read(&files, "evaluations.csv")).expect("text");
    assert_eq!(rows.lines().count(), 1 + 3 * 3);
    assert!(rows.contains("Hopper-v2,ppo,ppo,1,100,true,200"), "{rows}");
    let curves = &json("returns.json")["panels"];
    assert_eq!(
        curves[0]["curves"][0]["seeds"],
        serde_json::json!({"0": [2.0, 100.0], "1": [2.0, 200.0]}),
        "{curves}"
    );
}

#[test]
fn an_export_replaces_the_one_before() {
    let folder = tempfile::tempdir().expect("a folder");
    let spec = recorded(folder.path());
    let export =
        |format| export(&spec, folder.path(), &Scope::default(), &[format]).expect("written");
    let (events, other) = (export(Format::Tensorboard), export(Format::Csv));
    assert_eq!((events.len(), other.len()), (3, 1));
    assert!(events.iter().all(|file| !file.exists()) && other[0].exists());
}
