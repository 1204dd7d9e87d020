//! Compares branches of periodic responses with the oracles of independent code.
//!
//! `cargo run --release -p resonarm-analysis --example oracles` prints one row for each number of `tests/oracles` that belongs to
//! a branch, its bifurcations or the branches beside it: the table of `docs/continuation.md`. `tests/oracles/README.md`
//! says where the numbers are from, and the tests of this crate check most of them. With `speed` it follows the branch
//! of NLvib's example 7 instead, with stability and the search for other branches, and prints the times.
#![allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "a program that measures"
)]

mod cases;

use std::f64::consts::TAU;
use std::time::Instant;

use cases::{Case, cases, nlvib_6};
use resonarm_analysis::{
    Assess, BifurcationKind, Branch, Coordinate, Orbit, OriginKind, OtherBranches, OtherOptions, SearchOptions,
    TraceOptions, phase_zero_state, trace, trace_branches, trace_singular_curves,
};

use BifurcationKind::{BranchPoint, Fold, NeimarkSacker, PeriodDoubling};

const ISOLAS: &str = include_str!("../../../../tests/oracles/isolas.json");
const STARTS: &str = include_str!("../../../../tests/oracles/starts.json");
const SWITCHING: &str = include_str!("../../../../tests/oracles/switching.json");

/// The relative tolerance of the doublings by harmonic balance.
const TOLERANCE: f64 = 1e-5;

fn main() {
    if std::env::args().nth(1).as_deref() == Some("speed") {
        return speed();
    }
    println!("| system | load, N | quantity | oracle | Resonarm | relative difference |");
    println!("| --- | ---: | --- | ---: | ---: | ---: |");
    starts();
    isolas();
    fold_curves();
    pitchforks();
    doublings();
    sub_harmonics();
    neimark_sacker();
    polynomials();
}

/// Prints a row for each number of a quantity.
fn rows(system: &str, case: &Case, quantity: &str, oracle: &[f64], ours: &[f64]) {
    let load = case.forced.amplitude();
    if oracle.len() != ours.len() {
        println!("| {system} | {load} | {quantity} | {oracle:?} | {ours:?} | another number of them |");
        return;
    }
    for (oracle, ours) in oracle.iter().zip(ours) {
        let difference = (ours / oracle - 1.0).abs();
        println!("| {system} | {load} | {quantity} | {oracle} | {ours:.10} | {difference:.0e} |");
    }
}

/// Prints a row of two counts.
fn counts(system: &str, case: &Case, quantity: &str, oracle: usize, ours: usize) {
    let same = if oracle == ours { "0" } else { "another number" };
    println!("| {system} | {} | {quantity} | {oracle} | {ours} | {same} |", case.forced.amplitude());
}

/// The branch between two values of a coordinate.
fn branch(case: &Case, coordinate: Coordinate, ends: [f64; 2], hz: f64) -> (Branch, TraceOptions) {
    let options = TraceOptions::new(&case.forced, coordinate, ends, vec![case.read]);
    (trace(&case.forced, hz, coordinate, &options).unwrap(), options)
}

/// The branch between two frequencies, rad/s.
fn over_frequency(case: &Case, ends_rad_s: [f64; 2]) -> (Branch, TraceOptions) {
    let ends = ends_rad_s.map(|rad_s| rad_s / TAU);
    branch(case, Coordinate::FrequencyHz, ends, ends[0])
}

fn beside(case: &Case, of: &(Branch, TraceOptions), wanted: &OtherOptions) -> OtherBranches {
    trace_branches(&case.forced, &of.0, Coordinate::FrequencyHz, &of.1, wanted)
}

/// The bifurcations of a kind in ascending order, rad/s.
fn places(branch: &Branch, kind: BifurcationKind) -> Vec<f64> {
    let of_kind = branch.bifurcations.iter().filter(|found| found.kind == kind);
    let mut places: Vec<f64> = of_kind.map(|found| TAU * found.orbit.value).collect();
    places.sort_by(f64::total_cmp);
    places
}

/// The number nearest to another, if there is one.
fn nearest(among: &[f64], expected: f64) -> Vec<f64> {
    let off = |number: &f64| (number - expected).abs();
    among.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b))).into_iter().collect()
}

fn largest(orbit: &Orbit) -> f64 {
    orbit.readings[0].largest
}

/// The first response of a branch.
fn starts() {
    for case in cases(STARTS, "starts") {
        let hz = case.number("frequency_hz");
        let (branch, _) = branch(&case, Coordinate::FrequencyHz, [hz, 1.001 * hz], hz);
        let quantity = format!("largest displacement at {:.4} Hz, m", hz);
        rows(case.name(), &case, &quantity, &[case.number("largest_m")], &[largest(&branch.orbits[0])]);
    }
}

/// The folds of a branch, and the isolas beside it.
fn isolas() {
    for case in cases(ISOLAS, "isolas") {
        let main = over_frequency(&case, ["from_rad_s", "to_rad_s"].map(|key| case.number(key)));
        let name = case.name();
        if !case.data["main_largest_m"].is_null() {
            rows(name, &case, "fold, rad/s", &case.numbers("main_folds_rad_s"), &places(&main.0, Fold));
            let expected = [case.number("main_largest_m")];
            rows(name, &case, "largest displacement, m", &expected, &[largest(&main.0.peaks[0])]);
        }
        let found = beside(&case, &main, &OtherOptions { leaving: false, search: Some(SearchOptions::default()) });
        let expected = case.data["isolas"].as_array().unwrap();
        counts(name, &case, "number of isolas", expected.len(), found.branches.len());
        for (expected, isola) in expected.iter().zip(found.branches.iter().map(|found| found.branch())) {
            let folds: Vec<f64> =
                expected["folds_rad_s"].as_array().unwrap().iter().map(|fold| fold.as_f64().unwrap()).collect();
            rows(name, &case, "fold of the isola, rad/s", &folds, &places(isola, Fold));
            let expected = [expected["largest_m"].as_f64().unwrap()];
            rows(name, &case, "largest displacement of the isola, m", &expected, &[largest(&isola.peaks[0])]);
        }
    }
}

/// The loads between which an isola exists, and the folds of the response to a varying load.
fn fold_curves() {
    for case in cases(ISOLAS, "fold_curves") {
        let main = over_frequency(&case, ["from_rad_s", "to_rad_s"].map(|key| case.number(key)));
        let found = beside(&case, &main, &OtherOptions { leaving: false, search: Some(SearchOptions::default()) });
        let coordinates = [Coordinate::FrequencyHz, Coordinate::Amplitude];
        for (key, to_n) in [("isola_centre", 0.1), ("merger", 0.3)] {
            let along = TraceOptions::new(&case.forced, Coordinate::Amplitude, [0.0, to_n], vec![case.read]);
            let curves = trace_singular_curves(&case.forced, found.branches[0].branch(), coordinates, &along);
            let turns: Vec<_> = curves.into_iter().flat_map(|(_, curve)| curve.unwrap().turns).collect();
            let name = key.replace('_', " ");
            let expected = ["force_n", "omega_rad_s"].map(|number| case.data[key][number].as_f64().unwrap());
            let [loads, frequencies]: [Vec<f64>; 2] = [
                turns.iter().map(|turn| turn.point.mu).collect(),
                turns.iter().map(|turn| TAU * turn.point.lambda).collect(),
            ];
            rows(case.name(), &case, &format!("load of the {name}, N"), &expected[..1], &loads);
            rows(case.name(), &case, &format!("frequency of the {name}, rad/s"), &expected[1..], &frequencies);
        }
        let rad_s = case.number("at_rad_s");
        let (over_load, _) = branch(&case, Coordinate::Amplitude, [0.05, 3.0], rad_s / TAU);
        let folds: Vec<f64> = places(&over_load, Fold).iter().map(|fold| fold / TAU).collect();
        let quantity = format!("load of a fold at {rad_s} rad/s, N");
        for expected in case.numbers("folds_over_load_n") {
            rows(case.name(), &case, &quantity, &[expected], &nearest(&folds, expected));
        }
    }
}

/// Branch points, and the folds of the branch that leaves there.
fn pitchforks() {
    for case in cases(ISOLAS, "loops") {
        let (main, _) = over_frequency(&case, ["from_rad_s", "to_rad_s"].map(|key| case.number(key)));
        rows(case.name(), &case, "fold, rad/s", &case.numbers("main_folds_rad_s"), &places(&main, Fold));
    }
    for case in cases(SWITCHING, "branch_points") {
        let ends = case.numbers("ends_rad_s");
        let main = over_frequency(&case, [ends[0], ends[1]]);
        let expected = case.numbers("branch_points_rad_s");
        let mut found = places(&main.0, BranchPoint);
        // The oracle may have the first ones only.
        found.truncate(expected.len());
        rows(case.name(), &case, "branch point, rad/s", &expected, &found);
        let at_points = main.0.bifurcations.iter().filter(|found| found.kind == BranchPoint);
        let sizes: Vec<f64> = at_points.map(|found| largest(&found.orbit)).collect();
        let expected = case.numbers("largest_m");
        if expected.is_empty() {
            continue;
        }
        rows(case.name(), &case, "largest displacement at a branch point, m", &expected, &sizes);
        let found = beside(&case, &main, &OtherOptions { leaving: true, search: None });
        let folds = places(found.branches[0].branch(), Fold);
        rows(case.name(), &case, "fold of the branch that leaves, rad/s", &case.numbers("folds_rad_s"), &folds);
    }
}

/// The loss of symmetry and the doublings that follow it.
fn doublings() {
    for case in cases(SWITCHING, "period_doublings") {
        let name = case.name();
        let symmetric = case.numbers("branch_points_rad_s");
        let expected = case.numbers("doublings_rad_s");
        let by_balance = case.numbers("by_harmonic_balance_rad_s");
        let reaches = case.data["reaches_down_to_rad_s"].as_f64();
        let lowest = expected.iter().chain(&by_balance).copied().chain(reaches).fold(f64::INFINITY, f64::min);
        let main = over_frequency(&case, [1.04 * symmetric[0], 0.999 * lowest]);
        rows(name, &case, "branch point, rad/s", &symmetric, &places(&main.0, BranchPoint));
        let found = beside(&case, &main, &OtherOptions { leaving: true, search: None });
        let of_period = |period: usize| {
            let branches = found.branches.iter().filter(move |found| found.origin.period == period);
            branches.flat_map(|found| places(found.branch(), PeriodDoubling)).last()
        };
        if reaches.is_some() {
            let doublings = found.branches.iter().map(|found| places(found.branch(), PeriodDoubling).len()).sum();
            counts(name, &case, "number of period doublings", 0, doublings);
        }
        for (at, period) in [1, 2, 4].into_iter().enumerate() {
            let quantity = format!("doubling from {period} to {} periods, rad/s", 2 * period);
            let ours: Vec<f64> = of_period(period).into_iter().collect();
            // Those by integration over the period, with the variations.
            let integrated = expected.get(at);
            if let Some(integrated) = integrated {
                rows(name, &case, &quantity, &[*integrated], &ours);
            }
            if let Some(balance) = by_balance.get(at) {
                let is_off = integrated.is_some_and(|integrated| (balance / integrated - 1.0).abs() > TOLERANCE);
                let remark = if is_off { " (off: integration in time agrees with Resonarm)" } else { "" };
                let quantity = format!("{quantity}, oracle by harmonic balance{remark}");
                rows(name, &case, &quantity, &[*balance], &ours);
            }
        }
    }
}

/// Closed branches of 2 and 3 periods of the load.
fn sub_harmonics() {
    let search = SearchOptions { frequencies: 0, load_factor: 1.0, sub_harmonics: true, ..SearchOptions::default() };
    for case in cases(SWITCHING, "sub_harmonics") {
        let name = format!("sub-harmonic, {}", case.name());
        let main = over_frequency(&case, [2.2, 25.0]);
        let found = beside(&case, &main, &OtherOptions { leaving: false, search: Some(search) });
        let period = case.number("period") as usize;
        let is_own = |kind: OriginKind, of: usize| kind == OriginKind::SubHarmonic && of == period;
        let own = found.branches.iter().find(|found| is_own(found.origin.kind, found.origin.period)).unwrap().branch();
        rows(&name, &case, "fold, rad/s", &case.numbers("folds_rad_s"), &places(own, Fold));
        let expected = [case.number("largest_m")];
        rows(&name, &case, "largest displacement, m", &expected, &[largest(&own.peaks[0])]);
        let hz = case.number("at_rad_s") / TAU;
        let at: Vec<f64> = own.orbits.windows(2).filter_map(|pair| at_frequency(&case, pair, hz, &main.1)).collect();
        for expected in case.numbers("largest_at_m") {
            let quantity = format!("largest displacement at {} rad/s, m", case.number("at_rad_s"));
            rows(&name, &case, &quantity, &[expected], &nearest(&at, expected));
        }
    }
}

/// Returns the largest displacement at a frequency, if the branch passes it between two responses.
fn at_frequency(case: &Case, pair: &[Orbit], hz: f64, options: &TraceOptions) -> Option<f64> {
    let from = &pair[0];
    if (from.value - hz) * (pair[1].value - hz) > 0.0 {
        return None;
    }
    let near = phase_zero_state(&case.forced, Coordinate::FrequencyHz, from);
    let branch = options.branch.between(from.value, hz);
    let options = TraceOptions { near, branch, assess: Assess::Nothing, ..options.clone() };
    let branch = trace(&case.forced, from.value, Coordinate::FrequencyHz, &options).unwrap();
    branch.orbits.last().map(largest)
}

/// Neimark–Sacker points with their rotation numbers.
fn neimark_sacker() {
    for case in cases(SWITCHING, "neimark_sacker") {
        let (branch, _) = over_frequency(&case, [0.9, 1.21]);
        let points: Vec<_> = branch.bifurcations.iter().filter(|found| found.kind == NeimarkSacker).collect();
        for expected in case.data["points"].as_array().unwrap() {
            let [rad_s, rotation] = ["omega_rad_s", "rotation_number"].map(|key| expected[key].as_f64().unwrap());
            let off = |orbit: &Orbit| (TAU * orbit.value - rad_s).abs();
            let nearest = points.iter().min_by(|a, b| off(&a.orbit).total_cmp(&off(&b.orbit)));
            let ours: Vec<f64> = nearest.iter().map(|found| TAU * found.orbit.value).collect();
            rows(case.name(), &case, "Neimark–Sacker point, rad/s", &[rad_s], &ours);
            let ours: Vec<f64> = nearest.iter().filter_map(|found| Some(found.beat()?.rotation_number)).collect();
            rows(case.name(), &case, "rotation number there", &[rotation], &ours);
        }
    }
}

/// Polynomials over several displacements. The peaks have three digits.
fn polynomials() {
    let expected: [(f64, &[f64], f64); 4] = [
        (2e-4, &[], 0.0692),
        (5e-4, &[], 0.1346),
        (1e-3, &[1.127_343, 1.128_547], 0.202),
        (3e-3, &[1.087_927, 1.122_992], 0.328),
    ];
    for (force_n, folds, peak) in expected {
        let case = nlvib_6(force_n);
        let (branch, _) = over_frequency(&case, [1.18, 1.05]);
        rows("NLvib 06", &case, "fold, rad/s", folds, &places(&branch, Fold));
        let first_harmonic = branch.peaks[0].readings[0].harmonic1.norm_sqr().sqrt();
        rows("NLvib 06", &case, "first harmonic at the peak, m", &[peak], &[first_harmonic]);
    }
}

/// Times the branch of NLvib's example 7, friction, cubic springs and a contact, as `resonarm continue` follows it: with
/// stability, and with the search for other branches.
fn speed() {
    let case = cases(STARTS, "systems").into_iter().find(|case| case.name().starts_with("NLvib07")).unwrap();
    let begin = Instant::now();
    let main = over_frequency(&case, [0.5, 2.0]);
    println!("{:.3} s, {} responses, {:?}", begin.elapsed().as_secs_f64(), main.0.orbits.len(), main.0.work);
    for found in &main.0.bifurcations {
        println!("{} at {:.9} Hz, {:.9} m", found.kind.name(), found.orbit.value, largest(&found.orbit));
    }
    let begin = Instant::now();
    let found = beside(&case, &main, &OtherOptions { leaving: false, search: Some(SearchOptions::default()) });
    println!("search: {:.3} s, {} isolas", begin.elapsed().as_secs_f64(), found.branches.len());
}
