//! The digits of a table's numbers: as many as the deviation makes meaningful.

/// `mean ± spread` with two digits of the spread, and at most `most` after the point: `1802 ± 13`,
/// `118.66 ± 0.38`. A spread too small for these digits is shown as smaller than them; one that is
/// not finite is not shown.
pub fn plus_minus(mean: f64, spread: f64, most: usize) -> String {
    if !spread.is_finite() {
        return alone(mean);
    }
    // The mean of equal numbers differs from them in its last bits.
    if spread <= 1e-13 * mean.abs() {
        return format!("{} ± 0", shortest(mean, most));
    }
    // The exponent is that of the rounded spread, since 9.96 becomes 10.
    let exponent: i32 = format!("{spread:.1e}")
        .split_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or_default();
    let decimals = usize::try_from(1 - exponent).unwrap_or(0).min(most);
    let shown = number(spread, decimals);
    if shown.bytes().any(|digit| (b'1'..=b'9').contains(&digit)) {
        format!("{} ± {shown}", number(mean, decimals))
    } else {
        let least = 10_f64.powi(-(most as i32));
        format!("{} ± <{least:.most$}", number(mean, decimals))
    }
}

/// The two ends of an interval, with three digits of its width and at most four after the point, as
/// `−1210 to 350`.
pub fn between(low: f64, high: f64) -> String {
    let decimals = decimals_of(high - low);
    format!("{} to {}", number(low, decimals), number(high, decimals))
}

/// A number with as many digits as its interval has.
pub fn within(value: f64, low: f64, high: f64) -> String {
    number(value, decimals_of(high - low))
}

/// Digits after the point of the ends of an interval of this width.
fn decimals_of(width: f64) -> usize {
    let exponent: i32 = format!("{width:.1e}")
        .split_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or_default();
    if width > 0.0 {
        usize::try_from(2 - exponent).unwrap_or(0).min(4)
    } else {
        2
    }
}

/// A number without a deviation: five digits, at most two after the point.
pub fn alone(value: f64) -> String {
    let most = match value.abs() {
        10_000.0.. => 0,
        1000.0.. => 1,
        _ => 2,
    };
    shortest(value, most)
}

/// At most `most` digits after the point, and no zeros at the end.
fn shortest(value: f64, most: usize) -> String {
    let text = number(value, most);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A number with a true minus, and no minus before zero.
fn number(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits)
            if digits
                .chars()
                .any(|digit| digit.is_ascii_digit() && digit != '0') =>
        {
            format!("−{digits}")
        }
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviation_decides_the_digits() {
        for (mean, spread, shown) in [
            (9314.57, 0.41, "9314.57 ± 0.41"),
            (118.66, 0.38, "118.66 ± 0.38"),
            (25.71, 1.03, "25.7 ± 1.0"),
            (1897.69, 904.12, "1898 ± 904"),
            (-2332.95, 2193.85, "−2333 ± 2194"),
            (1000.0, 0.0, "1000 ± 0"),
            (553.5, 0.0, "553.5 ± 0"),
            (115.0 / 3.0, 7e-15, "38.3333 ± 0"),
            (12.34, 9.96, "12 ± 10"),
            (0.12345, 0.0123, "0.123 ± 0.012"),
            (5.0, 0.00321, "5.0000 ± 0.0032"),
            (1000.0, 1e-9, "1000.0000 ± <0.0001"),
            (3.25, f64::NAN, "3.25"),
            (3.25, f64::INFINITY, "3.25"),
            (-0.001, 2.0, "0.0 ± 2.0"),
        ] {
            assert_eq!(plus_minus(mean, spread, 4), shown);
        }
        assert_eq!(
            plus_minus(17.09, 0.001, 2),
            "17.09 ± <0.01",
            "the paper prints two decimals"
        );
    }

    #[test]
    fn an_interval_has_the_digits_of_its_width() {
        for (low, high, shown) in [
            (-1210.4, 349.7, "−1210 to 350"),
            (-0.5, -0.25, "−0.500 to −0.250"),
            (-0.0004, 12.34, "0.0 to 12.3"),
            (10.0, 10.0, "10.00 to 10.00"),
            (1.0, 1.000_001, "1.0000 to 1.0000"),
        ] {
            assert_eq!(between(low, high), shown);
        }
        assert_eq!(within(0.998_31, 0.9968, 0.9998), "0.9983");
    }

    #[test]
    fn a_number_alone_has_five_digits() {
        let shown = [
            969.71, 9320.416, 12_345.6, -600.25, 553.0, 0.004, -0.004, 120.5,
        ]
        .map(alone);
        assert_eq!(
            shown,
            [
                "969.71",
                "9320.4",
                "12346",
                "−600.25",
                "553",
                "0",
                "0",
                "120.5"
            ]
        );
    }
}
