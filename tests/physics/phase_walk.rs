//! The phase walk against the independent branches of harmonic balance: by the accelerometers' readings every settled
//! point is on the branch, stable or not.

use resonarm::analysis::Distances;
use resonarm::analysis::{
    BackboneOptions, Branch, Coordinate, Forced, Reading, TraceOptions, backbone, nearest, trace,
};
use resonarm::control::{
    Answer, CancelHarmonics, Controller, ModeNumber, Modelled, PhaseWalk, PhaseWalkSpec, ResponseControlSpec,
    ResponsePoint,
};
use resonarm::excitation::Phasor;
use resonarm::integrate::Scheme;
use resonarm::plant::{Plant, PlantSpec, ReadDof, TestedAssembly};
use resonarm::rig::{Amplifier, Converter, Load, RigSpec, Sampling, ShakerSpec};
use resonarm::structure::{Assembly, BodySpec, Preset, StructureSpec};

const RATE_HZ: f64 = 1000.0;
const SAMPLING: Sampling = Sampling { rate_hz: RATE_HZ, converter: Converter::Sinc5 };
/// The bounds of a point: frequency and amplitude, relative.
const FREQUENCY: f64 = 2e-5;
const BOUNDS: Distances = Distances { frequency: FREQUENCY, amplitude: 1e-3 };

struct Case {
    beta1_deg: f64,
    beta2_deg: f64,
    amplitude: Load,
    mode: ModeNumber,
    shaker: Option<ShakerSpec>,
    /// The smallest accepted number of unstable responses on the walk.
    unstable: usize,
    /// The most tries a point, on average.
    tries: f64,
}

/// Instruments without noise, but with the converters' quantisation.
fn quiet() -> RigSpec {
    let mut rig = RigSpec::default();
    rig.sensors.b.noise_rms = Some(0.0);
    rig.sensors.c.noise_rms = Some(0.0);
    rig.head.noise_rms = Some(0.0);
    rig
}

impl Case {
    fn plant(&self) -> Plant {
        self.plant_with(quiet())
    }

    fn plant_with(&self, rig: RigSpec) -> Plant {
        Plant::new(&self.spec(rig), &self.tested()).unwrap()
    }

    /// The arm as a chain.
    fn tested(&self) -> TestedAssembly {
        let chain = Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&[self.beta1_deg, self.beta2_deg]);
        let body = BodySpec::Chain(chain);
        let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
        TestedAssembly::at_rest(assembly, "tip", "joint2")
    }

    /// The walk that a specification asks for.
    fn controller(&self, spec: PhaseWalkSpec) -> PhaseWalk {
        let tested = self.tested();
        let of = Modelled::new(&tested, &RigSpec { shaker: self.shaker, ..quiet() }).unwrap();
        let limit = if self.amplitude.has_torque() { 1600.0 } else { 600.0 };
        PhaseWalk::new(spec, of, SAMPLING, limit).unwrap()
    }

    fn spec(&self, rig: RigSpec) -> PlantSpec {
        PlantSpec {
            scheme: Scheme::default(),
            sample_rate_hz: RATE_HZ,
            steps_per_sample: 4,
            rig: RigSpec { shaker: self.shaker, ..rig },
            seed: 1,
        }
    }

    fn walk(&self, plant: &mut Plant) -> Vec<ResponsePoint> {
        self.walk_by(plant, PhaseWalkSpec { points: 17, ..PhaseWalkSpec::new(self.amplitude) })
    }

    fn walk_by(&self, plant: &mut Plant, spec: PhaseWalkSpec) -> Vec<ResponsePoint> {
        let spec = PhaseWalkSpec { mode_number: self.mode, ..spec };
        drive(&mut self.controller(spec), plant)
    }

    /// The arm under the load, without a shaker's armature: the force between them is a load on the arm.
    fn forced(&self, amplitude: &Load) -> Forced {
        let tested = self.tested();
        let &[(dof, load)] = &tested.driven(amplitude)[..] else { panic!("{amplitude:?} acts at several places") };
        Forced::new(tested.assembly, dof, load)
    }

    /// The branch around the points, in steps so small that it is straight between its responses.
    fn branch(&self, at: &ReadDof, points: &[ResponsePoint]) -> Branch {
        let (low, high) = points.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), point| {
            (low.min(point.frequency_hz), high.max(point.frequency_hz))
        });
        let forced = self.forced(&self.amplitude);
        // Beyond the points on both sides, so that the nearest response is not an end of the branch.
        let ends = [0.98 * low, 1.02 * high];
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![at.dof]);
        options.branch.continuation.largest_turn_rad = 0.01;
        options.branch.most_points = 100_000;
        trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap()
    }
}

fn size(phasor: Phasor) -> f64 {
    phasor.norm_sqr().sqrt()
}

/// The amplitude of a displacement.
fn amplitude_m(point: &ResponsePoint, at: &ReadDof) -> f64 {
    size(point.displacement_m(at.channel))
}

/// The degree of freedom that moves most of those that are read without clipping.
fn most_moving(tested: &TestedAssembly, points: &[ResponsePoint]) -> ReadDof {
    let most = |at: &ReadDof| points.iter().map(|point| amplitude_m(point, at)).fold(0.0, f64::max);
    let is_whole = |at: &ReadDof| points.iter().all(|point| !point.clipped[at.channel]);
    tested.read().into_iter().filter(is_whole).max_by(|a, b| most(a).total_cmp(&most(b))).unwrap()
}

/// Runs to the end of the controller's work.
fn drive(controller: &mut dyn Controller, plant: &mut Plant) -> Vec<ResponsePoint> {
    let mut points = Vec::new();
    loop {
        let answer = controller.answer(&plant.measure());
        points.extend(std::iter::from_fn(|| controller.poll_response()));
        match answer {
            Answer::Hold(load) => plant.advance(&load).unwrap(),
            Answer::Finished => return points,
            Answer::Aborted(abort) => panic!("{abort}"),
        }
    }
}

fn check(case: &Case) {
    check_on(case, case.plant());
}

fn check_on(case: &Case, mut plant: Plant) {
    let points = case.walk(&mut plant);
    let at = most_moving(&case.tested(), &points);
    let branch = case.branch(&at, &points);
    let mut unstable = 0;
    for point in &points {
        assert!(point.settled, "{point:?}");
        // The load is within 0.11 % of the wanted one. With an ideal exciter it is the command, and the displacement
        // at a lag is proportional to it. With a shaker it is read, with noise.
        let load = case.amplitude;
        let part = point.load / libm::hypot(load.force_n.norm(), load.torque_nm.norm());
        assert!((part - 1.0).abs() < 1.1e-3, "{point:?}");
        let scale = if case.shaker.is_none() { part } else { 1.0 };
        let measured = [point.frequency_hz, amplitude_m(point, &at) / scale];
        let place = nearest(&branch.orbits, 0, measured, BOUNDS).unwrap();
        let distance =
            libm::hypot(place.frequency_deviation / BOUNDS.frequency, place.amplitude_deviation / BOUNDS.amplitude);
        assert!(distance < 1.0, "{} Hz, {:?}: {distance}", point.frequency_hz, case.shaker);
        unstable += usize::from(place.is_stable == Some(false));
    }
    assert!(unstable >= case.unstable, "{unstable} unstable responses");
    let tries: u32 = points.iter().map(|point| point.tries).sum();
    assert!(f64::from(tries) <= case.tries * points.len() as f64, "{tries} tries");
}

#[test]
fn a_torque_walks_over_both_folds() {
    let amplitude = Load::torque_nm(20.0, 0.0);
    check(&Case {
        beta1_deg: 0.0,
        beta2_deg: 60.0,
        amplitude,
        mode: ModeNumber::FIRST,
        shaker: None,
        unstable: 5,
        tries: 2.0,
    });
}

#[test]
fn a_force_at_the_tip_walks_over_both_folds() {
    let amplitude = Load::force_n(14.0, 0.0);
    check(&Case {
        beta1_deg: 30.0,
        beta2_deg: 60.0,
        amplitude,
        mode: ModeNumber::FIRST,
        shaker: None,
        unstable: 5,
        tries: 2.0,
    });
}

#[test]
fn a_hardening_arm_is_walked_as_well() {
    let amplitude = Load::torque_nm(10.0, 0.0);
    check(&Case {
        beta1_deg: 0.0,
        beta2_deg: 150.0,
        amplitude,
        mode: ModeNumber::FIRST,
        shaker: None,
        unstable: 0,
        tries: 2.0,
    });
}

#[test]
fn the_second_mode_is_walked_beside_the_first() {
    let amplitude = Load::torque_nm(20.0, 0.0);
    check(&Case {
        beta1_deg: 0.0,
        beta2_deg: 60.0,
        amplitude,
        mode: ModeNumber::SECOND,
        shaker: None,
        unstable: 0,
        tries: 3.0,
    });
}

/// The force on the arm is the head's reading, only part of the coil's force: the walk controls the fundamental of the
/// reading. The tip moves along an arc, so armature and suspension add harmonics to the force, as the square of the
/// amplitude; at 14 N they are as large as the fundamental, and the motion is no longer that of a pure sine.
#[test]
fn the_walk_works_with_a_shaker_s_armature() {
    let shaker = ShakerSpec {
        direction_deg: 0.0,
        amplifier: Amplifier::Current,
        moving_mass_kg: 0.05,
        stiffness_n_m: 500.0,
        damping_n_s_m: 5.0,
        force_factor_n_a: 20.0,
        resistance_ohm: 40.0,
        inductance_h: 1e-5,
        stroke_m: 0.2,
        current_limit_a: 30.0,
        voltage_limit_v: 1600.0,
    };
    // The coil's back-electromotive force has harmonics, too.
    for (amplifier, force_x_n) in [(Amplifier::Current, 5.0), (Amplifier::Voltage, 2.5)] {
        let amplitude = Load::force_n(force_x_n, 0.0);
        let shaker = Some(ShakerSpec { amplifier, ..shaker });
        check(&Case {
            beta1_deg: 30.0,
            beta2_deg: 60.0,
            amplitude,
            mode: ModeNumber::FIRST,
            shaker,
            unstable: 0,
            tries: 2.0,
        });
    }
}

/// A brake that takes 30 times as much force as the arm: the hold over a sample weakens it by 0.3 %, which is 9 % of
/// the arm's share. With more force the harmonics of the brake's force would change the response as well; with less,
/// the head's counts of 0.02 N would be too coarse, so they are finer here.
#[test]
fn the_walk_works_with_a_shaker_that_takes_most_of_the_force() {
    let shaker = Some(ShakerSpec {
        direction_deg: 0.0,
        amplifier: Amplifier::Current,
        moving_mass_kg: 0.1,
        stiffness_n_m: 2000.0,
        damping_n_s_m: 110.0,
        force_factor_n_a: 30.0,
        resistance_ohm: 6.0,
        inductance_h: 3e-4,
        stroke_m: 0.03,
        current_limit_a: 22.0,
        voltage_limit_v: 250.0,
    });
    let amplitude = Load::force_n(3.0, 0.0);
    let (beta1_deg, beta2_deg, mode) = (-76.5413, 120.0, ModeNumber::SECOND);
    let case = Case { beta1_deg, beta2_deg, amplitude, mode, shaker, unstable: 0, tries: 3.0 };
    let mut fine = quiet();
    fine.head.resolution = Some(1e-3);
    check_on(&case, case.plant_with(fine));
}

/// Where the lag is 90°, load and amplitude grow together, and the frequency follows the computed backbone.
#[test]
fn the_backbone_is_walked_at_quadrature() {
    let amplitude = Load::torque_nm(20.0, 0.0);
    let case = Case {
        beta1_deg: 0.0,
        beta2_deg: 60.0,
        amplitude,
        mode: ModeNumber::FIRST,
        shaker: None,
        unstable: 0,
        tries: 2.0,
    };
    let mut plant = case.plant();
    let points = case.walk_by(&mut plant, PhaseWalkSpec { points: 9, ..PhaseWalkSpec::backbone(amplitude) });
    let forced = case.forced(&amplitude);
    let at = most_moving(&case.tested(), &points);
    let mut options = BackboneOptions::new(&forced, 0, 1.0, 21.0, vec![at.dof]);
    options.branch.continuation.largest_turn_rad = 0.01;
    options.branch.continuation.largest_step = 0.02;
    let computed = backbone(&forced, &options).unwrap().points;
    let read = |readings: &[Reading]| size(readings[0].harmonic1);
    // In equal steps from a tenth of the load to the whole of it.
    for (point, load) in points.iter().zip((0..9).map(|k| 2.0 + 2.25 * f64::from(k))) {
        assert!(point.settled && (point.load / load - 1.0).abs() < 1.5e-3, "{load}: {point:?}");
        let a = amplitude_m(point, &at);
        let after = computed.iter().position(|orbit| read(&orbit.readings) > a).unwrap();
        let (low, high) = (&computed[after - 1], &computed[after]);
        let share = (a - read(&low.readings)) / (read(&high.readings) - read(&low.readings));
        let between = |low: f64, high: f64| low + share * (high - low);
        let frequency_hz = between(low.frequency_hz, high.frequency_hz);
        assert!((point.frequency_hz / frequency_hz - 1.0).abs() < FREQUENCY, "{load}: {frequency_hz} {point:?}");
        let drive = between(low.drive, high.drive);
        assert!((point.load / drive - 1.0).abs() < 2e-3, "{load}: {drive} {point:?}");
    }
    assert_eq!(points.len(), 9);
}

/// The displacement of C at about 0.06 rad of joint 1.
const HELD_M: f64 = 0.08;

/// At every frequency the load that holds the amplitude is the one whose computed response has it, on either side of
/// the resonance and in it, where the response is unstable at constant load.
#[test]
fn one_amplitude_is_held_by_the_computed_loads() {
    let amplitude = Load::torque_nm(200.0, 0.0);
    let case = Case {
        beta1_deg: 0.0,
        beta2_deg: 60.0,
        amplitude,
        mode: ModeNumber::FIRST,
        shaker: None,
        unstable: 0,
        tries: 2.0,
    };
    let mut plant = case.plant();
    let spec = ResponseControlSpec {
        amplitude,
        mode_number: case.mode,
        displacement_m: HELD_M,
        from_hz: 22.13,
        to_hz: 22.17,
        points: 9,
        cancel_harmonics: CancelHarmonics::NONE,
    };
    let tested = case.tested();
    let of = Modelled::new(&tested, &quiet()).unwrap();
    let points = drive(&mut PhaseWalk::new(spec, of, SAMPLING, 1600.0).unwrap(), &mut plant);
    assert_eq!(points.len(), 9);
    let forced = case.forced(&amplitude);
    let at = most_moving(&tested, &points);
    for (point, frequency_hz) in points.iter().zip((0..9).map(|k| 22.13 + 0.005 * f64::from(k))) {
        assert!(point.settled && (point.frequency_hz - frequency_hz).abs() < 1e-9, "{point:?}");
        let omega = core::f64::consts::TAU * point.frequency_hz;
        // Across the direction of C in the mode it moves by the third power of its amplitude alone.
        let [x, y] = point.acceleration_c_m_s2;
        let held_m = (x.norm_sqr() + y.norm_sqr()).sqrt() / (omega * omega);
        assert!((held_m / HELD_M - 1.0).abs() < 2e-3, "{point:?}");
        let ends = [0.1, 1.5 * point.load];
        let mut options = TraceOptions::new(&forced, Coordinate::Amplitude, ends, vec![at.dof]);
        options.branch.continuation.largest_turn_rad = 0.01;
        let branch = trace(&forced, point.frequency_hz, Coordinate::Amplitude, &options).unwrap();
        let a = amplitude_m(point, &at);
        let loads = branch.orbits.windows(2).filter_map(|pair| {
            let [low, high] = [&pair[0], &pair[1]].map(|orbit| size(orbit.readings[0].harmonic1));
            let share = (a - low) / (high - low);
            (0.0..=1.0).contains(&share).then(|| pair[0].value + share * (pair[1].value - pair[0].value))
        });
        let nearest = loads.min_by(|x, y| (x - point.load).abs().total_cmp(&(y - point.load).abs())).unwrap();
        assert!((point.load / nearest - 1.0).abs() < 2e-3, "{nearest} {point:?}");
    }
}
