//! Where episodes begin and end in arrays that others wrote.

use super::*;

/// 1 where a step is in `rows`, of six.
fn marks(rows: &[usize]) -> Vec<f64> {
    (0..6)
        .map(|row| f64::from(u8::from(rows.contains(&row))))
        .collect()
}

/// Six steps of InvertedPendulum with `more` arrays.
fn six_steps(more: &[(&str, Vec<f64>)]) -> Result<Imported, DemoError> {
    let observations = (0..24).map(f64::from).collect();
    let mut members: Vec<(&str, &[usize], Vec<f64>)> = vec![
        ("obs", &[6, 4], observations),
        ("actions", &[6], vec![0.5; 6]),
    ];
    let lengths: Vec<[usize; 1]> = more.iter().map(|(_, numbers)| [numbers.len()]).collect();
    members.extend(
        more.iter()
            .zip(&lengths)
            .map(|((name, numbers), length)| (*name, &length[..], numbers.clone())),
    );
    import_bytes(&arrays(&members), EnvId::InvertedPendulum)
}

#[test]
fn episodes_are_found_by_every_name_that_marks_them() {
    for (name, numbers) in [
        ("episode_starts", marks(&[0, 2, 5])),
        ("is_first", marks(&[0, 2, 5])),
        ("is_last", marks(&[1, 4, 5])),
        ("episode_index", vec![7.0, 7.0, 3.0, 3.0, 3.0, 9.0]),
        ("frame_index", vec![0.0, 1.0, 0.0, 1.0, 2.0, 0.0]),
        ("step", vec![1.0, 2.0, 1.0, 2.0, 3.0, 1.0]),
        ("dones", marks(&[1, 4, 5])),
        ("terminals", marks(&[1, 4])),
        ("timeouts", marks(&[1, 4, 5])),
        ("indices", vec![2.0, 5.0]),
    ] {
        let imported = six_steps(&[(name, numbers)]).expect(name);
        assert_eq!(imported.demonstration.episode_starts, [0, 2, 5], "{name}");
        assert_eq!(imported.warnings, Vec::<String>::new(), "{name}");
    }
    let imported =
        six_steps(&[("infos", vec![0.0; 6]), ("obs_mean", vec![0.0])]).expect("nothing is told");
    assert_eq!(imported.demonstration.episode_starts, [0]);
    assert_eq!(
        imported.warnings,
        ["nothing says where episodes begin; all 6 steps are taken as one episode"]
    );
    assert!(
        imported
            .losses
            .contains(&"not used: infos, obs_mean".to_owned()),
        "{:?}",
        imported.losses
    );
}

#[test]
fn what_two_arrays_say_of_episodes_must_agree() {
    let refused = |more: &[(&str, Vec<f64>)], says: &str| {
        let message = six_steps(more).expect_err(says).to_string();
        assert!(message.contains(says), "{message}");
    };
    let starts = || ("episode_starts", marks(&[0, 2]));
    let agreeing = six_steps(&[
        starts(),
        ("episode_index", vec![0.0, 0.0, 1.0, 1.0, 1.0, 1.0]),
        ("dones", marks(&[1])),
    ]);
    assert_eq!(
        agreeing
            .expect("both say the same")
            .demonstration
            .terminated,
        [false, true, false, false, false, true]
    );
    refused(
        &[
            starts(),
            ("episode_index", vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
        ],
        "`episode_starts` begins an episode in row 2, where `episode_index` does not",
    );
    refused(
        &[starts(), ("dones", marks(&[3]))],
        "row 3 ends its episode, but row 4 continues",
    );
    refused(
        &[starts(), ("episode_returns", vec![1.0; 3])],
        "`episode_returns` says 3 episodes, but the arrays hold 2",
    );
    refused(
        &[("step", vec![0.0, 1.0, 3.0, 4.0, 5.0, 6.0])],
        "`step` is 3 in row 2; expected 2, or 0 again",
    );
    refused(
        &[("step", vec![0.0, 2.0, 1.0, 3.0, 4.0, 5.0])],
        "`step` is 2 in row 1; expected 1",
    );
    refused(
        &[("episode", vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.0])],
        "`episode` 0 appears again in row 4",
    );
    refused(&[("indices", vec![2.5])], "`indices` do not rise");
    refused(&[("indices", vec![f64::NAN])], "`indices` do not rise");
    refused(
        &[("episode_starts", vec![1.0; 5])],
        "`episode_starts` has 5 numbers for 6 actions",
    );
}

#[test]
fn the_row_behind_an_episodes_last_step_is_no_step() {
    // As RLDS has it: two episodes of two and one steps, their last rows without an action.
    let row = |a: f64| vec![a, 0.5, 0.0, 0.5, 0.0, 0.0];
    let observations: Vec<f64> = (0..24).map(f64::from).collect();
    let rlds = |actions: Vec<f64>| {
        let members: [(&str, &[usize], Vec<f64>); 6] = [
            ("observation", &[6, 4], observations.clone()),
            ("action", &[6, 1], actions),
            ("reward", &[6], vec![1.0, 1.0, 0.0, 1.0, 0.0, 0.0]),
            ("is_first", &[6], marks(&[0, 3, 5])),
            ("is_last", &[6], marks(&[2, 4, 5])),
            ("is_terminal", &[6], marks(&[2])),
        ];
        import_bytes(&arrays(&members), EnvId::InvertedPendulum)
    };
    // An episode of one row has no step to be its last.
    assert_eq!(rlds(row(0.25)).expect("read").demonstration.len(), 6);
    let members: [(&str, &[usize], Vec<f64>); 5] = [
        ("observation", &[6, 4], observations.clone()),
        ("action", &[6, 1], vec![0.25, 0.5, 0.0, 0.5, 0.75, 0.0]),
        ("reward", &[6], vec![1.0, 2.0, 0.0, 3.0, 4.0, 0.0]),
        ("is_last", &[6], marks(&[2, 5])),
        ("is_terminal", &[6], marks(&[2])),
    ];
    let Imported {
        demonstration,
        losses,
        ..
    } = import_bytes(&arrays(&members), EnvId::InvertedPendulum).expect("as RLDS has it");
    assert_eq!(demonstration.actions.as_slice(), [0.25, 0.5, 0.5, 0.75]);
    assert_eq!(
        demonstration
            .observations
            .row(0)
            .iter()
            .copied()
            .collect::<Vec<_>>(),
        [0.0, 4.0, 12.0, 16.0]
    );
    assert_eq!(demonstration.returns(), Some(vec![3.0, 7.0]));
    assert_eq!(
        (demonstration.terminated, demonstration.episode_starts),
        (vec![false, true, false, false], vec![0, 2])
    );
    assert!(
        losses
            .iter()
            .any(|loss| loss.contains("after each episode's last step")),
        "{losses:?}"
    );
}

#[test]
fn an_end_that_may_be_a_limit_is_one_after_as_many_steps() {
    let n = 1003;
    let done = (0..n)
        .map(|row| f64::from(u8::from(row == 999 || row == 1002)))
        .collect();
    let members: [(&str, &[usize], Vec<f64>); 3] = [
        ("obs", &[n, 4], vec![0.0; 4 * n]),
        ("acts", &[n], vec![0.0; n]),
        ("dones", &[n], done),
    ];
    let Imported {
        demonstration,
        losses,
        ..
    } = import_bytes(&arrays(&members), EnvId::InvertedPendulum).expect("it is read");
    assert_eq!(demonstration.episode_starts, [0, 1000]);
    assert!(demonstration.truncated[999] && !demonstration.terminated[999]);
    assert!(demonstration.terminated[1002] && !demonstration.truncated[1002]);
    assert!(
        losses
            .iter()
            .any(|loss| loss.contains("how episodes ended")),
        "{losses:?}"
    );
}

#[test]
fn an_episode_longer_than_any_is_refused() {
    for (env, n, width) in [(EnvId::Hopper, 1001, 11), (EnvId::MountainCar, 1000, 2)] {
        let actions = if env == EnvId::Hopper { 3 } else { 1 };
        let members: [(&str, &[usize], Vec<f64>); 2] = [
            ("observations", &[n, width], vec![0.1; n * width]),
            ("actions", &[n, actions], vec![0.0; n * actions]),
        ];
        let message = import_bytes(&arrays(&members), env)
            .expect_err("too long")
            .to_string();
        assert!(
            message.contains(&format!(
                "episode 0 has {n} steps, and at most {} are possible",
                n - 1
            )),
            "{message}"
        );
    }
}
