//! How the lines of a figure look: colours, markers, dashes.
//!
//! A look is a number. The first twelve differ in colour and marker, and in their dashes too where
//! their colours look alike in grey; later ones have the same colours with other markers.

use super::{
    picture::{Color, Shape},
    style::{GREY, PALETTE, Sheet},
};

/// Opacity of a band.
pub const BAND: f64 = 0.16;
/// The share of the colour, mixed with white, in the line of a single seed and of a curve before
/// smoothing.
const FAINT: f64 = 0.4;

/// The dash patterns: lengths of dash and gap in turn, in points at the screen's size.
const PATTERNS: [&[f64]; 4] = [&[], &[8.0, 2.5], &[9.0, 2.0, 2.0, 2.0], &[3.5, 1.8]];
/// The pattern of each colour: colours of one pattern are far apart in lightness, so that grey
/// tells them apart too.
const PATTERN_OF: [usize; 12] = [0, 1, 2, 3, 0, 3, 2, 1, 0, 2, 3, 1];
const PAPER: [f64; 2] = [4.0, 2.0];
const DEMO: [f64; 2] = [1.5, 2.5];
const TOLERANCE: [f64; 2] = [1.5, 1.8];

/// A kind of line that the legend explains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// The curve of a series with this look.
    Series(usize),
    /// The paper's value, in its series' colour.
    Paper,
    /// The demonstration's return.
    Demo,
    /// The tolerance of a series.
    Tolerance,
}

impl Look {
    /// Its line in the legend, from `at` to the right.
    pub fn key(self, sheet: &Sheet, at: (f64, f64), width: f64) -> Vec<Shape> {
        let points = [at, (at.0 + width, at.1)];
        let mut shapes = self.line(sheet, &points, GREY);
        if let Self::Series(look) = self {
            shapes.extend(marker(sheet, look, (at.0 + width / 2.0, at.1)));
        }
        shapes
    }

    /// Its line through `points`; `color` where the look has none of its own.
    pub fn line(self, sheet: &Sheet, points: &[(f64, f64)], color: Color) -> Vec<Shape> {
        let (width, color, pattern): (f64, Color, &[f64]) = match self {
            Self::Series(look) => (1.0, self::color(look), PATTERNS[pattern(look)]),
            Self::Paper => (1.1, color, &PAPER),
            Self::Demo => (0.75, GREY, &DEMO),
            Self::Tolerance => (0.9, color, &TOLERANCE),
        };
        let pattern: Vec<f64> = pattern.iter().map(|&length| sheet.scaled(length)).collect();
        let width = width * sheet.curve;
        dashes(points, &pattern)
            .into_iter()
            .map(|points| Shape::Line {
                points,
                width,
                color,
            })
            .collect()
    }
}

/// The colour of a look.
pub fn color(look: usize) -> Color {
    PALETTE[look % PALETTE.len()]
}

/// The colour of lines behind the curve of a look. It is opaque, since a transparent line would
/// show where it crosses itself.
pub fn faint(look: usize) -> Color {
    color(look).map(|channel| (255.0 - FAINT * (255.0 - f64::from(channel))).round() as u8)
}

/// How many times the palette was used up before this look.
fn round(look: usize) -> usize {
    look / PALETTE.len()
}

/// Which of the four dash patterns a look has.
pub fn pattern(look: usize) -> usize {
    (PATTERN_OF[look % PALETTE.len()] + round(look)) % PATTERNS.len()
}

/// The marker of a look, edged in white so that it stands off its curve.
pub fn marker(sheet: &Sheet, look: usize, at: (f64, f64)) -> [Shape; 2] {
    let size = sheet.marker;
    [
        shape(look, at, size + sheet.scaled(0.9), [0xff; 3]),
        shape(look, at, size, color(look)),
    ]
}

/// A small marker, for a point that no line leads to.
pub fn dot(sheet: &Sheet, look: usize, at: (f64, f64)) -> Shape {
    shape(look, at, sheet.marker / 2.0, color(look))
}

fn shape(look: usize, at: (f64, f64), radius: f64, color: Color) -> Shape {
    let points = outline(look)
        .iter()
        .map(|(x, y)| (at.0 + x * radius, at.1 + y * radius))
        .collect();
    Shape::Area {
        points,
        color,
        opacity: 1.0,
    }
}

/// A shape of about the unit circle's size; twelve different ones, shifted against the colours in
/// each round.
pub fn outline(look: usize) -> Vec<(f64, f64)> {
    let polygon = |corners: usize, first: f64| {
        let corner = move |corner: usize| {
            let angle = (first + 360.0 * corner as f64 / corners as f64).to_radians();
            (angle.cos(), angle.sin())
        };
        (0..corners).map(corner).collect::<Vec<_>>()
    };
    // Shapes with corners look smaller than a circle of the same radius.
    let larger = |factor: f64, points: Vec<(f64, f64)>| -> Vec<(f64, f64)> {
        points
            .into_iter()
            .map(|(x, y)| (x * factor, y * factor))
            .collect()
    };
    let star = |tips: usize, inner: f64| {
        let corner = |corner: usize| {
            let angle = (360.0 * corner as f64 / (2 * tips) as f64 - 90.0).to_radians();
            let radius = if corner.is_multiple_of(2) { 1.0 } else { inner };
            (radius * angle.cos(), radius * angle.sin())
        };
        (0..2 * tips).map(corner).collect::<Vec<_>>()
    };
    match (look + round(look)) % PALETTE.len() {
        // At this size, 24 corners pass for a circle.
        0 => polygon(24, 0.0),
        1 => larger(1.2, polygon(4, 45.0)),
        2 => larger(1.3, polygon(3, -90.0)),
        3 => larger(1.25, polygon(4, 0.0)),
        4 => larger(1.3, polygon(3, 90.0)),
        5 => plus(),
        6 => larger(1.1, polygon(6, 0.0)),
        7 => larger(1.3, polygon(3, 0.0)),
        8 => larger(1.5, star(5, 0.42)),
        9 => {
            let diagonal = std::f64::consts::FRAC_1_SQRT_2;
            plus()
                .into_iter()
                .map(|(x, y)| (diagonal * (x - y), diagonal * (x + y)))
                .collect()
        }
        10 => larger(1.3, polygon(3, 180.0)),
        _ => larger(1.5, star(4, 0.35)),
    }
}

fn plus() -> Vec<(f64, f64)> {
    let (long, short) = (1.2, 0.42);
    let corners = [(short, long), (short, short), (long, short)];
    let quarter = |turn: usize| {
        corners.map(|(x, y)| match turn {
            0 => (x, y),
            1 => (y, -x),
            2 => (-x, -y),
            _ => (-y, x),
        })
    };
    (0..4).flat_map(quarter).collect()
}

/// The line through `points`, cut into dashes by `pattern` (lengths of dash and gap in turn); whole
/// for no pattern.
fn dashes(points: &[(f64, f64)], pattern: &[f64]) -> Vec<Vec<(f64, f64)>> {
    if pattern.is_empty() {
        return vec![points.to_vec()];
    }
    let (mut dashes, mut dash) = (Vec::new(), points[..1].to_vec());
    let (mut phase, mut left) = (0, pattern[0]);
    for ends in points.windows(2) {
        let (mut from, to) = (ends[0], ends[1]);
        loop {
            let length = (to.0 - from.0).hypot(to.1 - from.1);
            if length < left {
                left -= length;
                dash.push(to);
                break;
            }
            let share = left / length;
            from = (
                from.0 + share * (to.0 - from.0),
                from.1 + share * (to.1 - from.1),
            );
            dash.push(from);
            if phase % 2 == 0 {
                dashes.push(std::mem::take(&mut dash));
            }
            dash = vec![from];
            phase += 1;
            left = pattern[phase % pattern.len()];
        }
    }
    if phase % 2 == 0 && dash.len() > 1 {
        dashes.push(dash);
    }
    dashes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_go_around_corners_and_keep_their_lengths() {
        let dashes = dashes(&[(0.0, 0.0), (3.0, 0.0), (3.0, 7.0)], &[4.0, 2.0]);
        assert_eq!(
            dashes,
            [
                vec![(0.0, 0.0), (3.0, 0.0), (3.0, 1.0)],
                vec![(3.0, 3.0), (3.0, 7.0)]
            ]
        );
    }

    #[test]
    fn no_two_of_a_hundred_series_look_alike_and_twelve_differ_in_colour_and_marker() {
        let look = |index: usize| (color(index), outline(index));
        for one in 0..100 {
            for other in 0..one {
                let (left, right) = (look(one), look(other));
                assert!(left != right, "{one} looks like {other}");
                assert!(
                    one >= 12 || (left.0 != right.0 && left.1 != right.1),
                    "{one} is half of {other}"
                );
            }
        }
    }

    /// CIE 1976: lightness, and the two axes of colour.
    fn lab(color: Color) -> [f64; 3] {
        let linear = color.map(|channel| {
            let share = f64::from(channel) / 255.0;
            if share <= 0.04045 {
                share / 12.92
            } else {
                ((share + 0.055) / 1.055).powf(2.4)
            }
        });
        let [x, y, z] = [
            [0.4124 / 0.9505, 0.3576 / 0.9505, 0.1805 / 0.9505],
            [0.2126, 0.7152, 0.0722],
            [0.0193 / 1.089, 0.1192 / 1.089, 0.9505 / 1.089],
        ]
        .map(|row| {
            let share: f64 = row
                .iter()
                .zip(linear)
                .map(|(weight, channel)| weight * channel)
                .sum();
            if share > 0.008856 {
                share.cbrt()
            } else {
                7.787 * share + 16.0 / 116.0
            }
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// Below a distance of about 10 two thin lines are hard to tell apart.
    #[test]
    fn colours_are_far_apart_and_in_grey_those_of_one_dash_are() {
        for (one, &color) in PALETTE.iter().enumerate() {
            for other in (0..one).filter(|other| pattern(*other) == pattern(one)) {
                let apart = (lab(color)[0] - lab(PALETTE[other])[0]).abs();
                assert!(
                    apart > 9.0,
                    "looks {one} and {other} are {apart:.0} apart in grey and have one dash"
                );
            }
        }
        for (one, &color) in PALETTE.iter().enumerate() {
            for (other, &before) in PALETTE[..one].iter().enumerate() {
                let (left, right) = (lab(color), lab(before));
                let distance = left
                    .iter()
                    .zip(right)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>()
                    .sqrt();
                assert!(
                    distance > 25.0,
                    "colours {one} and {other} are {distance:.0} apart"
                );
            }
        }
    }
}
