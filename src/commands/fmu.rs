//! `resonarm fmu`: a scenario as an FMU for other simulation tools.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::flags::{self, read_scenario};
use crate::help::heading;
use crate::numbers;
use crate::output::{Inputs, JsonFlag, OverwriteFlag};
use resonarm::scenario::Scenario;
use resonarm_fmu::content::{Content, Interface, Role, Settings, TxClock};
use resonarm_fmu::export::{Library, Summary, export};

/// Writes a plant, exciter or bus as an FMU (FMI 3.0) for other simulation tools.
///
/// The FMU is one for co-simulation, made from a scenario.
#[derive(Debug, Args)]
pub(crate) struct Fmu {
    /// TOML file with the scenario.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    scenario: PathBuf,
    /// FMU to write; its name without `.fmu` is that of the model.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    out: PathBuf,
    /// Interface of the FMU.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "KIND", value_parser = flags::described(INTERFACES), default_value = "signals")]
    interface: Interface,
    /// What the FMU simulates; exciter and bus need `--interface can`.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "ROLE", value_parser = flags::described(ROLES), default_value = "plant")]
    role: Role,
    /// Clock by which frames leave the FMU.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "KIND", value_parser = flags::described(CLOCKS), default_value = "triggered")]
    clock: TxClock,
    /// Number of nodes for which a bus has terminals, from 2 to 32.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "N", default_value_t = 2, value_parser = numbers::integer_checked_later(2..=32_u8))]
    nodes: u8,
    /// Library to pack, for Linux on x86-64 or AArch64 [default: libresonarm_fmu.so beside this program].
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    library: Option<PathBuf>,
    /// Overwrite the FMU if it exists.
    #[arg(long, help_heading = heading::OUTPUT)]
    overwrite: bool,
    #[command(flatten)]
    json: JsonFlag,
}

const INTERFACES: [(Interface, &str, &str); 2] = [
    (Interface::Signals, "signals", "Loads are inputs, and readings are outputs"),
    (Interface::Can, "can", "Frames by FMI-LS-BUS"),
];
const ROLES: [(Role, &str, &str); 3] =
    [(Role::Plant, "plant", ""), (Role::Exciter, "exciter", ""), (Role::Bus, "bus", "")];
const CLOCKS: [(TxClock, &str, &str); 2] = [
    (TxClock::Triggered, "triggered", "At the end of a step"),
    (TxClock::Countdown, "countdown", "At a time that is stated beforehand"),
];

impl Fmu {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let inputs = Inputs::of(Scenario::files(&self.scenario).iter().chain(&self.library));
        OverwriteFlag { overwrite: self.overwrite }.check([self.out.clone()], &inputs)?;
        // A plant and an exciter are one node each: only a bus has terminals for several.
        let nodes = if self.role == Role::Bus { self.nodes } else { 0 };
        let settings = Settings { interface: self.interface, role: self.role, clock: self.clock, nodes };
        let content = Content { settings, scenario: read_scenario(&self.scenario)? };
        let library = self.library.as_deref().map_or_else(Library::beside_program, Library::read)?;
        let summary = export(&content, library, &self.out)?;
        let Summary { path, bytes, platform, variables, .. } = &summary;
        let text = || format!("{}: {variables} variables, {platform}, {bytes} bytes\n", path.display());
        self.json.show(&summary, text, &[])
    }
}
