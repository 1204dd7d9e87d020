//! `resonarm experiment`: whole experiments in one process, through the wire's codec.

mod walk;

use clap::{Args, Subcommand};

use super::failure::{Failure, Verdict};

/// Whole experiments of plant and controller in one process, in simulated time, through the frames of the wire.
#[derive(Debug, Args)]
pub(super) struct Experiment {
    #[command(subcommand)]
    experiment: Kind,
}

#[derive(Debug, Subcommand)]
enum Kind {
    Walk(walk::Walk),
}

impl Experiment {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        match &self.experiment {
            Kind::Walk(walk) => walk.execute(),
        }
    }
}
