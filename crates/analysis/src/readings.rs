//! Bench readings of a periodic motion: displacement, velocity and acceleration of the points B and C at the frequency
//! of the excitation.
//!
//! The load is A sin Ωt. A signal x(t) with a = 2/T ∫ x cos Ωt dt and b = 2/T ∫ x sin Ωt dt over the motion's period T
//! has the component a cos Ωt + b sin Ωt = Im(X e^{iΩt}) at Ω, with
//!
//! ```text
//! X = b + i a,        velocity iΩX,        acceleration −Ω²X
//! ```
//!
//! A motion that repeats after ν periods of the excitation has T = 2πν/Ω, and this is its component ν. B and C move by
//! the nonlinear kinematics, so that a joint's sine of amplitude c turns a link of length l with the fundamental 2 l
//! J₁(c), not l c. The sums over the samples of a period are of velocities, J(α) α̇, and X is their component over iΩ:
//! the same as from positions, but small motions are not differences of large numbers. As the load goes to zero, X goes
//! to A times the receptance of [`FrequencyResponse`](super::FrequencyResponse).

use core::f64::consts::TAU;

use nalgebra::Complex;

use super::fourier::{Basis, Harmonics, Motion};
use super::{ArmParameter, BackbonePoint, Coordinate, ForcedArm, Orbit, Oscillator, Response};
use resonarm_dynamics::arm::{Arm, State};
use resonarm_numeric::Phasor;

/// Samples of a period for each harmonic of the joints' motion. Readings are exact but for the points' harmonics from
/// 7H up, which are products of at least seven of the joints' harmonics.
const SAMPLES_PER_HARMONIC: usize = 8;
/// Fewest samples of a period: the points of links that turn by several radians have many harmonics even if the joints
/// have one.
const FEWEST_SAMPLES: usize = 64;

/// The component of a motion at the frequency of the excitation, of the joints and of the points B and C.
///
/// All are phasors against sin Ωt, the load: the real part is in phase with the load, the imaginary part leads it by
/// 90°. At small loads, the response over the load is [`FrequencyResponse::at`](super::FrequencyResponse::at).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    frequency_hz: f64,
    /// In the order of [`Response::ALL`], rad and m.
    displacement: [Phasor; 6],
}

impl Readings {
    /// The readings of a motion of `arm` by its Fourier coefficients, as those of an orbit. It repeats after `period`
    /// periods of the excitation.
    fn of_series(arm: &Arm, frequency_hz: f64, period: usize, coefficients: &[f64]) -> Readings {
        let (period, harmonics) = (period.max(1), coefficients.len() / 4);
        let count = (SAMPLES_PER_HARMONIC * harmonics.max(period)).max(FEWEST_SAMPLES).next_power_of_two();
        let mut motion = Motion::default();
        let base_rad_s = TAU * frequency_hz / period as f64;
        Basis::uniform(Harmonics::Integer(harmonics), count).synthesise(coefficients, base_rad_s, &mut motion);
        let mut sums = Sums::new(arm);
        for j in 0..count {
            let state = State { alpha_rad: motion.at(0, j), alpha_dot_rad_s: motion.at(1, j) };
            sums.add(&state, TAU * ((j * period) % count) as f64 / count as f64);
        }
        sums.finish(frequency_hz)
    }

    /// The readings of a motion on a branch of `forced` in `coordinate`.
    pub fn of_orbit(forced: &ForcedArm, coordinate: Coordinate<ArmParameter>, orbit: &Orbit) -> Readings {
        let read = |arm: &Arm| Readings::of_series(arm, orbit.frequency_hz, orbit.period, &orbit.coefficients);
        match coordinate {
            Coordinate::FrequencyHz | Coordinate::Parameter(ArmParameter::Amplitude) => read(forced.arm()),
            Coordinate::Parameter(which) => {
                let mut there = forced.clone();
                // The value was one of the arm's when the motion was solved for.
                let _ = there.set_parameter(which, orbit.value);
                read(there.arm())
            }
        }
    }

    /// The readings of a motion on a backbone of `arm`. Without dampers there is no load: the phase is against a sine
    /// in quadrature with the mode.
    pub fn of_backbone(arm: &Arm, point: &BackbonePoint) -> Readings {
        Readings::of_series(arm, point.frequency_hz, 1, &point.coefficients)
    }

    /// The frequency Ω/2π, Hz.
    pub fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// X, rad of an angle, m of a point.
    pub fn displacement(&self, of: Response) -> Phasor {
        self.displacement[of as usize]
    }

    /// iΩX, rad/s or m/s.
    pub fn velocity(&self, of: Response) -> Phasor {
        self.displacement(of) * Complex::new(0.0, TAU * self.frequency_hz)
    }

    /// −Ω²X, rad/s² or m/s².
    pub fn acceleration(&self, of: Response) -> Phasor {
        let omega = TAU * self.frequency_hz;
        self.displacement(of) * -(omega * omega)
    }
}

/// Sums of a motion's samples, evenly spaced over its period.
#[derive(Clone, Debug)]
pub(super) struct Sums<'a> {
    arm: &'a Arm,
    samples: u64,
    sums: [Phasor; 6],
}

impl<'a> Sums<'a> {
    pub fn new(arm: &'a Arm) -> Sums<'a> {
        Sums { arm, samples: 0, sums: [Complex::new(0.0, 0.0); 6] }
    }

    /// Adds the state at a phase of the excitation, rad.
    pub fn add(&mut self, state: &State, phase_rad: f64) {
        let [b, c] = self.arm.point_velocities(state);
        let joints = &state.alpha_dot_rad_s;
        let (sine, cosine) = libm::sincos(phase_rad);
        let against = Complex::new(sine, cosine);
        for (sum, velocity) in self.sums.iter_mut().zip([joints.x, joints.y, b.x, b.y, c.x, c.y]) {
            *sum += against * velocity;
        }
        self.samples += 1;
    }

    /// 2/N Σ ẋ (sin Ωt + i cos Ωt) over iΩ.
    pub fn finish(&self, frequency_hz: f64) -> Readings {
        let weight = 2.0 / (self.samples as f64 * TAU * frequency_hz);
        let displacement = self.sums.map(|sum| Complex::new(weight * sum.im, -weight * sum.re));
        Readings { frequency_hz, displacement }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Normed as _, Vector2};

    use super::*;
    use crate::tests::arm_at;
    use crate::{BackboneOptions, BranchOptions, Drive, FrequencyResponse, Quantity, backbone, modes, trace};
    use resonarm_dynamics::arm::{Load, Preset};

    fn fitted(beta1_deg: f64, beta2_deg: f64) -> Arm {
        arm_at(Preset::Irb1600Fitted, beta1_deg, beta2_deg)
    }

    fn near(got: Phasor, expected: Phasor, tolerance: f64) {
        assert!((got - expected).norm() <= tolerance, "{got}, expected {expected}");
    }

    /// Jacobi and Anger: sin(c sin τ) has the fundamental 2 J₁(c) sin τ, cos(c sin τ) none.
    #[test]
    fn one_turning_joint_gives_bessel_functions() {
        for (beta1_deg, beta2_deg) in [(0.0, 0.0), (20.0, 75.0)] {
            let arm = fitted(beta1_deg, beta2_deg);
            let rest = arm.points(&Vector2::zeros());
            for c in [1e-6, 0.3, 2.0] {
                let part = 2.0 * libm::j1(c);
                let read = Readings::of_series(&arm, 10.0, 1, &[0.0, 0.0, 0.0, 0.0, c, 0.0]);
                for (of, expected) in [
                    (Response::Alpha1, c),
                    (Response::Alpha2, 0.0),
                    (Response::BX, -part * rest.b_m.y),
                    (Response::BY, part * rest.b_m.x),
                    (Response::CX, -part * rest.c_m.y),
                    (Response::CY, part * rest.c_m.x),
                ] {
                    near(read.displacement(of), Complex::new(expected, 0.0), 2e-15 * c);
                }
                // Joint 2 alone, along the cosine: B is at rest, C turns about it a quarter of a period ahead.
                let read = Readings::of_series(&arm, 10.0, 1, &[0.0, 0.0, 0.0, c, 0.0, 0.0]);
                let link = rest.c_m - rest.b_m;
                near(read.displacement(Response::BX), Complex::new(0.0, 0.0), 2e-15 * c);
                near(read.displacement(Response::CX), Complex::new(0.0, -part * link.y), 2e-15 * c);
                near(read.displacement(Response::CY), Complex::new(0.0, part * link.x), 2e-15 * c);
            }
        }
    }

    /// For c sin 2τ + d sin τ, with τ at half the excitation's frequency, the component at 2τ of sin(c sin 2τ + d sin
    /// τ) has the coefficients of e^{±2iτ} in Σ J_m(c) J_n(d) e^{i(2m+n)τ}.
    #[test]
    fn a_doubled_motion_is_read_at_the_excitation() {
        let (arm, c, d) = (fitted(0.0, 0.0), 0.4, 0.7);
        let read = Readings::of_series(&arm, 10.0, 2, &[0.0, 0.0, 0.0, 0.0, d, 0.0, 0.0, 0.0, c, 0.0]);
        // J of negative order is (−1)^m J of the order. Terms of ±2 are of opposite sign in the imaginary part.
        let j = |m: i32, x: f64| libm::jn(m.abs(), x) * if m < 0 && m % 2 != 0 { -1.0 } else { 1.0 };
        let coefficient = |order: i32| (-20..=20).map(|m| j(m, c) * j(order - 2 * m, d)).sum::<f64>();
        let (length1, plus, minus) = (0.63, coefficient(2), coefficient(-2));
        near(read.displacement(Response::BY), Complex::new(length1 * (plus - minus), 0.0), 2e-15 * c);
        near(read.displacement(Response::BX), Complex::new(0.0, length1 * (plus + minus)), 2e-15 * c);
        near(read.displacement(Response::Alpha1), Complex::new(c, 0.0), 1e-15);
    }

    #[test]
    fn derivatives_turn_by_a_quarter() {
        let read = Readings::of_series(&fitted(0.0, 60.0), 20.0, 1, &[0.0, 0.0, 1e-3, 0.0, 2e-3, 0.0]);
        let (omega, x) = (TAU * 20.0, read.displacement(Response::CY));
        assert_eq!(read.velocity(Response::CY), Complex::new(-omega * x.im, omega * x.re));
        assert_eq!(read.acceleration(Response::CY), x * -(omega * omega));
        assert_eq!(read.frequency_hz(), 20.0);
    }

    /// `read` gives the frequency response times the load in all three quantities, within a relative tolerance.
    fn is_the_linear_response(read: &Readings, arm: &Arm, drive: Drive, load: f64, tolerance: f64) {
        let linear = FrequencyResponse::new(arm);
        for of in Response::ALL {
            for quantity in Quantity::ALL {
                let expected = linear.at(quantity, drive, of, read.frequency_hz()).unwrap() * load;
                let got = match quantity {
                    Quantity::Receptance => read.displacement(of),
                    Quantity::Mobility => read.velocity(of),
                    Quantity::Accelerance => read.acceleration(of),
                };
                for (got, expected) in [(got.re, expected.re), (got.im, expected.im)] {
                    let error = (got - expected).abs();
                    assert!(error <= tolerance * expected.abs(), "{drive} {of} {quantity}: {got}, expected {expected}");
                }
            }
        }
    }

    /// Off resonance and within the half-power width, 0.004 Hz; a negative load is one against sin Ωt.
    #[test]
    fn a_small_load_gives_the_linear_response() {
        let arm = fitted(35.0, 60.0);
        let natural_hz = modes(&arm)[0].frequency_hz;
        for (drive, direction, amplitude) in [
            (Drive::Torque1, Load::torque_nm(1.0, 0.0), 1e-3),
            (Drive::ForceX, Load::force_n(1.0, 0.0), 1e-3),
            (Drive::ForceY, Load::force_n(0.0, 1.0), -1e-3),
        ] {
            let forced = ForcedArm::new(arm.clone(), direction, amplitude);
            for (from, to) in [(10.0, 10.5), (natural_hz - 5e-3, natural_hz + 5e-3), (47.0, 47.5)] {
                let branch =
                    trace(forced.clone(), from, Coordinate::FrequencyHz, &BranchOptions::new(from, to)).unwrap();
                for orbit in &branch.orbits {
                    let read = Readings::of_orbit(&forced, Coordinate::FrequencyHz, orbit);
                    is_the_linear_response(&read, &arm, drive, amplitude, 1e-5);
                }
            }
        }
    }

    /// So does the foot of a backbone, where the mode lags by 90°.
    #[test]
    fn the_foot_of_a_backbone_is_the_linear_response() {
        let arm = fitted(35.0, 60.0);
        let forced = ForcedArm::new(arm.clone(), Load::force_n(1.0, 0.0), 0.0);
        let branch = BranchOptions::new(10.0, 100.0);
        let options = BackboneOptions { smallest_rad: 1e-6, largest_rad: 2e-6, largest_drive: f64::INFINITY, branch };
        let curve = backbone(forced, 0, ArmParameter::Amplitude, &options).unwrap();
        let read = Readings::of_backbone(&arm, &curve.points[0]);
        is_the_linear_response(&read, &arm, Drive::ForceX, curve.points[0].drive, 1e-4);
        let x = read.displacement(Response::CX);
        assert!(x.im < 0.0 && x.re.abs() < 1e-2 * x.im.abs(), "{x}");
    }

    /// On a branch in a parameter of the arm, readings use the arm with that value.
    #[test]
    fn a_branch_in_an_angle_is_read_at_its_pose() {
        let forced = ForcedArm::new(fitted(20.0, 60.0), Load::torque_nm(1.0, 0.0), 1e-3);
        let beta2 = Coordinate::Parameter(ArmParameter::Beta2Deg);
        let branch = trace(forced.clone(), 10.0, beta2, &BranchOptions::new(60.0, 100.0)).unwrap();
        let last = branch.orbits.last().unwrap();
        let read = Readings::of_orbit(&forced, beta2, last);
        is_the_linear_response(&read, &fitted(20.0, last.value), Drive::Torque1, 1e-3, 1e-5);
    }
}
