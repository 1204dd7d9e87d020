//! Times in bus logs: dates in their heads, in UTC, and decimal seconds.

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::Offset;

/// Month names that CANoe writes on a German Windows where they differ; the second is `Mär` read from an unknown code
/// page.
const GERMAN_MONTHS: [(&str, &str); 6] =
    [("M\u{e4}r", "Mar"), ("M\u{fffd}r", "Mar"), ("Mrz", "Mar"), ("Mai", "May"), ("Okt", "Oct"), ("Dez", "Dec")];

/// The date `unix_ms` milliseconds after the UNIX epoch.
pub(super) fn utc(unix_ms: u64) -> DateTime {
    // Times are 64 bits of nanoseconds, which end in the year 2554, and a timestamp reaches to the year 9999.
    let timestamp = i64::try_from(unix_ms).ok().and_then(|unix_ms| Timestamp::from_millisecond(unix_ms).ok());
    Offset::UTC.to_datetime(timestamp.unwrap_or(Timestamp::MAX))
}

/// Nanoseconds of the UNIX epoch; `None` before it, and where they don't fit 64 bits (from 2554 on).
pub(super) fn unix_ns(date: DateTime) -> Option<u64> {
    Offset::UTC.to_timestamp(date).ok()?.as_nanosecond().try_into().ok()
}

/// Nanoseconds of the UNIX epoch of `2015-07-10 06:17:32.249713`, with any number of digits behind the point.
pub(super) fn unix_ns_from_iso(text: &str) -> Option<u64> {
    let (date, fraction) = text.split_once('.').unwrap_or((text, ""));
    let date = DateTime::strptime("%Y-%m-%d %H:%M:%S", date).ok()?;
    unix_ns(date)?.checked_add(nanoseconds(&format!("0.{fraction}"))?)
}

/// Returns decimal seconds as whole nanoseconds, without floating-point rounding; further digits are cut off.
pub(super) fn nanoseconds(text: &str) -> Option<u64> {
    let (seconds, fraction) = text.split_once('.').unwrap_or((text, ""));
    let is_number = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit());
    if seconds.is_empty() || !is_number(seconds) || !is_number(fraction) {
        return None;
    }
    // Filled up with zeros or cut to nine digits, which are then the nanoseconds.
    let nine: String = fraction.chars().chain(core::iter::repeat('0')).take(9).collect();
    seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nine.parse().ok()?)
}

/// The date in the form of ASC: `Sat Sep 30 15:06:13.191 2017`.
pub(super) fn asc(date: DateTime) -> String {
    date.strftime("%a %b %d %H:%M:%S%.3f %Y").to_string()
}

/// Reads the form of ASC: `Sat Sep 30 15:06:13.191 2017`, with an optional fraction of the second, or with 12-hour time,
/// `Sat Sep 30 03:06:13.191 pm 2017`; the month in English or German. The weekday follows from the date, and is not
/// read: its name depends on the language of the tool.
pub(super) fn from_asc(text: &str) -> Option<DateTime> {
    let mut words = text.split_whitespace().skip(1).collect::<Vec<_>>();
    let month = words.first_mut()?;
    if let Some((_, english)) = GERMAN_MONTHS.into_iter().find(|(german, _)| german.eq_ignore_ascii_case(month)) {
        *month = english;
    }
    let form = if words.len() == 5 { "%b %d %I:%M:%S%.f %p %Y" } else { "%b %d %H:%M:%S%.f %Y" };
    DateTime::strptime(form, words.join(" ")).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Milliseconds of the UNIX epoch.
    fn unix_ms(date: DateTime) -> Option<u64> {
        unix_ns(date).map(|unix_ns| unix_ns / 1_000_000)
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        // As written by `date -u -d @SECONDS`.
        let cases = [
            (0, "Thu Jan 01 00:00:00.000 1970"),
            (951_782_399_999, "Mon Feb 28 23:59:59.999 2000"),
            (951_782_400_000, "Tue Feb 29 00:00:00.000 2000"),
            (1_506_783_973_191, "Sat Sep 30 15:06:13.191 2017"),
            (4_107_542_400_000, "Mon Mar 01 00:00:00.000 2100"),
        ];
        for (time_ms, text) in cases {
            assert_eq!(asc(utc(time_ms)), text);
            assert_eq!(from_asc(text).and_then(unix_ms), Some(time_ms));
        }
        for same in ["Sat Sep 30 03:06:13.191 pm 2017", "Sa sep 30 15:06:13.191 2017"] {
            assert_eq!(from_asc(same).and_then(unix_ms), Some(1_506_783_973_191), "{same}");
        }
        for wrong in [
            "Sat Feb 30 00:00:00 2017",
            "Sat Sep 30 25:00:00 2017",
            "Sat Sep 30 2017",
            "then",
            "",
            "Sat Sep 18446744073709551615 00:00:00 2017",
            "Sat Sep 30 00:00:00 18446744073709551615",
            "Sat Sep 30 18446744073709551615:00:00 2017",
        ] {
            assert_eq!(from_asc(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_fraction_of_a_second_has_any_number_of_digits() {
        assert_eq!(unix_ns_from_iso("1970-01-01 00:00:01.25"), Some(1_250_000_000));
        assert_eq!(unix_ns_from_iso("2015-07-10 06:17:32.24971300009"), Some(1_436_509_052_249_713_000));
        assert_eq!(unix_ns_from_iso("2015-07-10 06:17:32"), Some(1_436_509_052_000_000_000));
        assert_eq!(unix_ns_from_iso("1969-12-31 23:59:59"), None);
        assert_eq!(from_asc("Thu Jan 01 00:00:00.5 1970").and_then(unix_ms), Some(500));
    }

    proptest! {
        #[test]
        fn dates_come_back(time_ms in 0..7_000_000_000_000_u64) {
            prop_assert_eq!(unix_ms(utc(time_ms)), Some(time_ms));
        }
    }
}
