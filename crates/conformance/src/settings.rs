//! What the cases are given.

use super::tester::MS;

/// What the cases are given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The force that is commanded along x of a plant, N; along it, −x too.
    pub force_n: f64,
    /// A force that the plant must refuse for its size, N, if one is to be tried.
    pub beyond_n: Option<f64>,
    /// A rate of change of the force that the plant must refuse, N/s, if one is to be tried.
    pub beyond_n_per_s: Option<f64>,
    /// A force along x that drives the plant beyond its largest travel, N, if it is to be tried.
    pub beyond_travel_n: Option<f64>,
    /// How long a node under test is waited for, ns.
    pub patience_ns: u64,
    /// Which bit of the first damaged frame is wrong, and the seed of what is drawn.
    pub seed: u64,
    /// The bit rate of the bus, Hz, if it is to be loaded.
    pub bit_rate_hz: Option<u32>,
    /// How long good and bad frames are drawn at random, ns; 0 is not at all.
    pub soak_ns: u64,
    /// What an exciter is set to command, if it is known.
    pub sine: Option<ExpectedSine>,
}

/// A sine that an exciter is set to command, after a ramp of its own, alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedSine {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Its amplitude.
    pub amplitude: SineAmplitude,
}

/// What the sine is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SineAmplitude {
    /// A force along x, N.
    ForceN(f64),
    /// A torque at joint 1, N·m.
    TorqueNm(f64),
}

impl Default for Settings {
    /// 5 N, none too large, too fast or too far, 10 s, the first bit, no load, a soak of 5 s, no sine.
    fn default() -> Settings {
        Settings {
            force_n: 5.0,
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
