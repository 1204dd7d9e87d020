//! Curves of folds and doublings, doubled branches, parameters and several drives: against the arm's own analysis, and
//! against independent code.

use super::*;
use crate::{ArmParameter, trace_singular as arm_curve, trace_singular_curves as arm_curves};
use resonarm_dynamics::structure::StructureError;
use std::string::ToString;

type ArmCoordinate = crate::Coordinate<ArmParameter>;

const ARM_HZ: ArmCoordinate = crate::Coordinate::FrequencyHz;
const ARM_AMPLITUDE: ArmCoordinate = crate::Coordinate::Parameter(ArmParameter::Amplitude);

fn arm_and_chain(beta2_deg: f64, torque_nm: f64) -> (ForcedArm, Forced) {
    let arm = arm_at(Preset::Irb1600Fitted, 0.0, beta2_deg);
    let chain = BodySpec::Chain(ChainSpec::from_arm(arm.parameters(), arm.pose()));
    let assembly = Assembly::new(&StructureSpec { body: chain, elements: vec![] }).unwrap();
    let joint = assembly.dof("joint1").unwrap();
    (ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), torque_nm), Forced::new(assembly, joint, torque_nm))
}

fn options(forced: &Forced, coordinate: Coordinate, ends: [f64; 2]) -> TraceOptions {
    let joints = ["joint1", "joint2"].map(|name| forced.assembly().dof(name).unwrap());
    TraceOptions::new(forced, coordinate, ends, joints.into())
}

fn traced(forced: &Forced, hz: f64, coordinate: Coordinate, ends: [f64; 2]) -> Branch {
    crate::structure::trace(forced, hz, coordinate, &options(forced, coordinate, ends)).unwrap()
}

/// The curve of folds at 60° leaves one fold of a branch, has a cusp, and returns at the other; also in the angle.
#[test]
fn curves_of_folds_of_a_chain_are_those_of_the_arm() {
    let (arm, chain) = arm_and_chain(60.0, 60.0);
    let arm_options = BranchOptions::new(21.0, 23.5);
    let (of_arm, of_chain) = (
        trace(arm.clone(), 21.0, ARM_HZ, &arm_options).unwrap(),
        traced(&chain, 21.0, Coordinate::FrequencyHz, [21.0, 23.5]),
    );
    let angle = chain.assembly().parameter("link2.angle_deg").unwrap();
    let second = [
        (ARM_AMPLITUDE, Coordinate::Amplitude, 5.0),
        (crate::Coordinate::Parameter(ArmParameter::Beta2Deg), Coordinate::Parameter(angle), 75.0),
    ];
    for (of_the_arm, coordinate, to) in second {
        let expected = arm_curves(&arm, &of_arm, ARM_HZ, of_the_arm, &arm_options.between(0.0, to));
        let in_second = options(&chain, coordinate, [0.0, to]);
        let got = trace_singular_curves(&chain, &of_chain, [Coordinate::FrequencyHz, coordinate], &in_second);
        assert_eq!(got.len(), expected.len(), "{coordinate}");
        for ((kind, got), (expected_kind, expected)) in got.into_iter().zip(expected) {
            let (got, expected) = (got.unwrap(), expected.unwrap());
            assert_eq!((kind, got.turns.len()), (expected_kind, expected.turns.len()), "{coordinate}");
            let at = |point: &SingularPoint| (point.lambda, point.mu);
            let at_arm = |point: &crate::SingularPoint| (point.lambda, point.mu);
            let [first, last] = [at(&got.points[0]), at(got.points.last().unwrap())];
            let [arm_first, arm_last] = [at_arm(&expected.points[0]), at_arm(expected.points.last().unwrap())];
            for ((lambda, mu), (arm_lambda, arm_mu)) in [(first, arm_first), (last, arm_last)] {
                near(lambda, arm_lambda, 1e-10);
                near(mu, arm_mu, 1e-10);
            }
            for (got, expected) in got.turns.iter().zip(&expected.turns) {
                assert_eq!(got.is_cusp, expected.is_cusp);
                near(got.point.lambda, expected.point.lambda, 1e-10);
                near(got.point.mu, expected.point.mu, 1e-8);
                near(got.point.orbit.readings[0].harmonic1.norm(), expected.point.harmonic1_rad[0], 1e-4);
            }
        }
    }
}

/// Near the 1:2 internal resonance: the doublings, the doubled branches, and a curve of doublings in the amplitude.
#[test]
fn doublings_and_doubled_branches_of_a_chain_are_those_of_the_arm() {
    let (arm, chain) = arm_and_chain(75.0, 800.0);
    let arm_options = BranchOptions::new(40.0, 50.0);
    let of_arm = trace(arm.clone(), 40.0, ARM_HZ, &arm_options).unwrap();
    let of_chain = traced(&chain, 40.0, Coordinate::FrequencyHz, [40.0, 50.0]);
    let same = |got: &[Bifurcation], expected: &[crate::Bifurcation]| {
        let kinds: Vec<_> = expected.iter().map(|found| found.kind).collect();
        assert_eq!(got.iter().map(|found| found.kind).collect::<Vec<_>>(), kinds);
        for (got, expected) in got.iter().zip(expected) {
            // Neimark–Sacker points are where the multipliers of the flow are on the circle.
            let tolerance = if got.kind == BifurcationKind::NeimarkSacker { 1e-9 } else { 1e-10 };
            near(got.orbit.value, expected.orbit.value, tolerance);
            near(got.orbit.readings[1].harmonic1.norm(), expected.orbit.harmonic1_rad[1], 1e3 * tolerance);
        }
    };
    same(&of_chain.bifurcations, &of_arm.bifurcations);
    let in_hz = options(&chain, Coordinate::FrequencyHz, [40.0, 50.0]);
    let doubled = trace_doublings(&chain, &of_chain, Coordinate::FrequencyHz, &in_hz);
    let expected = crate::trace_doublings(&arm, &of_arm, ARM_HZ, &arm_options);
    assert_eq!(doubled.len(), expected.len());
    for (got, expected) in doubled.into_iter().zip(expected) {
        let (got, expected) = (got.unwrap(), expected.unwrap());
        assert!(got.orbits.iter().all(|orbit| orbit.period == 2));
        same(&got.bifurcations, &expected.bifurcations);
    }
    let amplitude = options(&chain, Coordinate::Amplitude, [800.0, 1200.0]);
    let coordinates = [Coordinate::FrequencyHz, Coordinate::Amplitude];
    let got = trace_singular(&chain, &of_chain.bifurcations[5], coordinates, &amplitude).unwrap();
    let in_amplitude = BranchOptions::new(800.0, 1200.0);
    let expected = arm_curve(arm, &of_arm.bifurcations[5], ARM_HZ, ARM_AMPLITUDE, &in_amplitude).unwrap();
    near(got.points.last().unwrap().lambda, expected.points.last().unwrap().lambda, 1e-10);
}

/// Branches in parameters of the structure have the bifurcations that the arm's have in its own.
#[test]
fn branches_in_any_parameter_are_those_of_the_arm() {
    let cases = [
        (ArmParameter::Beta2Deg, "link2.angle_deg", 22.1, [50.0, 70.0]),
        (ArmParameter::Mass2, "link2.mass_kg", 22.1, [46.0, 55.0]),
        (ArmParameter::Stiffness2, "link2.stiffness_nm_rad", 22.1, [120e3, 134e3]),
    ];
    for (of_arm, name, hz, ends) in cases {
        let (arm, chain) = arm_and_chain(60.0, 60.0);
        let arm_options = BranchOptions::new(ends[0], ends[1]);
        let expected = trace(arm, hz, crate::Coordinate::Parameter(of_arm), &arm_options).unwrap();
        let parameter = chain.assembly().parameter(name).unwrap();
        let got = traced(&chain, hz, Coordinate::Parameter(parameter), ends);
        assert_eq!(got.bifurcations.len(), expected.bifurcations.len(), "{name}");
        for (got, expected) in got.bifurcations.iter().zip(&expected.bifurcations) {
            assert_eq!(got.kind, expected.kind, "{name}");
            near(got.orbit.value, expected.orbit.value, 1e-10);
        }
        let [got, expected] =
            [&got.orbits.last().unwrap().readings[0].largest, &expected.orbits.last().unwrap().amplitude_rad[0]];
        near(*got, *expected, 1e-9);
    }
}

/// A torque and a force of a direction, in phase.
#[test]
fn several_drives_act_at_once() {
    let (arm, chain) = arm_and_chain(60.0, 1.0);
    let load = Load { torque_nm: [1.0, 0.0].into(), force_n: [0.5, -0.7].into() };
    let arm = ForcedArm::new(arm.arm().clone(), load, 50.0);
    let drives = [("joint1", 1.0), ("tip.x", 0.5), ("tip.y", -0.7)];
    let drives = drives.map(|(name, share)| (chain.assembly().dof(name).unwrap(), share));
    let chain = Forced::at_several(chain.assembly().clone(), &drives, 50.0);
    assert_eq!(chain.unit(), "times the drive");
    let expected = trace(arm, 21.0, ARM_HZ, &BranchOptions::new(21.0, 23.5)).unwrap();
    let got = traced(&chain, 21.0, Coordinate::FrequencyHz, [21.0, 23.5]);
    assert_eq!(got.bifurcations.len(), expected.bifurcations.len());
    for (got, expected) in got.bifurcations.iter().zip(&expected.bifurcations) {
        near(got.orbit.value, expected.orbit.value, 1e-10);
    }
}

/// A mode with a spring that hardens: x″ + 2·0.02 x′ + x + x³ = A sin Ωt.
fn duffing(amplitude: f64) -> Forced {
    let modes = vec![ModeSpec { frequency_hz: 1.0 / TAU, damping_ratio: 0.02 }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }];
    let law = Law::Cubic { stiffness3: 1.0, stiffness5: 0.0 };
    let elements = vec![ElementSpec { at: place("tip.x"), to: None, law }];
    let body = BodySpec::Modal(ModalSpec { modes, shapes });
    let assembly = Assembly::new(&StructureSpec { body, elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    Forced::new(assembly, tip, amplitude)
}

/// Folds and cusp of a spring that hardens are those of independent code: harmonic balance with 25 harmonics in NumPy,
/// with the null vector, and at the cusp wᵀR_qq(v, v) = 0, among the unknowns of one extended system.
#[test]
fn folds_and_cusp_of_a_mode_with_a_spring_are_those_of_independent_code() {
    let forced = duffing(0.1);
    let tip = forced.drives()[0].0;
    let hz = |rate: f64| rate / TAU;
    let options = |coordinate, ends| TraceOptions::new(&forced, coordinate, ends, vec![tip]);
    let in_amplitude = options(Coordinate::Amplitude, [0.0, 0.2]);
    let branch = crate::structure::trace(&forced, hz(1.2), Coordinate::Amplitude, &in_amplitude).unwrap();
    let folds = of_kind(&branch, BifurcationKind::Fold);
    near(folds[0].value, 0.131_177_737_928_744_4, 1e-9);
    near(folds[1].value, 0.036_523_310_331_124_28, 1e-9);
    let coordinates = [Coordinate::Amplitude, Coordinate::FrequencyHz];
    let down = options(Coordinate::FrequencyHz, [hz(1.2), hz(1.0)]);
    let mut curves = trace_singular_curves(&forced, &branch, coordinates, &down);
    assert_eq!(curves.len(), 1);
    let curve = curves.remove(0).1.unwrap();
    near(curve.points.last().unwrap().lambda, folds[1].value, 1e-9);
    let [turn] = &curve.turns[..] else { panic!("{:?}", curve.turns) };
    assert!(turn.is_cusp);
    near(turn.point.mu * TAU, 1.035_199_139_277_289, 1e-8);
    near(turn.point.lambda, 0.012_051_072_416_208_6, 1e-8);
    for (to, expected) in [
        (1.3, [0.255_646_358_844_787_8, 0.049_531_274_032_124_01]),
        (1.5, [0.620_388_660_127_435_1, 0.076_875_878_568_456_48]),
    ] {
        let up = options(Coordinate::FrequencyHz, [hz(1.2), hz(to)]);
        for ((_, curve), expected) in
            trace_singular_curves(&forced, &branch, coordinates, &up).into_iter().zip(expected)
        {
            near(curve.unwrap().points.last().unwrap().lambda, expected, 1e-9);
        }
    }
}

/// The curve of folds of a structure with a stop on one side ends at the folds of a branch at the other value: of the
/// amplitude and of the gap.
#[test]
fn curves_of_folds_with_a_contact_end_on_other_branches() {
    let cases = oracles("modal");
    let case = cases.iter().find(|case| case["elements"][0]["kind"] == "contact").unwrap();
    let assembly = modal(case);
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, number(case, "force_n"));
    let ends = [number(case, "from_hz"), number(case, "to_hz")];
    let traced = |forced: &Forced| {
        let mut options = TraceOptions::new(forced, Coordinate::FrequencyHz, ends, vec![tip]);
        options.assess = Assess::Nothing;
        super::super::trace(forced, ends[0], Coordinate::FrequencyHz, &options).unwrap()
    };
    let branch = traced(&forced);
    let fold = branch.bifurcations.iter().rfind(|found| found.kind == BifurcationKind::Fold).unwrap();
    let gap = forced.assembly().parameter("element1.gap_m").unwrap();
    let wider = 1.1 * forced.assembly().value(gap).unwrap();
    let louder = 1.1 * forced.amplitude();
    let changed = [
        (Coordinate::Amplitude, louder, Forced::new(forced.assembly().clone(), tip, louder)),
        (
            Coordinate::Parameter(gap),
            wider,
            Forced::new(forced.assembly().with(gap, wider).unwrap(), tip, forced.amplitude()),
        ),
    ];
    for (coordinate, to, other) in changed {
        let options = TraceOptions::new(&forced, coordinate, [0.9 * to, to], vec![tip]);
        let curve = trace_singular(&forced, fold, [Coordinate::FrequencyHz, coordinate], &options).unwrap();
        let there = traced(&other);
        let folds = of_kind(&there, BifurcationKind::Fold);
        near(curve.points.last().unwrap().lambda, folds.last().unwrap().value, 1e-7);
    }
}

/// The derivatives of the rows by parameters, of a chain and of modes, are those of differences.
#[test]
fn derivatives_by_parameters_are_those_of_differences() {
    let (_, chain) = arm_and_chain(60.0, 60.0);
    for (forced, hz) in [(chain, 22.0), (duffing(0.1), 0.2)] {
        for parameter in forced.assembly().parameters() {
            let mut balance = Balance::new(&forced, hz, Coordinate::Parameter(parameter), 3);
            let n = balance.dimension();
            let x: Vec<f64> = (0..n).map(|i| 0.05 * libm::sin(1.0 + 1.7 * i as f64)).collect();
            let (mut matrix, value) = (vec![0.0; (n + 1) * (n + 1)], forced.assembly().value(parameter).unwrap());
            let mut residual = |value: f64| {
                let mut out = vec![0.0; n];
                assert!(balance.evaluate(&x, value, &mut out, &mut matrix), "{parameter}");
                (out, matrix[n * (n + 1)..n * (n + 1) + n].to_vec())
            };
            // Some have no values below zero.
            let at = if value == 0.0 { 0.1 } else { value };
            let h = 1e-4 * at;
            let [above, below] = [at + h, at - h].map(|value| residual(value).0);
            let column = residual(at).1;
            let size = column.iter().fold(1e-6_f64, |size, by| size.max(by.abs()));
            for i in 0..n {
                let seen = (above[i] - below[i]) / (2.0 * h);
                assert!((column[i] - seen).abs() < 1e-5 * size, "{parameter} row {i}: {} {seen}", column[i]);
            }
        }
    }
}

#[test]
fn a_parameter_that_does_not_exist_is_refused() {
    let forced = duffing(0.1);
    let names = forced.assembly().parameters().iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(
        names,
        ["mode1.frequency_hz", "mode1.damping_ratio", "element1.stiffness3_n_m3", "element1.stiffness5_n_m5"]
    );
    assert!(matches!(forced.assembly().parameter("link1.mass_kg"), Err(StructureError::UnknownParameter { .. })));
}
