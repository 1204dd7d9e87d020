//! Figures of `resonarm identify`: frequency responses with the fitted curves, and poles over the order.

use super::identify_found::{Found, NumberedMode, OrderPoles};
use crate::figures::response_curves::broken_at_wraps;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Legend, Marker, Note, Panel, Series, Style};

/// A measured response and the fitted one.
#[derive(Clone)]
pub(super) struct Curve<'a> {
    /// Title of the row.
    pub title: String,
    /// Label of the modulus.
    pub label: String,
    /// Frequencies of the measured values, Hz.
    pub frequency_hz: &'a [f64],
    /// Measured values, complex as [real, imaginary].
    pub measured: &'a [[f64; 2]],
    pub coherence: Option<&'a [f64]>,
    /// One of so many measured lines is drawn; 1 draws all of them.
    pub step: usize,
    /// Frequencies and values of the fitted curve.
    pub fitted: &'a [(f64, [f64; 2])],
}

impl Curve<'_> {
    /// Returns the numbers of the measured lines that are drawn.
    fn drawn(&self) -> impl Iterator<Item = usize> {
        (0..self.frequency_hz.len()).step_by(self.step)
    }
}

/// The least coherence at which phases are drawn: below it they are those of the noise.
const LEAST_COHERENCE: f64 = 0.5;
/// Size of the dots of a measured response, px.
const DOT: f64 = 2.4;
/// Part of the diagram's height that the mode indicator takes.
const INDICATOR_PART: f64 = 0.9;
/// Height of the diagram over the highest order: the names of the modes are above it.
const ROOM: f64 = 1.12;

/// Draws a row for each response: the modulus and the phase as dots, the fitted curves over them, and the coherence, if there is
/// one. All moduli have one axis.
pub(super) fn responses_figure(found: &Found, curves: &[Curve<'_>]) -> Figure {
    let is_read = |curve: &&Curve<'_>| curve.drawn().any(|k| size(curve.measured[k]) > 0.0);
    let read: Vec<&Curve<'_>> = curves.iter().filter(is_read).collect();
    let of_curve = |curve: &&Curve<'_>| curve.drawn().map(|k| size(curve.measured[k])).collect::<Vec<_>>();
    let sizes = || read.iter().flat_map(of_curve).filter(|size| *size > 0.0);
    // A factor of two beyond the values at both ends of the logarithmic axis, the same for all rows, so that they can
    // be compared by eye.
    // Sharp peaks of the fitted curves are higher than the measured ones.
    let fitted = read.iter().flat_map(|curve| curve.fitted).map(|(_, value)| size(*value));
    let range = [sizes().fold(f64::INFINITY, f64::min) / 2.0, sizes().chain(fitted).fold(0.0, f64::max) * 2.0];
    let has_coherence = read.iter().any(|curve| curve.coherence.is_some());
    let mut figure = Figure::new("Frequency response, measured and fitted");
    figure.columns = if has_coherence { 3 } else { 2 };
    for curve in read {
        for panel in panels(found, curve, range) {
            // One legend, for all.
            let is_first = figure.panels.is_empty();
            figure = figure.with(panel.legend(if is_first { Legend::Bottom } else { Legend::None }));
        }
    }
    figure
}

fn size([re, im]: [f64; 2]) -> f64 {
    libm::hypot(re, im)
}

/// Returns the modulus for a logarithmic axis: a zero has no logarithm, and is left out.
fn modulus_of(value: [f64; 2]) -> f64 {
    Some(size(value)).filter(|size| *size > 0.0).unwrap_or(f64::NAN)
}

fn phase_of([re, im]: [f64; 2]) -> f64 {
    libm::atan2(im, re).to_degrees()
}

/// Draws the panels of a response, from left to right.
fn panels(found: &Found, curve: &Curve<'_>, [low, high]: [f64; 2]) -> Vec<Panel> {
    let x = || frequency_axis(found);
    let points = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        curve.drawn().map(|k| (curve.frequency_hz[k], value(k))).collect()
    };
    let is_noise = |k: usize| curve.coherence.is_some_and(|coherence| coherence[k] < LEAST_COHERENCE);
    let measured = |points| Series::markers("measured", Color::Blue, Marker::Circle, points).marked(DOT, true);
    let fitted = |points: Vec<(f64, f64)>| {
        let style = Style::Line { color: Color::Vermillion, width: 1.2, dash: Dash::Solid };
        Series::line("fitted", Color::Vermillion, points).style(style)
    };
    let is_known = |k: usize| !modulus_of(curve.measured[k]).is_nan();
    // A response of nothing but noise keeps its phases.
    let is_all_noise = !curve.drawn().any(|k| is_known(k) && !is_noise(k));
    // Below the least coherence the phase is random and would fill the panel from edge to edge.
    let is_drawn = |k: usize| is_known(k) && (is_all_noise || !is_noise(k));
    let modulus = Panel::new(x(), Axis::log(curve.label.as_str()).range(low, high))
        .title(curve.title.as_str())
        .with(measured(points(&|k| modulus_of(curve.measured[k]))))
        .with_any(fitted(curve.fitted.iter().map(|(hz, value)| (*hz, modulus_of(*value))).collect()));
    let phase = Panel::new(x(), Axis::degrees("phase (°)").range(-190.0, 190.0))
        .with(measured(points(&|k| if is_drawn(k) { phase_of(curve.measured[k]) } else { f64::NAN })))
        .with_any(fitted(broken_at_wraps(curve.fitted.iter().map(|(hz, value)| (*hz, phase_of(*value))).collect())));
    let coherence = curve.coherence.map(|values| {
        Panel::new(x(), Axis::linear("coherence").range(0.0, 1.05)).with(measured(points(&|k| values[k])))
    });
    [Some(modulus), Some(phase), coherence].into_iter().flatten().collect()
}

/// Returns the axis of the whole band, also where something is left out.
fn frequency_axis(found: &Found) -> Axis {
    Axis::linear("frequency (Hz)").range(found.from_hz, found.to_hz)
}

/// Draws the poles over the order of the polynomial model, the mode indicator under them, and the modes that were fitted.
pub(super) fn poles_figure(found: &Found, curves: &[Curve<'_>]) -> Figure {
    let orders = &found.stabilisation.orders;
    let highest = orders.iter().map(|order| order.order).max().unwrap_or(1) as f64;
    let poles = |wanted: bool| -> Vec<(f64, f64)> {
        let of_order = |order: &OrderPoles| {
            let pairs = order.poles_rad_s.iter().zip(&order.stable);
            let chosen = pairs.filter(|(_, stable)| **stable == wanted);
            let at = |(pole, _): (&[f64; 2], &bool)| (size(*pole) / core::f64::consts::TAU, order.order as f64);
            chosen.map(at).collect::<Vec<_>>()
        };
        orders.iter().flat_map(of_order).collect()
    };
    // A line from the bottom to the top at each mode, which a gap ends.
    let top = highest + 0.5;
    let chosen: Vec<(f64, f64)> = found
        .modes
        .iter()
        .flat_map(|mode| {
            let hz = mode.found.pole_frequency_hz;
            [(hz, 0.0), (hz, top), (hz, f64::NAN)]
        })
        .collect();
    let name = |NumberedMode { mode, found }: &NumberedMode| Note {
        at: (found.pole_frequency_hz, top),
        text: mode.map_or(format!("{:.1} Hz", found.pole_frequency_hz), |number| format!("mode {number}")),
    };
    let dashed = Style::Line { color: Color::Vermillion, width: 1.2, dash: Dash::Dashed };
    let indicator = Style::Line { color: Color::Grey, width: 1.2, dash: Dash::Solid };
    let panel = Panel::new(frequency_axis(found), Axis::linear("order").range(0.0, ROOM * highest))
        .with_any(
            Series::line("mode indicator: Σ|H₁|², logarithmic", Color::Grey, indicator_curve(curves, highest))
                .style(indicator),
        )
        .with_any(Series::line("fitted modes", Color::Vermillion, chosen).style(dashed))
        .with_any(Series::markers("single pole", Color::SkyBlue, Marker::Circle, poles(false)).marked(3.5, false))
        .with_any(Series::markers("pole that comes again", Color::Blue, Marker::Circle, poles(true)).marked(3.5, true))
        .row(found.modes.iter().map(name).collect())
        .legend(Legend::Below);
    Figure::new("Stabilisation diagram").with(panel)
}

/// Returns the logarithm of the sum of all responses' squares at the frequencies of the first one, scaled to the diagram.
fn indicator_curve(curves: &[Curve<'_>], highest: f64) -> Vec<(f64, f64)> {
    let Some(first) = curves.first() else { return Vec::new() };
    // Those of other recordings may have other frequencies.
    let alike = || curves.iter().filter(|curve| curve.frequency_hz == first.frequency_hz);
    let square = |value: [f64; 2]| value[0] * value[0] + value[1] * value[1];
    let logarithm = |k: usize| libm::log10(alike().map(|curve| square(curve.measured[k])).sum());
    let logarithms: Vec<f64> = (0..first.frequency_hz.len()).map(logarithm).collect();
    let finite = || logarithms.iter().copied().filter(|value| value.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let part = |value: f64| INDICATOR_PART * highest * (value - low) / (high - low);
    let scaled = |value: f64| if value.is_finite() { part(value) } else { f64::NAN };
    first.frequency_hz.iter().zip(&logarithms).map(|(hz, value)| (*hz, scaled(*value))).collect()
}
