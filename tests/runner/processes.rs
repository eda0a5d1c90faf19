//! Signals to processes, and waiting for what they do; also for the tests on Slurm.

use std::{
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

/// What takes longer than this hangs.
const PATIENCE: Duration = Duration::from_secs(300);

/// Sends `signal` to a process; gives whether it was there.
pub fn signal(signal: &str, process: u32) -> bool {
    let mut kill = Command::new("kill");
    kill.args([&format!("-{signal}"), &process.to_string()])
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

/// The first answer of `ask`.
pub fn wait_for<T>(what: &str, ask: impl Fn() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(began.elapsed() < PATIENCE, "waited for {what} in vain");
        thread::sleep(Duration::from_millis(2));
    }
}
