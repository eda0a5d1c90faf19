//! The Parquet format, there and back, and what is refused.

use std::fs;

use polars::prelude::{Column, DataFrame, IntoColumn, NamedFrom, ParquetWriter, Series};
use tempfile::TempDir;

use super::*;

/// Three episodes of 3, 1 and 2 steps.
fn example() -> Demonstration {
    Demonstration {
        observations: DMatrix::from_fn(4, 6, |i, j| (i as f64 + 0.1).powi(j as i32) / 3.0),
        actions: DMatrix::from_fn(1, 6, |_, j| -(j as f64)),
        rewards: Some(vec![1.0, 0.5, -2.0, 0.25, 1e-300, 4.0]),
        episode_starts: vec![0, 3, 4],
        terminated: vec![false, false, true, false, false, false],
        truncated: vec![false, false, false, true, false, false],
        poses: Some(
            (0..6)
                .map(|j| Pose {
                    qpos: vec![f64::from(j), 2.0],
                    qvel: vec![0.1, -f64::from(j)],
                })
                .collect(),
        ),
        provenance: vec![
            ("environment".into(), "InvertedPendulum-v2".into()),
            ("seed".into(), "3".into()),
        ],
    }
}

/// The message of reading what `change` makes of the example's columns.
fn refusal(change: impl FnOnce(&mut Vec<Column>)) -> String {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("demo.parquet");
    let mut columns = example().to_frame().expect("a frame").into_columns();
    change(&mut columns);
    let mut frame = DataFrame::new_infer_height(columns).expect("columns of one length");
    ParquetWriter::new(fs::File::create(&path).expect("a file"))
        .finish(&mut frame)
        .expect("it is written");
    let message = Demonstration::read(&path)
        .expect_err("it must be refused")
        .to_string();
    assert!(message.contains("demo.parquet"), "{message}");
    message
}

/// Puts `column` in the place of the one of its name.
fn replace(columns: &mut [Column], column: Column) {
    let place = columns
        .iter_mut()
        .find(|old| old.name() == column.name())
        .expect("a column of that name");
    *place = column;
}

fn lists(name: &str, rows: [&[f64]; 6]) -> Column {
    let rows: Vec<Series> = rows
        .iter()
        .map(|row| Series::new("".into(), *row))
        .collect();
    Series::new(name.into(), rows).into_column()
}

#[test]
fn columns_that_are_missing_or_wrong_are_named() {
    for name in [
        "episode",
        "step",
        "observation",
        "action",
        "terminated",
        "truncated",
        "qvel",
    ] {
        let message = refusal(|columns| columns.retain(|column| column.name() != name));
        assert!(
            message.contains(&format!("no column `{name}`")),
            "{message}"
        );
    }
    let message = refusal(|columns| replace(columns, Column::new("observation".into(), [1.0; 6])));
    assert!(
        message.contains("`observation` holds f64; expected a list of f64"),
        "{message}"
    );
    let message = refusal(|columns| replace(columns, Column::new("reward".into(), ["a"; 6])));
    assert!(
        message.contains("`reward` holds text or bytes; expected f64"),
        "{message}"
    );
    let message = refusal(|columns| replace(columns, Column::new("step".into(), [0.5; 6])));
    assert!(
        message.contains("`step` holds f64; expected a whole number"),
        "{message}"
    );
    let message = refusal(|columns| replace(columns, Column::new("truncated".into(), [0i64; 6])));
    assert!(
        message.contains("`truncated` holds i64; expected bool"),
        "{message}"
    );
}

#[test]
fn values_that_are_missing_ragged_or_not_finite_are_refused() {
    let message = refusal(|columns| {
        let reward = Series::new(
            "reward".into(),
            [Some(1.0), None, Some(1.0), None, None, None],
        );
        replace(columns, reward.into_column());
    });
    assert!(message.contains("`reward` has gaps"), "{message}");
    let message = refusal(|columns| {
        replace(
            columns,
            lists(
                "action",
                [&[1.0], &[1.0], &[1.0, 2.0], &[1.0], &[1.0], &[1.0]],
            ),
        );
    });
    assert!(
        message.contains("`action` has 2 numbers in row 2 and 1 before"),
        "{message}"
    );
    for bad in [f64::NAN, f64::INFINITY] {
        for name in ["action", "qpos"] {
            let message = refusal(|columns| {
                replace(
                    columns,
                    lists(name, [&[1.0], &[bad], &[1.0], &[1.0], &[1.0], &[1.0]]),
                )
            });
            assert!(
                message.contains(name) && message.contains("not finite"),
                "{message}"
            );
        }
    }
    let message = refusal(|columns| replace(columns, lists("action", [&[]; 6])));
    assert!(
        message.contains("`action` has gaps or empty lists"),
        "{message}"
    );
    let message = refusal(|columns| {
        columns
            .iter_mut()
            .for_each(|column| *column = column.head(Some(0)))
    });
    assert!(message.contains("no steps"), "{message}");
}

#[test]
fn torn_episodes_are_refused() {
    for (name, values, says) in [
        (
            "episode",
            [0i64, 1, 0, 2, 3, 3],
            "episode 0 comes after episode 1 in row 2",
        ),
        (
            "episode",
            [0, 0, 0, 0, 2, 2],
            "row 3 is step 0 of episode 0; expected step 3",
        ),
        (
            "step",
            [0, 1, 3, 0, 0, 1],
            "row 2 is step 3 of episode 0; expected step 2",
        ),
        (
            "step",
            [1, 2, 3, 0, 0, 1],
            "row 0 is step 1 of episode 0; expected step 0",
        ),
    ] {
        // The first kind also breaks `step`; what is said is what was found first.
        let message = refusal(|columns| replace(columns, Column::new(name.into(), values)));
        assert!(
            message.contains(says) || message.contains("row 1 is step 1 of episode 1"),
            "{message}"
        );
    }
    let ends = [true, false, false, false, false, false];
    let message = refusal(|columns| replace(columns, Column::new("terminated".into(), ends)));
    assert!(
        message.contains("row 0 ends its episode, but row 1 continues"),
        "{message}"
    );
}

#[test]
fn what_is_no_file_or_no_parquet_is_refused() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("demo.parquet");
    let refused = |what: &str| {
        let message = Demonstration::read(&path).expect_err(what).to_string();
        assert!(message.contains("demo.parquet"), "{message}");
    };
    refused("a missing file");
    for bytes in [
        &b""[..],
        b"PAR1",
        b"PAR1PAR1",
        b"PAR1\xff\xff\xff\x7fPAR1",
        &[0; 4096],
        b"step,reward\n0,1\n",
    ] {
        fs::write(&path, bytes).expect("written");
        refused("no Parquet");
    }
    fs::remove_file(&path).expect("removed");
    fs::create_dir(&path).expect("a folder");
    refused("a folder");
}

#[test]
fn damaged_files_never_panic() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("demo.parquet");
    example().write(&path).expect("written");
    let pyarrow = include_bytes!("../../tests/reference/pyarrow_v2_zstd.parquet");
    for whole in [fs::read(&path).expect("read"), pyarrow.to_vec()] {
        for length in (0..whole.len()).step_by(5) {
            assert!(
                parquet::from_bytes(whole[..length].to_vec()).is_err(),
                "{length} of {} bytes",
                whole.len()
            );
        }
        let mut refused = 0;
        for place in (0..whole.len()).step_by(2) {
            let mut bytes = whole.clone();
            bytes[place] ^= [0x01, 0x10, 0x80, 0xff][place / 2 % 4];
            refused += usize::from(parquet::from_bytes(bytes).is_err());
        }
        assert!(
            refused > whole.len() / 8,
            "{refused} of {}",
            whole.len() / 2
        );
    }
}

#[test]
fn what_pyarrow_writes_is_read() {
    // Written by tests/reference/parquet.py: dictionary or plain, pages of both versions, three
    // compressions.
    for bytes in [
        &include_bytes!("../../tests/reference/pyarrow_snappy.parquet")[..],
        include_bytes!("../../tests/reference/pyarrow_v2_zstd.parquet"),
        include_bytes!("../../tests/reference/pyarrow_plain_gzip.parquet"),
    ] {
        let read = parquet::from_bytes(bytes.to_vec()).expect("it is read");
        assert_eq!(
            read.observations,
            DMatrix::from_fn(4, 40, |i, j| (j / 3) as f64 + 0.25 * i as f64)
        );
        assert_eq!(
            read.actions,
            DMatrix::from_fn(2, 40, |i, j| (j as f64 + 1.0) / (i as f64 + 3.0))
        );
        assert_eq!(
            read.rewards,
            Some((0..40).map(|j| f64::from(j % 2)).collect())
        );
        assert_eq!(read.episode_starts, [0, 25]);
        assert_eq!(
            read.terminated,
            (0..40).map(|j| j == 24).collect::<Vec<_>>()
        );
        assert_eq!(read.truncated, (0..40).map(|j| j == 39).collect::<Vec<_>>());
        assert_eq!(
            (read.poses, read.provenance),
            (None, vec![("env".into(), "none".into())])
        );
    }
}

#[test]
fn what_is_written_comes_back() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("demo.parquet");
    for demonstration in [
        example(),
        Demonstration {
            rewards: None,
            poses: None,
            provenance: vec![],
            ..example()
        },
    ] {
        demonstration.write(&path).expect("written");
        assert_eq!(Demonstration::read(&path).expect("read"), demonstration);
    }
    assert_eq!(
        fs::read_dir(folder.path()).expect("a folder").count(),
        1,
        "nothing else is left"
    );
}

#[test]
fn a_writer_says_what_it_cannot_write() {
    let folder = TempDir::new().expect("a temporary folder");
    let nowhere = folder.path().join("missing/demo.parquet");
    assert!(matches!(
        example().write(&nowhere),
        Err(DemoError::Unwritable { .. })
    ));
    let flawed = Demonstration {
        terminated: vec![],
        ..example()
    };
    let message = flawed
        .write(&folder.path().join("demo.parquet"))
        .expect_err("flawed")
        .to_string();
    assert!(
        message.contains("terminated has 0 entries for 6 observations"),
        "{message}"
    );
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
}

#[test]
fn episodes_and_returns() {
    let demonstration = example();
    assert_eq!(
        demonstration.episodes().collect::<Vec<_>>(),
        [0..3, 3..4, 4..6]
    );
    assert_eq!(
        demonstration.returns(),
        Some(vec![-0.5, 0.25, 4.0 + 1e-300])
    );
    assert_eq!(
        Demonstration {
            rewards: None,
            ..demonstration
        }
        .returns(),
        None
    );
}
