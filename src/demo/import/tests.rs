//! Imports of what other programs wrote (tests/reference/import.py), and of what is hostile or damaged.

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

/// The message of importing `bytes`.
fn refusal(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("theirs.bin");
    fs::write(&path, bytes).expect("written");
    let message = import(&path, EnvId::InvertedPendulum).expect_err("it must be refused").to_string();
    assert!(message.contains("theirs.bin"), "{message}");
    message
}

#[test]
fn what_is_of_no_known_kind_or_missing_is_refused() {
    for bytes in [&b""[..], b"PK", b"BZh9", b"\x80", b"\x80\x03", b"hello", b"PAR1"] {
        refusal(bytes);
    }
    assert!(import(&reference("nowhere.pkl"), EnvId::Hopper).is_err());
}

#[test]
fn a_pickle_that_names_a_function_is_refused_by_its_name() {
    // What `pickle.dumps` makes of an object whose __reduce__ is (os.system, ("echo hello",)), protocols 3 and 4.
    let message = refusal(b"\x80\x03cposix\nsystem\nq\x00X\n\x00\x00\x00echo helloq\x01\x85q\x02Rq\x03.");
    assert!(message.contains("`posix.system`"), "{message}");
    let message = refusal(b"\x80\x04\x8c\x05posix\x94\x8c\x06system\x94\x93\x94\x8c\x02ls\x94\x85\x94R\x94.");
    assert!(message.contains("`posix.system`"), "{message}");
    // Known functions in unknown ways.
    assert!(refusal(b"\x80\x03cnumpy\nndarray\n(tR.").contains("Ndarray"));
    assert!(refusal(b"\x80\x03cnumpy\ndtype\nX\x02\x00\x00\x00f8\x85R(K\x01K\x02tb.").contains("builds"));
    // INST, OBJ, EXT1, PERSID, NEWOBJ.
    for code in [b'i', b'o', 0x82, b'P', 0x81] {
        assert!(refusal(&[0x80, 3, code]).contains(&format!("instruction 0x{code:02x}")));
    }
}

#[test]
fn pickles_that_misuse_the_machine_are_refused() {
    for program in [
        &b"\x80\x03."[..],                                   // nothing was made
        b"\x80\x09.",                                        // an unknown protocol
        b"\x80\x03h\x05.",                                   // recalls what was never made
        b"\x80\x03K\x01a.",                                  // appends to nothing
        b"\x80\x03}(K\x01u.",                                // a key without a value
        b"\x80\x03u.",                                       // no mark
        b"\x80\x03(((.",                                     // marks alone
        b"\x80\x03X\xff\xff\xff\xffa.",                      // a text of 4 GB
        b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\xff.",    // bytes beyond the address space
        b"\x80\x03}q\x00X\x0a\x00\x00\x00trajectoryh\x00s.", // a dictionary that holds itself
        b"\x80\x03]q\x00h\x00a.",                            // a list that holds itself
        b"\x80\x03}X\x0a\x00\x00\x00trajectory]s.",          // no episodes
        b"\x80\x03}X\x0a\x00\x00\x00trajectory](]K\x01es.",  // an episode that is a number
    ] {
        refusal(program);
    }
    // A mark hides what is below it from instructions that take one object.
    assert!(refusal(b"\x80\x03]K\x01(a.").contains("empty stack"));
}

#[test]
fn a_bomb_is_refused() {
    use std::io::Write;
    let mut part = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    part.write_all(&vec![0; 1 << 24]).expect("in memory");
    let bomb = part.finish().expect("in memory").repeat((MAX_UNFOLDED >> 24) + 1);
    assert!(bomb.len() < 1 << 16);
    assert!(refusal(&bomb).contains("unfolds to more"));
}

#[test]
fn damaged_files_never_panic() {
    let mut rng = Seed(1).stream(Stream::Update, 0);
    for name in FILES {
        let mut whole = fs::read(reference(name)).expect(name);
        if whole.starts_with(b"BZh") {
            // Damage below the compression, which would notice.
            whole = unfold(bzip2::read::MultiBzDecoder::new(whole.as_slice())).expect(name);
        }
        for length in (0..whole.len()).step_by(5) {
            assert!(from_bytes(whole[..length].to_vec(), EnvId::InvertedPendulum).is_err(), "{name}: {length} bytes");
        }
        for _ in 0..1000 {
            let mut bytes = whole.clone();
            for _ in 0..rng.random_range(1..4) {
                let place = rng.random_range(0..bytes.len());
                bytes[place] = if rng.random() { rng.random() } else { bytes[place] ^ 1 << rng.random_range(0..8) };
            }
            if let Ok((imported, _)) = from_bytes(bytes, EnvId::InvertedPendulum) {
                // What is left of it is a demonstration, or is known to be none.
                let _ = imported.demonstration.flaw();
            }
        }
    }
}

#[test]
fn another_environment_is_refused() {
    let path = reference("import_protocol3.pkl");
    let message = import(&path, EnvId::InvertedDoublePendulum).expect_err("of InvertedPendulum").to_string();
    assert!(message.contains("does not fit InvertedDoublePendulum-v2") && message.contains("InvertedPendulum-v2"));
    let message = import(&reference("import_d4rl.npz"), EnvId::Hopper).expect_err("of InvertedPendulum").to_string();
    assert!(message.contains("an observation has 4 numbers; 11 are needed"), "{message}");
}

#[test]
fn every_format_gives_the_same_demonstration() {
    for name in FILES {
        let Imported { demonstration, losses } = imported(name);
        let mut expected = DMatrix::from_fn(4, 5, |i, j| j as f64 + 0.25 * i as f64);
        if name.ends_with(".pkl") {
            expected[(3, 4)] = 11.0; // 5 deviations of 2 from the mean of 1
            assert!(losses.iter().any(|loss| loss.contains("1 of 20 numbers")), "{losses:?}");
            assert!(losses.iter().any(|loss| loss.contains("not read: extra")), "{losses:?}");
            assert_eq!(demonstration.rewards, None);
        } else {
            assert_eq!(demonstration.rewards, Some(vec![1.0; 5]), "{name}");
        }
        assert_eq!(demonstration.observations, expected, "{name}");
        assert_eq!(demonstration.actions, DMatrix::from_fn(1, 5, |_, j| -0.5 * j as f64), "{name}");
        assert_eq!(demonstration.episode_starts, [0, 3], "{name}");
        assert!(demonstration.terminated[2], "{name}");
        // Where the file tells, the second episode was cut; where it does not, that it was short tells.
        let told = name.ends_with(".npz");
        assert_eq!((demonstration.terminated[4], demonstration.truncated[4]), (!told, told), "{name}");
        assert_eq!(losses.iter().any(|loss| loss.contains("how episodes ended")), !told, "{name}: {losses:?}");
        assert!(demonstration.provenance.contains(&("imported_from".into(), name.into())));
    }
}

#[test]
fn this_crates_own_format_comes_through_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.parquet");
    let mut own = imported("import_d4rl.npz").demonstration;
    let pose = crate::env::Pose { qpos: vec![0.0, 1.0], qvel: vec![2.0, 3.0] };
    own.poses = Some(vec![pose; 5]);
    own.provenance = vec![];
    own.write(&path).expect("written");
    let Imported { mut demonstration, losses } = import(&path, EnvId::InvertedPendulum).expect("read");
    demonstration.provenance.clear();
    assert_eq!((demonstration, losses), (own, vec![]));
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
    assert_eq!(recomputed_rewards(&pendulum, &path, EnvId::InvertedPendulum).expect("rewards"), [1.0; 5]);
    // Fast beside the goal: +100 - 0.1 at the second step; an action beyond the bound costs what it is.
    let car = one_episode(
        DMatrix::from_column_slice(2, 2, &[0.0, 0.0, 0.44, 0.05]),
        DMatrix::from_row_slice(1, 2, &[2.0, 1.0]),
    );
    let rewards = recomputed_rewards(&car, &path, EnvId::MountainCar).expect("rewards");
    assert!((rewards[0] + 0.4).abs() < 1e-9 && (rewards[1] - 99.9).abs() < 1e-9, "{rewards:?}");
    assert!(recomputed_rewards(&car, &path, EnvId::Hopper).is_err());
}

#[test]
fn recomputed_rewards_are_near_the_physics_own() {
    // One step from a pose: velocity at its beginning against distance, which a step at most some hundredths long bounds;
    // for the double pendulum the poses before and after the step.
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
            earned += task.step(&action, &mut observation).expect("a step").dense_reward;
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
        let rewards = recomputed_rewards(&demonstration, &PathBuf::from("d"), env).expect("rewards");
        let recomputed: f64 = rewards.iter().sum();
        assert!((recomputed - earned).abs() < 0.25 * 8.0f64.min(1.0 + earned.abs()), "{env}: {recomputed}, {earned}");
    }
}
