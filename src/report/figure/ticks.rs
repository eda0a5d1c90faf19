//! The ticks of an axis: their places and labels.

use crate::report::axis::{Notation, superscript};

/// An axis from `low` to `high`, in the units of its data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The lower end.
    pub low: f64,
    /// The upper end, above the lower one.
    pub high: f64,
    /// Whether the axis is logarithmic; then both ends are above 0.
    pub log: bool,
}

/// A mark of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// The place of the mark, in the units of the data.
    pub at: f64,
    /// The text at the mark; empty at the small marks between powers of ten.
    pub label: String,
}

impl Scale {
    /// The scale on which all of `values` lie, with some space around them; from 0 to 1 where there
    /// are none. On a logarithmic scale, values that are not positive are ignored.
    pub fn around(values: impl IntoIterator<Item = f64>, log: bool) -> Self {
        let position = |value: f64| if log { value.log10() } else { value };
        let kept = values
            .into_iter()
            .map(position)
            .filter(|position| position.is_finite());
        let (low, high) = kept.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let (low, high) = match (low, high) {
            _ if low > high => (0.0, 1.0),
            _ if high - low <= 1e-9 * high.abs().max(low.abs()) => {
                // A single value gets a range around it, so that it is not drawn on the frame.
                let half = if log || low == 0.0 {
                    0.5
                } else {
                    0.1 * low.abs()
                };
                (low - half, high + half)
            }
            _ => (low, high),
        };
        let air = 0.05 * (high - low);
        let back = |position: f64| if log { 10_f64.powf(position) } else { position };
        Self {
            low: back(low - air),
            high: back(high + air),
            log,
        }
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
        Self {
            low: at(low),
            high: at(high),
            log: self.log,
        }
    }

    /// The marks, about `wanted` of them with a label.
    pub fn ticks(&self, wanted: usize) -> Vec<Tick> {
        if self.log {
            let powers = self.powers(wanted);
            if powers.iter().filter(|tick| !tick.label.is_empty()).count() > 1 {
                return powers;
            }
            let between = self.within_powers();
            if between.len() > 2 {
                return between;
            }
        }
        self.multiples(
            Step::near((self.high - self.low) / wanted.max(1) as f64),
            1e4,
        )
    }

    /// The marks of environment steps, about `wanted` of them (`0`, `1M`, `20k`): whole numbers.
    pub fn step_ticks(&self, wanted: usize) -> Vec<Tick> {
        self.multiples(
            Step::near(((self.high - self.low) / wanted.max(1) as f64).max(1.0)),
            1e3,
        )
    }

    /// Every multiple of `step`; values from `thousands` on may be written with `k`.
    fn multiples(&self, step: Step, thousands: f64) -> Vec<Tick> {
        let width = step.value(1);
        let (first, last) = (
            (self.low / width).ceil() as i64,
            (self.high / width).floor() as i64,
        );
        let multiples: Vec<i64> = (first..=last).collect();
        let labels = step.labels(&multiples, thousands);
        multiples
            .into_iter()
            .map(|multiple| step.value(multiple))
            .zip(labels)
            .map(|(at, label)| Tick { at, label })
            .collect()
    }

    /// Marks at one, two and five times powers of ten, since multiples of one step would crowd the
    /// upper end.
    fn within_powers(&self) -> Vec<Tick> {
        let exponents = self.low.log10().floor() as i32..=self.high.log10().floor() as i32;
        let digits = exponents.flat_map(|exponent| [1, 2, 5].map(|digit| Step { digit, exponent }));
        let values = digits
            .map(|step| step.value(1))
            .filter(|at| (self.low..=self.high).contains(at));
        values
            .map(|at| Tick {
                at,
                label: Notation::Powers.label(&at.into()),
            })
            .collect()
    }

    fn powers(&self, wanted: usize) -> Vec<Tick> {
        let (low, high) = (self.low.log10(), self.high.log10());
        let (first, last) = (low.ceil() as i32, high.floor() as i32);
        let stride = ((last - first + 1) as f64 / wanted.max(1) as f64)
            .round()
            .max(1.0) as i32;
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

/// The distance of marks: `digit` (1, 2 or 5) times ten to the `exponent`. A multiple of it has
/// exact digits, so that no two labels of an axis are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Step {
    digit: i64,
    exponent: i32,
}

impl Step {
    /// The smallest step that is not much smaller than `about`.
    fn near(about: f64) -> Self {
        let least = 0.8 * about;
        let exponent = least.log10().floor() as i32;
        let candidates = [1, 2, 5, 10].map(|digit| Self { digit, exponent });
        let found = candidates
            .into_iter()
            .find(|step| step.value(1) >= least * (1.0 - 1e-9));
        match found {
            Some(Self { digit: 10, .. }) | None => Self {
                digit: 1,
                exponent: exponent + 1,
            },
            Some(step) => step,
        }
    }

    /// The value of a multiple: the number nearest to its digits.
    fn value(self, multiple: i64) -> f64 {
        let digits = i128::from(multiple) * i128::from(self.digit);
        format!("{digits}e{}", self.exponent)
            .parse()
            .unwrap_or(f64::NAN)
    }

    /// The labels of multiples, all in one notation: as digits, with `k` or `M` (`thousands` and a
    /// million at least), or as a power of ten; whichever has the shortest labels.
    fn labels(self, multiples: &[i64], thousands: f64) -> Vec<String> {
        let most = multiples
            .iter()
            .map(|multiple| self.value(*multiple).abs())
            .fold(0.0, f64::max);
        let power = if most > 0.0 {
            most.log10().floor() as i32
        } else {
            0
        };
        let mut notations = vec![(0, String::new())];
        notations.extend((most >= thousands).then(|| (3, "k".to_owned())));
        notations.extend((most >= 1e6).then(|| (6, "M".to_owned())));
        notations.extend(
            (!(-3..9).contains(&power))
                .then(|| (power, format!("·10{}", superscript(&power.to_string())))),
        );
        let labels = |(unit, name): &(i32, String)| -> Vec<String> {
            multiples
                .iter()
                .map(|multiple| self.label(*multiple, *unit, name))
                .collect()
        };
        let length = |labels: &Vec<String>| {
            labels
                .iter()
                .map(|label| label.chars().count())
                .sum::<usize>()
        };
        notations
            .iter()
            .map(labels)
            .min_by_key(length)
            .unwrap_or_default()
    }

    /// The digits of a multiple divided by ten to the `unit`, followed by the unit's `name`.
    fn label(self, multiple: i64, unit: i32, name: &str) -> String {
        let digits = i128::from(multiple) * i128::from(self.digit);
        if digits == 0 {
            return "0".to_owned();
        }
        let sign = if digits < 0 { "−" } else { "" };
        let digits = digits.unsigned_abs().to_string();
        let number = match self.exponent - unit {
            zeros @ 0.. => digits + &"0".repeat(zeros as usize),
            places => {
                let places = places.unsigned_abs() as usize;
                let digits = format!("{digits:0>width$}", width = places + 1);
                format!(
                    "{}.{}",
                    &digits[..digits.len() - places],
                    &digits[digits.len() - places..]
                )
            }
        };
        match (number.as_str(), name.strip_prefix('·')) {
            ("1", Some(power)) => format!("{sign}{power}"),
            _ => format!("{sign}{number}{name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: &[Tick]) -> Vec<&str> {
        ticks
            .iter()
            .map(|tick| tick.label.as_str())
            .filter(|label| !label.is_empty())
            .collect()
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
        let scale = Scale {
            low: -1200.0,
            high: 4300.0,
            log: false,
        };
        assert_eq!(labels(&scale.ticks(3)), ["0", "2000", "4000"]);
        assert_eq!(
            labels(&scale.ticks(6)),
            ["−1000", "0", "1000", "2000", "3000", "4000"]
        );
    }

    #[test]
    fn steps_are_written_short() {
        let scale = Scale {
            low: 0.0,
            high: 3e6,
            log: false,
        };
        assert_eq!(labels(&scale.step_ticks(4)), ["0", "1M", "2M", "3M"]);
        let scale = Scale {
            low: 0.0,
            high: 20_480.0,
            log: false,
        };
        assert_eq!(labels(&scale.step_ticks(3)), ["0", "10k", "20k"]);
    }

    #[test]
    fn a_logarithmic_axis_is_marked_at_powers_of_ten() {
        let scale = Scale {
            low: 5e-6,
            high: 0.3,
            log: true,
        };
        assert_eq!(
            labels(&scale.ticks(6)),
            ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]
        );
        assert_eq!(labels(&scale.ticks(3)), ["10⁻⁴", "10⁻²"]);
        assert!((scale.fraction(5e-6)).abs() < 1e-12 && (scale.fraction(0.3) - 1.0).abs() < 1e-12);
        // The MMD of one tolerance over its annealing.
        let decade = Scale {
            low: 1.2e-4,
            high: 8.4e-3,
            log: true,
        };
        assert_eq!(
            labels(&decade.ticks(6)),
            ["2·10⁻⁴", "5·10⁻⁴", "10⁻³", "2·10⁻³", "5·10⁻³"]
        );
        let narrow = Scale {
            low: 0.02,
            high: 0.05,
            log: true,
        };
        assert_eq!(labels(&narrow.ticks(3)), ["0.02", "0.03", "0.04", "0.05"]);
    }

    #[test]
    fn labels_of_one_axis_have_one_notation_and_differ() {
        let linear = |low, high, wanted| {
            let ticks = Scale {
                low,
                high,
                log: false,
            }
            .ticks(wanted);
            labels(&ticks).join(" ")
        };
        assert_eq!(linear(0.0, 15_500.0, 3), "0 5k 10k 15k");
        assert_eq!(linear(-26_000.0, 1000.0, 3), "−20k −10k 0");
        assert_eq!(linear(12_000.0, 12_003.0, 4), "12000 12001 12002 12003");
        assert_eq!(
            linear(0.99e-4, 1.36e-4, 7),
            "0.000100 0.000105 0.000110 0.000115 0.000120 0.000125 0.000130 0.000135"
        );
        assert_eq!(linear(0.0, 5.2e-8, 5), "0 10⁻⁸ 2·10⁻⁸ 3·10⁻⁸ 4·10⁻⁸ 5·10⁻⁸");
        assert_eq!(linear(0.0, 6.1e23, 3), "0 2·10²³ 4·10²³ 6·10²³");
        assert_eq!(linear(0.0, 0.5, 5), "0 0.1 0.2 0.3 0.4 0.5");
        assert_eq!(linear(0.0, 9500.0, 4), "0 2000 4000 6000 8000");
    }

    /// What a label says, read as a person would.
    fn read(label: &str) -> f64 {
        let plain: String = label
            .chars()
            .map(|c| if c == '−' { '-' } else { c })
            .collect();
        let power_alone = |sign, start| Some((sign, plain.strip_prefix(start)?));
        let split = plain
            .split_once('·')
            .or_else(|| power_alone("1", "10"))
            .or_else(|| power_alone("-1", "-10"));
        let (number, unit) = match split {
            Some((number, power)) if power.contains(|c| "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".contains(c)) =>
            {
                let lowered = |c| "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|raised| raised == c);
                let digits = power
                    .chars()
                    .filter_map(lowered)
                    .map(|place| "-0123456789".as_bytes()[place] as char);
                (
                    number.to_owned(),
                    digits.collect::<String>().parse().expect("a power"),
                )
            }
            _ if plain.ends_with('k') => (plain.trim_end_matches('k').to_owned(), 3),
            _ if plain.ends_with('M') => (plain.trim_end_matches('M').to_owned(), 6),
            _ => (plain, 0),
        };
        format!("{number}e{unit}").parse().expect("a number")
    }

    proptest::proptest! {
        #[test]
        fn every_label_says_where_its_mark_is(
            low in -1.0..1.0_f64,
            width in 1e-6..1.0_f64,
            size in -30..30_i32,
            wanted in 1..12_usize,
            steps: bool,
        ) {
            let scale = Scale {
                low: low * 10_f64.powi(size),
                high: (low + width) * 10_f64.powi(size),
                log: false,
            };
            let ticks = if steps { scale.step_ticks(wanted) } else { scale.ticks(wanted) };
            let labels: std::collections::BTreeSet<&str> = labels(&ticks).into_iter().collect();
            proptest::prop_assert_eq!(labels.len(), ticks.len());
            for tick in &ticks {
                let said = read(&tick.label);
                proptest::prop_assert!(
                    (said - tick.at).abs() <= 1e-14 * tick.at.abs(),
                    "{:?} says {}", tick, said
                );
                proptest::prop_assert!(
                    tick.at >= scale.low * (1.0 - 1e-9) - 1e-300 || tick.at <= scale.high
                );
            }
        }
    }
}
