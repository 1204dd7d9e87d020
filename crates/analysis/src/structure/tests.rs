use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, Side, StructureSpec,
};
use serde_json::Value;

use super::balance::Balance;
use super::*;
use crate::continuation::System;

/// The cases of a kind; see `tests/oracles/README.md`.
fn oracles(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/structures.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or(0.0)
}

fn place(name: &str) -> Place {
    let (point, axis) = name.split_once('.').unwrap();
    assert_eq!(axis, "x");
    Place::Dof { point: point.into(), axis: Axis::X }
}

fn law(of: &Value) -> Law {
    let (stiffness, gap) = (number(of, "stiffness_n_m"), number(of, "gap_m"));
    match of["kind"].as_str().unwrap() {
        "cubic" => Law::Cubic { stiffness3: number(of, "stiffness3_n_m3"), stiffness5: 0.0 },
        "gap" => Law::Gap { stiffness, gap },
        "contact" => Law::KelvinVoigt { stiffness, damping: 0.0, gap, side: Side::Positive },
        "friction" => Law::Friction { stiffness, slip: number(of, "slip_force_n") },
        other => panic!("{other}"),
    }
}

fn modal(case: &Value) -> Assembly {
    let modes = case["modes"].as_array().unwrap();
    let body = ModalSpec {
        modes: modes
            .iter()
            .map(|mode| ModeSpec {
                frequency_hz: number(mode, "frequency_hz"),
                damping_ratio: number(mode, "damping_ratio"),
            })
            .collect(),
        shapes: ["tip", "mid"]
            .map(|point| ShapeSpec {
                point: point.into(),
                axis: Axis::X,
                by_mode: modes.iter().map(|mode| number(&mode["shape"], &[point, ".x"].concat())).collect(),
            })
            .into(),
    };
    let elements = case["elements"].as_array().unwrap().iter().map(|element| ElementSpec {
        at: place(element["at"].as_str().unwrap()),
        to: None,
        law: law(element),
    });
    Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements: elements.collect() }).unwrap()
}

/// The branch of an oracle.
fn branch_of(case: &Value) -> Branch {
    let assembly = modal(case);
    let [drive, read] = ["drive", "read"].map(|key| assembly.dof(case[key].as_str().unwrap()).unwrap());
    let forced = Forced::new(assembly, drive, number(case, "force_n"));
    let ends = [number(case, "from_hz"), number(case, "to_hz")];
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    match trace(&forced, 20.0, Coordinate::FrequencyHz, &options) { Ok(b) => b, Err(e) => { println!("{e}"); *e.so_far } }
}

#[test]
fn branches_have_the_folds_and_peaks_of_independent_code() {
    for case in oracles("modal") {
        let start = std::time::Instant::now();
        let branch = branch_of(&case);
        let peak = branch.orbits.iter().max_by(|a, b| a.readings[0].largest.total_cmp(&b.readings[0].largest)).unwrap();
        println!("{} {:?} points {} work {:?}", case["elements"][0]["kind"], start.elapsed(), branch.orbits.len(), branch.work);
        println!("  peak {} {} H {}", peak.frequency_hz, peak.readings[0].largest, peak.harmonics);
        println!("  oracle {} {}", case["peak_near_hz"], case["peak_amplitude_m"]);
        for b in &branch.bifurcations { println!("   {} {:?}", b.kind.name(), (b.orbit.value, b.orbit.readings[0].largest, b.orbit.harmonics)); }
        println!("{}", case["folds"]);
    }
}

/// The derivatives of the equations are those of the equations, for every law, also by way of states.
#[test]
fn jacobian_is_the_derivative() {
    let case = &oracles("modal")[0];
    let lugre = Law::Lugre {
        bristle_stiffness: 2e4,
        bristle_damping: 20.0,
        viscous: 3.0,
        coulomb: 20.0,
        breakaway: 30.0,
        stribeck: 0.1,
    };
    let laws = [
        Law::Cubic { stiffness3: 3.7e6, stiffness5: 1e9 },
        Law::Gap { stiffness: 2e5, gap: 1e-3 },
        Law::KelvinVoigt { stiffness: 2e5, damping: 30.0, gap: 1e-3, side: Side::Negative },
        Law::HuntCrossley { stiffness: 2e6, damping: 0.1, gap: 1e-3, side: Side::Positive },
        Law::Friction { stiffness: 4e4, slip: 55.0 },
        lugre,
        Law::Tanh { slip: 10.0, velocity: 0.2 },
    ];
    for law in laws {
        let mut spec = modal(case).spec().clone();
        spec.elements = vec![
            ElementSpec { at: place("mid.x"), to: None, law },
            ElementSpec { at: place("tip.x"), to: Some(place("mid.x")), law },
        ];
        let assembly = Assembly::new(&spec).unwrap();
        let drive = assembly.dof("tip.x").unwrap();
        derivatives_agree(&Forced::new(assembly, drive, 8.0), law.name());
    }
}

fn derivatives_agree(forced: &Forced, name: &str) {
    for coordinate in [Coordinate::FrequencyHz, Coordinate::Amplitude] {
        let mut balance = Balance::new(forced, 22.0, coordinate, 4);
        let n = balance.dimension();
        let wave = |seed: f64, i: usize| 4e-3 * libm::sin(seed + 1.7 * i as f64) * libm::exp(-0.2 * i as f64);
        let x: Vec<f64> = (0..n).map(|i| wave(1.0, i)).collect();
        let direction: Vec<f64> = (0..n).map(|i| wave(2.0, i)).collect();
        let value = if coordinate == Coordinate::FrequencyHz { 22.0 } else { 8.0 };
        let (mut matrix, h) = (vec![0.0; (n + 1) * (n + 1)], 1e-7);
        let mut residual = |x: &[f64], value: f64| {
            let mut out = vec![0.0; n];
            assert!(balance.evaluate(x, value, &mut out, &mut matrix));
            (out, matrix.clone())
        };
        let along = |factor: f64| -> Vec<f64> { x.iter().zip(&direction).map(|(x, d)| x + factor * d).collect() };
        let [above, below] = [h, -h].map(|h| residual(&along(h), value).0);
        let [higher, lower] = [h, -h].map(|h| residual(&x, value * (1.0 + h)).0);
        let (here, matrix) = residual(&x, value);
        let size = here.iter().fold(0.0_f64, |size, r| size.max(r.abs()));
        for i in 0..n {
            let exact: f64 = (0..n).map(|j| matrix[i + (n + 1) * j] * direction[j]).sum();
            let seen = (above[i] - below[i]) / (2.0 * h);
            assert!((exact - seen).abs() < 1e-4 * size, "{name} row {i}: {exact} {seen} of {size}");
            let (exact, seen) = (matrix[i + (n + 1) * n] * value, (higher[i] - lower[i]) / (2.0 * h));
            assert!((exact - seen).abs() < 1e-4 * size, "{name} {coordinate} row {i}: {exact} {seen} of {size}");
        }
    }
}
