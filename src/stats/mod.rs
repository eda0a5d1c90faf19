//! Statistics over seeds.

/// A mean with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The sample mean.
    pub mean: f64,
    /// Lower end; the mean itself for one sample.
    pub low: f64,
    /// Upper end; the mean itself for one sample.
    pub high: f64,
}

/// The mean of `samples` with its two-sided Student t interval at `confidence` (such as 0.95); `None` for no samples.
pub fn t_interval(samples: &[f64], confidence: f64) -> Option<Interval> {
    let _ = (samples, confidence);
    todo!()
}
