use core::cell::Cell;
use core::f64::consts::TAU;

use super::*;
use crate::tests::preset_at;
use crate::tests::{modal, near, number, of_kind, oracles, place, start_of_two};
use crate::time_domain::{BasinOutcome, Grid, SettleOptions, TimeDomainError};
use crate::{Bifurcation, Branch, Coordinate, Forced, LinearResponse, TraceOptions, trace};
use crate::{BifurcationKind, Quantity};
use nalgebra::Normed as _;
use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, Dof, ElementSpec, Law, ModalSpec, ModeSpec, Preset, ShapeSpec, Side, StepLoad, Stepper,
    StructureSpec,
};

/// The first structure of the oracles under its drive, and where it is read.
fn forced() -> (Forced, Dof) {
    let case = &oracles("modal")[0];
    let assembly = modal(case);
    let [drive, read] = ["drive", "read"].map(|key| assembly.dof(case[key].as_str().unwrap()).unwrap());
    (Forced::new(assembly, drive, number(case, "force_n")), read)
}

/// One mode of 10 Hz with an element, under a force.
fn oscillator(damping_ratio: f64, law: Law, force_n: f64) -> (Forced, Dof) {
    let body = ModalSpec {
        modes: vec![ModeSpec { frequency_hz: 10.0, damping_ratio }],
        shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }],
    };
    let elements = vec![ElementSpec::Point { at: place("tip.x"), to: None, law }];
    let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    (Forced::new(assembly, tip, force_n), tip)
}

/// One that hardens so that its resonance folds over.
fn hardening() -> (Forced, Dof) {
    oscillator(0.03, Law::Cubic { stiffness3: 4e6, stiffness5: 0.0 }, 5.0)
}

/// The branch of a structure from one frequency to another, Hz.
fn traced(forced: &Forced, read: Dof, ends: [f64; 2]) -> Branch {
    let options = TraceOptions::new(forced, Coordinate::FrequencyHz, ends, vec![read]);
    trace(forced, ends[0], Coordinate::FrequencyHz, &options).unwrap()
}

fn settled(forced: &Forced, read: Dof, frequency_hz: f64, start: &[f64]) -> Settled {
    let map = StroboscopicMap::new(forced, frequency_hz).unwrap();
    settle(&map, &[read], start, &SettleOptions::default(), &|| false).unwrap()
}

fn rest(forced: &Forced) -> Vec<f64> {
    vec![0.0; 2 * forced.assembly().coordinates() + forced.assembly().element_states()]
}

/// Without elements the settled response is the linear frequency response.
#[test]
fn responses_without_elements_are_linear() {
    let mut spec = forced().0.assembly().spec().clone();
    spec.elements.clear();
    let assembly = Assembly::new(&spec).unwrap();
    let [tip, mid] = ["tip.x", "mid.x"].map(|name| assembly.dof(name).unwrap());
    let response = LinearResponse::new(&assembly);
    let linear = Forced::new(assembly, tip, 3.0);
    for hz in [7.0, 20.0, 24.0, 70.0] {
        let got = settled(&linear, mid, hz, &rest(&linear));
        let expected = response.at(Quantity::Receptance, tip, mid, hz).unwrap() * 3.0;
        assert!((got.readings[0].harmonic1 - expected).norm() < 1e-8 * expected.norm(), "{hz} Hz: {got:?} {expected}");
        near(got.readings[0].largest, expected.norm(), 1e-8);
        assert!(got.period == Some(1) && got.drift < 1e-9 && got.largest_multiplier.unwrap() < 1.0);
    }
}

/// The fitted arm as a chain, under a torque at joint 1, and that joint.
fn arm(beta2_deg: f64, torque1_nm: f64) -> (Forced, Dof) {
    let assembly = preset_at(Preset::Irb1600Fitted, [0.0, beta2_deg]);
    let joint = assembly.dof("joint1").unwrap();
    (Forced::new(assembly, joint, torque1_nm), joint)
}

/// How far a state is from another, relative to its size, in the coordinates of the section.
fn off(map: &StroboscopicMap, state: &[f64], expected: &[f64]) -> f64 {
    let [state, expected] = [state, expected].map(|state| map.to_point(state));
    (&state - &expected).norm() / expected.norm()
}

/// The shortcut ends where integration alone ends: before the jump, through it, after it, and from rest into a
/// resonance with two stable periodic responses.
#[test]
fn ends_where_plain_integration_ends() {
    let (forced, joint) = arm(60.0, 60.0);
    let before = settled(&forced, joint, 22.134, &settled(&forced, joint, 22.12, &[0.02, 0.016, 0.0, 0.0]).end).end;
    let cases = [(22.1345, &before), (22.136, &before), (22.10, &vec![0.0; 4]), (22.07, &vec![0.2, 0.1, 3.0, 5.0])];
    for (frequency_hz, start) in cases {
        let map = StroboscopicMap::new(&forced, frequency_hz).unwrap();
        let settled = settled(&forced, joint, frequency_hz, start);
        let mut truth = [start.clone()];
        map.advance_all(&mut truth, (25.0 * map.time_constant_periods()).ceil() as u32).unwrap();
        let error = off(&map, &settled.end, &truth[0]);
        assert!(error < 1e-8, "{frequency_hz} Hz: {error} {settled:?}");
        assert!((settled.settling_periods as f64) < 8.0 * map.time_constant_periods(), "{settled:?}");
    }
}

/// A settled response closes after its period, by another scheme with far smaller steps too: the errors of single
/// periods of the map add up to less than 1e-8 of the amplitude over a time constant.
#[test]
fn settled_response_closes_by_another_scheme() {
    for (beta2_deg, torque1_nm, frequency_hz, period) in
        [(60.0, 60.0, 22.15, 1), (120.0, 60.0, 26.82, 1), (30.0, 100.0, 55.6, 1), (75.0, 300.0, 46.3, 2)]
    {
        let (forced, joint) = arm(beta2_deg, torque1_nm);
        let map = StroboscopicMap::new(&forced, frequency_hz).unwrap();
        // Into the subharmonic response by a start of about its size.
        let start = if period == 1 { [0.0; 4] } else { [0.05, -0.05, 5.0, 5.0] };
        let settled = settled(&forced, joint, frequency_hz, &start);
        assert_eq!(settled.period, Some(period), "{settled:?}");
        let rate_hz = 1000.0 * frequency_hz;
        let mut stepper = Stepper::new(forced.assembly(), &[joint], Scheme::Gl6, rate_hz).unwrap();
        stepper.restore(&settled.end).unwrap();
        let load = StepLoad::Sine { amplitude: &[torque1_nm], omega_rad_s: TAU * frequency_hz };
        let mut largest = [0.0_f64; 2];
        for k in 0..1000 * period {
            largest = [0, 1].map(|i| largest[i].max(stepper.position()[i].abs()));
            stepper.advance_under(f64::from(k) / rate_hz, &load).unwrap();
        }
        let error = off(&map, &[stepper.position(), stepper.velocity()].concat(), &settled.end);
        assert!(error < 1e-8 / map.time_constant_periods(), "{beta2_deg}°: {error}");
        for (coordinate, largest) in settled.coordinates.iter().zip(largest) {
            // Between samples of 1/1000 of a period the peak is missed by at most (nπ/1000)²/2 of harmonic n.
            let missed = coordinate.largest / largest - 1.0;
            assert!((0.0..1e-4).contains(&missed), "{beta2_deg}°: {missed}");
        }
    }
}

/// Between two Neimark–Sacker points, which harmonic balance locates at the 1:2 internal resonance, the response is
/// quasi-periodic and its section a closed curve; beyond them it has the period of the drive.
#[test]
fn finds_the_quasi_periodic_response_between_the_neimark_sacker_points() {
    let (forced, joint) = arm(75.0, 1500.0);
    let branch = traced(&forced, joint, [23.1, 22.94]);
    let torus = |event: &&Bifurcation| event.kind == BifurcationKind::NeimarkSacker;
    let [upper, lower] = branch.bifurcations.iter().filter(torus).collect::<Vec<_>>()[..] else { panic!("{branch:?}") };
    let options = SettleOptions { time_constants: 15.0, section_points: 400 };
    let at = |frequency_hz, start: &[f64]| {
        settle(&StroboscopicMap::new(&forced, frequency_hz).unwrap(), &[joint], start, &options, &|| false).unwrap()
    };
    let above = at(upper.orbit.frequency_hz + 0.005, &start_of_two(&upper.orbit));
    let between = at(upper.orbit.frequency_hz - 0.01, &above.end);
    let below = at(lower.orbit.frequency_hz - 0.005, &start_of_two(&lower.orbit));
    assert_eq!([above.period, between.period, below.period], [Some(1), None, Some(1)]);
    assert!(between.drift > 1e-4 && between.section.len() == 400);
    // A closed curve around the response that has lost its stability: it keeps away from it, and each point has
    // neighbours.
    let map = StroboscopicMap::new(&forced, upper.orbit.frequency_hz).unwrap();
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

/// A wait that is too short is reported, and the state at its end is not taken for a settled response.
#[test]
fn says_when_a_response_has_not_settled() {
    let (forced, joint) = arm(60.0, 60.0);
    let map = StroboscopicMap::new(&forced, 22.15).unwrap();
    let options = SettleOptions { time_constants: 0.5, section_points: 7 };
    let unsettled = settle(&map, &[joint], &[0.0; 4], &options, &|| false).unwrap();
    assert_eq!((unsettled.period, unsettled.largest_multiplier, unsettled.section.len()), (None, None, 7));
    assert!(unsettled.drift > 1e-6 && unsettled.readings[0].largest > 0.0 && unsettled.settling_periods > 400);
    // Settled by itself from there.
    assert_eq!(settled(&forced, joint, 22.15, &unsettled.end).period, Some(1));
}

/// Without a load the structure comes to rest from any state.
#[test]
fn without_a_load_the_structure_comes_to_rest() {
    let (forced, joint) = arm(120.0, 0.0);
    let settled = settled(&forced, joint, 30.0, &[0.1, -0.1, 1.0, 1.0]);
    assert_eq!(settled.period, Some(1));
    assert!(settled.coordinates.iter().all(|coordinate| coordinate.largest < 1e-12), "{settled:?}");
}

/// The amount of work is tested too: a change of it shows.
#[test]
fn the_amount_of_work_is_unchanged() {
    let (forced, joint) = arm(60.0, 60.0);
    let (mut state, mut periods) = (vec![0.0; 4], 0);
    for frequency_hz in Grid::new(21.0, 23.5, 51).unwrap().values() {
        let settled = settled(&forced, joint, *frequency_hz, &state);
        (state, periods) = (settled.end, periods + settled.settling_periods);
    }
    let steps = StroboscopicMap::new(&forced, 21.0).unwrap().steps_per_period();
    insta::assert_snapshot!(format!("{periods} periods of {steps} steps at 21 Hz"), @"27768 periods of 44 steps at 21 Hz");
}

/// A sweep over the frequency, the amplitude or a parameter of the structure follows the branch up to the fold at which
/// the stretch of the branch ends, and jumps within a step of it.
#[test]
fn sweeps_jump_at_the_folds() {
    let (forced, read) = hardening();
    let parameter = forced.assembly().parameter("element1.stiffness3_n_m3").unwrap();
    let sweeps = [
        (Coordinate::FrequencyHz, 5.0, [8.0, 20.0]),
        (Coordinate::Amplitude, 5.0, [2.0, 60.0]),
        (Coordinate::Parameter(parameter), 20.0, [1e5, 4e7]),
    ];
    for (over, amplitude, ends) in sweeps {
        let (forced, frequency_hz) = (forced.with_amplitude(amplitude), 13.0);
        let options = TraceOptions::new(&forced, over, ends, vec![read]);
        let branch = trace(&forced, frequency_hz, over, &options).unwrap();
        let folds: Vec<f64> = of_kind(&branch, BifurcationKind::Fold).iter().map(|orbit| orbit.value).collect();
        for (fold, from) in folds.iter().zip(ends) {
            let step = 1e-3 * fold * (fold - from).signum();
            let (begin, fine) = (fold - 3.5 * step, 7);
            // Denser towards the fold, where a step may not disturb the response off its stretch.
            let left = |k: u32| (1.0 - f64::from(k) / 60.0) * (1.0 - f64::from(k) / 60.0);
            let coarse = (0..60).map(|k| begin + (from - begin) * left(k));
            let values = coarse.chain((0..fine).map(|k| begin + f64::from(k) * step)).collect();
            let sweep = Sweep { forced: forced.clone(), frequency_hz, over, values };
            sweep.check().unwrap();
            let mut state = rest(&forced);
            let size = |value: &f64| {
                let options = SettleOptions::default();
                let reached = settle(&sweep.map(*value).unwrap(), &[read], &state, &options, &|| false).unwrap();
                assert!(reached.period == Some(1) && reached.drift < 1e-9);
                assert_eq!(&reached.section[..], core::slice::from_ref(&reached.end));
                state.clone_from(&reached.end);
                reached.readings[0].largest
            };
            let sizes: Vec<f64> = sweep.values.iter().map(size).collect();
            let sizes = &sizes[60..];
            let jumps: Vec<usize> = (1..7).filter(|&k| !(0.6..1.6).contains(&(sizes[k] / sizes[k - 1]))).collect();
            assert_eq!(jumps, [4], "{over} from {from}: {sizes:?} {folds:?}");
        }
        assert_eq!(folds.len(), 2);
    }
}

/// Values at which no structure exists are rejected before anything is computed.
#[test]
fn sweeps_refuse_values_without_a_structure() {
    let (forced, _) = hardening();
    let over = Coordinate::Parameter(forced.assembly().parameter("mode1.frequency_hz").unwrap());
    let sweep = Sweep { forced, frequency_hz: 13.0, over, values: vec![10.0, -1.0] };
    let refusal = sweep.check().unwrap_err().to_string();
    insta::assert_snapshot!(refusal, @"mode 1: `frequency_hz` is -1: it must be a number from 0");
}

/// 400 states a period, of which those at phase 0 are the section; also of a slow drive, where the steps are short.
#[test]
fn a_path_connects_the_points_of_the_section() {
    let (forced, read) = hardening();
    for frequency_hz in [0.5, 13.0] {
        let map = StroboscopicMap::new(&forced, frequency_hz).unwrap();
        let start = [2e-3, 0.1];
        let path = path(&map, &start, 2).unwrap();
        assert_eq!((path.len(), &path[0][..]), (801, &start[..]));
        let mut expected = start.to_vec();
        for at in [400, 800] {
            expected = map.advance(&expected).unwrap();
            path[at].iter().zip(&expected).for_each(|(got, expected)| near(*got, *expected, 1e-7));
        }
        assert_eq!(section_point(forced.assembly(), read, &start), start);
    }
}

/// Between the folds each stable periodic response is one of the branch, with its amplitude and multiplier; states
/// reach the one in which they settle.
#[test]
fn basins_have_the_stable_orbits_of_the_branch() {
    let (forced, read) = hardening();
    let folds = traced(&forced, read, [8.0, 20.0]).bifurcations;
    let hz = 0.5 * (folds[0].orbit.frequency_hz + folds[1].orbit.frequency_hz);
    let (orbits, early) = stable_orbits(&forced, &[read], hz, &|| false).unwrap();
    assert!(orbits.len() == 2 && early.is_none(), "{orbits:?}");
    // A branch that comes from below arrives on the upper stretch, and one from above on the lower.
    for (orbit, from_hz) in orbits.iter().zip([20.0, 8.0]) {
        let expected = traced(&forced, read, [from_hz, hz]).orbits.pop().unwrap();
        near(orbit.readings[0].largest, expected.readings[0].largest, 1e-7);
        near(orbit.readings[0].harmonic1.re, expected.readings[0].harmonic1.re, 1e-6);
        near(orbit.largest_multiplier, expected.stability.unwrap().multipliers[0].norm(), 1e-6);
        assert_eq!((orbit.period, orbit.section.len()), (1, 1));
    }
    let map = StroboscopicMap::new(&forced, hz).unwrap();
    let far = [0, 1].map(|index| reach(&orbits, index, hz));
    let place = |k: usize| [far[0] * (k % 5) as f64 / 2.0 - far[0], far[1] * (k / 5) as f64 / 2.0 - far[1]];
    let starts: Vec<Vec<f64>> = (0..25).map(|k| place(k).to_vec()).collect();
    let fates = outcomes(&map, &orbits, &starts, 40.0, &|| false).unwrap();
    let mut reached = [0; 2];
    for (start, fate) in starts.iter().zip(&fates) {
        let BasinOutcome::Reaches { orbit, .. } = fate else { panic!("{fate:?}") };
        near(settled(&forced, read, hz, start).readings[0].largest, orbits[*orbit].readings[0].largest, 1e-6);
        reached[*orbit] += 1;
    }
    assert!(reached.iter().all(|count| *count > 2), "{reached:?}");
}

/// Every fate that is reported is where plain integration ends, also for the states near the boundary between the
/// basins: such a trajectory passes close to the unstable response, far from both stable ones, and its approach over
/// one stretch can look by chance as a linearisation predicts.
#[test]
fn fates_are_where_plain_integration_ends() {
    let (forced, read) = oscillator(0.02, Law::Cubic { stiffness3: 4e6, stiffness5: 0.0 }, 2.0);
    let folds = traced(&forced, read, [8.0, 20.0]).bifurcations;
    let hz = 0.5 * (folds[0].orbit.frequency_hz + folds[1].orbit.frequency_hz);
    let (orbits, _) = stable_orbits(&forced, &[read], hz, &|| false).unwrap();
    let map = StroboscopicMap::new(&forced, hz).unwrap();
    let far = [0, 1].map(|index| reach(&orbits, index, hz));
    let counts = [13, 11];
    let place = |k: usize| {
        let at = |index: usize, line: usize| far[index] * (2.0 * line as f64 / (counts[index] - 1) as f64 - 1.0);
        vec![at(0, k % counts[0]), at(1, k / counts[0])]
    };
    let starts: Vec<Vec<f64>> = (0..counts[0] * counts[1]).map(place).collect();
    let fates = outcomes(&map, &orbits, &starts, 40.0, &|| false).unwrap();
    let mut ends = starts.clone();
    map.advance_all(&mut ends, 400).unwrap();
    let wrong: Vec<usize> = (0..starts.len())
        .filter(|&k| match fates[k] {
            BasinOutcome::Reaches { orbit, .. } => off(&map, &ends[k], &orbits[orbit].section[0]) > 1e-6,
            _ => true,
        })
        .collect();
    assert_eq!((orbits.len(), wrong), (2, vec![]));
}

/// A bilinear oscillator, twice as fast as its resonance driven, vibrates with two periods of the drive; that response
/// is found from beside the unstable one of the branch.
#[test]
fn finds_the_response_of_two_periods() {
    let stiffness = 1.25 * (TAU * 10.0) * (TAU * 10.0);
    let (forced, read) = oscillator(
        0.03,
        Law::KelvinVoigt { stiffness, damping: 0.0, gap: 0.0, side: Side::Positive, preload: 0.0 },
        5.0,
    );
    let (orbits, _) = stable_orbits(&forced, &[read], 24.0, &|| false).unwrap();
    let periods: Vec<u32> = orbits.iter().map(|orbit| orbit.period).collect();
    assert_eq!((periods.as_slice(), orbits[0].section.len()), (&[2][..], 2), "{orbits:?}");
}

/// Friction that sticks keeps the offset with which it began to stick: the response settles where it returns, and is
/// that of harmonic balance. Friction that slips forgets it.
#[test]
fn friction_settles() {
    for (force_n, multiplier) in [(1.0, false), (40.0, true)] {
        let (forced, read) = oscillator(0.03, Law::Friction { stiffness: 2e3, slip: 5.0 }, force_n);
        let got = settled(&forced, read, 9.0, &rest(&forced));
        assert_eq!((got.period, got.largest_multiplier.is_some()), (Some(1), multiplier), "{got:?}");
        let expected = traced(&forced, read, [9.0, 9.1]).orbits[0].readings[0];
        near(got.readings[0].harmonic1.norm(), expected.harmonic1.norm(), 2e-5);
    }
}

/// Without steps the frequencies are dense along the resonance; with few it is stepped over, and that is reported.
#[test]
fn frequencies_resolve_a_resonance_or_say_that_they_do_not() {
    let (forced, read) = hardening();
    let of = |steps| SweepFrequencies::new(&forced, &[read], [20.0, 5.0], steps).unwrap();
    let (few, all) = (of(Some(3)), of(None));
    assert_eq!((few.grid.values().len(), few.stepped_over.len(), few.stepped_over[0].reading), (3, 1, 0));
    assert!(all.grid.values().len() > 130 && all.stepped_over.is_empty() && all.unknown_beyond.is_none());
    let even = Grid::new(5.0, 20.0, 101).unwrap();
    assert!(even.values().iter().all(|hz| all.grid.values().contains(hz)));
}

/// A resonance that a step hits is not stepped over; one that is, is located between the points of the branch.
#[test]
fn what_is_stepped_over_is_located() {
    let modes = |damping_ratio: f64| vec![ModeSpec { frequency_hz: 20.0, damping_ratio }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![0.5] }];
    let of = |damping_ratio: f64, force_n: f64, ends: [f64; 2], steps: u32| {
        let body = BodySpec::Modal(ModalSpec { modes: modes(damping_ratio), shapes: shapes.clone() });
        let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
        let tip = assembly.dof("tip.x").unwrap();
        let forced = Forced::new(assembly, tip, force_n);
        SweepFrequencies::new(&forced, &[tip], ends, Some(steps)).unwrap().stepped_over
    };
    assert_eq!(of(0.01, 5.0, [19.0, 21.0], 3), []);
    for (zeta, force_n, ends, steps) in [(1e-4, 1.0, [15.03, 25.0], 6), (0.01, 5.0, [18.5, 22.5], 3)] {
        let [found] = of(zeta, force_n, ends, steps)[..] else { panic!() };
        // The largest response is at f √(1 − 2ζ²), and F φ²/(2ζω² √(1 − ζ²)).
        let omega = TAU * 20.0;
        near(found.frequency_hz, 20.0 * libm::sqrt(1.0 - 2.0 * zeta * zeta), 1e-8);
        near(found.largest, force_n * 0.25 / (2.0 * zeta * omega * omega * libm::sqrt(1.0 - zeta * zeta)), 1e-9);
        near(found.width_hz, 2.0 * zeta * 20.0, 0.02);
    }
}

/// A stop ends the computation, and invalid requests are rejected.
#[test]
fn stops_and_refuses() {
    let (forced, read) = forced();
    let map = StroboscopicMap::new(&forced, 20.0).unwrap();
    let asked = Cell::new(0);
    let stop = || asked.replace(asked.get() + 1) == 1;
    let stopped = settle(&map, &[read], &rest(&forced), &SettleOptions::default(), &stop);
    assert_eq!(stopped, Err(TimeDomainError::Stopped));
    let refusal = |forced: &Forced, hz: f64| StroboscopicMap::new(forced, hz).unwrap_err().to_string();
    insta::assert_snapshot!(refusal(&forced, 0.0), @"excitation frequency 0 Hz: it must be a positive number");
    insta::assert_snapshot!(refusal(&forced, f64::NAN), @"excitation frequency NaN Hz: it must be a positive number");
    let (arm, joint) = arm(60.0, 1.0);
    insta::assert_snapshot!(refusal(&arm, 1e-6), @"at an excitation frequency of 1e-6 Hz, a period would take 9.2e8 steps, more than 1000000; choose at least 9.21e-4 Hz, where the response is quasi-static");
    insta::assert_snapshot!(refusal(&arm.with_amplitude(f64::INFINITY), 20.0), @"the amplitude of the excitation is not finite: torque and force must be numbers");
    insta::assert_snapshot!(refusal(&forced.undamped().unwrap(), 20.0), @"mode 1 has the damping ratio 0e0, so no response settles; give the mode damping");
    let options = SettleOptions { time_constants: 0.0, ..SettleOptions::default() };
    insta::assert_snapshot!(settle(&map, &[read], &rest(&forced), &options, &|| false).unwrap_err(), @"time_constants is 0: it must be a positive number");
    let map = StroboscopicMap::new(&arm.with_amplitude(1e12), 20.0).unwrap();
    insta::assert_snapshot!(settle(&map, &[joint], &[0.0; 4], &SettleOptions::default(), &|| false).unwrap_err(), @"excited at 20 Hz: the response grows without bound, 1.06e-3 s after phase 0; lower the excitation");
}
