//! Open loop: a profile is played regardless of the response.

use super::response::{ResponsePoint, ResponseReader};
use super::{Answer, Controller, Length, LoadKind};
use crate::excitation::Profile;
use crate::rig::{Converter, Measurement, Sampling};

/// Plays a profile and reads the responses in its windows.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    profile: Profile,
    sampling: Sampling,
    reader: ResponseReader,
    response: Option<ResponsePoint>,
}

impl OpenLoop {
    /// Returns a controller that plays `profile`, with readings by this converter.
    pub fn new(profile: Profile, converter: Converter) -> OpenLoop {
        let sampling = Sampling { rate_hz: profile.rate_hz(), converter };
        OpenLoop { reader: ResponseReader::new(&profile, sampling), profile, sampling, response: None }
    }
}

impl Controller for OpenLoop {
    fn load_kind(&self) -> LoadKind {
        if self.profile.spec().amplitude.has_torque() { LoadKind::Torque } else { LoadKind::Force }
    }

    fn restart(&mut self) {
        self.reader = ResponseReader::new(&self.profile, self.sampling);
        self.response = None;
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let n = sample.sample;
        // The fit needs the phase of the acting load at the time of the reading. A held sine lags by half a
        // sample, and the converter's filter delays the reading.
        let read_at = n as f64 - self.sampling.converter.delay_samples() - 0.5;
        if let Some(point) = self.reader.add(sample, self.profile.phase_cycles(read_at)) {
            self.response = Some(ResponsePoint { load_kind: self.load_kind(), ..point });
        }
        // The response of the last window is read at the latest with the sample that ends the profile.
        if n >= self.profile.samples() { Answer::Finished } else { Answer::Hold(self.profile.load(n)) }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        self.response.take()
    }

    fn length(&self) -> Length {
        Length::Samples(self.profile.samples())
    }
}
