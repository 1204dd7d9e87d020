//! Sines one after the other, each of whole periods, with raised-cosine ramps at both ends.

use core::convert::Infallible;
use core::f64::consts::{PI, TAU};

use resonarm_protocol::SensorValues;
use resonarm_protocol::node::{Answer, Answering};

/// Sample rate of the plant, Hz.
pub const RATE_HZ: u16 = 1000;
/// Amplitude of the command, N.
pub const AMPLITUDE_N: f64 = 150.0;
const FREQUENCIES_HZ: [f64; 2] = [19.7, 26.0];
/// Least length of a sine, rounded up to whole periods.
const DWELL_S: f64 = 0.4;
const RAMP_S: f64 = 0.2;

/// Controller that plays sines one after the other, open loop.
pub struct Sines {
    /// Times at which each sine begins, and the last ends.
    starts_s: [f64; FREQUENCIES_HZ.len() + 1],
}

impl Sines {
    /// Returns the controller at the beginning of its first sine.
    pub fn new() -> Sines {
        let mut starts_s = [0.0; FREQUENCIES_HZ.len() + 1];
        for (k, hz) in FREQUENCIES_HZ.into_iter().enumerate() {
            starts_s[k + 1] = starts_s[k] + libm::ceil(DWELL_S * hz) / hz;
        }
        Sines { starts_s }
    }
}

impl Answering for Sines {
    type Abort = Infallible;

    fn restart(&mut self) {}

    fn answer(&mut self, sample: u64, _values: &SensorValues) -> Answer<Infallible> {
        let [begin_s, change_s, end_s] = self.starts_s;
        let t_s = sample as f64 / f64::from(RATE_HZ);
        let left_s = end_s - t_s;
        if left_s <= 0.0 {
            return Answer::Finished;
        }
        let (start_s, hz) = if t_s < change_s { (begin_s, FREQUENCIES_HZ[0]) } else { (change_s, FREQUENCIES_HZ[1]) };
        // Raised cosine: (1 − cos(π t/r))/2.
        let ramp = (t_s.min(left_s) / RAMP_S).min(1.0);
        let shape = 0.5 * (1.0 - libm::cos(PI * ramp)) * libm::sin(TAU * hz * (t_s - start_s));
        Answer::HoldForce { force_x_n: AMPLITUDE_N * shape, force_y_n: 0.0 }
    }
}
