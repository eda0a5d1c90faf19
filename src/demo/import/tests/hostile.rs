//! Files that are damaged, or made to harm: refused, and never a panic.

use super::*;
use crate::demo::import::pickle::Pickle;

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
    let wrong = |action, needed| PickleError::WrongObject { action, needed };
    for (program, error) in [
        (&b"\x80\x03."[..], PickleError::EmptyStack), // nothing was made
        (b"\x80\x03u.", PickleError::EmptyStack),     // no mark
        (b"\x80\x03(((.", PickleError::EmptyStack),   // marks alone
        (b"\x80\x03K\x01a.", PickleError::EmptyStack), // appends to nothing
        (b"\x80\x03NK\x01a.", wrong("appends to", "a list")),
        (b"\x80\x03NNNs.", wrong("inserts into", "a dictionary")),
        (b"\x80\x04NN\x93.", wrong("names a function by", "text")),
        (b"\x80\x03NNR.", wrong("calls", "a function")),
        (b"\x80\x03}(K\x01u.", PickleError::KeyAlone),
        (b"\x80\x09.", PickleError::Protocol(9)),
        (b"\x80\x03h\x05.", PickleError::NeverMade(5)),
        (b"\x80\x03X\xff\xff\xff\xffa.", PickleError::Ended), // a text of 4 GB
        // Bytes beyond the address space.
        (
            b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\xff.",
            PickleError::Ended,
        ),
        (
            b"\x80\x03\x8a\x09\0\0\0\0\0\0\0\0\0.",
            PickleError::LongNumber,
        ),
        (b"\x80\x04\x8c\x01\xff.", PickleError::Encoding("UTF-8")),
    ] {
        assert_eq!(Pickle::read(program).err(), Some(error));
        refusal(program);
    }
    for (program, says) in [
        // A dictionary that holds itself, and a list that does.
        (
            &b"\x80\x03}q\x00X\x0a\x00\x00\x00trajectoryh\x00s."[..],
            "no list",
        ),
        (b"\x80\x03]q\x00h\x00a.", "no list `trajectory`"),
        (
            b"\x80\x03}X\x0a\x00\x00\x00trajectory]s.",
            "it has no steps",
        ),
        (
            b"\x80\x03}X\x0a\x00\x00\x00trajectory](]K\x01es.",
            "episode 1 of the pickle's `trajectory` is not a list",
        ),
    ] {
        let message = refusal(program);
        assert!(message.contains(says), "{says}: {message}");
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
    // A stored number that has changed is seen by the archive's checksum alone.
    let whole = fs::read(reference("import_imitation.npz")).expect("a reference");
    let mut flipped = whole;
    flipped[400] ^= 1;
    assert!(refusal(&flipped).contains("do not have the archive's checksum"));
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
                let _ = imported.demonstration.is_sound();
            }
        }
    }
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
            read += usize::from(imported.demonstration.is_sound().is_ok());
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
