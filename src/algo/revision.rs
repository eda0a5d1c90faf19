//! Which parts of the program decide an algorithm's numbers, and the revision of each.
//!
//! Owns the table of who uses whom: a change in PPO makes the runs of all that train by PPO stale, and no others. Each
//! part's revision stands beside its code, as its `REVISION`. Start at [`of`].

use std::collections::BTreeMap;

use super::{
    adversarial, cloning, critic, discriminator, gae, gail, mcpo, mimicry, mmd_il, penalty, pofd, ppo, pretraining,
    trpo, trust_region,
};

/// What every run shares: networks, the normaliser, rollouts and evaluations. Raise it when one of these gives other numbers;
/// a change in a solver raises the parts that use it.
const TRAINING: u32 = 1;

/// A file of this module that computes something.
pub struct Part {
    /// The file's name.
    pub name: &'static str,
    /// Raised whenever its numbers change.
    pub revision: u32,
    /// The other parts that its numbers depend on.
    pub uses: &'static [&'static str],
}

/// All parts, each below those that it uses.
pub const PARTS: [Part; 15] = [
    Part { name: "critic", revision: critic::REVISION, uses: &[] },
    Part { name: "gae", revision: gae::REVISION, uses: &[] },
    Part { name: "trust_region", revision: trust_region::REVISION, uses: &[] },
    Part { name: "cloning", revision: cloning::REVISION, uses: &[] },
    Part { name: "discriminator", revision: discriminator::REVISION, uses: &[] },
    Part { name: "adversarial", revision: adversarial::REVISION, uses: &["discriminator"] },
    Part { name: "mimicry", revision: mimicry::REVISION, uses: &["critic", "gae", "trust_region"] },
    Part { name: "ppo", revision: ppo::REVISION, uses: &["critic", "gae"] },
    Part { name: "trpo", revision: trpo::REVISION, uses: &["critic", "gae", "trust_region"] },
    Part { name: "mcpo", revision: mcpo::REVISION, uses: &["critic", "gae", "mimicry", "trust_region"] },
    Part { name: "pretraining", revision: pretraining::REVISION, uses: &["cloning", "ppo"] },
    Part { name: "pofd", revision: pofd::REVISION, uses: &["adversarial", "discriminator", "ppo", "trpo"] },
    Part { name: "gail", revision: gail::REVISION, uses: &["adversarial", "discriminator", "ppo", "trpo"] },
    Part { name: "mmd_il", revision: mmd_il::REVISION, uses: &["mimicry", "trpo", "trust_region"] },
    Part { name: "penalty", revision: penalty::REVISION, uses: &["critic", "gae", "mimicry", "trpo", "trust_region"] },
];

/// The revisions, by part, that the numbers of `algorithm` depend on.
pub fn of(algorithm: &str) -> BTreeMap<String, u32> {
    let mut revisions = BTreeMap::from([("training".to_owned(), TRAINING)]);
    let mut wanted = vec![match algorithm {
        "expert" => "ppo",
        "bc" => "cloning",
        name => name,
    }];
    while let Some(name) = wanted.pop() {
        let part = PARTS.iter().find(|part| part.name == name);
        revisions.extend(part.map(|part| (name.to_owned(), part.revision)));
        wanted.extend(part.into_iter().flat_map(|part| part.uses));
    }
    revisions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_makes_its_users_stale_and_no_others() {
        let users = |part: &str| {
            let algorithms =
                ["mcpo", "ppo", "pretraining", "pofd", "mmd_il", "expert", "random", "trpo", "gail", "bc", "penalty"];
            algorithms.into_iter().filter(|name| of(name).contains_key(part)).collect::<Vec<_>>()
        };
        assert_eq!(users("mcpo"), ["mcpo"]);
        assert_eq!(users("ppo"), ["ppo", "pretraining", "pofd", "expert", "gail"]);
        assert_eq!(users("mimicry"), ["mcpo", "mmd_il", "penalty"]);
        assert_eq!(users("cloning"), ["pretraining", "bc"]);
        assert_eq!(users("training").len(), 11);
        assert_eq!(of("random").len(), 1);
    }
}
