//! The converters' samples against the same motion read on a fine grid.

use super::tests::{SHAKER, chain, shaken};
use super::*;
use crate::rig::{Amplifier, Converter, ShakerSpec};
use nalgebra::Vector2;
use resonarm_dynamics::arm::{Arm, Pose, Preset, State};

/// Fine samples a hold. A transient that decays e^−6.6-fold over a hold is summed to (6.6/1600)²/24 = 7e-7.
const FINE: u32 = 1600;
const HOLDS: usize = 30;

fn load(hold: usize) -> Load {
    let force_n = [40.0, -25.0, 10.0, 60.0, -5.0, 0.0, -70.0][hold % 7];
    Load { force_n: SHAKER.direction() * force_n, ..Load::default() }
}

fn spec(shaker: Option<ShakerSpec>, converter: Converter, steps_per_sample: u32) -> PlantSpec {
    let base = shaken(shaker.unwrap_or(SHAKER));
    PlantSpec { rig: RigSpec { shaker, converter, ..base.rig }, steps_per_sample, ..base }
}

const POSE: Pose = Pose { beta1_deg: 17.3, beta2_deg: 101.7 };

/// α and α̇ at the beginning.
const INITIAL: [[f64; 2]; 2] = [[2e-3, -1e-3], [0.1, 0.3]];

fn arm(preset: Preset) -> Arm {
    Arm::new(preset.parameters().unwrap(), POSE).unwrap()
}

/// The arm as a chain, from its beginning.
fn plant(spec: &PlantSpec) -> Plant {
    let tested = TestedAssembly { initial: INITIAL.concat(), ..chain(arm(Preset::default()).parameters(), POSE) };
    Plant::new(spec, &tested).unwrap()
}

/// Force in the head, N, and accelerations of B and C, m/s², along x and y, at a state of the arm with its attachment;
/// `load` acts on both, and the head is between them.
fn instant(arm: &Arm, state: &State, load: &Load) -> [f64; 6] {
    let acceleration_rad_s2 = arm.acceleration(state, load);
    let motion = arm.point_accelerations(state, &acceleration_rad_s2);
    let head_n = load.force_n - arm.attachment_force_n(state, &acceleration_rad_s2);
    [head_n.x, head_n.y, motion.b_m_s2.x, motion.b_m_s2.y, motion.c_m_s2.x, motion.c_m_s2.y]
}

/// The motion under the same loads at 1600 instants of every hold, channels by fine samples: arm and coil integrated
/// together by the classical Runge-Kutta method, with two steps from instant to instant.
fn fine(shaker: Option<ShakerSpec>) -> Vec<[f64; 6]> {
    let alone = arm(Preset::default());
    let arm = match shaker {
        Some(shaker) => alone.with_attachment(shaker.armature()).unwrap(),
        None => alone,
    };
    let [alpha_rad, alpha_dot_rad_s] = INITIAL;
    let (mut state, mut current_a) = (State::new(alpha_rad, alpha_dot_rad_s), 0.0);
    let h = 0.5e-3 / f64::from(FINE);
    let mut all = Vec::new();
    for index in 0..HOLDS * FINE as usize {
        let command = load(index / FINE as usize);
        for half in [true, false] {
            (state, current_a) = runge_kutta(&arm, shaker.as_ref(), &command, (state, current_a), h);
            if half {
                all.push(instant(&arm, &state, &acting(shaker.as_ref(), &arm, &state, &command, current_a)));
            }
        }
    }
    all
}

/// The coil's force, in voltage mode from the current, which without inductance is V/R − Bl ṡ/R.
fn acting(shaker: Option<&ShakerSpec>, arm: &Arm, state: &State, command: &Load, current_a: f64) -> Load {
    let Some(shaker) = shaker.filter(|shaker| shaker.amplifier == Amplifier::Voltage) else { return *command };
    let bl = shaker.force_factor_n_a;
    let steady_a = shaker.along_n(command) / bl - bl * arm.attachment_motion(state).1 / shaker.resistance_ohm;
    let current_a = if shaker.inductance_h == 0.0 { steady_a } else { current_a };
    Load { force_n: shaker.direction() * (bl * current_a), ..Load::default() }
}

fn runge_kutta(arm: &Arm, shaker: Option<&ShakerSpec>, command: &Load, start: (State, f64), h: f64) -> (State, f64) {
    let rates = |(state, current_a): (State, f64)| {
        let acceleration = arm.acceleration(&state, &acting(shaker, arm, &state, command, current_a));
        let coil = shaker.filter(|shaker| shaker.inductance_h > 0.0).map_or(0.0, |shaker| {
            let bl = shaker.force_factor_n_a;
            let volts = shaker.along_n(command) / bl * shaker.resistance_ohm;
            (volts - shaker.resistance_ohm * current_a - bl * arm.attachment_motion(&state).1) / shaker.inductance_h
        });
        (state.alpha_dot_rad_s, acceleration, coil)
    };
    type Slope = (Vector2<f64>, Vector2<f64>, f64);
    let moved = |slope: &Slope, t: f64| {
        let (state, current_a) = start;
        let alpha_rad = state.alpha_rad + slope.0 * t;
        (State { alpha_rad, alpha_dot_rad_s: state.alpha_dot_rad_s + slope.1 * t }, current_a + slope.2 * t)
    };
    let a = rates(start);
    let b = rates(moved(&a, 0.5 * h));
    let c = rates(moved(&b, 0.5 * h));
    let d = rates(moved(&c, h));
    let mean = (
        (a.0 + (b.0 + c.0) * 2.0 + d.0) / 6.0,
        (a.1 + (b.1 + c.1) * 2.0 + d.1) / 6.0,
        (a.2 + 2.0 * (b.2 + c.2) + d.2) / 6.0,
    );
    moved(&mean, h)
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
fn a_plant_at_rest_under_gravity_reads_constant_values_from_the_first_sample() {
    for converter in Converter::ALL {
        let at_rest = chain(arm(Preset::default()).parameters(), POSE);
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
    let (arm, mut plant) = (arm(Preset::default()), plant(&spec));
    for hold in 0..HOLDS {
        let before = arm.point_velocities(&plant.states().arm());
        plant.advance(&load(hold)).unwrap();
        let after = arm.point_velocities(&plant.states().arm());
        let [_, _, bx, by, cx, cy] = plant.measure().readings().map(|reading| reading.value);
        for (mean, change) in [([bx, by], after[0] - before[0]), ([cx, cy], after[1] - before[1])] {
            assert!((Vector2::from(mean) - change * 1000.0).norm() < 1e-9 * (1.0 + change.norm() * 1000.0));
        }
    }
}

/// The converters do not change the motion.
#[test]
fn states_have_the_same_bits_whatever_the_converter() {
    let tested = chain(arm(Preset::Irb1600Table1).parameters(), POSE);
    let states = Converter::ALL.map(|converter| {
        let mut plant = Plant::new(&spec(Some(SHAKER), converter, 2), &tested).unwrap();
        (0..HOLDS).for_each(|hold| plant.advance(&load(hold)).unwrap());
        *plant.states()
    });
    assert!(states.iter().all(|state| *state == states[0]));
}
