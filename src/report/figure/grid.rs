//! The grid of a figure's panels.

use super::{
    page::Page,
    panel::{self, Frame},
    picture::{Anchor, Shape},
    style::{BLACK, Sheet},
    words::text,
};
use crate::report::{
    axis,
    curve::{CurveData, Panel},
};

/// The grid of the panels on a page.
pub struct Grid {
    sheet: Sheet,
    /// The width of the page.
    pub width: f64,
    panels: usize,
    columns: usize,
    /// The width of a panel with everything that belongs to it.
    pub panel_width: f64,
    /// The height of a row.
    pub height: f64,
}

impl Grid {
    /// The least width of a panel in print, points: two stand in a column.
    const NARROWEST: f64 = 105.0;
    /// The height of the axes in print, as a share of a panel's width.
    const SHAPE: f64 = 0.6;

    /// The grid for the panels of `data`.
    pub fn new(data: &CurveData, sheet: Sheet) -> Self {
        let panels = data.panels.len().max(1);
        if sheet.print {
            Self::in_print(panels, sheet)
        } else {
            Self::on_screen(panels, sheet)
        }
    }

    /// As many columns as fit, on a page of the sheet's width.
    fn in_print(panels: usize, sheet: Sheet) -> Self {
        let room = sheet.width - left(&sheet) - sheet.margin;
        let most = (room / Self::NARROWEST).floor().max(1.0) as usize;
        // No more columns than the rows need, so that the last row is as full as it can be.
        let columns = panels.div_ceil(panels.div_ceil(most));
        let panel_width = room / columns as f64;
        let axes = (Self::SHAPE * panel_width).min(140.0);
        Self {
            sheet,
            width: sheet.width,
            panels,
            columns,
            panel_width,
            height: panel::height(&sheet, axes),
        }
    }

    /// At most three columns; the page is narrower for fewer.
    fn on_screen(panels: usize, sheet: Sheet) -> Self {
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
            panel_width: (width - left(&sheet) - sheet.margin) / columns as f64,
            height,
        }
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.panels.div_ceil(self.columns)
    }

    /// The number of empty cells of the last row.
    pub fn free(&self) -> usize {
        self.rows() * self.columns - self.panels
    }

    /// Draws the panels below what `page` has.
    pub fn panels(&self, data: &CurveData, page: &mut Page) {
        let sheet = &self.sheet;
        let top = page.y;
        let labels = self.label_widths(data);
        let mut curves = data
            .panels
            .iter()
            .flat_map(|panel| panel.curves.iter().flatten());
        let any_paper = curves.any(|curve| curve.paper.is_some());
        for (index, panel) in data.panels.iter().enumerate() {
            let (column, row) = (index % self.columns, index / self.columns);
            let frame = Frame {
                left: left(sheet) + column as f64 * self.panel_width,
                top: top + row as f64 * self.height,
                width: self.panel_width,
                height: self.height,
                labels: labels[column],
                gutter: if any_paper {
                    sheet.scaled(panel::GUTTER)
                } else {
                    0.0
                },
                // Only the lowest panel of each column names the axis.
                x_label: index + self.columns >= self.panels,
            };
            let row_label = (column == 0).then(|| self.row_label(data, frame.top));
            let title = title(data, panel, index);
            page.shapes
                .extend(panel::draw(data, panel, &title, sheet, frame));
            page.shapes.extend(row_label);
        }
        page.y = top + self.rows() as f64 * self.height + panel::below(sheet);
    }

    /// The room for the y axis's labels in each column: that of the widest, so that the axes stand
    /// below each other.
    fn label_widths(&self, data: &CurveData) -> Vec<f64> {
        let mut widths = vec![0.0; self.columns];
        for (index, panel) in data.panels.iter().enumerate() {
            let own = panel::label_width(data, panel, &self.sheet, self.height);
            let widest = &mut widths[index % self.columns];
            *widest = f64::max(*widest, own);
        }
        widths
    }

    /// The name of the y axis, at the left of the row that starts at `top`.
    fn row_label(&self, data: &CurveData, top: f64) -> Shape {
        let size = self.sheet.text;
        let at = (self.sheet.margin + size, top + self.height / 2.0);
        let mut label = text(&data.y_label, at, Anchor::Middle, size, BLACK);
        label.upwards = true;
        Shape::Text(label)
    }
}

/// The left end of the panels, behind the name of the y axis.
fn left(sheet: &Sheet) -> f64 {
    sheet.margin + 1.6 * sheet.text
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
