//! A demonstration as a picture: over the steps of each episode, its return so far and each number
//! of its actions.

use super::rewards::Rewards;
use crate::{
    demo::Demonstration,
    report::{
        BLACK, PALETTE,
        picture::{Anchor, Color, Picture, Shape, Text},
    },
};

/// The most episodes that are drawn; more would hide each other.
const EPISODES: usize = 10;
/// The most numbers of an action that are drawn.
const ACTIONS: usize = 16;
/// The most points of a line.
const POINTS: usize = 1500;

const WIDTH: f64 = 640.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = WIDTH - 16.0;
const PANEL: f64 = 78.0;
const GAP: f64 = 24.0;
const SIZE: f64 = 10.0;
const DPI: u32 = 144;
const LIGHT: Color = [0xc8, 0xc8, 0xc8];

/// One quantity over the steps of each episode.
struct Panel {
    title: String,
    episodes: Vec<Vec<f64>>,
}

/// The picture of `demonstration` under `title`.
pub fn picture(title: &str, demonstration: &Demonstration, rewards: Option<&Rewards>) -> Picture {
    let panels = panels(demonstration, rewards);
    let longest = panels
        .iter()
        .flat_map(|panel| &panel.episodes)
        .map(Vec::len)
        .max()
        .unwrap_or(1);
    let mut shapes = vec![text(title, (WIDTH / 2.0, 24.0), Anchor::Middle, 12.0)];
    let mut top = 50.0;
    for panel in &panels {
        shapes.extend(draw(panel, longest, top));
        top += PANEL + GAP;
    }
    let below = top - GAP + SIZE * 1.5;
    shapes.push(text("0", (LEFT, below), Anchor::Middle, SIZE));
    shapes.push(text(
        &longest.to_string(),
        (RIGHT, below),
        Anchor::End,
        SIZE,
    ));
    shapes.push(text(
        "step of the episode",
        ((LEFT + RIGHT) / 2.0, below),
        Anchor::Middle,
        SIZE,
    ));
    let mut height = below + SIZE;
    if let Some(note) = note(demonstration, rewards) {
        height += SIZE * 1.5;
        shapes.push(text(&note, (LEFT, height), Anchor::Start, SIZE));
    }
    Picture {
        width: WIDTH,
        height: height + SIZE,
        dpi: DPI,
        shapes,
    }
}

/// Returns first, then actions.
fn panels(demonstration: &Demonstration, rewards: Option<&Rewards>) -> Vec<Panel> {
    let episodes = || demonstration.episodes().take(EPISODES);
    let earned = rewards.into_iter().map(|rewards| Panel {
        title: format!("return so far, {}", rewards.source),
        episodes: episodes()
            .map(|steps| {
                rewards.values[steps]
                    .iter()
                    .scan(0.0, |sum, reward| {
                        *sum += reward;
                        Some(*sum)
                    })
                    .collect()
            })
            .collect(),
    });
    let action_dim = demonstration.actions.nrows();
    let actions = (0..action_dim.min(ACTIONS)).map(|i| Panel {
        title: format!("action, number {} of {action_dim}", i + 1),
        episodes: episodes()
            .map(|steps| steps.map(|step| demonstration.actions[(i, step)]).collect())
            .collect(),
    });
    earned.chain(actions).collect()
}

/// A note on the episodes and numbers that are not drawn.
fn note(demonstration: &Demonstration, rewards: Option<&Rewards>) -> Option<String> {
    let (episodes, actions) = (
        demonstration.episode_starts.len(),
        demonstration.actions.nrows(),
    );
    let notes = [
        rewards
            .is_none()
            .then(|| "rewards are not recorded".to_owned()),
        (episodes > EPISODES).then(|| format!("the first {EPISODES} of {episodes} episodes")),
        (actions > ACTIONS)
            .then(|| format!("the first {ACTIONS} of {actions} numbers of an action")),
    ];
    let notes: Vec<String> = notes.into_iter().flatten().collect();
    (!notes.is_empty()).then(|| notes.join("; "))
}

/// A panel whose frame begins at `top`.
fn draw(panel: &Panel, longest: usize, top: f64) -> Vec<Shape> {
    let values = || panel.episodes.iter().flatten().copied();
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    // A constant line is drawn in the middle.
    let (low, high) = if high > low {
        (low, high)
    } else {
        (low - 1.0, high + 1.0)
    };
    let at = |step: usize, value: f64| {
        // A single step would divide by zero, hence at least two.
        let across = LEFT + (RIGHT - LEFT) * step as f64 / (longest.max(2) - 1) as f64;
        (across, top + PANEL * (high - value) / (high - low))
    };
    let frame = [
        (LEFT, top),
        (RIGHT, top),
        (RIGHT, top + PANEL),
        (LEFT, top + PANEL),
        (LEFT, top),
    ];
    let mut shapes = vec![
        Shape::Line {
            points: frame.to_vec(),
            width: 0.8,
            color: LIGHT,
        },
        text(&panel.title, (LEFT, top - 4.0), Anchor::Start, SIZE),
        text(
            &number(high),
            (LEFT - 5.0, top + SIZE * 0.8),
            Anchor::End,
            SIZE,
        ),
        text(&number(low), (LEFT - 5.0, top + PANEL), Anchor::End, SIZE),
    ];
    // Zero is a line only where it lies inside the frame.
    if low < 0.0 && high > 0.0 {
        let points = vec![(LEFT, at(0, 0.0).1), (RIGHT, at(0, 0.0).1)];
        shapes.push(Shape::Line {
            points,
            width: 0.8,
            color: LIGHT,
        });
    }
    for (episode, color) in panel.episodes.iter().zip(PALETTE.iter().cycle()) {
        let stride = episode.len().div_ceil(POINTS);
        let mut points: Vec<_> = episode
            .iter()
            .enumerate()
            .step_by(stride)
            .map(|(i, &value)| at(i, value))
            .collect();
        // A line needs two points, so an episode of one step gets a short dash.
        if let [only] = points[..] {
            points.push((only.0 + 2.0, only.1));
        }
        // The lines of long episodes are dense, and easier to read if thin.
        let width = if longest > 300 { 0.7 } else { 1.2 };
        shapes.push(Shape::Line {
            points,
            width,
            color: *color,
        });
    }
    shapes
}

/// A number with three to four digits.
fn number(value: f64) -> String {
    match value.abs() {
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

fn text(text: &str, at: (f64, f64), anchor: Anchor, size: f64) -> Shape {
    Shape::Text(Text {
        text: text.to_owned(),
        at,
        anchor,
        size,
        color: BLACK,
        upwards: false,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn demonstration(episodes: usize, actions: usize) -> Demonstration {
        let n = 3 * episodes;
        Demonstration {
            observations: DMatrix::zeros(1, n),
            actions: DMatrix::from_fn(actions, n, |i, j| (i + j) as f64),
            rewards: None,
            episode_starts: (0..episodes).map(|i| 3 * i).collect(),
            terminated: vec![false; n],
            truncated: vec![false; n],
            poses: None,
            provenance: vec![],
        }
    }

    fn rewards(demonstration: &Demonstration) -> Rewards {
        Rewards {
            values: vec![2.0; demonstration.len()],
            source: "as recorded",
        }
    }

    #[test]
    fn what_is_not_drawn_is_said() {
        let small = demonstration(1, 1);
        assert_eq!(note(&small, Some(&rewards(&small))), None);
        let note = note(&demonstration(11, 17), None).expect("a note");
        assert_eq!(
            note,
            "rewards are not recorded; the first 10 of 11 episodes; the first 16 of 17 numbers of \
             an action"
        );
        assert_eq!(panels(&demonstration(11, 17), None).len(), 16);
    }

    #[test]
    fn returns_add_up_and_actions_are_told_apart() {
        let demonstration = demonstration(2, 2);
        let panels = panels(&demonstration, Some(&rewards(&demonstration)));
        assert_eq!(panels[0].episodes, [[2.0, 4.0, 6.0], [2.0, 4.0, 6.0]]);
        assert_eq!(panels[2].episodes, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    }

    #[test]
    fn every_line_stays_in_the_picture() {
        let mut single = demonstration(1, 1);
        single.episode_starts = vec![0, 1, 2]; // episodes of one step
        for demonstration in [demonstration(3, 8), single] {
            let picture = picture("title", &demonstration, Some(&rewards(&demonstration)));
            for shape in &picture.shapes {
                let Shape::Line { points, .. } = shape else {
                    continue;
                };
                assert!(points.len() > 1);
                assert!(
                    points
                        .iter()
                        .all(|&(x, y)| (0.0..WIDTH).contains(&x)
                            && (0.0..picture.height).contains(&y))
                );
            }
        }
    }
}
