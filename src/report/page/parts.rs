//! The small parts that sections are made of.

use crate::escape;

/// A section under a heading.
pub fn section(id: &str, title: &str, body: &str) -> String {
    format!(
        "<section id=\"{id}\" aria-labelledby=\"{id}-title\">\n<h2 id=\"{id}-title\">{title}</h2>\n\
         {body}</section>\n"
    )
}

/// Text as HTML; parts between backticks become code.
pub fn prose(text: &str) -> String {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return escape::html(text);
    }
    let part = |(index, part): (usize, &&str)| match index % 2 {
        0 => escape::html(part),
        _ => format!("<code>{}</code>", escape::html(part)),
    };
    parts.iter().enumerate().map(part).collect()
}

/// Notes that stay folded until a reader opens them.
pub fn notes(title: &str, notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    let items: String = notes
        .iter()
        .map(|note| format!("<li>{}</li>\n", prose(note)))
        .collect();
    format!("<details class=\"notes\"><summary>{title}</summary>\n<ul>\n{items}</ul>\n</details>\n")
}

/// Links to the files of a table or figure, which lie beside the page.
pub fn files(name: &str, extensions: &[&str]) -> String {
    let link = |extension: &&str| {
        let (file, format) = (
            escape::link(&format!("{name}{extension}")),
            format_of(extension),
        );
        format!("<a href=\"{file}\">{format}</a>")
    };
    let links: Vec<String> = extensions.iter().map(link).collect();
    format!("<p class=\"files\">{}</p>\n", links.join(" "))
}

/// The name of a file's format, by its extension.
fn format_of(extension: &str) -> &str {
    match extension {
        ".csv" | "-curves.csv" => "CSV",
        "-seeds.csv" => "seeds as CSV",
        ".md" => "Markdown",
        ".tex" => "LaTeX",
        ".png" => "PNG",
        ".svg" => "SVG",
        ".pdf" => "PDF",
        other => other,
    }
}

/// A verdict with a mark, so that colour is not its only sign.
pub fn verdict(text: &str) -> String {
    let word = text.split([':', ' ']).next().unwrap_or_default();
    let class = match word {
        "holds" | "reproduced" => "good",
        "contradicted" | "worse" => "bad",
        "better" => "other",
        _ => "open",
    };
    format!("<span class=\"verdict {class}\">{}</span>", prose(text))
}

/// `word` in the singular or plural, as `count` asks.
pub fn plural(count: usize, word: &str) -> String {
    if count == 1 {
        word.to_owned()
    } else {
        format!("{word}s")
    }
}
