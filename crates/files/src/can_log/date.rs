//! Calendar dates of the UNIX epoch, in UTC.

const DAYS: [&str; 7] = ["Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"];
const MONTHS: [&str; 12] = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
/// Month names that CANoe writes on a German Windows where they differ; the second is `Mär` read from an unknown code
/// page.
const GERMAN_MONTHS: [(&str, u64); 6] =
    [("M\u{e4}r", 3), ("M\u{fffd}r", 3), ("Mrz", 3), ("Mai", 5), ("Okt", 10), ("Dez", 12)];
const DAY_S: u64 = 86_400;

/// A millisecond in the calendar, UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Date {
    pub year: u64,
    /// Month of the year, 1 to 12.
    pub month: u64,
    /// Day of the month, 1 to 31.
    pub day: u64,
    /// Day of the week as the number of days since Sunday, 0 to 6.
    pub weekday: u64,
    pub hour: u64,
    pub minute: u64,
    pub second: u64,
    pub millisecond: u64,
}

impl Date {
    /// Returns the date `unix_ms` milliseconds after the UNIX epoch.
    ///
    /// Years are counted from 1 March, so that the leap day is the last of a year, in eras of 400 years
    /// (H. Hinnant, "chrono-Compatible low-level date algorithms", 2013, `civil_from_days`).
    pub fn from_unix_ms(unix_ms: u64) -> Date {
        let (seconds, millisecond) = (unix_ms / 1000, unix_ms % 1000);
        let (days, second) = (seconds / DAY_S, seconds % DAY_S);
        // Days from 0000-03-01 to 1970-01-01. An era of 400 years has 146 097 days, a century 36 524 and four years
        // 1461.
        let from_march = days + 719_468;
        let (era, day_of_era) = (from_march / 146_097, from_march % 146_097);
        let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
        let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        // From March on, five months have 153 days (31, 30, 31, 30, 31), again and again.
        let month_from_march = (5 * day_of_year + 2) / 153;
        let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
        Date {
            year: 400 * era + year_of_era + u64::from(month <= 2),
            month,
            day: day_of_year - (153 * month_from_march + 2) / 5 + 1,
            // 1 January 1970 was a Thursday.
            weekday: (days + 4) % 7,
            hour: second / 3600,
            minute: second / 60 % 60,
            second: second % 60,
            millisecond,
        }
    }

    /// Returns nanoseconds of the UNIX epoch; `None` if there is no such date, or they don't fit 64 bits (before 1970
    /// and from 2554 on).
    pub fn unix_ns(&self) -> Option<u64> {
        self.unix_ms()?.checked_mul(1_000_000)
    }

    /// Returns milliseconds of the UNIX epoch; `None` before it, or if there is no such date.
    fn unix_ms(&self) -> Option<u64> {
        // The comparison below rejects days that a month does not have.
        let is_there = self.year < 10_000 && self.month < 13 && self.day < 32 && self.hour < 24;
        if !is_there || self.minute >= 60 || self.second >= 60 || self.millisecond >= 1000 {
            return None;
        }
        let year = self.year.checked_sub(u64::from(self.month <= 2))?;
        let (era, year_of_era) = (year / 400, year % 400);
        let month_from_march = (self.month + 9) % 12;
        let day_of_year = (153 * month_from_march + 2) / 5 + self.day.checked_sub(1)?;
        let day_of_era = 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + day_of_year;
        let days = (era.checked_mul(146_097)? + day_of_era).checked_sub(719_468)?;
        let second = days * DAY_S + 3600 * self.hour + 60 * self.minute + self.second;
        let unix_ms = 1000 * second + self.millisecond;
        // The weekday is not compared: logs state it, but it follows from the date.
        let found = Date { weekday: self.weekday, ..Date::from_unix_ms(unix_ms) };
        (found == *self).then_some(unix_ms)
    }

    /// Returns nanoseconds of the UNIX epoch of `2015-07-10 06:17:32.249713`, with any number of digits behind the
    /// point.
    pub fn unix_ns_from_iso(text: &str) -> Option<u64> {
        let (day, time) = text.split_once(' ')?;
        let (time, fraction) = time.split_once('.').unwrap_or((time, ""));
        let numbers = |text: &str, separator| -> Option<Vec<u64>> {
            text.split(separator).map(|number| number.parse().ok()).collect()
        };
        let (day, time) = (numbers(day, '-')?, numbers(time, ':')?);
        let ([year, month, day], [hour, minute, second]) = (&day[..], &time[..]) else { return None };
        let [year, month, day, hour, minute, second] = [year, month, day, hour, minute, second].map(|number| *number);
        let date = Date { year, month, day, weekday: 0, hour, minute, second, millisecond: 0 };
        date.unix_ns()?.checked_add(super::candump::nanoseconds(&format!("0.{fraction}"))?)
    }

    /// Formats the date as in ASC: `Sat Sep 30 15:06:13.191 2017`.
    pub fn asc(&self) -> String {
        let Date { year, month, day, weekday, hour, minute, second, millisecond } = *self;
        let (weekday, month) = (DAYS[weekday as usize % 7], MONTHS[(month as usize - 1) % 12]);
        format!("{weekday} {month} {day:02} {hour:02}:{minute:02}:{second:02}.{millisecond:03} {year}")
    }

    /// Parses a date of ASC: `Sat Sep 30 15:06:13.191 2017`, with optional milliseconds, or with 12-hour time, `Sat Sep
    /// 30 03:06:13.191 pm 2017`; the month in English or German.
    pub fn from_asc(text: &str) -> Option<Date> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let (month, day, time, half, year) = match words[..] {
            [_, month, day, time, year] => (month, day, time, None, year),
            [_, month, day, time, half, year] => (month, day, time, Some(half), year),
            _ => return None,
        };
        let months = MONTHS.into_iter().zip(1..).chain(GERMAN_MONTHS);
        let (_, month) = months.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(month))?;
        let (time, millisecond) = time.split_once('.').unwrap_or((time, "0"));
        let numbers: Vec<u64> = time.split(':').map(|number| number.parse().ok()).collect::<Option<_>>()?;
        let [hour, minute, second] = numbers[..] else { return None };
        let hour = match half {
            None => hour,
            Some(half) if half.eq_ignore_ascii_case("am") => hour % 12,
            Some(half) if half.eq_ignore_ascii_case("pm") => hour % 12 + 12,
            Some(_) => return None,
        };
        let (day, year, millisecond) = (day.parse().ok()?, year.parse().ok()?, millisecond.parse().ok()?);
        // Through milliseconds and back, which also fills in the weekday.
        let date = Date { year, month, day, weekday: 0, hour, minute, second, millisecond };
        date.unix_ms().map(Date::from_unix_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
        for (unix_ms, text) in cases {
            assert_eq!(Date::from_unix_ms(unix_ms).asc(), text);
            assert_eq!(Date::from_asc(text).and_then(|date| date.unix_ms()), Some(unix_ms));
        }
        assert_eq!(Date::from_asc("Sat Sep 30 03:06:13.191 pm 2017").unwrap().unix_ms(), Some(1_506_783_973_191));
        for wrong in [
            "Sat Feb 30 00:00:00 2017",
            "Sat Sep 30 25:00:00 2017",
            "Sat Sep 30 2017",
            "then",
            "Sat Sep 18446744073709551615 00:00:00 2017",
            "Sat Sep 30 00:00:00 18446744073709551615",
            "Sat Sep 30 18446744073709551615:00:00 2017",
        ] {
            assert_eq!(Date::from_asc(wrong), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn dates_come_back(unix_ms in 0..7_000_000_000_000_u64) {
            prop_assert_eq!(Date::from_unix_ms(unix_ms).unix_ms(), Some(unix_ms));
        }
    }
}
