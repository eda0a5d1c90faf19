//! Signals: the first one asks for a clean stop, the second one leaves at once.

use std::{
    fs, io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

/// The exit code of an interrupted program.
pub const INTERRUPTED: u8 = 130;

/// A request to stop, which is made or not yet made.
#[derive(Debug, Clone, Default)]
pub struct StopRequest {
    by_signal: Arc<AtomicBool>,
    /// Whether the signal was a cluster's warning.
    by_warning: Arc<AtomicBool>,
    /// Kept apart from signals, so that the first signal after such a request still counts as the
    /// first.
    by_program: Arc<AtomicBool>,
    /// The time at which the request is made by itself.
    deadline: Option<Instant>,
}

impl StopRequest {
    /// A request that signals make: SIGINT (Ctrl-C), SIGTERM, SIGUSR1 (a cluster's warning) and
    /// SIGHUP (the terminal is gone). Signals that this process was started to ignore do not count
    /// (`nohup` ignores SIGHUP). A second signal ends the process at once with code 130.
    ///
    /// # Errors
    ///
    /// The system refuses the handlers.
    pub fn on_signals() -> io::Result<Self> {
        let request = Self::default();
        let ignored = ignored();
        for signal in [SIGINT, SIGTERM, SIGUSR1, SIGHUP]
            .into_iter()
            .filter(|signal| ignored >> (signal - 1) & 1 == 0)
        {
            // The order matters: the signal that makes the request must not see it as already made.
            signal_hook::flag::register_conditional_shutdown(
                signal,
                INTERRUPTED.into(),
                request.by_signal.clone(),
            )?;
            signal_hook::flag::register(signal, request.by_signal.clone())?;
            if signal == SIGUSR1 {
                signal_hook::flag::register(signal, request.by_warning.clone())?;
            }
        }
        Ok(request)
    }

    /// The same request, which is also made when `time` has passed from now on.
    pub fn or_after(self, time: Duration) -> Self {
        Self {
            deadline: Instant::now().checked_add(time),
            ..self
        }
    }

    /// Makes the request.
    pub fn make(&self) {
        self.by_program.store(true, Ordering::SeqCst);
    }

    /// Whether it was made by a cluster's warning that the time is nearly up.
    pub fn is_warning(&self) -> bool {
        self.by_warning.load(Ordering::SeqCst)
    }

    /// Whether the request is made.
    pub fn is_made(&self) -> bool {
        let is_late = || {
            self.deadline
                .is_some_and(|deadline| Instant::now() >= deadline)
        };
        self.by_signal.load(Ordering::SeqCst) || self.by_program.load(Ordering::SeqCst) || is_late()
    }
}

/// The signals that this process ignores, one bit each, the lowest that of signal 1; none where the
/// system does not tell.
fn ignored() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_seen_by_every_copy() {
        let request = StopRequest::default();
        let copy = request.clone();
        assert!(!copy.is_made());
        request.make();
        assert!(copy.is_made());
    }

    #[test]
    fn a_request_makes_itself_when_its_time_is_up() {
        let request = StopRequest::default().or_after(Duration::from_millis(100));
        assert!(!request.is_made() && !StopRequest::default().or_after(Duration::MAX).is_made());
        std::thread::sleep(Duration::from_millis(150));
        assert!(request.is_made());
    }
}
