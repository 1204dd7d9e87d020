//! Thread settings that a run requests from the operating system, for its loop and around it.

use super::error::RunError;
use super::session::{OnShortfall, Session};
use resonarm_realtime::{CoresAwake, ThreadReport, ThreadSetup};

impl Session {
    /// Leaves the core of the loop to it ([`ThreadSetup::leave_core`]), if the options give it one. What runs a loop
    /// does so by itself; call it before starting threads of your own, or a bus that has some.
    pub fn leave_core(&self) {
        let Some(Err(error)) = self.options.thread.as_ref().map(ThreadSetup::leave_core) else { return };
        tracing::warn!("other threads may run on the core of the loop: {error}");
    }

    /// Makes the calling thread a real-time thread, if requested, and returns the settings that were granted and
    /// denied.
    pub(super) fn become_real_time(&self) -> Result<(Option<ThreadReport>, Option<CoresAwake>), RunError> {
        let Some(setup) = &self.options.thread else { return Ok((None, None)) };
        let (report, awake) = setup.apply();
        tracing::info!("{report}");
        match self.options.on_shortfall {
            OnShortfall::Refuse if !report.shortfalls.is_empty() => {
                return Err(RunError::NoRealTimeThread { shortfalls: report.shortfalls });
            }
            OnShortfall::Refuse | OnShortfall::Warn => {}
        }
        report.shortfalls.iter().for_each(|shortfall| tracing::warn!("{shortfall}"));
        Ok((Some(report), awake))
    }
}
