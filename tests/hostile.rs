//! Files from strangers: whatever their bytes, a reader gives an answer, and takes no more memory
//! than it says.
//!
//! What `fuzz/` does for hours, in seconds: random bytes, and files of every kind with bytes
//! changed, cut and repeated.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    fs,
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use mcpo_run::{
    algo::Agent,
    demo::{Demonstration, import},
    env::EnvId,
    measured::progress,
    nn::{GaussianPolicy, Mlp, Normalizer},
    plan,
    record::{Build, Checkpoint, Manifest, RunPaths, Stamp, compare, policy, rows},
    rng::{Seed, Stream},
    spec::{self, Overrides},
    train::{EvaluationEpisode, Iteration},
};
use proptest::prelude::*;

/// More than any reader may hold at once for a file of some kilobytes: a page or an archive's
/// member may unfold to 256 MiB, and its numbers be kept once more as f64.
const MOST: usize = 1 << 30;

/// The system's allocator, counting.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[expect(
    unsafe_code,
    reason = "an allocator is unsafe by its trait; this one passes on to the system's"
)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(held, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// One reader at a time, so that what it holds can be told.
static ONE: Mutex<()> = Mutex::new(());

/// Lets `read` have a file of `bytes`; a panic or too much memory fails the test.
fn show(bytes: &[u8], read: impl Fn(&Path)) {
    let one = ONE
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hostile");
    fs::write(&path, bytes).expect("written");
    let before = HELD.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    read(&path);
    let peak = PEAK.load(Ordering::Relaxed).saturating_sub(before);
    drop(one);
    assert!(
        peak < MOST,
        "{} bytes made a reader hold {peak}",
        bytes.len()
    );
}

fn demonstration(path: &Path) {
    let _ = Demonstration::read(path);
    let _ = import::import(path, EnvId::InvertedPendulum);
}

fn checkpoint(path: &Path) {
    let _ = Checkpoint::read(path, "f");
    let bytes = fs::read(path).expect("it was written");
    fs::write(path, sealed(&bytes)).expect("written");
    let _ = Checkpoint::read(path, "f");
}

/// A checkpoint with this payload, whose digest is right.
fn sealed(payload: &[u8]) -> Vec<u8> {
    let head = format!(
        "mcpo-run checkpoint 2\nf\n{}\n",
        blake3::hash(payload).to_hex()
    );
    [head.as_bytes(), payload].concat()
}

fn saved_policy(path: &Path) {
    let _ = policy::digest(path);
    let _ = policy::read(path);
}

fn manifest(path: &Path) {
    let _ = Manifest::read(path);
}

fn results(path: &Path) {
    let _ = rows::read_progress(path);
    let _ = rows::read_evaluations(path);
    let _ = rows::read_keys(path);
    let _ = rows::read_stamp(path);
    let _ = rows::read_numbers(path, progress::COLUMNS);
    let _ = compare::tables(path, path, compare::Exactness::Bits);
}

fn matrix(path: &Path) {
    let bytes = fs::read(path).expect("it was written");
    match spec::parse(
        path,
        &String::from_utf8_lossy(&bytes),
        &Overrides::default(),
    ) {
        Ok(spec) => drop(plan::plan(&spec)),
        Err(errors) => assert!(!errors.render(true).is_empty()),
    }
}

/// Everything that reads.
const READERS: [fn(&Path); 6] = [
    demonstration,
    checkpoint,
    saved_policy,
    manifest,
    results,
    matrix,
];

/// What is done to a file: a byte becomes another, a piece is cut out or repeated, or a number
/// becomes a great one.
#[derive(Debug, Clone)]
enum Change {
    Byte(usize, u8),
    Cut(usize, usize),
    Repeat(usize, usize),
    Great(usize, u8),
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let change = prop_oneof![
        (any::<usize>(), any::<u8>()).prop_map(|(at, byte)| Change::Byte(at, byte)),
        (any::<usize>(), 0_usize..64).prop_map(|(at, length)| Change::Cut(at, length)),
        (any::<usize>(), 0_usize..64).prop_map(|(at, length)| Change::Repeat(at, length)),
        (any::<usize>(), 0x70_u8..=0xff).prop_map(|(at, byte)| Change::Great(at, byte)),
    ];
    prop::collection::vec(change, 1..6)
}

/// `whole` after `changes`. Half of the places lie in the first and the last kilobyte, where
/// formats keep their sizes.
fn changed(whole: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for change in changes {
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len();
        let place = |at: usize| match at % 4 {
            0 => at / 4 % length.min(1024),
            1 => length - 1 - at / 4 % length.min(1024),
            _ => at / 4 % length,
        };
        match *change {
            Change::Byte(at, byte) => bytes[place(at)] = byte,
            Change::Cut(at, count) => {
                let start = place(at);
                bytes.drain(start..(start + count).min(length));
            }
            Change::Repeat(at, count) => {
                let start = place(at);
                let piece = bytes[start..(start + count).min(length)].to_vec();
                bytes.splice(start..start, piece);
            }
            Change::Great(at, byte) => {
                let start = place(at);
                bytes[start..(start + 4).min(length)].fill(byte);
            }
        }
    }
    bytes
}

/// Demonstrations of every kind and compression.
fn demonstrations() -> Vec<Vec<u8>> {
    let names = [
        "import_columns.parquet",
        "import_d4rl.npz",
        "import_imitation.npz",
        "import_protocol2.pkl",
    ];
    let more = [
        "import_protocol3.pkl",
        "import_protocol4.pkl",
        "pyarrow_plain_gzip.parquet",
        "pyarrow_snappy.parquet",
    ];
    let mut paths: Vec<PathBuf> = names
        .iter()
        .chain(&more)
        .map(|name| Path::new("tests/reference").join(name))
        .collect();
    paths.push("tests/reference/pyarrow_v2_zstd.parquet".into());
    paths.push("experiments/demos/MountainCarContinuous-v0.parquet".into());
    paths
        .into_iter()
        .map(|path| fs::read(path).expect("it is there"))
        .collect()
}

fn stamp() -> Stamp {
    let (spec, build) = (
        serde_json::json!({ "id": "a/b" }),
        Build::current(serde_json::Value::Null),
    );
    Stamp {
        spec,
        fingerprint: "f".to_owned(),
        demonstration: None,
        demonstrated: None,
        build,
        origin: None,
    }
}

/// The bytes of what `write` writes.
fn written(write: impl Fn(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("file");
    write(&path);
    fs::read(path).expect("it was written")
}

/// A checkpoint's payload.
fn a_checkpoint() -> Vec<u8> {
    let episode = EvaluationEpisode {
        env_steps: 1,
        last: true,
        episode: 2,
        dense_return: 0.5,
        training_return: 1.0,
        length: 7,
    };
    let checkpoint = Checkpoint {
        state: vec![7; 300],
        evaluations: vec![episode; 3],
        seconds: 2.0,
        ..Checkpoint::default()
    };
    let whole = written(|path| checkpoint.write(path, "f").expect("written"));
    let payload = (0..whole.len())
        .filter(|&at| whole[at] == b'\n')
        .nth(2)
        .expect("its head has three lines")
        + 1;
    assert_eq!(
        sealed(&whole[payload..]),
        whole,
        "the test's seal is not the program's"
    );
    whole[payload..].to_vec()
}

fn a_policy() -> Vec<u8> {
    let mut rng = Seed(3).stream(Stream::Network, 0);
    let agent = Agent {
        policy: GaussianPolicy::new(3, &[5, 4], 2, 0.3, &mut rng),
        value: Mlp::new(&[3, 4, 1], 1.0, &mut rng),
        normalizer: Normalizer::new(3, 5.0),
    };
    written(|path| policy::write(path, &agent, &stamp()).expect("written"))
}

fn a_manifest() -> Vec<u8> {
    written(|path| Manifest::new(stamp()).write(path).expect("written"))
}

fn a_table() -> Vec<u8> {
    let keys = rows::Keys {
        experiment: "e".to_owned(),
        run: "a/b".to_owned(),
        env: "Hopper-v2".to_owned(),
        algorithm: "mcpo".to_owned(),
        d: Some(1e-3),
        epsilon: None,
        seed: 7,
        axes: Default::default(),
    };
    let row = Iteration {
        iteration: 1,
        env_steps: 100,
        episodes: 3,
        dense_return: None,
        training_return: Some(0.25),
        episode_length: Some(12.5),
        update: Default::default(),
        physics_seconds: 0.125,
        rollout_seconds: 0.25,
        update_seconds: 0.5,
    };
    written(|path| {
        rows::write_progress(path, &keys, &stamp(), &vec![row.clone(); 20]).expect("written")
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn random_bytes_are_refused(kind in 0_usize..8, bytes in prop::collection::vec(any::<u8>(), 0..512)) {
        // Behind the beginnings by which formats are known, so that readers are reached.
        let beginnings: [&[u8]; 8] =
            [b"", b"PAR1", b"BZh9", b"\x80\x02", b"PK\x03\x04", b"mcpo-run checkpoint 2\nf\n", b"\x40\0\0\0\0\0\0\0{", b"name = "];
        let mut whole = beginnings[kind].to_vec();
        whole.extend(bytes);
        if kind == 1 {
            whole.extend(b"PAR1");
        }
        for read in READERS {
            show(&whole, read);
        }
    }

    #[test]
    fn a_changed_demonstration_is_read_or_refused(kind in 0_usize..10, changes in changes()) {
        let demonstrations = demonstrations();
        show(&changed(&demonstrations[kind % demonstrations.len()], &changes), demonstration);
    }

    #[test]
    fn a_changed_checkpoint_policy_or_manifest_is_read_or_refused(changes in changes()) {
        show(&changed(&a_checkpoint(), &changes), checkpoint);
        show(&changed(&a_policy(), &changes), saved_policy);
        show(&changed(&a_manifest(), &changes), manifest);
    }

    #[test]
    fn a_changed_table_is_read_or_refused(changes in changes()) {
        show(&changed(&a_table(), &changes), results);
    }

    #[test]
    fn a_changed_matrix_is_read_or_refused(file in 0_usize..4, changes in changes()) {
        let name = ["smoke", "ablation", "comparison", "ci"][file];
        let whole = fs::read(format!("experiments/{name}.toml")).expect("it is there");
        show(&changed(&whole, &changes), matrix);
    }

    /// Whatever names a file gives, everything of its runs lies in the folder of the results.
    #[test]
    fn names_cannot_lead_outside_the_results(experiment in "[a./\\\\~:\u{0}-]{0,6}", id in "[a./\\\\~:\u{0}-]{0,12}") {
        if let Ok(paths) = RunPaths::new(Path::new("results"), &experiment, &id) {
            for path in [&paths.complete, &paths.partial, &paths.claim] {
                let parts: Vec<_> = path.components().collect();
                prop_assert!(path.starts_with("results") && parts.len() >= 4, "{path:?}");
                prop_assert!(parts.iter().all(|part| matches!(part, std::path::Component::Normal(_))), "{path:?}");
            }
        }
    }

    /// The same for an axis whose values are texts, the only ones that are free.
    #[test]
    fn values_of_axes_cannot_lead_outside_the_results(path in "[a./ -]{1,12}") {
        let text = format!(
            "name = 'x'\nbudget.env_steps = 100_000\n[[matrix]]\nseed = [0]\nenv = ['Hopper-v2']\nalgorithm = ['bc']\n\
             demonstrations = ['{path}']\n"
        );
        if let Ok(spec) = spec::parse(Path::new("x.toml"), &text, &Overrides::default()) {
            for run in plan::plan(&spec).expect("one run") {
                if let Ok(paths) = RunPaths::new(Path::new("results"), &run.experiment, &run.id) {
                    let parts = paths.complete.components().count();
                    prop_assert_eq!(parts, 6, "{:?}", paths.complete); // results/x/runs/ENV/ALGORITHM/SEED
                }
            }
        }
    }
}

#[test]
fn names_that_lead_outside_are_told_in_the_file() {
    for name in ["..", "../x", "/etc/x", "a/b", "a\\\\b", ".git", "x.partial"] {
        let text = format!(
            "name = \"{name}\"\nbudget.env_steps = 100_000\n[[matrix]]\nseed = [0]\nenv = ['Hopper-v2']\nalgorithm = ['ppo']\n"
        );
        let refused = match spec::parse(Path::new("x.toml"), &text, &Overrides::default()) {
            Err(errors) => errors.to_string().contains("cannot name"),
            Ok(spec) => RunPaths::new(Path::new("results"), &spec.name, "a").is_err(),
        };
        assert!(refused, "{name} was accepted");
    }
    for env in ["../Hopper-v2", "Hopper-v2/..", "/"] {
        let text = format!(
            "name = 'x'\nbudget.env_steps = 100_000\n[[matrix]]\nseed = [0]\nenv = ['{env}']\nalgorithm = ['ppo']\n"
        );
        let errors = spec::parse(Path::new("x.toml"), &text, &Overrides::default())
            .expect_err("no environment");
        assert!(
            errors.to_string().contains("unknown environment"),
            "{errors}"
        );
    }
}

#[test]
fn a_few_bytes_that_unfold_to_much_are_bounded() {
    use std::io::Write;
    let unfolds_to = |bytes: &[u8], count: usize| {
        let mut part = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
        part.write_all(&bytes.repeat(count)).expect("in memory");
        part.finish().expect("in memory")
    };
    // Objects without end; marks; tuples of a memo's object; a list that takes up what was put on
    // the stack.
    for (head, repeated) in [
        ("\u{80}\u{2}", "N"),
        ("\u{80}\u{2}", "("),
        ("\u{80}\u{2}N", "\u{85}"),
        ("\u{80}\u{2}]", "(NNNNNNNe"),
    ] {
        let latin1 = |text: &str| {
            text.chars()
                .map(|c| u32::from(c) as u8)
                .collect::<Vec<u8>>()
        };
        let whole = [
            latin1(head),
            latin1(repeated).repeat((1 << 26) / repeated.len()),
        ]
        .concat();
        show(&unfolds_to(&whole, 1), demonstration);
    }
    // Zeros: twice what a file may unfold to.
    show(&unfolds_to(&[0; 1 << 20], 256), demonstration);
    // A truth value a byte in an archive, which becomes eight.
    let header = "{'descr': '|b1', 'fortran_order': False, 'shape': (120000000, 1), }";
    let mut npy = [
        b"\x93NUMPY\x01\x00",
        &(header.len() as u16).to_le_bytes()[..],
        header.as_bytes(),
    ]
    .concat();
    npy.resize(npy.len() + 120_000_000, 0);
    let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
    deflated.write_all(&npy).expect("in memory");
    let deflated = deflated.finish().expect("in memory");
    let sizes = [deflated.len() as u32, npy.len() as u32]
        .map(u32::to_le_bytes)
        .concat();
    let name = b"actions.npy";
    let common = [
        &[20, 0, 0, 0, 8, 0],
        &[0; 8][..],
        &sizes,
        &(name.len() as u16).to_le_bytes(),
        &[0, 0],
    ]
    .concat();
    let file = [b"PK\x03\x04", &common[..], name, &deflated].concat();
    let entry = [b"PK\x01\x02\x14\x00", &common[..], &[0; 14], name].concat();
    let place = [entry.len() as u32, file.len() as u32]
        .map(u32::to_le_bytes)
        .concat();
    let end = [b"PK\x05\x06\0\0\0\0\x01\x00\x01\x00", &place[..], &[0, 0]].concat();
    show(&[file, entry, end].concat(), demonstration);
}

#[test]
fn a_small_table_of_many_rows_is_refused() {
    use polars::prelude::{Column, DataFrame, DataType, ParquetWriter};
    let height = 40_000_000;
    let columns = ["iteration", "env_steps"]
        .map(|name| Column::full_null(name.into(), height, &DataType::UInt64));
    let mut frame = DataFrame::new(height, columns.to_vec()).expect("a frame");
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes)
        .finish(&mut frame)
        .expect("in memory");
    assert!(bytes.len() < 1 << 21, "no small file: {}", bytes.len());
    show(&bytes, |path| {
        results(path);
        let error = rows::read_numbers(path, progress::COLUMNS)
            .expect_err("too much")
            .to_string();
        assert!(error.contains("40000000 rows"), "{error}");
    });
}

#[test]
#[should_panic(expected = "made a reader hold")]
fn a_reader_that_takes_too_much_would_be_found() {
    show(b"x", |_| drop(Vec::<u8>::with_capacity(MOST)));
}
