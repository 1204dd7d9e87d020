//! What a controller is to lead to, set while it works.

/// A set-point of a controller that is steered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint {
    /// Amplitude of the load, N or N·m as that of the scenario, zero or positive.
    pub load: f64,
    /// Frequency, Hz, positive and below half the sample rate.
    pub frequency_hz: f64,
    /// Phase of the sine, degrees.
    pub phase_deg: f64,
}
