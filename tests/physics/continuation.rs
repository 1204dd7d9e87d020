//! Folds of forced branches against independent numbers (`tests/oracles/oracles.json`: harmonic balance with nine
//! harmonics, the first case equal to AUTO-07p in all its printed digits).

use resonarm::analysis::BifurcationKind;
use resonarm::analysis::{Branch, Coordinate, Forced, Reading, TraceOptions, trace};
use resonarm::structure::{Assembly, BodySpec, ChainSpec, Dof, Preset, StructureSpec};
use serde_json::Value;

fn number(case: &Value, key: &str) -> f64 {
    case[key].as_f64().unwrap_or_else(|| panic!("{key} in {case}"))
}

fn pair(value: &Value) -> [f64; 2] {
    [value[0].as_f64().unwrap(), value[1].as_f64().unwrap()]
}

/// The fitted arm with its links at angles, degrees.
fn fitted(angles_deg: [f64; 2]) -> ChainSpec {
    Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&angles_deg)
}

fn assembly(chain: ChainSpec) -> Assembly {
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap()
}

fn forced(case: &Value) -> Forced {
    let mut chain = fitted(["beta1_deg", "beta2_deg"].map(|key| number(case, key)));
    (chain.links[1].inertia_kg_m2, chain.links[1].length_m) = (number(case, "I_S2"), number(case, "l2"));
    let assembly = assembly(chain);
    let loads = [("joint1", number(case, "torque1_nm")), ("tip.x", number(case, "force_x_n"))];
    let loads = loads.into_iter().filter(|(_, load)| *load != 0.0);
    let loads: Vec<(Dof, f64)> = loads.map(|(name, load)| (assembly.dof(name).unwrap(), load)).collect();
    Forced::at_several(assembly, &loads, 1.0)
}

fn traced(forced: &Forced, [from, to]: [f64; 2]) -> Branch {
    let joints = ["joint1", "joint2"].map(|name| forced.assembly().dof(name).unwrap());
    let options = TraceOptions::new(forced, Coordinate::FrequencyHz, [from, to], joints.into());
    trace(forced, from, Coordinate::FrequencyHz, &options).unwrap()
}

fn harmonic1(reading: &Reading) -> f64 {
    libm::hypot(reading.harmonic1.re, reading.harmonic1.im)
}

fn folds(branch: &Branch) -> Vec<(f64, &[Reading])> {
    let folds = branch.bifurcations.iter().filter(|b| b.kind == BifurcationKind::Fold);
    folds.map(|fold| (fold.orbit.frequency_hz, &fold.orbit.readings[..])).collect()
}

#[test]
fn folds_and_peaks_are_those_of_the_oracles_in_both_directions() {
    let oracles: Value = serde_json::from_str(include_str!("../oracles/oracles.json")).unwrap();
    let cases = oracles["branches"].as_array().unwrap();
    assert_eq!(cases.len(), 6);
    for case in cases {
        let (from, to) = (number(case, "from_hz"), number(case, "to_hz"));
        let forced = forced(case);
        let (up, down) = (traced(&forced, [from, to]), traced(&forced, [to, from]));
        let (found, mut back) = (folds(&up), folds(&down));
        // On the way down the same folds come in the other order.
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
            let Some((_, readings)) = fold else { panic!("{frequency} Hz is not in {near:?}") };
            for dof in 0..2 {
                assert!((harmonic1(&readings[dof]) / pair(&expected["harmonic1_rad"])[dof] - 1.0).abs() < 1e-5);
                // The oracle's amplitude is the largest of its samples.
                assert!((readings[dof].largest / pair(&expected["amplitude_rad"])[dof] - 1.0).abs() < 1e-3);
            }
        }
        let peak = pair(&case["peak_harmonic1_rad"])[0];
        // No point need lie on the peak itself, but none may exceed it.
        let highest = up.orbits.iter().fold(0.0_f64, |highest, orbit| highest.max(harmonic1(&orbit.readings[0])));
        assert!(highest < peak * (1.0 + 1e-5) && highest > 0.9 * peak, "{highest} {peak}");
    }
}

/// Two resonance zones in one continuation, at an amplitude at which it is easily lost on the way.
#[test]
fn both_zones_are_walked_whole_in_both_directions() {
    let arm = assembly(fitted([30.0, 120.0]));
    for amplitude_n in [5.0, 20.0, 60.0, 100.0] {
        let forced = Forced::new(arm.clone(), arm.dof("tip.x").unwrap(), amplitude_n);
        let traced = |ends: [f64; 2]| {
            let branch = traced(&forced, ends);
            assert_eq!(branch.orbits.last().unwrap().frequency_hz, ends[1]);
            branch
        };
        let (up, mut down) = (traced([20.0, 60.0]), traced([60.0, 20.0]));
        down.bifurcations.reverse();
        // Below 20 N the resonances do not bend far enough for folds; the branch passes both all the same.
        for (joint, natural_hz) in arm.modes().iter().map(|mode| mode.frequency_hz).enumerate() {
            let near = up.orbits.iter().filter(|orbit| (orbit.frequency_hz / natural_hz - 1.0).abs() < 0.01);
            let [top, elsewhere] = [
                near.map(|orbit| harmonic1(&orbit.readings[joint])).fold(0.0, f64::max),
                harmonic1(&up.orbits[0].readings[joint]),
            ];
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
