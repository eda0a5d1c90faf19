//! Counts and steps in words.

/// A count with its noun in the right number: `1 seed`, `3 seeds`.
pub fn count(number: usize, what: &str) -> String {
    if number == 1 {
        format!("1 {what}")
    } else {
        format!("{number} {what}s")
    }
}

/// A number of environment steps in few characters: `500`, `20k`, `1.5M`.
pub fn steps(steps: u64) -> String {
    match steps {
        0..1_000 => steps.to_string(),
        1_000..1_000_000 => format!("{}k", round(steps as f64 / 1e3)),
        _ => format!("{}M", round(steps as f64 / 1e6)),
    }
}

/// `number` with at most two decimals.
fn round(number: f64) -> f64 {
    (number * 100.0).round() / 100.0
}
