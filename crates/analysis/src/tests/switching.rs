//! Branch points, the branches that leave others, sub-harmonic responses, and beats.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use serde_json::{Value, json};

use super::super::balance::Balance;
use super::super::phase_zero::at_phase_zero;
use super::super::switching::Beginning;
use super::super::time_domain::StroboscopicMap;
use super::super::{
    Bifurcation, BranchEnd, NotFollowed, Orbit, Origin, OriginKind, OtherBranch, OtherBranches, OtherOptions,
    SearchOptions, trace, trace_branches,
};
use super::arm::numbers;
use super::starts::forced;
use super::{near, number, of_kind};
use crate::{BifurcationKind, Branch, Coordinate, Forced, TraceOptions};

use BifurcationKind::{BranchPoint, Fold, NeimarkSacker, PeriodDoubling};

/// The case of this name; see `tests/oracles/README.md`.
fn case(kind: &str, name: &str) -> Value {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/switching.json")).unwrap();
    let cases = file[kind].as_array().unwrap();
    cases.iter().find(|case| case["name"] == name).unwrap().clone()
}

/// All branches that leave others, and sub-harmonic ones.
fn all() -> OtherOptions {
    let search = SearchOptions { frequencies: 0, load_factor: 1.0, sub_harmonics: true, ..SearchOptions::default() };
    OtherOptions { leaving: true, search: Some(search) }
}

/// The branch of a case over an interval of the frequency, rad/s, and those that leave it.
fn switched(case: &Value, ends_rad_s: &[f64]) -> (Forced, Branch, OtherBranches) {
    let forced = forced(case);
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let ends = [ends_rad_s[0] / TAU, ends_rad_s[1] / TAU];
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    let switched = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options, &all());
    (forced, branch, switched)
}

fn whole(switched: &OtherBranch) -> &Branch {
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

/// The state of a response at phase 0 of the drive.
fn start(forced: &Forced, orbit: &Orbit) -> Vec<f64> {
    let orders = [orbit.period, orbit.harmonics];
    let mut balance = Balance::of_period(forced, orders, orbit.frequency_hz, Coordinate::FrequencyHz);
    balance.evaluate_orbit(&orbit.coefficients);
    at_phase_zero(&balance)
}

/// How far a response, integrated in time, is from its beginning after this many periods of the drive, relative to its
/// size.
fn distance_after(forced: &Forced, orbit: &Orbit, periods: usize) -> f64 {
    let start = start(forced, orbit);
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
    let case = case("branch_points", "symmetric pair");
    let (forced, branch, switched) = switched(&case, &numbers(&case["ends_rad_s"]));
    let expected = numbers(&case["branch_points_rad_s"]);
    all_near(&places(&branch, BranchPoint), &expected, 1e-9);
    for (point, largest) in of_kind(&branch, BranchPoint).iter().zip(numbers(&case["largest_m"])) {
        near(point.readings[0].largest, largest, 1e-5);
    }
    let [asymmetric] = &switched.branches[..] else { panic!("{:?}", switched.branches) };
    let Origin { kind, parent, period, .. } = asymmetric.origin;
    assert_eq!((kind, parent, period), (OriginKind::BranchPoint, Some(0), 1));
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

/// The branch that leaves Ueda's oscillator's symmetric responses at 1.641 rad/s meets them again at 0.848 rad/s. Its steps are long
/// there, and the symmetric responses pass close by: no step may jump to them.
#[test]
fn a_branch_without_a_symmetry_does_not_jump_to_the_responses_that_have_it() {
    let case = case("period_doublings", "Ueda");
    let forced = forced(&case);
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let ends = [2.0, 0.7].map(|omega_rad_s| omega_rad_s / TAU);
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    let points: Vec<&Bifurcation> = branch.bifurcations.iter().filter(|found| found.kind == BranchPoint).collect();
    let beginning = Beginning::new(&forced, &branch, points[0], Coordinate::FrequencyHz, &options).unwrap();
    let asymmetric = beginning.follow(&options).unwrap().unwrap();
    assert_eq!(asymmetric.end, BranchEnd::Rejoined);
    near(asymmetric.bifurcations.last().unwrap().orbit.value, points[1].orbit.value, 1e-9);
    // Without a symmetry the mean is not zero, but where the branches meet, between the last two responses.
    let [inner @ .., _, _] = asymmetric.orbits.as_slice() else { panic!() };
    assert!(inner.iter().all(|orbit| orbit.readings[0].mean.abs() > 1e-3));
}

/// The branches beside the one of a structure whose range is given in Hz.
fn beside(case: &Value, ends_hz: [f64; 2]) -> (Branch, OtherBranches) {
    let forced = forced(case);
    let read = forced.assembly().dof(case["drive"].as_str().unwrap()).unwrap();
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends_hz, vec![read]);
    // A branch that turned back and left the range where it began is one, too.
    let branch = trace(&forced, ends_hz[0], Coordinate::FrequencyHz, &options).unwrap_or_else(|early| *early.so_far);
    let beside = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options, &all());
    (branch, beside)
}

/// The branches that leave others at bifurcations of a kind, each of which must end at a branch point where it meets such a branch
/// again: the coordinate where it begins, and there.
fn leaving_and_returning(beside: &OtherBranches, kind: OriginKind) -> Vec<[f64; 2]> {
    let leaving = beside.branches.iter().filter(|branch| branch.origin.kind == kind);
    let ends = leaving.map(|branch| {
        let whole = whole(branch);
        assert_eq!(whole.end, BranchEnd::Rejoined, "from {}", branch.origin.value);
        let met: Vec<&Bifurcation> = whole.bifurcations.iter().filter(|found| found.kind == BranchPoint).collect();
        let [met] = met[..] else { panic!("{} branch points from {}", met.len(), branch.origin.value) };
        assert_eq!(Some(met), whole.bifurcations.last());
        [branch.origin.value, met.orbit.value]
    });
    ends.collect()
}

/// In a gap, a vibration loses its symmetry at one branch point and has it again at another. The determinant does not see the
/// second one of the first structure, where the branch turns back in a fold; with the second structure the responses with and
/// without the symmetry are nearer to each other there than rounding.
#[test]
fn a_branch_in_a_gap_ends_where_it_has_its_symmetry_again() {
    let one = json!({
        "modes": [{ "frequency_hz": 0.149_126_191_918_344_92, "damping_ratio": 0.007_231_766_473_095_19,
            "shape": { "d0.x": 0.903_825_692_676_236_2 } }],
        "elements": [{ "kind": "gap", "at": "d0.x", "stiffness_n_m": 9.863_582_447_659_503, "gap_m": 0.3 }],
        "drive": "d0.x", "force_n": 0.158_281_934_812_193_7,
    });
    let three = json!({
        "modes": [
            { "frequency_hz": 0.130_446_402_269_100_6, "damping_ratio": 0.012_284_945_540_404_215,
                "shape": { "d0.x": -0.962_695_673_497_635_3 } },
            { "frequency_hz": 0.148_637_516_668_677_48, "damping_ratio": 0.012_284_945_540_404_215,
                "shape": { "d0.x": 0.304_394_054_782_503_25 } },
            { "frequency_hz": 0.342_295_814_420_573_2, "damping_ratio": 0.012_284_945_540_404_215,
                "shape": { "d0.x": -0.004_220_018_844_321_993 } },
        ],
        "elements": [{ "kind": "gap", "at": "d0.x", "stiffness_n_m": 5.004_281_340_358_339_5, "gap_m": 0.3 }],
        "drive": "d0.x", "force_n": 2.771_534_528_065_627,
    });
    for (case, ends_hz) in [(one, [0.13, 0.1]), (three, [0.2, 0.1018])] {
        let (branch, beside) = beside(&case, ends_hz);
        let [leaves, returns] = of_kind(&branch, BranchPoint)[..] else { panic!("{:?}", branch.bifurcations) };
        let ends = leaving_and_returning(&beside, OriginKind::BranchPoint);
        let [[from, to]] = ends[..] else { panic!("{ends:?}, from {} to {}", leaves.value, returns.value) };
        near(from, leaves.value, 1e-9);
        near(to, returns.value, 1e-4);
    }
}

/// Two sub-harmonic responses of a structure with a quadratic force each double their period twice between 0.52 and 0.57 Hz, and
/// one branch joins both doublings. Beside the second it has a Neimark–Sacker point in the step in which it ends.
#[test]
fn a_branch_ends_where_it_meets_a_shorter_period_beside_another_bifurcation() {
    let half = core::f64::consts::FRAC_1_SQRT_2;
    let case = json!({
        "modes": [
            { "frequency_hz": 0.133_420_270_732_273_47, "damping_ratio": 0.013_665_361_105_293_346, "shape": { "d0.x": half } },
            { "frequency_hz": 0.456_973_337_619_431_7, "damping_ratio": 0.013_665_361_105_293_346, "shape": { "d0.x": half } },
        ],
        "elements": [{ "kind": "polynomial", "at": ["d0.x"], "terms": [
            { "powers": [3], "energy": 0.076_474_939_819_004_54 }, { "powers": [4], "energy": 0.756_448_303_935_559_6 },
        ] }],
        "drive": "d0.x", "force_n": 2.839_134_982_637_569,
    });
    let (_, beside) = beside(&case, [0.575, 0.515]);
    let mut ends = leaving_and_returning(&beside, OriginKind::PeriodDoubling);
    ends.iter_mut().for_each(|ends| ends.sort_by(f64::total_cmp));
    ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let parents: Vec<&Branch> = beside.branches.iter().filter(|one| one.origin.parent.is_none()).map(whole).collect();
    let mut doublings: Vec<f64> = parents.iter().flat_map(|parent| places(parent, PeriodDoubling)).collect();
    doublings.sort_by(f64::total_cmp);
    // The two of each parent are the first and the last, and those between.
    let [a, b, c, d] = doublings[..] else { panic!("{doublings:?}") };
    for ([from, to], [first, last]) in ends.iter().zip([[a, d], [b, c]]) {
        near(from * TAU, first, 1e-9);
        near(to * TAU, last, 1e-9);
    }
    assert_eq!(ends.len(), 2);
    assert!(leaving_and_returning(&beside, OriginKind::BranchPoint).is_empty());
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
        assert_eq!((doubled.origin.kind, doubled.origin.parent), (OriginKind::PeriodDoubling, Some(number)));
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
    assert_eq!((beyond.parent, beyond.period, reason), (Some(4), 16, &NotFollowed::Cascade));
}

/// The response of a branch at a frequency, between its points: the largest displacement and the stability of the nearer
/// one.
fn crossings(branch: &Branch, omega_rad_s: f64) -> Vec<(f64, Option<bool>)> {
    let at = |orbit: &Orbit| orbit.value * TAU - omega_rad_s;
    let pairs = branch.orbits.windows(2).filter(|pair| at(&pair[0]) * at(&pair[1]) <= 0.0);
    pairs
        .map(|pair| {
            let share = at(&pair[0]) / (at(&pair[0]) - at(&pair[1]));
            let [a, b] = [0, 1].map(|end: usize| pair[end].readings[0].largest);
            (a + share * (b - a), pair[usize::from(share > 0.5)].is_stable())
        })
        .collect()
}

/// A hardening oscillator has closed branches of two and of three periods of the load, which no other branch leads to. A
/// range within one of them cuts it: both its responses are found, the stable one and the other.
#[test]
fn sub_harmonic_branches_are_found_and_closed() {
    let cases = ["half", "third"].map(|name| case("sub_harmonics", name));
    let (forced, _, switched) = switched(&cases[0], &[2.2, 25.0]);
    assert_eq!((switched.branches.len(), switched.left_out.len()), (2, 0));
    for (found, case) in switched.branches.iter().zip(&cases) {
        assert_eq!((found.origin.kind, found.origin.parent), (OriginKind::SubHarmonic, None));
        assert_eq!(found.origin.period as u64, case["period"].as_u64().unwrap());
        let branch = whole(found);
        assert_eq!(branch.end, BranchEnd::Closed);
        let mut folds = places(branch, Fold);
        folds.sort_by(f64::total_cmp);
        all_near(&folds, &numbers(&case["folds_rad_s"]), 1e-9);
        near(branch.peaks[0].readings[0].largest, number(case, "largest_m"), 1e-4);
        for largest in numbers(&case["largest_at_m"]) {
            let all = crossings(branch, number(case, "at_rad_s"));
            assert!(all.iter().any(|(got, _)| (got / largest - 1.0).abs() < 1e-2), "{largest}: {all:?}");
        }
        is_confirmed_in_time(&forced, branch);
    }
}

#[test]
fn a_sub_harmonic_branch_is_cut_by_the_range() {
    let cases = ["half", "third"].map(|name| case("sub_harmonics", name));
    let (_, _, switched) = switched(&cases[0], &[4.4, 4.6]);
    // Of the responses of two periods the unstable one is not among those that are found.
    for (case, stability) in cases.iter().zip([&[Some(true)][..], &[Some(true), Some(false)]]) {
        let period = case["period"].as_u64().unwrap();
        let of_period = switched.branches.iter().filter(|found| found.origin.period as u64 == period).map(whole);
        let mut found: Vec<(f64, Option<bool>)> = of_period
            .flat_map(|branch| {
                assert_eq!(branch.end, BranchEnd::AtEnd);
                crossings(branch, number(case, "at_rad_s"))
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let largest: Vec<f64> = found.iter().map(|found| found.0).collect();
        all_near(&largest, &numbers(&case["largest_at_m"]), 1e-4);
        assert_eq!(found.iter().map(|found| found.1).collect::<Vec<_>>(), stability);
    }
}

/// The rotation numbers of an absorber's Neimark–Sacker points. Beyond the first one the response beats with the second
/// frequency: started beside the periodic response, which is unstable, the section turns by the rotation number in each
/// period.
#[test]
fn a_neimark_sacker_point_has_a_rotation_number() {
    let case = case("neimark_sacker", "absorber");
    let (forced, branch, switched) = switched(&case, &[0.9, 1.21]);
    let sought = switched.searched.unwrap().sub_harmonics.unwrap();
    assert!(switched.branches.is_empty() && sought.values.is_empty());
    let points: Vec<_> = branch.bifurcations.iter().filter(|found| found.kind == NeimarkSacker).collect();
    let expected = case["points"].as_array().unwrap();
    assert_eq!(points.len(), expected.len());
    for (point, expected) in points.iter().zip(expected) {
        near(point.orbit.value * TAU, number(expected, "omega_rad_s"), 1e-7);
        let beat = point.beat().unwrap();
        near(beat.rotation_number, number(expected, "rotation_number"), 1e-5);
        near(beat.frequency_hz, beat.rotation_number * point.orbit.value, 1e-12);
    }
    let orbit = &points[0].orbit;
    let map = StroboscopicMap::new(&forced, orbit.frequency_hz).unwrap();
    let fixed = map.to_point(&start(&forced, orbit));
    let mut state = [start(&forced, orbit)];
    state[0][0] *= 1.0 + 1e-6;
    // Other pairs of multipliers die out first. Then the distance returns to its direction after 1/ρ periods.
    map.advance_all(&mut state, 30).unwrap();
    let mut distances = Vec::new();
    for _ in 0..101 {
        distances.push((map.to_point(&state[0]) - &fixed)[0]);
        map.advance_all(&mut state, 1).unwrap();
    }
    let signs: Vec<usize> = (1..distances.len()).filter(|k| distances[k - 1] < 0.0 && distances[*k] >= 0.0).collect();
    let (first, last) = (signs[0], signs[signs.len() - 1]);
    let turns = (signs.len() - 1) as f64 / (last - first) as f64;
    near(turns, points[0].beat().unwrap().rotation_number, 1e-2);
}

/// A branch of more periods ends where it meets one of fewer. A step past that place once went on along the other: of this
/// cascade, branches of 4 and 8 periods had responses of 1 and 2.
#[test]
fn branches_keep_their_period() {
    let case = case("period_doublings", "Ueda");
    let (forced, ends) = (forced(&case), [0.7, 2.0].map(|rad_s| rad_s / TAU));
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    let leaving = OtherOptions { leaving: true, search: None };
    let switched = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options, &leaving);
    let doubled = switched.branches.iter().filter(|branch| branch.origin.period > 1);
    assert!(doubled.clone().count() > 4);
    for branch in doubled.map(OtherBranch::branch) {
        let [_, inner @ .., _] = &branch.orbits[..] else { continue };
        for orbit in inner {
            let rows = orbit.coefficients.iter().enumerate();
            let odd =
                rows.filter(|(row, _)| row.div_ceil(2) % 2 == 1).map(|(_, value)| value.abs()).fold(0.0, f64::max);
            assert!(odd > 1e-6, "{odd:e} at {} Hz of {} periods", orbit.value, orbit.period);
        }
    }
}

/// A branch of 8 periods turns so sharply beside the doubling at which it leaves that a first step of 1e-4 of the response is too
/// long. The doubling is that of independent code: shooting by an explicit method of order 8 with a tolerance of 1e-12.
#[test]
fn a_branch_that_turns_sharply_is_followed() {
    let case = case("period_doublings", "Ueda");
    let (forced, ends) = (forced(&case), [0.136_750_136_379_319_3, 0.8596 / TAU]);
    let read = forced.assembly().dof(case["read"].as_str().unwrap()).unwrap();
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
    options.near = Some(vec![-0.539_846_435_861_878_7, -1.698_808_833_217_677_8]);
    let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
    assert_eq!(branch.period(), Some(4));
    all_near(&places(&branch, PeriodDoubling), &[0.859_375_421_919], 1e-11);
    let leaving = OtherOptions { leaving: true, search: None };
    let switched = trace_branches(&forced, &branch, Coordinate::FrequencyHz, &options, &leaving);
    let [doubled, ..] = &switched.branches[..] else { panic!("{:?}", switched.left_out) };
    assert_eq!((doubled.origin.period, whole(doubled).end), (8, BranchEnd::AtEnd));
    let kept = switched.left_out.iter().all(|(_, reason)| *reason == NotFollowed::Cascade);
    assert!(kept, "{:?}", switched.left_out);
    // It comes back after 8 periods, by the accuracy of their integration, and not after 4.
    let stable: Vec<&Orbit> = whole(doubled).orbits.iter().filter(|orbit| orbit.is_stable() == Some(true)).collect();
    let [half, whole] = [4, 8].map(|periods| distance_after(&forced, stable[stable.len() / 2], periods));
    assert!(whole < 1e-6 && half > 100.0 * whole, "{whole:e} {half:e}");
}
