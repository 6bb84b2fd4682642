//! Numbers as people read them: no more digits than mean something, a true minus sign.

/// With so many significant digits; in powers of ten where it would be long. `-` for what is not finite.
#[must_use]
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) && value.is_finite() {
        let scientific = format!("{value:.*e}", digits.saturating_sub(1));
        return minus(scientific);
    }
    decimal(value, decimals_for(magnitude, digits))
}

/// With so many digits after the point. `-` for what is not finite.
#[must_use]
pub fn decimal(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let text = format!("{value:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    minus(if is_zero {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    })
}

/// As somebody else printed it: with all its digits and no more. `-` for what is not finite.
#[must_use]
pub fn printed(value: f64) -> String {
    if value.is_finite() {
        minus(value.to_string())
    } else {
        "-".to_owned()
    }
}

/// A value and its standard error, `34.96 ± 0.23`: to the error's second digit.
#[must_use]
pub fn with_error(value: f64, standard_error: f64) -> String {
    if !(standard_error.is_finite() && standard_error > 0.0) {
        return number(value, 5);
    }
    let decimals = decimals_for(standard_error.log10().floor(), 2).min(6);
    let error = decimal(standard_error, decimals);
    let value = decimal(value, decimals);
    format!("{value} ± {error}")
}

/// Digits after the point that give `digits` significant ones to a number of this power of ten.
fn decimals_for(magnitude: f64, digits: usize) -> usize {
    (digits as f64 - 1.0 - magnitude).clamp(0.0, 12.0) as usize
}

fn minus(text: String) -> String {
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits() {
        assert_eq!(number(0.012345, 3), "0.0123");
        assert_eq!(number(-123.456, 3), "−123");
        assert_eq!(number(1234.0, 3), "1234");
        assert_eq!(number(1.5e-7, 2), "1.5e−7");
        assert_eq!(number(0.0, 3), "0");
        assert_eq!(number(f64::NAN, 3), "-");
        assert_eq!(number(f64::INFINITY, 3), "-");
    }

    #[test]
    fn the_error_decides_the_digits_of_the_value() {
        assert_eq!(with_error(34.964_71, 0.2345), "34.96 ± 0.23");
        assert_eq!(with_error(0.001_23, 0.000_41), "0.00123 ± 0.00041");
        assert_eq!(with_error(1500.0, 120.0), "1500 ± 120");
        assert_eq!(with_error(2.5, f64::NAN), "2.5000");
    }

    #[test]
    fn printed_values_keep_their_digits() {
        assert_eq!(printed(-0.0685), "−0.0685");
        assert_eq!(printed(47.6), "47.6");
        assert_eq!(printed(f64::NAN), "-");
    }

    #[test]
    fn zero_has_no_sign() {
        assert_eq!(decimal(-0.001, 2), "0.00");
    }
}
