//! Demonstrations of another environment than was said: told by label, shape or motion.

use super::*;

#[test]
fn another_environment_is_refused() {
    let path = reference("import_protocol3.pkl");
    let message = import(&path, EnvId::InvertedDoublePendulum)
        .expect_err("of InvertedPendulum")
        .to_string();
    assert!(
        message.contains("does not fit InvertedDoublePendulum-v2")
            && message.contains("InvertedPendulum-v2")
    );
    let message = import(&reference("import_d4rl.npz"), EnvId::Hopper)
        .expect_err("of InvertedPendulum")
        .to_string();
    assert!(
        message.contains("an observation has 4 numbers; 11 are needed"),
        "{message}"
    );
}

/// A recording of Gymnasium's as another program would pool it: arrays without a mark, in an
/// episode at most the limit.
fn pooled(env: EnvId, columns: std::ops::Range<usize>) -> Vec<u8> {
    let path = PathBuf::from(format!("tests/parity/{env}.parquet"));
    let recorded = Demonstration::read(&path).expect("it was recorded");
    let part = |matrix: &DMatrix<f64>| {
        matrix
            .columns_range(columns.clone())
            .iter()
            .copied()
            .collect::<Vec<f64>>()
    };
    let n = columns.len();
    arrays(&[
        (
            "observations",
            &[n, recorded.observations.nrows()],
            part(&recorded.observations),
        ),
        (
            "actions",
            &[n, recorded.actions.nrows()],
            part(&recorded.actions),
        ),
    ])
}

#[test]
fn pooled_episodes_are_told_by_their_jump() {
    let warnings = import_bytes(&pooled(EnvId::Hopper, 0..50), EnvId::Hopper)
        .expect("it is read")
        .warnings;
    assert!(
        warnings
            .iter()
            .any(|warning| warning.contains("between rows 25 and 26 the observation jumps")),
        "{warnings:?}"
    );
    let warnings = import_bytes(&pooled(EnvId::Hopper, 58..240), EnvId::Hopper)
        .expect("it is read")
        .warnings;
    assert!(
        !warnings.iter().any(|warning| warning.contains("jumps")),
        "{warnings:?}"
    );
}

#[test]
fn another_robot_of_the_same_shape_is_refused_by_its_motion() {
    let cheetah = pooled(EnvId::HalfCheetah, 0..300);
    let message = import_bytes(&cheetah, EnvId::Walker2d)
        .expect_err("a cheetah")
        .to_string();
    assert!(
        message.contains(
            "does not fit Walker2d-v2: its observations move like those of HalfCheetah-v2"
        ),
        "{message}"
    );
    assert_eq!(
        import_bytes(&cheetah, EnvId::HalfCheetah)
            .expect("its own")
            .warnings
            .len(),
        1
    ); // no marks of episodes
}

#[test]
fn a_label_of_another_environment_or_version_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.parquet");
    let mut own = imported("import_d4rl.npz").demonstration;
    let mut with = |label: &str| {
        own.provenance = vec![("env".into(), label.into())];
        own.write(&path).expect("written");
        import(&path, EnvId::InvertedPendulum)
    };
    for label in [
        "Hopper-v2",
        "walker2d-expert-v2",
        "InvertedDoublePendulum-v4",
    ] {
        let message = with(label).expect_err(label).to_string();
        assert!(
            message.contains(&format!("the file says that it is from {label}")),
            "{message}"
        );
    }
    assert_eq!(
        with("InvertedPendulum-v4")
            .expect("the same numbers")
            .warnings,
        Vec::<String>::new()
    );
    let warnings = with("InvertedPendulum-v5")
        .expect("nearly the same")
        .warnings;
    assert!(
        warnings[0].contains("v5 pays 0 instead of 1"),
        "{warnings:?}"
    );
    let warnings = with("Pusher-v2").expect("a label alone").warnings;
    assert!(
        warnings[0].contains("`Pusher-v2`, which is not known"),
        "{warnings:?}"
    );
}
