//! The page of a figure, with the lines of text above and below its panels.

use super::{
    picture::{Anchor, Picture, Shape},
    style::{BLACK, GREY, Sheet},
    words::{text, wrap},
};

const LINE: f64 = 1.35; // of a text's size

/// A page that is filled from the top.
pub struct Page {
    /// All that is drawn so far.
    pub shapes: Vec<Shape>,
    pub sheet: Sheet,
    /// The lower end of what is drawn so far.
    pub y: f64,
}

impl Page {
    /// An empty page.
    pub fn new(sheet: Sheet) -> Self {
        Self {
            shapes: Vec::new(),
            sheet,
            y: sheet.margin,
        }
    }

    /// Writes the title of the figure, centred.
    pub fn title(&mut self, title: &str) {
        let size = self.sheet.title;
        for line in wrap(title, size, self.sheet.width - 2.0 * self.sheet.margin) {
            self.y += size * LINE;
            let at = (self.sheet.width / 2.0, self.y - 0.3 * size);
            self.shapes
                .push(Shape::Text(text(&line, at, Anchor::Middle, size, BLACK)));
        }
        self.y += 4.0;
    }

    /// Writes the notes, small and grey.
    pub fn notes(&mut self, notes: &str) {
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

    /// The picture of the page, as high as it is filled.
    pub fn into_picture(self) -> Picture {
        Picture {
            width: self.sheet.width,
            height: self.y + self.sheet.margin,
            dpi: self.sheet.dpi,
            shapes: self.shapes,
        }
    }
}
