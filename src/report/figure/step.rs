//! One step of MCPO on a problem of two parameters, as in the paper's Figure 1: drawn from the
//! solver that trains.
//!
//! Owns the problem and its sketch. Knows nothing of runs. Start at [`draw`].
//!
//! The objective has a lower summit near the current policy and a higher one beyond it, to which
//! the demonstration points, although it is not on it. The trust region's best step climbs the
//! lower summit; the half-plane in which the linearised mimicry constraint holds turns it towards
//! the higher one.

use crate::{
    report::ReportError,
    solver::{LinearConstraint, LinearOperator, conjugate_gradient::Limits, constrained_step},
};

use super::{
    picture::{Anchor, Color, Picture, Shape},
    style::{BLACK, PALETTE, Sheet},
    words::text,
};

type Point = (f64, f64);

/// The summits of the objective: place, height and breadth of each.
const SUMMITS: [(Point, f64, f64); 2] = [((-1.15, 0.75), 0.6, 0.62), ((1.65, 0.85), 1.0, 0.68)];
/// The policy that imitates the demonstration best; D is the squared distance from it.
const DEMONSTRATION: Point = (1.1, 0.7);
/// The tolerance of D.
const TOLERANCE: f64 = 1.25;
/// The policy before the step.
const CURRENT: Point = (0.0, 0.0);
/// The Hessian of the KL divergence there.
const HESSIAN: [[f64; 2]; 2] = [[1.0, 0.3], [0.3, 1.3]];
/// The radius of the trust region.
const RADIUS: f64 = 0.22;
/// The part of the plane that is drawn: left, right, bottom, top.
const WINDOW: [f64; 4] = [-2.2, 2.7, -1.2, 1.9];
const LEVELS: usize = 9;
/// Cells along each side of the grid on which contours are found.
const CELLS: usize = 90;

const WITHOUT: Color = PALETTE[1];
const WITH: Color = PALETTE[0];
const MIMICRY: Color = PALETTE[2];
const CONTOUR: Color = [0xc4, 0xc4, 0xc4];

/// The sketch, `inches` wide.
///
/// # Errors
///
/// The solver finds no step, which the tests rule out.
pub fn draw(inches: Option<f64>) -> Result<Picture, ReportError> {
    let sheet = Sheet::print(inches.unwrap_or(3.25));
    let [left, right, bottom, top] = WINDOW;
    let (label, width) = (
        1.5 * sheet.text,
        sheet.width - 2.0 * sheet.margin - 1.5 * sheet.text,
    );
    let plane = Plane {
        left: sheet.margin + label,
        top: sheet.margin,
        // One unit along both axes, so that angles and the ellipse keep their shapes.
        unit: width / (right - left),
    };
    let height = (top - bottom) * plane.unit;
    let (without, with) = (step(false)?, step(true)?);

    // From the back to the front: a later shape covers an earlier one.
    let mut shapes = contours(&plane);
    shapes.extend(half_plane(&plane, &sheet));
    let line = |points: Vec<Point>, width: f64, color| Shape::Line {
        points,
        width: width * sheet.curve,
        color,
    };
    shapes.push(line(ellipse(&plane), 1.0, BLACK));
    shapes.extend(arrow(&plane, &sheet, without, WITHOUT));
    shapes.extend(arrow(&plane, &sheet, with, WITH));
    shapes.push(dot(plane.at(CURRENT), sheet.marker, BLACK));
    shapes.push(diamond(
        plane.at(DEMONSTRATION),
        1.3 * sheet.marker,
        MIMICRY,
    ));
    let (x0, x1, y0, y1) = (
        plane.left,
        plane.left + width,
        plane.top,
        plane.top + height,
    );
    // Once around and a little further, so that the starting corner is joined too.
    shapes.push(line(
        vec![(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0), (x1, y0)],
        0.6,
        BLACK,
    ));
    let under = ((x0 + x1) / 2.0, y1 + 1.1 * sheet.text);
    shapes.push(Shape::Text(text(
        "θ₁",
        under,
        Anchor::Middle,
        sheet.text,
        BLACK,
    )));
    let mut beside = text(
        "θ₂",
        (sheet.margin + sheet.text, (y0 + y1) / 2.0),
        Anchor::Middle,
        sheet.text,
        BLACK,
    );
    beside.upwards = true;
    shapes.push(Shape::Text(beside));

    let mut legend = Legend {
        shapes,
        sheet,
        top: y1 + 1.6 * sheet.text,
        entries: 0,
    };
    legend.entry("policy θₖ", |at, _| {
        vec![dot((at.0, at.1), sheet.marker, BLACK)]
    });
    legend.entry("demonstration", |at, _| {
        vec![diamond(at, 1.3 * sheet.marker, MIMICRY)]
    });
    legend.entry("trust region, KL ≤ δ", |at, half| {
        vec![line(level(at, half), 1.0, BLACK)]
    });
    legend.entry("mimicry half-plane", |at, half| {
        let size = 0.4 * sheet.text;
        let corners = vec![
            (at.0 - half, at.1 - size),
            (at.0 + half, at.1 - size),
            (at.0 + half, at.1),
            (at.0 - half, at.1),
        ];
        vec![
            Shape::Area {
                points: corners,
                color: MIMICRY,
                opacity: SHADE,
            },
            line(level(at, half), 1.0, MIMICRY),
        ]
    });
    legend.entry("step without mimicry", |at, half| {
        vec![line(level(at, half), 1.6, WITHOUT)]
    });
    legend.entry("step with mimicry", |at, half| {
        vec![line(level(at, half), 1.6, WITH)]
    });
    let bottom = legend.bottom();
    Ok(Picture {
        width: sheet.width,
        height: bottom + sheet.margin,
        dpi: sheet.dpi,
        shapes: legend.shapes,
    })
}

/// Opacity of the half-plane.
const SHADE: f64 = 0.12;

/// The objective.
fn objective((x, y): Point) -> f64 {
    SUMMITS
        .iter()
        .map(|((a, b), high, broad)| {
            high * (-((x - a).powi(2) + (y - b).powi(2)) / (2.0 * broad * broad)).exp()
        })
        .sum()
}

/// The gradient of the objective.
fn gradient(at: Point) -> Point {
    let slope = |axis: usize| {
        let along = |point: Point| if axis == 0 { point.0 } else { point.1 };
        let of = |((a, b), high, broad): &(Point, f64, f64)| {
            let square = (at.0 - a).powi(2) + (at.1 - b).powi(2);
            high * (-square / (2.0 * broad * broad)).exp() * (along((*a, *b)) - along(at))
                / (broad * broad)
        };
        SUMMITS.iter().map(of).sum()
    };
    (slope(0), slope(1))
}

/// The gradient of D at the current policy, and how much of the tolerance is left there.
fn mimicry() -> (Point, f64) {
    let away = (CURRENT.0 - DEMONSTRATION.0, CURRENT.1 - DEMONSTRATION.1);
    (
        (2.0 * away.0, 2.0 * away.1),
        TOLERANCE - (away.0.powi(2) + away.1.powi(2)),
    )
}

/// The Hessian as the solver takes it.
struct Metric;

impl LinearOperator for Metric {
    fn dim(&self) -> usize {
        2
    }

    fn apply(&mut self, x: &[f32], product: &mut [f32]) {
        for (row, product) in HESSIAN.iter().zip(product) {
            *product = row.iter().zip(x).map(|(entry, x)| *entry as f32 * x).sum();
        }
    }
}

/// The end of the solver's step from the current policy, with the constraint or without.
fn step(constrained: bool) -> Result<Point, ReportError> {
    let ((g0, g1), (b, slack)) = (gradient(CURRENT), mimicry());
    let (loss, b) = ([-g0 as f32, -g1 as f32], [b.0 as f32, b.1 as f32]);
    let constraint = constrained.then_some(LinearConstraint {
        gradient: &b,
        slack,
    });
    let limits = Limits {
        iterations: 2,
        relative_residual: 1e-9,
    }; // two products solve two equations
    let found = constrained_step(&mut Metric, &loss, constraint, RADIUS, limits);
    let step = found
        .step
        .ok_or_else(|| ReportError::Draw(std::io::Error::other(found.solution.name())))?;
    let [x, y] = [step.as_slice()[0], step.as_slice()[1]].map(f64::from);
    Ok((CURRENT.0 + x, CURRENT.1 + y))
}

/// Maps the plane of parameters to the page.
struct Plane {
    left: f64,
    top: f64,
    unit: f64,
}

impl Plane {
    fn at(&self, (x, y): Point) -> Point {
        (
            self.left + (x - WINDOW[0]) * self.unit,
            self.top + (WINDOW[3] - y) * self.unit,
        )
    }
}

/// Lines of equal objective, by marching squares.
fn contours(plane: &Plane) -> Vec<Shape> {
    let [left, right, bottom, top] = WINDOW;
    let (dx, dy) = ((right - left) / CELLS as f64, (top - bottom) / CELLS as f64);
    let corner = |column: usize, row: usize| (left + column as f64 * dx, bottom + row as f64 * dy);
    let highest = SUMMITS
        .iter()
        .map(|summit| objective(summit.0))
        .fold(0.0, f64::max);
    let mut shapes = Vec::new();
    for level in (1..=LEVELS).map(|level| highest * level as f64 / (LEVELS + 1) as f64) {
        for (column, row) in (0..CELLS).flat_map(|column| (0..CELLS).map(move |row| (column, row)))
        {
            let corners =
                [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| corner(column + x, row + y));
            let crossed = (0..4).filter_map(|side| {
                let (from, to) = (corners[side], corners[(side + 1) % 4]);
                let (low, high) = (objective(from) - level, objective(to) - level);
                let share = low / (low - high);
                ((low > 0.0) != (high > 0.0)).then(|| plane.at(between(from, to, share)))
            });
            let crossed: Vec<Point> = crossed.collect();
            let line = |ends: &[Point]| Shape::Line {
                points: ends.to_vec(),
                width: 0.5,
                color: CONTOUR,
            };
            shapes.extend(crossed.chunks_exact(2).map(line));
        }
    }
    shapes
}

fn between(from: Point, to: Point, share: f64) -> Point {
    (
        from.0 + share * (to.0 - from.0),
        from.1 + share * (to.1 - from.1),
    )
}

/// The half-plane where the linearised constraint holds, cut to the window, and its boundary.
fn half_plane(plane: &Plane, sheet: &Sheet) -> Vec<Shape> {
    let (b, slack) = mimicry();
    let [left, right, bottom, top] = WINDOW;
    let room = |(x, y): Point| slack - b.0 * (x - CURRENT.0) - b.1 * (y - CURRENT.1);
    let corners = [(left, bottom), (right, bottom), (right, top), (left, top)];
    let (mut inside, mut boundary) = (Vec::new(), Vec::new());
    for (index, &from) in corners.iter().enumerate() {
        let to = corners[(index + 1) % 4];
        let (here, there) = (room(from), room(to));
        if here >= 0.0 {
            inside.push(plane.at(from));
        }
        if (here >= 0.0) != (there >= 0.0) {
            let crossing = plane.at(between(from, to, here / (here - there)));
            inside.push(crossing);
            boundary.push(crossing);
        }
    }
    let edge = Shape::Line {
        points: boundary,
        width: sheet.curve,
        color: MIMICRY,
    };
    vec![
        Shape::Area {
            points: inside,
            color: MIMICRY,
            opacity: SHADE,
        },
        edge,
    ]
}

/// The ellipse on which the KL divergence, to second order, equals the trust region's radius.
fn ellipse(plane: &Plane) -> Vec<Point> {
    let point = |turn: usize| {
        let (y, x) = (turn as f64).to_radians().sin_cos();
        let square = HESSIAN[0][0] * x * x + 2.0 * HESSIAN[0][1] * x * y + HESSIAN[1][1] * y * y;
        let far = (2.0 * RADIUS / square).sqrt();
        plane.at((CURRENT.0 + far * x, CURRENT.1 + far * y))
    };
    (0..=362).step_by(2).map(point).collect()
}

fn arrow(plane: &Plane, sheet: &Sheet, end: Point, color: Color) -> [Shape; 2] {
    let (from, to) = (plane.at(CURRENT), plane.at(end));
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let (ux, uy) = ((to.0 - from.0) / length, (to.1 - from.1) / length);
    let (long, half) = (2.4 * sheet.marker, sheet.marker);
    let base = (to.0 - long * ux, to.1 - long * uy);
    let head = vec![
        to,
        (base.0 - half * uy, base.1 + half * ux),
        (base.0 + half * uy, base.1 - half * ux),
    ];
    let shaft = Shape::Line {
        points: vec![from, base],
        width: 1.6 * sheet.curve,
        color,
    };
    [
        shaft,
        Shape::Area {
            points: head,
            color,
            opacity: 1.0,
        },
    ]
}

fn dot(at: Point, radius: f64, color: Color) -> Shape {
    let corner = |turn: usize| {
        let (y, x) = (15.0 * turn as f64).to_radians().sin_cos();
        (at.0 + radius * x, at.1 + radius * y)
    };
    Shape::Area {
        points: (0..24).map(corner).collect(),
        color,
        opacity: 1.0,
    }
}

fn diamond((x, y): Point, radius: f64, color: Color) -> Shape {
    let points = vec![
        (x - radius, y),
        (x, y - radius),
        (x + radius, y),
        (x, y + radius),
    ];
    Shape::Area {
        points,
        color,
        opacity: 1.0,
    }
}

/// A level line around `at`.
fn level((x, y): Point, half: f64) -> Vec<Point> {
    vec![(x - half, y), (x + half, y)]
}

/// A legend of two entries per row.
struct Legend {
    shapes: Vec<Shape>,
    sheet: Sheet,
    top: f64,
    entries: usize,
}

impl Legend {
    const KEY: f64 = 17.0;

    fn entry(&mut self, name: &str, key: impl Fn(Point, f64) -> Vec<Shape>) {
        let (size, column) = (self.sheet.text, self.entries % 2);
        let left = 2.0 * self.sheet.margin + column as f64 * (self.sheet.width / 2.0);
        let base = self.top + (self.entries / 2 + 1) as f64 * 1.4 * size;
        self.shapes.extend(key(
            (left + Self::KEY / 2.0, base - 0.3 * size),
            Self::KEY / 2.0,
        ));
        self.shapes.push(Shape::Text(text(
            name,
            (left + Self::KEY + 4.0, base),
            Anchor::Start,
            size,
            BLACK,
        )));
        self.entries += 1;
    }

    fn bottom(&self) -> f64 {
        self.top + self.entries.div_ceil(2) as f64 * 1.4 * self.sheet.text + 0.3 * self.sheet.text
    }
}

#[cfg(test)]
mod tests;
