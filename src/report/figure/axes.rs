//! The axes of a panel: where they are, and which values lie on them.

use super::{
    beside,
    ticks::{Scale, Tick},
};
use crate::{
    report::curve::{Across, Curve, CurveData, Panel},
    spec::Band,
};

/// The inside of the axes, with their scales. Heights grow downwards.
pub struct Axes {
    /// The left edge.
    pub left: f64,
    /// The right edge.
    pub right: f64,
    /// The upper edge.
    pub top: f64,
    /// The lower edge.
    pub bottom: f64,
    /// The x axis.
    pub x: Scale,
    /// The y axis.
    pub y: Scale,
}

impl Axes {
    /// The place of a point.
    pub fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.across(x), self.height_of(y))
    }

    /// The x coordinate of a value.
    pub fn across(&self, x: f64) -> f64 {
        self.left + self.x.fraction(x) * (self.right - self.left)
    }

    /// The y coordinate of a value; that of the frame where the value lies outside.
    pub fn height_of(&self, y: f64) -> f64 {
        let height = self.bottom - self.y.fraction(y) * (self.bottom - self.top);
        // A logarithm of 0 or less is at the bottom.
        if height.is_nan() {
            self.bottom
        } else {
            height.clamp(self.top, self.bottom)
        }
    }
}

/// The x axis: from 0 to a little beyond the last point, or the range of scores.
pub fn x_scale(data: &CurveData, panel: &Panel) -> Scale {
    let (low, high) = match data.across {
        Across::Scores(low, high) => (low, high),
        Across::Steps => {
            let points = panel
                .curves
                .iter()
                .flatten()
                .flat_map(|curve| &curve.points);
            let end = points.map(|point| point.env_steps).fold(0.0, f64::max);
            (0.0, if end > 0.0 { end * 1.02 } else { 1.0 })
        }
    };
    Scale {
        low,
        high,
        log: false,
    }
}

/// The marks of the x axis.
pub fn x_ticks(data: &CurveData, x: &Scale, wanted: usize) -> Vec<Tick> {
    match data.across {
        Across::Steps => x.step_ticks(wanted),
        Across::Scores(..) => x.ticks(wanted),
    }
}

/// The y axis: all means and the demonstration lie inside, and the paper's values as far as it
/// [reaches](beside). Bands extend it by at most half that range to either side, since the wide
/// interval of two seeds would otherwise flatten the curves.
pub fn y_scale(data: &CurveData, panel: &Panel) -> Scale {
    let curves = || panel.curves.iter().flatten();
    let values: Vec<f64> = curves()
        .flat_map(|curve| {
            let means = curve.points.iter().map(|point| point.mean);
            let singles = drawn_singles(data, curve).flatten().map(|point| point.1);
            let raw = curve.raw.iter().map(|point| point.1);
            means
                .chain(singles)
                .chain(raw)
                .chain(curve.tolerance.iter().map(|point| point.1))
        })
        .chain(panel.demo)
        .collect();
    let own = Scale::around(values.iter().copied(), data.log_y);
    // Curves of one height have no range that could be a measure.
    let flat = values.windows(2).all(|pair| pair[0] == pair[1]);
    let papers = beside::values(panel)
        .flatten()
        .filter(|paper| flat || beside::reached(&own, *paper));
    let inner = Scale::around(values.iter().copied().chain(papers), data.log_y);
    let bands = curves()
        .flat_map(|curve| &curve.points)
        .filter_map(|point| point.band);
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    for band in bands {
        low = low.min(inner.fraction(band.0).max(-0.5));
        high = high.max(inner.fraction(band.1).min(1.5));
    }
    inner.stretched(low, high)
}

/// The seeds that get a line of their own.
pub fn drawn_singles<'a>(
    data: &CurveData,
    curve: &'a Curve,
) -> impl Iterator<Item = &'a Vec<(f64, f64)>> {
    let wanted = data.band == Band::Seeds;
    curve
        .singles
        .iter()
        .filter(move |_| wanted)
        .map(|single| &single.points)
}
