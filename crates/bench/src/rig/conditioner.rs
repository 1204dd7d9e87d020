//! Conditioner of an instrument, applied to readings that have passed another one.

use super::filter::Section;
use super::sensor::SensorSpec;

/// Filters and delay of an instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditioner {
    rate_hz: f64,
    highpass_hz: Option<f64>,
    lowpass_hz: Option<f64>,
    delay_samples: usize,
}

impl SensorSpec {
    /// Returns the filters and the delay of the instrument at `rate_hz` samples per second.
    pub(crate) fn conditioner(&self, rate_hz: f64) -> Conditioner {
        Conditioner {
            rate_hz,
            highpass_hz: self.highpass_hz,
            lowpass_hz: self.lowpass_hz,
            delay_samples: self.delay_samples.unwrap_or(0) as usize,
        }
    }
}

impl Conditioner {
    /// Returns whether it changes no amplitude.
    pub(crate) fn has_no_filter(&self) -> bool {
        self.highpass_hz.is_none() && self.lowpass_hz.is_none()
    }

    /// Passes values through the conditioner, which has settled on the first one.
    pub(crate) fn apply(&self, values: &mut [f64]) {
        let Some(&first) = values.first() else { return };
        let filters = [
            self.highpass_hz.map(|corner_hz| Section::highpass(corner_hz, self.rate_hz)),
            self.lowpass_hz.map(|corner_hz| Section::lowpass(corner_hz, self.rate_hz)),
        ];
        let mut rest = first;
        for mut filter in filters.into_iter().flatten() {
            rest = filter.settle(rest);
            values.iter_mut().for_each(|value| *value = filter.next(*value));
        }
        let delay = self.delay_samples.min(values.len());
        values.rotate_right(delay);
        values[..delay].fill(rest);
    }
}
