//! Measures where an update's time goes, for `mcpo-run bench`.

use std::time::Instant;

/// Seconds of an update's parts, one after the other.
#[derive(Debug)]
pub struct Stopwatch {
    since: Instant,
    laps: Vec<(String, f64)>,
}

impl Stopwatch {
    /// Starts the first part.
    pub fn start() -> Self {
        Self {
            since: Instant::now(),
            laps: Vec::new(),
        }
    }

    /// Ends the part `name`, and starts the next; parts of one name add up.
    pub fn lap(&mut self, name: &str) {
        let seconds = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        match self.laps.iter_mut().find(|(known, _)| known == name) {
            Some((_, sum)) => *sum += seconds,
            None => self.laps.push((name.to_owned(), seconds)),
        }
    }

    /// The parts in the order of their first end.
    pub fn laps(self) -> Vec<(String, f64)> {
        self.laps
    }
}
