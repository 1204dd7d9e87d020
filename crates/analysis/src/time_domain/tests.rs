use core::f64::consts::TAU;

use nalgebra::{Normed as _, Vector2};

use super::*;
use crate::tests::arm_at;
use crate::{
    ArmParameter, Bifurcation, BifurcationKind, BranchOptions, Coordinate, ForcedArm, FrequencyResponse, Orbit, trace,
};
use resonarm_dynamics::arm::{Arm, Load, Parameters, Pose, Preset, Sine, State};
use resonarm_dynamics::integrate::{Integrator, Scheme};

fn fitted(beta2_deg: f64) -> Arm {
    arm_at(Preset::Irb1600Fitted, 0.0, beta2_deg)
}

fn frequency_sweep(torque1_nm: f64, (from, to, points): (f64, f64, u32), direction: Direction) -> Sweep {
    let parameter = SweepParameter::Frequency { amplitude: Load::torque_nm(torque1_nm, 0.0) };
    Sweep { parameter, grid: Grid::new(from, to, points).unwrap(), direction }
}

/// The whole sweep from rest, with its values.
fn swept(arm: &Arm, sweep: &Sweep) -> Vec<(f64, Settled)> {
    let mut state = State::default();
    let respond = |(value, sine)| {
        let map = StroboscopicMap::new(arm, sine).unwrap();
        let settled = settled_from(&map, &state);
        state = settled.end;
        (value, settled)
    };
    sweep.values().into_iter().zip(sweep.sines()).map(respond).collect()
}

fn settled_from(map: &StroboscopicMap, start: &State) -> Settled {
    settle(map, start, &SettleOptions::default(), &|| false).unwrap()
}

/// Nothing but integration, for so many time constants.
fn plain(map: &StroboscopicMap, start: &State, time_constants: f64) -> State {
    let periods = (time_constants * map.time_constant_periods()).ceil() as u64;
    (0..periods).fold(*start, |state, _| map.advance(&state).unwrap())
}

/// At small amplitudes the response is that of the linearised arm, for a torque and for a force, around both
/// resonances.
#[test]
fn small_motions_are_those_of_the_linear_arm() {
    for (preset, hz) in [
        (Preset::Irb1600Fitted, vec![5.0, 15.0, 22.1575, 22.3, 40.0, 48.9, 70.0]),
        (Preset::Irb1600Table1, vec![10.0, 23.64, 60.0]),
    ] {
        let arm = arm_at(preset, 35.0, 60.0);
        let response = FrequencyResponse::new(&arm);
        for amplitude in [
            Load::torque_nm(1e-6, 0.0),
            Load::force_n(1e-6, -2e-6),
            Load { torque_nm: [0.0, 1e-6].into(), ..Load::default() },
        ] {
            for frequency_hz in hz.iter().copied() {
                let map = StroboscopicMap::new(&arm, Sine { amplitude, frequency_hz }).unwrap();
                let settled = settled_from(&map, &State::default());
                let force = arm.generalised_force(&Vector2::zeros(), &amplitude);
                let h = response.receptance_matrix(frequency_hz).unwrap();
                let size = h.norm() * force.norm();
                for i in 0..2 {
                    let expected = (h[(i, 0)] * force.x + h[(i, 1)] * force.y).norm();
                    for got in [settled.harmonic1_rad[i], settled.amplitude_rad[i]] {
                        assert!(
                            (got - expected).abs() < 1e-8 * size,
                            "{preset} {frequency_hz} Hz α{i}: {got} {expected}"
                        );
                    }
                }
                assert_eq!(settled.period, Some(1));
            }
        }
    }
}

/// 60 N·m at joint 1, β2 = 60°: up, the motion jumps where the lower branch ends, 22.1349 Hz; down, where the upper one
/// ends, 22.0635 Hz (`tests/oracles/oracles.json`): within one step of 2 mHz of the fold. (With steps of 4 mHz the jump
/// down comes earlier: the step itself disturbs the motion off the branch.)
#[test]
fn up_and_down_show_the_hysteresis_between_the_folds() {
    let jump = |direction| {
        let points = swept(&fitted(60.0), &frequency_sweep(60.0, (22.04, 22.2, 81), direction));
        assert!(points.iter().all(|(_, settled)| settled.period == Some(1) && settled.drift < 1e-9));
        let jumps: Vec<_> = points
            .windows(2)
            .filter(|pair| {
                let ratio = pair[1].1.amplitude_rad[0] / pair[0].1.amplitude_rad[0];
                !(0.5..2.0).contains(&ratio)
            })
            .map(|pair| (pair[0].0, pair[1].0))
            .collect();
        assert_eq!(jumps.len(), 1, "{jumps:?}");
        jumps[0]
    };
    let (before, after) = jump(Direction::Up);
    assert!(before < 22.134_917_658 && 22.134_917_658 < after, "{before} {after}");
    let (before, after) = jump(Direction::Down);
    assert!(before > 22.063_474_107 && 22.063_474_107 > after, "{before} {after}");
}

/// The state at phase 0 of a motion of the branch.
fn start_of(orbit: &Orbit) -> State {
    let mut state = State::new([orbit.coefficients[0], orbit.coefficients[1]], [0.0; 2]);
    for (k, pair) in orbit.coefficients[2..].chunks_exact(4).enumerate() {
        for joint in 0..2 {
            state.alpha_rad[joint] += pair[joint];
            state.alpha_dot_rad_s[joint] += (k + 1) as f64 * TAU * orbit.frequency_hz * pair[2 + joint];
        }
    }
    state
}

/// Against harmonic balance: from near a stable motion of the branch the arm settles on it, with its amplitudes and its
/// multiplier; from an unstable one it moves away to a stable one.
#[test]
fn settles_on_the_stable_branches() {
    let arm = fitted(60.0);
    let forced = ForcedArm::new(arm.clone(), Load::torque_nm(1.0, 0.0), 60.0);
    let branch = trace(forced, 22.0, Coordinate::FrequencyHz, &BranchOptions::new(22.0, 22.25)).unwrap();
    let (mut stable, mut unstable) = (0, 0);
    for orbit in &branch.orbits {
        let sine = Sine { amplitude: Load::torque_nm(60.0, 0.0), frequency_hz: orbit.frequency_hz };
        let map = StroboscopicMap::new(&arm, sine).unwrap();
        let start = start_of(orbit);
        let settled = settled_from(&map, &State::new((start.alpha_rad * 1.0001).into(), start.alpha_dot_rad_s.into()));
        let error = (settled.amplitude_rad[0] / orbit.amplitude_rad[0] - 1.0).abs();
        if orbit.is_stable() {
            stable += 1;
            let multiplier = orbit.multipliers()[0].norm_sqr().sqrt();
            let harmonic_error = (settled.harmonic1_rad[1] / orbit.harmonic1_rad[1] - 1.0).abs();
            assert!(error < 1e-6 && harmonic_error < 1e-6, "{} Hz: {error} {harmonic_error}", orbit.frequency_hz);
            assert!((settled.largest_multiplier.unwrap() - multiplier).abs() < 1e-7, "{multiplier} {settled:?}");
        } else if branch.bifurcations.iter().all(|fold| (fold.orbit.frequency_hz - orbit.frequency_hz).abs() > 1e-5) {
            unstable += 1;
            assert!(error > 1e-3 && settled.period == Some(1), "{} Hz: {error}", orbit.frequency_hz);
        }
    }
    assert!(stable > 10 && unstable > 3, "{stable} {unstable}");
}

/// The shortcut ends where integration alone ends: before the jump, through it, after it, and from rest into a
/// resonance with two stable motions.
#[test]
fn ends_where_plain_integration_ends() {
    let arm = fitted(60.0);
    let amplitude = Load::torque_nm(60.0, 0.0);
    let map = |frequency_hz| StroboscopicMap::new(&arm, Sine { amplitude, frequency_hz }).unwrap();
    let before = settled_from(&map(22.134), &settled_from(&map(22.12), &State::new([0.02, 0.016], [0.0; 2])).end).end;
    let cases =
        [(22.1345, before), (22.136, before), (22.10, State::default()), (22.07, State::new([0.2, 0.1], [3.0, 5.0]))];
    for (frequency_hz, start) in cases {
        let map = map(frequency_hz);
        let settled = settled_from(&map, &start);
        let truth = plain(&map, &start, 25.0);
        let error = (map.to_point(&settled.end) - map.to_point(&truth)).norm() / map.to_point(&truth).norm();
        assert!(error < 1e-8, "{frequency_hz} Hz: {error} {settled:?}");
        assert!((settled.settling_periods as f64) < 8.0 * map.time_constant_periods(), "{settled:?}");
    }
}

/// A settled motion closes after its period, by another scheme with far smaller steps too: the errors of single periods
/// of the map add up to less than 1e-8 of the amplitude over a time constant.
#[test]
fn settled_motion_closes_by_another_scheme() {
    for (beta2_deg, torque1_nm, frequency_hz, period) in
        [(60.0, 60.0, 22.15, 1), (120.0, 60.0, 26.82, 1), (30.0, 100.0, 55.6, 1), (75.0, 300.0, 46.3, 2)]
    {
        let arm = fitted(beta2_deg);
        let sine = Sine { amplitude: Load::torque_nm(torque1_nm, 0.0), frequency_hz };
        let map = StroboscopicMap::new(&arm, sine).unwrap();
        // Into the subharmonic motion by a start of about its size.
        let start = if period == 1 { State::default() } else { State::new([0.05, -0.05], [5.0, 5.0]) };
        let settled = settled_from(&map, &start);
        assert_eq!(settled.period, Some(period), "{settled:?}");
        let steps = 1000 * period;
        let rate_hz = 1000.0 * frequency_hz;
        let integrator = Integrator::new(Scheme::Gl6, rate_hz, &arm).unwrap();
        let mut largest = [0.0_f64; 2];
        let end = (0..steps).fold(settled.end, |state, k| {
            largest = [0, 1].map(|i| largest[i].max(state.alpha_rad[i].abs()));
            integrator.step(&arm, f64::from(k) / rate_hz, &state, &sine).unwrap()
        });
        let size = map.to_point(&end).norm();
        let error = (map.to_point(&end) - map.to_point(&settled.end)).norm() / size;
        assert!(error < 1e-8 / map.time_constant_periods(), "{beta2_deg}°: {error}");
        for (amplitude, largest) in settled.amplitude_rad.iter().zip(&largest) {
            // Between samples of 1/1000 of a period the peak is missed by at most (nπ/1000)²/2 of harmonic n.
            let missed = amplitude / largest - 1.0;
            assert!((0.0..1e-4).contains(&missed), "{beta2_deg}°: {missed}");
        }
    }
}

/// The motion between the folds of a period doubling, found up and down, is twice as long and has two points in the
/// section.
#[test]
fn finds_the_doubled_motion() {
    let points = swept(&fitted(75.0), &frequency_sweep(300.0, (46.15, 46.45, 7), Direction::Up));
    let periods: Vec<_> = points.iter().map(|(_, settled)| settled.period.unwrap()).collect();
    assert_eq!(periods, [1, 1, 2, 2, 2, 2, 2]);
    for (_, settled) in &points {
        assert_eq!(settled.section.len(), settled.period.unwrap() as usize);
        assert!(settled.largest_multiplier.unwrap() < 1.0);
        // A motion of half the excitation's frequency is not its first harmonic.
        let share = settled.harmonic1_rad[0] / settled.amplitude_rad[0];
        assert_eq!(share < 0.9, settled.period == Some(2), "{share}");
    }
}

/// Between two Neimark–Sacker points, which harmonic balance locates at the 1:2 internal resonance, the motion is
/// quasi-periodic and its section a closed curve; beyond them it has the period of the excitation.
#[test]
fn finds_the_quasi_periodic_motion_between_the_neimark_sacker_points() {
    let arm = fitted(75.0);
    let forced = ForcedArm::new(arm.clone(), Load::torque_nm(1.0, 0.0), 1500.0);
    let branch = trace(forced, 23.1, Coordinate::FrequencyHz, &BranchOptions::new(23.1, 22.94)).unwrap();
    let torus = |event: &&Bifurcation| event.kind == BifurcationKind::NeimarkSacker;
    let [upper, lower] = branch.bifurcations.iter().filter(torus).collect::<Vec<_>>()[..] else { panic!("{branch:?}") };
    let amplitude = Load::torque_nm(1500.0, 0.0);
    let options = SettleOptions { time_constants: 15.0, section_points: 400 };
    let at = |frequency_hz, start: &State| {
        settle(&StroboscopicMap::new(&arm, Sine { amplitude, frequency_hz }).unwrap(), start, &options, &|| false)
            .unwrap()
    };
    let above = at(upper.orbit.frequency_hz + 0.005, &start_of(&upper.orbit));
    let between = at(upper.orbit.frequency_hz - 0.01, &above.end);
    let below = at(lower.orbit.frequency_hz - 0.005, &start_of(&lower.orbit));
    assert_eq!([above.period, between.period, below.period], [Some(1), None, Some(1)]);
    assert!(between.drift > 1e-4 && between.section.len() == 400);
    // A closed curve around the motion that has lost its stability: it keeps away from it, and each point has
    // neighbours.
    let map = StroboscopicMap::new(&arm, Sine { amplitude, frequency_hz: upper.orbit.frequency_hz }).unwrap();
    let centre = map.to_point(&above.end);
    let section: Vec<_> = between.section.iter().map(|state| map.to_point(state)).collect();
    let distances = section.iter().map(|point| (point - &centre).norm());
    let (near, far) = distances.fold((f64::INFINITY, 0.0_f64), |(near, far), d| (near.min(d), far.max(d)));
    assert!(near > 0.1 * far, "{near} {far}");
    for point in &section {
        let mut others: Vec<f64> = section.iter().map(|other| (point - other).norm()).collect();
        others.sort_by(f64::total_cmp);
        assert!(others[2] < 0.1 * far, "{others:?}");
    }
}

/// A wait that is too short is reported, never taken for a result.
#[test]
fn says_when_a_motion_has_not_settled() {
    let arm = fitted(60.0);
    let sine = Sine { amplitude: Load::torque_nm(60.0, 0.0), frequency_hz: 22.15 };
    let map = StroboscopicMap::new(&arm, sine).unwrap();
    let options = SettleOptions { time_constants: 0.5, section_points: 7 };
    let unsettled = settle(&map, &State::default(), &options, &|| false).unwrap();
    assert_eq!((unsettled.period, unsettled.largest_multiplier, unsettled.section.len()), (None, None, 7));
    assert!(unsettled.drift > 1e-6 && unsettled.amplitude_rad[0] > 0.0 && unsettled.settling_periods > 400);
    // Settled by itself from there.
    assert_eq!(settled_from(&map, &unsettled.end).period, Some(1));
}

/// Without a load the arm comes to rest from any state.
#[test]
fn without_a_load_the_arm_comes_to_rest() {
    let arm = fitted(120.0);
    let map = StroboscopicMap::new(&arm, Sine { amplitude: Load::default(), frequency_hz: 30.0 }).unwrap();
    let settled = settled_from(&map, &State::new([0.1, -0.1], [1.0, 1.0]));
    assert_eq!(settled.period, Some(1));
    assert!(settled.amplitude_rad.iter().all(|amplitude| *amplitude < 1e-12), "{settled:?}");
}

/// Up and down an amplitude: both ways visit the same values; they jump at the folds of the branch in amplitude, and
/// agree beyond them, where there is only one motion.
#[test]
fn amplitude_can_be_stepped() {
    let arm = fitted(60.0);
    let forced = ForcedArm::new(arm.clone(), Load::torque_nm(1.0, 0.0), 1.0);
    let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
    let branch = trace(forced, 22.1, amplitude, &BranchOptions::new(0.0, 300.0)).unwrap();
    let folds: Vec<_> = branch.bifurcations.iter().map(|fold| fold.orbit.value).collect();
    let sweep = |direction| {
        let parameter = SweepParameter::Amplitude { unit: Load::torque_nm(1.0, 0.0), frequency_hz: 22.1 };
        swept(&arm, &Sweep { parameter, grid: Grid::new(20.0, 260.0, 61).unwrap(), direction })
    };
    let (up, mut down) = (sweep(Direction::Up), sweep(Direction::Down));
    down.reverse();
    let mut apart = Vec::new();
    for ((value, a), (same, b)) in up.iter().zip(&down) {
        assert_eq!(value.to_bits(), same.to_bits());
        let (a, b) = (a.amplitude_rad[0], b.amplitude_rad[0]);
        if (a - b).abs() > 1e-8 * b {
            assert!(b > 2.0 * a, "{value}: {a} {b}");
            apart.push(*value);
        }
    }
    let [high, low] = folds[..] else { panic!("{folds:?}") };
    // Within a step, or within two if the step disturbs the motion off the end of its branch.
    let (first, last) = (apart[0] - low, high - apart[apart.len() - 1]);
    assert!((0.0..8.0).contains(&first) && (0.0..8.0).contains(&last), "{folds:?} {apart:?}");
}

/// The amount of work is tested too.
#[test]
fn the_amount_of_work_is_unchanged() {
    let (arm, sweep) = (fitted(60.0), frequency_sweep(60.0, (21.0, 23.5, 51), Direction::Up));
    let periods: u64 = swept(&arm, &sweep).iter().map(|(_, settled)| settled.settling_periods).sum();
    let steps = StroboscopicMap::new(&arm, sweep.sines()[0]).unwrap().steps_per_period();
    insta::assert_snapshot!(format!("{periods} periods of {steps} steps at 21 Hz"), @"17038 periods of 44 steps at 21 Hz");
}

#[test]
fn stops_on_request() {
    let arm = fitted(60.0);
    let map = StroboscopicMap::new(&arm, Sine { amplitude: Load::torque_nm(60.0, 0.0), frequency_hz: 22.1 }).unwrap();
    let stopped = settle(&map, &State::default(), &SettleOptions::default(), &|| true).unwrap_err();
    insta::assert_snapshot!(stopped, @"stopped before the motion had settled");
}

#[test]
fn says_what_can_not_be_swept() {
    let arm = fitted(60.0);
    let says = |torque1_nm, frequency_hz| {
        let sine = Sine { amplitude: Load::torque_nm(torque1_nm, 0.0), frequency_hz };
        StroboscopicMap::new(&arm, sine).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says(1.0, 0.0), @"excitation frequency 0 Hz: it must be a positive number");
    insta::assert_snapshot!(says(1.0, f64::NAN), @"excitation frequency NaN Hz: it must be a positive number");
    insta::assert_snapshot!(says(1.0, 1e-6), @"excitation frequency 1e-6 Hz: a period would take 9.2e8 steps, more than 1000000; go no lower than 9.21e-4 Hz, where the motion is quasi-static");
    insta::assert_snapshot!(says(f64::INFINITY, 20.0), @"the amplitude of the excitation is not finite: torque and force must be numbers");
    insta::assert_snapshot!(Grid::new(23.0, 23.0, 10).unwrap_err(), @"a sweep from 23 to 23: both ends must be numbers, and different");
    insta::assert_snapshot!(Grid::new(f64::NAN, 21.0, 10).unwrap_err(), @"a sweep from NaN to 21: both ends must be numbers, and different");
    assert_eq!(Grid::new(23.0, 21.0, 3).unwrap().values(), [21.0, 22.0, 23.0]);
    assert_eq!(
        Grid::new(21.0, 23.0, 2).unwrap().with([24.0, 22.5, 21.0]).in_order(Direction::Down),
        [23.0, 22.5, 21.0]
    );
    insta::assert_snapshot!(Grid::new(21.0, 23.0, 1).unwrap_err(), @"a sweep of 1 points: it must have from 2, one at each end, to 1000000");
    let preset = Preset::Irb1600Fitted.parameters().unwrap();
    let parameters = Parameters { damping1_nm_s_rad: 0.0, damping2_nm_s_rad: 0.0, ..preset };
    let undamped = Arm::new(parameters, Pose::default()).unwrap();
    let sine = Sine { amplitude: Load::torque_nm(1.0, 0.0), frequency_hz: 20.0 };
    insta::assert_snapshot!(StroboscopicMap::new(&undamped, sine).unwrap_err(), @"mode 1 has the damping ratio 0e0: without damping no motion settles; give it damping");
    let map = StroboscopicMap::new(&arm, sine).unwrap();
    let options = SettleOptions { time_constants: 0.0, ..SettleOptions::default() };
    insta::assert_snapshot!(settle(&map, &State::default(), &options, &|| false).unwrap_err(), @"time_constants is 0: it must be a positive number");
    let options = SettleOptions::default();
    let beyond = Sine { amplitude: Load::torque_nm(1e12, 0.0), frequency_hz: 20.0 };
    let map = StroboscopicMap::new(&arm, beyond).unwrap();
    insta::assert_snapshot!(settle(&map, &State::default(), &options, &|| false).unwrap_err(), @"excited at 20 Hz: the motion grows beyond all bounds, 1.06e-3 s after phase 0; try less excitation");
}
