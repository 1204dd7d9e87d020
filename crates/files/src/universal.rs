//! Lines and numbers of the Universal File Format (SDRC 1988; the University of Cincinnati keeps the layouts at
//! ceas3.uc.edu/sdrluff), for all that writes it.

use std::io::{self, Write};

/// Line before and after each dataset of a universal file.
pub(crate) const DELIMITER: &str = "    -1";
/// Specific data type of an axis without a quantity.
pub(crate) const NONE: u32 = 0;
/// Characters of a number in a column of 13, the first of which is blank.
const DIGITS: usize = 12;

/// Writes dataset 164, which states that all numbers are in SI units.
pub(crate) fn units(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{DELIMITER}\n{:6}{:74}", 164, "")?;
    writeln!(out, "{:10}{:<20}{:10}", 1, "SI: Meter (newton)", 2)?;
    // FORTRAN's D25.17: the factors from the file's units to SI, all 1, and an offset of temperature of 0.
    let one = "1.00000000000000000D+00";
    writeln!(out, "{one:>25}{one:>25}{one:>25}\n{:>25}\n{DELIMITER}", "0.00000000000000000D+00")
}

/// Writes the line of an axis of dataset 58: specific data type, exponents of length, force and temperature, label, unit.
pub(crate) fn axis(out: &mut impl Write, kind: u32, exponents: [i32; 3], label: &str, unit: &str) -> io::Result<()> {
    let [length, force, temperature] = exponents;
    writeln!(out, "{kind:10}{length:5}{force:5}{temperature:5} {label:20} {unit:20}")
}

/// Formats a text as one line of 80 ASCII characters.
pub(crate) fn line80(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).take(80).collect()
}

/// Formats a text of several words as one line of 80 ASCII characters; `NONE` if it is empty.
pub(crate) fn words80(text: &str) -> String {
    let text = if text.trim().is_empty() { "NONE" } else { text };
    let of_ascii = |c: char| if c.is_ascii_graphic() || c == ' ' { c } else { '_' };
    format!("{:80}", text.chars().map(of_ascii).take(80).collect::<String>())
}

/// Formats a number like FORTRAN's E20.12, with the exponent of two or three digits behind the first digit of the
/// value.
pub(crate) fn e20(value: f64) -> String {
    format!("{:>20}", exponential(value, 12))
}

/// Formats a number like FORTRAN's E13.5.
pub(crate) fn e13(value: f64) -> String {
    format!("{:>13}", exponential(value, 5))
}

/// Formats a number in 13 columns, of which the first is blank, with as many digits as fit. FORTRAN's E13.5 reads it with and
/// without an exponent, and readers that divide lines at blanks find it.
pub(crate) fn in_13(value: f64) -> String {
    let candidates = (1..DIGITS).flat_map(|places| [format!("{value:.places$}"), format!("{value:.places$e}")]);
    let fitting = candidates.filter(|text| text.len() <= DIGITS);
    let error = |text: &String| text.parse().map_or(f64::INFINITY, |read: f64| (read - value).abs());
    // The shortest of the nearest: they come with rising lengths, and `min_by` keeps the first.
    let nearest = fitting.min_by(|a, b| error(a).total_cmp(&error(b)));
    format!("{:>13}", nearest.unwrap_or_else(|| exponential(value, 5)))
}

/// Formats a number with an exponent of at least two digits and a sign: `-1.23e-4` becomes `-1.23000e-04`.
fn exponential(value: f64, places: usize) -> String {
    let text = format!("{value:.places$e}");
    match text.split_once('e') {
        Some((digits, exponent)) => match exponent.strip_prefix('-') {
            Some(exponent) => format!("{digits}e-{exponent:0>2}"),
            None => format!("{digits}e+{exponent:0>2}"),
        },
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_as_many_digits_as_their_column() {
        let text = |value: f64| in_13(value).trim_start().to_owned();
        let cases: [(f64, &str); 9] = [
            (0.0, "0.0"),
            (1.0, "1.0"),
            (-0.5, "-0.5"),
            (0.4, "0.4"),
            (core::f64::consts::PI, "3.1415926536"),
            (-389.557_489_045_1, "-389.557489"),
            (1.234_567_890_123e-5, "1.2345679e-5"),
            (-1.234_567_890_123e-12, "-1.23457e-12"),
            (6.022_140_76e23, "6.0221408e23"),
        ];
        for (value, expected) in cases {
            assert_eq!(text(value), expected);
            assert_eq!(in_13(value).len(), 13);
        }
    }
}
