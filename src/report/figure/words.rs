//! Text that fits: broken into lines, or cut.

use super::picture::{Anchor, Color, Text, text_width};
use crate::escape;

/// A line of text, with characters that could do harm made harmless.
pub fn text(text: &str, at: (f64, f64), anchor: Anchor, size: f64, color: Color) -> Text {
    Text {
        text: escape::plain(text),
        at,
        anchor,
        size,
        color,
        upwards: false,
    }
}

/// `text` in lines no wider than `room`, broken at spaces, and within a word that is wider.
pub fn wrap(text: &str, size: f64, room: f64) -> Vec<String> {
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
pub fn fit(text: &str, size: f64, room: f64) -> String {
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
