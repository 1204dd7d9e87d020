use alloc::vec;
use alloc::vec::Vec;

use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ChainSpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, Side, StructureSpec,
};
use serde_json::Value;

use super::balance::Balance;
use super::*;
use crate::continuation::System;
use crate::tests::arm_at;
use crate::{BranchOptions, Drive, ForcedArm, FrequencyResponse, Quantity, Response, trace};
use nalgebra::Normed as _;
use resonarm_dynamics::arm::{Load, Preset};

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
    match super::trace(&forced, 20.0, Coordinate::FrequencyHz, &options) { Ok(b) => b, Err(e) => { println!("{e}"); *e.so_far } }
}

#[test]
fn branches_have_the_folds_and_peaks_of_independent_code() {
    for case in oracles("modal") {
        let start = std::time::Instant::now();
        let branch = branch_of(&case);
        let peak = &branch.peaks[0];
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

/// A chain of two links is the arm: the same responses, and the same branch with its folds.
#[test]
fn a_chain_of_two_links_moves_as_the_arm() {
    let arm = arm_at(Preset::Irb1600Fitted, 0.0, 60.0);
    let chain = BodySpec::Chain(ChainSpec::from_arm(arm.parameters(), arm.pose()));
    let assembly = Assembly::new(&StructureSpec { body: chain, elements: vec![] }).unwrap();
    let joints = ["joint1", "joint2"].map(|name| assembly.dof(name).unwrap());
    let tip = assembly.dof("tip.y").unwrap();

    let (of_arm, of_chain) = (FrequencyResponse::new(&arm), LinearResponse::new(&assembly));
    for hz in [0.0, 5.0, 22.0, 60.0] {
        let expected = of_arm.at(Quantity::Accelerance, Drive::Torque1, Response::CY, hz).unwrap();
        let got = of_chain.at(Quantity::Accelerance, joints[0], tip, hz).unwrap();
        assert!((got - expected).norm() <= 1e-10 * expected.norm(), "{hz} Hz: {got} {expected}");
    }

    let interval = [21.0, 23.5];
    let of_arm = trace(
        ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), 60.0),
        interval[0],
        crate::Coordinate::FrequencyHz,
        &BranchOptions::new(interval[0], interval[1]),
    );
    let of_arm = of_arm.unwrap();
    let forced = Forced::new(assembly, joints[0], 60.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, interval, joints.into());
    let of_chain = super::trace(&forced, interval[0], Coordinate::FrequencyHz, &options).unwrap();
    println!("{} {}", of_arm.orbits.len(), of_chain.orbits.len());
    for (a, b) in of_arm.bifurcations.iter().zip(&of_chain.bifurcations) {
        println!("{:?} {} {:?} | {:?} {} {:?}", a.kind, a.orbit.value, a.orbit.amplitude_rad, b.kind, b.orbit.value, b.orbit.readings);
    }
}

