//! The page's security policy: it may use its own style and run its own script, both known by their
//! digests, and nothing else.

/// The digests of `style.css` and `script.js`, as a Content Security Policy names them. The test
/// below tells the right ones.
const STYLE: &str = "sha256-RfgP6o7/CGHcXp7/sfTfhaqODxz9hHPS8KJUTIXUoCY=";
const SCRIPT: &str = "sha256-1xtNiHjsIB14B+TngyVF/kVVp9u0DmLMeoBGRSXYRNA=";

/// The policy of the page.
pub fn content_security() -> String {
    format!(
        "default-src 'none'; style-src '{STYLE}'; script-src '{SCRIPT}'; base-uri 'none'; \
         form-action 'none'"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digests_are_of_the_style_and_the_script() {
        assert_eq!(
            digest(b"abc"),
            "sha256-ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=",
            "FIPS 180-4's example"
        );
        assert_eq!(STYLE, digest(super::super::STYLE.as_bytes()));
        assert_eq!(SCRIPT, digest(super::super::SCRIPT.as_bytes()));
    }

    /// SHA-256 (FIPS 180-4) in base64.
    fn digest(text: &[u8]) -> String {
        let primes: Vec<u32> = (2..312).filter(|n| (2..*n).all(|m| n % m != 0)).collect();
        let fraction = |root: f64| (root.fract() * 2.0_f64.powi(32)) as u32;
        let constants: Vec<u32> = primes
            .iter()
            .map(|&prime| fraction(f64::from(prime).cbrt()))
            .collect();
        let mut state: Vec<u32> = primes[..8]
            .iter()
            .map(|&prime| fraction(f64::from(prime).sqrt()))
            .collect();
        let mut bytes = text.to_vec();
        bytes.push(0x80);
        bytes.resize((bytes.len() + 8).next_multiple_of(64) - 8, 0);
        bytes.extend((8 * text.len() as u64).to_be_bytes());
        for block in bytes.chunks(64) {
            let mut words: Vec<u32> = block
                .chunks(4)
                .map(|word| u32::from_be_bytes([word[0], word[1], word[2], word[3]]))
                .collect();
            for t in 16..64 {
                let (a, b) = (words[t - 15], words[t - 2]);
                let small = a.rotate_right(7) ^ a.rotate_right(18) ^ (a >> 3);
                let large = b.rotate_right(17) ^ b.rotate_right(19) ^ (b >> 10);
                words.push(
                    words[t - 16]
                        .wrapping_add(small)
                        .wrapping_add(words[t - 7])
                        .wrapping_add(large),
                );
            }
            let mut now = state.clone();
            for (constant, word) in constants.iter().zip(&words) {
                let [a, b, c, _, e, f, g, h] = now[..] else {
                    unreachable!("eight words")
                };
                let choice = (e & f) ^ (!e & g);
                let first = [
                    e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25),
                    choice,
                    *constant,
                    *word,
                ];
                let first = first.iter().fold(h, |sum, term| sum.wrapping_add(*term));
                let second = (a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22))
                    .wrapping_add((a & b) ^ (a & c) ^ (b & c));
                now.rotate_right(1);
                now[0] = first.wrapping_add(second);
                now[4] = now[4].wrapping_add(first);
            }
            state
                .iter_mut()
                .zip(now)
                .for_each(|(word, now)| *word = word.wrapping_add(now));
        }
        let bytes: Vec<u8> = state.iter().flat_map(|word| word.to_be_bytes()).collect();
        format!("sha256-{}", base64(&bytes))
    }

    fn base64(bytes: &[u8]) -> String {
        let digits: Vec<char> = ('A'..='Z')
            .chain('a'..='z')
            .chain('0'..='9')
            .chain(['+', '/'])
            .collect();
        let three = |bytes: &[u8]| {
            let word = bytes
                .iter()
                .chain([&0; 2])
                .take(3)
                .fold(0, |word: usize, byte| word << 8 | usize::from(*byte));
            let digit = |place: usize| {
                if place > bytes.len() {
                    '='
                } else {
                    digits[word >> (18 - 6 * place) & 63]
                }
            };
            (0..4).map(digit).collect::<String>()
        };
        bytes.chunks(3).map(three).collect()
    }
}
