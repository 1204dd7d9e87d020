//! `resonarm fmu`: a scenario as an FMU for other simulation tools.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;
use resonarm::scenario::Scenario;
use resonarm_fmu::content::{Content, Interface, Role, Settings};
use resonarm_fmu::export::{Library, Summary, export};

/// Writes a scenario's plant as an FMU (FMI 3.0 co-simulation) for other simulation tools; docs/fmu.md.
#[derive(Debug, Args)]
pub(crate) struct Fmu {
    /// The scenario, a TOML file.
    #[arg(long, value_name = "FILE")]
    scenario: PathBuf,
    /// The FMU to write; its name without `.fmu` is that of the model.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How it is connected: `signals` has loads as inputs and readings as outputs.
    #[arg(long, value_enum, default_value_t = InterfaceFlag::Signals)]
    interface: InterfaceFlag,
    /// The library to pack, of Linux on x86-64 or AArch64 [default: libresonarm_fmu.so beside this program].
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    /// Overwrite the FMU if it exists.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    json: JsonFlag,
}

/// [`Interface`] as a flag.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum InterfaceFlag {
    Signals,
}

impl Fmu {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        if !self.overwrite && self.out.exists() {
            return Err(Failure::Exists { path: self.out.clone() });
        }
        let interface = match self.interface {
            InterfaceFlag::Signals => Interface::Signals,
        };
        let settings = Settings { interface, role: Role::Plant, ..Settings::default() };
        let content = Content { settings, scenario: Scenario::read(&self.scenario)? };
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
