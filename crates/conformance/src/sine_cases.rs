//! The size of an exciter's commands: within its own limits, and as set.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use super::exciter_role::begin;
use super::settings::{ExpectedSine, SineAmplitude};
use super::stop::{Stop, failed, inconclusive, late, skipped};
use super::tester::{Heard, Tester, is_state};
use super::times::{MS, ms};
use resonarm_protocol::{ForceCommand, Message, NodeState, Profile, TorqueCommand};

/// How long commands are observed, ns.
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

/// The commands are within the limits that its capabilities state.
pub(super) fn own_limits(t: &mut Tester) -> Result<(), Stop> {
    if t.network.profile() == Profile::Classic {
        return skipped("the classic profile has no capabilities that state limits");
    }
    begin(t)?;
    t.run_ns(WATCH_NS)?;
    let stated = t.heard.iter().rev().find_map(|heard| match heard.message {
        Message::Capabilities(capabilities) => Some((capabilities.force_limit_n, capabilities.torque_limit_nm)),
        _ => None,
    });
    let Some((force_limit_n, torque_limit_nm)) = stated else {
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

/// A sine fitted to points: its amplitude, and the root mean square of the residual without constants.
#[derive(Clone, Copy, Debug)]
struct Fit {
    amplitude: f64,
    rest: f64,
}

impl Fit {
    fn is(&self, expected: f64) -> bool {
        (self.amplitude - expected).abs() <= TOLERANCE * expected && self.is_sine()
    }

    fn is_sine(&self) -> bool {
        self.amplitude > NONE && self.rest <= TOLERANCE * self.amplitude
    }
}

/// The commands become the sine set at the exciter.
pub(super) fn sine(t: &mut Tester) -> Result<(), Stop> {
    let Some(wanted) = t.settings.sine else {
        return skipped(
            "the sine that it is set to is not given (--expect-frequency-hz with --expect-force-n or -torque-nm)",
        );
    };
    let rate_hz = begin(t).map(|()| f64::from(t.hello.rate_hz))?;
    if wanted.frequency_hz >= rate_hz / 2.0 {
        return inconclusive(format!("{} Hz can't be commanded at {rate_hz} samples a second", wanted.frequency_hz));
    }
    let block_ns = BLOCK_NS.max((BLOCK_PERIODS / wanted.frequency_hz * 1e9) as u64);
    let give_up_ns = t.now_ns() + t.settings.patience_ns.max(2 * block_ns);
    let mut settled = [0.0; 2];
    loop {
        let from = t.heard.len();
        t.run_ns(block_ns)?;
        let points = points(&t.heard[from..], wanted.axis(), rate_hz);
        let has_ended = t.heard[from..].iter().any(|heard| !is_running(&heard.message));
        if points.len() < BLOCK_COMMANDS || has_ended {
            return late(format!("{} {} commands came within {}", points.len(), wanted.axis().name(), ms(block_ns)));
        }
        let Some(fit) = fit(&points, wanted.frequency_hz) else {
            return inconclusive("the commands that came are too few for a fit");
        };
        if fit.is(wanted.amplitude()) {
            let (amplitude, unit) = (fit.amplitude, wanted.axis().unit());
            t.note(format!("{amplitude:.3} {unit} at {} Hz", wanted.frequency_hz));
            return Ok(());
        }
        let has_settled = settled.iter().all(|before| (before - fit.amplitude).abs() < SETTLED * fit.amplitude);
        if t.now_ns() >= give_up_ns || (has_settled && fit.amplitude > NONE) {
            return failed(explained(t, &wanted, fit, from, rate_hz));
        }
        settled = [settled[1], fit.amplitude];
    }
}

fn is_running(message: &Message) -> bool {
    !is_state(message, NodeState::PreOperational) && !is_state(message, NodeState::Fault)
}

/// A signal of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    ForceX,
    ForceY,
    Torque1,
    Torque2,
}

impl Axis {
    const ALL: [Axis; 4] = [Axis::ForceX, Axis::ForceY, Axis::Torque1, Axis::Torque2];

    const fn name(self) -> &'static str {
        match self {
            Axis::ForceX => "force_x_n",
            Axis::ForceY => "force_y_n",
            Axis::Torque1 => "torque1_nm",
            Axis::Torque2 => "torque2_nm",
        }
    }

    const fn unit(self) -> &'static str {
        match self {
            Axis::ForceX | Axis::ForceY => "N",
            Axis::Torque1 | Axis::Torque2 => "N m",
        }
    }

    /// The value of one count in the classic profile, in the unit.
    const fn factor(self) -> f64 {
        match self {
            Axis::ForceX | Axis::ForceY => 0.02,
            Axis::Torque1 | Axis::Torque2 => 0.05,
        }
    }

    fn of(self, message: &Message) -> Option<(u16, f64)> {
        match (self, *message) {
            (Axis::ForceX, Message::Force(command)) => Some((command.sample, command.force_x_n)),
            (Axis::ForceY, Message::Force(command)) => Some((command.sample, command.force_y_n)),
            (Axis::Torque1, Message::Torque(command)) => Some((command.sample, command.torque1_nm)),
            (Axis::Torque2, Message::Torque(command)) => Some((command.sample, command.torque2_nm)),
            _ => None,
        }
    }

    /// The value with its bytes in reverse order.
    fn swapped(self, value: f64, profile: Profile) -> f64 {
        match profile {
            Profile::Classic => f64::from(((value / self.factor()).round() as i16).swap_bytes()) * self.factor(),
            Profile::Fd => f32::from_bits((value as f32).to_bits().swap_bytes()).into(),
        }
    }
}

impl ExpectedSine {
    fn axis(&self) -> Axis {
        match self.amplitude {
            SineAmplitude::ForceN(_) => Axis::ForceX,
            SineAmplitude::TorqueNm(_) => Axis::Torque1,
        }
    }

    fn amplitude(&self) -> f64 {
        match self.amplitude {
            SineAmplitude::ForceN(amplitude) | SineAmplitude::TorqueNm(amplitude) => amplitude,
        }
    }
}

fn points(heard: &[Heard], axis: Axis, rate_hz: f64) -> Points {
    let values: Vec<(u16, f64)> = heard.iter().filter_map(|heard| axis.of(&heard.message)).collect();
    let first = values.first().map_or(0, |(sample, _)| *sample);
    values.iter().map(|(sample, value)| (f64::from(sample.wrapping_sub(first)) / rate_hz, *value)).collect()
}

/// The least squares of a cos ωt + b sin ωt + c, by its normal equations; `None` if the points don't determine them.
fn fit(points: &Points, frequency_hz: f64) -> Option<Fit> {
    let basis = |time_s: f64| {
        let (sin, cos) = libm::sincos(TAU * frequency_hz * time_s);
        [cos, sin, 1.0]
    };
    let (mut matrix, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
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
    Some(Fit { amplitude: libm::hypot(a, b), rest })
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

/// Describes the commands, with the usual mistake that explains them, if one does.
fn explained(t: &Tester, wanted: &ExpectedSine, got: Fit, from: usize, rate_hz: f64) -> String {
    let (axis, amplitude, frequency_hz) = (wanted.axis(), wanted.amplitude(), wanted.frequency_hz);
    let (heard, unit) = (&t.heard[from..], axis.unit());
    let fitted = |points: &Points, frequency_hz| fit(points, frequency_hz).filter(Fit::is_sine);
    let expected = format!("expected are {amplitude} {unit} at {frequency_hz} Hz along {}", axis.name());
    if got.is_sine() {
        let ratio = got.amplitude / amplitude;
        let by_factor = |factor: f64| (ratio / factor - 1.0).abs() < TOLERANCE;
        let why = if by_factor(axis.factor()) {
            " Is it sent without the factor of its counts?"
        } else if by_factor(1.0 / axis.factor()) {
            " Is it divided twice by the factor of its counts?"
        } else {
            ""
        };
        return format!("it commands {:.4} {unit}, {ratio:.4} times the amplitude; {expected}.{why}", got.amplitude);
    }
    let own = points(heard, axis, rate_hz);
    let swapped: Points = own.iter().map(|(at, value)| (*at, axis.swapped(*value, t.network.profile()))).collect();
    if let Some(fit) = fitted(&swapped, frequency_hz) {
        return format!(
            "with the bytes of each value the other way round it commands {:.4} {unit}; {expected}. Is its \
             byte order wrong?",
            fit.amplitude
        );
    }
    for other in Axis::ALL.into_iter().filter(|other| *other != axis) {
        if let Some(fit) = fitted(&points(heard, other, rate_hz), frequency_hz) {
            return format!("it commands {:.4} {} along {}; {expected}", fit.amplitude, other.unit(), other.name());
        }
    }
    for ratio in [1.0 / TAU, TAU, 0.5, 2.0, 0.1, 10.0, 0.01, 100.0, 0.001, 1000.0] {
        if let Some(fit) = fitted(&own, ratio * frequency_hz).filter(|_| ratio * frequency_hz < rate_hz / 2.0) {
            return format!("it commands {:.4} {unit} at {:.4} Hz; {expected}", fit.amplitude, ratio * frequency_hz);
        }
    }
    format!(
        "its commands are no sine of this frequency: of {:.4} {unit} {:.4} {unit} rms are left; {expected}",
        got.amplitude, got.rest
    )
}
