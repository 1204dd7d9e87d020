//! Folds of forced branches against independent numbers (`tests/oracles/oracles.json`: harmonic balance with nine
//! harmonics, the first case equal to AUTO-07p in all its printed digits).

use resonarm::analysis::{BifurcationKind, Branch, BranchOptions, Coordinate, ForcedArm, modes, trace};
use resonarm::arm::{Arm, Load, Parameters, Pose, Preset};
use serde_json::Value;

fn number(case: &Value, key: &str) -> f64 {
    case[key].as_f64().unwrap_or_else(|| panic!("{key} in {case}"))
}

fn pair(value: &Value) -> [f64; 2] {
    [value[0].as_f64().unwrap(), value[1].as_f64().unwrap()]
}

fn forced(case: &Value) -> ForcedArm {
    let parameters = Parameters {
        inertia2_kg_m2: number(case, "I_S2"),
        length2_m: number(case, "l2"),
        ..Preset::Irb1600Fitted.parameters().unwrap()
    };
    let pose = Pose { beta1_deg: number(case, "beta1_deg"), beta2_deg: number(case, "beta2_deg") };
    let load =
        Load { torque_nm: [number(case, "torque1_nm"), 0.0].into(), force_n: [number(case, "force_x_n"), 0.0].into() };
    ForcedArm::new(Arm::new(parameters, pose).unwrap(), load, 1.0)
}

fn folds(branch: &Branch) -> Vec<(f64, [f64; 2], [f64; 2])> {
    let folds = branch.bifurcations.iter().filter(|b| b.kind == BifurcationKind::Fold);
    folds.map(|fold| (fold.orbit.frequency_hz, fold.orbit.harmonic1_rad, fold.orbit.amplitude_rad)).collect()
}

#[test]
fn folds_and_peaks_are_those_of_the_oracles_in_both_directions() {
    let oracles: Value = serde_json::from_str(include_str!("../oracles/oracles.json")).unwrap();
    let cases = oracles["branches"].as_array().unwrap();
    assert_eq!(cases.len(), 6);
    for case in cases {
        let (from, to) = (number(case, "from_hz"), number(case, "to_hz"));
        let traced =
            |from, to| trace(forced(case), from, Coordinate::FrequencyHz, &BranchOptions::new(from, to)).unwrap();
        let (up, down) = (traced(from, to), traced(to, from));
        let (found, mut back) = (folds(&up), folds(&down));
        back.reverse();
        assert_eq!(found.len(), back.len(), "{case}");
        for (a, b) in found.iter().zip(&back) {
            assert!((a.0 / b.0 - 1.0).abs() < 1e-10, "{} {} Hz", a.0, b.0);
        }
        // The oracles cover the zone of the first mode.
        let expected = case["folds"].as_array().unwrap();
        let peak_hz = number(case, "peak_hz");
        let near: Vec<_> = found.iter().filter(|fold| (fold.0 / peak_hz - 1.0).abs() < 0.1).collect();
        assert_eq!(near.len(), expected.len(), "{case}: {found:?}");
        for expected in expected {
            let frequency = number(expected, "frequency_hz");
            let fold = near.iter().find(|fold| (fold.0 / frequency - 1.0).abs() < 1e-9);
            let Some((_, harmonic1, amplitude)) = fold else { panic!("{frequency} Hz is not in {near:?}") };
            for dof in 0..2 {
                assert!((harmonic1[dof] / pair(&expected["harmonic1_rad"])[dof] - 1.0).abs() < 1e-5);
                // The oracle's amplitude is the largest of its samples.
                assert!((amplitude[dof] / pair(&expected["amplitude_rad"])[dof] - 1.0).abs() < 1e-3);
            }
        }
        let peak = pair(&case["peak_harmonic1_rad"])[0];
        let highest = up.orbits.iter().fold(0.0_f64, |highest, orbit| highest.max(orbit.harmonic1_rad[0]));
        assert!(highest < peak * (1.0 + 1e-5) && highest > 0.9 * peak, "{highest} {peak}");
    }
}

/// Two resonance zones in one continuation, at an amplitude at which it is easily lost on the way.
#[test]
fn both_zones_are_walked_whole_in_both_directions() {
    let parameters = Preset::Irb1600Fitted.parameters().unwrap();
    let arm = Arm::new(parameters, Pose { beta1_deg: 30.0, beta2_deg: 120.0 }).unwrap();
    for amplitude_n in [5.0, 20.0, 60.0, 100.0] {
        let forced = ForcedArm::new(arm.clone(), Load::force_n(1.0, 0.0), amplitude_n);
        let traced = |from, to| {
            let branch = trace(forced.clone(), from, Coordinate::FrequencyHz, &BranchOptions::new(from, to)).unwrap();
            assert_eq!(branch.orbits.last().unwrap().frequency_hz, to);
            branch
        };
        let (up, mut down) = (traced(20.0, 60.0), traced(60.0, 20.0));
        down.bifurcations.reverse();
        // Below 20 N the resonances do not bend far enough for folds; the branch passes both all the same.
        let natural = modes(&arm).map(|mode| mode.frequency_hz);
        for (joint, natural_hz) in natural.into_iter().enumerate() {
            let near = up.orbits.iter().filter(|orbit| (orbit.frequency_hz / natural_hz - 1.0).abs() < 0.01);
            let [top, elsewhere] =
                [near.map(|orbit| orbit.harmonic1_rad[joint]).fold(0.0, f64::max), up.orbits[0].harmonic1_rad[joint]];
            assert!(top > 100.0 * elsewhere, "{amplitude_n} N, {natural_hz} Hz: {top} {elsewhere}");
        }
        assert_eq!(folds(&up).is_empty(), amplitude_n < 20.0, "{amplitude_n} N: {:?}", folds(&up));
        assert_eq!(up.bifurcations.len(), down.bifurcations.len());
        for (a, b) in up.bifurcations.iter().zip(&down.bifurcations) {
            assert_eq!(a.kind, b.kind);
            assert!((a.orbit.frequency_hz / b.orbit.frequency_hz - 1.0).abs() < 1e-10);
        }
    }
}
