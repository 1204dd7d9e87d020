//! `resonarm protocol eds`: the electronic data sheet of a drive.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::numbers;
use crate::output;
use resonarm::node::WireSpec;
use resonarm::node::cia402::DriveSpec;
use resonarm::scenario::Scenario;

/// Prints the EDS (CiA 306) of a CANopen drive of a scenario, for CANopen masters.
///
/// The scenario has `preset = "cia402"` in [wire]. The EDS is the object dictionary with its values after power-on.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::NETWORK)]
pub(super) struct Eds {
    /// TOML file with the scenario.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    scenario: PathBuf,
    /// Node id of the drive; without it the scenario's only one.
    #[arg(long, value_name = "N", value_parser = numbers::integer_checked_later(1..=127_u8))]
    node_id: Option<u8>,
}

impl Eds {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = Scenario::read(&self.scenario)?;
        let Some(WireSpec::Cia402(spec)) = scenario.wire_spec()? else {
            return Err(Failure::usage(format!(
                "{} has no CANopen drives: give it [wire] with `preset = \"cia402\"`",
                self.scenario.display()
            )));
        };
        let drive = self.drive(&spec.drives)?;
        let file = format!("resonarm-{}.eds", drive.node_id);
        output::print(&drive.eds(&file, env!("CARGO_PKG_VERSION")))?;
        Ok(Verdict::Positive)
    }

    fn drive<'a>(&self, drives: &'a [DriveSpec]) -> Result<&'a DriveSpec, Failure> {
        let ids: Vec<String> = drives.iter().map(|drive| drive.node_id.to_string()).collect();
        let ids = ids.join(" and ");
        match (self.node_id, drives) {
            (Some(id), _) => drives.iter().find(|drive| drive.node_id == id).ok_or_else(|| {
                Failure::usage(format!("--node-id is {id}, but the scenario has drives with the node ids {ids}"))
            }),
            (None, [drive]) => Ok(drive),
            (None, _) => Err(Failure::usage(format!(
                "the scenario has several drives, with the node ids {ids}: choose one by --node-id"
            ))),
        }
    }
}
