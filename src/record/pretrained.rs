//! Agents trained before their runs, kept for the runs that share them.
//!
//! Each agent is one sealed file in a folder beside all results, named by the hash of everything
//! that decides it: whoever needs the same agent finds it. The folder only saves time: without it,
//! or with a damaged file in it, agents are trained anew, to the same bits.

use std::{path::Path, thread, time::Duration};

use tracing::{info, warn};

use super::{
    Claim, RecordError,
    checkpoint::{read_sealed, write_sealed},
};
use crate::{algo::Agent, train::TrainError};

/// Trains an agent before its run, and calls its argument now and then, as a sign of life.
pub type Pretrain<'a> = dyn FnMut(&mut dyn FnMut()) -> Result<Agent, TrainError> + 'a;

/// The name in the file's first line.
const NAME: &str = "mcpo-run pre-trained agent";

/// The agent of `key` from `folder`; if there is none, the result of `train`, which is then kept
/// there.
///
/// `key` names all that `train` depends on except for `machine`, the class of machine, whose bits
/// may differ. Of several processes that ask for the same agent at once, one trains it and the
/// others wait; `alive` is called now and then meanwhile.
///
/// A damaged file is replaced, with a warning in the log.
///
/// # Errors
///
/// Training fails, or the folder cannot be written to.
pub fn pretrained(
    folder: &Path,
    key: &str,
    machine: (&str, &str),
    train: &mut Pretrain<'_>,
    alive: &mut dyn FnMut(),
) -> Result<Agent, TrainError> {
    let name =
        &blake3::hash(format!("{key} {} {}", machine.0, machine.1).as_bytes()).to_hex()[..32];
    let path = folder.join(name);
    let _claim = lock(&path.with_extension("claim"), alive)?;
    match read_sealed(&path, NAME, key) {
        Ok(Some(agent)) => {
            info!("found the pre-trained agent {name}");
            return Ok(agent);
        }
        Ok(None) => {}
        Err(error) => warn!("{error}; training it again"),
    }
    let agent = train(alive)?;
    write_sealed(&path, NAME, key, &agent)?;
    info!("trained the agent {name}, and kept it for other runs");
    Ok(agent)
}

/// Waits for the claim on `place`.
fn lock(place: &Path, alive: &mut dyn FnMut()) -> Result<Claim, RecordError> {
    const LOOK: Duration = Duration::from_millis(100);
    loop {
        if let Some(claim) = Claim::take_now(place)? {
            return Ok(claim);
        }
        alive();
        thread::sleep(LOOK);
    }
}

impl From<RecordError> for TrainError {
    fn from(error: RecordError) -> Self {
        crate::train::SinkError(error.to_string()).into()
    }
}

#[cfg(test)]
mod tests {
    use std::{
        fs,
        sync::atomic::{AtomicU32, Ordering},
    };

    use super::*;
    use crate::{
        nn::{GaussianPolicy, Mlp, Normalizer},
        rng::{Seed, Stream},
    };

    fn agent(seed: u64) -> Agent {
        let mut rng = Seed(seed).stream(Stream::Network, 0);
        Agent {
            policy: GaussianPolicy::new(2, &[3], 1, 0.5, &mut rng),
            value: Mlp::new(&[2, 3, 1], 0.0, &mut rng),
            normalizer: Normalizer::new(2, 10.0),
        }
    }

    /// What is found or trained under `key`, and whether it was trained.
    fn ask(folder: &Path, key: &str, seed: u64) -> (Agent, bool) {
        let mut trained = false;
        let mut train = |_: &mut dyn FnMut()| {
            trained = true;
            Ok(agent(seed))
        };
        let given = pretrained(folder, key, ("x86_64 fma", "a"), &mut train, &mut || {})
            .expect("a folder to write to");
        (given, trained)
    }

    #[test]
    fn what_fails_keeps_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut fail = |_: &mut dyn FnMut()| Err(TrainError::NoDemonstration);
        assert!(matches!(
            pretrained(folder.path(), "k", ("c", "a"), &mut fail, &mut || {}),
            Err(TrainError::NoDemonstration)
        ));
        assert!(ask(folder.path(), "k", 1).1, "a failure was found");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("written");
        let message = pretrained(&file, "k", ("c", "a"), &mut |_| Ok(agent(1)), &mut || {})
            .expect_err("no folder")
            .to_string();
        assert!(message.contains("file"), "{message}");
    }

    #[test]
    fn a_damaged_file_is_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        ask(folder.path(), "k", 1);
        let files = fs::read_dir(folder.path())
            .expect("readable")
            .map(|entry| entry.expect("an entry").path());
        let path = files
            .into_iter()
            .find(|path| path.extension().is_none())
            .expect("the agent's file");
        let whole = fs::read(&path).expect("readable");
        for place in [0, 40, whole.len() / 2, whole.len() - 1] {
            let mut damaged = whole.clone();
            damaged[place] ^= 1;
            for bytes in [&damaged[..], &whole[..place]] {
                fs::write(&path, bytes).expect("written");
                assert_eq!(
                    ask(folder.path(), "k", 1),
                    (agent(1), true),
                    "damaged at {place}"
                );
                assert_eq!(fs::read(&path).expect("readable"), whole);
            }
        }
        assert_eq!(ask(folder.path(), "k", 2), (agent(1), false));
    }

    #[test]
    fn another_key_or_class_of_machine_is_another_agent() {
        let folder = tempfile::tempdir().expect("a folder");
        ask(folder.path(), "k", 1);
        assert_eq!(ask(folder.path(), "l", 2), (agent(2), true));
        for (n, machine) in [(3, ("aarch64", "a")), (4, ("x86_64 fma", "b"))] {
            let other = pretrained(
                folder.path(),
                "k",
                machine,
                &mut |_| Ok(agent(n)),
                &mut || {},
            )
            .expect("trained");
            assert_eq!(other, agent(n));
        }
    }

    #[test]
    fn waiting_for_another_and_training_are_signs_of_life() {
        let folder = tempfile::tempdir().expect("a folder");
        let (mut here, mut there) = (0, 0);
        std::thread::scope(|scope| {
            let folder = folder.path();
            let (began, has_begun) = std::sync::mpsc::channel();
            let there = &mut there;
            scope.spawn(move || {
                let mut train = |alive: &mut dyn FnMut()| {
                    began.send(()).expect("the other waits");
                    alive();
                    thread::sleep(Duration::from_millis(350));
                    Ok(agent(1))
                };
                pretrained(folder, "k", ("c", "a"), &mut train, &mut || *there += 1)
                    .expect("trained");
            });
            has_begun.recv().expect("the other trains");
            pretrained(folder, "k", ("c", "a"), &mut |_| Ok(agent(2)), &mut || {
                here += 1
            })
            .expect("found");
        });
        assert!(
            here >= 2 && there == 1,
            "{here} while it waited, {there} while it trained"
        );
    }

    #[test]
    fn many_at_once_train_it_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let count = AtomicU32::new(0);
        std::thread::scope(|scope| {
            for seed in 0..8 {
                let (folder, count) = (folder.path(), &count);
                scope.spawn(move || {
                    let mut train = |_: &mut dyn FnMut()| {
                        count.fetch_add(1, Ordering::Relaxed);
                        Ok(agent(seed))
                    };
                    pretrained(folder, "k", ("c", "a"), &mut train, &mut || {})
                        .expect("a folder to write to");
                });
            }
        });
        assert_eq!(count.into_inner(), 1);
    }
}
