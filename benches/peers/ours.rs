//! Our side of `benches/peers/run`: one JSON line per case, the best of several rounds.
#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use std::error::Error;
use std::hint::black_box;
use std::time::Duration;

use resonarm::integrate::Scheme;
use resonarm::structure::{Assembly, BodySpec, Preset, StepError, Stepper, StructureSpec};

const RATE_HZ: f64 = 8000.0;
/// Rounds are short, so that some of them run undisturbed.
const ROUNDS: u32 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let chain = Preset::Irb1600Fitted.chain()?.at_angles_deg(&[0.0, 60.0]);
    let arm = Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] })?;
    let start = [0.02, -0.03, 0.0, 0.0];
    // The peers integrate these 800 steps by the same scheme, and `peers.py` compares where they arrive.
    let end = steps(Scheme::Rk4, &arm, &start, 800)?;
    println!(r#"{{"name": "state", "state": {end:?}}}"#);

    for scheme in Scheme::ALL {
        let count = 2_000;
        let seconds = best(|| steps(scheme, &arm, black_box(&start), count))?;
        report(&format!("resonarm {scheme}"), f64::from(count) / seconds);
    }
    Ok(())
}

/// The angles and rates after so many steps.
fn steps(scheme: Scheme, arm: &Assembly, start: &[f64], count: u32) -> Result<Vec<f64>, StepError> {
    let mut stepper = Stepper::new(arm, &[], scheme, RATE_HZ)?;
    stepper.restore(start)?;
    (0..count).try_for_each(|k| stepper.advance(f64::from(k) / RATE_HZ, black_box(&[])))?;
    Ok([stepper.position(), stepper.velocity()].concat())
}

/// The shortest time of all rounds, s.
fn best<T, E>(run: impl Fn() -> Result<T, E>) -> Result<f64, E> {
    let mut best = Duration::MAX;
    for _ in 0..ROUNDS {
        #[allow(clippy::disallowed_methods, reason = "a benchmark measures time")]
        let start = std::time::Instant::now();
        black_box(run()?);
        // Other processes only make a round longer, so the shortest is nearest to the cost of the steps.
        best = best.min(start.elapsed());
    }
    Ok(best.as_secs_f64())
}

fn report(name: &str, steps_per_s: f64) {
    println!(r#"{{"name": "{name}", "steps_per_s": {steps_per_s:.0}}}"#);
}
