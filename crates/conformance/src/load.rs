//! Bus load: foreign frames, so many that all frames together take 70 % of the bus.

use resonarm_numeric::noise::Noise;
use resonarm_protocol::bits::{self, BitRates};
use resonarm_protocol::{Frame, FrameError, Id};

use super::times::MS;

/// The share of the bus that is filled.
pub(super) const SHARE: f64 = 0.7;

/// If the tester was held up, foreign frames more than this time behind are omitted, ns.
const MOST_BEHIND_NS: u64 = 2 * MS;

/// Interval of checking the load, ns.
const LOOK_NS: u64 = MS;

/// The number of the load's stream of random numbers.
const STREAM: u64 = 1;

/// The load of the bus, by the bits of the frames themselves.
#[derive(Debug)]
pub(super) struct BusLoad {
    rates: BitRates,
    noise: Noise,
    /// Time at which the load began, ns; later if frames were omitted.
    start_ns: u64,
    /// Time that the frames since then take, ns.
    busy_ns: u64,
    next_ns: u64,
}

impl BusLoad {
    pub fn new(bit_rate_hz: u32, seed: u64, now_ns: u64) -> BusLoad {
        let rates = BitRates::classical(bit_rate_hz);
        BusLoad { rates, noise: Noise::new(seed, STREAM), start_ns: now_ns, busy_ns: 0, next_ns: now_ns }
    }

    /// Counts a frame on the bus, from any sender.
    pub fn count(&mut self, frame: &Frame) {
        self.busy_ns += bits::of(frame).time_ns(self.rates);
    }

    /// Returns the time at which the load is checked next, ns.
    pub fn next_ns(&self) -> u64 {
        self.next_ns
    }

    /// The share of the bus in use.
    pub fn share(&self, now_ns: u64) -> f64 {
        self.busy_ns as f64 / now_ns.saturating_sub(self.start_ns).max(1) as f64
    }

    /// The foreign frame that is due, if one is.
    pub fn due(&mut self, now_ns: u64) -> Option<Result<Frame, FrameError>> {
        let allowed_ns = (now_ns - self.start_ns) as f64 * SHARE;
        let behind_ns = allowed_ns - self.busy_ns as f64;
        // A later start forgives what is further behind. To catch up on it would fill the bus with foreign frames
        // alone.
        if behind_ns > MOST_BEHIND_NS as f64 * SHARE {
            self.start_ns += (behind_ns / SHARE) as u64 - MOST_BEHIND_NS;
        }
        if behind_ns <= 0.0 {
            self.next_ns = now_ns + LOOK_NS;
            return None;
        }
        Some(foreign(&mut self.noise))
    }
}

/// A frame that neither SPEC.md nor CiA 301 uses: below or above all identifiers in use.
fn foreign(noise: &mut Noise) -> Result<Frame, FrameError> {
    let choice = noise.bits();
    let data = noise.bits().to_le_bytes();
    // Half of the frames win the arbitration against all of the network's, and half lose it.
    let id = if choice & 1 == 0 { 0x001 + (choice >> 1) % 0x7F } else { 0x7F0 + (choice >> 1) % 0x10 };
    Frame::classic(Id::Standard(id as u16), &data)
}
