//! A picture as a PDF of one page: text stays text, and the glyphs that it needs are embedded.
//!
//! Owns everything of PDF. Knows nothing of curves. Start at [`Picture::pdf`].

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, Write},
};

use flate2::{Compression, write::ZlibEncoder};
use pdf_writer::{
    Content, Filter, Finish, Name, Pdf, Rect, Ref, Str,
    types::{CidFontType, FontFlags, LineJoinStyle, SystemInfo, UnicodeCmap},
};
use subsetter::GlyphRemapper;

use super::picture::{Anchor, Color, FONT_FILE, Metrics, Picture, Shape, Text, glyphs, metrics};

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const FONT: Ref = Ref::new(5);
const CID_FONT: Ref = Ref::new(6);
const DESCRIPTOR: Ref = Ref::new(7);
const FONT_PROGRAM: Ref = Ref::new(8);
const TO_UNICODE: Ref = Ref::new(9);
/// The object number of the first opacity.
const OPACITIES: i32 = 10;

/// The name of the font on the page.
const FONT_NAME: Name = Name(b"F");
/// The font's name; its six-letter prefix marks a subset of the font, as PDF requires.
const BASE_FONT: Name = Name(b"MCPORN+DejaVuSans");
const IDENTITY: SystemInfo = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};
/// PDF measures glyphs in thousandths of an em.
const EM: f32 = 1000.0;

impl Picture {
    /// The picture as a PDF.
    ///
    /// # Errors
    ///
    /// None that the embedded font, which the tests check, can give.
    pub fn pdf(&self) -> io::Result<Vec<u8>> {
        // PDF sets opacities through named states, so each opacity in use gets one.
        let opacities: BTreeSet<u32> = self.shapes.iter().filter_map(opacity).collect();
        let opacities: BTreeMap<u32, (String, Ref)> = (0..)
            .zip(opacities)
            .map(|(index, percent)| (percent, (format!("G{index}"), Ref::new(OPACITIES + index))))
            .collect();
        let mut page = Page {
            content: Content::new(),
            height: self.height,
            font: Glyphs::default(),
            opacities,
        };
        self.shapes.iter().for_each(|shape| page.shape(shape));
        let Page {
            content,
            font,
            opacities,
            ..
        } = page;

        let mut pdf = Pdf::new();
        pdf.catalog(CATALOG).pages(PAGES);
        pdf.pages(PAGES).kids([PAGE]).count(1);
        let mut page = pdf.page(PAGE);
        page.parent(PAGES)
            .media_box(Rect::new(0.0, 0.0, self.width as f32, self.height as f32))
            .contents(CONTENT);
        let mut resources = page.resources();
        resources.fonts().pair(FONT_NAME, FONT);
        let mut states = resources.ext_g_states();
        opacities.values().for_each(|(name, id)| {
            states.pair(Name(name.as_bytes()), *id);
        });
        // An object must be finished before the next one is begun.
        states.finish();
        resources.finish();
        page.finish();
        for (percent, (_, id)) in &opacities {
            pdf.ext_graphics(*id)
                .non_stroking_alpha(*percent as f32 / 100.0);
        }
        pdf.stream(CONTENT, &deflated(&content.finish())?)
            .filter(Filter::FlateDecode);
        font.embed(&mut pdf)?;
        Ok(pdf.finish())
    }
}

/// The opacity of a filled area in percent; `None` for lines and text.
fn opacity(shape: &Shape) -> Option<u32> {
    match shape {
        Shape::Area { opacity, .. } => Some((opacity * 100.0).round() as u32),
        Shape::Line { .. } | Shape::Text(_) => None,
    }
}

/// The page while it is drawn.
struct Page {
    content: Content,
    height: f64,
    font: Glyphs,
    /// The name and object of each opacity, by its percentage.
    opacities: BTreeMap<u32, (String, Ref)>,
}

impl Page {
    /// A point in PDF's coordinates, whose y axis points up.
    fn at(&self, (x, y): (f64, f64)) -> (f32, f32) {
        (x as f32, (self.height - y) as f32)
    }

    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Line {
                points,
                width,
                color,
            } => {
                let [red, green, blue] = unit(*color);
                self.content
                    .set_stroke_rgb(red, green, blue)
                    .set_line_width(*width as f32);
                self.content.set_line_join(LineJoinStyle::RoundJoin);
                self.path(points);
                self.content.stroke();
            }
            Shape::Area { points, color, .. } => {
                let state = opacity(shape).and_then(|percent| self.opacities.get(&percent));
                if let Some((name, _)) = state {
                    self.content.set_parameters(Name(name.as_bytes()));
                }
                let [red, green, blue] = unit(*color);
                self.content.set_fill_rgb(red, green, blue);
                self.path(points);
                self.content.close_path().fill_nonzero();
            }
            Shape::Text(text) => self.text(text),
        }
    }

    /// Begins a path; PDF wants all state before it.
    fn path(&mut self, points: &[(f64, f64)]) {
        for (index, &point) in points.iter().enumerate() {
            let (x, y) = self.at(point);
            if index == 0 {
                self.content.move_to(x, y);
            } else {
                self.content.line_to(x, y);
            }
        }
    }

    fn text(&mut self, text: &Text) {
        let size = text.size as f32;
        let (glyphs, width) = glyphs(&text.text, size);
        let start = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        let (x, y) = self.at(text.at);
        let matrix = match text.upwards {
            false => [1.0, 0.0, 0.0, 1.0, x + start, y],
            true => [0.0, 1.0, -1.0, 0.0, x, y + start],
        };
        let [red, green, blue] = unit(text.color);
        self.content
            .begin_text()
            .set_font(FONT_NAME, size)
            .set_fill_rgb(red, green, blue)
            .set_text_matrix(matrix);
        let mut shown = self.content.show_positioned();
        let mut items = shown.items();
        let mut pen = 0.0;
        for ((glyph, x), character) in glyphs.into_iter().zip(text.text.chars()) {
            let (id, advance) = self.font.take(glyph.0, character);
            if (x - pen).abs() > 1e-3 {
                items.adjust(-(x - pen) / size * EM); // kerned
            }
            items.show(Str(&id.to_be_bytes()));
            pen = x + advance * size / EM;
        }
        items.finish();
        shown.finish();
        self.content.end_text();
    }
}

/// The glyphs in use, with new numbers.
#[derive(Default)]
struct Glyphs {
    mapper: GlyphRemapper,
    /// Each new number's character, and its advance in thousandths of an em.
    used: BTreeMap<u16, (char, f32)>,
}

impl Glyphs {
    /// The new number of `glyph`, which stands for `character`, and its advance.
    fn take(&mut self, glyph: u16, character: char) -> (u16, f32) {
        let (id, advance) = (self.mapper.remap(glyph), metrics().advance(glyph) * EM);
        self.used.entry(id).or_insert((character, advance));
        (id, advance)
    }

    fn embed(&self, pdf: &mut Pdf) -> io::Result<()> {
        let program = subsetter::subset(FONT_FILE, 0, &self.mapper).map_err(io::Error::other)?;
        let Metrics {
            ascent,
            descent,
            cap_height,
            ..
        } = metrics();
        // The page's text holds glyph numbers, which Identity-H and the identity map take as they
        // are.
        pdf.type0_font(FONT)
            .base_font(BASE_FONT)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(CID_FONT)
            .to_unicode(TO_UNICODE);
        let mut font = pdf.cid_font(CID_FONT);
        font.subtype(CidFontType::Type2)
            .base_font(BASE_FONT)
            .system_info(IDENTITY)
            .font_descriptor(DESCRIPTOR);
        font.cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = font.widths();
        for (id, (_, advance)) in &self.used {
            widths.same(*id, *id, *advance);
        }
        widths.finish();
        font.finish();
        pdf.font_descriptor(DESCRIPTOR)
            .name(BASE_FONT)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Rect::new(-1021.0, -463.0, 1793.0, 1232.0)) // the font's own, of its table `head`
            .italic_angle(0.0)
            .ascent(ascent * EM)
            .descent(descent * EM)
            .cap_height(cap_height * EM)
            .stem_v(90.0)
            .font_file2(FONT_PROGRAM);
        // PDF asks for the length of a TrueType program before compression.
        let length = program.len() as i32;
        pdf.stream(FONT_PROGRAM, &deflated(&program)?)
            .filter(Filter::FlateDecode)
            .pair(Name(b"Length1"), length);
        // The map back to characters makes the text searchable and copyable.
        let mut unicode = UnicodeCmap::new(Name(b"Adobe-Identity-UCS"), IDENTITY);
        self.used
            .iter()
            .for_each(|(id, (character, _))| unicode.pair(*id, *character));
        pdf.cmap(TO_UNICODE, &unicode.finish());
        Ok(())
    }
}

fn unit(color: Color) -> [f32; 3] {
    color.map(|channel| f32::from(channel) / 255.0)
}

fn deflated(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn picture(text: &str) -> Picture {
        let line = Shape::Line {
            points: vec![(10.0, 10.0), (90.0, 10.0)],
            width: 1.0,
            color: [0, 0, 0],
        };
        let corners = vec![(10.0, 20.0), (90.0, 20.0), (90.0, 40.0)];
        let area = Shape::Area {
            points: corners,
            color: [255, 0, 0],
            opacity: 0.16,
        };
        let (at, anchor, size, color) = ((50.0, 50.0), Anchor::Middle, 8.0, [0, 0, 0]);
        let text = Text {
            text: text.into(),
            at,
            anchor,
            size,
            color,
            upwards: false,
        };
        Picture {
            width: 100.0,
            height: 60.0,
            dpi: 300,
            shapes: vec![area, line, Shape::Text(text)],
        }
    }

    /// The inflated streams of a PDF of ours.
    fn streams(pdf: &[u8]) -> Vec<Vec<u8>> {
        let starts = pdf
            .windows(7)
            .enumerate()
            .filter(|(_, window)| *window == b"stream\n")
            .map(|(at, _)| at + 7);
        let inflated = starts.filter_map(|start| {
            let mut bytes = Vec::new();
            flate2::read::ZlibDecoder::new(&pdf[start..])
                .read_to_end(&mut bytes)
                .ok()
                .map(|_| bytes)
        });
        inflated.filter(|bytes| !bytes.is_empty()).collect()
    }

    #[test]
    fn a_pdf_has_its_page_and_a_part_of_the_font_that_can_draw_its_text() {
        let pdf = picture("AVAVA ± 10⁻³ ε").pdf().expect("written");
        assert!(
            pdf.starts_with(b"%PDF-1.7") && pdf.len() < 30_000,
            "{} bytes",
            pdf.len()
        );
        assert_eq!(
            pdf,
            picture("AVAVA ± 10⁻³ ε").pdf().expect("written"),
            "the same picture gives the same bytes"
        );
        let streams = streams(&pdf);
        let content = String::from_utf8_lossy(&streams[0]);
        assert!(
            content.contains("10 50 m") && content.contains("90 50 l"),
            "y goes up: {content}"
        );
        assert!(
            content.contains("/G0 gs"),
            "a band is translucent: {content}"
        );
        let program = &streams[1];
        let face = ab_glyph::FontRef::try_from_slice(program);
        assert!(
            face.is_err() || program.len() < FONT_FILE.len() / 10,
            "the whole font is in it"
        );
        let text = String::from_utf8_lossy(&pdf);
        assert!(
            text.contains("/FontFile2") && text.contains("/MediaBox [0 0 100 60]"),
            "{text}"
        );
        // Every character can be copied out of it again.
        for character in "AV±10⁻³ε".chars() {
            let code = format!("<{:04X}>", u32::from(character));
            assert!(
                text.contains(&code),
                "{character} is not in the map: {text}"
            );
        }
    }
}
