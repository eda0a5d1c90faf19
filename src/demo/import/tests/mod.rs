//! Imports of what other programs wrote (tests/reference/import.py).

mod episodes;
mod hostile;
mod origin;

use std::{fs, path::PathBuf};

use super::*;
use crate::rng::{Seed, Stream};
use nalgebra::DMatrix;
use rand::RngExt;

fn reference(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference")).join(name)
}

fn imported(name: &str) -> Imported {
    import(&reference(name), EnvId::InvertedPendulum).expect(name)
}

const FILES: [&str; 6] = [
    "import_protocol2.pkl",
    "import_protocol3.pkl",
    "import_protocol4.pkl",
    "import_d4rl.npz",
    "import_imitation.npz",
    "import_columns.parquet",
];

/// An archive with `members`, deflated, each a name and its bytes.
fn archive(members: &[(&str, &[u8])]) -> Vec<u8> {
    use std::io::Write;
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in members {
        let mut deflated =
            flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
        deflated.write_all(bytes).expect("in memory");
        let deflated = deflated.finish().expect("in memory");
        let offset = file.len() as u32;
        let (lengths, name_length) = (
            [deflated.len(), bytes.len()].map(|n| (n as u32).to_le_bytes()),
            name.len() as u16,
        );
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        // Versions and flags, the method, time and date, which nobody asks for; then the checksum,
        // sizes and lengths.
        let common = [
            &[20, 0, 0, 0, 8, 0],
            &[0; 4][..],
            &crc.sum().to_le_bytes(),
            &lengths.concat(),
            &name_length.to_le_bytes(),
            &[0, 0],
        ]
        .concat();
        file.extend([b"PK\x03\x04", &common[..], name.as_bytes(), &deflated].concat());
        let entry = [
            b"PK\x01\x02\x14\x00",
            &common[..],
            &[0; 10],
            &offset.to_le_bytes(),
            name.as_bytes(),
        ]
        .concat();
        directory.extend(entry);
    }
    let count = (members.len() as u16).to_le_bytes();
    let place = [directory.len() as u32, file.len() as u32]
        .map(u32::to_le_bytes)
        .concat();
    let end = [b"PK\x05\x06\0\0\0\0", &count[..], &count, &place, &[0, 0]].concat();
    [file, directory, end].concat()
}

/// An `.npy` file.
fn npy(dtype: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let fortran = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': {dtype}, 'fortran_order': {fortran}, 'shape': {shape}, }}");
    [
        b"\x93NUMPY\x01\x00",
        &(header.len() as u16).to_le_bytes()[..],
        header.as_bytes(),
        data,
    ]
    .concat()
}

#[test]
fn every_format_gives_the_same_demonstration() {
    for name in FILES {
        let Imported {
            demonstration,
            losses,
            ..
        } = imported(name);
        let mut expected = DMatrix::from_fn(4, 5, |i, j| j as f64 + 0.25 * i as f64);
        if name.ends_with(".pkl") {
            expected[(3, 4)] = 11.0; // 5 deviations of 2 from the mean of 1
            assert!(
                losses.iter().any(|loss| loss.contains("1 of 20 numbers")),
                "{losses:?}"
            );
            assert!(
                losses.iter().any(|loss| loss.contains("not read: extra")),
                "{losses:?}"
            );
            assert_eq!(demonstration.rewards, None);
        } else {
            assert_eq!(demonstration.rewards, Some(vec![1.0; 5]), "{name}");
        }
        assert_eq!(demonstration.observations, expected, "{name}");
        assert_eq!(
            demonstration.actions,
            DMatrix::from_fn(1, 5, |_, j| -0.5 * j as f64),
            "{name}"
        );
        assert_eq!(demonstration.episode_starts, [0, 3], "{name}");
        assert!(demonstration.terminated[2], "{name}");
        // Where the file tells, the second episode was cut; where it does not, that it was short
        // tells.
        let told = name.ends_with(".npz");
        assert_eq!(
            (demonstration.terminated[4], demonstration.truncated[4]),
            (!told, told),
            "{name}"
        );
        assert_eq!(
            losses
                .iter()
                .any(|loss| loss.contains("how episodes ended")),
            !told,
            "{name}: {losses:?}"
        );
        assert!(
            demonstration
                .provenance
                .contains(&("imported_from".into(), name.into()))
        );
    }
}

#[test]
fn this_crates_own_format_comes_through_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.parquet");
    let mut own = imported("import_d4rl.npz").demonstration;
    let pose = crate::env::Pose {
        qpos: vec![0.0, 1.0],
        qvel: vec![2.0, 3.0],
    };
    own.poses = Some(vec![pose; 5]);
    own.provenance = vec![];
    own.write(&path).expect("written");
    let Imported {
        mut demonstration,
        losses,
        warnings,
    } = import(&path, EnvId::InvertedPendulum).expect("read");
    demonstration.provenance.clear();
    assert_eq!((demonstration, losses, warnings), (own, vec![], vec![]));
}

#[test]
fn rewards_follow_from_observations_and_actions() {
    let path = PathBuf::from("d");
    let one_episode = |observations: DMatrix<f64>, actions: DMatrix<f64>| Demonstration {
        rewards: None,
        episode_starts: vec![0],
        terminated: vec![false; observations.ncols()],
        truncated: vec![false; observations.ncols()],
        poses: None,
        provenance: vec![],
        observations,
        actions,
    };
    let pendulum = imported("import_d4rl.npz").demonstration;
    assert_eq!(
        recomputed_rewards(&pendulum, &path, EnvId::InvertedPendulum).expect("rewards"),
        [1.0; 5]
    );
    // Fast beside the goal: +100 - 0.1 at the second step; an action beyond the bound costs what it
    // is.
    let car = one_episode(
        DMatrix::from_column_slice(2, 2, &[0.0, 0.0, 0.44, 0.05]),
        DMatrix::from_row_slice(1, 2, &[2.0, 1.0]),
    );
    let rewards = recomputed_rewards(&car, &path, EnvId::MountainCar).expect("rewards");
    assert!(
        (rewards[0] + 0.4).abs() < 1e-9 && (rewards[1] - 99.9).abs() < 1e-9,
        "{rewards:?}"
    );
    assert!(recomputed_rewards(&car, &path, EnvId::Hopper).is_err());
}

#[test]
fn recomputed_rewards_are_near_the_physics_own() {
    // One step from a pose: velocity at its beginning against distance, which a step at most some
    // hundredths long bounds; for the double pendulum the poses before and after the step.
    use crate::env::{Reward, Task};
    for env in EnvId::ALL {
        let mut task = Task::new(env, Reward::Dense, 1000).expect("a task");
        let mut rng = Seed(3).stream(Stream::Environment, 0);
        let spaces = task.spaces();
        let mut observation = vec![0.0; spaces.observation_dim];
        task.reset(&mut rng, &mut observation);
        let (mut observations, mut earned) = (vec![], 0.0);
        let action = vec![0.05; spaces.action_dim];
        for _ in 0..8 {
            observations.extend_from_slice(&observation);
            earned += task
                .step(&action, &mut observation)
                .expect("a step")
                .dense_reward;
        }
        let demonstration = Demonstration {
            observations: DMatrix::from_vec(spaces.observation_dim, 8, observations),
            actions: DMatrix::from_element(spaces.action_dim, 8, 0.05),
            rewards: None,
            episode_starts: vec![0],
            terminated: vec![false; 8],
            truncated: vec![false; 8],
            poses: None,
            provenance: vec![],
        };
        let rewards =
            recomputed_rewards(&demonstration, &PathBuf::from("d"), env).expect("rewards");
        let recomputed: f64 = rewards.iter().sum();
        assert!(
            (recomputed - earned).abs() < 0.25 * 8.0f64.min(1.0 + earned.abs()),
            "{env}: {recomputed}, {earned}"
        );
    }
}

/// An archive of arrays of f64, each a name, a shape and its numbers.
fn arrays(members: &[(&str, &[usize], Vec<f64>)]) -> Vec<u8> {
    let files: Vec<(String, Vec<u8>)> = members
        .iter()
        .map(|(name, shape, numbers)| {
            let lengths: String = shape.iter().map(|length| format!("{length}, ")).collect();
            let bytes: Vec<u8> = numbers
                .iter()
                .flat_map(|number| number.to_le_bytes())
                .collect();
            (
                format!("{name}.npy"),
                npy("'<f8'", false, &format!("({lengths})"), &bytes),
            )
        })
        .collect();
    archive(
        &files
            .iter()
            .map(|(name, bytes)| (name.as_str(), bytes.as_slice()))
            .collect::<Vec<_>>(),
    )
}

fn import_bytes(bytes: &[u8], env: EnvId) -> Result<Imported, DemoError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("theirs.npz");
    fs::write(&path, bytes).expect("written");
    import(&path, env)
}
