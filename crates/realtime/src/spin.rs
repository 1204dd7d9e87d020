//! Waiting for a deadline: asleep, or asleep until shortly before and then looking at the clock.

use core::fmt;
use core::str::FromStr;

use serde::Serialize;
use thiserror::Error;

use crate::clock::Clock;
use crate::latency::{HistogramError, LatencyHistogram};
use crate::rate::SampleRate;
use resonarm_numeric::number::short;

/// The largest fraction of a period that a loop spins: a quarter, so that a thread that can't be preempted leaves
/// others most of its core, whatever it has measured.
const SPIN_PART: u64 = 4;
/// Sleeps that are measured.
const SLEEPS: u32 = 300;
/// Longest sleep of the measurement, ns.
const SLEEP_NS: u64 = 500_000;

/// Whether the loop spins before a deadline. In text: `off`, `auto`, or a number of microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spin {
    /// The loop sleeps until the deadline.
    #[default]
    Off,
    /// The loop spins for as long as sleeps are late, if that is at most a quarter of the period: measured before the
    /// first sample.
    Auto,
    /// The loop spins for this long, ns.
    For(u64),
}

/// The choice, and why. As JSON it is in the document of `resonarm run --json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpinChoice {
    /// Time for which the loop spins before each deadline, µs; 0 if it sleeps until the deadline.
    pub spin_us: f64,
    /// Largest lateness of 99 % of the sleeps measured before the first sample, µs; `None` if the time was given.
    pub slept_p99_us: Option<f64>,
    /// The most that is possible at the rate, µs.
    pub most_us: f64,
}

impl Spin {
    /// Refuses a spin time that is too long for a loop at `rate`.
    ///
    /// # Errors
    /// [`SpinError::TooLong`] for a time given that is longer than a quarter of the period.
    pub fn check(self, rate: SampleRate) -> Result<(), SpinError> {
        let most_ns = most_ns(rate);
        match self {
            Spin::For(ns) if ns > most_ns => Err(SpinError::TooLong {
                got_us: ns as f64 / 1e3,
                most_us: most_ns as f64 / 1e3,
                rate_hz: rate.rate_hz(),
            }),
            Spin::Off | Spin::Auto | Spin::For(_) => Ok(()),
        }
    }

    /// Chooses for a loop at `rate` on the calling thread. [`Spin::Auto`] sleeps 300 times for that, half a millisecond
    /// or a period each.
    ///
    /// # Errors
    /// [`SpinError::TooLong`] for a time given that is longer than a quarter of the period.
    pub fn choose<C: Clock>(self, clock: &C, rate: SampleRate) -> Result<Option<SpinChoice>, SpinError> {
        self.check(rate)?;
        let most_ns = most_ns(rate);
        let choice = |spin_ns: u64, slept_p99_us| {
            let [spin_us, most_us] = [spin_ns, most_ns].map(|ns| ns as f64 / 1e3);
            SpinChoice { spin_us, slept_p99_us, most_us }
        };
        match self {
            Spin::Off => Ok(None),
            Spin::For(ns) => Ok(Some(choice(ns, None))),
            Spin::Auto => {
                // The sleeps are no longer than those of the loop, since a core that idles longer may sleep deeper
                // and wake up later. Half a millisecond each bounds the whole measurement to some 0.15 s.
                let p99_us = sleeps_p99_us(clock, rate.offset_ns(1).min(SLEEP_NS))?;
                let p99_ns = (p99_us * 1e3) as u64;
                // Sleeps later than the longest spin would end after the deadline even so: the spin would cost the core
                // and gain nothing, so it is off.
                Ok(Some(choice(if p99_ns <= most_ns { p99_ns } else { 0 }, Some(p99_us))))
            }
        }
    }
}

impl SpinChoice {
    /// Returns the time for which the loop spins, ns.
    pub fn spin_ns(&self) -> u64 {
        (self.spin_us * 1e3) as u64
    }
}

impl fmt::Display for SpinChoice {
    /// Writes what was chosen and why: `for 85.2 µs before each deadline: of 300 sleeps 99 % were late by up to that`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { spin_us, slept_p99_us, most_us } = self;
        match slept_p99_us {
            None => write!(f, "for {spin_us:.1} µs before each deadline, as asked for"),
            Some(p99_us) if p99_us > most_us => {
                write!(
                    f,
                    "off: of {SLEEPS} sleeps 99 % were late by up to {p99_us:.1} µs, more than a quarter of the period"
                )
            }
            Some(_) => {
                write!(f, "for {spin_us:.1} µs before each deadline: of {SLEEPS} sleeps 99 % were late by up to that")
            }
        }
    }
}

/// The longest time that a loop at this rate may spin, ns.
fn most_ns(rate: SampleRate) -> u64 {
    rate.offset_ns(1) / SPIN_PART
}

/// Returns the largest lateness of 99 % of sleeps of `sleep_ns`, µs.
fn sleeps_p99_us<C: Clock>(clock: &C, sleep_ns: u64) -> Result<f64, HistogramError> {
    let mut late = LatencyHistogram::new()?;
    for _ in 0..SLEEPS {
        let deadline_ns = clock.now_ns() + sleep_ns;
        clock.sleep_until_ns(deadline_ns);
        late.record(clock.now_ns().saturating_sub(deadline_ns));
    }
    Ok(late.percentiles().map_or(0.0, |found| found.p99))
}

impl FromStr for Spin {
    type Err = SpinError;

    fn from_str(text: &str) -> Result<Self, SpinError> {
        match text {
            "off" => Ok(Spin::Off),
            "auto" => Ok(Spin::Auto),
            number => match number.parse::<f64>() {
                // A coarse bound on the text. `check`, which knows the rate, has the bound that counts.
                Ok(us) if us > 0.0 && us <= 1e6 => Ok(Spin::For((us * 1e3) as u64)),
                _ => Err(SpinError::Text { got: text.to_owned() }),
            },
        }
    }
}

impl fmt::Display for Spin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Spin::Off => f.pad("off"),
            Spin::Auto => f.pad("auto"),
            Spin::For(ns) => write!(f, "{}", short(&(*ns as f64 / 1e3))),
        }
    }
}

/// Errors of a spin time.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SpinError {
    /// The text is no spin time.
    #[error("`{got}` is not a setting of spinning: expected auto, off, or a number of microseconds above 0")]
    Text {
        /// Text that is no setting of spinning.
        got: String,
    },
    /// The spin time would take too much of the core.
    #[error(
        "spinning for {} µs before each deadline: at {} Hz at most {} µs are possible, a quarter of the period, so \
         that other threads get the core; give a shorter time, or auto",
        short(.got_us), short(.rate_hz), short(.most_us)
    )]
    TooLong {
        /// The time asked for, µs.
        got_us: f64,
        /// The most that is possible, µs.
        most_us: f64,
        /// Sample rate of the loop, Hz.
        rate_hz: f64,
    },
    /// The sleeps could not be measured.
    #[error(transparent)]
    Histogram(#[from] HistogramError),
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    /// Sleeps are late by 40 µs, each sixtieth by `seldom_ns`.
    struct LateClock {
        now_ns: Cell<u64>,
        sleeps: Cell<u64>,
        seldom_ns: u64,
    }

    impl Clock for LateClock {
        fn now_ns(&self) -> u64 {
            self.now_ns.get()
        }

        fn sleep_until_ns(&self, deadline_ns: u64) {
            self.sleeps.set(self.sleeps.get() + 1);
            // Five of the 300 sleeps are so late, more than one in a hundred, so that the percentile of 99 % is one
            // of them.
            let late_ns = if self.sleeps.get().is_multiple_of(60) { self.seldom_ns } else { 40_000 };
            self.now_ns.set(deadline_ns + late_ns);
        }
    }

    fn choose(spin: Spin, rate_hz: f64, seldom_ns: u64) -> Result<Option<SpinChoice>, SpinError> {
        let clock = LateClock { now_ns: Cell::new(0), sleeps: Cell::new(0), seldom_ns };
        spin.choose(&clock, SampleRate::new(rate_hz).unwrap())
    }

    #[test]
    fn the_lateness_of_most_sleeps_is_spun_for_if_that_is_a_quarter_of_the_period_at_most() {
        let choice = |rate_hz, seldom_ns| choose(Spin::Auto, rate_hz, seldom_ns).unwrap().unwrap().to_string();
        insta::assert_snapshot!(choice(1000.0, 41_000), @"for 41.0 µs before each deadline: of 300 sleeps 99 % were late by up to that");
        insta::assert_snapshot!(choice(1000.0, 300_000), @"off: of 300 sleeps 99 % were late by up to 300.0 µs, more than a quarter of the period");
        insta::assert_snapshot!(choice(10_000.0, 41_000), @"off: of 300 sleeps 99 % were late by up to 41.0 µs, more than a quarter of the period");
        assert_eq!(choose(Spin::Auto, 10_000.0, 41_000).unwrap().unwrap().spin_ns(), 0);
    }

    #[test]
    fn a_time_that_is_given_is_not_measured_and_is_bounded() {
        assert_eq!(choose(Spin::Off, 1000.0, 0).unwrap(), None);
        let choice = choose(Spin::For(250_000), 1000.0, 0).unwrap().unwrap();
        assert_eq!((choice.spin_ns(), choice.slept_p99_us), (250_000, None));
        // Nanoseconds are thousandths, the last digits of a time in microseconds.
        assert_eq!(choose(Spin::For(232_063), 1000.0, 0).unwrap().unwrap().spin_us, 232.063);
        insta::assert_snapshot!(choice, @"for 250.0 µs before each deadline, as asked for");
        insta::assert_snapshot!(choose(Spin::For(251_000), 1000.0, 0).unwrap_err(), @"spinning for 251 µs before each deadline: at 1000 Hz at most 250 µs are possible, a quarter of the period, so that other threads get the core; give a shorter time, or auto");
    }

    #[test]
    fn it_is_read_and_written_as_text() {
        for (text, spin) in [("off", Spin::Off), ("auto", Spin::Auto), ("12.5", Spin::For(12_500))] {
            assert_eq!((text.parse(), spin.to_string().as_str()), (Ok(spin), text));
        }
        for wrong in ["0", "-1", "NaN", "inf", "1e300", "on"] {
            assert!(wrong.parse::<Spin>().is_err(), "{wrong}");
        }
        insta::assert_snapshot!("on".parse::<Spin>().unwrap_err(), @"`on` is not a setting of spinning: expected auto, off, or a number of microseconds above 0");
    }
}
