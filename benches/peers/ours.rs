//! Our side of `benches/peers/run`: one JSON line per case, the best of several rounds.
#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use std::error::Error;
use std::hint::black_box;
use std::time::Duration;

use resonarm::arm::{Arm, Load, Pose, Preset, State};
use resonarm::integrate::{IntegrateError, Integrator, Scheme};

const RATE_HZ: f64 = 8000.0;
/// Rounds are short, so that some of them run undisturbed.
const ROUNDS: u32 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let arm = Arm::new(Preset::Irb1600Fitted.parameters()?, Pose { beta1_deg: 0.0, beta2_deg: 60.0 })?;
    let start = State::new([0.02, -0.03], [0.0, 0.0]);
    let end = steps(Scheme::Rk4, &arm, start, 800)?;
    let [x, v] = [end.alpha_rad, end.alpha_dot_rad_s];
    println!(r#"{{"name": "state", "state": [{}, {}, {}, {}]}}"#, x.x, x.y, v.x, v.y);

    for scheme in Scheme::ALL {
        let count = 2_000;
        let seconds = best(|| steps(scheme, &arm, black_box(start), count))?;
        report(&format!("resonarm {scheme}"), f64::from(count) / seconds);
    }
    Ok(())
}

fn steps(scheme: Scheme, arm: &Arm, start: State, count: u32) -> Result<State, IntegrateError> {
    let integrator = Integrator::new(scheme, RATE_HZ, arm)?;
    let load = black_box(Load::default());
    (0..count).try_fold(start, |state, k| integrator.step(arm, f64::from(k) / RATE_HZ, &state, &load))
}

/// The shortest time of all rounds, s.
fn best<T, E>(run: impl Fn() -> Result<T, E>) -> Result<f64, E> {
    let mut best = Duration::MAX;
    for _ in 0..ROUNDS {
        #[allow(clippy::disallowed_methods, reason = "a benchmark measures time")]
        let start = std::time::Instant::now();
        black_box(run()?);
        best = best.min(start.elapsed());
    }
    Ok(best.as_secs_f64())
}

fn report(name: &str, steps_per_s: f64) {
    println!(r#"{{"name": "{name}", "steps_per_s": {steps_per_s:.0}}}"#);
}
