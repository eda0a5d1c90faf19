//! The paper's values beside the axes: they hold after training alone.
//!
//! A value far from all curves would flatten them, so the y axis does not reach it: an arrow at its
//! end shows the direction, and the notes give the value.

use super::ticks::Scale;
use crate::report::curve::Panel;

/// How far the paper's values may stretch the y axis to either side, in units of the range that it
/// has without them.
const REACH: f64 = 1.0;

/// Arrows of one direction that stand apart; later ones lie on the last.
const APART: usize = 6;

/// Where one of the paper's values stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Beside {
    /// Within the axis, at its height.
    Within(f64),
    /// Above the axis: its turn among the arrows there, from 0.
    Above(usize),
    /// Below the axis: its turn among the arrows there, from 0.
    Below(usize),
}

/// The paper's values that a panel shows, one for each series.
pub fn values(panel: &Panel) -> impl Iterator<Item = Option<f64>> {
    // A panel without points shows a text instead of lines.
    let drawn = panel
        .curves
        .iter()
        .flatten()
        .any(|curve| !curve.points.is_empty());
    panel
        .curves
        .iter()
        .map(move |curve| curve.as_ref().filter(|_| drawn)?.paper)
}

/// The places of `values` beside the y axis `scale`.
pub fn places(scale: &Scale, values: impl IntoIterator<Item = Option<f64>>) -> Vec<Option<Beside>> {
    let (mut above, mut below) = (0, 0);
    let turn = |count: &mut usize| {
        *count += 1;
        (*count - 1).min(APART - 1)
    };
    let mut place = |value: f64| match scale.fraction(value) {
        fraction if fraction > 1.0 => Beside::Above(turn(&mut above)),
        fraction if fraction >= 0.0 => Beside::Within(value),
        // A logarithm of 0 or less is at the bottom.
        _ => Beside::Below(turn(&mut below)),
    };
    values
        .into_iter()
        .map(|value| value.map(&mut place))
        .collect()
}

/// Whether the y axis is stretched to reach `value`, where it is `own` without the paper's values.
pub fn reached(own: &Scale, value: f64) -> bool {
    (-REACH..=1.0 + REACH).contains(&own.fraction(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_beyond_the_axis_get_arrows_in_turn() {
        let scale = Scale {
            low: -100.0,
            high: 300.0,
            log: false,
        };
        let values = [Some(-5477.0), Some(12.0), None, Some(-2332.0), Some(301.0)];
        let expected = [
            Some(Beside::Below(0)),
            Some(Beside::Within(12.0)),
            None,
            Some(Beside::Below(1)),
            Some(Beside::Above(0)),
        ];
        assert_eq!(places(&scale, values), expected);
        assert!(reached(&scale, -499.0) && !reached(&scale, -501.0));
        assert!(reached(&scale, 699.0) && !reached(&scale, 701.0));
    }

    #[test]
    fn zero_is_below_a_logarithmic_axis() {
        let scale = Scale {
            low: 1e-3,
            high: 1.0,
            log: true,
        };
        assert_eq!(places(&scale, [Some(0.0)]), [Some(Beside::Below(0))]);
        assert!(!reached(&scale, 0.0));
    }
}
