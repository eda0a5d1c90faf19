//! A picture as a list of shapes, and its way to PNG and SVG.
//!
//! Owns the font and everything that needs plotters, which is named here alone. Knows nothing of
//! curves. Start at [`Picture`].
//!
//! Coordinates are points (1/72 inch), x to the right and y down. The same shapes give the same
//! bytes, always.

use std::{collections::BTreeSet, io, sync::LazyLock};

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use plotters::{
    prelude::{BitMapBackend, DrawingBackend, SVGBackend},
    style::{
        Color as _, FontDesc, FontFamily, FontStyle, FontTransform, RGBAColor, RGBColor,
        ShapeStyle, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};

/// Every pixel of a PNG is the mean of this number squared.
const SAMPLES: u32 = 2;
/// An SVG's coordinates are whole numbers, this many to a point.
const SVG_UNITS: u32 = 20;
/// Points to an inch.
const INCH: f64 = 72.0;
/// The fonts that an SVG asks its viewer for, the embedded one first.
const SVG_FONT: &str = "DejaVu Sans, Verdana, sans-serif";

/// The font of all text.
pub const FONT_FILE: &[u8] = include_bytes!("font/DejaVuSans.ttf");

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(FONT_FILE).expect("the embedded font is checked by the tests")
});

/// The font's metrics, in ems.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metrics {
    /// Above the base line.
    pub ascent: f32,
    /// Below the base line, so less than 0.
    pub descent: f32,
    /// The height of a capital letter.
    pub cap_height: f32,
    em: f32,
}

impl Metrics {
    /// The advance of the glyph with this number.
    pub fn advance(&self, glyph: u16) -> f32 {
        FONT.h_advance_unscaled(ab_glyph::GlyphId(glyph)) / self.em
    }
}

/// The metrics of the embedded font.
pub fn metrics() -> Metrics {
    let em = FONT.units_per_em().unwrap_or(2048.0);
    let (ascent, descent) = (FONT.ascent_unscaled() / em, FONT.descent_unscaled() / em);
    Metrics {
        ascent,
        descent,
        cap_height: 0.729,
        em,
    } // the height of its H
}

/// Red, green, blue.
pub type Color = [u8; 3];

/// A picture: its size, and its shapes in drawing order.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width, points.
    pub width: f64,
    /// Height, points.
    pub height: f64,
    /// Pixels of its PNG to an inch.
    pub dpi: u32,
    /// From the back to the front.
    pub shapes: Vec<Shape>,
}

/// One shape.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A line through points, with round joints.
    Line {
        /// At least two points.
        points: Vec<(f64, f64)>,
        /// The breadth of the line, points.
        width: f64,
        /// The colour of the line.
        color: Color,
    },
    /// A filled polygon.
    Area {
        /// The corners of the polygon.
        points: Vec<(f64, f64)>,
        /// The colour of the polygon.
        color: Color,
        /// From 0, invisible, to 1, opaque.
        opacity: f64,
    },
    /// A line of text.
    Text(Text),
}

/// A line of text.
#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// The characters.
    pub text: String,
    /// A point on the base line, the text's start, middle or end.
    pub at: (f64, f64),
    /// Which of these three points `at` is.
    pub anchor: Anchor,
    /// The font size: the length of an em, points.
    pub size: f64,
    /// The colour of the text.
    pub color: Color,
    /// Whether the text runs upwards.
    pub upwards: bool,
}

/// Which point on the base line of a text its position is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The left end.
    Start,
    /// The middle.
    Middle,
    /// The right end.
    End,
}

/// The width of `text` at `size`.
pub fn text_width(text: &str, size: f64) -> f64 {
    glyphs(text, size as f32).1.into()
}

/// The glyphs of `text` with the x of their origins, and the width of the whole text.
pub fn glyphs(text: &str, size: f32) -> (Vec<(ab_glyph::GlyphId, f32)>, f32) {
    let font = FONT.as_scaled(scale(size));
    let (mut glyphs, mut x, mut previous) = (Vec::new(), 0.0, None);
    for character in text.chars() {
        let glyph = font.glyph_id(character);
        x += previous.map_or(0.0, |previous| font.kern(previous, glyph));
        glyphs.push((glyph, x));
        x += font.h_advance(glyph);
        previous = Some(glyph);
    }
    (glyphs, x)
}

/// The ab_glyph scale of an em of `size`. ab_glyph measures a font from ascent to descent instead.
fn scale(size: f32) -> PxScale {
    PxScale::from(size * FONT.height_unscaled() / FONT.units_per_em().unwrap_or(2048.0))
}

impl Picture {
    /// The picture as a PNG at its `dpi`, which the file records.
    ///
    /// # Errors
    ///
    /// None that the encoder gives for a buffer in memory.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        let fine = f64::from(self.dpi * SAMPLES) / INCH;
        let size = [self.width, self.height]
            .map(|points| (points * f64::from(self.dpi) / INCH).ceil() as u32 * SAMPLES);
        let size = (size[0], size[1]);
        let mut pixels = vec![255; (size.0 * size.1 * 3) as usize];
        let mut bitmap = BitMapBackend::with_buffer(&mut pixels, size);
        for shape in &self.shapes {
            draw_pixels(&mut bitmap, shape, fine)?;
        }
        drop(bitmap);
        encode(
            &coarser(&pixels, size),
            (size.0 / SAMPLES, size.1 / SAMPLES),
            self.dpi,
        )
    }

    /// The picture as an SVG; its text stays text.
    ///
    /// # Errors
    ///
    /// None that plotters gives for a string in memory.
    pub fn svg(&self) -> io::Result<String> {
        let size = self.size(SVG_UNITS);
        let mut text = String::new();
        let mut svg = SVGBackend::with_string(&mut text, size);
        for shape in &self.shapes {
            draw_vectors(&mut svg, shape)?;
        }
        svg.present().map_err(io::Error::other)?;
        drop(svg);
        // Fine units inside, points outside: plotters knows one size for both.
        let points = (size.0 / SVG_UNITS, size.1 / SVG_UNITS);
        let fine = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
        Ok(text.replacen(
            &fine,
            &format!("width=\"{}pt\" height=\"{}pt\"", points.0, points.1),
            1,
        ))
    }

    /// The characters of its text that the embedded font does not have.
    pub fn without_glyph(&self) -> BTreeSet<char> {
        let texts = self.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) => Some(&text.text),
            Shape::Line { .. } | Shape::Area { .. } => None,
        });
        texts
            .flat_map(|text| text.chars())
            .filter(|character| FONT.glyph_id(*character).0 == 0)
            .collect()
    }

    fn size(&self, units: u32) -> (u32, u32) {
        let whole = |points: f64| points.ceil() as u32 * units;
        (whole(self.width), whole(self.height))
    }
}

fn draw_pixels(bitmap: &mut BitMapBackend<'_>, shape: &Shape, fine: f64) -> io::Result<()> {
    let pixel = |(x, y): (f64, f64)| ((x * fine).round() as i32, (y * fine).round() as i32);
    match shape {
        Shape::Line {
            points,
            width,
            color,
        } => {
            let style = filled(*color, 1.0);
            let half = width * fine / 2.0;
            for ends in points.windows(2) {
                let [(x0, y0), (x1, y1)] = [ends[0], ends[1]].map(|(x, y)| (x * fine, y * fine));
                let length = (x1 - x0).hypot(y1 - y0);
                // Two equal points have no direction.
                if length > 0.0 {
                    let (dx, dy) = ((y1 - y0) / length * half, (x0 - x1) / length * half);
                    let corners = [
                        (x0 + dx, y0 + dy),
                        (x1 + dx, y1 + dy),
                        (x1 - dx, y1 - dy),
                        (x0 - dx, y0 - dy),
                    ];
                    let corners = corners.map(|(x, y)| (x.round() as i32, y.round() as i32));
                    bitmap
                        .fill_polygon(corners, &style)
                        .map_err(io::Error::other)?;
                }
            }
            // Round joints where the line turns; its ends stay square, as dashes need.
            let inner = points
                .get(1..points.len().saturating_sub(1))
                .unwrap_or_default();
            for &joint in inner.iter().filter(|_| half >= 2.0) {
                bitmap
                    .draw_circle(pixel(joint), half.round() as u32, &style, true)
                    .map_err(io::Error::other)?;
            }
            Ok(())
        }
        Shape::Area {
            points,
            color,
            opacity,
        } => bitmap
            .fill_polygon(points.iter().copied().map(pixel), &filled(*color, *opacity))
            .map_err(io::Error::other),
        Shape::Text(text) => draw_glyphs(bitmap, text, fine as f32),
    }
}

/// Text by its outlines: plotters' own drops the bearings, which spaces letters unevenly.
fn draw_glyphs(bitmap: &mut BitMapBackend<'_>, text: &Text, fine: f32) -> io::Result<()> {
    let size = text.size as f32 * fine;
    let (glyphs, width) = glyphs(&text.text, size);
    let start = match text.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => -width / 2.0,
        Anchor::End => -width,
    };
    let (x0, y0) = (
        (text.at.0 as f32 * fine).round() as i32,
        (text.at.1 as f32 * fine).round() as i32,
    );
    let color = filled(text.color, 1.0).color;
    for (glyph, x) in glyphs {
        let placed = glyph.with_scale_and_position(scale(size), point(start + x, 0.0));
        let Some(outline) = FONT.outline_glyph(placed) else {
            continue;
        };
        let corner = outline.px_bounds().min;
        let mut result = Ok(());
        outline.draw(|x, y, cover| {
            let (x, y) = (corner.x as i32 + x as i32, corner.y as i32 + y as i32);
            let at = if text.upwards {
                (x0 + y, y0 - x)
            } else {
                (x0 + x, y0 + y)
            };
            if result.is_ok() {
                result = bitmap.draw_pixel(
                    at,
                    color
                        .mix(f64::from(cover.clamp(0.0, 1.0)))
                        .to_backend_color(),
                );
            }
        });
        result.map_err(io::Error::other)?;
    }
    Ok(())
}

fn draw_vectors(svg: &mut SVGBackend<'_>, shape: &Shape) -> io::Result<()> {
    let units = f64::from(SVG_UNITS);
    let unit = |(x, y): (f64, f64)| ((x * units).round() as i32, (y * units).round() as i32);
    match shape {
        Shape::Line {
            points,
            width,
            color,
        } => {
            let style = filled(*color, 1.0).stroke_width((width * units).round() as u32);
            svg.draw_path(points.iter().copied().map(unit), &style)
                .map_err(io::Error::other)
        }
        Shape::Area {
            points,
            color,
            opacity,
        } => svg
            .fill_polygon(points.iter().copied().map(unit), &filled(*color, *opacity))
            .map_err(io::Error::other),
        Shape::Text(text) => {
            let horizontal = match text.anchor {
                Anchor::Start => HPos::Left,
                Anchor::Middle => HPos::Center,
                Anchor::End => HPos::Right,
            };
            // plotters puts the middle of small letters, 0.27 em above the base line, at its
            // anchor, and takes a font's size to be 1.24 em.
            let up = 0.27 * text.size;
            let at = if text.upwards {
                (text.at.0 - up, text.at.1)
            } else {
                (text.at.0, text.at.1 - up)
            };
            let turn = if text.upwards {
                FontTransform::Rotate270
            } else {
                FontTransform::None
            };
            let font = FontDesc::new(
                FontFamily::Name(SVG_FONT),
                text.size * units * 1.24,
                FontStyle::Normal,
            );
            let color = filled(text.color, 1.0).color;
            let style = TextStyle::from(font.transform(turn))
                .color(&color)
                .pos(Pos::new(horizontal, VPos::Center));
            svg.draw_text(&text.text, &style, unit(at))
                .map_err(io::Error::other)
        }
    }
}

fn filled([red, green, blue]: Color, opacity: f64) -> ShapeStyle {
    let color: RGBAColor = RGBColor(red, green, blue).mix(opacity);
    color.filled()
}

/// Shrinks the image: each pixel of the result is the mean of [`SAMPLES`] by [`SAMPLES`] pixels.
fn coarser(pixels: &[u8], (width, height): (u32, u32)) -> Vec<u8> {
    let (samples, row) = (SAMPLES as usize, width as usize * 3);
    let mut coarse = Vec::with_capacity(pixels.len() / (samples * samples));
    for y in 0..height as usize / samples {
        for x in 0..width as usize / samples {
            for channel in 0..3 {
                let block = (0..samples * samples).map(|index| {
                    let (dx, dy) = (index % samples, index / samples);
                    u32::from(pixels[(y * samples + dy) * row + (x * samples + dx) * 3 + channel])
                });
                coarse.push((block.sum::<u32>() / (SAMPLES * SAMPLES)) as u8);
            }
        }
    }
    coarse
}

/// The PNG of RGB pixels, at `dpi` pixels to an inch.
fn encode(pixels: &[u8], (width, height): (u32, u32), dpi: u32) -> io::Result<Vec<u8>> {
    let to_the_metre = (f64::from(dpi) / 0.0254).round() as u32;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let (xppu, yppu) = (to_the_metre, to_the_metre);
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu,
        yppu,
        unit: png::Unit::Meter,
    }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}
