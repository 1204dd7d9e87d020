//! Target of a controller that can be set while it runs.

/// A target: load, frequency and phase of a sine.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SetPoint {
    /// Amplitude of the load, N or N·m depending on the scenario's kind of load, zero or positive.
    pub load: f64,
    /// Frequency, Hz, positive and below half the sample rate.
    pub frequency_hz: f64,
    /// Phase of the sine, degrees.
    pub phase_deg: f64,
}
