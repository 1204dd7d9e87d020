//! What the demo shows: an introduction, the response as a table, and as a figure beside the linear theory.

use core::fmt::Write;

use super::captions;
use super::exciter::magnitude;
use super::failure::Failure;
use crate::analysis::{Drive, FrequencyResponse, FrfError, Quantity, Response, modes};
use crate::excitation::Profile;
use crate::node::ResponsePoint;
use crate::plot::{Axis, Color, Figure, Marker, Panel, Series, Style};
use crate::run::{Mode, Speed};
use crate::scenario::Scenario;

/// Points of the theory's curves.
const CURVE_POINTS: usize = 1200;

/// What is about to happen.
pub(super) fn introduction(
    scenario: &Scenario,
    profile: &Profile,
    mode: Mode,
    speed: Speed,
) -> Result<String, Failure> {
    let [first, second] = modes(&scenario.build_arm()?);
    let settling_s = 1.0 / (core::f64::consts::TAU * first.frequency_hz * first.damping_ratio);
    let pace = match (mode, speed.times()) {
        (Mode::RealTime, _) => String::from("in real time"),
        (_, 0.0) => String::from("in lockstep, as fast as it goes"),
        (_, times) => format!("in lockstep at {times} times the speed of the clock"),
    };
    Ok(format!(
        "arm          {} at β1 = {}°, β2 = {}°\n\
         modes        {:.2} Hz (damping ratio {:.1e}, time constant {settling_s:.2} s), {:.2} Hz\n\
         bus          in memory, {} samples a second for {:.1} simulated seconds, {pace}\n\n",
        scenario.arm.label(),
        scenario.arm.beta1_deg,
        scenario.arm.beta2_deg,
        first.frequency_hz,
        first.damping_ratio,
        second.frequency_hz,
        scenario.simulation.rate_hz,
        profile.duration_s()
    ))
}

/// The accelerance of one point: measured, and by the linear theory.
struct Accelerance {
    measured: f64,
    linear: f64,
}

/// |acceleration of B or C| / |force in the head|, for both points.
fn accelerances(
    scenario: &Scenario,
    linear: &FrequencyResponse,
    point: &ResponsePoint,
) -> Result<[Accelerance; 2], Failure> {
    let force_n = magnitude(&point.head_force_n);
    let [b, c] = linear_accelerances(scenario, linear, point.frequency_hz)?;
    Ok([
        Accelerance { measured: magnitude(&point.acceleration_b_m_s2) / force_n, linear: b },
        Accelerance { measured: magnitude(&point.acceleration_c_m_s2) / force_n, linear: c },
    ])
}

/// The same by the linear theory, for the scenario's direction of force.
fn linear_accelerances(scenario: &Scenario, linear: &FrequencyResponse, hz: f64) -> Result<[f64; 2], Failure> {
    let amplitude = scenario.excitation.as_ref().map(|spec| spec.amplitude).unwrap_or_default();
    let size = (amplitude.force_x_n.powi(2) + amplitude.force_y_n.powi(2)).sqrt();
    let along = |response: Response| -> Result<f64, FrfError> {
        let x = linear.at(Quantity::Accelerance, Drive::ForceX, response, hz)? * amplitude.force_x_n;
        let y = linear.at(Quantity::Accelerance, Drive::ForceY, response, hz)? * amplitude.force_y_n;
        Ok((x + y).norm_sqr())
    };
    let both = |x, y| -> Result<f64, FrfError> { Ok((along(x)? + along(y)?).sqrt() / size) };
    let failed = |error: FrfError| Failure::Usage(error.to_string());
    Ok([both(Response::BX, Response::BY).map_err(failed)?, both(Response::CX, Response::CY).map_err(failed)?])
}

/// The responses for reading.
pub(super) fn table(scenario: &Scenario, responses: &[ResponsePoint]) -> Result<String, Failure> {
    if responses.is_empty() {
        return Ok(String::from("no response was read\n\n"));
    }
    let linear = FrequencyResponse::new(&scenario.build_arm()?);
    let mut text = String::from("  frequency   force    accelerance at B, linear     at C, linear   (m/s² per N)\n");
    for point in responses {
        let [b, c] = accelerances(scenario, &linear, point)?;
        let _infallible = writeln!(
            text,
            "  {:6.2} Hz {:6.2} N        {:9.4}  {:9.4}  {:9.4} {:9.4}   {}",
            point.frequency_hz,
            magnitude(&point.head_force_n),
            b.measured,
            b.linear,
            c.measured,
            c.linear,
            if point.clipped {
                "clipped"
            } else if point.is_settled() {
                ""
            } else {
                "not settled"
            }
        );
    }
    let unsettled = responses.iter().filter(|point| !point.is_settled()).count();
    let _infallible = writeln!(
        text,
        "\n{unsettled} of {} points were still moving by more than {} % when they were read.\n",
        responses.len(),
        ResponsePoint::SETTLED_DRIFT * 100.0
    );
    Ok(text)
}

/// The responses as a figure: two panels, points B and C, over the linear theory; `None` without a response.
pub(super) fn figure(scenario: &Scenario, responses: &[ResponsePoint]) -> Result<Option<Figure>, Failure> {
    if responses.is_empty() {
        return Ok(None);
    }
    let linear = FrequencyResponse::new(&scenario.build_arm()?);
    let (low, high) = responses.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), point| {
        (low.min(point.frequency_hz), high.max(point.frequency_hz))
    });
    // One point alone gets 1 Hz to each side.
    let margin = if high > low { 0.05 * (high - low) } else { 1.0 };
    let grid = (0..=CURVE_POINTS).map(|k| low - margin + (high - low + 2.0 * margin) * k as f64 / CURVE_POINTS as f64);
    let curve: Vec<(f64, [f64; 2])> = grid
        .map(|hz| linear_accelerances(scenario, &linear, hz).map(|values| (hz, values)))
        .collect::<Result<_, Failure>>()?;
    let measured: Vec<(bool, f64, [Accelerance; 2])> = responses
        .iter()
        .map(|point| Ok((point.is_settled(), point.frequency_hz, accelerances(scenario, &linear, point)?)))
        .collect::<Result<_, Failure>>()?;

    let mut figure = Figure::new("Stepped sine through the first resonance").subtitle(captions::pose(&scenario.arm));
    for (index, name) in ["B", "C"].into_iter().enumerate() {
        let marks = |settled: bool| {
            measured.iter().filter(|m| m.0 == settled).map(|m| (m.1, m.2[index].measured)).collect::<Vec<_>>()
        };
        let line = curve.iter().map(|(hz, values)| (*hz, values[index])).collect();
        let open = Style::Markers { color: Color::Vermillion, shape: Marker::Circle, size: 6.0, filled: false };
        let mut panel =
            Panel::new(Axis::linear("frequency (Hz)"), Axis::log(format!("accelerance at {name} (m/s² per N)")))
                .with(Series::line("linear theory, settled", Color::Grey, line));
        for (label, settled) in [("read, settled", true), ("read, not settled", false)] {
            let points = marks(settled);
            if !points.is_empty() {
                let series = Series::markers(label, Color::Vermillion, Marker::Circle, points);
                panel = panel.with(if settled { series } else { series.style(open) });
            }
        }
        figure = figure.with(panel);
    }
    Ok(Some(figure))
}
