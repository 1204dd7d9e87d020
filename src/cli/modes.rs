//! `resonarm modes`: the natural modes of the linearised arm.

use core::fmt::Write;

use clap::Args;
use serde::Serialize;

use super::failure::{Failure, Verdict};
use super::flags::ArmFlags;
use super::output;
use crate::analysis::modes;
use crate::scenario::Scenario;

/// Natural frequencies, damping ratios and mode shapes of the arm in its pose.
#[derive(Debug, Args)]
pub(super) struct Modes {
    #[command(flatten)]
    arm: ArmFlags,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Document {
    modes: [crate::analysis::Mode; 2],
}

impl Modes {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.arm.scenario(|| Ok(Scenario::default()))?;
        let modes = modes(&scenario.build_arm()?);
        if self.json {
            output::print_json(&Document { modes })?;
        } else {
            let mut text = format!(
                "{} at β1 = {}°, β2 = {}°\n\n  mode   frequency   damping ratio   α2/α1\n",
                scenario.arm.preset, scenario.arm.beta1_deg, scenario.arm.beta2_deg
            );
            for (k, mode) in modes.iter().enumerate() {
                let ratio = mode.shape[1] / mode.shape[0];
                let _infallible = writeln!(
                    text,
                    "  {:4}   {:6.2} Hz   {:13.3e}   {ratio:+.4}",
                    k + 1,
                    mode.frequency_hz,
                    mode.damping_ratio
                );
            }
            output::print(&text)?;
        }
        Ok(Verdict::Positive)
    }
}
