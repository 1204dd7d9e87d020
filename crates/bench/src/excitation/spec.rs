//! Excitations as a scenario states them.

use serde::{Deserialize, Serialize};

use super::error::{ExcitationError, check_amplitude, not_negative, positive};
use super::waveform::Waveform;
use crate::rig::Load;

/// An excitation: a waveform, its amplitude, and the length of its ramps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationSpec {
    /// Peak load, also of noise and files: no sample is larger. It has forces of the exciter or torques at the joints, not
    /// both, since one command carries one kind.
    pub amplitude: Load,
    /// Length of the raised-cosine ramps, s, not negative. With bursts each burst has them; an impulse has none. A
    /// sudden start rings the arm's modes, which take about a minute to die out.
    #[serde(default)]
    pub ramp_s: f64,
    /// Shape of the excitation in time.
    pub profile: Waveform,
}

impl ExcitationSpec {
    /// Checks the numbers; `rate_hz` is the sample rate at which the excitation will be played.
    pub(super) fn check(&self, rate_hz: f64) -> Result<(), ExcitationError> {
        positive("rate_hz", rate_hz)?;
        not_negative("ramp_s", self.ramp_s)?;
        check_amplitude(&self.amplitude)?;
        let highest_hz = self.profile.check()?;
        // At half the sample rate itself the samples of a sine may all be zero.
        if highest_hz >= 0.5 * rate_hz {
            return Err(ExcitationError::AboveNyquist { frequency_hz: highest_hz, rate_hz });
        }
        Ok(())
    }
}
