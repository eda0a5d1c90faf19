//! Figures: curves as panels in a grid, with one legend outside the axes.
//!
//! Owns where everything is put. Knows nothing of files, and of plotters only that [`picture`] does. Start at [`draw`].

mod panel;
pub mod picture;
mod style;
mod ticks;

use std::collections::BTreeSet;

pub use style::{BLACK, PALETTE};

use picture::{Anchor, Picture, Shape, Text, text_width};

use super::curve::{Curve, CurveData, LeftOut, SEEDS_FOR_BAND};
use crate::escape;
use panel::Frame;
use style::{GREY, Look, NOTE_SIZE, SIZE, TITLE_SIZE};

const MARGIN: f64 = 10.0;
const LINE: f64 = 1.35; // of a text's size

/// The figure of `data`.
pub fn draw(data: &CurveData) -> Picture {
    let panels = data.panels.len().max(1);
    let columns = match panels {
        1 => 1,
        2 | 4 => 2,
        _ => 3,
    };
    let (width, height) = [(400.0, 240.0), (600.0, 205.0), (760.0, 175.0)][columns - 1];
    let mut page = Page { shapes: Vec::new(), width, y: MARGIN };
    page.title(&data.title);

    let (left, top) = (MARGIN + 1.6 * SIZE, page.y);
    let panel_width = (width - left - MARGIN) / columns as f64;
    let label_widths = data.panels.iter().map(|panel| panel::label_width(data, panel, height));
    let mut labels = vec![0.0; columns];
    for (index, label_width) in label_widths.enumerate() {
        labels[index % columns] = f64::max(labels[index % columns], label_width);
    }
    let any_paper =
        data.panels.iter().flat_map(|panel| panel.curves.iter().flatten()).any(|curve| curve.paper.is_some());
    for (index, panel) in data.panels.iter().enumerate() {
        let (column, row) = (index % columns, index / columns);
        let frame = Frame {
            left: left + column as f64 * panel_width,
            top: top + row as f64 * height,
            width: panel_width,
            height,
            labels: labels[column],
            gutter: if any_paper { panel::GUTTER } else { 0.0 },
            x_label: index + columns >= panels,
        };
        page.shapes.extend(panel::draw(data, panel, frame));
        if column == 0 {
            let mut label = text(&data.y_label, (MARGIN + SIZE, frame.top + height / 2.0), Anchor::Middle, SIZE, BLACK);
            label.upwards = true;
            page.shapes.push(Shape::Text(label));
        }
    }

    page.y = top + panels.div_ceil(columns) as f64 * height + 12.0;
    let (free, beside) = (columns - 1 - (panels - 1) % columns, width - MARGIN);
    let legend = Legend::new(data, if free > 0 { free as f64 * panel_width } else { width - 2.0 * MARGIN });
    if free > 0 && legend.height() < height - 24.0 {
        // In the empty cells of the last row, below the names of the x axes above them.
        let room = height - 24.0 - legend.height();
        let middle = beside - free as f64 * panel_width / 2.0;
        page.shapes.extend(legend.draw(middle, page.y - height + 12.0 + room / 2.0));
    } else {
        page.shapes.extend(legend.draw(width / 2.0, page.y));
        page.y += legend.height();
    }
    page.notes(&notes(data));
    Picture { width, height: page.y + MARGIN, shapes: page.shapes }
}

/// What the legend says of one kind of line: its name, in lines where it is long.
#[derive(Debug, Clone)]
struct Entry {
    look: Look,
    lines: Vec<String>,
    width: f64,
}

/// One entry a series, and one for each other kind of line that is drawn; in rows, each centred.
struct Legend {
    /// The width of each row, and its entries.
    rows: Vec<(f64, Vec<Entry>)>,
}

impl Legend {
    const KEY: f64 = 34.0;
    const GAP: f64 = 18.0;
    const LINE: f64 = SIZE * 1.25;
    const BETWEEN: f64 = SIZE * 0.25;

    fn new(data: &CurveData, room: f64) -> Self {
        let mut entries: Vec<(Look, String)> =
            data.series.iter().enumerate().map(|(index, name)| (Look::Series(index), name.text.clone())).collect();
        let drawn =
            || data.panels.iter().filter(|panel| panel.curves.iter().flatten().any(|curve| !curve.points.is_empty()));
        let curves = || drawn().flat_map(|panel| panel.curves.iter().flatten());
        if curves().any(|curve| curve.paper.is_some()) {
            entries.push((Look::Paper, "the paper, after training".to_owned()));
        }
        if drawn().any(|panel| panel.demo.is_some()) {
            entries.push((Look::Demo, "the demonstration".to_owned()));
        }
        if curves().any(|curve| !curve.tolerance.is_empty()) {
            entries.push((Look::Tolerance, "tolerance d of the same colour's curve".to_owned()));
        }
        let entries: Vec<Entry> = entries.into_iter().map(|(look, name)| Entry::new(look, &name, room)).collect();
        let rows = Self::rows(entries.clone(), room);
        // Series of one width stand in columns, unless that takes more rows.
        let widest = entries.iter().filter(|entry| entry.is_series()).map(|entry| entry.width).fold(0.0, f64::max);
        let even = entries
            .into_iter()
            .map(|entry| Entry { width: if entry.is_series() { widest } else { entry.width }, ..entry });
        let even = Self::rows(even.collect(), room);
        Self { rows: if even.len() > rows.len() { rows } else { even } }
    }

    fn rows(entries: Vec<Entry>, room: f64) -> Vec<(f64, Vec<Entry>)> {
        let mut rows: Vec<(f64, Vec<Entry>)> = Vec::new();
        for entry in entries {
            match rows.last_mut() {
                Some((used, row)) if *used + Self::GAP + entry.width <= room => {
                    *used += Self::GAP + entry.width;
                    row.push(entry);
                }
                _ => rows.push((entry.width, vec![entry])),
            }
        }
        rows
    }

    fn height(&self) -> f64 {
        self.rows.iter().map(|(_, row)| Self::row_height(row)).sum::<f64>() + 6.0
    }

    fn row_height(row: &[Entry]) -> f64 {
        let lines = row.iter().map(|entry| entry.lines.len()).max().unwrap_or(0);
        lines as f64 * Self::LINE + Self::BETWEEN
    }

    fn draw(&self, middle: f64, top: f64) -> Vec<Shape> {
        let mut shapes = Vec::new();
        let mut above = top;
        for (width, row) in &self.rows {
            let mut x = middle - width / 2.0;
            for entry in row {
                for (index, line) in entry.lines.iter().enumerate() {
                    let y = above + (index + 1) as f64 * Self::LINE + Self::BETWEEN;
                    if index == 0 {
                        shapes.extend(entry.look.key((x, y - 0.3 * SIZE), Self::KEY - 6.0));
                    }
                    shapes.push(Shape::Text(text(line, (x + Self::KEY, y), Anchor::Start, SIZE, BLACK)));
                }
                x += entry.width + Self::GAP;
            }
            above += Self::row_height(row);
        }
        shapes
    }
}

impl Entry {
    fn new(look: Look, name: &str, room: f64) -> Self {
        let lines = wrap(name, SIZE, room - Legend::KEY);
        let width = Legend::KEY + lines.iter().map(|line| text_width(line, SIZE)).fold(0.0, f64::max);
        Self { look, lines, width }
    }

    fn is_series(&self) -> bool {
        matches!(self.look, Look::Series(_))
    }
}

/// A page that is filled from the top.
struct Page {
    shapes: Vec<Shape>,
    width: f64,
    y: f64,
}

impl Page {
    fn title(&mut self, title: &str) {
        for line in wrap(title, TITLE_SIZE, self.width - 2.0 * MARGIN) {
            self.y += TITLE_SIZE * LINE;
            let at = (self.width / 2.0, self.y - 0.3 * TITLE_SIZE);
            self.shapes.push(Shape::Text(text(&line, at, Anchor::Middle, TITLE_SIZE, BLACK)));
        }
        self.y += 4.0;
    }

    fn notes(&mut self, notes: &str) {
        if notes.is_empty() {
            return;
        }
        for line in wrap(notes, NOTE_SIZE, self.width - 2.0 * MARGIN) {
            self.y += NOTE_SIZE * LINE;
            self.shapes.push(Shape::Text(text(&line, (MARGIN, self.y), Anchor::Start, NOTE_SIZE, GREY)));
        }
    }
}

/// What a reader must know of the curves: seeds, bands, and what is lacking.
fn notes(data: &CurveData) -> String {
    let curves: Vec<(&str, &str, &Curve)> = data
        .panels
        .iter()
        .filter(|panel| panel.curves.iter().flatten().any(|curve| curve.seeds > 0)) // the others say so themselves
        .flat_map(|panel| {
            let named = data.series.iter().zip(&panel.curves);
            named.filter_map(|(name, curve)| Some((panel.title.as_str(), name.text.as_str(), curve.as_ref()?)))
        })
        .collect();
    if curves.is_empty() {
        return String::new();
    }
    let finished = || curves.iter().map(|(_, _, curve)| curve.seeds).filter(|seeds| *seeds > 0);
    let (fewest, most) = (finished().min().unwrap_or(0), finished().max().unwrap_or(0));
    let kind = if data.log_y { "Geometric mean" } else { "Mean" };
    let band = match curves.iter().any(|(_, _, curve)| (2..SEEDS_FOR_BAND).contains(&curve.seeds)) {
        true if most < SEEDS_FOR_BAND => "from one to the other",
        true => "95 % Student t interval, of two seeds their range, cut at the frame",
        false => "95 % Student t interval, cut at the frame",
    };
    let mut notes = vec![match most {
        0 | 1 => "One seed a curve.".to_owned(),
        _ if fewest < most => format!("{kind} over {fewest} to {most} seeds; shaded: {band}."),
        _ => format!("{kind} over {most} seeds; shaded: {band}."),
    }];
    let name =
        |env: &str, series: &str| if data.series.len() > 1 { format!("{series}, {env}") } else { env.to_owned() };
    let lacking: Vec<String> = curves
        .iter()
        .filter(|(_, _, curve)| curve.seeds < curve.planned)
        .map(|(env, series, curve)| format!("{} ({} of {})", name(env, series), curve.seeds, curve.planned))
        .collect();
    let counts: BTreeSet<(usize, usize)> = curves.iter().map(|(_, _, curve)| (curve.seeds, curve.planned)).collect();
    match counts.first() {
        _ if lacking.is_empty() => {}
        Some((seeds, planned)) if counts.len() == 1 && curves.len() > 1 => {
            notes.push(format!("Of each curve {seeds} of {planned} seeds are finished."));
        }
        _ => notes.push(format!("Fewer finished: {}.", shorten(&lacking))),
    }
    let mut left_out = |reason: &str, count: fn(&LeftOut) -> usize| {
        let of: Vec<String> = curves
            .iter()
            .filter(|(_, _, curve)| count(&curve.left_out) > 0)
            .map(|(env, series, curve)| format!("{} ({})", name(env, series), count(&curve.left_out)))
            .collect();
        if !of.is_empty() {
            notes.push(format!("{reason}: {}.", shorten(&of)));
        }
    };
    left_out("Gaps where a seed's value is no finite number", |left_out| left_out.not_finite);
    left_out("Gaps where a seed's value is not above 0, which this axis cannot show", |left_out| left_out.not_positive);
    left_out("Points left out because a seed has none there", |left_out| left_out.absent);
    notes.join(" ")
}

/// The first few of a list, and how many more there are.
fn shorten(list: &[String]) -> String {
    const SHOWN: usize = 6;
    let shown = list[..list.len().min(SHOWN)].join("; ");
    if list.len() > SHOWN { format!("{shown}; and {} more", list.len() - SHOWN) } else { shown }
}

fn text(text: &str, at: (f64, f64), anchor: Anchor, size: f64, color: picture::Color) -> Text {
    Text { text: escape::plain(text), at, anchor, size, color, upwards: false }
}

/// `text` in lines no wider than `room`, broken at spaces, and within a word that is wider.
fn wrap(text: &str, size: f64, room: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    let fits = |line: &str, more: &str| text_width(line, size) + text_width(more, size) <= room;
    for word in escape::plain(text).split(' ') {
        let line = lines.last_mut().expect("there is always one");
        if line.is_empty() || !fits(line, &format!(" {word}")) {
            if !line.is_empty() {
                lines.push(String::new());
            }
        } else {
            line.push(' ');
        }
        for character in word.chars() {
            let line = lines.last_mut().expect("there is always one");
            if line.is_empty() || fits(line, character.encode_utf8(&mut [0; 4])) {
                line.push(character);
            } else {
                lines.push(character.to_string());
            }
        }
    }
    lines
}

/// `text`, cut with an ellipsis where it is wider than `room`.
fn fit(text: &str, size: f64, room: f64) -> String {
    if text_width(text, size) <= room {
        return text.to_owned();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while kept.pop().is_some() {
        let cut: String = kept.iter().chain(&['…']).collect();
        if text_width(&cut, size) <= room {
            return cut;
        }
    }
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{
        axis::Label,
        curve::{Panel, Point},
    };

    /// A curve of `values` with bands.
    fn curve(values: &[f64]) -> Curve {
        let points = values.iter().zip(1..).map(|(&mean, step)| {
            let band = Some((mean - 0.1 * mean.abs(), mean + 0.1 * mean.abs()));
            Point { env_steps: f64::from(step) * 1e5, mean, band }
        });
        Curve { points: points.collect(), seeds: 5, planned: 5, paper: Some(values[0]), ..Curve::default() }
    }

    fn figure(panels: Vec<Panel>, series: usize, name: &str, log_y: bool) -> CurveData {
        let series = (0..series).map(|index| Label { text: format!("{name} {index}"), values: vec![] }).collect();
        CurveData {
            title: "A title of a figure".into(),
            y_label: "return (dense reward)".into(),
            log_y,
            y: "return".into(),
            keys: vec![],
            series,
            panels,
        }
    }

    fn panel(title: &str, curves: Vec<Option<Curve>>) -> Panel {
        Panel { title: title.into(), curves, demo: Some(500.0) }
    }

    /// Left, right, top and bottom of everything that is written.
    fn boxes(picture: &Picture) -> Vec<(String, [f64; 4])> {
        let place = |text: &Text| {
            let width = text_width(&text.text, text.size);
            let start = match text.anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => -width / 2.0,
                Anchor::End => -width,
            };
            let (x, y) = text.at;
            let (up, down) = (0.73 * text.size, 0.2 * text.size);
            match text.upwards {
                false => [x + start, x + start + width, y - up, y + down],
                true => [x - up, x + down, y - start - width, y - start],
            }
        };
        let texts = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Text(text) => Some((text.text.clone(), place(text))),
            Shape::Line { .. } | Shape::Area { .. } => None,
        });
        texts.collect()
    }

    /// Everything lies on the page, and no text on another.
    fn check(data: &CurveData) {
        let picture = draw(data);
        let boxes = boxes(&picture);
        for (index, (text, [left, right, top, bottom])) in boxes.iter().enumerate() {
            let inside = *left >= 0.0 && *right <= picture.width && *top >= 0.0 && *bottom <= picture.height;
            assert!(inside, "`{text}` leaves the page");
            for (other, [l, r, t, b]) in &boxes[..index] {
                let apart = left >= r || l >= right || top >= b || t >= bottom;
                assert!(apart, "`{text}` lies on `{other}`");
            }
        }
        for shape in &picture.shapes {
            let (Shape::Line { points, .. } | Shape::Area { points, .. }) = shape else { continue };
            for (x, y) in points {
                let inside = (0.0..=picture.width).contains(x) && (0.0..=picture.height).contains(y);
                assert!(inside, "a line leaves the page at ({x}, {y})");
            }
        }
    }

    #[test]
    fn nothing_is_clipped_or_written_over_whatever_the_numbers() {
        let values: [&[f64]; 5] =
            [&[0.0, -2.5e6, -9e6], &[1e-3, 4e-3, 2e-3], &[1e9, 4e10, 2e9], &[1000.0, 1000.0], &[-0.5]];
        for panels in 1..=7 {
            let panels = (0..panels).map(|index| {
                let curves = (0..7).map(|series| (series != 3).then(|| curve(values[(index + series) % 5]))).collect();
                panel("InvertedDoublePendulum-v2", curves)
            });
            check(&figure(panels.collect(), 7, "a method", false));
        }
    }

    #[test]
    fn curves_that_were_meant_to_have_fewer_seeds_lack_none() {
        let (few, mut many) = (curve(&[1.0, 2.0]), curve(&[1.0, 2.0]));
        (many.seeds, many.planned) = (15, 15);
        let panels = vec![panel("Hopper-v2", vec![Some(few)]), panel("Ant-v2", vec![Some(many)])];
        let told = notes(&figure(panels, 1, "MCPO", false));
        assert!(told.starts_with("Mean over 5 to 15 seeds;") && !told.contains("Fewer finished"), "{told}");
    }

    #[test]
    fn seeds_that_are_finished_are_counted_not_planned_ones() {
        let short = || Some(Curve { seeds: 2, ..curve(&[1.0, 2.0]) });
        let told = notes(&figure(vec![panel("Hopper-v2", vec![short(), short()])], 2, "MCPO", false));
        let expected = "Mean over 2 seeds; shaded: from one to the other. Of each curve 2 of 5 seeds are finished.";
        assert_eq!(told, expected);
        let told = notes(&figure(vec![panel("Hopper-v2", vec![short(), Some(curve(&[1.0]))])], 2, "MCPO", false));
        assert!(told.starts_with("Mean over 2 to 5 seeds;") && told.contains("MCPO 0, Hopper-v2 (2 of 5)"), "{told}");
    }

    #[test]
    fn long_names_are_broken_or_cut() {
        let name = "penalty, samples = rollout, bandwidth = median heuristic, estimator = u, weight = 100";
        let long = "AnEnvironmentWithANameThatIsLongerThanAnyPanelIsWideAndThenSome-v2";
        let mut data = figure(vec![panel(long, vec![Some(curve(&[1.0, 2.0])); 9])], 9, name, false);
        data.title = "much too long a title ".repeat(9);
        check(&data);
    }

    #[test]
    fn legends_of_any_length_stay_apart() {
        let name =
            "a very long name of a series that does not fit into one line of a legend, whatever the size ".repeat(3);
        let data = figure(vec![panel("Ant-v2", vec![Some(curve(&[1.0, 2.0])); 16])], 16, &name, false);
        check(&data);
        let written: Vec<String> = boxes(&draw(&data)).into_iter().map(|(text, _)| text).collect();
        for index in 0..16 {
            assert!(written.iter().any(|line| line.ends_with(&format!(" {index}"))), "{index}: {written:?}");
        }
    }

    #[test]
    fn titles_of_any_script_are_one_line_and_what_the_font_lacks_is_told() {
        let mut data = figure(vec![panel("Ant-v2", vec![Some(curve(&[1.0, 2.0]))])], 1, "MCPO", false);
        data.title = "学习\tcurve\nof \u{1b} Ü".into();
        let picture = draw(&data);
        assert_eq!(picture.without_glyph().into_iter().collect::<String>(), "习学");
        let written: Vec<String> = boxes(&picture).into_iter().map(|(text, _)| text).collect();
        assert_eq!(written[0], "学习 curve of \\u{1b} Ü");
    }

    #[test]
    fn a_panel_without_curves_says_why() {
        let written = |left_out, seeds| {
            let empty = Curve { planned: 5, seeds, left_out, ..Curve::default() };
            let mut data = figure(vec![panel("Hopper-v2", vec![Some(empty)])], 1, "MCPO", true);
            data.y = "nu".into();
            check(&data);
            boxes(&draw(&data)).into_iter().map(|(text, _)| text).collect::<Vec<_>>().join("\n")
        };
        let none = LeftOut::default();
        assert!(written(none, 0).contains("\nno finished run\n"));
        assert!(written(none, 5).contains("\nno value of nu\n") && !written(none, 5).contains("no finished run"));
        assert!(written(LeftOut { not_positive: 3, ..none }, 5).contains("\nnothing above 0\n"));
        assert!(written(LeftOut { not_finite: 3, ..none }, 5).contains("\nno finite number\n"));
        let text = written(LeftOut { absent: 3, ..none }, 5);
        assert!(
            text.contains("\nno point of all seeds\n") && text.contains("a seed has none there: Hopper-v2 (3)"),
            "{text}"
        );
    }

    #[test]
    fn a_gap_is_not_bridged() {
        let mut broken = curve(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        broken.gaps = vec![2.5e5];
        let data = figure(vec![panel("Hopper-v2", vec![Some(broken)])], 1, "MCPO", false);
        let crosses = |shape: &Shape| match shape {
            Shape::Line { points, color, .. } if *color == style::color(0) && points.len() > 1 => {
                points.first().zip(points.last()).map(|(first, last)| last.0 - first.0)
            }
            _ => None,
        };
        let picture = draw(&data);
        let mut lengths: Vec<f64> = picture.shapes.iter().filter_map(crosses).collect();
        lengths.sort_by(f64::total_cmp);
        let whole = picture.width;
        assert!(lengths.iter().all(|length| *length < 0.5 * whole), "{lengths:?}");
    }

    #[test]
    fn what_does_not_train_is_a_level_line() {
        let mut level =
            Curve { points: vec![Point { env_steps: 0.0, mean: 1.5, band: Some((1.0, 2.0)) }], ..curve(&[1.0]) };
        level.paper = None;
        let data = figure(vec![panel("Hopper-v2", vec![Some(curve(&[1.0, 2.0])), Some(level)])], 2, "method", false);
        check(&data);
        let lengths = draw(&data).shapes.into_iter().filter_map(|shape| match shape {
            Shape::Line { points, color, .. } if color == style::color(1) => Some(points.last()?.0 - points.first()?.0),
            _ => None,
        });
        assert!(lengths.fold(0.0, f64::max) > 200.0, "it does not cross the panel");
    }

    #[test]
    fn five_decades_and_zeros_fit_a_logarithmic_axis() {
        let mut falling = curve(&[1.0, 1e-2, 1e-4, 1e-5]);
        falling.paper = None;
        falling.tolerance = vec![(1e5, 1e-3), (4e5, 1e-3)];
        falling.points[3].band = Some((0.0, 1e-4));
        let mut data = figure(vec![panel("HalfCheetah-v2", vec![Some(falling)])], 1, "MCPO", true);
        data.panels[0].demo = None;
        check(&data);
        let written: Vec<String> = boxes(&draw(&data)).into_iter().map(|(text, _)| text).collect();
        assert!(written.contains(&"10⁻³".to_owned()), "{written:?}");
    }

    #[test]
    fn a_panel_without_finished_runs_says_so_and_missing_seeds_are_named() {
        let (empty, mut short) = (Curve { planned: 5, ..Curve::default() }, curve(&[1.0, 2.0]));
        short.seeds = 4;
        let panels = vec![panel("Hopper-v2", vec![Some(empty)]), panel("Ant-v2", vec![Some(short)])];
        let data = figure(panels, 1, "MCPO", false);
        check(&data);
        let written: Vec<String> = boxes(&draw(&data)).into_iter().map(|(text, _)| text).collect();
        assert!(written.contains(&"no finished run".to_owned()), "{written:?}");
        assert!(written.iter().any(|text| text.contains("Fewer finished: Ant-v2 (4 of 5)")), "{written:?}");
    }

    #[test]
    fn the_legend_lies_outside_the_axes() {
        let data = figure(vec![panel("Hopper-v2", vec![Some(curve(&[1.0, 2.0])); 3])], 3, "method", false);
        let boxes = boxes(&draw(&data));
        let top = |wanted: &str| boxes.iter().find(|(text, _)| text == wanted).map(|(_, at)| at[2]).expect("written");
        assert!(top("method 0") > top("environment steps"));
    }

    #[test]
    fn the_same_data_gives_the_same_picture() {
        let data = figure(vec![panel("Hopper-v2", vec![Some(curve(&[1.0, 2.0, 0.5]))])], 1, "MCPO", false);
        let (one, other) = (draw(&data), draw(&data));
        assert!(one.png().expect("encoded") == other.png().expect("encoded"));
        let svg = one.svg().expect("text");
        assert_eq!(svg, other.svg().expect("text"));
        assert!(svg.starts_with("<svg width=\"400pt\"") && svg.contains(">\nenvironment steps"), "{}", &svg[..200]);
    }
}
