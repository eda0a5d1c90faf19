//! Text from outside, made harmless for the place that shows it: a terminal, Markdown, LaTeX, a
//! spreadsheet, a web page.
//!
//! Owns the escapes of each format. Knows nothing of what the text says: error messages,
//! descriptions, names and log lines may hold anything. Start at [`plain`], which the others build
//! upon.

/// One line without control characters: line ends and tabs become spaces, others (and those that
/// turn or hide text) are written as `\u{1b}`.
pub fn plain(text: &str) -> String {
    text.chars()
        .fold(String::with_capacity(text.len()), |mut line, character| {
            match character {
                '\n' | '\r' | '\t' => line.push(' '),
                _ if unseen(character) => line.extend(character.escape_unicode()),
                _ => line.push(character),
            }
            line
        })
}

/// As [`plain`], for text of several lines: line ends and tabs stay.
pub fn terminal(text: &str) -> String {
    text.chars()
        .fold(String::with_capacity(text.len()), |mut shown, character| {
            match character {
                '\n' | '\t' => shown.push(character),
                _ if unseen(character) => shown.extend(character.escape_unicode()),
                _ => shown.push(character),
            }
            shown
        })
}

/// Whether a character moves the cursor, changes colours, or turns or hides its neighbours
/// (Unicode's bidirectional and zero-width formats).
fn unseen(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
}

/// One line of Markdown, in a table too, that shows `text`. A key between backticks (`` `ppo.clip`
/// ``) stays code.
pub fn markdown(text: &str) -> String {
    let characters: Vec<char> = plain(text).trim().chars().collect();
    let mut escaped = String::with_capacity(characters.len());
    let mut at = 0;
    while let Some(&character) = characters.get(at) {
        if let Some(key) = key_between_backticks(&characters[at..]) {
            escaped.extend(key);
            at += key.len();
            continue;
        }
        let within_a_word = at > 0
            && [characters.get(at - 1), characters.get(at + 1)]
                .iter()
                .all(|beside| beside.is_some_and(|beside| beside.is_alphanumeric()));
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '\\' | '`' | '*' | '[' | ']' | '|' | '~' => escaped.extend(['\\', character]),
            '_' if !within_a_word => escaped.push_str("\\_"),
            '#' | '+' | '-' if at == 0 => escaped.extend(['\\', character]),
            _ => escaped.push(character),
        }
        at += 1;
    }
    escaped
}

/// The beginning of `characters` that is a key between backticks.
fn key_between_backticks(characters: &[char]) -> Option<&[char]> {
    let inside = characters.strip_prefix(&['`'])?;
    let length = inside
        .iter()
        .take_while(|c| c.is_ascii_alphanumeric() || "._-".contains(**c))
        .count();
    (length > 0 && inside.get(length) == Some(&'`')).then(|| &characters[..length + 2])
}

/// One line of LaTeX that shows `text`, with no package and in any font of pdfTeX; what such a font
/// does not have is named by its code point. Safe at the start of a row too, where `[` and `*`
/// would be read as part of `\\`.
pub fn latex(text: &str) -> String {
    let mut escaped = String::new();
    let text = plain(text);
    let mut characters = text.trim().chars().peekable();
    while let Some(character) = characters.next() {
        if let Some((mark, first)) = raised_or_lowered(character) {
            escaped.extend(['$', mark, '{', first]);
            while let Some((_, next)) = characters
                .peek()
                .and_then(|next| raised_or_lowered(*next))
                .filter(|x| x.0 == mark)
            {
                escaped.push(next);
                characters.next();
            }
            escaped.push_str("}$");
            continue;
        }
        match character {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => escaped.extend(['\\', character]),
            '[' | ']' | '*' => escaped.extend(['{', character, '}']),
            '<' | '>' | '|' => escaped.extend(['$', character, '$']),
            ' '..='~' if latex_name(character).is_none() => escaped.push(character),
            // Letters that pdfTeX composes; those between them it has in other encodings alone.
            '\u{c0}'..='\u{ff}' if !"ÐÞ×ðþ÷".contains(character) => escaped.push(character),
            _ => match latex_name(character) {
                Some(name) => escaped.push_str(name),
                None => escaped.push_str(&format!("(U+{:04X})", u32::from(character))),
            },
        }
    }
    escaped
}

/// How LaTeX writes a symbol that its fonts have under a name.
fn latex_name(character: char) -> Option<&'static str> {
    let names = [
        ("~", "\\textasciitilde{}"),
        ("^", "\\textasciicircum{}"),
        ("\\", "\\textbackslash{}"),
        ("\"", "''"),
        ("`", "\\textasciigrave{}"),
        ("\u{a0}", "~"),
        ("±", "$\\pm$"),
        ("−", "$-$"),
        ("–", "--"),
        ("—", "---"),
        ("…", "\\dots{}"),
        ("‘", "`"),
        ("’", "'"),
        ("“", "``"),
        ("”", "''"),
        ("·", "$\\cdot$"),
        ("×", "$\\times$"),
        ("÷", "$\\div$"),
        ("∞", "$\\infty$"),
        ("≤", "$\\leq$"),
        ("≥", "$\\geq$"),
        ("≠", "$\\neq$"),
        ("≈", "$\\approx$"),
        ("→", "$\\to$"),
        ("∈", "$\\in$"),
        ("∑", "$\\sum$"),
        ("√", "$\\surd$"),
        ("∂", "$\\partial$"),
        ("°", "$^{\\circ}$"),
        ("§", "\\S{}"),
        ("Γ", "$\\Gamma$"),
        ("Δ", "$\\Delta$"),
        ("Θ", "$\\Theta$"),
        ("Λ", "$\\Lambda$"),
        ("Π", "$\\Pi$"),
        ("Σ", "$\\Sigma$"),
        ("Φ", "$\\Phi$"),
        ("Ψ", "$\\Psi$"),
        ("Ω", "$\\Omega$"),
        ("α", "$\\alpha$"),
        ("β", "$\\beta$"),
        ("γ", "$\\gamma$"),
        ("δ", "$\\delta$"),
        ("ε", "$\\epsilon$"),
        ("ζ", "$\\zeta$"),
        ("η", "$\\eta$"),
        ("θ", "$\\theta$"),
        ("κ", "$\\kappa$"),
        ("λ", "$\\lambda$"),
        ("μ", "$\\mu$"),
        ("µ", "$\\mu$"),
        ("ν", "$\\nu$"),
        ("ξ", "$\\xi$"),
        ("π", "$\\pi$"),
        ("ρ", "$\\rho$"),
        ("σ", "$\\sigma$"),
        ("τ", "$\\tau$"),
        ("φ", "$\\phi$"),
        ("χ", "$\\chi$"),
        ("ψ", "$\\psi$"),
        ("ω", "$\\omega$"),
    ];
    names
        .iter()
        .find(|(symbol, _)| symbol.starts_with(character))
        .map(|(_, name)| *name)
}

/// The character that was raised (`^`) or lowered (`_`) to give this one.
fn raised_or_lowered(character: char) -> Option<(char, char)> {
    let signs = "-+0123456789";
    let find = |mark, changed: &str| {
        changed
            .chars()
            .zip(signs.chars())
            .find(|pair| pair.0 == character)
            .map(|(_, sign)| (mark, sign))
    };
    find('^', "⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹").or_else(|| find('_', "₋₊₀₁₂₃₄₅₆₇₈₉"))
}

/// Text of a web page, also between quotes as an attribute's value.
pub fn html(text: &str) -> String {
    terminal(text).chars().fold(
        String::with_capacity(text.len()),
        |mut escaped, character| {
            match character {
                '&' => escaped.push_str("&amp;"),
                '<' => escaped.push_str("&lt;"),
                '>' => escaped.push_str("&gt;"),
                '"' => escaped.push_str("&quot;"),
                '\'' => escaped.push_str("&#39;"),
                _ => escaped.push(character),
            }
            escaped
        },
    )
}

/// JSON within a `<script>` of a web page, which no text in it can end.
pub fn script(json: &str) -> String {
    json.replace('<', "\\u003c") // in JSON it stands within strings alone
}

/// A path as a link of a web page: all but the plainest characters by their bytes.
pub fn link(path: &str) -> String {
    path.bytes()
        .fold(String::with_capacity(path.len()), |mut escaped, byte| {
            match byte {
                b'a'..=b'z'
                | b'A'..=b'Z'
                | b'0'..=b'9'
                | b'-'
                | b'.'
                | b'_'
                | b'~'
                | b'/'
                | b'='
                | b',' => {
                    escaped.push(char::from(byte));
                }
                _ => escaped.push_str(&format!("%{byte:02X}")),
            }
            escaped
        })
}

/// A cell of a CSV file that no spreadsheet takes for a formula: text that begins like one gets an
/// apostrophe before it. Numbers stay as they are; quotes and commas are the writer's.
pub fn csv(text: &str) -> String {
    let text = plain(text);
    let formula =
        text.trim_start().starts_with(['=', '+', '-', '@']) && text.parse::<f64>().is_err();
    if formula { format!("'{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_moves_the_cursor_or_turns_text() {
        assert_eq!(
            plain("a\x1b[31mred\nb\tc\u{202e}d"),
            "a\\u{1b}[31mred b c\\u{202e}d"
        );
        assert_eq!(
            terminal("a\x1b]0;title\x07\nb\tc\r"),
            "a\\u{1b}]0;title\\u{7}\nb\tc\\u{d}"
        );
        assert_eq!(plain("5 ± 1, é, 中, 10⁻³"), "5 ± 1, é, 中, 10⁻³");
    }

    #[test]
    fn markdown_shows_markup_and_makes_none() {
        for (text, escaped) in [
            ("a|b", "a\\|b"),
            (
                "<script>alert(1)</script>",
                "&lt;script&gt;alert(1)&lt;/script&gt;",
            ),
            (
                "[x](javascript:y) ![i](z)",
                "\\[x\\](javascript:y) !\\[i\\](z)",
            ),
            ("# no heading", "\\# no heading"),
            ("- no list\nof two", "\\- no list of two"),
            (
                "demo_states and _this_ and *that*",
                "demo_states and \\_this\\_ and \\*that\\*",
            ),
            ("another `ppo.clip`", "another `ppo.clip`"),
            ("`a b` and ``", "\\`a b\\` and \\`\\`"),
            ("x & y \\ z", "x &amp; y \\\\ z"),
        ] {
            assert_eq!(markdown(text), escaped, "{text}");
        }
    }

    #[test]
    fn latex_has_a_name_for_every_character() {
        for (text, escaped) in [
            (
                "a_b\\c^d & 50 %",
                "a\\_b\\textbackslash{}c\\textasciicircum{}d \\& 50 \\%",
            ),
            ("[8]", "{[}8{]}"),
            ("2·10⁻³ ≥ 5 ± 1", "2$\\cdot$10$^{-3}$ $\\geq$ 5 $\\pm$ 1"),
            ("x₁₂² ∞ ε", "x$_{12}$$^{2}$ $\\infty$ $\\epsilon$"),
            (
                "é中\u{7}\u{1f600}",
                "é(U+4E2D)\\textbackslash{}u\\{7\\}(U+1F600)",
            ),
            ("a\n\nb", "a  b"),
            ("\"q\" <x|y>", "''q'' $<$x$|$y$>$"),
        ] {
            assert_eq!(latex(text), escaped, "{text}");
        }
    }

    #[test]
    fn a_web_page_shows_markup_and_runs_none() {
        assert_eq!(
            html("<b id=\"x\" y='z'>&\u{202e}"),
            "&lt;b id=&quot;x&quot; y=&#39;z&#39;&gt;&amp;\\u{202e}"
        );
        assert_eq!(
            script("{\"a\":\"</script><!--\"}"),
            "{\"a\":\"\\u003c/script>\\u003c!--\"}"
        );
        assert_eq!(
            link("../runs/a b/d=0.1,x/\"é:"),
            "../runs/a%20b/d=0.1,x/%22%C3%A9%3A"
        );
    }

    #[test]
    fn a_spreadsheet_computes_nothing() {
        for formula in ["=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", " =1"] {
            assert_eq!(csv(formula), format!("'{formula}"));
        }
        assert_eq!(csv("\t=1"), "' =1");
        for harmless in ["-0.5", "-1e-6", "+3", "a=b", "Hopper-v2", ""] {
            assert_eq!(csv(harmless), harmless);
        }
    }
}
