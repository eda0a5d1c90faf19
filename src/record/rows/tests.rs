//! Tests of the rows of results, and rows for the tests of others.

use super::*;
use crate::{algo::Update, plan::AxisValue, record::Build};

/// A row with numbers that text would not keep.
pub(crate) fn iteration(n: u64) -> Iteration {
    let update = Update {
        kl: Some(0.1 + 0.2),
        case: (n % 2 == 1).then(|| "active".to_owned()),
        cg_iterations: Some(n),
        mmd: Some(f64::MIN_POSITIVE / 3.0),
        d: Some(1e-3),
        ..Update::default()
    };
    Iteration {
        iteration: n,
        env_steps: n * 100,
        episodes: 3,
        dense_return: (n > 1).then_some(-1.0 / 3.0),
        training_return: None,
        episode_length: Some(12.5),
        update,
        physics_seconds: 0.125,
        rollout_seconds: 0.25,
        update_seconds: 0.5,
    }
}

pub(crate) fn episode(n: u64) -> EvaluationEpisode {
    EvaluationEpisode {
        env_steps: 100,
        last: n > 0,
        episode: n,
        dense_return: 0.1,
        training_return: 1.0,
        length: 7,
    }
}

pub(crate) fn stamp() -> Stamp {
    let spec = serde_json::json!({ "id": "a/b" });
    Stamp {
        spec,
        fingerprint: "f".to_owned(),
        demonstration: None,
        demonstrated: None,
        build: Build::current(serde_json::Value::Null),
        origin: None,
    }
}

pub(crate) fn keys(d: Option<f64>) -> Keys {
    Keys {
        experiment: "e".to_owned(),
        run: "a/b".to_owned(),
        env: "Hopper-v2".to_owned(),
        algorithm: "mcpo".to_owned(),
        d,
        epsilon: None,
        seed: u64::MAX,
        axes: BTreeMap::from([
            ("mcpo.max_kl".to_owned(), AxisValue::Number(d)),
            (
                "ppo.normalize_advantages".to_owned(),
                AxisValue::Truth(Some(true)),
            ),
            (
                "reward".to_owned(),
                AxisValue::Text(Some("dense".to_owned())),
            ),
            ("rollout.steps".to_owned(), AxisValue::Whole(Some(2048))),
        ]),
    }
}

#[test]
fn any_parameter_can_be_an_axis_beside_the_row_and_comes_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut keys = keys(Some(1e-3));
    let names = crate::spec::Parameter::names().into_iter();
    keys.axes = names
        .map(|name| (name, AxisValue::Number(Some(0.5))))
        .collect();
    assert!(
        keys.axes.contains_key("cg_iterations"),
        "MCPO bounds what a column counts"
    );
    let (progress, evaluations) = (
        folder.path().join("p.parquet"),
        folder.path().join("e.parquet"),
    );
    write_progress(&progress, &keys, &stamp(), &[iteration(1)]).expect("written");
    write_evaluations(&evaluations, &keys, &stamp(), &[episode(0)]).expect("written");
    assert_eq!(
        read_progress(&progress).expect("readable"),
        [iteration(1)],
        "an axis took a quantity's place"
    );
    assert_eq!(
        read_evaluations(&evaluations).expect("readable"),
        [episode(0)]
    );
    assert_eq!(
        [read_keys(&progress), read_keys(&evaluations)].map(|read| read.expect("readable")),
        [keys.clone(), keys]
    );
}

#[test]
fn what_is_no_table_of_results_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("progress.parquet");
    assert!(
        read_progress(&path)
            .expect_err("absent")
            .to_string()
            .contains("progress.parquet")
    );
    std::fs::write(&path, b"PAR1 no").expect("written");
    assert!(read_progress(&path).is_err() && read_stamp(&path).is_err());
    write_evaluations(&path, &keys(None), &stamp(), &[episode(0)]).expect("written");
    assert!(
        read_progress(&path)
            .expect_err("other columns")
            .to_string()
            .contains("iteration")
    );
}

#[test]
fn a_changed_byte_is_refused_or_gives_other_rows_but_no_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("p.parquet");
    write_progress(
        &path,
        &keys(Some(1e-3)),
        &stamp(),
        &[iteration(1), iteration(2)],
    )
    .expect("written");
    let whole = std::fs::read(&path).expect("readable");
    let mut refused = 0;
    for place in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[place] ^= [0x01, 0x10, 0x80, 0xff][place % 4];
        std::fs::write(&path, bytes).expect("written");
        let read = [
            read_progress(&path).is_ok(),
            read_keys(&path).is_ok(),
            read_numbers(&path, progress::COLUMNS).is_ok(),
        ];
        refused += usize::from(read != [true; 3]);
    }
    assert!(refused > whole.len() / 8, "{refused} of {}", whole.len());
}

#[test]
fn rows_and_keys_and_stamp_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let (progress, evaluations) = (
        folder.path().join("p.parquet"),
        folder.path().join("e.parquet"),
    );
    let rows: Vec<_> = (1..=5).map(iteration).collect();
    let episodes: Vec<_> = (0..4).map(episode).collect();
    write_progress(&progress, &keys(Some(1e-3)), &stamp(), &rows).expect("written");
    write_evaluations(&evaluations, &keys(None), &stamp(), &episodes).expect("written");
    assert_eq!(read_progress(&progress).expect("readable"), rows);
    assert_eq!(read_evaluations(&evaluations).expect("readable"), episodes);
    assert_eq!(read_keys(&progress).expect("readable"), keys(Some(1e-3)));
    assert_eq!(read_keys(&evaluations).expect("readable"), keys(None));
    assert_eq!(read_stamp(&progress).expect("readable"), stamp());
}

#[test]
fn every_file_has_the_same_columns_of_the_same_types() {
    let bare = Iteration {
        update: Update::default(),
        dense_return: None,
        episode_length: None,
        ..iteration(1)
    };
    let full = to_frame(progress::COLUMNS, &keys(Some(1.0)), &[iteration(1)]).expect("a frame");
    for rows in [vec![], vec![bare]] {
        let frame = to_frame(progress::COLUMNS, &keys(None), &rows).expect("a frame");
        assert_eq!(frame.schema(), full.schema());
    }
    assert_eq!(
        full.column("recovery_steps").expect("a column").dtype(),
        &polars::prelude::DataType::UInt64
    );
    let none = to_frame(evaluations::COLUMNS, &keys(None), &[]).expect("a frame");
    assert_eq!(
        none.schema(),
        to_frame(evaluations::COLUMNS, &keys(Some(1.0)), &[episode(1)])
            .expect("a frame")
            .schema()
    );
}
