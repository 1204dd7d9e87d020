//! Responses that a branch does not reach.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use serde_json::Value;

use super::starts::{cases as starts, forced};
use super::{near, number, of_kind};
use crate::phase_zero::phase_zero_states;
use crate::time_domain::{SettleOptions, StroboscopicMap, reach, settle, stable_orbits};
use crate::{
    BifurcationKind, Branch, BranchEnd, Coordinate, Forced, NotSearched, OriginKind, OtherBranches, OtherOptions,
    SearchOptions, Searched, TraceOptions, trace_branches, trace_singular_curves,
};
use resonarm_dynamics::structure::Dof;

/// The cases of a kind; see `tests/oracles/README.md`.
fn cases(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/isolas.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

fn case(name: &str) -> Value {
    cases("isolas").into_iter().find(|case| case["name"] == name).unwrap()
}

fn numbers(of: &Value) -> Vec<f64> {
    of.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The branch of a case from one frequency to another, rad/s, its options and the branches found beside it.
fn searched(
    case: &Value,
    ends_rad_s: [f64; 2],
    search: &SearchOptions,
) -> (Forced, Branch, TraceOptions, OtherBranches) {
    beside(case, ends_rad_s, &OtherOptions { leaving: false, search: Some(*search) })
}

/// The same with other branches.
fn beside(case: &Value, ends_rad_s: [f64; 2], wanted: &OtherOptions) -> (Forced, Branch, TraceOptions, OtherBranches) {
    let forced = forced(case);
    let read: Dof = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let ends = ends_rad_s.map(|rad_s| rad_s / TAU);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    let branch = crate::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    let found = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options, wanted);
    (forced, branch, options, found)
}

/// The only branch found, whole.
fn only(found: &OtherBranches) -> &Branch {
    let [only] = &found.branches[..] else { panic!("{}", found.branches.len()) };
    assert_eq!((only.origin.kind, only.origin.parent), (OriginKind::Detached, None));
    only.traced.as_ref().unwrap()
}

/// Returns what the search has covered.
fn covered(found: &OtherBranches) -> &Searched {
    found.searched.as_ref().unwrap()
}

fn ends(case: &Value) -> [f64; 2] {
    ["from_rad_s", "to_rad_s"].map(|key| number(case, key))
}

/// Returns the frequencies of the bifurcations of a kind in ascending order, rad/s.
fn frequencies(branch: &Branch, kind: BifurcationKind) -> Vec<f64> {
    let mut found: Vec<f64> = of_kind(branch, kind).iter().map(|orbit| TAU * orbit.value).collect();
    found.sort_by(f64::total_cmp);
    found
}

fn assert_near(got: &[f64], expected: &[f64], relative: f64) {
    assert_eq!(got.len(), expected.len(), "{got:?}, expected {expected:?}");
    got.iter().zip(expected).for_each(|(got, expected)| near(*got, *expected, relative));
}

/// The isolas of independent code are found, and none where it found none: before the birth of the absorber's isola at
/// 0.1255 N, after its merger with the main branch at 0.1818 N, and beside folds that belong to no isola.
#[test]
fn isolas_are_found_and_none_is_invented() {
    for case in cases("isolas") {
        let (_, branch, _, found) = searched(&case, ends(&case), &SearchOptions::default());
        let expected = case["isolas"].as_array().unwrap();
        assert_eq!(found.branches.len(), expected.len(), "{}", case["name"]);
        let searched = covered(&found);
        assert_eq!((searched.not_searched, searched.attached), (None, 0), "{}", case["name"]);
        for (isola, expected) in found.branches.iter().zip(expected) {
            let isola = isola.traced.as_ref().unwrap();
            assert_eq!(isola.end, BranchEnd::Closed);
            assert_near(&frequencies(isola, BifurcationKind::Fold), &numbers(&expected["folds_rad_s"]), 1e-6);
            // That of independent code is the largest of its points.
            near(isola.peaks[0].readings[0].largest, number(expected, "largest_m"), 1e-4);
            let [first, last] = [isola.orbits.first().unwrap(), isola.orbits.last().unwrap()];
            near(first.value, last.value, 1e-6);
            near(first.readings[0].largest, last.readings[0].largest, 1e-6);
        }
        assert_eq!((searched.frequencies_hz.len(), searched.starts), (5, 10));
        assert_eq!(searched.largest, [4.0 * branch.peaks[0].readings[0].largest]);
        let folds = of_kind(&branch, BifurcationKind::Fold);
        assert_eq!(searched.loads.is_some(), !folds.is_empty(), "{}", case["name"]);
        let force_n = number(&case, "force_n");
        if let Some([lowest, highest]) = searched.loads {
            assert!(0.5 * force_n <= lowest && lowest < force_n, "{lowest}");
            assert!(force_n < highest && highest <= 2.0 * force_n, "{highest}");
        }
    }
}

/// Each search finds an isola without the other: curves of folds alone, and random starts alone.
#[test]
fn each_search_finds_an_isola_alone() {
    let (case, no_starts) = (case("absorber 0.13 N"), SearchOptions { frequencies: 0, ..SearchOptions::default() });
    let (.., found) = searched(&case, ends(&case), &no_starts);
    let expected = numbers(&case["isolas"][0]["folds_rad_s"]);
    assert_near(&frequencies(only(&found), BifurcationKind::Fold), &expected, 1e-6);
    assert_eq!((covered(&found).frequencies_hz.len(), covered(&found).starts), (0, 0));

    let case = self::case("absorber 0.15 N");
    let (.., found) = searched(&case, ends(&case), &SearchOptions { load_factor: 1.0, ..SearchOptions::default() });
    let expected = numbers(&case["isolas"][0]["folds_rad_s"]);
    assert_near(&frequencies(only(&found), BifurcationKind::Fold), &expected, 1e-6);
    // With the factor 1 no fold is followed to another load.
    assert_eq!(covered(&found).loads, Some([0.15, 0.15]));
}

/// Beyond the merger the branch leaves a range that ends before its last fold on the large response. The small response
/// there, that of independent code at 2 rad/s, is on a branch that leaves the range at both ends.
#[test]
fn a_branch_that_leaves_the_range_is_found_whole() {
    let case = case("absorber 0.19 N");
    let (_, whole, ..) = searched(&case, ends(&case), &SearchOptions { frequencies: 0, ..SearchOptions::default() });
    let (forced, branch, options, found) = searched(&case, [0.7, 2.6], &SearchOptions::default());
    assert!(branch.orbits.last().unwrap().readings[0].largest > 2.0);
    let other = only(&found);
    let [first, last] = [other.orbits.first().unwrap(), other.orbits.last().unwrap()];
    assert_eq!((other.end, first.value, last.value), (BranchEnd::AtStart, 2.6 / TAU, 2.6 / TAU));
    // The longer branch has its fold, and passes all of it.
    let fold = frequencies(other, BifurcationKind::Fold);
    assert_eq!(fold.len(), 1);
    let of_whole = frequencies(&whole, BifurcationKind::Fold);
    assert!(of_whole.iter().any(|of_whole| (of_whole / fold[0] - 1.0).abs() < 1e-9), "{fold:?} {of_whole:?}");
    let case = starts("systems").into_iter().find(|case| case["name"] == "NLvib02 .19").unwrap();
    let (hz, expected) = (numbers(&case["frequencies_hz"])[4], numbers(&case["largest_m"])[4]);
    let map = StroboscopicMap::new(&forced, hz).unwrap();
    let largest = phase_zero_states(&forced, other, hz, &options).into_iter().map(|state| {
        let settled = settle(&map, &options.read, &state, &SettleOptions::default(), &|| false).unwrap();
        settled.readings[0].largest
    });
    let nearest = largest.map(|largest| (largest / expected - 1.0).abs()).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-6, "{nearest:e}");
}

/// The asymmetric responses of a symmetric pair meet its branch at pitchforks: they are no isola. With the branches that
/// leave others they are listed once, as one of two mirror images.
#[test]
fn a_loop_between_pitchforks_is_no_isola() {
    for case in cases("loops") {
        let (_, branch, _, found) = searched(&case, ends(&case), &SearchOptions::default());
        let expected = numbers(&case["branch_points_rad_s"]);
        assert_near(&frequencies(&branch, BifurcationKind::BranchPoint), &expected, 1e-7);
        assert_eq!((found.branches.len(), covered(&found).attached), (0, 1));
        let all = OtherOptions { leaving: true, search: Some(SearchOptions::default()) };
        let (.., found) = beside(&case, ends(&case), &all);
        let [of_loop] = &found.branches[..] else { panic!("{}", found.branches.len()) };
        assert_eq!((of_loop.origin.kind, of_loop.origin.is_mirrored), (OriginKind::BranchPoint, true));
        assert_eq!(covered(&found).attached, 0);
        let folds = frequencies(of_loop.branch(), BifurcationKind::Fold);
        assert_near(&folds, &numbers(&case["folds_rad_s"]), 1e-7);
    }
}

/// With the branches that leave others, an isola is listed once, and before them. The branches of period 1 that leave it
/// count from there.
#[test]
fn an_isola_is_listed_once_beside_the_branches_that_leave_others() {
    let case = case("absorber 0.15 N");
    let all = OtherOptions { leaving: true, search: Some(SearchOptions::default()) };
    let (.., found) = beside(&case, ends(&case), &all);
    let expected = numbers(&case["isolas"][0]["folds_rad_s"]);
    assert_near(&frequencies(only(&found), BifurcationKind::Fold), &expected, 1e-6);
}

/// An isola exists from its birth to its merger with the branch: its folds turn back there as the load varies. The figures
/// of independent code have four digits.
#[test]
fn the_folds_of_an_isola_lead_to_its_birth_and_its_merger() {
    let case = case("absorber 0.15 N");
    let (forced, _, options, found) = searched(&case, ends(&case), &SearchOptions::default());
    for (to_n, [load_n, rad_s]) in [(0.1, [0.1255, 1.797]), (0.3, [0.1818, 1.436])] {
        let along = TraceOptions::new(&forced, Coordinate::Amplitude, [0.0, to_n], options.read.clone());
        let coordinates = [Coordinate::FrequencyHz, Coordinate::Amplitude];
        let curves = trace_singular_curves(&forced, only(&found), coordinates, &along);
        let turns: Vec<_> = curves.into_iter().flat_map(|(_, curve)| curve.unwrap().turns).collect();
        let [turn] = &turns[..] else { panic!("{turns:?}") };
        near(turn.point.mu, load_n, 5e-4);
        // Where the load turns, its error of 1e-4 is one of 1e-2 in the frequency.
        near(TAU * turn.point.lambda, rad_s, 1e-2);
    }
}

/// From a state beside a stable response of an isola the structure settles on it by integration in time, far above the
/// response of the branch.
#[test]
fn a_response_of_an_isola_is_confirmed_in_time() {
    let case = case("absorber 0.15 N");
    let (forced, _, options, found) = searched(&case, ends(&case), &SearchOptions::default());
    let (isola, hz) = (only(&found), 2.0 / TAU);
    let map = StroboscopicMap::new(&forced, hz).unwrap();
    let from_beside = |state: Vec<f64>| {
        let beside: Vec<f64> = state.iter().map(|number| 1.001 * number).collect();
        settle(&map, &options.read, &beside, &SettleOptions::default(), &|| false).unwrap()
    };
    let settled: Vec<_> = phase_zero_states(&forced, isola, hz, &options).into_iter().map(from_beside).collect();
    // 2.008 m is the figure of independent code; that of the branch is 0.051 m.
    let on_isola = settled.iter().find(|settled| (settled.readings[0].largest / 2.008 - 1.0).abs() < 1e-3);
    assert_eq!(on_isola.unwrap().period, Some(1));
}

/// Basins know the response of the isola, and their states reach beyond it.
#[test]
fn basins_know_the_responses_of_isolas() {
    let case = case("absorber 0.15 N");
    let (forced, hz) = (forced(&case), 2.0 / TAU);
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let (orbits, early) = stable_orbits(&forced, &[read], hz, &|| false).unwrap();
    assert!(early.is_none());
    // The figures of independent code, as above.
    let largest: Vec<f64> = orbits.iter().map(|orbit| orbit.readings[0].largest).collect();
    let [of_branch, of_isola] = largest[..] else { panic!("{largest:?}") };
    near(of_branch, 0.051, 1e-2);
    near(of_isola, 2.008, 1e-3);
    assert_eq!(reach(&orbits, 0, hz), 1.5 * orbits[1].coordinates[0].largest);
}

/// A linear structure has one response at each frequency: nothing is searched.
#[test]
fn a_linear_structure_is_not_searched() {
    let mut case = case("absorber 0.12 N");
    case["elements"].as_array_mut().unwrap().retain(|element| element["kind"] == "linear");
    let (forced, _, _, found) = searched(&case, ends(&case), &SearchOptions::default());
    assert!(forced.is_linear() && found.branches.is_empty());
    assert_eq!(covered(&found), &Searched { not_searched: Some(NotSearched::Linear), ..Searched::default() });
}

/// The random numbers have a seed.
#[test]
fn equal_searches_find_equal_responses() {
    let case = case("absorber 0.17 N");
    let [first, second] = [(); 2].map(|()| searched(&case, ends(&case), &SearchOptions::default()).3);
    assert_eq!((only(&first), first.searched.as_ref()), (only(&second), second.searched.as_ref()));
}
