mod arm;
mod backbones;
mod contacts;
mod curves;
mod detached;
mod given_states;
mod load_harmonics;
mod margins;
mod polynomials;
mod starts;
mod switching;
mod textbook;

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ChainSpec, Dof, ElementSpec, Law, Link, LoadHarmonic, ModalSpec, ModeSpec, Place, Preset,
    ShapeSpec, Side, StepLoad, Stepper, StructureSpec, Term,
};
use serde_json::Value;

use super::balance::Balance;
use super::*;
use crate::continuation::System;
use crate::{BifurcationKind, BranchOptions, Quantity};
use nalgebra::{Complex, Normed as _};

/// A chain without elements.
pub(crate) fn assembly_of(chain: ChainSpec) -> Assembly {
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap()
}

/// A preset with its links at angles, degrees. The mass of link 1, which its source does not state, may vary.
pub(crate) fn preset_at(preset: Preset, angles_deg: [f64; 2]) -> Assembly {
    let chain = preset.chain().unwrap().at_angles_deg(&angles_deg);
    assembly_of(ChainSpec { unstated: vec![], ..chain })
}

/// The state at phase 0 of a periodic response of a structure with two coordinates: the sum of its cosines, and of its
/// sines times their angular frequencies.
pub(crate) fn start_of_two(orbit: &Orbit) -> Vec<f64> {
    let mut state = orbit.coefficients[..2].to_vec();
    state.resize(4, 0.0);
    for (k, rows) in (1..).zip(orbit.coefficients[2..].chunks_exact(4)) {
        for i in 0..2 {
            state[i] += rows[i];
            state[2 + i] += f64::from(k) * TAU * orbit.frequency_hz * rows[2 + i];
        }
    }
    state
}

/// The cases of a kind; see `tests/oracles/README.md`.
pub(super) fn oracles(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/structures.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

pub(super) fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or(0.0)
}

pub(super) fn place(name: &str) -> Place {
    let (point, axis) = name.split_once('.').unwrap();
    assert_eq!(axis, "x");
    Place::Dof { point: point.into(), axis: Axis::X }
}

fn law(of: &Value) -> Law {
    let (stiffness, gap) = (number(of, "stiffness_n_m"), number(of, "gap_m"));
    match of["kind"].as_str().unwrap() {
        "cubic" => Law::Cubic { stiffness3: number(of, "stiffness3_n_m3"), stiffness5: 0.0 },
        "gap" => Law::Gap { stiffness, gap, preload: 0.0 },
        "contact" => Law::KelvinVoigt { stiffness, damping: 0.0, gap, side: Side::Positive, preload: 0.0 },
        "friction" => Law::Friction { stiffness, slip: number(of, "slip_force_n") },
        other => panic!("{other}"),
    }
}

pub(super) fn modal(case: &Value) -> Assembly {
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
    let elements = case["elements"].as_array().unwrap().iter().map(|element| ElementSpec::Point {
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
    super::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap()
}

pub(super) fn near(got: f64, expected: f64, relative: f64) {
    assert!((got / expected - 1.0).abs() < relative, "{got}, expected {expected}");
}

pub(super) fn of_kind(branch: &Branch, kind: BifurcationKind) -> Vec<&Orbit> {
    branch.bifurcations.iter().filter(|found| found.kind == kind).map(|found| &found.orbit).collect()
}

/// The oracle samples the forces at 512 points without regard to where a contact opens between two of them. With 25
/// harmonics that puts small folds around the peak, which are not there with finer points; its first and last folds and
/// its peak are those of the response.
#[test]
fn branches_have_the_folds_and_peaks_of_independent_code() {
    for case in oracles("modal") {
        let branch = branch_of(&case);
        let kind = case["elements"][0]["kind"].as_str().unwrap();
        let folds = of_kind(&branch, BifurcationKind::Fold);
        let peak = branch.peaks[0].readings[0].largest;
        near(peak, number(&case, "peak_amplitude_m"), if kind == "cubic" { 1e-4 } else { 5e-3 });
        let of_oracle = case["folds"].as_array().unwrap();
        let hz = |fold: &Value| fold[0].as_f64().unwrap();
        if kind == "friction" {
            assert!(folds.is_empty() && of_oracle.is_empty(), "{folds:?}");
            continue;
        }
        assert_eq!(folds.len(), 2, "{kind}");
        let highest_hz = of_oracle.iter().map(hz).fold(0.0, f64::max);
        let tolerance = if kind == "cubic" { 1e-9 } else { 1e-4 };
        near(folds[0].value, highest_hz, tolerance);
        near(folds[1].value, hz(of_oracle.last().unwrap()), if kind == "cubic" { 1e-9 } else { 1e-6 });
        // The flow of the variations, of all modes, has a multiplier 1 where harmonic balance turns back.
        let off = folds[0].stability.as_ref().unwrap().multipliers.iter().map(|mu| (mu - 1.0).norm());
        assert!(off.fold(f64::INFINITY, f64::min) < if kind == "cubic" { 1e-7 } else { 3e-3 }, "{kind}: {folds:?}");
        // Beside the fold, multipliers of a law with a kink are not accurate enough to decide.
        let is_between = |orbit: &&Orbit| (folds[0].arclength..folds[1].arclength).contains(&orbit.arclength);
        let between: Vec<_> = branch.orbits.iter().filter(is_between).map(Orbit::is_stable).collect();
        assert_ne!(between[0], Some(true), "{kind}");
        assert!(between.contains(&Some(false)), "{kind}: {between:?}");
    }
}

/// The contact on one side also doubles the period, twice on the way up and twice on the way down; backlash, which is
/// symmetric, has branch points where the response loses its symmetry.
#[test]
fn multipliers_find_what_is_not_a_fold() {
    let [gap, contact] = ["gap", "contact"].map(|kind| {
        let cases = oracles("modal");
        branch_of(cases.iter().find(|case| case["elements"][0]["kind"] == kind).unwrap())
    });
    for orbit in of_kind(&contact, BifurcationKind::PeriodDoubling) {
        let off = orbit.stability.as_ref().unwrap().multipliers.iter().map(|mu| (mu + 1.0).norm());
        assert!(off.fold(f64::INFINITY, f64::min) < 1e-5, "{orbit:?}");
    }
    assert_eq!(of_kind(&contact, BifurcationKind::PeriodDoubling).len(), 4);
    let crossings = of_kind(&gap, BifurcationKind::BranchPoint);
    assert_eq!(crossings.len(), 2);
    // Before the first one the response is symmetric: its even harmonics vanish.
    let before = gap.orbits.iter().rfind(|orbit| orbit.arclength < crossings[0].arclength).unwrap();
    let even = before.coefficients.chunks(4).map(|four| four[0].abs().max(*four.get(3).unwrap_or(&0.0)));
    assert!(even.fold(0.0, f64::max) < 1e-12, "{before:?}");
}

/// Without elements the response is the linear frequency response, at any place.
#[test]
fn a_structure_without_elements_is_linear() {
    let mut spec = modal(&oracles("modal")[0]).spec().clone();
    spec.elements.clear();
    let assembly = Assembly::new(&spec).unwrap();
    let [tip, mid] = ["tip.x", "mid.x"].map(|name| assembly.dof(name).unwrap());
    let response = LinearResponse::new(&assembly);
    let forced = Forced::new(assembly, tip, 3.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [15.0, 65.0], vec![tip, mid]);
    let branch = super::trace(&forced, 15.0, Coordinate::FrequencyHz, &options).unwrap();
    for orbit in &branch.orbits {
        for (dof, reading) in [tip, mid].into_iter().zip(&orbit.readings) {
            let expected = response.at(Quantity::Receptance, tip, dof, orbit.value).unwrap() * 3.0;
            assert!((reading.harmonic1 - expected).norm() < 1e-10 * expected.norm(), "{orbit:?}: {expected}");
            near(reading.largest, expected.norm(), 1e-9);
        }
    }
    assert!(branch.bifurcations.is_empty() && branch.orbits.iter().all(|orbit| orbit.is_stable() == Some(true)));
}

/// Two masses with dampers whose damping is not modal, as springs and dampers between modes without them: the frequency
/// response is (K − Ω²M + iΩC)⁻¹, in closed form, and a branch of forced periodic responses the same.
#[test]
fn dampers_between_points_need_not_be_modal() {
    let modes = [26.0, 30.0].map(|omega| ModeSpec { frequency_hz: omega / TAU, damping_ratio: 0.0 }).to_vec();
    let shapes = [("a", [1.0, 0.0]), ("b", [0.0, 1.0 / libm::sqrt(0.02)])]
        .map(|(point, amounts)| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: amounts.to_vec() })
        .to_vec();
    let element = |at: &str, to: Option<&str>, stiffness: f64, damping: f64| ElementSpec::Point {
        at: place(at),
        to: to.map(place),
        law: Law::Linear { stiffness, damping },
    };
    let elements = vec![element("a.x", Some("b.x"), 40.0, 0.05), element("a.x", None, 0.0, 0.05)];
    let body = BodySpec::Modal(ModalSpec { modes, shapes });
    let assembly = Assembly::new(&StructureSpec { body, elements }).unwrap();
    let drive = assembly.dof("a.x").unwrap();
    let response = LinearResponse::new(&assembly);
    let forced = Forced::new(assembly, drive, 3.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [3.0, 9.0], vec![drive]);
    let branch = super::trace(&forced, 3.0, Coordinate::FrequencyHz, &options).unwrap();
    for orbit in &branch.orbits {
        let w = TAU * orbit.value;
        let [of_a, coupled, of_b] =
            [[26.0 * 26.0 + 40.0 - w * w, 0.1 * w], [-40.0, -0.05 * w], [58.0 - 0.02 * w * w, 0.05 * w]]
                .map(|[re, im]| Complex::new(re, im));
        let expected = of_b / (of_a * of_b - coupled * coupled);
        let got = response.at(Quantity::Receptance, drive, drive, orbit.value).unwrap();
        assert!((got - expected).norm() < 1e-12 * expected.norm(), "{w}: {got} {expected}");
        assert!((orbit.readings[0].harmonic1 - expected * 3.0).norm() < 1e-7 * expected.norm(), "{orbit:?}");
    }
    assert!(branch.orbits.iter().all(|orbit| orbit.is_stable() == Some(true)));
}

/// The arm with a spring at its elbow that hardens: at 40 N a response almost breaks a symmetry, and a closed branch
/// passes by at 22.856 Hz, nearer than a usual step. The branch passes it, and leaves the interval.
#[test]
fn a_branch_does_not_jump_to_one_that_passes_close_by() {
    let chain = BodySpec::Chain(Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&[0.0, 60.0]));
    let law = Law::Cubic { stiffness3: 3e9, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: Place::Joint(2), to: None, law }];
    let assembly = Assembly::new(&StructureSpec { body: chain, elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 40.0);
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [21.9, 23.1], vec![tip]);
    options.assess = Assess::Nothing;
    options.branch.most_points = 250;
    let traced = super::trace(&forced, 21.9, Coordinate::FrequencyHz, &options);
    let branch = traced.map_err(|early| early.reason).unwrap();
    let folds: Vec<f64> = of_kind(&branch, BifurcationKind::Fold).iter().map(|orbit| orbit.value).collect();
    assert_eq!(folds.len(), 2, "{folds:?}");
    near(folds[0], 23.015_74, 1e-6);
    near(folds[1], 22.629_37, 1e-6);
}

/// Modes beyond the second only add to the compliance between the places.
#[test]
fn many_modes_cost_no_more_equations() {
    let case = &oracles("modal")[0];
    let mut spec = modal(case).spec().clone();
    let of_two = branch_without_stability(&spec);
    let BodySpec::Modal(body) = &mut spec.body else { panic!() };
    for k in 2..32 {
        body.modes.push(ModeSpec { frequency_hz: 100.0 + 37.0 * k as f64, damping_ratio: 0.005 });
        body.shapes.iter_mut().for_each(|shape| shape.by_mode.push(0.2 * libm::sin(k as f64)));
    }
    let of_many = branch_without_stability(&spec);
    let unknowns = |branch: &Branch| branch.orbits.iter().map(|orbit| orbit.coefficients.len()).max().unwrap();
    assert!(unknowns(&of_many) <= unknowns(&of_two) + 4);
    assert!(of_many.work.evaluations <= 2 * of_two.work.evaluations, "{:?} {:?}", of_many.work, of_two.work);
    assert_eq!(of_kind(&of_many, BifurcationKind::Fold).len(), 2);
}

fn branch_without_stability(spec: &StructureSpec) -> Branch {
    let assembly = Assembly::new(spec).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 10.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [18.0, 26.0], vec![tip]);
    let options = TraceOptions { assess: Assess::Nothing, ..options };
    super::trace(&forced, 18.0, Coordinate::FrequencyHz, &options).unwrap()
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
        Law::Gap { stiffness: 2e5, gap: 1e-3, preload: 0.0 },
        Law::KelvinVoigt { stiffness: 2e5, damping: 30.0, gap: 1e-3, side: Side::Negative, preload: 0.0 },
        Law::HuntCrossley { stiffness: 2e6, damping: 0.1, gap: 1e-3, side: Side::Positive, preload: 0.0 },
        Law::Friction { stiffness: 4e4, slip: 55.0 },
        lugre,
        Law::Linear { stiffness: 3e3, damping: 20.0 },
        Law::Tanh { slip: 10.0, velocity: 0.2 },
        Law::Gap { stiffness: 2e5, gap: 1e-3, preload: -60.0 },
        Law::KelvinVoigt { stiffness: 2e5, damping: 30.0, gap: 0.0, side: Side::Negative, preload: 80.0 },
        Law::HuntCrossley { stiffness: 2e6, damping: 0.1, gap: 0.0, side: Side::Positive, preload: 40.0 },
    ];
    let harmonics = vec![LoadHarmonic { order: 3, ratio: 0.4, phase_rad: 0.7 }];
    for law in laws {
        let mut spec = modal(case).spec().clone();
        spec.elements = vec![
            ElementSpec::Point { at: place("mid.x"), to: None, law },
            ElementSpec::Point { at: place("tip.x"), to: Some(place("mid.x")), law },
        ];
        let assembly = Assembly::new(&spec).unwrap();
        let drive = assembly.dof("tip.x").unwrap();
        let forced = Forced::new(assembly, drive, 8.0).with_harmonics(harmonics.clone());
        derivatives_agree(&forced, law.name());
    }
    let mut spec = modal(case).spec().clone();
    let terms = [([2, 1], 3e5), ([1, 3], -4e8), ([0, 5], 2e10)];
    let terms = terms.iter().map(|(powers, energy)| Term { powers: powers.to_vec(), energy: *energy }).collect();
    spec.elements = vec![ElementSpec::Polynomial { at: vec![place("tip.x"), place("mid.x")], terms }];
    let assembly = Assembly::new(&spec).unwrap();
    let drive = assembly.dof("tip.x").unwrap();
    derivatives_agree(&Forced::new(assembly, drive, 8.0), "polynomial");
}

/// The same of a chain with elements at points and at joints, and in the amplitude too.
#[test]
fn jacobian_of_a_chain_is_the_derivative() {
    let mut chain = Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&[20.0, 60.0]);
    chain.links.push(Link { angle_deg: 25.0, ..chain.links[1] });
    let contact = Law::KelvinVoigt { stiffness: 1e5, damping: 20.0, gap: 1e-4, side: Side::Positive, preload: 0.0 };
    let (friction, hertz) = (
        Law::Friction { stiffness: 1e4, slip: 6.0 },
        Law::HuntCrossley { stiffness: 1e6, damping: 0.2, gap: 1e-4, side: Side::Negative, preload: 0.0 },
    );
    let lugre = Law::Lugre {
        bristle_stiffness: 1e4,
        bristle_damping: 1.0,
        viscous: 0.5,
        coulomb: 2.0,
        breakaway: 3.0,
        stribeck: 0.05,
    };
    let at = |place: Place, law: Law| ElementSpec::Point { at: place, to: None, law };
    let elements = vec![
        at(place("tip.x"), contact),
        at(Place::Dof { point: "joint3".into(), axis: Axis::Y }, hertz),
        at(Place::Joint(2), friction),
        at(place("joint2.x"), lugre),
        ElementSpec::Polynomial {
            at: vec![place("tip.x"), Place::Dof { point: "joint3".into(), axis: Axis::Y }],
            terms: vec![Term { powers: vec![2, 1], energy: 4e6 }, Term { powers: vec![1, 3], energy: 5e9 }],
        },
    ];
    let assembly = Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements }).unwrap();
    let drive = assembly.dof("tip.y").unwrap();
    let harmonics = vec![LoadHarmonic { order: 2, ratio: 0.5, phase_rad: -0.3 }];
    derivatives_agree(&Forced::new(assembly, drive, 8.0).with_harmonics(harmonics), "chain");
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
            assert!((exact - seen).abs() < 1e-5 * size, "{name} row {i}: {exact} {seen} of {size}");
            let (exact, seen) = (matrix[i + (n + 1) * n] * value, (higher[i] - lower[i]) / (2.0 * h));
            assert!((exact - seen).abs() < 1e-5 * size, "{name} {coordinate} row {i}: {exact} {seen} of {size}");
        }
    }
}

/// Maxwell's reciprocity between two places, which holds for every linear structure: force here and displacement there.
#[test]
fn responses_are_reciprocal() {
    for (preset, angles_deg) in [(Preset::Irb1600Fitted, [35.0, 60.0]), (Preset::Irb1600Table1, [-100.0, 130.0])] {
        let assembly = preset_at(preset, angles_deg);
        let linear = LinearResponse::new(&assembly);
        for (one, other) in [("tip.x", "tip.y"), ("joint1", "tip.x"), ("joint1", "joint2"), ("joint2.y", "tip.x")] {
            let [one, other] = [one, other].map(|name| assembly.dof(name).unwrap());
            for hz in [0.0, 3.0, 22.0, 70.0] {
                let [there, back] = [(one, other), (other, one)]
                    .map(|(from, to)| linear.at(Quantity::Receptance, from, to, hz).unwrap());
                assert!((there - back).norm() <= 1e-12 * (there.norm() + 1e-9), "{hz} Hz: {there} {back}");
            }
        }
    }
}

/// The straight arm upright: its elbow moves along −x by l1 α1; at 0 Hz a joint gives as its spring.
#[test]
fn responses_of_points_follow_from_those_of_joints() {
    let assembly = preset_at(Preset::Irb1600Fitted, [90.0, 0.0]);
    let [joint1, joint2, elbow] = ["joint1", "joint2", "joint2.x"].map(|name| assembly.dof(name).unwrap());
    let linear = LinearResponse::new(&assembly);
    let at = |dof, hz| linear.at(Quantity::Receptance, joint1, dof, hz).unwrap();
    assert!((at(elbow, 15.0) + at(joint1, 15.0) * 0.63).norm() < 1e-12 * at(joint1, 15.0).norm());
    assert!((at(joint1, 0.0).re * 555_000.0 - 1.0).abs() < 1e-14 && at(joint2, 0.0).norm() < 1e-16);
}

/// Started on the steady vibration that the response predicts, a chain stays on it: amplitude and phase, near both
/// resonances.
#[test]
fn responses_predict_the_small_vibration_in_time() {
    let assembly = preset_at(Preset::Irb1600Fitted, [35.0, 60.0]);
    let [tip, joint1, joint2] = ["tip.x", "joint1", "joint2"].map(|name| assembly.dof(name).unwrap());
    let linear = LinearResponse::new(&assembly);
    for frequency_hz in [10.0, 22.15, 40.0, 48.9, 70.0] {
        let omega = TAU * frequency_hz;
        let amplitude =
            [joint1, joint2].map(|joint| linear.at(Quantity::Receptance, tip, joint, frequency_hz).unwrap() * 1e-6);
        // The drive is Im e^{iωt}, so is the response.
        let state_at = |t_s: f64| {
            let turned = amplitude.map(|a| a * Complex::new(libm::cos(omega * t_s), libm::sin(omega * t_s)));
            [turned.map(|a| a.im), turned.map(|a| omega * a.re)].concat()
        };
        let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Gl6, 2000.0).unwrap();
        stepper.restore(&state_at(0.0)).unwrap();
        for k in 0..2000 {
            let load = StepLoad::Sine { amplitude: &[1e-6], omega_rad_s: omega };
            stepper.advance_under(f64::from(k) / 2000.0, &load).unwrap();
        }
        let size = amplitude.iter().map(|a| a.norm()).fold(0.0, f64::max);
        for (got, expected) in stepper.position().iter().zip(state_at(1.0)) {
            assert!((got - expected).abs() < 1e-5 * size, "{frequency_hz} Hz: {got} {expected} of {size}");
        }
    }
}

/// Without damping the response at a natural frequency is infinite.
#[test]
fn says_why_there_is_no_response() {
    let mode = ModeSpec { frequency_hz: 8.0, damping_ratio: 0.0 };
    let shape = ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] };
    let body = BodySpec::Modal(ModalSpec { modes: vec![mode], shapes: vec![shape] });
    let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
    let (linear, tip) = (LinearResponse::new(&assembly), assembly.dof("tip.x").unwrap());
    let says = |hz| linear.at(Quantity::Receptance, tip, tip, hz).unwrap_err();
    insta::assert_snapshot!(says(-1.0), @"frequency -1 Hz: it must be zero or a positive number");
    insta::assert_snapshot!(says(f64::NAN), @"frequency NaN Hz: it must be zero or a positive number");
    insta::assert_snapshot!(says(8.0), @"the response at 8 Hz is infinite, since nothing damps this mode; give the structure damping, or choose another frequency");
}

/// The fitted arm as a chain, with link 2 at this angle.
fn chain_of(beta2_deg: f64) -> Assembly {
    preset_at(Preset::Irb1600Fitted, [0.0, beta2_deg])
}

/// The same under a torque at joint 1.
fn chain_under(beta2_deg: f64, torque_nm: f64) -> Forced {
    let assembly = chain_of(beta2_deg);
    let joint = assembly.dof("joint1").unwrap();
    Forced::new(assembly, joint, torque_nm)
}

/// A bolted beam of two modes whose tip and joint slip on each other. Periodic responses near its resonance are found
/// from those farther off, past the corner at which the slip begins; they are the same.
#[test]
fn a_branch_begins_beyond_the_corner_of_friction() {
    let mode = |frequency_hz, damping_ratio| ModeSpec { frequency_hz, damping_ratio };
    let shape = |point: &str, by_mode| ShapeSpec { point: point.into(), axis: Axis::X, by_mode };
    let body = BodySpec::Modal(ModalSpec {
        modes: vec![mode(41.0, 0.002), mode(187.0, 0.003)],
        shapes: vec![shape("tip", vec![0.9, -0.8]), shape("joint", vec![0.35, 0.7])],
    });
    let law = Law::Friction { stiffness: 4e4, slip: 15.0 };
    let elements = vec![ElementSpec::Point { at: place("tip.x"), to: Some(place("joint.x")), law }];
    let assembly = Assembly::new(&StructureSpec { body, elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 10.0);
    let traced = |from_hz: f64, to_hz: f64| {
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [from_hz, to_hz], vec![tip]);
        options.assess = Assess::Nothing;
        super::trace(&forced, from_hz, Coordinate::FrequencyHz, &options).unwrap().orbits
    };
    let (begun, reached) = (traced(43.0, 43.5), traced(30.0, 43.0));
    let (begun, reached) = (&begun[0].readings[0], &reached.last().unwrap().readings[0]);
    near(begun.largest, reached.largest, 1e-8);
    near(begun.harmonic1.norm(), reached.harmonic1.norm(), 1e-8);
}

/// Two masses of 2 kg, free, with a spring between them of 20 Hz, and a spring that hardens; held by nothing.
fn free_masses(elements: Vec<ElementSpec>) -> Assembly {
    let mode = |frequency_hz, damping_ratio| ModeSpec { frequency_hz, damping_ratio };
    let shape =
        |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let modal = ModalSpec {
        modes: vec![mode(0.0, 0.0), mode(20.0, 0.01)],
        shapes: vec![shape("tip", [0.5, 0.5]), shape("mid", [0.5, -0.5])],
    };
    Assembly::new(&StructureSpec { body: BodySpec::Modal(modal), elements }).unwrap()
}

/// The mass line far below the first resonance, and the response of the whole, 1/(mω²) and that of the mode.
#[test]
fn a_free_structure_responds_above_0_hz() {
    let assembly = free_masses(vec![]);
    let (linear, tip) = (LinearResponse::new(&assembly), assembly.dof("tip.x").unwrap());
    let accelerance = linear.at(Quantity::Accelerance, tip, tip, 0.01).unwrap();
    near(accelerance.re, 0.25, 1e-6);
    let omega = TAU * 31.0;
    let own = Complex::new((TAU * 20.0).powi(2) - omega * omega, 2.0 * 0.01 * TAU * 20.0 * omega).inv() * 0.25;
    let expected = own - Complex::new(0.25 / (omega * omega), 0.0);
    let got = linear.at(Quantity::Receptance, tip, tip, 31.0).unwrap();
    assert!((got - expected).norm() < 1e-12 * expected.norm(), "{got} {expected}");
    let refused = linear.at(Quantity::Accelerance, tip, tip, 0.0).unwrap_err();
    insta::assert_snapshot!(refused, @"the response at 0 Hz is infinite: mode 1 is rigid, so nothing holds the structure; start above 0 Hz");
}

/// With a hardening spring between the masses their distance d = x_a − x_b moves as one oscillator, d̈ + 2ζω ḋ + ω² d =
/// F/m − (2/m) k₃ d³, whose mode has the shape 1 at d: the same branch as that oscillator held. The rigid mode adds its own
/// motion and two multipliers 1, so that no periodic response is proved stable.
#[test]
fn a_free_structure_with_an_inner_spring_is_continued() {
    let law = Law::Cubic { stiffness3: 1e9, stiffness5: 0.0 };
    let inner = ElementSpec::Point { at: place("tip.x"), to: Some(place("mid.x")), law };
    let assembly = free_masses(vec![inner]);
    let [tip, mid] = ["tip.x", "mid.x"].map(|name| assembly.dof(name).unwrap());
    let ends = [15.0, 26.0];
    let forced = Forced::new(assembly, tip, 0.6);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![tip, mid]);
    let free = super::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    // q = d, of modal mass 1 as x = q/2 of both masses: F/2 drives it, and k₃ d³ acts with the shape 1.
    let modal = ModalSpec {
        modes: vec![ModeSpec { frequency_hz: 20.0, damping_ratio: 0.01 }],
        shapes: [("tip", 0.5), ("mid", 1.0)]
            .map(|(point, phi)| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: vec![phi] })
            .into(),
    };
    let held = ElementSpec::Point { at: place("mid.x"), to: None, law };
    let held = Assembly::new(&StructureSpec { body: BodySpec::Modal(modal), elements: vec![held] }).unwrap();
    let (drive, read) = (held.dof("tip.x").unwrap(), held.dof("mid.x").unwrap());
    let forced = Forced::new(held, drive, 0.6);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    let expected = super::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    let folds = [&free, &expected].map(|branch| {
        of_kind(branch, BifurcationKind::Fold).iter().map(|orbit| orbit.frequency_hz).collect::<Vec<_>>()
    });
    assert_eq!(folds[0].len(), 2, "{folds:?}");
    folds[0].iter().zip(&folds[1]).for_each(|(got, expected)| near(*got, *expected, 1e-9));
    // At the branch's end, away from the resonance: the mean of both masses is that of the rigid mode, −F/(2m ω²).
    let last = free.orbits.last().unwrap();
    let omega = TAU * last.frequency_hz;
    let mean = (last.readings[0].harmonic1 + last.readings[1].harmonic1) * 0.5;
    near(mean.norm(), 0.6 / (4.0 * omega * omega), 1e-9);
    assert!(free.orbits.iter().all(|orbit| orbit.readings.iter().all(|reading| reading.mean.abs() < 1e-12)));
    for orbit in &free.orbits {
        let stability = orbit.stability.as_ref().unwrap();
        let ones = stability.multipliers.iter().filter(|mu| (*mu - Complex::new(1.0, 0.0)).norm() < 1e-9).count();
        assert!(ones >= 2, "{:?}", stability.multipliers);
    }
}

#[test]
fn what_has_no_steady_state_is_refused() {
    let law = Law::Cubic { stiffness3: 1e9, stiffness5: 0.0 };
    let assembly = free_masses(vec![ElementSpec::Point { at: place("tip.x"), to: None, law }]);
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly.clone(), tip, 6.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [15.0, 26.0], vec![tip]);
    let refused = super::trace(&forced, 15.0, Coordinate::FrequencyHz, &options).unwrap_err();
    insta::assert_snapshot!(refused, @"mode 1 is rigid, at 0 Hz, and only element 1 holds it, so the mean position of the vibration is not computed; integrate in time, or give the mode the frequency that it has on its soft supports");
    let refused =
        super::backbone(&forced, &BackboneOptions::new(&forced, 0, 1e-3, f64::INFINITY, vec![tip])).unwrap_err();
    insta::assert_snapshot!(refused, @"mode 1 is rigid, at 0 Hz, so it has no resonance: choose another mode");
    let refused = time_domain::StroboscopicMap::new(&forced, 20.0).unwrap_err();
    insta::assert_snapshot!(refused, @"mode 1 is rigid, at 0 Hz, so no response settles; give the mode the frequency and the damping that it has on its soft supports");
}

/// An overdamped mode beside one that oscillates: the closed form of the response, and, with a spring too weak to act,
/// the multipliers e^{−aT} and e^{−bT}.
#[test]
fn an_overdamped_mode_is_continued() {
    let mode = |frequency_hz, damping_ratio| ModeSpec { frequency_hz, damping_ratio };
    let modal = ModalSpec {
        modes: vec![mode(20.0, 0.01), mode(57.0, 1.5)],
        shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![0.5, 0.4] }],
    };
    let weak =
        ElementSpec::Point { at: place("tip.x"), to: None, law: Law::Cubic { stiffness3: 1e-3, stiffness5: 0.0 } };
    let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(modal), elements: vec![weak] }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 1.0);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [15.0, 17.0], vec![tip]);
    let branch = super::trace(&forced, 15.0, Coordinate::FrequencyHz, &options).unwrap();
    let orbit = &branch.orbits[0];
    let omega = TAU * 15.0;
    let of = |hz: f64, zeta: f64, phi: f64| {
        Complex::new((TAU * hz).powi(2) - omega * omega, 2.0 * zeta * TAU * hz * omega).inv() * (phi * phi)
    };
    near(orbit.readings[0].harmonic1.norm(), (of(20.0, 0.01, 0.5) + of(57.0, 1.5, 0.4)).norm(), 1e-9);
    let root = libm::sqrt(1.25);
    for rate in [TAU * 57.0 * (1.5 - root), TAU * 57.0 * (1.5 + root)] {
        let mu = libm::exp(-rate / 15.0);
        let multipliers = &orbit.stability.as_ref().unwrap().multipliers;
        assert!(multipliers.iter().any(|found| (found - Complex::new(mu, 0.0)).norm() < 1e-9), "{mu} {multipliers:?}");
    }
}

/// A mass of 4 kg on a spring, and one that hardens, on a base that moves along x.
fn on_a_base(elements: Vec<ElementSpec>) -> Assembly {
    let shape = |point: &str, phi| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: vec![phi] };
    let modal = ModalSpec {
        modes: vec![ModeSpec { frequency_hz: 20.0, damping_ratio: 0.05 }],
        shapes: vec![shape("tip", 0.5), shape("base", 2.0)],
    };
    Assembly::new(&StructureSpec { body: BodySpec::Modal(modal), elements }).unwrap()
}

/// The transmissibility (ω₀² + 2iζω₀ω)/(ω₀² − ω² + 2iζω₀ω) of absolute accelerations, and the relative displacement −1 over
/// the same.
#[test]
fn a_base_excites_the_structure() {
    let assembly = on_a_base(vec![]);
    let [tip, base] = ["tip.x", "base.x"].map(|name| assembly.dof(name).unwrap());
    let linear = LinearResponse::new(&assembly);
    let (own, omega) = (TAU * 20.0, TAU * 23.0);
    let z = Complex::new(own * own - omega * omega, 2.0 * 0.05 * own * omega);
    let expected = Complex::new(own * own, 2.0 * 0.05 * own * omega) / z;
    let got = linear.at(Quantity::Accelerance, base, tip, 23.0).unwrap();
    assert!((got - expected).norm() < 1e-12, "{got} {expected}");
    let got = linear.at(Quantity::Receptance, base, tip, 23.0).unwrap();
    assert!((got + z.inv()).norm() < 1e-12 * z.inv().norm(), "{got}");
    // The base follows itself, and at 0 Hz the mass follows the base.
    assert_eq!(linear.at(Quantity::Accelerance, base, base, 23.0).unwrap(), Complex::new(1.0, 0.0));
    assert_eq!(linear.at(Quantity::Accelerance, base, tip, 0.0).unwrap(), Complex::new(1.0, 0.0));
}

/// An acceleration of the base does what the force −ma at the mass does, with its branches, and settled periodic
/// responses.
#[test]
fn branches_under_a_moving_base_are_those_of_a_force() {
    let law = Law::Cubic { stiffness3: 1e8, stiffness5: 0.0 };
    let assembly = on_a_base(vec![ElementSpec::Point { at: place("tip.x"), to: None, law }]);
    let [tip, base] = ["tip.x", "base.x"].map(|name| assembly.dof(name).unwrap());
    let branch = |drive: Dof, amplitude: f64| {
        let forced = Forced::new(assembly.clone(), drive, amplitude);
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [15.0, 35.0], vec![tip]);
        super::trace(&forced, 15.0, Coordinate::FrequencyHz, &options).unwrap()
    };
    let (moved, pushed) = (branch(base, 30.0), branch(tip, 120.0));
    assert_eq!(of_kind(&moved, BifurcationKind::Fold).len(), 2);
    for (moved, pushed) in moved.bifurcations.iter().zip(&pushed.bifurcations) {
        near(moved.orbit.frequency_hz, pushed.orbit.frequency_hz, 1e-9);
        near(moved.orbit.readings[0].largest, pushed.orbit.readings[0].largest, 1e-7);
    }
    assert_eq!(Forced::new(assembly.clone(), base, 1.0).unit(), "m/s²");
}
