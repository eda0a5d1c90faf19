use super::*;

/// The best point of the ellipse, and of the part of it in the half-plane, by trying all
/// directions.
fn best(constrained: bool) -> Point {
    let (g, (b, slack)) = (gradient(CURRENT), mimicry());
    let candidates = (0..360_000).map(|turn| {
        let (y, x) = (f64::from(turn) / 1000.0).to_radians().sin_cos();
        let square = HESSIAN[0][0] * x * x + 2.0 * HESSIAN[0][1] * x * y + HESSIAN[1][1] * y * y;
        let far = (2.0 * RADIUS / square).sqrt();
        (far * x, far * y)
    });
    let allowed = candidates.filter(|x| !constrained || b.0 * x.0 + b.1 * x.1 <= slack);
    let gain = |x: &Point| g.0 * x.0 + g.1 * x.1;
    allowed
        .max_by(|left, right| gain(left).total_cmp(&gain(right)))
        .expect("some direction is allowed")
}

#[test]
fn the_steps_are_the_best_that_the_regions_allow_and_lead_to_different_summits() {
    for constrained in [false, true] {
        let (found, best) = (step(constrained).expect("a step"), best(constrained));
        assert!(
            (found.0 - best.0).hypot(found.1 - best.1) < 1e-3,
            "{constrained}: {found:?}, {best:?}"
        );
    }
    let (without, with) = (step(false).expect("a step"), step(true).expect("a step"));
    let far = |from: Point, summit: usize| {
        (from.0 - SUMMITS[summit].0.0).hypot(from.1 - SUMMITS[summit].0.1)
    };
    assert!(
        far(without, 0) < far(CURRENT, 0),
        "without the constraint, the lower summit"
    );
    assert!(far(with, 1) < far(CURRENT, 1), "with it, the higher one");
}

#[test]
fn the_gradient_is_the_objectives() {
    let (at, h) = ((0.3, -0.2), 1e-6);
    let numeric = (
        (objective((at.0 + h, at.1)) - objective((at.0 - h, at.1))) / (2.0 * h),
        (objective((at.0, at.1 + h)) - objective((at.0, at.1 - h))) / (2.0 * h),
    );
    let exact = gradient(at);
    assert!(
        (exact.0 - numeric.0).abs() < 1e-8 && (exact.1 - numeric.1).abs() < 1e-8,
        "{exact:?} {numeric:?}"
    );
}

#[test]
fn nothing_leaves_the_page() {
    for inches in [None, Some(2.0), Some(7.0)] {
        let picture = draw(inches).expect("drawn");
        for shape in &picture.shapes {
            let points = match shape {
                Shape::Line { points, .. } | Shape::Area { points, .. } => points.as_slice(),
                Shape::Text(text) => std::slice::from_ref(&text.at),
            };
            let inside = |(x, y): &Point| {
                (0.0..=picture.width).contains(x) && (0.0..=picture.height).contains(y)
            };
            assert!(points.iter().all(inside), "{shape:?}");
        }
    }
}
