//! The first response of a branch, where Newton's method from rest finds none.

use alloc::format;
use alloc::string::ToString;
use alloc::vec;

use serde_json::Value;

use super::super::balance::Balance;
use super::super::branch::reading;
use super::super::start::start;
use super::{near, number};
use crate::continuation::System;
use crate::{AnalysisError, BifurcationKind, BranchEnd, Coordinate, EndedEarly, Forced, TraceOptions};
use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, Dof, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, Side, StructureSpec, Term,
};

/// The cases of a kind; see `tests/oracles/README.md`.
pub(super) fn cases(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/starts.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

fn place(name: &Value) -> Place {
    let point = name.as_str().unwrap().strip_suffix(".x").unwrap();
    Place::Dof { point: point.into(), axis: Axis::X }
}

fn law(of: &Value) -> Law {
    let at = |key: &str| number(of, key);
    let (stiffness, damping, gap) = (at("stiffness_n_m"), at("damping_n_s_m"), at("gap_m"));
    match of["kind"].as_str().unwrap() {
        "cubic" => Law::Cubic { stiffness3: at("stiffness3_n_m3"), stiffness5: 0.0 },
        "linear" => Law::Linear { stiffness, damping },
        "gap" => Law::Gap { stiffness, gap, preload: 0.0 },
        "contact" => Law::KelvinVoigt { stiffness, damping, gap, side: Side::Positive, preload: 0.0 },
        "friction" => Law::Friction { stiffness, slip: at("slip_force_n") },
        "tanh" => Law::Tanh { slip: at("slip_force_n"), velocity: at("velocity_m_s") },
        "lugre" => Law::Lugre {
            bristle_stiffness: stiffness,
            bristle_damping: damping,
            viscous: at("viscous_n_s_m"),
            coulomb: at("slip_force_n"),
            breakaway: at("breakaway_n"),
            stribeck: at("stribeck_m_s"),
        },
        other => panic!("{other}"),
    }
}

fn polynomial(of: &Value) -> ElementSpec {
    let power = |power: &Value| power.as_u64().unwrap() as u8;
    let term = |term: &Value| Term {
        powers: term["powers"].as_array().unwrap().iter().map(power).collect(),
        energy: number(term, "energy"),
    };
    ElementSpec::Polynomial {
        at: of["at"].as_array().unwrap().iter().map(place).collect(),
        terms: of["terms"].as_array().unwrap().iter().map(term).collect(),
    }
}

/// The structure of a case and its drive.
pub(super) fn forced(case: &Value) -> Forced {
    let of_modes = case["modes"].as_array().unwrap();
    let modes = of_modes.iter().map(|mode| ModeSpec {
        frequency_hz: number(mode, "frequency_hz"),
        damping_ratio: number(mode, "damping_ratio"),
    });
    let shapes = of_modes[0]["shape"].as_object().unwrap().keys().map(|name| ShapeSpec {
        point: name.strip_suffix(".x").unwrap().into(),
        axis: Axis::X,
        by_mode: of_modes.iter().map(|mode| number(&mode["shape"], name)).collect(),
    });
    let body = BodySpec::Modal(ModalSpec { modes: modes.collect(), shapes: shapes.collect() });
    let elements = case["elements"].as_array().unwrap().iter().map(|element| {
        if element["kind"] == "polynomial" {
            return polynomial(element);
        }
        let (at, to) = match element["between"].as_array() {
            Some(ends) => (place(&ends[0]), Some(place(&ends[1]))),
            None => (place(&element["at"]), None),
        };
        ElementSpec::Point { at, to, law: law(element) }
    });
    let assembly = Assembly::new(&StructureSpec { body, elements: elements.collect() }).unwrap();
    let drive = assembly.dof(case["drive"].as_str().unwrap()).unwrap();
    Forced::new(assembly, drive, number(case, "force_n"))
}

/// Returns the largest displacement of the first response at a frequency.
fn first_largest(forced: &Forced, read: Dof, frequency_hz: f64) -> Result<f64, AnalysisError> {
    let ends = [frequency_hz, 2.0 * frequency_hz];
    let options = TraceOptions::new(forced, Coordinate::FrequencyHz, ends, vec![read]);
    let mut balance = Balance::new(forced, frequency_hz, Coordinate::FrequencyHz, options.branch.least_harmonics);
    let continuation = start(&mut balance, &options)?;
    balance.evaluate_orbit(&continuation.point().x);
    Ok(reading(&balance, read).largest)
}

/// A strongly driven Duffing and Ueda oscillator, a bilinear one, and one with LuGre friction start on the response of
/// independent code.
#[test]
fn first_responses_are_those_of_independent_code() {
    for case in cases("starts") {
        let forced = forced(&case);
        let hz = number(&case, "frequency_hz");
        let largest = first_largest(&forced, forced.drives()[0].0, hz);
        near(largest.unwrap(), number(&case, "largest_m"), number(&case, "tolerance"));
    }
}

/// Structures of the literature start at every frequency that was tried, among them those at which the homotopy from the
/// linear structure alone fails. The largest displacements are those of independent code with 41 to 161 harmonics, where
/// that found a response.
#[test]
fn every_structure_starts() {
    let (mut tried, mut failed) = (0, vec![]);
    for case in cases("systems") {
        let forced = forced(&case);
        let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
        for (i, hz) in case["frequencies_hz"].as_array().unwrap().iter().enumerate() {
            tried += 1;
            match first_largest(&forced, read, hz.as_f64().unwrap()) {
                Ok(got) => {
                    let expected = case["largest_m"][i].as_f64().unwrap_or(got);
                    assert!(
                        (got / expected - 1.0).abs() < 2e-3,
                        "{} {hz} Hz: {got}, expected {expected}",
                        case["name"]
                    );
                }
                Err(error) => failed.push(format!("{} {hz} Hz: {error}", case["name"])),
            }
        }
    }
    assert!(failed.is_empty(), "{} of {tried}: {failed:#?}", failed.len());
}

/// The error that a response states is that of its largest displacement within a factor of 3, and each tolerance takes as
/// many harmonics as in independent code.
#[test]
fn a_response_states_its_truncation_error() {
    let case = &cases("starts")[1];
    let (forced, hz) = (forced(case), number(case, "frequency_hz"));
    let read = forced.drives()[0].0;
    // The independent code tried 9, 13, 19 and 29 harmonics: the first that reaches a tolerance bounds their number.
    for (tolerance, most_harmonics, tried) in
        [(1e-3, 64, [9, 13]), (1e-4, 64, [13, 19]), (1e-6, 64, [19, 29]), (1e-9, 11, [11; 2])]
    {
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [hz, 1.01 * hz], vec![read]);
        (options.branch.truncation, options.branch.most_harmonics) = (tolerance, most_harmonics);
        let branch = crate::trace(&forced, hz, Coordinate::FrequencyHz, &options).unwrap();
        let first = &branch.orbits[0];
        let off = (first.readings[0].largest / number(case, "largest_m") - 1.0).abs();
        assert!(off < 3.0 * first.truncation_error, "{tolerance}: {off:e} {:e}", first.truncation_error);
        // Harmonics are added by an eighth and one.
        assert!((tried[0]..=tried[1] + 1).contains(&first.harmonics), "{tolerance}: {}", first.harmonics);
        assert_eq!(first.truncation_error <= tolerance, most_harmonics == 64);
    }
}

/// The branch of the strongly driven oscillator, from a start that Newton's method does not find from rest, has the folds
/// of independent code. From a start between the folds the branch returns to it, and says that it never reached its end.
#[test]
fn a_branch_has_its_folds_and_says_where_it_ended() {
    let case = &cases("starts")[0];
    let forced = forced(case);
    let trace = |ends: [f64; 2]| {
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![forced.drives()[0].0]);
        crate::trace(&forced, ends[0], Coordinate::FrequencyHz, &options)
    };
    let whole = trace([number(case, "frequency_hz"), 1.0]).unwrap();
    assert_eq!(whole.end, BranchEnd::AtEnd);
    let folds = super::of_kind(&whole, BifurcationKind::Fold);
    for expected in [0.0894008, 0.0870649, 0.6741292] {
        let nearest = folds.iter().map(|fold| (fold.value - expected).abs()).fold(f64::INFINITY, f64::min);
        // The oracle states seven digits.
        assert!(nearest < 1e-7, "{expected}: {nearest:e}");
    }
    let EndedEarly { reason, so_far } = trace([0.557, 0.0239]).unwrap_err();
    assert_eq!(
        reason.to_string(),
        "the branch turned back and left the interval at its start, 0.557000 Hz; 0.023900 Hz was not reached: start at the other end"
    );
    assert_eq!((so_far.end, so_far.orbits.last().unwrap().value), (BranchEnd::AtStart, 0.557));
}

/// The error of a start that fails lists what was tried. Here a harmonic of the drive is the natural frequency of an
/// undamped mode, whose compliance is infinite.
#[test]
fn a_start_that_fails_says_what_was_tried() {
    let mut case = cases("systems").into_iter().find(|case| case["name"] == "strong Duffing").unwrap();
    case["modes"][0]["damping_ratio"] = 0.0.into();
    let natural_hz = number(&case["modes"][0], "frequency_hz");
    let forced = forced(&case);
    let error = first_largest(&forced, forced.drives()[0].0, 0.5 * natural_hz).unwrap_err();
    let AnalysisError::NoStart { attempts, .. } = &error else { panic!("{error}") };
    assert_eq!(attempts.iter().map(|tried| tried.harmonics).collect::<Vec<_>>(), [7, 15, 31]);
    insta::assert_snapshot!(error.to_string().split_once(';').unwrap().0, @"no periodic response was found at 0.079577 Hz. It was searched from rest (the equations were singular or not finite), and by raising the element forces from zero: from the linear structure with 7 harmonics, up to 100 % of the forces (the equations were singular or not finite)");
    assert!(error.to_string().ends_with("). Start elsewhere, lower the excitation, follow the amplitude from a smaller one, or give a state of the response"), "{error}");
}

/// Exactly at the natural frequency of an undamped mode, and at a third of it, the compliance has a pole, and the error
/// says so.
#[test]
fn a_start_exactly_at_an_undamped_mode_names_it() {
    let case = cases("systems").into_iter().find(|case| case["name"] == "NLvib02 .19").unwrap();
    let (forced, natural_hz) = (forced(&case), number(&case["modes"][0], "frequency_hz"));
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    for harmonic in [1, 3] {
        let from = natural_hz / harmonic as f64;
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [from, 2.0 * from], vec![read]);
        let EndedEarly { reason, .. } = crate::trace(&forced, from, Coordinate::FrequencyHz, &options).unwrap_err();
        let AnalysisError::AtUndampedMode { mode: 1, natural_hz: named_hz, harmonic: named } = reason else {
            panic!("{reason}")
        };
        near(named_hz, natural_hz, 1e-15);
        assert_eq!(named, harmonic);
    }
}

/// A structure with more elements than modes has the coordinates of the modes as unknowns. Its response solves the balance
/// of the elements' displacements, too.
#[test]
fn a_response_by_modes_is_one_by_places() {
    let case = cases("systems").into_iter().find(|case| case["name"] == "NLvib07 1 N").unwrap();
    let (forced, hz) = (forced(&case), 0.2);
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [hz, 2.0 * hz], vec![read]);
    let mut balance = Balance::new(&forced, hz, Coordinate::FrequencyHz, options.branch.least_harmonics);
    let found = start(&mut balance, &options).unwrap();
    let (mut by_places, x) = balance.by_places(&found.point().x).unwrap();
    by_places.set_harmonics(balance.harmonics());
    assert_eq!([&balance, &by_places].map(|balance| balance.unknowns.count()), [3, 5]);
    let (mut residual, mut matrix) = (vec![0.0; x.len()], vec![0.0; (x.len() + 1) * (x.len() + 1)]);
    assert!(by_places.evaluate(&x, hz, &mut residual, &mut matrix));
    let largest = |of: &[f64]| of.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    assert!(largest(&residual) < 1e-9 * largest(&x), "{:e}", largest(&residual));
}
