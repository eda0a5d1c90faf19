//! The parts of the program that decide an algorithm's numbers, and the revision of each.
//!
//! Owns the walk from an algorithm to all that it uses: a change in PPO makes the runs of all that
//! train by PPO stale, and no others. Each part stands beside its code, as its `PART`. Start at
//! [`of`].

use std::collections::BTreeMap;

/// The revision of networks, the normaliser, rollouts and evaluations, which every run shares.
/// Raise it when one of these gives other numbers; a change in a solver raises the parts that use
/// it.
const TRAINING: u32 = 1;

/// A file whose results an algorithm's numbers depend on.
#[derive(Debug)]
pub struct Part {
    /// The file's name.
    pub name: &'static str,
    /// Raised whenever its numbers change.
    pub revision: u32,
    /// The other parts that its numbers depend on.
    pub uses: &'static [&'static Part],
}

/// The revisions, by part, that an algorithm's numbers depend on, whose own part is `part`; only
/// the revision of training if it has none.
pub fn of(part: Option<&'static Part>) -> BTreeMap<String, u32> {
    let mut revisions = BTreeMap::from([("training".to_owned(), TRAINING)]);
    let mut wanted: Vec<&Part> = part.into_iter().collect();
    while let Some(part) = wanted.pop() {
        revisions.insert(part.name.to_owned(), part.revision);
        wanted.extend(part.uses);
    }
    revisions
}

#[cfg(test)]
mod tests {
    use super::super::catalogue;

    #[test]
    fn a_change_makes_its_users_stale_and_no_others() {
        let revisions =
            |name: &str| super::of(catalogue::find(name).expect("a known name").about().part);
        let users = |part: &str| {
            let names = catalogue::all().map(|entry| entry.about().name);
            names
                .filter(|name| revisions(name).contains_key(part))
                .collect::<Vec<_>>()
        };
        assert_eq!(users("mcpo"), ["mcpo"]);
        assert_eq!(
            users("ppo"),
            ["ppo", "pretraining", "pofd", "expert", "gail"]
        );
        assert_eq!(users("mimicry"), ["mcpo", "mmd_il", "penalty"]);
        assert_eq!(users("cloning"), ["pretraining", "bc"]);
        assert_eq!(users("training").len(), 11);
        assert_eq!(revisions("random").len(), 1);
    }
}
