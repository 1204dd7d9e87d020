//! Times forced branches, folds and stability included: `peer`, the one that AUTO-07p is compared on
//! (`benches/peers/auto`), and `fig4`, six poses from 0.5 to 80 Hz at 60 N·m, on as many threads as there are cores.

use std::thread;
use std::time::Instant;

use resonarm::analysis::{AnalysisError, BifurcationKind};
use resonarm::analysis::{Branch, BranchOptions, Coordinate, Forced, TraceOptions, trace};
use resonarm::structure::{Assembly, BodySpec, Preset, StructureSpec};

fn forced(beta2_deg: f64) -> Result<Forced, Box<dyn std::error::Error>> {
    let chain = Preset::Irb1600Fitted.chain()?.at_angles_deg(&[0.0, beta2_deg]);
    let arm = Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] })?;
    let joint = arm.dof("joint1")?;
    Ok(Forced::new(arm, joint, 60.0))
}

fn branch(forced: &Forced, from_hz: f64, to_hz: f64) -> Result<Branch, AnalysisError> {
    let read = vec![forced.drives()[0].0];
    let mut options = TraceOptions::new(forced, Coordinate::FrequencyHz, [from_hz, to_hz], read);
    // As `resonarm continue` has it.
    options.branch.continuation.largest_step = BranchOptions::LARGEST_STEP;
    trace(forced, from_hz, Coordinate::FrequencyHz, &options).map_err(AnalysisError::from)
}

/// The result and the time of a computation, s.
#[allow(clippy::disallowed_methods)]
fn timed<T>(compute: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = compute();
    (result, start.elapsed().as_secs_f64())
}

/// One line: the most harmonics, seconds, points, folds in Hz.
#[allow(clippy::print_stdout)]
fn peer() -> Result<(), Box<dyn std::error::Error>> {
    let arm = forced(60.0)?;
    // The first round is not timed: it loads code and memory.
    let mut best = (branch(&arm, 21.0, 23.5)?, f64::INFINITY);
    for _ in 0..20 {
        let (result, seconds) = timed(|| branch(&arm, 21.0, 23.5));
        if seconds < best.1 {
            best = (result?, seconds);
        }
    }
    let harmonics = best.0.orbits.iter().map(|orbit| orbit.harmonics).max().unwrap_or(0);
    print!("RESONARM {harmonics} {:.6} {}", best.1, best.0.orbits.len());
    for fold in best.0.bifurcations.iter().filter(|b| b.kind == BifurcationKind::Fold) {
        print!(" {:.11}", fold.orbit.frequency_hz);
    }
    println!();
    Ok(())
}

#[allow(clippy::print_stdout)]
fn fig4() -> Result<(), Box<dyn std::error::Error>> {
    let poses = [0.0, 60.0, 120.0, 30.0, 90.0, 150.0].map(forced).into_iter().collect::<Result<Vec<_>, _>>()?;
    let cores = thread::available_parallelism()?.get();
    let trace_all = |arms: &[Forced]| arms.iter().map(|arm| branch(arm, 0.5, 80.0)).collect::<Result<Vec<_>, _>>();
    let (branches, seconds) = timed(|| {
        thread::scope(|scope| {
            let threads: Vec<_> =
                poses.chunks(poses.len().div_ceil(cores)).map(|arms| scope.spawn(move || trace_all(arms))).collect();
            threads.into_iter().map(|thread| thread.join()).collect::<Result<Vec<_>, _>>()
        })
    });
    let mut points = 0;
    for branch in branches.map_err(|_| "a thread failed")?.into_iter().collect::<Result<Vec<_>, _>>()?.iter().flatten()
    {
        points += branch.orbits.len();
    }
    println!("FIG4 {cores} {seconds:.6} {points}");
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    match std::env::args().nth(1).as_deref() {
        Some("peer") => peer(),
        Some("fig4") => fig4(),
        _ => peer().and_then(|()| fig4()),
    }
}
