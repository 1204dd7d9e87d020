//! The size of an exciter's commands: within its own limits, and as set.

use core::f64::consts::{PI, TAU};
use core::ops::Range;

use super::counters::{is_command, sample};
use super::exciter_role::begin;
use super::settings::{ExpectedSine, SineAmplitude};
use super::stop::{Stop, failed, inconclusive, late, skipped};
use super::tester::{Heard, Tester, is_state};
use super::times::{MS, ms};
use resonarm_protocol::{Capabilities, ForceCommand, Message, NodeState, Profile, TorqueCommand};

/// Time for which commands are observed, ns.
const WATCH_NS: u64 = 1000 * MS;
/// Rounding of the limits in the capabilities, which are singles, as a share of them.
const ROUNDING: f64 = 1e-6;
/// Tolerance of the amplitude, and of the remainder, as a share of the expected amplitude.
const TOLERANCE: f64 = 0.05;
/// The shortest time over which a sine is fitted, ns, and the fewest periods.
const BLOCK_NS: u64 = 200 * MS;
const BLOCK_PERIODS: f64 = 3.0;
/// The fewest commands in a block.
const BLOCK_COMMANDS: usize = 10;
/// The amplitude has settled when successive blocks differ by less than this share.
const SETTLED: f64 = 0.005;
/// The smallest amplitude that counts as a command.
const NONE: f64 = 1e-9;
/// Share by which the frequency may differ from the expected one, by the times of the samples: more than quartz
/// crystals do.
const TIME_BASE: f64 = 1e-3;
/// Number of times that a frequency is fitted again.
const REFINEMENTS: u32 = 6;
/// The fewest periods of which a sine is known.
const PERIODS: f64 = 1.0;
/// Commands are clipped if this share of them is at each end of their range.
const CLIPPED: f64 = 0.1;
/// Phase at which a sine of the opposite sign begins, rad beyond π: with a slow ramp its first values are zero. One
/// that begins anywhere is there once in ten times.
const OPPOSITE: Range<f64> = -0.15..0.5;

/// The commands are within the limits that its capabilities state.
pub(super) fn own_limits(t: &mut Tester) -> Result<(), Stop> {
    if t.network.profile() == Profile::Classic {
        return skipped("the classic profile has no capabilities that state limits");
    }
    begin(t)?;
    t.run_ns(WATCH_NS)?;
    let Some(Capabilities { force_limit_n, torque_limit_nm, .. }) = t.last_capabilities() else {
        return skipped("no capabilities follow its hello, so it states no limits");
    };
    let beyond = |value: f64, limit: f64| value.abs() > limit * (1.0 + ROUNDING);
    for Heard { message, .. } in &t.heard {
        let (values, sample, limit, unit) = match *message {
            Message::Force(ForceCommand { force_x_n, force_y_n, sample }) => {
                ([force_x_n, force_y_n], sample, force_limit_n, "N")
            }
            Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample }) => {
                ([torque1_nm, torque2_nm], sample, torque_limit_nm, "N m")
            }
            _ => continue,
        };
        if let Some(value) = values.into_iter().find(|value| beyond(*value, limit)) {
            return failed(format!(
                "it commands {value} {unit} for sample {sample}, beyond the {limit} {unit} of its capabilities"
            ));
        }
    }
    t.note(format!("at most {force_limit_n} N, {torque_limit_nm} N m"));
    Ok(())
}

/// The commands along an axis, at the times of the samples, s.
type Points = Vec<(f64, f64)>;

/// A sine fitted to points, A sin(2π f t + φ) and a constant, and the root mean square of the residual.
#[derive(Clone, Copy, Debug)]
struct Fit {
    frequency_hz: f64,
    amplitude: f64,
    phase_rad: f64,
    rest: f64,
}

impl Fit {
    /// Whether it is the sine of this amplitude.
    fn is(&self, amplitude: f64) -> bool {
        (self.amplitude - amplitude).abs() <= TOLERANCE * amplitude && self.is_sine()
    }

    fn is_sine(&self) -> bool {
        self.amplitude > NONE && self.rest <= TOLERANCE * self.amplitude
    }
}

/// The commands become the sine set at the exciter.
pub(super) fn sine(t: &mut Tester) -> Result<(), Stop> {
    let Some(wanted) = t.settings.sine else {
        return skipped(
            "the sine that it should command is not given (--expect-frequency-hz with --expect-force-n or -torque-nm)",
        );
    };
    let rate_hz = begin(t).map(|()| f64::from(t.hello.rate_hz))?;
    // From half the sample rate on, a sine can't be told from its alias.
    if wanted.frequency_hz >= rate_hz / 2.0 {
        return inconclusive(format!("{} Hz can't be commanded at {rate_hz} samples a second", wanted.frequency_hz));
    }
    let block_ns = BLOCK_NS.max((BLOCK_PERIODS / wanted.frequency_hz * 1e9) as u64);
    // A slow sine gets the time of two blocks, however short the patience is.
    let give_up_ns = t.now_ns() + t.settings.patience_ns.max(2 * block_ns);
    let mut settled = [0.0; 2];
    loop {
        let from = t.heard.len();
        let points = block(t, wanted.axis(), block_ns)?;
        let Some(fit) = fit(&points, wanted.frequency_hz) else {
            return inconclusive("too few commands were received for a fit");
        };
        if fit.is(wanted.amplitude()) {
            return judge_time_and_sign(t, &wanted, from, rate_hz);
        }
        // Three blocks in a row must agree, since two parts of a slow ramp can be alike by chance.
        let has_settled = settled.iter().all(|before| (before - fit.amplitude).abs() < SETTLED * fit.amplitude);
        if t.now_ns() >= give_up_ns || (has_settled && fit.amplitude > NONE) {
            if !fit.is_sine() {
                // A lower frequency shows itself in a longer time.
                t.run_ns(WATCH_NS)?;
            }
            return failed(explained(t, &wanted, fit, from, rate_hz));
        }
        settled = [settled[1], fit.amplitude];
    }
}

/// The commands along an axis over a block of samples. On a busy machine the samples of the tester are fewer than the
/// clock says, so it takes the time that they take.
fn block(t: &mut Tester, axis: Axis, block_ns: u64) -> Result<Points, Stop> {
    let (from, start_ns, rate_hz) = (t.heard.len(), t.now_ns(), f64::from(t.hello.rate_hz));
    let give_up_ns = start_ns + block_ns + t.settings.patience_ns;
    loop {
        t.run_ns(block_ns)?;
        let points = points(&t.heard[from..], axis, rate_hz);
        let seen_s = points.last().map_or(0.0, |(time_s, _)| *time_s);
        let is_whole = points.len() >= BLOCK_COMMANDS && seen_s >= 0.9e-9 * block_ns as f64;
        if has_ended(t, from) || (!is_whole && t.now_ns() >= give_up_ns) {
            let took = ms(t.now_ns() - start_ns);
            return late(format!("{} {} commands came within {took}", points.len(), axis.name));
        }
        if is_whole {
            return Ok(points);
        }
    }
}

/// Whether its work has ended after index `from` of the log.
fn has_ended(t: &Tester, from: usize) -> bool {
    t.heard[from..].iter().any(|heard| !is_running(&heard.message))
}

/// Judges frequency and sign of the sine that the commands are from index `from` of the log on. Times are those of the
/// samples, so that no hold-up changes them.
fn judge_time_and_sign(t: &mut Tester, wanted: &ExpectedSine, from: usize, rate_hz: f64) -> Result<(), Stop> {
    let axis = wanted.axis();
    let until = t.heard.len();
    t.run_ns(WATCH_NS)?;
    // If the sine ends meanwhile, the time in which it was seen has to do.
    let until = if has_ended(t, from) { until } else { t.heard.len() };
    let is_boot = |heard: &Heard| is_state(&heard.message, NodeState::BootUp);
    let boot = t.heard[..from].iter().rposition(is_boot).unwrap_or(0);
    let all = points(&t.heard[boot..until], axis, rate_hz);
    let seen = points(&t.heard[from..until], axis, rate_hz).len();
    let Some((fit, deviation_hz)) = refined(&all[all.len().saturating_sub(seen)..], wanted.frequency_hz) else {
        return inconclusive("too few commands were received for a fit");
    };
    let unit = axis.unit;
    let frequency_hz = wanted.frequency_hz;
    let ppm = |hz: f64| 1e6 * hz / frequency_hz;
    let off_hz = fit.frequency_hz - frequency_hz;
    let stated = format!(
        "{:.3} {unit} at {:.5} Hz, {:+.0} ppm from {frequency_hz} Hz (standard deviation {:.1} ppm)",
        fit.amplitude,
        fit.frequency_hz,
        ppm(off_hz),
        ppm(deviation_hz)
    );
    // Beyond four standard deviations, the noise of a normal fit would fail one node in some 16 000.
    if off_hz.abs() > TIME_BASE * frequency_hz + 4.0 * deviation_hz {
        return failed(format!(
            "it commands {stated}, by its samples: at most {:.0} ppm are allowed. Does its time advance by a sample period \
             with each sample?",
            ppm(TIME_BASE * frequency_hz)
        ));
    }
    t.note(stated);
    let first = all.iter().find(|(_, value)| value.abs() > NONE).map_or(0.0, |(time_s, _)| *time_s);
    // The phase of the sine at its first command that is not zero.
    let begins_rad = fit.phase_rad + TAU * fit.frequency_hz * first;
    if OPPOSITE.contains(&wrapped(begins_rad - PI)) {
        return Err(Stop::Chance(format!(
            "its sine begins with negative {}: it is the expected one with the opposite sign. Is a sign wrong?",
            axis.name
        )));
    }
    Ok(())
}

fn is_running(message: &Message) -> bool {
    !is_state(message, NodeState::PreOperational) && !is_state(message, NodeState::Fault)
}

/// A signal of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis {
    name: &'static str,
    unit: &'static str,
    /// The value of one count in the classic profile, in the unit.
    factor: f64,
}

// The factors are those of the classic profile in SPEC.md, section 3: 50 counts for a newton and 20 for a newton
// metre.
const FORCE_X: Axis = Axis { name: "force_x_n", unit: "N", factor: 0.02 };
const FORCE_Y: Axis = Axis { name: "force_y_n", ..FORCE_X };
const TORQUE_1: Axis = Axis { name: "torque1_nm", unit: "N m", factor: 0.05 };
const TORQUE_2: Axis = Axis { name: "torque2_nm", ..TORQUE_1 };

impl Axis {
    fn of(self, message: &Message) -> Option<(u16, f64)> {
        let mut value = None;
        if is_command(message) {
            message.signals(|name, of| value = value.or((name == self.name).then_some(of)));
        }
        sample(message).zip(value)
    }

    /// The value with its bytes in reverse order.
    fn swapped(self, value: f64, profile: Profile) -> f64 {
        match profile {
            Profile::Classic => f64::from(((value / self.factor).round() as i16).swap_bytes()) * self.factor,
            Profile::Fd => f32::from_bits((value as f32).to_bits().swap_bytes()).into(),
        }
    }
}

impl ExpectedSine {
    fn axis(&self) -> Axis {
        match self.amplitude {
            SineAmplitude::ForceN(_) => FORCE_X,
            SineAmplitude::TorqueNm(_) => TORQUE_1,
        }
    }

    fn amplitude(&self) -> f64 {
        match self.amplitude {
            SineAmplitude::ForceN(amplitude) | SineAmplitude::TorqueNm(amplitude) => amplitude,
        }
    }
}

/// The values along an axis, at the times of their samples since the first of them, s.
fn points(heard: &[Heard], axis: Axis, rate_hz: f64) -> Points {
    let mut last = None;
    let mut samples = 0_i64;
    let values = heard.iter().filter_map(|heard| axis.of(&heard.message));
    values
        .map(|(sample, value)| {
            // Modulo 2¹⁶: the upper half of the range is behind.
            samples += i64::from(sample.wrapping_sub(last.replace(sample).unwrap_or(sample)) as i16);
            (samples as f64 / rate_hz, value)
        })
        .collect()
}

/// The least squares of a cos ωt + b sin ωt + c, by its normal equations; `None` if the points don't determine them.
fn fit(points: &[(f64, f64)], frequency_hz: f64) -> Option<Fit> {
    let basis = |time_s: f64| {
        let (sin, cos) = libm::sincos(TAU * frequency_hz * time_s);
        [cos, sin, 1.0]
    };
    let mut matrix = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for (time_s, value) in points {
        let row = basis(*time_s);
        for i in 0..3 {
            right[i] += row[i] * value;
            for j in 0..3 {
                matrix[i][j] += row[i] * row[j];
            }
        }
    }
    let [a, b, c] = solved(matrix, right)?;
    let square = |(time_s, value): &(f64, f64)| {
        let [cos, sin, one] = basis(*time_s);
        let rest = value - a * cos - b * sin - c * one;
        rest * rest
    };
    let rest = libm::sqrt(points.iter().map(square).sum::<f64>() / points.len() as f64);
    // a cos ωt + b sin ωt is A sin(ωt + φ) with a = A sin φ and b = A cos φ.
    Some(Fit { frequency_hz, amplitude: libm::hypot(a, b), phase_rad: libm::atan2(a, b), rest })
}

/// The sine whose frequency is fitted, too, beginning with a frequency, and the standard deviation of the frequency, Hz:
/// the phases of both halves of the points agree. `None` if the points don't determine it.
fn refined(points: &[(f64, f64)], frequency_hz: f64) -> Option<(Fit, f64)> {
    let (first, second) = points.split_at(points.len() / 2);
    // A fit whose frequency is a little off is right in the middle of its points, so that the phases of the halves
    // differ by that error over this time.
    let middle = |half: &[(f64, f64)]| half.iter().map(|(time_s, _)| time_s).sum::<f64>() / half.len() as f64;
    let between_s = middle(second) - middle(first);
    let mut frequency_hz = frequency_hz;
    for _ in 0..REFINEMENTS {
        // With a frequency that is off, the phase of the second half runs away from that of the first.
        let phase_rad = wrapped(fit(second, frequency_hz)?.phase_rad - fit(first, frequency_hz)?.phase_rad);
        frequency_hz += phase_rad / (TAU * between_s);
    }
    let fit = fit(points, frequency_hz).filter(|fit| fit.frequency_hz.is_finite() && fit.amplitude > NONE)?;
    // The phase of a half of n points has the variance 2 (rest / amplitude)² / n.
    let of_phase_rad = 2.0 * fit.rest / fit.amplitude * libm::sqrt(2.0 / points.len() as f64);
    Some((fit, of_phase_rad / (TAU * between_s)))
}

/// An angle, rad, between −π and π.
fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - TAU * libm::round(angle_rad / TAU)
}

/// The solution of three equations, by Cramer's rule.
fn solved(matrix: [[f64; 3]; 3], right: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = |m: &[[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(&matrix);
    let solution = core::array::from_fn(|column| {
        let mut replaced = matrix;
        for (row, value) in replaced.iter_mut().zip(right) {
            row[column] = value;
        }
        determinant(&replaced) / whole
    });
    solution.iter().all(|value: &f64| value.is_finite()).then_some(solution)
}

/// The smallest and the largest of the values.
fn range(points: &[(f64, f64)]) -> (f64, f64) {
    let values = points.iter().map(|(_, value)| *value);
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| (min.min(value), max.max(value)))
}

/// Whether so many values are at both ends of their range that they were clipped there.
fn is_clipped(points: &[(f64, f64)]) -> bool {
    let (min, max) = range(points);
    let at = |end: f64| points.iter().filter(|(_, value)| (value - end).abs() <= NONE).count() as f64;
    max - min > NONE && [min, max].iter().all(|end| at(*end) >= CLIPPED * points.len() as f64)
}

/// The sine of this frequency that the points are; `None` if they are none. They determine it only if they are a period
/// and more, and its amplitude is never beyond the range of their values.
fn sine_at(points: &[(f64, f64)], frequency_hz: f64, rate_hz: f64) -> Option<Fit> {
    let (Some((from_s, _)), Some((to_s, _))) = (points.first(), points.last()) else { return None };
    if frequency_hz * (to_s - from_s) < PERIODS || frequency_hz >= rate_hz / 2.0 {
        return None;
    }
    let (min, max) = range(points);
    // Over little more than a period a large sine beside a large constant would fit almost anything.
    let is_within = |fit: &Fit| fit.amplitude <= (1.0 + TOLERANCE) * (max - min) / 2.0;
    fit(points, frequency_hz).filter(Fit::is_sine).filter(is_within)
}

/// Describes the commands, with the usual mistake that explains them, if one does.
fn explained(t: &Tester, wanted: &ExpectedSine, got: Fit, from: usize, rate_hz: f64) -> String {
    let axis = wanted.axis();
    let amplitude = wanted.amplitude();
    let frequency_hz = wanted.frequency_hz;
    let heard = &t.heard[from..];
    let unit = axis.unit;
    let expected = format!("expected {amplitude} {unit} at {frequency_hz} Hz along {}", axis.name);
    let own = points(heard, axis, rate_hz);
    let (min, max) = range(&own);
    if got.is_sine() {
        let ratio = got.amplitude / amplitude;
        let by_factor = |factor: f64| (ratio / factor - 1.0).abs() < TOLERANCE;
        let why = if by_factor(axis.factor) {
            " Is it sent without the factor of its counts?"
        } else if by_factor(1.0 / axis.factor) {
            " Is it divided twice by the factor of its counts?"
        } else {
            ""
        };
        return format!("it commands {:.4} {unit}, {ratio:.4} times the amplitude; {expected}.{why}", got.amplitude);
    }
    if is_clipped(&own) {
        return format!("its commands are no sine: they are clipped at {min} and {max} {unit}; {expected}");
    }
    let swapped: Points = own.iter().map(|(at, value)| (*at, axis.swapped(*value, t.network.profile()))).collect();
    if let Some(fit) = sine_at(&swapped, frequency_hz, rate_hz) {
        return format!(
            "with the bytes of each value the other way round it commands {:.4} {unit}; {expected}. Is its \
             byte order wrong?",
            fit.amplitude
        );
    }
    for other in [FORCE_X, FORCE_Y, TORQUE_1, TORQUE_2].into_iter().filter(|other| *other != axis) {
        if let Some(fit) = sine_at(&points(heard, other, rate_hz), frequency_hz, rate_hz) {
            return format!("it commands {:.4} {} along {}; {expected}", fit.amplitude, other.unit, other.name);
        }
    }
    // Radians in place of periods, half and double, and wrong powers of ten.
    let ratios = [1.0, 1.0 / TAU, TAU, 0.5, 2.0, 0.1, 10.0, 0.01, 100.0, 0.001, 1000.0];
    for guess_hz in ratios.map(|ratio| ratio * frequency_hz) {
        let near_hz = refined(&own, guess_hz).map_or(guess_hz, |(fit, _)| fit.frequency_hz);
        if let Some(fit) = sine_at(&own, near_hz, rate_hz) {
            return format!("it commands {:.4} {unit} at {:.4} Hz; {expected}", fit.amplitude, fit.frequency_hz);
        }
    }
    let rest = got.rest;
    format!(
        "its commands are no sine of this frequency: they are from {min} to {max} {unit}, and the best sine leaves {rest:.4} \
         {unit} rms of them; {expected}"
    )
}
