//! The joints' angles from the accelerations: double integration in the frequency domain, then the inverse kinematics.

use core::f64::consts::TAU;

use nalgebra::{SMatrix, SVector, Vector2};

use super::ResponsePoint;
use crate::excitation::Phasor;
use resonarm_dynamics::arm::Arm;

/// Samples per period.
const SAMPLES: usize = 32;
/// Number of harmonics that are read.
const ORDERS: usize = 3;

/// Unknowns of a link: the mean of its angle, and sine and cosine of every order.
const UNKNOWNS: usize = 1 + 2 * ORDERS;
/// Known values of a link: sine and cosine of every order of its two components.
const KNOWNS: usize = 4 * ORDERS;

/// Vibration of the joints over a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointAngles {
    /// Fundamentals of α1 and α2 against the phase of the load, rad.
    pub harmonic1: [Phasor; 2],
    /// The largest |α1| and |α2| over the period, rad.
    pub amplitude_rad: [f64; 2],
    /// Whether α1 and α2 come from an accelerometer with a clipped axis. The harmonics of a clipped axis are wrong by some
    /// per cent, and the angles are then, too.
    pub clipped: [bool; 2],
}

/// Readings of a link by the accelerometers.
struct LinkReading {
    /// Harmonics of the vector from its start to its end, along x and y, m.
    vibration: [[Phasor; 2]; ORDERS],
    /// The axes that were clipped.
    clipped: [bool; 2],
    /// The vector at rest, m.
    rest: Vector2<f64>,
}

impl JointAngles {
    /// The angles in a response of `arm`.
    ///
    /// The harmonic of order h of an acceleration is −(hω)² times that of the position. The links' lengths give the
    /// rest.
    pub fn of(point: &ResponsePoint, arm: &Arm) -> JointAngles {
        let omega = TAU * point.frequency_hz;
        let position = |channel: usize, order: usize| {
            let rate = omega * order as f64;
            point.harmonic(channel, order) / -(rate * rate)
        };
        let points = arm.points(&Vector2::zeros());
        let clipped = |channel: usize| [point.clipped[channel], point.clipped[channel + 1]];
        let (b, c) = (clipped(2), clipped(4));
        let first = LinkReading {
            vibration: core::array::from_fn(|h| [position(2, h + 1), position(3, h + 1)]),
            clipped: b,
            rest: points.b_m,
        };
        let second = LinkReading {
            vibration: core::array::from_fn(|h| {
                core::array::from_fn(|axis| position(4 + axis, h + 1) - first.vibration[h][axis])
            }),
            clipped: [b[0] || c[0], b[1] || c[1]],
            rest: points.c_m - points.b_m,
        };
        let turns = [first.turn(), second.turn()];
        let angles = [turns[0], turns[1] - turns[0]];
        let (b_is_clipped, c_is_clipped) = (b.contains(&true), c.contains(&true));
        JointAngles {
            harmonic1: angles.map(|angle| Phasor::new(angle[1], angle[2])),
            amplitude_rad: angles.map(|angle| largest(&angle)),
            clipped: [b_is_clipped, b_is_clipped || c_is_clipped],
        }
    }

    /// Amplitudes of the fundamentals, rad.
    pub fn harmonic1_rad(&self) -> [f64; 2] {
        self.harmonic1.map(|phasor| libm::hypot(phasor.re, phasor.im))
    }
}

/// (1, sin θ, cos θ, sin 2θ, …) over a period.
fn phases() -> impl Iterator<Item = SVector<f64, UNKNOWNS>> {
    (0..SAMPLES).map(|k| {
        SVector::from_fn(|row, _| {
            let turn = TAU * (row.div_ceil(2) * k) as f64 / SAMPLES as f64;
            if row % 2 == 1 { libm::sin(turn) } else { libm::cos(turn) }
        })
    })
}

/// The largest |angle| over a period, for an angle with these harmonics. The peak lies between the samples: from the
/// largest sample, Newton's method finds the place where the slope is zero.
fn largest(angle: &SVector<f64, UNKNOWNS>) -> f64 {
    const STEPS: usize = 6;
    let sampled = |(k, basis): (usize, SVector<f64, UNKNOWNS>)| (k, angle.dot(&basis).abs());
    let (place, most) = phases().enumerate().map(sampled).fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    // Value, slope and curvature at a phase.
    let at = |phase: f64| {
        let orders = (1..=ORDERS).map(|order| {
            let (rate, (sine, cosine)) = (order as f64, libm::sincos(order as f64 * phase));
            let (s, c) = (angle[2 * order - 1], angle[2 * order]);
            let value = s * sine + c * cosine;
            [value, rate * (s * cosine - c * sine), -rate * rate * value]
        });
        orders.fold([angle[0], 0.0, 0.0], |sum, one| [sum[0] + one[0], sum[1] + one[1], sum[2] + one[2]])
    };
    let spacing = TAU / SAMPLES as f64;
    let start = spacing * place as f64;
    let mut phase = start;
    for _ in 0..STEPS {
        let [_, slope, curvature] = at(phase);
        if curvature != 0.0 {
            phase = (phase - slope / curvature).clamp(start - spacing, start + spacing);
        }
    }
    most.max(at(phase)[0].abs())
}

impl LinkReading {
    fn is_lost(&self) -> bool {
        self.clipped == [true, true]
    }

    /// The harmonics (1, sin θ, cos θ, …) of the link's angle of rotation, rad.
    ///
    /// Gauss–Newton's method: fits the harmonics of r (cos, sin)(rest + turn), except the means, which no accelerometer
    /// reads, to those that were read. A clipped axis has little weight beside one that is not. The mean of the angle
    /// is pulled to zero, as small vibration does not determine it.
    fn turn(&self) -> SVector<f64, UNKNOWNS> {
        const ITERATIONS: usize = 8;
        const CLIPPED: f64 = 1e-4;
        const PULL: f64 = 1e-4;
        let lost = self.is_lost();
        let weights = self.clipped.map(|clipped| if clipped && !lost { CLIPPED } else { 1.0 });
        let read: SVector<f64, KNOWNS> = SVector::from_fn(|row, _| {
            let phasor = self.vibration[row / 4][row % 4 / 2];
            if row % 2 == 0 { phasor.re } else { phasor.im }
        });
        let mut turn = SVector::<f64, UNKNOWNS>::zeros();
        for _ in 0..ITERATIONS {
            let mut missing = read;
            let mut slopes = SMatrix::<f64, KNOWNS, UNKNOWNS>::zeros();
            for basis in phases() {
                let (sine, cosine) = libm::sincos(turn.dot(&basis));
                let r =
                    Vector2::new(self.rest.x * cosine - self.rest.y * sine, self.rest.x * sine + self.rest.y * cosine);
                for row in 0..KNOWNS {
                    // 2/n Σ of the component times the sine or cosine of the row's order.
                    let projection = 2.0 / SAMPLES as f64 * basis[1 + 2 * (row / 4) + row % 2];
                    let (value, slope) = if row % 4 < 2 { (r.x, -r.y) } else { (r.y, r.x) };
                    missing[row] -= projection * value;
                    for column in 0..UNKNOWNS {
                        slopes[(row, column)] += projection * slope * basis[column];
                    }
                }
            }
            let weighted =
                SMatrix::<f64, KNOWNS, UNKNOWNS>::from_fn(|row, column| slopes[(row, column)] * weights[row % 4 / 2]);
            let mut normal = weighted.transpose() * slopes;
            let mut moment = weighted.transpose() * missing;
            let pull = PULL * self.rest.norm_squared();
            normal[(0, 0)] += pull;
            moment[0] -= pull * turn[0];
            let Some(cholesky) = normal.cholesky() else { break };
            turn += cholesky.solve(&moment);
        }
        turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_dynamics::arm::{Pose, Preset, State};

    /// Accelerations of a known motion, α = mean + Σ, harmonics by quadrature over many samples.
    #[test]
    fn finds_the_motion_from_the_accelerations() {
        const MANY: usize = 512;
        let arm = Arm::new(Preset::default().parameters().unwrap(), Pose { beta1_deg: 30.0, beta2_deg: 60.0 }).unwrap();
        let (hz, omega) = (22.0, TAU * 22.0);
        let alpha = |turn: f64| [2e-3 + 0.09 * libm::sin(turn) + 1e-3 * libm::sin(2.0 * turn), 0.05 * libm::cos(turn)];
        let mut harmonics = [[Phasor::new(0.0, 0.0); ORDERS]; 6];
        for k in 0..MANY {
            let turn = TAU * k as f64 / MANY as f64;
            let rate =
                [omega * (0.09 * libm::cos(turn) + 2e-3 * libm::cos(2.0 * turn)), -omega * 0.05 * libm::sin(turn)];
            let w2 = omega * omega;
            let acceleration = Vector2::new(
                -w2 * (0.09 * libm::sin(turn) + 4e-3 * libm::sin(2.0 * turn)),
                -w2 * 0.05 * libm::cos(turn),
            );
            let motion = arm.point_accelerations(&State::new(alpha(turn), rate), &acceleration);
            let channels = [0.0, 0.0, motion.b_m_s2.x, motion.b_m_s2.y, motion.c_m_s2.x, motion.c_m_s2.y];
            for (value, orders) in channels.iter().zip(&mut harmonics) {
                for (h, sum) in orders.iter_mut().enumerate() {
                    let (sine, cosine) = libm::sincos(turn * (h + 1) as f64);
                    *sum += Phasor::new(sine, cosine) * (2.0 * value / MANY as f64);
                }
            }
        }
        let point = ResponsePoint::of_harmonics(hz, 1.0, &harmonics);
        let angles = JointAngles::of(&point, &arm);
        let [a, b] = angles.harmonic1;
        assert!((a.re / 0.09 - 1.0).abs() < 1e-4 && a.im.abs() < 1e-5, "{a}");
        assert!((b.im / 0.05 - 1.0).abs() < 3e-4 && b.re.abs() < 1e-5, "{b}");
        let largest = (0..MANY).map(|k| alpha(TAU * k as f64 / MANY as f64)[0].abs()).fold(0.0, f64::max);
        assert!((angles.amplitude_rad[0] / largest - 1.0).abs() < 5e-3, "{angles:?} {largest}");
    }

    /// Samples of a sine miss its peak by up to 1 − cos(π/32) = 0.5 %: `compare` drew points that far below its branch.
    #[test]
    fn the_largest_angle_lies_between_the_samples() {
        for phase in [0.0, 0.03, 0.098, 0.1, 3.0] {
            let angle = SVector::<f64, UNKNOWNS>::from_column_slice(&[
                1e-4,
                0.09 * libm::sin(phase),
                0.09 * libm::cos(phase),
                0.0,
                0.0,
                0.0,
                0.0,
            ]);
            assert!((largest(&angle) / 0.0901 - 1.0).abs() < 1e-12, "{phase}: {}", largest(&angle));
        }
        assert_eq!(largest(&SVector::zeros()), 0.0);
    }

    /// One clipped axis of C makes α2 wrong by some per cent; it was drawn as settled and unmarked.
    #[test]
    fn an_angle_from_an_accelerometer_with_one_clipped_axis_is_marked() {
        let arm =
            Arm::new(Preset::default().parameters().unwrap(), Pose { beta1_deg: 20.0, beta2_deg: 100.0 }).unwrap();
        let still = ResponsePoint::of_harmonics(25.0, 25.0, &[[Phasor::new(1e-3, 0.0); ORDERS]; 6]);
        for (axis, expected) in [
            (0, [false, false]),
            (1, [false, false]),
            (2, [true, true]),
            (3, [true, true]),
            (4, [false, true]),
            (5, [false, true]),
        ] {
            let mut point = still;
            point.clipped[axis] = true;
            assert_eq!(JointAngles::of(&point, &arm).clipped, expected, "{axis}");
        }
    }
}
