//! The phase walk against the independent branches of harmonic balance: by the accelerometers' readings every settled
//! point is on the branch, stable or not.

use resonarm::analysis::{
    ArmParameter, BackboneOptions, Branch, BranchOptions, Coordinate, Distances, ForcedArm, MeasuredMotion, backbone,
    nearest, trace,
};
use resonarm::arm::{Arm, Pose, Preset};
use resonarm::control::{
    Answer, CancelHarmonics, Controller, JointAngles, ModeNumber, PhaseWalk, PhaseWalkSpec, ResponseControlSpec,
    ResponsePoint,
};
use resonarm::excitation::Amplitude;
use resonarm::integrate::Scheme;
use resonarm::plant::{Plant, PlantSpec, TestedAssembly};
use resonarm::rig::{Amplifier, Converter, RigSpec, Sampling, ShakerSpec};
use resonarm_dynamics::structure::{Assembly, BodySpec, ChainSpec, StructureSpec};

const RATE_HZ: f64 = 1000.0;
const SAMPLING: Sampling = Sampling { rate_hz: RATE_HZ, converter: Converter::Sinc5 };
/// The bounds of a point: frequency and amplitude, relative.
const FREQUENCY: f64 = 2e-5;
const BOUNDS: Distances = Distances { frequency: FREQUENCY, amplitude: 1e-3 };

struct Case {
    beta1_deg: f64,
    beta2_deg: f64,
    amplitude: Amplitude,
    mode: ModeNumber,
    shaker: Option<ShakerSpec>,
    /// The fewest unstable motions on the walk.
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
        let arm = self.arm();
        let body = BodySpec::Chain(ChainSpec::from_arm(arm.parameters(), arm.pose()));
        let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
        Plant::new(&self.spec(rig), &TestedAssembly::at_rest(assembly, "tip", "joint2")).unwrap()
    }

    /// The arm, with the armature of a shaker.
    fn arm(&self) -> Arm {
        let pose = Pose { beta1_deg: self.beta1_deg, beta2_deg: self.beta2_deg };
        let arm = Arm::new(Preset::Irb1600Fitted.parameters().unwrap(), pose).unwrap();
        match &self.shaker {
            Some(shaker) => arm.with_attachment(shaker.armature()).unwrap(),
            None => arm,
        }
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
        let limit = if self.amplitude.is_torque() { 1600.0 } else { 600.0 };
        drive(&mut PhaseWalk::new(spec, &self.arm(), SAMPLING, limit).unwrap(), plant)
    }

    /// The branch around the points, in steps so small that it is straight between its motions.
    fn branch(&self, arm: &Arm, points: &[ResponsePoint]) -> Branch {
        let (low, high) = points.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), point| {
            (low.min(point.frequency_hz), high.max(point.frequency_hz))
        });
        let mut options = BranchOptions::new(0.98 * low, 1.02 * high);
        options.continuation.largest_turn_rad = 0.01;
        options.most_points = 100_000;
        let forced = ForcedArm::new(arm.clone(), self.amplitude.load(), 1.0);
        trace(forced, 0.98 * low, Coordinate::FrequencyHz, &options).unwrap()
    }
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
    let arm = case.arm();
    let branch = case.branch(&arm, &points);
    // The joint that moves most in the mode.
    let joint = usize::from(u8::from(case.mode) - 1);
    let mut unstable = 0;
    for point in &points {
        assert!(point.settled, "{point:?}");
        // The load is within 0.11 % of the wanted one. With an ideal exciter it is the command, and the angle at a lag
        // is proportional to it. With a shaker it is read, with noise.
        let load = case.amplitude.load();
        let part = point.load / libm::hypot(load.force_n.norm(), load.torque_nm.norm());
        assert!((part - 1.0).abs() < 1.1e-3, "{point:?}");
        let scale = if case.shaker.is_none() { part } else { 1.0 };
        let harmonic1_rad = JointAngles::of(point, &case.arm()).harmonic1_rad().map(|angle_rad| angle_rad / scale);
        let measured = MeasuredMotion { frequency_hz: point.frequency_hz, harmonic1_rad };
        let place = nearest(&branch, &measured, joint, BOUNDS).unwrap();
        let distance = place.distance;
        assert!(distance < 1.0, "{} Hz, {:?}: {distance}", point.frequency_hz, case.shaker);
        unstable += usize::from(!place.is_stable);
    }
    assert!(unstable >= case.unstable, "{unstable} unstable motions");
    let tries: u32 = points.iter().map(|point| point.tries).sum();
    assert!(f64::from(tries) <= case.tries * points.len() as f64, "{tries} tries");
}

#[test]
fn a_torque_walks_over_both_folds() {
    let amplitude = Amplitude { torque1_nm: 20.0, ..Amplitude::default() };
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
    let amplitude = Amplitude { force_x_n: 14.0, ..Amplitude::default() };
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
    let amplitude = Amplitude { torque1_nm: 10.0, ..Amplitude::default() };
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
    let amplitude = Amplitude { torque1_nm: 20.0, ..Amplitude::default() };
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
        let amplitude = Amplitude { force_x_n, ..Amplitude::default() };
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
    let amplitude = Amplitude { force_x_n: 3.0, ..Amplitude::default() };
    let (beta1_deg, beta2_deg, mode) = (-76.5413, 120.0, ModeNumber::SECOND);
    let case = Case { beta1_deg, beta2_deg, amplitude, mode, shaker, unstable: 0, tries: 3.0 };
    let mut fine = quiet();
    fine.head.resolution = Some(1e-3);
    check_on(&case, case.plant_with(fine));
}

/// Where the lag is 90°, load and amplitude grow together, and the frequency follows the computed backbone.
#[test]
fn the_backbone_is_walked_at_quadrature() {
    let amplitude = Amplitude { torque1_nm: 20.0, ..Amplitude::default() };
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
    let direction = Amplitude { torque1_nm: 1.0, ..amplitude }.load();
    let mut branch = BranchOptions::new(20.0, 24.0);
    branch.continuation.largest_turn_rad = 0.01;
    branch.continuation.largest_step = 0.02;
    let options = BackboneOptions { smallest_rad: 1e-3, largest_rad: 1.0, largest_drive: 21.0, branch };
    let computed = backbone(ForcedArm::new(case.arm(), direction, 1.0), 0, ArmParameter::Amplitude, &options);
    let computed = computed.unwrap().points;
    for (point, load) in points.iter().zip((0..9).map(|k| 2.0 + 2.25 * f64::from(k))) {
        assert!(point.settled && (point.load / load - 1.0).abs() < 1.5e-3, "{load}: {point:?}");
        let a = JointAngles::of(point, &case.arm()).harmonic1_rad()[0];
        let after = computed.iter().position(|motion| motion.harmonic1_rad[0] > a).unwrap();
        let (low, high) = (&computed[after - 1], &computed[after]);
        let share = (a - low.harmonic1_rad[0]) / (high.harmonic1_rad[0] - low.harmonic1_rad[0]);
        let between = |low: f64, high: f64| low + share * (high - low);
        let frequency_hz = between(low.frequency_hz, high.frequency_hz);
        assert!((point.frequency_hz / frequency_hz - 1.0).abs() < FREQUENCY, "{load}: {frequency_hz} {point:?}");
        let drive = between(low.drive, high.drive);
        assert!((point.load / drive - 1.0).abs() < 2e-3, "{load}: {drive} {point:?}");
    }
    assert_eq!(points.len(), 9);
}

/// At every frequency the load that holds the amplitude is the one whose computed motion has it, on either side of the
/// resonance and in it, where the motion is unstable at constant load.
#[test]
fn one_amplitude_is_held_by_the_computed_loads() {
    let amplitude = Amplitude { torque1_nm: 200.0, ..Amplitude::default() };
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
        angle_rad: Some(0.06),
        displacement_m: None,
        from_hz: 22.13,
        to_hz: 22.17,
        points: 9,
        cancel_harmonics: CancelHarmonics::NONE,
    };
    let points = drive(&mut PhaseWalk::at_one_amplitude(spec, &case.arm(), SAMPLING, 1600.0).unwrap(), &mut plant);
    assert_eq!(points.len(), 9);
    let direction = Amplitude { torque1_nm: 1.0, ..amplitude }.load();
    let forced = ForcedArm::new(case.arm(), direction, 1.0);
    for (point, frequency_hz) in points.iter().zip((0..9).map(|k| 22.13 + 0.005 * f64::from(k))) {
        assert!(point.settled && (point.frequency_hz - frequency_hz).abs() < 1e-9, "{point:?}");
        let a = JointAngles::of(point, &case.arm()).harmonic1_rad()[0];
        assert!((a / 0.06 - 1.0).abs() < 2e-3, "{point:?}");
        let mut options = BranchOptions::new(0.1, 1.5 * point.load);
        options.continuation.largest_turn_rad = 0.01;
        let coordinate = Coordinate::Parameter(ArmParameter::Amplitude);
        let branch = trace(forced.clone(), point.frequency_hz, coordinate, &options).unwrap();
        let loads = branch.orbits.windows(2).filter_map(|pair| {
            let [low, high] = [pair[0].harmonic1_rad[0], pair[1].harmonic1_rad[0]];
            let share = (a - low) / (high - low);
            (0.0..=1.0).contains(&share).then(|| pair[0].value + share * (pair[1].value - pair[0].value))
        });
        let nearest = loads.min_by(|x, y| (x - point.load).abs().total_cmp(&(y - point.load).abs())).unwrap();
        assert!((point.load / nearest - 1.0).abs() < 2e-3, "{nearest} {point:?}");
    }
}
