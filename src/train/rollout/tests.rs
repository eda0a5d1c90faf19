use super::*;
use crate::{
    env::{EnvId, Reward},
    nn::{GaussianPolicy, Mlp, Normalizer},
};

fn agent() -> Agent {
    let mut rng = Seed(0).stream(Stream::Network, 0);
    Agent {
        policy: GaussianPolicy::new(11, &[8], 3, 0.5, &mut rng),
        value: Mlp::new(&[11, 8, 1], 0.0, &mut rng),
        normalizer: Normalizer::new(11, 10.0),
    }
}

fn rollout(lanes: usize) -> Rollout {
    let task = || Task::new(EnvId::Hopper, Reward::Dense, 1000).expect("a task");
    Rollout::new((0..lanes).map(|_| task()).collect(), Seed(0))
}

#[test]
fn means_have_the_bits_of_a_pass_on_the_whole_batch() {
    let mut agent = agent();
    for lanes in [1, 3] {
        let batch = rollout(lanes)
            .collect(&mut agent, 50)
            .expect("physics")
            .batch;
        let mut pass = Pass::default();
        agent.policy.forward(&batch.observations, &mut pass);
        assert_eq!(batch.means, pass.output());
    }
}

#[test]
fn a_replay_ends_where_the_rollout_did() {
    let (mut first, mut second) = (rollout(3), rollout(3));
    let mut agent = agent();
    first.collect(&mut agent, 37).expect("physics"); // so that episodes are under way
    second.restore(first.save()).expect("the same environments");
    let collected = first.collect(&mut agent, 100).expect("physics");
    assert!(
        collected.episodes.len() >= 3,
        "an untrained hopper falls soon"
    );
    second.replay(&collected.batch).expect("physics");
    let lanes = first
        .groups
        .iter()
        .flatten()
        .zip(second.groups.iter().flatten());
    for (index, (one, other)) in lanes.enumerate() {
        assert!(
            one.own.episode.length > 0,
            "this seed's rollout ends within all three episodes"
        );
        assert_eq!(one.task.pose(), other.task.pose(), "environment {index}");
    }
}
