//! `resonarm fmu`: a scenario as an FMU for other simulation tools.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::failure::{Failure, Verdict};
use crate::flags::read_scenario;
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
    #[arg(long, help_heading = heading::SIMULATED, value_name = "KIND", value_enum, default_value_t = InterfaceFlag::Signals)]
    interface: InterfaceFlag,
    /// What the FMU simulates; exciter and bus need `--interface can`.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "ROLE", value_enum, default_value_t = RoleFlag::Plant)]
    role: RoleFlag,
    /// Clock by which frames leave the FMU.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "KIND", value_enum, default_value_t = ClockFlag::Triggered)]
    clock: ClockFlag,
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

/// The values of the flag for an [`Interface`].
#[derive(Clone, Copy, Debug, ValueEnum)]
enum InterfaceFlag {
    /// Loads are inputs, and readings are outputs.
    Signals,
    /// Frames by FMI-LS-BUS.
    Can,
}

/// The values of the flag for a [`Role`].
#[derive(Clone, Copy, Debug, ValueEnum)]
enum RoleFlag {
    Plant,
    Exciter,
    Bus,
}

/// The values of the flag for a [`TxClock`].
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ClockFlag {
    /// At the end of a step.
    Triggered,
    /// At a time that is stated beforehand.
    Countdown,
}

impl Fmu {
    fn settings(&self) -> Settings {
        let interface = match self.interface {
            InterfaceFlag::Signals => Interface::Signals,
            InterfaceFlag::Can => Interface::Can,
        };
        let (role, nodes) = match self.role {
            RoleFlag::Plant => (Role::Plant, 0),
            RoleFlag::Exciter => (Role::Exciter, 0),
            RoleFlag::Bus => (Role::Bus, self.nodes),
        };
        let clock = match self.clock {
            ClockFlag::Triggered => TxClock::Triggered,
            ClockFlag::Countdown => TxClock::Countdown,
        };
        Settings { interface, role, clock, nodes }
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let inputs = Inputs::of(Scenario::files(&self.scenario).iter().chain(&self.library));
        OverwriteFlag { overwrite: self.overwrite }.check([self.out.clone()], &inputs)?;
        let settings = self.settings();
        let content = Content { settings, scenario: read_scenario(&self.scenario)? };
        let library = match &self.library {
            Some(path) => Library::read(path)?,
            None => Library::beside_program()?,
        };
        let summary = export(&content, library, &self.out)?;
        let Summary { path, bytes, platform, variables, .. } = &summary;
        self.json.show(
            &summary,
            || format!("{}: {variables} variables, {platform}, {bytes} bytes\n", path.display()),
            &[],
        )
    }
}
