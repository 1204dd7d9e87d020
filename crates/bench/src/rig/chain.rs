//! Signal chain of an instrument with up to three axes, each from the true value to the reading.
//!
//! gravity → transverse → gain → sensor's noise → sensor's range → high-pass → low-pass → delay → converter (rounding,
//! range).
//!
//! Faults that add to the signal act before the converter; faults that replace a reading act after it.
//!
//! The chain works on the samples. Before sample 0 the instrument has always been at rest.
//!
//! Gravity comes first because an accelerometer can't distinguish it from acceleration: an axis also reads its
//! transverse share of the other axis's gravity.

use alloc::vec;
use alloc::vec::Vec;

use super::fault::Fault;
use super::filter::Section;
use super::reading::{MOST_AXES, Reading};
use super::sensor::SensorSpec;
use crate::structure::channel::Axis;
use resonarm_numeric::noise::Noise;

/// An instrument of one to three axes.
#[derive(Clone, Debug)]
pub(super) struct Instrument {
    /// Reading of gravity along each axis, m/s².
    gravity: Option<[f64; MOST_AXES]>,
    transverse: Option<f64>,
    axes: Vec<AxisChain>,
    faults: Vec<Fault>,
    /// Reading of the last sample.
    last: [Reading; MOST_AXES],
}

impl Instrument {
    /// Returns a valid instrument with these axes at `rate_hz` samples per second. Its noise comes from the
    /// streams of `seed` from `stream` on, one for each axis.
    pub fn new(spec: &SensorSpec, along: &[Axis], rate_hz: f64, seed: u64, stream: u64) -> Instrument {
        let of_gravity =
            |gravity: f64| core::array::from_fn(|place| if along.get(place) == Some(&Axis::Y) { gravity } else { 0.0 });
        let gravity = spec.gravity_m_s2.map(of_gravity);
        let transverse = spec.transverse;
        let rest = seen([0.0; MOST_AXES], along.len(), gravity.as_ref(), transverse);
        let chain = |(stream, rest): (u64, f64)| AxisChain::new(spec, rate_hz, Noise::new(seed, stream), rest);
        let axes: Vec<AxisChain> = (stream..).zip(rest).take(along.len()).map(chain).collect();
        let last = core::array::from_fn(|place| axes.get(place).map_or(Reading::default(), AxisChain::at_rest));
        Instrument { gravity, transverse, axes, faults: Vec::new(), last }
    }

    /// Returns the instrument with these faults.
    pub fn with_faults(self, faults: Vec<Fault>) -> Instrument {
        Instrument { faults, ..self }
    }

    /// Returns the state of all axes, and the last reading as value and mark.
    pub fn gathered(&mut self) -> impl Iterator<Item = f64> {
        let last = self.last.into_iter().take(self.axes.len());
        let last = last.flat_map(|reading| [reading.value, f64::from(u8::from(reading.clipped))]);
        self.axes.iter_mut().flat_map(AxisChain::gathered).map(|number| *number).chain(last)
    }

    /// Continues at a sample with the numbers of [`Instrument::gathered`]. Returns whether there were enough of
    /// them.
    pub fn restore(&mut self, sample: u64, numbers: &mut impl Iterator<Item = f64>) -> bool {
        for axis in &mut self.axes {
            axis.noise.seek(sample);
            for to in axis.gathered() {
                let Some(number) = numbers.next() else { return false };
                *to = number;
            }
        }
        for last in self.last.iter_mut().take(self.axes.len()) {
            let (Some(value), Some(clipped)) = (numbers.next(), numbers.next()) else { return false };
            *last = Reading { value, clipped: clipped != 0.0 };
        }
        self.faults.iter_mut().for_each(|fault| fault.seek(sample));
        true
    }

    /// Returns the reading at sample `sample` of `truth`, one number for each axis.
    pub fn read(&mut self, sample: u64, truth: [f64; MOST_AXES]) -> [Reading; MOST_AXES] {
        let seen = seen(truth, self.axes.len(), self.gravity.as_ref(), self.transverse);
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let value = axis.conditioned(seen[index]);
            // Drift, noise and spikes pass the converter and are rounded and clipped like a signal.
            let value = self.faults.iter_mut().fold(value, |value, fault| fault.disturbed(sample, index, value));
            let reading = axis.quantizer.read(value);
            let last = self.last[index];
            self.last[index] =
                // Stuck and dropped-out axes replace what the converter has put out.
                self.faults.iter().fold(reading, |reading, fault| fault.replaced(sample, index, reading, last));
        }
        self.last
    }

    /// Returns the number of axes.
    pub fn axes(&self) -> usize {
        self.axes.len()
    }
}

/// Returns the inputs of `count` axes. Gravity g along −y reads as an acceleration g along y, and t is the
/// share of the other axes: with two axes x + t y and y + t x.
fn seen(
    truth: [f64; MOST_AXES],
    count: usize,
    gravity: Option<&[f64; MOST_AXES]>,
    transverse: Option<f64>,
) -> [f64; MOST_AXES] {
    let mut heavy = truth;
    if let Some(gravity) = gravity {
        heavy.iter_mut().zip(gravity).filter(|(_, g)| **g != 0.0).for_each(|(axis, g)| *axis += g);
    }
    let Some(share) = transverse else { return heavy };
    core::array::from_fn(|place| {
        let others = heavy.iter().take(count).enumerate().filter(|(other, _)| *other != place);
        others
            .map(|(_, other)| *other)
            .reduce(|sum, other| sum + other)
            .map_or(heavy[place], |sum| heavy[place] + share * sum)
    })
}

/// Signal chain of one axis, with the state of its filters.
#[derive(Clone, Debug)]
struct AxisChain {
    gain: f64,
    noise_rms: f64,
    noise: Noise,
    sensor_range: f64,
    highpass: Option<Section>,
    lowpass: Option<Section>,
    /// Ring buffer of the delayed values; the next one leaves at `oldest`.
    delayed: Vec<f64>,
    oldest: usize,
    /// Input of the converter at rest.
    rest: f64,
    quantizer: Quantizer,
}

impl AxisChain {
    /// Returns an axis that has settled on `rest`.
    fn new(spec: &SensorSpec, rate_hz: f64, noise: Noise, rest: f64) -> AxisChain {
        let gain = spec.gain.unwrap_or(1.0);
        let sensor_range = spec.sensor_range.unwrap_or(f64::INFINITY);
        let mut highpass = spec.highpass_hz.map(|corner_hz| Section::highpass(corner_hz, rate_hz));
        let mut lowpass = spec.lowpass_hz.map(|corner_hz| Section::lowpass(corner_hz, rate_hz));
        // Every stage is settled on the output of the stage before it, so that a run begins without a
        // transient.
        let rest = (gain * rest).clamp(-sensor_range, sensor_range);
        let rest = highpass.as_mut().map_or(rest, |highpass| highpass.settle(rest));
        let rest = lowpass.as_mut().map_or(rest, |lowpass| lowpass.settle(rest));
        AxisChain {
            gain,
            noise_rms: spec.sensor_noise(rate_hz),
            noise,
            sensor_range,
            highpass,
            lowpass,
            delayed: vec![rest; spec.delay_samples.unwrap_or(0) as usize],
            oldest: 0,
            rest,
            quantizer: Quantizer::new(spec.range, spec.count()),
        }
    }

    /// Returns the state of filters and delay, the oldest delayed value first.
    fn gathered(&mut self) -> impl Iterator<Item = &mut f64> {
        self.delayed.rotate_left(self.oldest);
        self.oldest = 0;
        let sections = self.highpass.iter_mut().chain(&mut self.lowpass);
        sections.flat_map(|section| section.gathered()).chain(&mut self.delayed)
    }

    fn at_rest(&self) -> Reading {
        self.quantizer.read(self.rest)
    }

    /// Returns the input of the converter.
    fn conditioned(&mut self, seen: f64) -> f64 {
        let noisy = self.gain * seen + self.noise_rms * self.noise.normal();
        // The sensor itself saturates before the filters, which then pass the flattened signal: such readings
        // are not marked.
        let sensed = noisy.clamp(-self.sensor_range, self.sensor_range);
        let high = self.highpass.as_mut().map_or(sensed, |highpass| highpass.next(sensed));
        let low = self.lowpass.as_mut().map_or(high, |lowpass| lowpass.next(high));
        self.delay(low)
    }

    fn delay(&mut self, newest: f64) -> f64 {
        // Without a delay the ring is empty.
        let Some(slot) = self.delayed.get_mut(self.oldest) else { return newest };
        let oldest = core::mem::replace(slot, newest);
        self.oldest = (self.oldest + 1) % self.delayed.len();
        oldest
    }
}

/// Converter of a value, which rounds to the closest count and clips to the last count within the range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantizer {
    /// Last count within the range.
    largest: f64,
    resolution: f64,
}

impl Quantizer {
    pub fn new(range: f64, resolution: f64) -> Quantizer {
        Quantizer { largest: largest(range, resolution), resolution }
    }

    pub fn read(&self, value: f64) -> Reading {
        let counted = if self.resolution > 0.0 { libm::rint(value / self.resolution) * self.resolution } else { value };
        let clipped = counted.abs() > self.largest;
        Reading { value: counted.clamp(-self.largest, self.largest), clipped }
    }
}

/// Returns the largest magnitude that a converter reads, the last whole count within the range. A range that is
/// a whole number of counts up to rounding counts as one.
fn largest(range: f64, resolution: f64) -> f64 {
    const ROUNDING: f64 = 1e-9;
    if resolution == 0.0 { range } else { libm::floor(range / resolution * (1.0 + ROUNDING)) * resolution }
}
