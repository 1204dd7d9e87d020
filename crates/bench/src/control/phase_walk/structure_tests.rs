//! Walks on structures other than the arm, against their computed branches.

use super::*;
use crate::control::{Followed, ModeNumber, Modelled};
use crate::plant::{Plant, PlantSpec, TestedAssembly};
use crate::rig::{Amplifier, Converter, Load, RigSpec, ShakerSpec};
use alloc::string::{String, ToString};
use alloc::vec;
use resonarm_analysis::Distances;
use resonarm_analysis::{Assess, Coordinate, Forced, TraceOptions, nearest, trace};
use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ChainSpec, ElementSpec, Law, Link, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
};

const SAMPLING: Sampling = Sampling { rate_hz: 1000.0, converter: Converter::Sinc5 };

fn place(point: &str, axis: Axis) -> Place {
    Place::Dof { point: point.into(), axis }
}

/// The exciter and accelerometer C at `tip`, B at `b`.
fn tested(body: BodySpec, elements: Vec<ElementSpec>, b: &str) -> TestedAssembly {
    let assembly = Assembly::new(&StructureSpec { body, elements }).unwrap();
    TestedAssembly::at_rest(assembly, "tip", b)
}

/// Modes at 20, 43 and 71 Hz with a spring at the tip that hardens.
fn modal(frequencies_hz: &[f64]) -> TestedAssembly {
    let modes = frequencies_hz.iter().map(|&frequency_hz| ModeSpec { frequency_hz, damping_ratio: 0.01 }).collect();
    let shape = |name: &str, of: [f64; 3]| ShapeSpec {
        point: name.into(),
        axis: Axis::X,
        by_mode: of[..frequencies_hz.len()].to_vec(),
    };
    let shapes = vec![shape("tip", [0.4, 0.3, -0.2]), shape("mid", [0.2, -0.3, 0.3])];
    let law = Law::Cubic { stiffness3: 2e8, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: place("tip", Axis::X), to: None, law }];
    tested(BodySpec::Modal(ModalSpec { modes, shapes }), elements, "mid")
}

/// Three links, the last joint hardening.
fn chain() -> TestedAssembly {
    let link = |angle_deg: f64| Link {
        length_m: 0.4,
        mass_kg: 5.0,
        centre_of_mass_m: 0.2,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.07,
        angle_deg,
        stiffness_nm_rad: 4e4,
        damping_nm_s_rad: 3.0,
    };
    let links = vec![link(20.0), link(35.0), link(40.0)];
    let law = Law::Cubic { stiffness3: 4e9, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: Place::Joint(3), to: None, law }];
    tested(BodySpec::Chain(ChainSpec { links, gravity_m_s2: 0.0, unstated: vec![] }), elements, "joint3")
}

fn spec(amplitude: Load, mode: u8) -> PhaseWalkSpec {
    PhaseWalkSpec {
        points: 5,
        mode_number: ModeNumber::try_from(mode).unwrap(),
        from_lag_deg: 30.0,
        to_lag_deg: 150.0,
        ..PhaseWalkSpec::new(amplitude)
    }
}

/// A shaker along x whose coil brakes.
const SHAKER: ShakerSpec = ShakerSpec {
    direction_deg: 0.0,
    amplifier: Amplifier::Voltage,
    moving_mass_kg: 0.3,
    stiffness_n_m: 2e3,
    damping_n_s_m: 10.0,
    force_factor_n_a: 20.0,
    resistance_ohm: 2.0,
    inductance_h: 3e-4,
    stroke_m: 0.05,
    current_limit_a: 30.0,
    voltage_limit_v: 200.0,
};

fn rig(shaker: Option<ShakerSpec>) -> RigSpec {
    RigSpec { converter: SAMPLING.converter, shaker, ..RigSpec::default() }.without_noise()
}

fn plant(tested: &TestedAssembly, shaker: Option<ShakerSpec>) -> Plant {
    let (scheme, sample_rate_hz, rig) = (Scheme::default(), SAMPLING.rate_hz, rig(shaker));
    let spec = PlantSpec { scheme, sample_rate_hz, steps_per_sample: 4, rig, seed: 1 };
    Plant::new(&spec, tested).unwrap()
}

/// The responses of a walk that finishes.
fn walked(tested: &TestedAssembly, shaker: Option<ShakerSpec>, walk: &mut PhaseWalk) -> Vec<ResponsePoint> {
    let (mut plant, mut points) = (plant(tested, shaker), Vec::new());
    loop {
        let answer = walk.answer(&plant.measure());
        points.extend(core::iter::from_fn(|| walk.poll_response()));
        match answer {
            Answer::Hold(load) => plant.advance(&load).unwrap(),
            Answer::Finished => return points,
            Answer::Aborted(abort) => panic!("{abort}"),
        }
        assert!(plant.sample() < 200_000, "{points:?}");
    }
}

/// A walk by a force along an axis at the tip settles at every point on the computed branch, also where the branch is
/// unstable. Returns the number of unstable points.
fn on_the_branch(tested: &TestedAssembly, (name, mode): (&str, u8), force_n: f64, shaker: Option<ShakerSpec>) -> usize {
    let amplitude = if name == "tip.x" { Load::force_n(force_n, 0.0) } else { Load::force_n(0.0, force_n) };
    let of = Modelled::new(tested, &rig(shaker)).unwrap();
    let mut walk = PhaseWalk::new(spec(amplitude, mode), of, SAMPLING, 600.0).unwrap();
    let points = walked(tested, shaker, &mut walk);
    let dof = tested.assembly.dof(name).unwrap();
    let read = ["tip.x", "tip.y"].map(|name| tested.assembly.dof(name).ok());
    let range = |pick: fn(f64, f64) -> f64| points.iter().map(|point| point.frequency_hz).reduce(pick).unwrap();
    let interval = [0.97 * range(f64::min), 1.03 * range(f64::max)];
    let forced = Forced::new(tested.assembly.clone(), dof, force_n);
    let reads = read.into_iter().flatten().collect();
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, interval, reads);
    options.branch.continuation.largest_turn_rad = 0.03;
    // The multipliers of a chain take many times longer than its branch.
    options.assess = match &tested.assembly.spec().body {
        BodySpec::Chain(_) => Assess::Nothing,
        BodySpec::Modal(_) => Assess::Multipliers,
    };
    options.branch.most_points = 100_000;
    let branch = trace(&forced, interval[0], Coordinate::FrequencyHz, &options).unwrap();
    let mut unstable = 0;
    for point in &points {
        assert!(point.settled && (point.load / force_n - 1.0).abs() < NOISY_LOAD_TOLERANCE, "{point:?}");
        let omega = TAU * point.frequency_hz;
        for (reading, along) in read.iter().flatten().zip([0, 1]) {
            let amplitude = point.acceleration_c_m_s2[along].norm_sqr().sqrt() / (omega * omega);
            let at = nearest(&branch.orbits, along, [point.frequency_hz, amplitude], Distances::default()).unwrap();
            let off = (at.frequency_deviation, at.amplitude_deviation);
            assert!(off.0.abs() < 5e-5 && off.1.abs() < 3e-3, "{reading:?} {point:?}: {off:?}");
            unstable += usize::from(along == 0 && at.is_stable == Some(false));
        }
    }
    assert_eq!(points.len(), 5);
    unstable
}

#[test]
fn a_walk_on_modes_is_on_the_computed_branch() {
    let three = modal(&[20.0, 43.0, 71.0]);
    assert!(on_the_branch(&three, ("tip.x", 1), 12.0, None) > 0);
    on_the_branch(&three, ("tip.x", 2), 12.0, None);
    // A single mode has no other beside it.
    assert!(on_the_branch(&modal(&[20.0]), ("tip.x", 1), 12.0, None) > 0);
}

/// The head reads what the coil gives less what the armature takes: the walk holds the former's share on the structure.
#[test]
fn a_walk_with_a_shaker_is_on_the_branch_of_the_structure_alone() {
    assert!(on_the_branch(&modal(&[20.0, 43.0, 71.0]), ("tip.x", 1), 12.0, Some(SHAKER)) > 0);
}

#[test]
fn a_walk_on_a_chain_is_on_the_computed_branch() {
    on_the_branch(&chain(), ("tip.y", 1), 20.0, None);
    on_the_branch(&chain(), ("tip.x", 2), 20.0, None);
}

/// Two modes half a hertz apart move the tip alike, so that the model of the first has no response with a lag of 170°. On a free
/// plate with modes at 67.8 and 73.0 Hz the walk once named a lag, a frequency and an amplitude of NaN.
#[test]
fn a_lag_that_two_modes_do_not_reach_is_named() {
    let spec = PhaseWalkSpec { from_lag_deg: 170.0, to_lag_deg: 172.0, ..spec(Load::force_n(12.0, 0.0), 1) };
    let tested = modal(&[20.0, 20.5]);
    let mut walk = PhaseWalk::new(spec, Modelled::new(&tested, &rig(None)).unwrap(), SAMPLING, 600.0).unwrap();
    let answer = walk.answer(&plant(&tested, None).measure());
    assert_eq!(answer, Answer::Aborted(Abort::NotPredicted { lag_deg: 170.0 }));
}

/// The load that holds one displacement at every frequency is that of the branch.
#[test]
fn one_displacement_is_held() {
    let tested = modal(&[20.0, 43.0, 71.0]);
    let amplitude = Load::force_n(20.0, 0.0);
    let spec = ResponseControlSpec {
        amplitude,
        mode_number: ModeNumber::FIRST,
        displacement_m: 5e-4,
        from_hz: 19.8,
        to_hz: 20.4,
        points: 4,
        cancel_harmonics: crate::control::CancelHarmonics::NONE,
    };
    let mut walk = PhaseWalk::new(spec, Modelled::new(&tested, &rig(None)).unwrap(), SAMPLING, 600.0).unwrap();
    for point in walked(&tested, None, &mut walk) {
        let omega = TAU * point.frequency_hz;
        let held_m = point.acceleration_c_m_s2[0].norm_sqr().sqrt() / (omega * omega);
        assert!(point.settled && (held_m / 5e-4 - 1.0).abs() < 2e-3, "{point:?}");
    }
}

/// In mode 1 the tip, C, moves with 0.4 · 0.4/2ζ = 8 m/s² a newton in resonance, the middle, B, half as far.
#[test]
fn the_range_of_the_followed_accelerometer_suffices() {
    let followed = |ranges_m_s2: [f64; 2], shape_b: f64, load_n: f64| {
        let mut spec = modal(&[20.0, 43.0, 71.0]).assembly.spec().clone();
        let BodySpec::Modal(body) = &mut spec.body else { unreachable!() };
        body.shapes[1].by_mode[0] = shape_b;
        let tested = tested(spec.body, vec![], "mid");
        let of = Modelled { ranges_m_s2, ..Modelled::new(&tested, &rig(None)).unwrap() };
        ModeModel::new(&of, &Load::force_n(1.0, 0.0), load_n, ModeNumber::FIRST).unwrap().followed
    };
    assert_eq!(followed([1600.0, 1600.0], 0.2, 150.0), Followed::PointC);
    assert_eq!(followed([1600.0, 1600.0], 0.2, 170.0), Followed::PointB);
    assert_eq!(followed([1600.0, 3300.0], 0.2, 1000.0), Followed::PointC);
    // Less than a fifth as far as the other.
    assert_eq!(followed([1600.0, 1600.0], 0.079, 170.0), Followed::PointC);
    assert_eq!(followed([100.0, 1600.0], 2.1, 170.0), Followed::PointB);
}

#[test]
fn a_mode_that_is_not_there_is_refused() {
    let amplitude = Load::force_n(20.0, 0.0);
    let refused = |tested: &TestedAssembly, mode: u8| -> String {
        PhaseWalk::new(spec(amplitude, mode), Modelled::new(tested, &rig(None)).unwrap(), SAMPLING, 600.0)
            .unwrap_err()
            .to_string()
    };
    insta::assert_snapshot!(refused(&modal(&[20.0]), 2), @"control: there is no mode 2: the structure has modes 1 to 1");
    let y = Load::force_n(0.0, 20.0);
    let one = modal(&[20.0]);
    let off = PhaseWalk::new(spec(y, 1), Modelled::new(&one, &rig(None)).unwrap(), SAMPLING, 600.0).unwrap_err();
    insta::assert_snapshot!(off, @"control: this load does not drive mode 1: choose another direction");
}
