//! Wall-clock time, and the time that this process worked.

use std::{ops::AddAssign, time::Instant};

use rustix::time::{ClockId, clock_gettime};

/// Seconds by two clocks.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seconds {
    /// Seconds by the wall clock.
    pub wall: f64,
    /// Seconds on a core, all threads together: other work on the machine does not stretch them.
    pub cpu: f64,
}

impl AddAssign for Seconds {
    fn add_assign(&mut self, other: Self) {
        self.wall += other.wall;
        self.cpu += other.cpu;
    }
}

/// The result of `work`, and how long it took.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, Seconds) {
    let (wall, cpu) = (Instant::now(), cpu_seconds());
    let result = work();
    (
        result,
        Seconds {
            wall: wall.elapsed().as_secs_f64(),
            cpu: cpu_seconds() - cpu,
        },
    )
}

fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
