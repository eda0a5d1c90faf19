//! What a figure is drawn for: sizes, widths and colours.

use super::picture::Color;

/// Text and frames.
pub const BLACK: Color = [0x20, 0x20, 0x20];
/// Notes, and lines that are no curve.
pub const GREY: Color = [0x60, 0x60, 0x60];
/// The lines behind the curves.
pub const LIGHT: Color = [0xe6, 0xe6, 0xe6];

/// The curves' colours: Okabe and Ito (2008), without their yellow, which is too light for a line
/// on white; then five that differ from those and from each other in lightness too.
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

/// What a figure is drawn for, all lengths in points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Whether for print: without a title and with what a caption says left to it, panels with
    /// letters.
    pub print: bool,
    /// Its width; of a figure for the screen, that of three panels.
    pub width: f64,
    /// Around everything.
    pub margin: f64,
    /// Labels of axes and the legend.
    pub text: f64,
    /// Labels of ticks.
    pub tick: f64,
    /// The title.
    pub title: f64,
    /// The notes below the legend.
    pub note: f64,
    /// Breadth of a curve.
    pub curve: f64,
    /// Radius of a marker.
    pub marker: f64,
    /// Breadth of a frame and its ticks.
    pub frame: f64,
    /// Pixels of a PNG to an inch.
    pub dpi: u32,
}

impl Sheet {
    /// For a screen.
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

    /// For print, so many inches wide: no text below 7 points, the least that journals take.
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

    /// A length that is `points` where text is as large as on the screen.
    pub fn scaled(&self, points: f64) -> f64 {
        points * self.text / Self::SCREEN.text
    }
}
