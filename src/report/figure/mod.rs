//! Figures: curves as panels in a grid, with one legend outside the axes.
//!
//! Owns where everything is put. Knows nothing of files; plotters is named in [`picture`] alone.
//! Start at [`draw`].

mod caption;
mod legend;
pub mod look;
mod panel;
mod pdf;
pub mod picture;
pub mod step;
mod style;
#[cfg(test)]
mod tests;
pub mod ticks;
mod words;

pub use caption::notes;
pub use panel::{x_scale, x_ticks, y_scale};
pub use style::{BLACK, PALETTE};

use picture::{Anchor, Picture, Shape};

use super::{
    axis,
    curve::{CurveData, Panel},
};
use legend::Legend;
use panel::Frame;
use style::{GREY, Sheet};
use words::{text, wrap};

const LINE: f64 = 1.35; // of a text's size

/// The figure of `data`: for print where it has a width, otherwise for the screen.
pub fn draw(data: &CurveData) -> Picture {
    let sheet = data.width.map_or(Sheet::SCREEN, Sheet::print);
    let grid = Grid::new(data, sheet);
    let sheet = Sheet {
        width: grid.width,
        ..sheet
    };
    let mut page = Page {
        shapes: Vec::new(),
        sheet,
        y: sheet.margin,
    };
    if !sheet.print {
        page.title(&data.title);
    }
    let top = page.y;
    grid.panels(data, &mut page);

    // The legend goes into the empty cells of the last row, below the names of the x axes above
    // them, and otherwise below all panels.
    let (free, bottom) = (grid.free(), page.y);
    let beside = sheet.width - sheet.margin - free as f64 * grid.panel_width / 2.0;
    let legend = |room| Legend::new(data, &sheet, room);
    let inside = legend(free as f64 * grid.panel_width);
    let room = grid.height - 2.0 * panel::below(&sheet);
    if free > 0 && inside.height() < room {
        let last_row = top + (grid.rows() - 1) as f64 * grid.height;
        let above = last_row + panel::below(&sheet) + (room - inside.height()) / 2.0;
        page.shapes.extend(inside.draw(beside, above));
    } else {
        let below = legend(sheet.width - 2.0 * sheet.margin);
        page.shapes.extend(below.draw(sheet.width / 2.0, bottom));
        page.y += below.height();
    }
    let notes = notes(data);
    page.notes(&if sheet.print {
        notes.lacking
    } else {
        notes.all()
    });
    Picture {
        width: sheet.width,
        height: page.y + sheet.margin,
        dpi: sheet.dpi,
        shapes: page.shapes,
    }
}

/// The grid of the panels on a page.
struct Grid {
    sheet: Sheet,
    width: f64,
    panels: usize,
    columns: usize,
    /// The width of a panel with everything that belongs to it.
    panel_width: f64,
    height: f64,
}

impl Grid {
    /// The least width of a panel in print, points: two stand in a column.
    const NARROWEST: f64 = 105.0;
    /// The height of the axes in print, as a share of a panel's width.
    const SHAPE: f64 = 0.6;

    fn new(data: &CurveData, sheet: Sheet) -> Self {
        let panels = data.panels.len().max(1);
        let left = sheet.margin + 1.6 * sheet.text;
        if sheet.print {
            let most = ((sheet.width - left - sheet.margin) / Self::NARROWEST)
                .floor()
                .max(1.0) as usize;
            let columns = panels.div_ceil(panels.div_ceil(most));
            let panel_width = (sheet.width - left - sheet.margin) / columns as f64;
            let axes = (Self::SHAPE * panel_width).min(140.0);
            let height = panel::height(&sheet, axes);
            return Self {
                sheet,
                width: sheet.width,
                panels,
                columns,
                panel_width,
                height,
            };
        }
        let columns = match panels {
            1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        let (width, height) = [(400.0, 240.0), (600.0, 205.0), (sheet.width, 175.0)][columns - 1];
        Self {
            sheet,
            width,
            panels,
            columns,
            panel_width: (width - left - sheet.margin) / columns as f64,
            height,
        }
    }

    fn rows(&self) -> usize {
        self.panels.div_ceil(self.columns)
    }

    /// Empty cells of the last row.
    fn free(&self) -> usize {
        self.rows() * self.columns - self.panels
    }

    /// Draws the panels below what `page` has.
    fn panels(&self, data: &CurveData, page: &mut Page) {
        let sheet = &self.sheet;
        let (left, top) = (sheet.margin + 1.6 * sheet.text, page.y);
        let mut labels = vec![0.0; self.columns];
        for (index, panel) in data.panels.iter().enumerate() {
            let own = panel::label_width(data, panel, sheet, self.height);
            labels[index % self.columns] = f64::max(labels[index % self.columns], own);
        }
        let mut curves = data
            .panels
            .iter()
            .flat_map(|panel| panel.curves.iter().flatten());
        let any_paper = curves.any(|curve| curve.paper.is_some());
        for (index, panel) in data.panels.iter().enumerate() {
            let (column, row) = (index % self.columns, index / self.columns);
            let frame = Frame {
                left: left + column as f64 * self.panel_width,
                top: top + row as f64 * self.height,
                width: self.panel_width,
                height: self.height,
                labels: labels[column],
                gutter: if any_paper {
                    sheet.scaled(panel::GUTTER)
                } else {
                    0.0
                },
                x_label: index + self.columns >= self.panels,
            };
            page.shapes.extend(panel::draw(
                data,
                panel,
                &title(data, panel, index),
                sheet,
                frame,
            ));
            if column == 0 {
                let at = (sheet.margin + sheet.text, frame.top + self.height / 2.0);
                let mut label = text(&data.y_label, at, Anchor::Middle, sheet.text, BLACK);
                label.upwards = true;
                page.shapes.push(Shape::Text(label));
            }
        }
        page.y = top + self.rows() as f64 * self.height + panel::below(sheet);
    }
}

/// The title above a panel. In print, it has the paper's name of the environment, and a letter
/// where there are several panels.
fn title(data: &CurveData, panel: &Panel, index: usize) -> String {
    if data.width.is_none() {
        return panel.title.clone();
    }
    let name = axis::paper_family(&panel.title);
    match u8::try_from(index)
        .ok()
        .filter(|index| *index < 26 && data.panels.len() > 1)
    {
        Some(index) => format!("({}) {name}", char::from(b'a' + index)),
        None => name.to_owned(),
    }
}

/// A page that is filled from the top.
struct Page {
    shapes: Vec<Shape>,
    sheet: Sheet,
    y: f64,
}

impl Page {
    fn title(&mut self, title: &str) {
        let size = self.sheet.title;
        for line in wrap(title, size, self.sheet.width - 2.0 * self.sheet.margin) {
            self.y += size * LINE;
            let at = (self.sheet.width / 2.0, self.y - 0.3 * size);
            self.shapes
                .push(Shape::Text(text(&line, at, Anchor::Middle, size, BLACK)));
        }
        self.y += 4.0;
    }

    fn notes(&mut self, notes: &str) {
        if notes.is_empty() {
            return;
        }
        let (size, margin) = (self.sheet.note, self.sheet.margin);
        for line in wrap(notes, size, self.sheet.width - 2.0 * margin) {
            self.y += size * LINE;
            self.shapes.push(Shape::Text(text(
                &line,
                (margin, self.y),
                Anchor::Start,
                size,
                GREY,
            )));
        }
        self.y += 0.2 * size;
    }
}
