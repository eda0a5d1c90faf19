//! Imports of what other programs wrote (tests/reference/import.py), and of what is hostile or
//! damaged.

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
    let message = import(&path, EnvId::InvertedPendulum)
        .expect_err("it must be refused")
        .to_string();
    assert!(message.contains("theirs.bin"), "{message}");
    message
}

#[test]
fn what_is_of_no_known_kind_or_missing_is_refused() {
    for bytes in [
        &b""[..],
        b"PK",
        b"BZh9",
        b"\x80",
        b"\x80\x03",
        b"hello",
        b"PAR1",
    ] {
        refusal(bytes);
    }
    assert!(import(&reference("nowhere.pkl"), EnvId::Hopper).is_err());
}

#[test]
fn a_pickle_that_names_a_function_is_refused_by_its_name() {
    // What `pickle.dumps` makes of an object whose __reduce__ is (os.system, ("echo hello",)),
    // protocols 3 and 4.
    let message =
        refusal(b"\x80\x03cposix\nsystem\nq\x00X\n\x00\x00\x00echo helloq\x01\x85q\x02Rq\x03.");
    assert!(message.contains("`posix.system`"), "{message}");
    let message =
        refusal(b"\x80\x04\x8c\x05posix\x94\x8c\x06system\x94\x93\x94\x8c\x02ls\x94\x85\x94R\x94.");
    assert!(message.contains("`posix.system`"), "{message}");
    // Known functions in unknown ways.
    assert!(refusal(b"\x80\x03cnumpy\nndarray\n(tR.").contains("Ndarray"));
    assert!(
        refusal(b"\x80\x03cnumpy\ndtype\nX\x02\x00\x00\x00f8\x85R(K\x01K\x02tb.")
            .contains("builds")
    );
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
    let bomb = part
        .finish()
        .expect("in memory")
        .repeat((MAX_UNFOLDED >> 24) + 1);
    assert!(bomb.len() < 1 << 16);
    assert!(refusal(&bomb).contains("unpacks to more"));
}

/// A step whose state is the array under the memo's key 1, so that it can be made long and recalled
/// often.
fn pickle_of_arrays(shape: &[u8], dtype: &[u8], bytes: &[u8], episode: &[u8]) -> Vec<u8> {
    let array = [
        b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\nK\x00\x85C\x01btR(K\x01"
            .as_slice(),
        shape,
        b"cnumpy\ndtype\n(X\x02\x00\x00\x00",
        dtype,
        b"K\x00K\x01tR\x89B",
        &(bytes.len() as u32).to_le_bytes(),
        bytes,
        b"tbq\x01",
    ]
    .concat();
    let step = [
        b"}(X\x01\x00\x00\x00s",
        array.as_slice(),
        b"X\x01\x00\x00\x00ah\x01uq\x02",
    ]
    .concat();
    [
        b"\x80\x03}X\x0a\x00\x00\x00trajectory](](",
        step.as_slice(),
        episode,
        b"ees.",
    ]
    .concat()
}

#[test]
fn what_a_short_pickle_unfolds_to_is_bounded() {
    // As it should be: one step with a state of four numbers, and actions of as many.
    let sane = pickle_of_arrays(b"K\x04\x85", b"f8", &[0; 32], b"");
    assert!(refusal(&sane).contains("an action has 4 numbers"));
    // One step of 200,000 numbers, a thousand times; a truth value a byte, 1 GiB and more when
    // widened.
    let long = pickle_of_arrays(
        b"J\x40\x0d\x03\x00\x85",
        b"f4",
        &[0; 800_000],
        &b"h\x02".repeat(1000),
    );
    assert!(refusal(&long).contains("unpack to more"));
    let shape = [
        b"J".as_slice(),
        &(MAX_NUMBERS as u32 + 1).to_le_bytes(),
        b"\x85",
    ]
    .concat();
    let wide = pickle_of_arrays(&shape, b"b1", &vec![0; MAX_NUMBERS + 1], b"");
    assert!(refusal(&wide).contains("no array of numbers `s`"));
    // A text of 1 MiB, made bytes a thousand times.
    let text = [
        b"X".as_slice(),
        &(1u32 << 20).to_le_bytes(),
        &vec![b'x'; 1 << 20],
    ]
    .concat();
    let encode = [
        b"\x80\x03c_codecs\nencode\nq\x00",
        text.as_slice(),
        b"X\x06\x00\x00\x00latin1\x86q\x01",
    ]
    .concat();
    assert!(
        refusal(&[encode, b"h\x00h\x01R".repeat(1000)].concat()).contains("encodes texts of more")
    );
    // Lists in lists, each twice in the next: nothing walks them. And a stack of recalled objects.
    let doubled = [
        b"\x80\x03]q\x00".as_slice(),
        &b"](h\x00h\x00eq\x00".repeat(10_000),
        b".",
    ]
    .concat();
    assert!(refusal(&doubled).contains("no list `trajectory`"));
    let deep = [b"\x80\x03]".as_slice(), &b"\x85".repeat(1 << 20), b"."].concat();
    assert!(refusal(&deep).contains("no list `trajectory`"));
    let tall = [b"\x80\x03Nq\x00".as_slice(), &b"h\x00".repeat(1 << 24)].concat();
    assert!(refusal(&tall).contains("instructions"));
}

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
        // Versions and flags, the method, time and date and check sum, which nobody asks for; then
        // sizes and lengths.
        let common = [
            &[20, 0, 0, 0, 8, 0],
            &[0; 8][..],
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
fn hostile_archives_are_refused_by_what_is_wrong_with_them() {
    let with = |actions: &[u8]| {
        archive(&[
            ("obs.npy", &npy("'<f8'", false, "(1, 4)", &[0; 32])),
            ("acts.npy", actions),
        ])
    };
    let refused = |actions: &[u8], says: &str| {
        let message = refusal(&with(actions));
        assert!(
            message.contains("acts") && message.contains(says),
            "{says}: {message}"
        );
    };
    refused(
        &npy("'|O'", false, "(1, 1)", b"\x80\x03]."),
        "holds `|O`; numbers are needed",
    );
    refused(&npy("'<U4'", false, "(1, 1)", &[0; 16]), "holds `<U4`");
    refused(
        &npy("[('x', '<f8')]", false, "(1,)", &[0; 8]),
        "numbers are needed",
    );
    refused(&npy("'<c16'", false, "(1, 1)", &[0; 16]), "holds `<c16`");
    refused(&npy("'<f8'", true, "(1, 1)", &[0; 8]), "Fortran");
    refused(
        &npy("'<f8'", false, "(2, 1)", &[0; 8]),
        "has 1 numbers for the shape [2, 1]",
    );
    refused(
        &npy("'<f8'", false, "(1, 1)", &[0; 7]),
        "numbers are needed",
    );
    refused(
        &npy("'<f8'", false, "(4294967296, 4294967296)", &[]),
        "too large",
    );
    refused(&npy("'<f8'", false, "(-1, 1)", &[0; 8]), "has no shape");
    refused(b"\x80\x03]q\x00.", "is not an .npy array");
    // As many rows as memory would not hold, of no numbers.
    refused(
        &npy("'<f8'", false, "(1000000000000000, 0)", &[]),
        "no steps",
    );
    let poses = npy("'<f8'", false, "(1000000000000000, 0)", &[]);
    let action = npy("'<f8'", false, "(1, 1)", &[0; 8]);
    let observation = npy("'<f8'", false, "(1, 4)", &[0; 32]);
    let members = [
        ("obs.npy", &observation[..]),
        ("acts.npy", &action),
        ("qpos.npy", &poses),
        ("qvel.npy", &poses),
    ];
    refusal(&archive(&members));
    // 300 MiB of zeros in 300 kB.
    let bomb = with(&npy("'|u1'", false, "(314572800, 1)", &vec![0; 300 << 20]));
    assert!(bomb.len() < 1 << 20 && refusal(&bomb).contains("unpacks to more"));
    // Bytes that come highest first are numbers too.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("big.npz");
    fs::write(
        &path,
        with(&npy("'>f8'", false, "(1, 1)", &0.25f64.to_be_bytes())),
    )
    .expect("written");
    let read = import(&path, EnvId::InvertedPendulum)
        .expect("big-endian")
        .demonstration;
    assert_eq!(read.actions[(0, 0)], 0.25);
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
            assert!(
                from_bytes(whole[..length].to_vec(), EnvId::InvertedPendulum).is_err(),
                "{name}: {length} bytes"
            );
        }
        for _ in 0..1000 {
            let mut bytes = whole.clone();
            for _ in 0..rng.random_range(1..4) {
                let place = rng.random_range(0..bytes.len());
                bytes[place] = if rng.random() {
                    rng.random()
                } else {
                    bytes[place] ^ 1 << rng.random_range(0..8)
                };
            }
            if let Ok(imported) = from_bytes(bytes, EnvId::InvertedPendulum) {
                // What is left of it is a demonstration, or is known to be none.
                let _ = imported.demonstration.flaw();
            }
        }
    }
}

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

#[test]
fn lengths_ranks_and_types_that_do_not_fit_never_panic() {
    let shapes: [&[usize]; 13] = [
        &[],
        &[0],
        &[1],
        &[4],
        &[5],
        &[6],
        &[7],
        &[5, 0],
        &[5, 1],
        &[6, 1],
        &[5, 4],
        &[7, 4],
        &[5, 1, 4],
    ];
    let types = [("<f8", 8), ("<f4", 4), ("|b1", 1), ("<i8", 8), ("<u2", 2)];
    let optional = [
        "rewards",
        "terminals",
        "timeouts",
        "dones",
        "is_last",
        "episode_starts",
        "episode",
        "step",
        "indices",
        "qpos",
    ];
    let mut read = 0;
    let member = |name: &str, shape: &[usize], (dtype, width): (&str, usize), fill: u8| {
        let lengths: String = shape.iter().map(|length| format!("{length}, ")).collect();
        let bytes = vec![fill; shape.iter().product::<usize>() * width];
        (
            format!("{name}.npy"),
            npy(
                &format!("'{dtype}'"),
                false,
                &format!("({lengths})"),
                &bytes,
            ),
        )
    };
    let mut attempt = |members: &[(String, Vec<u8>)]| {
        let members: Vec<(&str, &[u8])> = members
            .iter()
            .map(|(name, bytes)| (name.as_str(), bytes.as_slice()))
            .collect();
        if let Ok(imported) = from_bytes(archive(&members), EnvId::InvertedPendulum) {
            read += usize::from(imported.demonstration.flaw().is_none());
        }
    };
    for observations in shapes {
        for actions in shapes {
            for kind in types {
                attempt(&[
                    member("obs", observations, kind, 0),
                    member("acts", actions, kind, 0),
                ]);
            }
        }
    }
    for name in optional {
        for shape in shapes {
            for kind in types {
                for observations in [[5, 4], [6, 4], [7, 4]] {
                    for fill in [0, 1, 0xff] {
                        let whole = ("<f8", 8);
                        attempt(&[
                            member("obs", &observations, whole, 0),
                            member("acts", &[5, 1], whole, 0),
                            member(name, shape, kind, fill),
                            member("qvel", shape, kind, fill),
                        ]);
                    }
                }
            }
        }
    }
    assert!(read > 100, "{read}");
}
