//! Lengths of time as people write them.

use std::time::Duration;

/// The units, longest first, with their seconds.
const UNITS: [(char, u64); 4] = [('d', 86_400), ('h', 3_600), ('m', 60), ('s', 1)];

/// Parses a length of time, such as `2h`, `90m`, `1h30m`: whole numbers with their units, the
/// longer unit first.
///
/// # Errors
///
/// The text has another form, or the time is zero.
pub fn parse(text: &str) -> Result<Duration, String> {
    let refused = || format!("`{text}` is not a length of time such as 2h, 90m or 1h30m");
    let (mut rest, mut seconds, mut units) = (text, 0_u64, UNITS.iter());
    while !rest.is_empty() {
        let end = rest
            .find(|c: char| !c.is_ascii_digit())
            .ok_or_else(refused)?;
        let number: u64 = rest[..end].parse().map_err(|_| refused())?;
        let (_, unit) = units
            .find(|(name, _)| rest[end..].starts_with(*name))
            .ok_or_else(refused)?;
        seconds = number
            .checked_mul(*unit)
            .and_then(|part| part.checked_add(seconds))
            .ok_or_else(refused)?;
        rest = &rest[end + 1..];
    }
    if seconds == 0 {
        Err(refused())
    } else {
        Ok(Duration::from_secs(seconds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_numbers_with_units_and_nothing_else() {
        for (text, seconds) in [
            ("45s", 45),
            ("90m", 5_400),
            ("2h", 7_200),
            ("1h30m", 5_400),
            ("1d2h3m4s", 93_784),
        ] {
            assert_eq!(parse(text), Ok(Duration::from_secs(seconds)), "{text}");
        }
        for text in [
            "",
            "2",
            "h",
            "2 h",
            "-2h",
            "1.5h",
            "30m1h",
            "2h2h",
            "0s",
            "2hours",
            "99999999999999999999h",
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
        assert!(parse(&format!("{}d", u64::MAX)).is_err());
    }
}
