//! The settings of the cases.

use super::times::MS;

/// The settings of the cases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The force commanded along x of a plant, N, and along −x.
    pub force_n: f64,
    /// The torque commanded at a joint of a plant whose own protocol has no forces, N·m, and its opposite.
    pub torque_nm: f64,
    /// A force that the plant must reject as too large, N, if this is to be tried.
    pub beyond_n: Option<f64>,
    /// A rate of change of the force that the plant must reject, N/s, if this is to be tried.
    pub beyond_n_per_s: Option<f64>,
    /// A force along x that drives the plant beyond its largest travel, N, if this is to be tried.
    pub beyond_travel_n: Option<f64>,
    /// Time to wait for a node under test, ns.
    pub patience_ns: u64,
    /// Seed of random numbers, which also selects the wrong bit of the first damaged frame.
    pub seed: u64,
    /// The bit rate of the bus, Hz, if it is to be loaded.
    pub bit_rate_hz: Option<u32>,
    /// Time for which good and bad frames are sent at random, ns; 0 means not at all.
    pub soak_ns: u64,
    /// The sine that an exciter is set to command, if known.
    pub sine: Option<ExpectedSine>,
}

/// A sine that an exciter is set to command, alone, after its own ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedSine {
    /// Frequency of the sine, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the sine.
    pub amplitude: SineAmplitude,
}

/// The quantity of the sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SineAmplitude {
    /// A force along x, N.
    ForceN(f64),
    /// A torque at joint 1, N·m.
    TorqueNm(f64),
}

impl Default for Settings {
    /// 5 N or 5 N·m, none too large, too fast or too far, 10 s, the first bit, no load, a soak of 5 s, no sine.
    fn default() -> Settings {
        Settings {
            force_n: 5.0,
            torque_nm: 5.0,
            beyond_n: None,
            beyond_n_per_s: None,
            beyond_travel_n: None,
            patience_ns: 10_000 * MS,
            seed: 0,
            bit_rate_hz: None,
            soak_ns: 5_000 * MS,
            sine: None,
        }
    }
}
