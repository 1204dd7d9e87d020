//! `resonarm experiment`: whole experiments in one process, through the encoder and decoder of the protocol.

pub(crate) mod fig9;
mod walk;
mod zone_figure;

use clap::{Args, Subcommand};

use crate::failure::{Failure, Verdict};

/// Runs whole experiments of plant and controller in one process, in simulated time.
///
/// Plant and controller exchange the frames of the CAN protocol.
#[derive(Debug, Args)]
pub(crate) struct Experiment {
    #[command(subcommand)]
    pub(crate) experiment: Kind,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Kind {
    Fig9(fig9::Fig9),
    Walk(walk::WalkExperiment),
}

impl Experiment {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        match &self.experiment {
            Kind::Fig9(fig9) => fig9.execute(),
            Kind::Walk(walk) => walk.execute(),
        }
    }
}
