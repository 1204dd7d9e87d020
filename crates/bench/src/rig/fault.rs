//! Faults of instruments at stated times.
//!
//! Drift, noise and spike are added between delay and converter, and gain and distortion act there, before the converter rounds
//! and clips; a stuck or dropped-out axis replaces the converter's output. Several faults of an axis act in the order of the
//! specification.

use alloc::boxed::Box;

use serde::{Deserialize, Serialize};

use super::error::RigError;
use super::name::InstrumentName;
use super::reading::{MOST_AXES, Reading};
use super::sensor::Measured;
use crate::structure::channel::Axis;
use resonarm_numeric::noise::Noise;

/// Largest number of faults of a rig.
pub const MOST_FAULTS: usize = 64;

/// First stream of the faults' noise; the streams before it belong to the instruments.
const FIRST_STREAM: u64 = 1 << 32;
/// First stream of the noise of third axes.
const FIRST_THIRD_STREAM: u64 = 1 << 33;

/// Axes of an instrument that have a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultAxis {
    /// The axis x of the base frame.
    X,
    /// The axis y of the base frame.
    Y,
    /// The axis z of the base frame.
    Z,
    /// All axes that the instrument has, two or three.
    #[default]
    All,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// The axis repeats its reading from the sample before the fault.
    Stuck,
    /// The axis reads zero.
    Dropout,
    /// An offset is added that grows linearly from zero.
    Drift,
    /// White Gaussian noise, as of a cable, is added.
    Noise,
    /// A constant is added, for one sample unless the fault has an end.
    Spike,
    /// The axis reads its value times a factor: a wrong sensitivity, or with a negative factor a reversed sensor.
    Gain,
    /// The axis reads x + x²/a, with an amplitude a: the reading of a sine of amplitude A has a second harmonic of A²/2a and an
    /// offset of the same size.
    Distortion,
}

/// A fault as a scenario states it. A drift has a rate, noise its standard deviation, spike and distortion their amplitude, each in
/// the key of the instrument's unit, a gain its factor; stuck axes and dropouts have none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultSpec {
    /// Instrument with the fault: a sensor, or the head.
    pub instrument: InstrumentName,
    /// Axes of the instrument that have the fault.
    #[serde(default)]
    pub axis: FaultAxis,
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Beginning, s of simulated time from sample 0, not negative: the first sample is ⌈`from_s` · rate⌉.
    pub from_s: f64,
    /// End, s, at least a sample later: the fault is over from sample ⌈`to_s` · rate⌉ on. `None` lasts to the end of
    /// the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// Rate of a drift, (m/s²)/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_m_s2_per_s: Option<f64>,
    /// Rate of a drift, N/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_n_per_s: Option<f64>,
    /// Rate of a drift, (m/s)/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_m_s_per_s: Option<f64>,
    /// Rate of a drift, m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_m_per_s: Option<f64>,
    /// Rate of a drift, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_rad_per_s: Option<f64>,
    /// Standard deviation of noise, m/s², not negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_m_s2: Option<f64>,
    /// Standard deviation of noise, N, not negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_n: Option<f64>,
    /// Standard deviation of noise, m/s, not negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_m_s: Option<f64>,
    /// Standard deviation of noise, m, not negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
    /// Standard deviation of noise, rad, not negative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_rad: Option<f64>,
    /// Amplitude of a spike or a distortion, m/s².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude_m_s2: Option<f64>,
    /// Amplitude of a spike or a distortion, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude_n: Option<f64>,
    /// Amplitude of a spike or a distortion, m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude_m_s: Option<f64>,
    /// Amplitude of a spike or a distortion, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude_m: Option<f64>,
    /// Amplitude of a spike or a distortion, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude_rad: Option<f64>,
    /// Factor of a gain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factor: Option<f64>,
}

impl FaultSpec {
    /// Returns a fault of all axes of an instrument that lasts to the end of the run, without an amount.
    pub const fn new(instrument: InstrumentName, kind: FaultKind, from_s: f64) -> FaultSpec {
        FaultSpec {
            instrument,
            axis: FaultAxis::All,
            kind,
            from_s,
            to_s: None,
            rate_m_s2_per_s: None,
            rate_n_per_s: None,
            rate_m_s_per_s: None,
            rate_m_per_s: None,
            rate_rad_per_s: None,
            rms_m_s2: None,
            rms_n: None,
            rms_m_s: None,
            rms_m: None,
            rms_rad: None,
            amplitude_m_s2: None,
            amplitude_n: None,
            amplitude_m_s: None,
            amplitude_m: None,
            amplitude_rad: None,
            factor: None,
        }
    }

    /// Returns the key of the amount, if the kind has one, in the unit of what the instrument measures.
    fn key(&self, measures: Measured) -> Option<&'static str> {
        let [rate, rms, amplitude] = match measures {
            Measured::Acceleration => ["rate_m_s2_per_s", "rms_m_s2", "amplitude_m_s2"],
            Measured::Force => ["rate_n_per_s", "rms_n", "amplitude_n"],
            Measured::Velocity => ["rate_m_s_per_s", "rms_m_s", "amplitude_m_s"],
            Measured::Displacement => ["rate_m_per_s", "rms_m", "amplitude_m"],
            Measured::Angle => ["rate_rad_per_s", "rms_rad", "amplitude_rad"],
        };
        match self.kind {
            FaultKind::Stuck | FaultKind::Dropout => None,
            FaultKind::Drift => Some(rate),
            FaultKind::Noise => Some(rms),
            FaultKind::Spike | FaultKind::Distortion => Some(amplitude),
            FaultKind::Gain => Some("factor"),
        }
    }

    /// Returns the amount, if the kind has one.
    fn size(&self, measures: Measured, number: usize) -> Result<f64, RigError> {
        let stated = [
            ("rate_m_s2_per_s", self.rate_m_s2_per_s),
            ("rate_n_per_s", self.rate_n_per_s),
            ("rate_m_s_per_s", self.rate_m_s_per_s),
            ("rate_m_per_s", self.rate_m_per_s),
            ("rate_rad_per_s", self.rate_rad_per_s),
            ("rms_m_s2", self.rms_m_s2),
            ("rms_n", self.rms_n),
            ("rms_m_s", self.rms_m_s),
            ("rms_m", self.rms_m),
            ("rms_rad", self.rms_rad),
            ("amplitude_m_s2", self.amplitude_m_s2),
            ("amplitude_n", self.amplitude_n),
            ("amplitude_m_s", self.amplitude_m_s),
            ("amplitude_m", self.amplitude_m),
            ("amplitude_rad", self.amplitude_rad),
            ("factor", self.factor),
        ];
        let wanted = self.key(measures);
        let mut size = None;
        for (key, value) in stated {
            match value {
                Some(got) if wanted == Some(key) => size = Some((key, got)),
                Some(_) => return Err(RigError::FaultKeyIdle { number, key }),
                None => {}
            }
        }
        match (wanted, size) {
            (None, _) => Ok(0.0),
            (Some(key), None) => Err(RigError::FaultKeyMissing { number, key }),
            (Some(_), Some((name, got))) => {
                let (is_valid, expected) = match self.kind {
                    FaultKind::Noise => (got >= 0.0, "zero or a positive number"),
                    FaultKind::Distortion => (got > 0.0, "a positive number"),
                    _ => (true, "a number"),
                };
                let error = RigError::Fault { number, name, got, expected };
                if got.is_finite() && is_valid { Ok(got) } else { Err(error) }
            }
        }
    }
}

/// A fault of one instrument, ready to act.
#[derive(Clone, Debug)]
pub(super) struct Fault {
    /// Axes of the instrument that have it.
    axes: [bool; MOST_AXES],
    /// First sample with the fault; the next field is the first sample after it.
    first: u64,
    end: u64,
    effect: Effect,
}

#[derive(Clone, Debug)]
enum Effect {
    Stuck,
    Dropout,
    /// Share of the drift per sample.
    Drift(f64),
    /// Standard deviation, and a noise stream for each axis.
    Noise(f64, Box<[Noise; MOST_AXES]>),
    Spike(f64),
    Gain(f64),
    Distortion(f64),
}

impl Fault {
    /// Returns the fault at `index` among those of the rig, of an instrument that measures this along these
    /// axes.
    pub fn new(
        spec: &FaultSpec,
        (measures, along): (Measured, &[Axis]),
        index: usize,
        (rate_hz, seed): (f64, u64),
    ) -> Result<Fault, RigError> {
        let number = index + 1;
        if !(spec.from_s.is_finite() && spec.from_s >= 0.0) {
            let name = "from_s";
            let expected = "zero or a positive number";
            return Err(RigError::Fault { number, name, got: spec.from_s, expected });
        }
        let size = spec.size(measures, number)?;
        let first = sample_at(spec.from_s, rate_hz);
        let end = match (spec.to_s, spec.kind) {
            (Some(got), _) if got.is_nan() || sample_at(got, rate_hz) <= first => {
                let expected = "at least a sample later than `from_s`";
                return Err(RigError::Fault { number, name: "to_s", got, expected });
            }
            (Some(to_s), _) => sample_at(to_s, rate_hz),
            (None, FaultKind::Spike) => first.saturating_add(1),
            (None, _) => u64::MAX,
        };
        let stream = FIRST_STREAM + 2 * index as u64;
        let effect = match spec.kind {
            FaultKind::Stuck => Effect::Stuck,
            FaultKind::Dropout => Effect::Dropout,
            FaultKind::Drift => Effect::Drift(size / rate_hz),
            FaultKind::Noise => {
                // The streams of x and y of all faults are numbered without gaps. The stream of a third axis lies
                // apart and does not shift them.
                let streams = [stream, stream + 1, FIRST_THIRD_STREAM + index as u64];
                Effect::Noise(size, Box::new(streams.map(|stream| Noise::new(seed, stream))))
            }
            FaultKind::Spike => Effect::Spike(size),
            FaultKind::Gain => Effect::Gain(size),
            FaultKind::Distortion => Effect::Distortion(size),
        };
        let has = |axis: &Axis| match spec.axis {
            FaultAxis::X => *axis == Axis::X,
            FaultAxis::Y => *axis == Axis::Y,
            FaultAxis::Z => *axis == Axis::Z,
            FaultAxis::All => true,
        };
        if !along.iter().any(has) {
            return Err(RigError::FaultKeyIdle { number, key: "axis" });
        }
        let axes = core::array::from_fn(|place| along.get(place).is_some_and(has));
        Ok(Fault { axes, first, end, effect })
    }

    fn acts(&self, sample: u64, axis: usize) -> bool {
        self.axes[axis] && (self.first..self.end).contains(&sample)
    }

    /// Continues at a sample, as if the fault had acted on all samples before.
    pub fn seek(&mut self, sample: u64) {
        // The noise of a fault advances only while the fault acts, so its position is the number of such
        // samples.
        let before = sample.clamp(self.first, self.end) - self.first;
        if let Effect::Noise(_, noise) = &mut self.effect {
            noise.iter_mut().for_each(|noise| noise.seek(before));
        }
    }

    /// Returns the input of the converter with the fault.
    pub fn disturbed(&mut self, sample: u64, axis: usize, value: f64) -> f64 {
        if !self.acts(sample, axis) {
            return value;
        }
        match &mut self.effect {
            Effect::Stuck | Effect::Dropout => value,
            Effect::Drift(step) => value + *step * (sample - self.first) as f64,
            Effect::Noise(rms, noise) => value + *rms * noise[axis].normal(),
            Effect::Spike(amplitude) => value + *amplitude,
            Effect::Gain(factor) => value * *factor,
            Effect::Distortion(amplitude) => value + value * value / *amplitude,
        }
    }

    /// Returns the reading that replaces `reading`; `last` is that of the sample before.
    pub fn replaced(&self, sample: u64, axis: usize, reading: Reading, last: Reading) -> Reading {
        match self.effect {
            Effect::Stuck if self.acts(sample, axis) => last,
            Effect::Dropout if self.acts(sample, axis) => Reading::default(),
            _ => reading,
        }
    }
}

/// Returns the first sample at `time_s` or later. A time that is a whole number of samples up to rounding
/// counts as one: 2.007 s at 1 kHz is 2007.0000000000002 samples.
fn sample_at(time_s: f64, rate_hz: f64) -> u64 {
    const ROUNDING: f64 = 1e-12;
    libm::ceil(time_s * rate_hz * (1.0 - ROUNDING)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Measurement, Rig, RigSpec};
    use crate::structure::OUTPUTS;
    use alloc::format;
    use alloc::string::{String, ToString};
    use alloc::vec::Vec;

    const QUIET: &str = "sensors.b = { noise_rms_m_s2 = 0, resolution_m_s2 = 0, range_m_s2 = 100 }\n\
        head = { noise_rms_n = 0, resolution_n = 0 }\n";

    fn spec(faults: &str) -> RigSpec {
        toml::from_str(&format!("{QUIET}{faults}")).unwrap()
    }

    /// Readings at 10 Hz of an acceleration of 1, 2, 3 … m/s² along x of B, and twice that along y.
    fn readings(spec: &RigSpec, samples: u64) -> Vec<Measurement> {
        let mut rig = Rig::new(spec, &OUTPUTS, 10.0, 5).unwrap();
        let sampled = |sample: u64| {
            let x = sample as f64 + 1.0;
            [3.0, 4.0, x, 2.0 * x, 0.0, 0.0]
        };
        (0..samples).map(|sample| rig.measure(sample, &sampled(sample))).collect()
    }

    fn b(faults: &str, axis: usize) -> Vec<f64> {
        readings(&spec(faults), 8).iter().map(|sample| sample.acceleration_b_m_s2[axis].value).collect()
    }

    #[test]
    fn faults_act_on_their_axes_at_their_samples() {
        let fault = |rest: &str| format!("[[faults]]\ninstrument = 'b'\n{rest}");
        let stuck = fault("axis = 'x'\nkind = 'stuck'\nfrom_s = 0.25\nto_s = 0.6");
        assert_eq!(b(&stuck, 0), [1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 7.0, 8.0]);
        assert_eq!(b(&stuck, 1), b("", 1));
        let dropout = fault("kind = 'dropout'\nfrom_s = 0.5");
        assert_eq!(b(&dropout, 0), [1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0, 0.0]);
        assert_eq!(b(&dropout, 1), [2.0, 4.0, 6.0, 8.0, 10.0, 0.0, 0.0, 0.0]);
        let drift = fault("axis = 'y'\nkind = 'drift'\nrate_m_s2_per_s = -10\nfrom_s = 0.1\nto_s = 0.5");
        assert_eq!(b(&drift, 1), [2.0, 4.0, 5.0, 6.0, 7.0, 12.0, 14.0, 16.0]);
        let spike = fault("axis = 'x'\nkind = 'spike'\namplitude_m_s2 = 50\nfrom_s = 0.2");
        assert_eq!(b(&spike, 0), [1.0, 2.0, 53.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        let gain = fault("axis = 'x'\nkind = 'gain'\nfactor = -2\nfrom_s = 0.5\nto_s = 0.7");
        assert_eq!(b(&gain, 0), [1.0, 2.0, 3.0, 4.0, 5.0, -12.0, -14.0, 8.0]);
        assert_eq!(b(&gain, 1), b("", 1));
        let distorted = fault("axis = 'x'\nkind = 'distortion'\namplitude_m_s2 = 2\nfrom_s = 0.5\nto_s = 0.7");
        assert_eq!(b(&distorted, 0), [1.0, 2.0, 3.0, 4.0, 5.0, 24.0, 31.5, 8.0]);
        let both = format!("{spike}\n{}", fault("axis = 'x'\nkind = 'stuck'\nfrom_s = 0.3"));
        assert_eq!(b(&both, 0)[2..], [53.0; 6]);
    }

    #[test]
    fn an_axis_stuck_from_the_start_keeps_its_reading_at_rest() {
        let stuck = "[[faults]]\ninstrument = 'head'\nkind = 'stuck'\nfrom_s = 0";
        let readings = readings(&spec(stuck), 3);
        assert!(readings.iter().all(|sample| sample.head_force_n == [Reading::default(); 2]));
    }

    #[test]
    fn additions_are_rounded_and_clipped_by_the_converter() {
        let spike = "[[faults]]\ninstrument = 'b'\naxis = 'x'\nkind = 'spike'\namplitude_m_s2 = 1e4\n\
            from_s = 0.1\nto_s = 0.3";
        let clipped: Vec<_> = readings(&spec(spike), 4).iter().map(|sample| sample.acceleration_b_m_s2[0]).collect();
        let reading = |value, clipped| Reading { value, clipped };
        let beyond = reading(100.0, true);
        assert_eq!(clipped, [reading(1.0, false), beyond, beyond, reading(4.0, false)]);
    }

    #[test]
    fn noise_of_a_cable_is_seeded_and_leaves_the_others_as_they_were() {
        let noise = "[[faults]]\ninstrument = 'b'\nkind = 'noise'\nrms_m_s2 = 0.5\nfrom_s = 0.2\n\
            [sensors.c]\nnoise_rms_m_s2 = 3.0";
        let [noisy, again] = [(); 2].map(|()| readings(&spec(noise), 2000));
        assert_eq!(noisy, again);
        let clean = readings(&spec("[sensors.c]\nnoise_rms_m_s2 = 3.0"), 2000);
        let mut squares = [0.0; 2];
        for (noisy, clean) in noisy.iter().zip(&clean).take(90) {
            assert_eq!(noisy.acceleration_c_m_s2, clean.acceleration_c_m_s2);
            for (axis, squares) in squares.iter_mut().enumerate() {
                let added = noisy.acceleration_b_m_s2[axis].value - clean.acceleration_b_m_s2[axis].value;
                assert!(noisy.sample >= 2 || added == 0.0);
                *squares += if clean.acceleration_b_m_s2[axis].value < 90.0 { added * added } else { 0.0 };
            }
        }
        // Along x over 88 samples, along y over the 42 within the range; four standard errors of a variance, √(2/n).
        assert!((squares[0] / 87.0 / 0.25 - 1.0).abs() < 0.62, "{squares:?}");
        assert!((squares[1] / 42.0 / 0.25 - 1.0).abs() < 0.88, "{squares:?}");
    }

    #[test]
    fn times_are_rounded_up_to_samples_but_for_their_last_bits() {
        for (time_s, rate_hz, sample) in
            [(2.007, 1000.0, 2007), (0.0, 1e3, 0), (0.0001, 1e3, 1), (2.0001, 1e3, 2001), (0.3, 1000.0, 300)]
        {
            assert_eq!(sample_at(time_s, rate_hz), sample, "{time_s}");
        }
    }

    #[test]
    fn says_what_is_wrong_with_a_fault() {
        let says = |rest: &str| {
            let good = "[[faults]]\ninstrument = 'c'\nkind = 'stuck'\nfrom_s = 1\n";
            Rig::new(&spec(&format!("{good}[[faults]]\n{rest}")), &OUTPUTS, 1000.0, 0).unwrap_err().to_string()
        };
        let c = |rest: &str| says(&format!("instrument = 'c'\n{rest}"));
        insta::assert_snapshot!(c("kind = 'stuck'\nfrom_s = -1"), @"rig.faults, number 2: `from_s` is -1: it must be zero or a positive number");
        insta::assert_snapshot!(c("kind = 'stuck'\nfrom_s = 1\nto_s = 0.9999"), @"rig.faults, number 2: `to_s` is 0.9999: it must be at least a sample later than `from_s`");
        insta::assert_snapshot!(c("kind = 'drift'\nfrom_s = 1"), @"rig.faults, number 2: `rate_m_s2_per_s` is missing: add it, or change `kind`");
        insta::assert_snapshot!(c("kind = 'noise'\nfrom_s = 1\nrms_n = 2"), @"rig.faults, number 2: `rms_n` does not apply to this kind of fault of this instrument: leave it out");
        insta::assert_snapshot!(c("kind = 'noise'\nfrom_s = 1\nrms_m_s2 = -2"), @"rig.faults, number 2: `rms_m_s2` is -2: it must be zero or a positive number");
        insta::assert_snapshot!(c("kind = 'distortion'\nfrom_s = 1\namplitude_m_s2 = 0"), @"rig.faults, number 2: `amplitude_m_s2` is 0: it must be a positive number");
        insta::assert_snapshot!(says("instrument = 'head'\nkind = 'spike'\nfrom_s = 1\namplitude_n = nan"), @"rig.faults, number 2: `amplitude_n` is NaN: it must be a number");
        let many: String =
            (0..MOST_FAULTS).map(|_| "[[faults]]\ninstrument = 'head'\nkind = 'dropout'\nfrom_s = 1\n").collect();
        insta::assert_snapshot!(says(&many.replacen("[[faults]]", "", 1)), @"rig.faults are 65: at most 64 are taken");
    }
}
