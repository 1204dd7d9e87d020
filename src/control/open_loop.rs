//! Open loop: a profile is played, whatever the arm does.

use super::response::ResponseReader;
use super::{Answer, Controller, Length, LoadKind, ResponsePoint};
use crate::excitation::Profile;
use crate::rig::Measurement;

/// Plays a profile and reads the responses in its windows.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    profile: Profile,
    reader: ResponseReader,
    response: Option<ResponsePoint>,
}

impl OpenLoop {
    /// A controller that plays `profile`.
    pub fn new(profile: Profile) -> OpenLoop {
        OpenLoop { reader: ResponseReader::new(&profile), profile, response: None }
    }
}

impl Controller for OpenLoop {
    fn load_kind(&self) -> LoadKind {
        if self.profile.spec().amplitude.is_torque() { LoadKind::Torque } else { LoadKind::Force }
    }

    fn restart(&mut self) {
        self.reader = ResponseReader::new(&self.profile);
        self.response = None;
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let n = sample.sample;
        self.response = self.reader.add(sample, self.profile.phase_cycles(n));
        if n >= self.profile.samples() { Answer::Finished } else { Answer::Hold(self.profile.load(n)) }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        self.response.take()
    }

    fn length(&self) -> Length {
        Length::Samples(self.profile.samples())
    }
}
