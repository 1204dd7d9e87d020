//! The responses that an exciter read, as documents and as a table; and the state of a test that it controls.

use serde::Serialize;

use resonarm::control::{ResponsePoint, TestPhase, TestReport};
use resonarm::excitation::Phasor;
use resonarm_numeric::number::rounded;

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

pub(crate) fn documents(responses: &[ResponsePoint]) -> Vec<ResponseDocument> {
    let pair = |phasors: [Phasor; 2]| phasors.map(|phasor| [phasor.re, phasor.im]);
    let document = |point: &ResponsePoint| ResponseDocument {
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
    };
    responses.iter().map(document).collect()
}

/// Lists the responses in a table, after a blank line; empty if there are none.
pub(crate) fn table(responses: &[ResponsePoint]) -> String {
    let mut text = String::new();
    if !responses.is_empty() {
        text.push_str("\n  frequency     head force   B            C            drift\n");
    }
    for point in responses {
        let hz = point.frequency_hz;
        let drift = point.drift;
        let remark = remark(point);
        let [head, b, c] = [point.head_force_n, point.acceleration_b_m_s2, point.acceleration_c_m_s2].map(magnitude);
        text += &format!("  {hz:9.5} Hz {head:8.3} N {b:8.2} m/s² {c:8.2} m/s² {drift:7.3} {remark}\n");
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
fn magnitude([x, y]: [Phasor; 2]) -> f64 {
    (x.norm_sqr() + y.norm_sqr()).sqrt()
}

/// Describes the state of a test at the end.
pub(crate) fn test_text(test: &TestReport) -> String {
    let TestReport { progress, lines } = test;
    let mut text = String::from("test");
    match (progress.level_db, progress.phase) {
        (Some(level_db), _) => text += &format!(" at {} dB", rounded(&level_db, 1)),
        (None, TestPhase::Silence | TestPhase::LoopCheck) => text += " in its loop check",
        (None, _) => text += " before its first level",
    }
    if let Some(frequency_hz) = progress.frequency_hz {
        text += &format!(", {} Hz", rounded(&frequency_hz, 2));
    }
    if progress.full_level_s > 0.0 {
        text += &format!(", {} s at full level", rounded(&progress.full_level_s, 1));
    }
    // Densities are powers, so a factor of ten is 10 dB.
    let deviations = lines.iter().map(|line| 10.0 * libm::log10(line.control / line.demand));
    let [low, high] =
        deviations.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], db| [low.min(db), high.max(db)]);
    if !lines.is_empty() {
        text +=
            &format!(", control average from {} to {} dB of the specification", rounded(&low, 2), rounded(&high, 2));
    }
    text + "\n"
}
