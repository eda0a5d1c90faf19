//! Figures: curves as panels in a grid, with one legend outside the axes.
//!
//! Owns where everything is put. Knows nothing of files; plotters is named in [`picture`] alone.
//! Start at [`draw`].

pub mod axes;
pub mod beside;
mod caption;
mod grid;
mod legend;
pub mod look;
mod page;
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
pub use style::{BLACK, PALETTE};

use super::curve::CurveData;
use grid::Grid;
use legend::Legend;
use page::Page;
use picture::Picture;
use style::Sheet;

/// The figure of `data`: for print where it has a width, otherwise for the screen.
pub fn draw(data: &CurveData) -> Picture {
    let sheet = data.width.map_or(Sheet::SCREEN, Sheet::print);
    let grid = Grid::new(data, sheet);
    let sheet = Sheet {
        width: grid.width,
        ..sheet
    };
    let mut page = Page::new(sheet);
    if !sheet.print {
        page.title(&data.title);
    }
    let top = page.y;
    grid.panels(data, &mut page);
    put_legend(data, &grid, top, &mut page);
    let notes = notes(data);
    page.notes(&if sheet.print {
        notes.inside
    } else {
        notes.all()
    });
    page.into_picture()
}

/// Draws the legend into the empty cells of the last row of the `grid`, which starts at `top`,
/// below the names of the x axes above them; below all panels where it does not fit there.
fn put_legend(data: &CurveData, grid: &Grid, top: f64, page: &mut Page) {
    let sheet = page.sheet;
    let legend = |width| Legend::new(data, &sheet, width);
    let free = grid.free();
    let inside = legend(free as f64 * grid.panel_width);
    let room = grid.height - 2.0 * panel::below(&sheet);
    if free > 0 && inside.height() < room {
        let middle = sheet.width - sheet.margin - free as f64 * grid.panel_width / 2.0;
        let last_row = top + (grid.rows() - 1) as f64 * grid.height;
        let above = last_row + panel::below(&sheet) + (room - inside.height()) / 2.0;
        page.shapes.extend(inside.draw(middle, above));
    } else {
        let below = legend(sheet.width - 2.0 * sheet.margin);
        page.shapes.extend(below.draw(sheet.width / 2.0, page.y));
        page.y += below.height();
    }
}
