//! A scenario describes a whole run in one TOML file.
//!
//! Every key has a default, so that a scenario states only the values that differ. An unknown key is an error that
//! suggests the closest known one. A recording holds the whole scenario with its defaults written out.

mod abort_limits;
mod configuration;
pub mod dbc;
mod error;
mod label;
mod limit;
mod load;
pub mod nearest;
mod network;
mod provenance;
pub mod specification;
pub mod structure;
pub mod text_file;
pub mod toml_error;
pub mod wire;

pub use configuration::Configuration;
pub use error::ScenarioError;
pub use label::Change;
pub use network::NetworkSection;
pub use structure::{StructureKind, StructureSection, StructureSectionError};
pub use wire::{LockstepSpec, WireError, WireLack, WireSection};

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::toml_error::TomlError;
use crate::wire::Quantities;
use resonarm_bench::control::{
    ControlError, ControlSpec, Controller, Limited, LimitsSpec, Modelled, OpenLoop, Steered, TestController,
};
use resonarm_bench::excitation::{ExcitationSpec, LoadFile, Profile, Waveform};
use resonarm_bench::plant::{self, Plant, PlantSpec, TestedAssembly};
use resonarm_bench::rig::{Converter, Load, RigSpec, Sampling};
use resonarm_bench::structure::{Channel, OUTPUTS};
use resonarm_dynamics::integrate::Scheme;

/// Largest number of samples of a run that has an end: 31 years at 1 kHz.
pub const MOST_SAMPLES: u64 = 1_000_000_000_000;

/// A complete description of a run, as one TOML file states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// The structure under test.
    pub structure: StructureSection,
    /// Settings of the simulation: rate, scheme, seed, duration.
    pub simulation: SimulationSection,
    /// The CAN network: identifiers, profile, bit rates, timeouts, faults.
    pub network: NetworkSection,
    /// The user protocol that replaces Resonarm's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wire: Option<WireSection>,
    /// The instruments and the exciter: ranges, noise, converter, faults.
    pub rig: RigSpec,
    /// Content of a recording: how often the plotting topics hold a message.
    pub recording: RecordingSection,
    /// Load that the exciter's controller plays in open loop, if the scenario states one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excitation: Option<ExcitationSpec>,
    /// Control law of the exciter's controller, in place of an excitation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control: Option<ControlSpec>,
    /// Limits at which the exciter's controller ends the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSpec>,
}

impl Default for Scenario {
    /// Returns the scenario of an empty text.
    fn default() -> Scenario {
        Scenario {
            structure: StructureSection::default().with_defaults(),
            simulation: SimulationSection::default(),
            network: NetworkSection::default(),
            wire: None,
            rig: RigSpec::default(),
            recording: RecordingSection::default(),
            excitation: None,
            control: None,
            limits: None,
        }
    }
}

/// Settings of the simulation: rate, scheme, seed, duration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationSection {
    /// Sample rate, an integer from 1 to 65535 Hz, since the protocol states it so. At least 100 Hz in real
    /// time.
    pub rate_hz: f64,
    /// Integration steps a sample, even, from 2 to [`MOST_STEPS_PER_SAMPLE`](plant::MOST_STEPS_PER_SAMPLE); without it
    /// [`Scheme::steps_per_sample`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps_per_sample: Option<u32>,
    /// Integration scheme of the equations of motion.
    pub scheme: Scheme,
    /// Seed of all random numbers: noise of the instruments, errors of the bus.
    #[serde(with = "resonarm_numeric::seed")]
    pub seed: u64,
    /// Duration of the run, s; without it the run goes on until it is stopped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
}

impl Default for SimulationSection {
    /// 1 kHz, the default scheme with its own steps a sample, seed 0, no end.
    fn default() -> SimulationSection {
        let scheme = Scheme::default();
        SimulationSection { rate_hz: 1000.0, steps_per_sample: None, scheme, seed: 0, duration_s: None }
    }
}

impl SimulationSection {
    /// Returns the integration steps per sample, as given or the scheme's own.
    pub fn steps_per_sample(&self) -> u32 {
        self.steps_per_sample.unwrap_or(self.scheme.steps_per_sample())
    }

    /// Returns the integration step rate, Hz.
    pub fn step_rate_hz(&self) -> f64 {
        self.rate_hz * f64::from(self.steps_per_sample())
    }
}

/// Content of a recording, as a scenario states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordingSection {
    /// Decimation of the plotting topics: every how many samples they hold a message, at most 1000; 1 is every
    /// sample, 0 none.
    pub plot_every_samples: u64,
}

impl Default for RecordingSection {
    /// Plots every tenth sample.
    fn default() -> RecordingSection {
        RecordingSection { plot_every_samples: 10 }
    }
}

/// Warning about readings of [`Scenario::reads_images`].
pub const READS_IMAGES: &str = "rig.converter is `instant`: the head reads images of the shaker's held command as well, by \
    up to 10 % near a resonance; take a converter with a filter (`sinc5`)";

impl Scenario {
    /// Reads a scenario file and the files that it names, relative to the scenario's folder.
    ///
    /// # Errors
    /// [`ScenarioError::Read`] if the file can't be read, [`ScenarioError::Parse`] if it is no scenario;
    /// [`ScenarioError::ReadLoad`] and [`ScenarioError::LoadFile`] of the load file; [`ScenarioError::Wire`] of the
    /// DBC, [`ScenarioError::Structure`] of the structure's files.
    pub fn read(path: &Path) -> Result<Scenario, ScenarioError> {
        let text = text_file::read(path).map_err(|source| ScenarioError::Read { path: path.to_path_buf(), source })?;
        let mut scenario = Scenario::parse(&text, &path.display().to_string())?;
        // Paths in a scenario count from its own folder, not from the working directory, so that a scenario can
        // be moved together with its files.
        scenario.read_files(path.parent().unwrap_or(Path::new("")))?;
        Ok(scenario)
    }

    /// Returns the files that [`Scenario::read`] reads: the scenario file itself and those that it names, as
    /// far as it can be read.
    pub fn files(path: &Path) -> Vec<PathBuf> {
        let mut files = vec![path.to_path_buf()];
        let text = text_file::read(path).ok();
        // A scenario that does not pass its checks still names files. Callers watch these files, and need them
        // most while the user repairs one.
        let Some(scenario) = text.and_then(|text| Scenario::parse_unchecked(&text, "the scenario").ok()) else {
            return files;
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let matrices = scenario.structure.matrices.as_ref();
        let named = [
            scenario.wire.as_ref().map(|wire| &wire.dbc),
            scenario.structure.file.as_ref(),
            matrices.map(|matrices| &matrices.mass),
            matrices.map(|matrices| &matrices.stiffness),
            matrices.and_then(|matrices| matrices.damping.as_ref()),
        ];
        files.extend(named.into_iter().flatten().map(|file| folder.join(file)));
        if let Some(Waveform::File { path, .. }) = scenario.excitation.as_ref().map(|spec| &spec.profile) {
            files.push(folder.join(path));
        }
        if let Some((_, test)) = scenario.control.as_ref().and_then(ControlSpec::test) {
            files.extend(specification::files(&folder.join(&test.specification)));
        }
        files
    }

    /// Reads the files that the scenario names: the load of its excitation, the specification of its control, the DBC of
    /// its user protocol, and the files of its structure. Paths are relative to `folder`.
    ///
    /// # Errors
    /// [`ScenarioError::ReadLoad`] and [`ScenarioError::LoadFile`] of the load, [`ScenarioError::Specification`] of the
    /// specification, [`ScenarioError::Wire`] of the DBC, [`ScenarioError::Structure`] of the structure.
    pub fn read_files(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        if let Some(wire) = &mut self.wire {
            wire.read(folder)?;
        }
        self.read_structure(folder)?;
        if let Some(test) = self.control.as_mut().and_then(ControlSpec::test_mut) {
            test.source = Some(Arc::new(specification::read_source(&folder.join(&test.specification))?));
        }
        let profile = self.excitation.as_mut().map(|spec| &mut spec.profile);
        let Some(Waveform::File { path, load }) = profile else { return Ok(()) };
        let path = folder.join(path);
        let text = match text_file::read_numbers(&path) {
            Ok(text) => text,
            Err(source) => return Err(ScenarioError::ReadLoad { path, source }),
        };
        *load = Some(LoadFile::parse(&text).map_err(|source| ScenarioError::LoadFile { path, source })?);
        Ok(())
    }

    /// Reads the files of the structure, or notes which FMU it is; paths are relative to `folder`.
    ///
    /// # Errors
    /// [`ScenarioError::Structure`].
    pub fn read_structure(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        Ok(self.structure.read(folder)?)
    }

    /// Reads a scenario from its text; messages call the text `origin`. A load file that it names is not read,
    /// so that an excitation with it can't be played before [`Scenario::read_files`].
    ///
    /// # Errors
    /// [`ScenarioError::Parse`] if it is no scenario, and what [`Scenario::check`] finds.
    pub fn parse(text: &str, origin: &str) -> Result<Scenario, ScenarioError> {
        let scenario = Scenario::parse_unchecked(text, origin)?;
        scenario.check()?;
        Ok(scenario)
    }

    fn parse_unchecked(text: &str, origin: &str) -> Result<Scenario, ScenarioError> {
        let scenario: Scenario = toml::from_str(text).map_err(|error| TomlError::new(origin, &error))?;
        Ok(Scenario { structure: scenario.structure.with_defaults(), ..scenario })
    }

    /// Checks everything that no run can use, whatever its mode: the structure's name, the steps per sample,
    /// the timeouts, and the excitation against the exciter's limits. Values that command-line options may
    /// still replace are checked where they are used.
    ///
    /// The limits of `[limits]` are checked against the load and the instruments.
    ///
    /// # Errors
    /// [`ScenarioError::Name`] for a name that no line can show, [`ScenarioError::Plant`] for steps a sample that no
    /// plant can have, [`ScenarioError::Value`] for a timeout that is not positive or longer than an hour and for
    /// limits that contradict, [`ScenarioError::Fault`] for a fault of the network that can't be,
    /// [`ScenarioError::BeyondLimit`] for an excitation beyond the limits.
    pub fn check(&self) -> Result<(), ScenarioError> {
        self.structure.check_name()?;
        plant::check_steps_per_sample(self.simulation.steps_per_sample())?;
        self.network.check()?;
        abort_limits::check(self)?;
        match (&self.excitation, &self.control) {
            (Some(_), Some(_)) => Err(ScenarioError::TwoControllers),
            (Some(spec), None) => limit::check("excitation", &spec.amplitude, &self.rig.drive(), self.network.profile),
            // The controller answers each sample with a command. With two samples in a frame, the first one
            // would be answered a sample late.
            (None, Some(_)) if self.network.samples_per_frame != 1 => Err(ScenarioError::value(
                "network.samples_per_frame",
                self.network.samples_per_frame,
                "1 with [control]: a loop that is closed answers every sample",
            )),
            (None, Some(spec)) if spec.amplitude().force_n.z != 0.0 => Err(ScenarioError::value(
                "control.amplitude.exciter_z",
                spec.amplitude().force_n.z,
                "left out: a control law reads the impedance head, which has the axes x and y; excite along z by \
                 [excitation]",
            )),
            (None, Some(spec)) => limit::check("control", spec.amplitude(), &self.rig.drive(), self.network.profile),
            (None, None) => Ok(()),
        }
    }

    /// Returns the scenario as TOML, with every default written out.
    ///
    /// # Errors
    /// [`ScenarioError::Write`] if a value can't be written.
    pub fn to_toml(&self) -> Result<String, ScenarioError> {
        let mut whole = self.clone();
        // The scheme's own number of steps may change in a later version. A recording states the number that
        // was used.
        whole.simulation.steps_per_sample = Some(self.simulation.steps_per_sample());
        toml::to_string(&whole).map_err(|error| ScenarioError::Write { reason: error.to_string() })
    }

    /// Builds the structure under test as an assembly, with its initial state and the places of the rig.
    ///
    /// # Errors
    /// Returns [`ScenarioError::Structure`] if the section makes no structure or the rig does not fit it. An FMU
    /// and a structure that a program makes have no assembly.
    pub fn under_test(&self) -> Result<TestedAssembly, ScenarioError> {
        Ok(self.structure.tested(&self.rig)?)
    }

    /// Leaves the structure to the program that runs the scenario, under this name, unless the scenario states one
    /// itself.
    pub fn leave_structure_to_program(&mut self, name: Option<String>) {
        if self.states_no_structure() {
            self.structure = StructureSection::own(name);
        }
    }

    /// Returns whether the section `[structure]` is left out or holds only defaults.
    fn states_no_structure(&self) -> bool {
        self.structure == Scenario::default().structure
    }

    /// Returns the specification of the plant, without its structure.
    pub fn plant_spec(&self) -> PlantSpec {
        PlantSpec {
            scheme: self.simulation.scheme,
            sample_rate_hz: self.simulation.rate_hz,
            steps_per_sample: self.simulation.steps_per_sample(),
            rig: self.rig.clone(),
            seed: self.simulation.seed,
        }
    }

    /// Returns the specification of the plant for a structure that the program itself makes.
    ///
    /// # Errors
    /// [`ScenarioError::Structure`] if the scenario has another structure, or the rig does not fit the program's.
    pub fn own_plant_spec(&self) -> Result<PlantSpec, ScenarioError> {
        let mut scenario = self.clone();
        scenario.leave_structure_to_program(None);
        scenario.structure.check_own(&self.rig)?;
        Ok(self.plant_spec())
    }

    /// Builds the plant at its start; an FMU is loaded.
    ///
    /// # Errors
    /// [`ScenarioError`] as [`Scenario::under_test`], [`ScenarioError::Plant`] if it is impossible, and
    /// [`ScenarioError::Structure`] of an FMU that can't be the structure.
    pub fn plant(&self) -> Result<Plant, ScenarioError> {
        if self.is_fmu() {
            return Ok(self.structure.fmu_plant(&self.plant_spec())??);
        }
        Ok(Plant::new(&self.plant_spec(), &self.under_test()?)?)
    }

    /// Returns whether the structure under test is an FMU.
    pub fn is_fmu(&self) -> bool {
        self.structure.kind == StructureKind::Fmu
    }

    /// Returns the structure section if the equations are external: a program makes the structure, or it is an
    /// FMU.
    pub fn foreign_structure(&self) -> Option<&StructureSection> {
        self.structure.kind.is_foreign().then_some(&self.structure)
    }

    /// Returns the sample rate as the protocol states it, an integer in hertz.
    ///
    /// # Errors
    /// [`ScenarioError::Rate`] if it is not a whole number of hertz from 1 to 65535.
    pub fn wire_rate_hz(&self) -> Result<u16, ScenarioError> {
        let got_hz = self.simulation.rate_hz;
        // The cast saturates and truncates, so comparing back finds fractions, numbers beyond 65535, negative
        // ones and NaN at once.
        let rate_hz = got_hz as u16;
        if f64::from(rate_hz) == got_hz && rate_hz > 0 { Ok(rate_hz) } else { Err(ScenarioError::Rate { got_hz }) }
    }

    /// Returns the duration of the run in samples, if it has an end.
    ///
    /// # Errors
    /// [`ScenarioError::Value`] if the length is not a positive number, [`ScenarioError::TooLong`] if it has more than
    /// [`MOST_SAMPLES`] samples.
    pub fn duration_samples(&self) -> Result<Option<u64>, ScenarioError> {
        let samples = |duration_s| {
            let seconds = positive("simulation.duration_s", duration_s)?;
            // Rounded up: the run covers the whole duration. libm keeps the result independent of the platform.
            let samples = libm::ceil(seconds * self.simulation.rate_hz);
            if samples <= MOST_SAMPLES as f64 {
                Ok(samples as u64)
            } else {
                Err(ScenarioError::TooLong { duration_s, samples, most: MOST_SAMPLES })
            }
        };
        self.simulation.duration_s.map(samples).transpose()
    }

    /// Returns whether readings contain images of the held command at its own frequency: a shaker's force is
    /// not held, and converters without a filter alias the images there.
    pub fn reads_images(&self) -> bool {
        self.rig.shaker.is_some() && self.rig.converter == Converter::Instant
    }

    /// Returns the sample rate and the converter of the simulated plant's instruments.
    pub fn sampling(&self) -> Sampling {
        Sampling { rate_hz: self.simulation.rate_hz, converter: self.rig.converter }
    }

    /// Returns the exciter's controller with the limits, at sample 0, for the simulated plant.
    ///
    /// # Errors
    /// [`ScenarioError::Control`] if a loop can't be closed so, [`ScenarioError::TwoControllers`] if the scenario has
    /// an excitation as well, and without a control as [`Scenario::profile`].
    pub fn controller(&self) -> Result<Box<dyn Controller>, ScenarioError> {
        self.controller_reading(self.rig.converter)
    }

    /// Returns the same controller for a plant whose instruments have this converter, whose effect on the
    /// readings it corrects.
    ///
    /// # Errors
    /// As [`Scenario::controller`].
    pub fn controller_reading(&self, converter: Converter) -> Result<Box<dyn Controller>, ScenarioError> {
        let controller = self.unlimited_controller(converter)?;
        // What the sensors read depends on the structure, which takes longer to make than most controllers.
        let limits_sensors = self.limits.as_ref().is_some_and(|limits| !limits.sensors.is_empty());
        let outputs =
            if limits_sensors { Quantities::of_scenario(self)?.readings().to_vec() } else { OUTPUTS.to_vec() };
        Ok(self.limited(controller, &outputs))
    }

    /// Wraps a controller with the scenario's limits, if it states some, for a plant whose structure has these outputs.
    pub fn limited(&self, controller: Box<dyn Controller>, outputs: &[Channel]) -> Box<dyn Controller> {
        match &self.limits {
            Some(limits) => {
                let plant = (&self.rig, outputs);
                Box::new(Limited::new(controller, limits.clone(), plant, self.simulation.rate_hz))
            }
            None => controller,
        }
    }

    /// Returns the same controller as [`Scenario::controller_reading`] without the limits.
    ///
    /// # Errors
    /// As [`Scenario::controller`].
    pub fn unlimited_controller(&self, converter: Converter) -> Result<Box<dyn Controller>, ScenarioError> {
        self.check()?;
        let sampling = Sampling { converter, ..self.sampling() };
        match &self.control {
            None => Ok(Box::new(OpenLoop::new(self.profile()?, converter))),
            Some(spec) => {
                let limit = limit::largest(spec.amplitude(), &self.rig.drive(), self.network.profile);
                // A test is controlled without a model, so that its structure may also be an FMU.
                if let Some((law, test)) = spec.test() {
                    let controller = TestController::new(law, test, sampling.rate_hz, limit, self.rig.c_is_driven());
                    return Ok(Box::new(controller.map_err(ControlError::from)?));
                }
                let tested = self.under_test()?;
                let of = Modelled::new(&tested, &self.rig).map_err(StructureSectionError::from)?;
                Ok(spec.controller(of, sampling, limit)?)
            }
        }
    }

    /// Returns amplitude and direction of the load of the control or of the excitation, if there is one.
    pub fn amplitude(&self) -> Option<&Load> {
        let control = self.control.as_ref().map(ControlSpec::amplitude);
        control.or(self.excitation.as_ref().map(|excitation| &excitation.amplitude))
    }

    /// Returns a controller that is steered along the load of the scenario's control or excitation, for a plant
    /// whose instruments have this converter.
    ///
    /// # Errors
    /// [`ScenarioError::NoExcitation`] if it has neither; [`ScenarioError::IdleLoad`] if nothing of the structure takes
    /// the load.
    pub fn steered(&self, converter: Converter) -> Result<Steered, ScenarioError> {
        self.check()?;
        let amplitude = self.amplitude().ok_or(ScenarioError::NoExcitation)?;
        let limit = limit::largest(amplitude, &self.rig.drive(), self.network.profile);
        // The direction is the load at unit size. An amplitude is either forces or torques, so the norm of both
        // parts is that of the one that is there.
        let direction = amplitude.scaled(1.0 / libm::hypot(amplitude.force_n.norm(), amplitude.torque_nm.norm()));
        let tested = self.under_test()?;
        check_accepted(&tested, amplitude)?;
        let first_hz = tested.assembly.modes().first().map_or(f64::NAN, |mode| mode.frequency_hz);
        // The controller starts at 0.8 of the first natural frequency. At the resonance the structure would
        // respond strongly before anyone has steered it.
        Ok(Steered::new(direction, limit, Sampling { converter, ..self.sampling() }, 0.8 * first_hz))
    }

    /// Returns the load that the exciter plays over time.
    ///
    /// # Errors
    /// [`ScenarioError::NoExcitation`] if the scenario has none, [`ScenarioError::Excitation`] if it can't be played,
    /// [`ScenarioError::BeyondLimit`] if it is more than the exciter can produce or the protocol can carry.
    pub fn profile(&self) -> Result<Profile, ScenarioError> {
        let spec = self.excitation.as_ref().ok_or(ScenarioError::NoExcitation)?;
        limit::check("excitation", &spec.amplitude, &self.rig.drive(), self.network.profile)?;
        Ok(Profile::new(spec, self.simulation.rate_hz)?)
    }
}

fn positive(name: &'static str, got: f64) -> Result<f64, ScenarioError> {
    if got.is_finite() && got > 0.0 { Ok(got) } else { Err(ScenarioError::value(name, got, "a positive number")) }
}

/// Checks that a structure accepts every part of a load.
///
/// # Errors
/// [`ScenarioError::IdleLoad`] names the first part that acts on nothing.
pub fn check_accepted(tested: &TestedAssembly, load: &Load) -> Result<(), ScenarioError> {
    let idle = tested.idle_load(load);
    idle.map_or(Ok(()), |(name, got)| Err(ScenarioError::idle_load(name, got, tested.accepted_loads())))
}

#[cfg(test)]
mod tests;
