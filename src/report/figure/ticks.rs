//! Where an axis is marked, and how.

use crate::report::{
    axis::{number_label, superscript},
    notes,
};

/// An axis from `low` to `high`, in the units of its data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The lower end.
    pub low: f64,
    /// The upper end, above the lower one.
    pub high: f64,
    /// Whether equal distances are equal ratios; then both ends are above 0.
    pub log: bool,
}

/// A mark of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Where, in the units of the data.
    pub at: f64,
    /// What is written there; nothing at the small marks between powers of ten.
    pub label: String,
}

impl Scale {
    /// The scale on which all of `values` lie, with some air; from 0 to 1 where there are none. On a logarithmic one, values
    /// that are not positive do not count.
    pub fn around(values: impl IntoIterator<Item = f64>, log: bool) -> Self {
        let position = |value: f64| if log { value.log10() } else { value };
        let kept = values.into_iter().map(position).filter(|position| position.is_finite());
        let (low, high) = kept.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (low, high) = match (low, high) {
            _ if low > high => (0.0, 1.0),
            _ if high - low <= 1e-9 * high.abs().max(low.abs()) => {
                // One value alone: around it, so that it is not drawn on the frame.
                let half = if log || low == 0.0 { 0.5 } else { 0.1 * low.abs() };
                (low - half, high + half)
            }
            _ => (low, high),
        };
        let air = 0.05 * (high - low);
        let back = |position: f64| if log { 10_f64.powf(position) } else { position };
        Self { low: back(low - air), high: back(high + air), log }
    }

    /// Where `value` lies between the ends: 0 at the lower, 1 at the upper.
    pub fn fraction(&self, value: f64) -> f64 {
        if self.log {
            (value.log10() - self.low.log10()) / (self.high.log10() - self.low.log10())
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// The scale from fraction `low` to fraction `high` of this one.
    pub fn stretched(&self, low: f64, high: f64) -> Self {
        let at = |fraction: f64| match self.log {
            true => self.low * (self.high / self.low).powf(fraction),
            false => self.low + (self.high - self.low) * fraction,
        };
        Self { low: at(low), high: at(high), log: self.log }
    }

    /// The marks, about `wanted` of them with a label.
    pub fn ticks(&self, wanted: usize) -> Vec<Tick> {
        if self.log && (self.high / self.low).log10() >= 1.0 {
            return self.powers(wanted);
        }
        let step = round_step((self.high - self.low) / wanted.max(1) as f64);
        let whole = |decimals: &usize| (step * 10_f64.powi(*decimals as i32)).fract().abs() < 1e-6;
        let decimals = (0..12).find(whole).unwrap_or(12);
        self.multiples(step).into_iter().map(|at| Tick { at, label: number(at, decimals) }).collect()
    }

    /// The marks of environment steps, about `wanted` of them (`0`, `1M`, `20k`).
    pub fn step_ticks(&self, wanted: usize) -> Vec<Tick> {
        let step = round_step((self.high - self.low) / wanted.max(1) as f64).max(1.0);
        self.multiples(step).into_iter().map(|at| Tick { at, label: notes::steps(at as u64) }).collect()
    }

    fn multiples(&self, step: f64) -> Vec<f64> {
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        (first..=last).map(|index| index as f64 * step).collect()
    }

    fn powers(&self, wanted: usize) -> Vec<Tick> {
        let (low, high) = (self.low.log10(), self.high.log10());
        let (first, last) = (low.ceil() as i32, high.floor() as i32);
        let stride = ((last - first + 1) as f64 / wanted.max(1) as f64).round().max(1.0) as i32;
        let mut ticks = Vec::new();
        for exponent in low.floor() as i32..=last {
            let power = 10_f64.powi(exponent);
            let labelled = exponent >= first && exponent.rem_euclid(stride) == 0;
            let digits = if stride == 1 { 1..10 } else { 1..2 };
            for digit in digits {
                let at = f64::from(digit) * power;
                if at >= self.low && at <= self.high {
                    let label = match digit {
                        1 if labelled => format!("10{}", superscript(&exponent.to_string())),
                        _ => String::new(),
                    };
                    ticks.push(Tick { at, label });
                }
            }
        }
        ticks
    }
}

/// The next of 1, 2, 2.5, 5, 10 times a power of ten; a little less will do.
fn round_step(about: f64) -> f64 {
    let least = 0.8 * about;
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|digit| digit * power)
        .into_iter()
        .find(|step| *step >= least * (1.0 - 1e-9))
        .unwrap_or(least)
}

/// `−2000`, `0.25`, `10k`, `2.5M`: short, with a true minus.
fn number(value: f64, decimals: usize) -> String {
    let size = value.abs();
    if size >= 1e9 {
        return number_label(value);
    }
    let sign = if value < 0.0 { "−" } else { "" };
    let text = if size >= 1e4 { notes::steps(size as u64) } else { format!("{size:.decimals$}") };
    format!("{sign}{text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|tick| tick.label.as_str()).filter(|label| !label.is_empty()).collect()
    }

    #[test]
    fn nothing_and_one_value_still_make_an_axis() {
        for values in [vec![], vec![0.0], vec![1000.0], vec![f64::NAN], vec![-5.0]] {
            let scale = Scale::around(values.iter().copied(), false);
            assert!(scale.low < scale.high, "{values:?}: {scale:?}");
            assert!(scale.ticks(5).len() >= 2, "{values:?}: {scale:?}");
        }
        let log = Scale::around([0.0, -1.0], true);
        assert!(log.low > 0.0 && log.low < log.high);
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let scale = Scale { low: -1200.0, high: 4300.0, log: false };
        assert_eq!(labels(&scale.ticks(3)), ["0", "2000", "4000"]);
        assert_eq!(labels(&scale.ticks(6)), ["−1000", "0", "1000", "2000", "3000", "4000"]);
    }

    #[test]
    fn steps_are_written_short() {
        let scale = Scale { low: 0.0, high: 3e6, log: false };
        assert_eq!(labels(&scale.step_ticks(4)), ["0", "1M", "2M", "3M"]);
        let scale = Scale { low: 0.0, high: 20_480.0, log: false };
        assert_eq!(labels(&scale.step_ticks(3)), ["0", "10k", "20k"]);
    }

    #[test]
    fn a_logarithmic_axis_is_marked_at_powers_of_ten() {
        let scale = Scale { low: 5e-6, high: 0.3, log: true };
        assert_eq!(labels(&scale.ticks(6)), ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]);
        assert_eq!(labels(&scale.ticks(3)), ["10⁻⁴", "10⁻²"]);
        assert!((scale.fraction(5e-6)).abs() < 1e-12 && (scale.fraction(0.3) - 1.0).abs() < 1e-12);
        let narrow = Scale { low: 0.02, high: 0.05, log: true };
        assert_eq!(labels(&narrow.ticks(3)), ["0.02", "0.03", "0.04", "0.05"]);
    }

    #[test]
    fn large_numbers_are_short() {
        assert_eq!(
            [number(-25_000.0, 0), number(9000.0, 0), number(0.25, 2), number(-0.5, 1)],
            ["−25k", "9000", "0.25", "−0.5"]
        );
    }
}
