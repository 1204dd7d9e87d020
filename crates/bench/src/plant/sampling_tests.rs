//! The converters' samples against the same motion read on a fine grid.

use super::tests::{SHAKER, preset, shaken, tested};
use super::*;
use crate::rig::{Amplifier, Converter, ShakerSpec};
use nalgebra::{Matrix2, Vector2};
use resonarm_dynamics::structure::{Link, Preset};

/// Fine samples a hold. A transient that decays e^−6.6-fold over a hold is summed to (6.6/1600)²/24 = 7e-7.
const FINE: u32 = 1600;
const HOLDS: usize = 30;

fn load(hold: usize) -> Load {
    let force_n = [40.0, -25.0, 10.0, 60.0, -5.0, 0.0, -70.0][hold % 7];
    Load::planar([0.0; 2], (SHAKER.direction() * force_n).into())
}

fn spec(shaker: Option<ShakerSpec>, converter: Converter, steps_per_sample: u32) -> PlantSpec {
    let base = shaken(shaker.unwrap_or(SHAKER));
    PlantSpec { rig: RigSpec { shaker, converter, ..base.rig }, steps_per_sample, ..base }
}

const ANGLES_DEG: [f64; 2] = [17.3, 101.7];

/// α and α̇ at the beginning.
const INITIAL: [[f64; 2]; 2] = [[2e-3, -1e-3], [0.1, 0.3]];

/// A plant of the fitted arm in the state [`INITIAL`].
fn plant(spec: &PlantSpec) -> Plant {
    Plant::new(spec, &TestedAssembly { initial: INITIAL.concat(), ..preset(ANGLES_DEG) }).unwrap()
}

/// Two links with the armature of a shaker at the tip, by Eq. (3) of Gierlak & Warmiński 2023, without gravity:
///
/// ```text
/// M α̈ + C α̇ + D α̇ + K α = Jᵀ (F − e (m s̈ + c ṡ + k s))
/// ```
///
/// with the unit vector e along the shaker and the displacement s of the tip along it.
struct TwoLinks {
    links: [Link; 2],
    shaker: Option<ShakerSpec>,
}

#[derive(Clone, Copy)]
struct State {
    alpha_rad: Vector2<f64>,
    alpha_dot_rad_s: Vector2<f64>,
    current_a: f64,
}

/// The tip at a state: where it is, and how its velocity depends on the rates of the joints.
struct Tip {
    position_m: Vector2<f64>,
    jacobian_m: Matrix2<f64>,
    /// The part of its acceleration that the rates alone cause, m/s²; that of the elbow.
    drift_m_s2: Vector2<f64>,
    elbow_drift_m_s2: Vector2<f64>,
    /// The elbow from joint 1, m.
    elbow_m: Vector2<f64>,
}

impl TwoLinks {
    fn new(shaker: Option<ShakerSpec>) -> TwoLinks {
        let chain = Preset::default().chain().unwrap().at_angles_deg(&ANGLES_DEG);
        TwoLinks { links: chain.links.try_into().unwrap(), shaker }
    }

    fn tip(&self, state: &State) -> Tip {
        let [one, two] = &self.links;
        let first = one.angle_deg.to_radians() + state.alpha_rad.x;
        let second = first + two.angle_deg.to_radians() + state.alpha_rad.y;
        let along = |angle: f64, length_m: f64| Vector2::new(libm::cos(angle), libm::sin(angle)) * length_m;
        let (elbow_m, forearm_m) = (along(first, one.length_m), along(second, two.length_m));
        let across = |link: Vector2<f64>| Vector2::new(-link.y, link.x);
        let rates = state.alpha_dot_rad_s;
        let elbow_drift_m_s2 = -elbow_m * rates.x * rates.x;
        Tip {
            position_m: elbow_m + forearm_m,
            jacobian_m: Matrix2::from_columns(&[across(elbow_m) + across(forearm_m), across(forearm_m)]),
            drift_m_s2: elbow_drift_m_s2 - forearm_m * (rates.x + rates.y) * (rates.x + rates.y),
            elbow_drift_m_s2,
            elbow_m,
        }
    }

    /// Returns the rate ṡ of the armature's stroke, m/s.
    fn stroke_rate_m_s(&self, state: &State) -> f64 {
        self.shaker.map_or(0.0, |shaker| shaker.direction().dot(&(self.tip(state).jacobian_m * state.alpha_dot_rad_s)))
    }

    /// c ṡ + k s, N.
    fn suspension_n(&self, shaker: &ShakerSpec, state: &State) -> f64 {
        let rest = State { alpha_rad: Vector2::zeros(), ..*state };
        let moved_m = self.tip(state).position_m - self.tip(&rest).position_m;
        shaker.damping_n_s_m * self.stroke_rate_m_s(state) + shaker.stiffness_n_m * shaker.direction().dot(&moved_m)
    }

    /// α̈ under a force on the tip, or on the armature.
    fn acceleration_rad_s2(&self, state: &State, force_n: &Vector2<f64>) -> Vector2<f64> {
        let ([one, two], x, v, tip) = (&self.links, state.alpha_rad, state.alpha_dot_rad_s, self.tip(state));
        let a3 = two.inertia_kg_m2 + two.mass_kg * two.centre_of_mass_m * two.centre_of_mass_m;
        let a2 = two.mass_kg * one.length_m * two.centre_of_mass_m;
        let own = one.inertia_kg_m2 + one.mass_kg * one.centre_of_mass_m * one.centre_of_mass_m;
        let a1 = own + a3 + two.mass_kg * one.length_m * one.length_m;
        let (sine, cosine) = libm::sincos(two.angle_deg.to_radians() + x.y);
        let (h, t) = (a2 * sine, a2 * cosine);
        let mut mass = Matrix2::new(a1 + 2.0 * t, a3 + t, a3 + t, a3);
        let joint = |link: &Link, x: f64, v: f64| link.stiffness_nm_rad * x + link.damping_nm_s_rad * v;
        let mut torque = tip.jacobian_m.transpose() * force_n
            - Vector2::new(joint(one, x.x, v.x), joint(two, x.y, v.y))
            + Vector2::new(h * v.y * (2.0 * v.x + v.y), -h * v.x * v.x);
        if let Some(shaker) = &self.shaker {
            let w = tip.jacobian_m.transpose() * shaker.direction();
            let drift_m_s2 = shaker.direction().dot(&tip.drift_m_s2);
            mass += w * w.transpose() * shaker.moving_mass_kg;
            torque -= w * (shaker.moving_mass_kg * drift_m_s2 + self.suspension_n(shaker, state));
        }
        mass.try_inverse().unwrap() * torque
    }

    /// The force on the tip or the armature, N: in voltage mode the coil's by its current, which without inductance is
    /// V/R − Bl ṡ/R.
    fn force_n(&self, state: &State, command: &Load) -> Vector2<f64> {
        let voltage = |shaker: &ShakerSpec| shaker.amplifier == Amplifier::Voltage;
        let Some(shaker) = self.shaker.filter(voltage) else { return command.force_n.xy() };
        let bl = shaker.force_factor_n_a;
        let steady_a = shaker.along_n(command) / bl - bl * self.stroke_rate_m_s(state) / shaker.resistance_ohm;
        shaker.direction() * (bl * if shaker.inductance_h == 0.0 { steady_a } else { state.current_a })
    }

    /// Force in the head, N, and accelerations of B and C, m/s², along x and y. The head is between tip and armature.
    fn instant(&self, state: &State, command: &Load) -> [f64; 6] {
        let (force_n, tip) = (self.force_n(state, command), self.tip(state));
        let a = self.acceleration_rad_s2(state, &force_n);
        let b = Vector2::new(-tip.elbow_m.y, tip.elbow_m.x) * a.x + tip.elbow_drift_m_s2;
        let c = tip.jacobian_m * a + tip.drift_m_s2;
        let head_n = self.shaker.map_or(force_n, |shaker| {
            let e = shaker.direction();
            force_n - e * (shaker.moving_mass_kg * e.dot(&c) + self.suspension_n(&shaker, state))
        });
        [head_n.x, head_n.y, b.x, b.y, c.x, c.y]
    }

    /// α̇, α̈ and di/dt.
    fn rates(&self, state: &State, command: &Load) -> State {
        let coil = self.shaker.filter(|shaker| shaker.inductance_h > 0.0);
        let current_a_s = coil.map_or(0.0, |shaker| {
            let (bl, r) = (shaker.force_factor_n_a, shaker.resistance_ohm);
            (shaker.along_n(command) / bl * r - r * state.current_a - bl * self.stroke_rate_m_s(state))
                / shaker.inductance_h
        });
        let acceleration_rad_s2 = self.acceleration_rad_s2(state, &self.force_n(state, command));
        State { alpha_rad: state.alpha_dot_rad_s, alpha_dot_rad_s: acceleration_rad_s2, current_a: current_a_s }
    }

    /// A step of the classical Runge-Kutta method.
    fn step(&self, start: &State, command: &Load, h: f64) -> State {
        let moved = |rates: &State, t: f64| State {
            alpha_rad: start.alpha_rad + rates.alpha_rad * t,
            alpha_dot_rad_s: start.alpha_dot_rad_s + rates.alpha_dot_rad_s * t,
            current_a: start.current_a + rates.current_a * t,
        };
        let a = self.rates(start, command);
        let b = self.rates(&moved(&a, 0.5 * h), command);
        let c = self.rates(&moved(&b, 0.5 * h), command);
        let d = self.rates(&moved(&c, h), command);
        let mean = State {
            alpha_rad: (a.alpha_rad + (b.alpha_rad + c.alpha_rad) * 2.0 + d.alpha_rad) / 6.0,
            alpha_dot_rad_s: (a.alpha_dot_rad_s + (b.alpha_dot_rad_s + c.alpha_dot_rad_s) * 2.0 + d.alpha_dot_rad_s)
                / 6.0,
            current_a: (a.current_a + 2.0 * (b.current_a + c.current_a) + d.current_a) / 6.0,
        };
        moved(&mean, h)
    }
}

/// The motion under the same loads at 1600 instants of every hold, channels by fine samples: links and coil integrated
/// together, with two steps from instant to instant.
fn fine(shaker: Option<ShakerSpec>) -> Vec<[f64; 6]> {
    let arm = TwoLinks::new(shaker);
    let [alpha_rad, alpha_dot_rad_s] = INITIAL.map(Vector2::from);
    let mut state = State { alpha_rad, alpha_dot_rad_s, current_a: 0.0 };
    let h = 0.5e-3 / f64::from(FINE);
    let mut all = Vec::new();
    for index in 0..HOLDS * FINE as usize {
        let command = load(index / FINE as usize);
        state = arm.step(&state, &command, h);
        all.push(arm.instant(&state, &command));
        state = arm.step(&state, &command, h);
    }
    all
}

/// The readings of every sample by sums over the fine ones; before sample 0 all values were those of the start.
fn expected(converter: Converter, fine: &[[f64; 6]], began: [f64; 6]) -> Vec<[f64; 6]> {
    let n = FINE as usize;
    let weight = |piece: usize, k: usize| converter.piece(piece, (k as f64 + 0.5) / n as f64)[0] / n as f64;
    let at = |sample: usize, piece: usize, k: usize| match sample.checked_sub(piece + 1) {
        Some(hold) => fine[hold * n + k],
        None => began,
    };
    let reading = |sample: usize| {
        let mut sum = [0.0; 6];
        for piece in 0..converter.order() {
            for k in 0..n {
                let (weight, values) = (weight(piece, k), at(sample, piece, k));
                sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        sum
    };
    (0..=HOLDS).map(reading).collect()
}

fn seen(spec: &PlantSpec) -> Vec<[f64; 6]> {
    let mut plant = plant(spec);
    let mut readings = vec![plant.measure().readings().map(|reading| reading.value)];
    for hold in 0..HOLDS {
        plant.advance(&load(hold)).unwrap();
        readings.push(plant.measure().readings().map(|reading| reading.value));
    }
    readings
}

#[test]
fn readings_are_the_weighted_means_of_the_continuous_motion() {
    let voltage = |inductance_h| Some(ShakerSpec { amplifier: Amplifier::Voltage, inductance_h, ..SHAKER });
    let shakers = [None, Some(SHAKER), voltage(0.0), voltage(3e-4), voltage(2.1e-3)];
    for shaker in shakers {
        let fine = fine(shaker);
        let largest = fine.iter().flatten().fold(0.0_f64, |most, value| most.max(value.abs()));
        for converter in [Converter::Sinc1, Converter::Sinc3, Converter::Sinc5] {
            for steps_per_sample in [2, 6] {
                let spec = spec(shaker, converter, steps_per_sample);
                // The arm's response to a transient of the coil is left out.
                let has_transient = shaker.is_some_and(|shaker| shaker.inductance_h > 0.0);
                let bound = if has_transient && steps_per_sample == 2 { 1e-5 } else { 2e-6 };
                let seen = seen(&spec);
                let expected = expected(converter, &fine, seen[0]);
                for (sample, (seen, expected)) in seen.iter().zip(&expected).enumerate() {
                    for (channel, (seen, expected)) in seen.iter().zip(expected).enumerate() {
                        let which = (shaker.map(|shaker| shaker.inductance_h), converter, steps_per_sample);
                        let off = (seen - expected).abs() / largest;
                        assert!(off < bound, "{which:?}, sample {sample}, channel {channel}: {seen} {expected}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_plant_at_rest_reads_constant_values_from_the_first_sample() {
    for converter in Converter::ALL {
        let at_rest = preset(ANGLES_DEG);
        let mut plant = Plant::new(&spec(None, converter, 2), &at_rest).unwrap();
        for _ in 0..8 {
            assert!(plant.measure().readings().iter().all(|reading| reading.value.abs() < 1e-12));
            plant.advance(&Load::default()).unwrap();
        }
    }
}

/// The mean of an acceleration over a hold is the change of velocity, exactly.
#[test]
fn the_mean_over_a_hold_is_the_change_of_velocity() {
    let spec = spec(None, Converter::Sinc1, 2);
    let (assembly, mut plant) = (preset(ANGLES_DEG).assembly, plant(&spec));
    let velocities = |plant: &Plant| {
        let (x, v) = (plant.states().coordinates(), plant.states().rates());
        ["joint2.x", "joint2.y", "tip.x", "tip.y"].map(|name| assembly.at(x).velocity(assembly.dof(name).unwrap(), v))
    };
    for hold in 0..HOLDS {
        let before = velocities(&plant);
        plant.advance(&load(hold)).unwrap();
        let after = velocities(&plant);
        let [_, _, means @ ..] = plant.measure().readings().map(|reading| reading.value);
        for (channel, mean) in means.iter().enumerate() {
            let change = (after[channel] - before[channel]) * 1000.0;
            assert!((mean - change).abs() < 1e-9 * (1.0 + change.abs()), "{hold} {channel}: {mean} {change}");
        }
    }
}

/// The converters do not change the motion.
#[test]
fn states_have_the_same_bits_whatever_the_converter() {
    let tested = tested(Preset::Irb1600Table1.chain().unwrap().at_angles_deg(&ANGLES_DEG));
    let states = Converter::ALL.map(|converter| {
        let mut plant = Plant::new(&spec(Some(SHAKER), converter, 2), &tested).unwrap();
        (0..HOLDS).for_each(|hold| plant.advance(&load(hold)).unwrap());
        *plant.states()
    });
    assert!(states.iter().all(|state| *state == states[0]));
}
