//! The legend: what each kind of line is.

use super::{
    look::Look,
    picture::{Anchor, Shape, text_width},
    style::{BLACK, Sheet},
    words::{text, wrap},
};
use crate::report::curve::CurveData;

/// The legend's entry for one kind of line: its name, on several lines where it is long.
#[derive(Debug, Clone)]
struct Entry {
    look: Look,
    lines: Vec<String>,
    width: f64,
}

/// One entry per series, and one for each other kind of line that is drawn; in rows, each centred.
pub struct Legend<'a> {
    sheet: &'a Sheet,
    /// The width of each row, and its entries.
    rows: Vec<(f64, Vec<Entry>)>,
}

impl<'a> Legend<'a> {
    /// The legend of `data`, no wider than `room`.
    pub fn new(data: &CurveData, sheet: &'a Sheet, room: f64) -> Self {
        let looks = data.looks.iter().map(|look| Look::Series(*look));
        let mut entries: Vec<(Look, String)> = looks
            .zip(data.series.iter().map(|name| name.text.clone()))
            .collect();
        // Panels without points show a text instead of lines, so they need no entries.
        let drawn = || {
            data.panels.iter().filter(|panel| {
                panel
                    .curves
                    .iter()
                    .flatten()
                    .any(|curve| !curve.points.is_empty())
            })
        };
        let curves = || drawn().flat_map(|panel| panel.curves.iter().flatten());
        if curves().any(|curve| curve.paper.is_some()) {
            entries.push((Look::Paper, "the paper, after training".to_owned()));
        }
        if drawn().any(|panel| panel.demo.is_some()) {
            entries.push((Look::Demo, "the demonstration".to_owned()));
        }
        if curves().any(|curve| !curve.tolerance.is_empty()) {
            entries.push((
                Look::Tolerance,
                "tolerance d of the same colour's curve".to_owned(),
            ));
        }
        let entries: Vec<Entry> = entries
            .into_iter()
            .map(|(look, name)| Entry::new(look, &name, sheet, room))
            .collect();
        let rows = rows(sheet, entries.clone(), room);
        // Series of equal width line up in columns, unless that takes more rows.
        let widest = entries
            .iter()
            .filter(|entry| entry.is_series())
            .map(|entry| entry.width)
            .fold(0.0, f64::max);
        let even = entries.into_iter().map(|entry| Entry {
            width: if entry.is_series() {
                widest
            } else {
                entry.width
            },
            ..entry
        });
        let even = self::rows(sheet, even.collect(), room);
        Self {
            sheet,
            rows: if even.len() > rows.len() { rows } else { even },
        }
    }

    /// The height of the legend.
    pub fn height(&self) -> f64 {
        self.rows
            .iter()
            .map(|(_, row)| self.row_height(row))
            .sum::<f64>()
            + self.sheet.scaled(6.0)
    }

    fn line(&self) -> f64 {
        1.25 * self.sheet.text
    }

    fn between(&self) -> f64 {
        0.25 * self.sheet.text
    }

    fn row_height(&self, row: &[Entry]) -> f64 {
        let lines = row.iter().map(|entry| entry.lines.len()).max().unwrap_or(0);
        lines as f64 * self.line() + self.between()
    }

    /// The shapes of the legend, centred at `middle` and below `top`.
    pub fn draw(&self, middle: f64, top: f64) -> Vec<Shape> {
        let (size, key) = (self.sheet.text, key(self.sheet));
        let mut shapes = Vec::new();
        let mut above = top;
        for (width, row) in &self.rows {
            let mut x = middle - width / 2.0;
            for entry in row {
                for (index, line) in entry.lines.iter().enumerate() {
                    let y = above + (index + 1) as f64 * self.line() + self.between();
                    if index == 0 {
                        shapes.extend(entry.look.key(
                            self.sheet,
                            (x, y - 0.3 * size),
                            key - self.sheet.scaled(6.0),
                        ));
                    }
                    shapes.push(Shape::Text(text(
                        line,
                        (x + key, y),
                        Anchor::Start,
                        size,
                        BLACK,
                    )));
                }
                x += entry.width + gap(self.sheet);
            }
            above += self.row_height(row);
        }
        shapes
    }
}

/// The width of the line before an entry's name.
fn key(sheet: &Sheet) -> f64 {
    sheet.scaled(34.0)
}

/// The space between two entries.
fn gap(sheet: &Sheet) -> f64 {
    sheet.scaled(18.0)
}

/// `entries` in rows that fit into `room`, with the width of each.
fn rows(sheet: &Sheet, entries: Vec<Entry>, room: f64) -> Vec<(f64, Vec<Entry>)> {
    let mut rows: Vec<(f64, Vec<Entry>)> = Vec::new();
    for entry in entries {
        match rows.last_mut() {
            Some((used, row)) if *used + gap(sheet) + entry.width <= room => {
                *used += gap(sheet) + entry.width;
                row.push(entry);
            }
            _ => rows.push((entry.width, vec![entry])),
        }
    }
    rows
}

impl Entry {
    fn new(look: Look, name: &str, sheet: &Sheet, room: f64) -> Self {
        let lines = wrap(name, sheet.text, room - key(sheet));
        let width = key(sheet)
            + lines
                .iter()
                .map(|line| text_width(line, sheet.text))
                .fold(0.0, f64::max);
        Self { look, lines, width }
    }

    fn is_series(&self) -> bool {
        matches!(self.look, Look::Series(_))
    }
}
