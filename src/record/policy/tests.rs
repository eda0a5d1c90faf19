use super::*;
use crate::record::rows::tests::stamp;

fn agent() -> Agent {
    let mut rng = Seed(3).stream(Stream::Network, 0);
    let mut normalizer = Normalizer::new(3, 5.0);
    for observation in [[0.1, 1e-7, 3.0], [0.7, -1e-7, 1.0 / 3.0], [1e9, 0.3, -2.0]] {
        normalizer.update(&observation);
    }
    Agent {
        policy: GaussianPolicy::new(3, &[5, 4], 2, 0.3, &mut rng),
        value: Mlp::new(&[3, 4, 1], 1.0, &mut rng),
        normalizer,
    }
}

#[test]
fn damaged_and_hostile_files_are_errors() {
    let whole = encode(&agent(), &stamp()).expect("encoded");
    assert!(decode(&whole).is_ok());
    for end in 0..whole.len() {
        assert!(decode(&whole[..end]).is_err(), "cut at {end}");
    }
    for place in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[place] ^= 0x55;
        let _ = decode(&damaged); // an error or another policy, but no panic
    }
    assert!(decode(&[0xff; 64]).is_err());
}

#[test]
fn a_number_that_is_none_and_a_shape_that_does_not_fit_are_refused() {
    let mut broken = agent();
    broken.value.parameters_mut()[0] = f32::NAN;
    let refused = |agent: &Agent| {
        let bytes = encode(agent, &stamp()).expect("encoded");
        decode(&bytes).expect_err("refused").to_string()
    };
    assert_eq!(refused(&broken), "`value.0.weight` is not finite at 0");
    let mut narrow = agent();
    narrow.normalizer = Normalizer::new(2, 5.0);
    assert_eq!(
        refused(&narrow),
        "normalizer.mean has 2 numbers; 3 would fit the policy's network"
    );
}

#[test]
fn a_policy_comes_back_bit_for_bit_and_has_the_same_bytes_every_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("policy.safetensors");
    write(&path, &agent(), &stamp()).expect("written");
    let (read_agent, read_stamp) = read(&path).expect("readable");
    assert_eq!(read_agent, agent());
    assert_eq!(read_stamp, stamp());
    let bytes = |agent, stamp| encode(agent, stamp).expect("encoded");
    assert_eq!(bytes(&agent(), &stamp()), bytes(&read_agent, &read_stamp));
}

#[test]
fn a_digest_is_of_the_numbers_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let digest_of = |agent: &Agent, stamp: &Stamp| {
        let path = folder.path().join("policy.safetensors");
        write(&path, agent, stamp).expect("written");
        digest(&path).expect("readable")
    };
    let whole = digest_of(&agent(), &stamp());
    assert_eq!(
        digest_of(
            &agent(),
            &Stamp {
                fingerprint: "another".to_owned(),
                ..stamp()
            }
        ),
        whole
    );
    let mut other = agent();
    let number = &mut other.value.parameters_mut()[0];
    *number = number.next_up();
    assert_ne!(digest_of(&other, &stamp()), whole);
    assert!(digest(&folder.path().join("none")).is_err());
}

#[test]
fn weights_are_by_rows_as_python_expects() {
    let bytes = encode(&agent(), &stamp()).expect("encoded");
    let tensors = SafeTensors::deserialize(&bytes).expect("safetensors");
    let view = tensors.tensor("policy.mean.0.weight").expect("there");
    assert_eq!(view.shape(), [5, 3]);
    let second = f32::from_le_bytes(view.data()[4..8].try_into().expect("four bytes"));
    let agent = agent();
    let (weights, _) = agent.policy.mean().layers().next().expect("a layer");
    assert_eq!(second, weights[(0, 1)]);
}
