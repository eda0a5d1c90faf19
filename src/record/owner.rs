//! The owner of a claim.

use std::{
    env, fs, process,
    sync::atomic::{AtomicU64, Ordering},
    time::SystemTime,
};

use serde::{Deserialize, Serialize};

use super::provenance::host;

/// A process that holds a claim.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    /// The cluster's node, or else the machine's name.
    pub host: String,
    /// A text that identifies the machine since its start, and the container; empty where the
    /// system does not tell.
    machine: String,
    /// The process's number there.
    pub process: u32,
    /// When the process began, to tell it from a later one of the same number.
    began: String,
    /// The claim's number, which no other claim has.
    pub(super) number: String,
}

impl Owner {
    /// This process, with a claim of its own.
    pub(super) fn this() -> Self {
        Self::process(process::id())
    }

    /// A process of this machine.
    pub(super) fn process(process: u32) -> Self {
        static CLAIMS: AtomicU64 = AtomicU64::new(0);
        let (host, machine, began) = (
            Self::node(),
            machine(),
            state(process).map(|(_, began)| began).unwrap_or_default(),
        );
        let nth = CLAIMS.fetch_add(1, Ordering::Relaxed);
        let now = SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)
            .unwrap_or_default()
            .as_nanos();
        let whole = format!(
            "{host} {machine} {process} {began} {} {nth} {now}",
            process::id()
        );
        let number = blake3::hash(whole.as_bytes()).to_hex()[..24].to_owned();
        Self {
            host,
            machine,
            process,
            began,
            number,
        }
    }

    /// Whether the process is alive; `None` if that cannot be seen from here.
    pub(super) fn is_alive(&self) -> Option<bool> {
        if self.machine.is_empty() || self.machine != machine() {
            return None;
        }
        Some(
            state(self.process)
                .is_some_and(|(state, began)| !"ZX".contains(state) && began == self.began),
        )
    }

    /// The content of a claim's file for this owner.
    pub(super) fn text(&self) -> Vec<u8> {
        serde_json::to_vec(self)
            .unwrap_or_else(|error| unreachable!("texts and a number are JSON: {error}"))
    }

    /// The owner that a claim's file names.
    pub(super) fn read(text: &[u8]) -> Option<Self> {
        let owner: Self = serde_json::from_slice(text).ok()?;
        // The number becomes part of a file's name, so it must be harmless.
        (owner.number.len() == 24 && owner.number.bytes().all(|c| c.is_ascii_hexdigit()))
            .then_some(owner)
    }

    /// The name of the cluster's node, if there is one, else of the machine.
    pub fn node() -> String {
        env::var("SLURMD_NODENAME").unwrap_or_else(|_| host())
    }
}

/// A text that identifies this machine since its start, and this container; empty where the system
/// does not tell.
fn machine() -> String {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id");
    let processes = fs::read_link("/proc/self/ns/pid");
    match (boot, processes) {
        (Ok(boot), Ok(processes)) => format!("{} {}", boot.trim(), processes.display()),
        _ => String::new(),
    }
}

/// The letter of a process's state, and when the process began; `None` if no process has that
/// number.
fn state(process: u32) -> Option<(char, String)> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name before them, in brackets, may hold anything.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    Some((
        fields.first()?.chars().next()?,
        (*fields.get(19)?).to_owned(),
    ))
}

#[cfg(test)]
impl Owner {
    /// A process on another machine.
    pub(super) fn elsewhere() -> Self {
        Self {
            host: "elsewhere".to_owned(),
            machine: "another boot".to_owned(),
            ..Self::this()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_alive_here_and_unknown_elsewhere() {
        let this = Owner::this();
        assert_eq!(this.is_alive(), Some(true));
        assert_eq!(
            Owner {
                began: "7".to_owned(),
                ..this.clone()
            }
            .is_alive(),
            Some(false),
            "a later one of its number"
        );
        assert_eq!(
            Owner {
                process: u32::MAX,
                ..this.clone()
            }
            .is_alive(),
            Some(false)
        );
        assert_eq!(Owner::elsewhere().is_alive(), None);
        assert_ne!(Owner::this().number, this.number);
    }

    #[test]
    fn a_text_that_would_name_another_file_is_no_owner() {
        let this = Owner::this();
        assert_eq!(Owner::read(&this.text()), Some(this.clone()));
        for number in ["", "../../../../../../../x.y", "xyzxyzxyzxyzxyzxyzxyzxyz"] {
            assert_eq!(
                Owner::read(
                    &Owner {
                        number: number.to_owned(),
                        ..this.clone()
                    }
                    .text()
                ),
                None,
                "{number}"
            );
        }
        assert_eq!(Owner::read(b"somebody's"), None);
    }
}
