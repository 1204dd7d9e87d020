//! The responses that an exciter read, as documents and as a table.

use serde::Serialize;

use resonarm::control::ResponsePoint;
use resonarm::excitation::Phasor;

/// A response as JSON: phasors against the drive's phase as [in phase, in quadrature], for x and y.
#[derive(Serialize)]
pub(crate) struct ResponseDocument {
    frequency_hz: f64,
    /// Amplitude of the load's fundamental, N or N·m.
    load: f64,
    /// Lag of the response that a closed loop controls; none in open loop.
    phase_deg: Option<f64>,
    head_force_n: [[f64; 2]; 2],
    acceleration_b_m_s2: [[f64; 2]; 2],
    acceleration_c_m_s2: [[f64; 2]; 2],
    drift: f64,
    /// Harmonics 2 and 3 of the head's force over its fundamental, if they are read; `distortion` is both together.
    force_harmonics: Option<[f64; 2]>,
    distortion: Option<f64>,
    settled: bool,
    clipped: bool,
    tries: u32,
}

impl From<&ResponsePoint> for ResponseDocument {
    fn from(point: &ResponsePoint) -> ResponseDocument {
        let pair = |phasors: [Phasor; 2]| phasors.map(|phasor| [phasor.re, phasor.im]);
        ResponseDocument {
            frequency_hz: point.frequency_hz,
            load: point.load,
            phase_deg: point.lag_rad.map(f64::to_degrees),
            head_force_n: pair(point.head_force_n),
            acceleration_b_m_s2: pair(point.acceleration_b_m_s2),
            acceleration_c_m_s2: pair(point.acceleration_c_m_s2),
            drift: point.drift,
            force_harmonics: point.force_harmonics(),
            distortion: point.distortion(),
            settled: point.settled,
            clipped: point.is_clipped(),
            tries: point.tries,
        }
    }
}

pub(crate) fn documents(responses: &[ResponsePoint]) -> Vec<ResponseDocument> {
    responses.iter().map(ResponseDocument::from).collect()
}

/// Lists the responses in a table, after a blank line; empty if there are none.
pub(crate) fn table(responses: &[ResponsePoint]) -> String {
    let mut text = String::new();
    if !responses.is_empty() {
        text.push_str("\n  frequency     head force   B            C            drift\n");
    }
    for point in responses {
        text += &format!(
            "  {:9.5} Hz {:8.3} N {:8.2} m/s² {:8.2} m/s² {:7.3} {}\n",
            point.frequency_hz,
            magnitude(&point.head_force_n),
            magnitude(&point.acceleration_b_m_s2),
            magnitude(&point.acceleration_c_m_s2),
            point.drift,
            remark(point)
        );
    }
    text
}

fn remark(point: &ResponsePoint) -> &'static str {
    match (point.settled, point.is_clipped()) {
        (false, _) => "not settled",
        (true, true) => "clipped",
        (true, false) => "",
    }
}

/// Returns √(|x|² + |y|²), the size of a vector of phasors.
fn magnitude(phasors: &[Phasor; 2]) -> f64 {
    (phasors[0].norm_sqr() + phasors[1].norm_sqr()).sqrt()
}
