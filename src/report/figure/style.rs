//! The sizes, widths and colours of a figure, for print or for a screen.

use super::picture::Color;

/// The colour of text and frames.
pub const BLACK: Color = [0x20, 0x20, 0x20];
/// The colour of notes, and of lines that are not curves.
pub const GREY: Color = [0x60, 0x60, 0x60];
/// The colour of the lines behind the curves.
pub const LIGHT: Color = [0xe6, 0xe6, 0xe6];

/// The curves' colours. The first are from Okabe and Ito (2008), without their yellow, which is too
/// light for a line on white. Five more follow, which also differ in lightness from those and from
/// each other.
pub const PALETTE: [Color; 12] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x00, 0x00, 0x00],
    [0xe6, 0x9f, 0x00],
    [0x56, 0xb4, 0xe9],
    [0x88, 0x22, 0x55],
    [0x99, 0x99, 0x33],
    [0x5e, 0x3c, 0x99],
    [0x8c, 0x56, 0x3b],
    [0xa0, 0xa0, 0xa0],
];

/// Points to an inch.
const INCH: f64 = 72.0;

/// The medium that a figure is drawn for. All lengths are in points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Whether the figure is for print. Then it has no title, its notes are left to the caption,
    /// and its panels have letters.
    pub print: bool,
    /// The figure's width; on a screen, that of three panels.
    pub width: f64,
    /// The margin around everything.
    pub margin: f64,
    /// The font size of the axes' labels and the legend.
    pub text: f64,
    /// The font size of tick labels.
    pub tick: f64,
    /// The font size of the title.
    pub title: f64,
    /// The font size of the notes below the legend.
    pub note: f64,
    /// The breadth of a curve.
    pub curve: f64,
    /// The radius of a marker.
    pub marker: f64,
    /// The breadth of a frame and its ticks.
    pub frame: f64,
    /// Pixels of a PNG to an inch.
    pub dpi: u32,
}

impl Sheet {
    /// The style for a screen.
    pub const SCREEN: Self = Self {
        print: false,
        width: 760.0,
        margin: 10.0,
        text: 11.0,
        tick: 9.5,
        title: 13.0,
        note: 8.5,
        curve: 1.5,
        marker: 3.3,
        frame: 0.7,
        dpi: 144,
    };

    /// The style for print, this many inches wide. No text is below 7 points, the smallest size
    /// that journals accept.
    pub fn print(inches: f64) -> Self {
        Self {
            print: true,
            width: inches * INCH,
            margin: 2.0,
            text: 7.5,
            tick: 7.0,
            title: 7.5,
            note: 7.0,
            curve: 1.0,
            marker: 2.4,
            frame: 0.5,
            dpi: 300,
        }
    }

    /// The length that corresponds to `points` on the screen, scaled with the size of text.
    pub fn scaled(&self, points: f64) -> f64 {
        points * self.text / Self::SCREEN.text
    }
}
