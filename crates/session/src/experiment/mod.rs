//! Whole experiments: several free runs of plant and controller with one result.
//!
//! A [`ZoneExperiment`] measures a resonance as a bench does: a phase-resonance test over the whole response and one
//! along the backbone, then stepped sines up and down at controlled force, dense where the test has found the
//! resonance. [`Score`] compares the measurement with the computed response.

mod score;
mod zone;

pub use score::{Jump, Score, score};
pub use zone::{Zone, ZoneExperiment, ZoneMeasured};

use crate::run::{Mode, Options, RunError, Session, Signals};
use resonarm_bench::control::{ControlSpec, ResponsePoint};
use resonarm_bench::node::ExciterOutcome;
use resonarm_scenario::Scenario;

/// Results of one run of a controller: the responses that it read, and how it ended.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The responses, in the order in which they were read.
    pub points: Vec<ResponsePoint>,
    /// The outcome of the run.
    pub outcome: Option<ExciterOutcome>,
    /// Length of the run, s of simulated time.
    pub simulated_s: f64,
}

/// Runs `scenario` freely with `control` instead of the work of its exciter, without a recording.
///
/// # Errors
/// [`RunError`] if the run can't start, or an error ends it.
pub fn measure(scenario: &Scenario, control: ControlSpec, signals: &Signals) -> Result<Measured, RunError> {
    let session = session(scenario, control)?;
    let rate_hz = scenario.simulation.rate_hz;
    let report = session.both(signals, &mut |_| {})?;
    let outcome = report.exciter_outcome(signals);
    match report.plant.error.or(report.exciter.error) {
        Some(error) => Err(error),
        None => Ok(Measured {
            points: report.exciter.responses,
            outcome,
            simulated_s: report.plant.samples as f64 / rate_hz,
        }),
    }
}

/// Returns the checked session of such a run.
fn session(scenario: &Scenario, control: ControlSpec) -> Result<Session, RunError> {
    let mut scenario = scenario.clone();
    scenario.control = Some(control);
    scenario.excitation = None;
    scenario.simulation.duration_s = None;
    scenario.check()?;
    let session = Session::new(scenario, Mode::Free, Options::default())?;
    session.controller()?;
    Ok(session)
}
