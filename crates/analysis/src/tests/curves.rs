//! Curves of folds and doublings, doubled branches, parameters and several drives: against what the arm's own analysis
//! gave, and against independent code.

use super::arm::{numbers, oracles_of_the_arm, pair};
use super::*;
use resonarm_dynamics::structure::StructureError;
use std::string::ToString;

fn options(forced: &Forced, coordinate: Coordinate, ends: [f64; 2]) -> TraceOptions {
    let joints = ["joint1", "joint2"].map(|name| forced.assembly().dof(name).unwrap());
    TraceOptions::new(forced, coordinate, ends, joints.into())
}

fn traced(forced: &Forced, hz: f64, coordinate: Coordinate, ends: [f64; 2]) -> Branch {
    crate::trace(forced, hz, coordinate, &options(forced, coordinate, ends)).unwrap()
}

/// The curves of folds and doublings in the load, the angle and the stiffness, at both ends and where they turn back, are
/// those of the arm: at 60° the curve of folds leaves one fold of a branch, has a cusp, and returns at the other.
#[test]
fn curves_of_a_chain_are_those_of_the_arm() {
    let cases = oracles_of_the_arm();
    let cases = cases["curves"].as_array().unwrap();
    let key = |case: &Value| ["beta2_deg", "torque1_nm", "to"].map(|key| number(case, key));
    for cases in cases.chunk_by(|a, b| key(a) == key(b)) {
        let case = &cases[0];
        let chain = chain_under(number(case, "beta2_deg"), number(case, "torque1_nm"));
        let (ends, to) = (pair(&case["hz"]), number(case, "to"));
        let of = |name: &str| Coordinate::Parameter(chain.assembly().parameter(name).unwrap());
        let coordinate = match case["parameter"].as_str().unwrap() {
            "amplitude" => Coordinate::Amplitude,
            "beta2_deg" => of("link2.angle_deg"),
            "stiffness2_nm_rad" => of("link2.stiffness_nm_rad"),
            other => panic!("{other}"),
        };
        let branch = traced(&chain, ends[0], Coordinate::FrequencyHz, ends);
        let in_second = options(&chain, coordinate, [0.0, to]);
        let got = trace_singular_curves(&chain, &branch, [Coordinate::FrequencyHz, coordinate], &in_second);
        assert_eq!(got.len(), cases.len(), "{coordinate}");
        for ((kind, got), case) in got.into_iter().zip(cases) {
            let (got, expected) = (got.unwrap(), &case["curve"]);
            assert_eq!(kind.name(), case["kind"]);
            let some = expected["some"].as_array().unwrap();
            for (got, expected) in [(got.points.first(), some.first()), (got.points.last(), some.last())] {
                let (got, expected) = (got.unwrap(), expected.unwrap());
                near(got.lambda, number(expected, "lambda"), 1e-10);
                near(got.mu, number(expected, "mu"), 1e-10);
            }
            let turns = expected["turns"].as_array().unwrap();
            assert_eq!(got.turns.len(), turns.len(), "{coordinate}");
            for (got, expected) in got.turns.iter().zip(turns) {
                let point = &expected["point"];
                assert_eq!(got.is_cusp, expected["is_cusp"]);
                near(got.point.lambda, number(point, "lambda"), 1e-10);
                near(got.point.mu, number(point, "mu"), 1e-8);
                near(got.point.orbit.readings[0].harmonic1.norm(), numbers(&point["harmonic1_rad"])[0], 1e-4);
            }
        }
    }
}

/// Near the 1:2 internal resonance the second zone loses its period: the branches of the doubled period leave at one
/// period doubling, join at another, and have the bifurcations of the arm's on their way.
#[test]
fn doubled_branches_of_a_chain_are_those_of_the_arm() {
    let cases = oracles_of_the_arm();
    let case = cases["branches"].as_array().unwrap().iter().find(|case| case["doubled"][0].is_object()).unwrap();
    let chain = chain_under(number(case, "beta2_deg"), number(case, "torque1_nm"));
    let ends = pair(&case["hz"]);
    let branch = traced(&chain, ends[0], Coordinate::FrequencyHz, ends);
    let in_hz = options(&chain, Coordinate::FrequencyHz, ends);
    let leaving = crate::OtherOptions { leaving: true, search: None };
    let switched = trace_branches(&chain, &branch, Coordinate::FrequencyHz, &in_hz, &leaving);
    let doubled: Vec<_> = switched.branches.into_iter().filter(|switched| switched.origin.parent == Some(0)).collect();
    let expected = case["doubled"].as_array().unwrap();
    assert_eq!(doubled.len(), expected.len());
    for (got, expected) in doubled.into_iter().zip(expected) {
        let got = got.traced.unwrap();
        assert!(got.orbits.iter().all(|orbit| orbit.period == 2));
        let bifurcations = expected["bifurcations"].as_array().unwrap();
        assert_eq!(got.bifurcations.len(), bifurcations.len());
        for (got, expected) in got.bifurcations.iter().zip(bifurcations) {
            assert_eq!(got.kind.name(), expected["kind"]);
            // Neimark–Sacker points are where the multipliers of the flow are on the circle.
            let tolerance = if got.kind == BifurcationKind::NeimarkSacker { 1e-9 } else { 1e-10 };
            near(got.orbit.value, number(&expected["orbit"], "value"), tolerance);
            let harmonic1 = numbers(&expected["orbit"]["harmonic1_rad"])[1];
            near(got.orbit.readings[1].harmonic1.norm(), harmonic1, 1e3 * tolerance);
        }
    }
}

/// Branches in parameters of the structure have the folds, and end in the periodic responses, that the arm's had in its
/// own.
#[test]
fn branches_in_any_parameter_are_those_of_the_arm() {
    let cases = [
        ("link2.angle_deg", [50.0, 70.0], [60.677_273_375_241_63, 59.390_233_336_227_645], 0.001_634_542_201_303_282_3),
        ("link2.mass_kg", [46.0, 55.0], [50.771_163_035_110_6, 50.382_628_895_949_765], 0.001_396_442_607_605_622_4),
        (
            "link2.stiffness_nm_rad",
            [120e3, 134e3],
            [131_607.731_678_253_74, 124_875.758_511_011_1],
            0.009_000_727_062_517_47,
        ),
    ];
    for (name, ends, folds, last_rad) in cases {
        let chain = chain_under(60.0, 60.0);
        let parameter = chain.assembly().parameter(name).unwrap();
        let got = traced(&chain, 22.1, Coordinate::Parameter(parameter), ends);
        assert_eq!(got.bifurcations.len(), 2, "{name}");
        for (got, expected) in got.bifurcations.iter().zip(folds) {
            assert_eq!(got.kind, BifurcationKind::Fold, "{name}");
            near(got.orbit.value, expected, 1e-10);
        }
        near(got.orbits.last().unwrap().readings[0].largest, last_rad, 1e-9);
    }
}

/// A torque and a force of a direction act in phase: small vibrations are the sum of the responses to each.
#[test]
fn several_drives_act_at_once() {
    let assembly = chain_of(60.0);
    let drives = [("joint1", 1.0), ("tip.x", 0.5), ("tip.y", -0.7)];
    let drives = drives.map(|(name, share)| (assembly.dof(name).unwrap(), share));
    let chain = Forced::at_several(assembly.clone(), &drives, 1e-3);
    assert_eq!(chain.unit(), "times the drive");
    let (linear, [joint1, ..]) = (LinearResponse::new(&assembly), drives.map(|(dof, _)| dof));
    let branch = traced(&chain, 21.0, Coordinate::FrequencyHz, [21.0, 23.5]);
    for orbit in &branch.orbits {
        let one = |(dof, share): &(Dof, f64)| {
            linear.at(Quantity::Receptance, *dof, joint1, orbit.frequency_hz).unwrap() * (1e-3 * share)
        };
        let expected: Complex<f64> = drives.iter().map(one).sum();
        assert!((orbit.readings[0].harmonic1 - expected).norm() < 1e-4 * expected.norm(), "{orbit:?} {expected}");
    }
}

/// A mode with a spring that hardens: x″ + 2·0.02 x′ + x + x³ = A sin Ωt.
fn duffing(amplitude: f64) -> Forced {
    let modes = vec![ModeSpec { frequency_hz: 1.0 / TAU, damping_ratio: 0.02 }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }];
    let law = Law::Cubic { stiffness3: 1.0, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: place("tip.x"), to: None, law }];
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
    let branch = crate::trace(&forced, hz(1.2), Coordinate::Amplitude, &in_amplitude).unwrap();
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
    for (forced, hz) in [(chain_under(60.0, 60.0), 22.0), (duffing(0.1), 0.2)] {
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
