//! Times the branch of a scenario's structure, folds included, without and with the stability of every response:
//! `structure_speed FILE DRIVE AMPLITUDE FROM_HZ TO_HZ`. One JSON line each, for `benches/peers/structures/compare`.

use std::path::Path;
use std::time::Instant;

use resonarm::analysis::BifurcationKind;
use resonarm::analysis::{Assess, Branch, Coordinate, Forced, TraceOptions, trace};
use resonarm::scenario::Scenario;

/// The shortest of several rounds counts.
const ROUNDS: u32 = 20;

/// The result of the last round, and the time of the shortest, s.
#[allow(clippy::disallowed_methods, reason = "it measures time")]
fn timed<T, E>(compute: impl Fn() -> Result<T, E>) -> Result<(T, f64), E> {
    let (mut result, mut best_s) = (compute()?, f64::INFINITY);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        result = compute()?;
        best_s = best_s.min(start.elapsed().as_secs_f64());
    }
    Ok((result, best_s))
}

#[allow(clippy::print_stdout, reason = "its output is what it is for")]
fn show(assess: Assess, branch: &Branch, seconds: f64) {
    let folds: Vec<_> = branch.bifurcations.iter().filter(|found| found.kind == BifurcationKind::Fold).collect();
    let hz: Vec<f64> = folds.iter().map(|fold| fold.orbit.frequency_hz).collect();
    let harmonics = branch.orbits.iter().map(|orbit| orbit.harmonics).max().unwrap_or(0);
    let peak = branch.peaks.first().map(|peak| [peak.frequency_hz, peak.readings[0].largest]);
    let (points, peak) = (branch.orbits.len(), peak.unwrap_or([f64::NAN; 2]));
    println!(
        "{}",
        serde_json::json!({
            "tool": "Resonarm", "stability": assess == Assess::Multipliers, "harmonics": harmonics,
            "seconds": seconds, "points": points, "peak": peak, "folds_hz": hz,
        })
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, drive, numbers @ ..] = &arguments[..] else {
        return Err("give FILE DRIVE AMPLITUDE FROM_HZ TO_HZ".into());
    };
    let [amplitude, from_hz, to_hz] = numbers.iter().map(|text| text.parse()).collect::<Result<Vec<f64>, _>>()?[..]
    else {
        return Err("give AMPLITUDE, FROM_HZ and TO_HZ after the drive".into());
    };
    let tested = Scenario::read(Path::new(file))?.under_test()?;
    let dof = tested.assembly.dof(drive)?;
    let forced = Forced::new(tested.assembly, dof, amplitude);
    let coordinate = Coordinate::FrequencyHz;
    for assess in [Assess::Nothing, Assess::Multipliers] {
        let mut options = TraceOptions::new(&forced, coordinate, [from_hz, to_hz], vec![dof]);
        options.assess = assess;
        let (branch, seconds) = timed(|| trace(&forced, from_hz, coordinate, &options))?;
        show(assess, &branch, seconds);
    }
    Ok(())
}
