//! Branch points, and the branches that leave others.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use serde_json::Value;

use super::super::balance::Balance;
use super::super::phase_zero::at_phase_zero;
use super::super::time_domain::StroboscopicMap;
use super::super::{BranchEnd, NotFollowed, Orbit, SwitchedBranch, SwitchedBranches, trace, trace_branches};
use super::arm::numbers;
use super::starts::forced;
use super::{near, of_kind};
use crate::{BifurcationKind, Branch, Coordinate, Forced, TraceOptions};

use BifurcationKind::{BranchPoint, Fold, PeriodDoubling};

/// The case of this name; see `tests/oracles/README.md`.
fn case(kind: &str, name: &str) -> Value {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/switching.json")).unwrap();
    let cases = file[kind].as_array().unwrap();
    cases.iter().find(|case| case["name"] == name).unwrap().clone()
}

/// The branch of a case over an interval of the frequency, rad/s, and those that leave it.
fn switched(case: &Value, ends_rad_s: &[f64]) -> (Forced, Branch, SwitchedBranches) {
    let forced = forced(case);
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let ends = [ends_rad_s[0] / TAU, ends_rad_s[1] / TAU];
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    let switched = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options);
    (forced, branch, switched)
}

fn whole(switched: &SwitchedBranch) -> &Branch {
    switched.traced.as_ref().unwrap()
}

/// The angular frequencies of the bifurcations of a kind, rad/s.
fn places(branch: &Branch, kind: BifurcationKind) -> Vec<f64> {
    of_kind(branch, kind).iter().map(|orbit| orbit.value * TAU).collect()
}

fn all_near(got: &[f64], expected: &[f64], relative: f64) {
    assert_eq!(got.len(), expected.len(), "{got:?}, expected {expected:?}");
    got.iter().zip(expected).for_each(|(got, expected)| near(*got, *expected, relative));
}

/// How far a response, integrated in time, is from its beginning after this many periods of the drive, relative to its
/// size.
fn distance_after(forced: &Forced, orbit: &Orbit, periods: usize) -> f64 {
    let mut balance =
        Balance::of_period(forced, [orbit.period, orbit.harmonics], orbit.frequency_hz, Coordinate::FrequencyHz);
    balance.evaluate_orbit(&orbit.coefficients);
    let start = at_phase_zero(&balance);
    let map = StroboscopicMap::new(forced, orbit.frequency_hz).unwrap();
    let mut end = [start.clone()];
    map.advance_all(&mut end, periods as u32).unwrap();
    let [start, end] = [&start, &end[0]].map(|state| map.to_point(state));
    (end - &start).norm() / start.norm()
}

/// A stable response of a branch comes back after its own period when it is integrated in time, and not before.
fn is_confirmed_in_time(forced: &Forced, branch: &Branch) {
    let stable: Vec<&Orbit> = branch.orbits.iter().filter(|orbit| orbit.is_stable() == Some(true)).collect();
    let orbit = stable[stable.len() / 2];
    let off = distance_after(forced, orbit, orbit.period);
    assert!(off < 1e-7, "{off:e} after {} periods at {} Hz", orbit.period, orbit.value);
    for periods in 1..orbit.period {
        let off = distance_after(forced, orbit, periods);
        assert!(off > 1e-3, "{off:e} after {periods} periods at {} Hz", orbit.value);
    }
}

/// Two equal masses under equal forces move alike, up to two pitchforks. The responses that do not leave at one and return
/// at the other: those with m1 and m2 exchanged are not listed again.
#[test]
fn a_pitchfork_has_one_branch_for_both_mirror_images() {
    let case = case("branch_points", "pair");
    let (forced, branch, switched) = switched(&case, &numbers(&case["ends_rad_s"]));
    let expected = numbers(&case["branch_points_rad_s"]);
    all_near(&places(&branch, BranchPoint), &expected, 1e-9);
    for (point, largest) in of_kind(&branch, BranchPoint).iter().zip(numbers(&case["largest_m"])) {
        near(point.readings[0].largest, largest, 1e-5);
    }
    let [asymmetric] = &switched.branches[..] else { panic!("{:?}", switched.branches) };
    assert_eq!((asymmetric.origin.kind, asymmetric.origin.parent, asymmetric.origin.period), (BranchPoint, 0, 1));
    assert!(asymmetric.origin.is_mirrored);
    near(asymmetric.origin.value * TAU, expected[0], 1e-9);
    let asymmetric = whole(asymmetric);
    assert_eq!(asymmetric.end, BranchEnd::Rejoined);
    near(asymmetric.bifurcations.last().unwrap().orbit.value * TAU, expected[1], 1e-9);
    let mut folds = places(asymmetric, Fold);
    folds.sort_by(f64::total_cmp);
    all_near(&folds, &numbers(&case["folds_rad_s"]), 1e-8);
    is_confirmed_in_time(&forced, asymmetric);
}

/// Springs of 1 N/m³ at x₁ + x₂ and of half of it at x₁ − 2x₂ keep x₂ = 0 in motion, but exchange nothing by x₂ → −x₂: the
/// branch points are transcritical. Each of the other branches passes through two of them, and is listed once.
#[test]
fn a_transcritical_branch_is_followed_to_both_sides() {
    let case = case("branch_points", "transcritical");
    let (forced, branch, switched) = switched(&case, &numbers(&case["ends_rad_s"]));
    let points = places(&branch, BranchPoint);
    assert_eq!(points.len(), 4);
    all_near(&points[..2], &numbers(&case["branch_points_rad_s"]), 1e-9);
    assert_eq!(switched.branches.len(), 2);
    for (switched, mut pair) in switched.branches.iter().zip([[points[0], points[1]], [points[2], points[3]]]) {
        assert!(!switched.origin.is_mirrored);
        let other = whole(switched);
        assert_eq!(other.end, BranchEnd::Closed);
        let mut crossed = places(other, BranchPoint);
        crossed.sort_by(f64::total_cmp);
        pair.sort_by(f64::total_cmp);
        all_near(&crossed, &pair, 1e-9);
        for at in pair {
            let (below, above): (Vec<_>, Vec<_>) = other.orbits.iter().partition(|orbit| orbit.value * TAU < at);
            assert!(!below.is_empty() && !above.is_empty());
        }
        is_confirmed_in_time(&forced, other);
    }
}

/// Ueda's oscillator loses its symmetry, and then its period, again and again.
#[test]
fn doublings_are_followed_to_a_cascade() {
    let case = case("period_doublings", "Ueda");
    let (forced, branch, switched) = switched(&case, &[1.7, 1.2235]);
    all_near(&places(&branch, BranchPoint), &numbers(&case["branch_points_rad_s"]), 1e-9);
    let expected = numbers(&case["doublings_rad_s"]);
    let [asymmetric, doubled @ ..] = &switched.branches[..] else { panic!() };
    assert!(asymmetric.origin.is_mirrored && whole(asymmetric).end == BranchEnd::AtEnd);
    all_near(&places(whole(asymmetric), PeriodDoubling), &expected[..1], 1e-9);
    assert_eq!(doubled.len(), 3);
    for (number, (doubled, at)) in (1..).zip(doubled.iter().zip(&expected)) {
        assert_eq!((doubled.origin.kind, doubled.origin.parent), (PeriodDoubling, number));
        assert_eq!(doubled.origin.period, 1 << number);
        near(doubled.origin.value * TAU, *at, 1e-9);
        // The multiplier −1 is accurate, although the stiffness is up to a thousand times that of the mode.
        let parent = whole(&switched.branches[number - 1]);
        let multipliers = &of_kind(parent, PeriodDoubling)[0].stability.as_ref().unwrap().multipliers;
        near(multipliers[0].re, -1.0, 1e-5);
        let next = expected.get(number).map_or(vec![], |next| vec![*next]);
        if number < 3 {
            all_near(&places(whole(doubled), PeriodDoubling), &next, 1e-9);
        }
        is_confirmed_in_time(&forced, whole(doubled));
    }
    let [(beyond, reason)] = &switched.left_out[..] else { panic!("{:?}", switched.left_out) };
    assert_eq!((beyond.parent, beyond.period, reason), (4, 16, &NotFollowed::Cascade));
}
