//! Bus load of Resonarm's own protocol at the bit rate that a scenario states.

use super::Scenario;
use crate::error::ScenarioError;
use crate::network::NetworkSection;
use resonarm_bus::timed;
use resonarm_protocol::bits::{BitRates, Bits, Stuffing};
use resonarm_protocol::load::{Stream, bits_per_second, share, streams};

/// Bit rates of the arbitration phase, Hz: the range of high-speed transceivers (ISO 11898-2).
const BIT_RATE_HZ: core::ops::RangeInclusive<u32> = 10_000..=1_000_000;
/// Largest bit rate of the data phase of a CAN FD frame, Hz.
const DATA_BIT_RATE_MAX_HZ: u32 = 8_000_000;
/// Largest bit error rate: at one wrong bit in a hundred, two of three frames are destroyed.
const BIT_ERROR_RATE_MAX: f64 = 0.01;

impl Scenario {
    /// Returns the bus on which frames take their time, if the scenario states its bit rate.
    ///
    /// # Errors
    /// [`ScenarioError::Value`] if a rate is impossible, [`ScenarioError::Rate`] as [`Scenario::wire_rate_hz`], and
    /// [`ScenarioError::Overload`] if it can't carry what is sent at the sample rate.
    pub fn timed_bus(&self) -> Result<Option<timed::Spec>, ScenarioError> {
        let Some(spec) = self.bus_of_bit_rate()? else { return Ok(None) };
        let samples = self.network.samples_per_frame()?;
        let sent = |rate_hz| streams(self.network.profile, rate_hz, samples);
        // The messages of a user protocol are counted with their mapping, in `wire::load`.
        if self.wire.is_none() {
            check(sent, self.wire_rate_hz()?, spec.rates)?;
        }
        Ok(Some(spec))
    }

    /// Returns the bus at the stated bit rates, if any, without checking its load.
    pub(super) fn bus_of_bit_rate(&self) -> Result<Option<timed::Spec>, ScenarioError> {
        let rates = bit_rates(&self.network)?;
        let bit_error_rate = bit_error_rate(&self.network)?;
        let seed = self.simulation.seed;
        Ok(rates.map(|rates| timed::Spec { bit_error_rate, seed, ..timed::Spec::new(rates) }))
    }
}

/// Returns the bit rates, if the scenario states them.
fn bit_rates(network: &NetworkSection) -> Result<Option<BitRates>, ScenarioError> {
    let refused = |name, got: u32, expected| Err(ScenarioError::value(name, got, expected));
    match (network.bit_rate_hz, network.data_bit_rate_hz) {
        (None, None) => Ok(None),
        (Some(got), _) if !BIT_RATE_HZ.contains(&got) => refused(
            "network.bit_rate_hz",
            got,
            "from 10000 to 1000000 Hz; `data_bit_rate_hz` is that of FD frames' data",
        ),
        (None, Some(got)) => refused(
            "network.data_bit_rate_hz",
            got,
            "left out, or stated with `network.bit_rate_hz`, the rate of arbitration",
        ),
        (Some(nominal_hz), Some(got)) if !(nominal_hz..=DATA_BIT_RATE_MAX_HZ).contains(&got) => {
            refused("network.data_bit_rate_hz", got, "from `network.bit_rate_hz` to 8000000 Hz")
        }
        (Some(nominal_hz), data_hz) => Ok(Some(BitRates { nominal_hz, data_hz: data_hz.unwrap_or(nominal_hz) })),
    }
}

/// Returns the probability that a bit arrives inverted.
fn bit_error_rate(network: &NetworkSection) -> Result<f64, ScenarioError> {
    let name = "network.bit_error_rate";
    match (network.bit_error_rate, network.bit_rate_hz) {
        (None, _) => Ok(0.0),
        (Some(got), None) => {
            let expected = "left out, or stated with `network.bit_rate_hz`: without it frames have no bits";
            Err(ScenarioError::value(name, got, expected))
        }
        (Some(got), Some(_)) if !(0.0..=BIT_ERROR_RATE_MAX).contains(&got) => {
            Err(ScenarioError::value(name, got, "a probability from 0 to 0.01"))
        }
        (Some(got), Some(_)) => Ok(got),
    }
}

/// Rejects a sample rate whose frames do not fit the bus with the largest possible number of stuff bits: how
/// many there are depends on the readings, and a bus that carries the worst case carries every sample. `sent`
/// returns the messages sent at a sample rate.
///
/// The load is a + b · rate, with a of heartbeats and hellos: so the rate that fits is (1 − a)/b.
fn check<S: Iterator<Item = Stream>>(
    sent: impl Fn(u16) -> S,
    rate_hz: u16,
    rates: BitRates,
) -> Result<(), ScenarioError> {
    let per_second = |rate_hz| bits_per_second(sent(rate_hz), Stuffing::Worst);
    let load = |bits: Bits| share(bits, rates);
    let bits = per_second(rate_hz);
    if load(bits) <= 1.0 {
        return Ok(());
    }
    // What is sent at any rate, such as heartbeats and hellos.
    let rest = load(per_second(0));
    let most_hz = libm::floor((1.0 - rest) / (load(bits) - rest) * f64::from(rate_hz)).max(0.0);
    Err(ScenarioError::Overload {
        rate_hz,
        bits_per_second: bits.total(),
        rates,
        percent: 100.0 * load(bits),
        most_hz,
        enough: enough(bits, rates),
    })
}

/// Returns the one bit rate that, raised alone, would suffice, if one within its range does: that of the data
/// phase next to what arbitration leaves, else that of arbitration.
fn enough(per_second: Bits, rates: BitRates) -> Option<(&'static str, f64)> {
    let nominal = per_second.nominal as f64;
    let data = per_second.data as f64;
    // Both phases share the time of one second: data/r_data + nominal/r_nominal ≤ 1, solved for the rate of one
    // phase with the other fixed.
    let beside = |bits: f64, other: f64, other_hz: u32| {
        let left = 1.0 - other / f64::from(other_hz);
        if left > 0.0 { libm::ceil(bits / left) } else { f64::INFINITY }
    };
    let data_hz = beside(data, nominal, rates.nominal_hz);
    if data > 0.0 && data_hz <= f64::from(DATA_BIT_RATE_MAX_HZ) {
        return Some(("network.data_bit_rate_hz", data_hz));
    }
    let nominal_hz = beside(nominal, data, rates.data_hz);
    // A data phase slower than arbitration does not exist, so the nominal rate can't rise above the data rate.
    let most_hz = f64::from(if data > 0.0 { rates.data_hz } else { *BIT_RATE_HZ.end() }.min(*BIT_RATE_HZ.end()));
    (nominal_hz <= most_hz).then_some(("network.bit_rate_hz", nominal_hz))
}
