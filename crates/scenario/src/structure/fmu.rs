//! A third-party FMU as the structure under test.

use std::path::{Path, absolute};
use std::sync::Arc;

use super::StructureSection;
use super::error::StructureSectionError;
use super::source::{of_file, unreadable};
use crate::text_file;
use resonarm_bench::plant::{Plant, PlantSpec, PlantSpecError};
use resonarm_bench::rig::{Converter, PlaceName, RigSpec};
use resonarm_fmu_import::{NamedChannels, Source, Spec, sha256};

impl StructureSection {
    /// Notes the absolute path of the FMU and its SHA-256, so that a recording states which FMU was used. A
    /// hash that is already stated is kept, and compared when the FMU is loaded.
    pub(super) fn read_fmu(&mut self, folder: &Path) -> Result<(), StructureSectionError> {
        let Some(file) = &self.file else { return Ok(()) };
        let path = folder.join(file);
        let path = absolute(&path).unwrap_or(path);
        if self.sha256.is_none() {
            self.sha256 = Some(sha256(&text_file::read_archive(&path).map_err(unreadable(&path))?));
        }
        self.file = Some(path);
        Ok(())
    }

    /// Allows the FMU of a recording to be loaded, from `file` and not from the path that the recording names.
    /// Its SHA-256 must be the recorded one, if there is one.
    pub fn allow_fmu(&mut self, file: &Path) {
        self.file = Some(absolute(file).unwrap_or_else(|_| file.to_path_buf()));
        self.is_recorded = false;
    }

    /// Rejects the FMU of a recording until it is allowed.
    ///
    /// # Errors
    /// [`StructureSectionError::FmuNotAllowed`].
    pub fn check_allowed(&self) -> Result<(), StructureSectionError> {
        if !self.is_recorded {
            return Ok(());
        }
        let path = self.file.clone().unwrap_or_default();
        let sha256 = self.sha256.clone();
        Err(StructureSectionError::FmuNotAllowed { path, sha256 })
    }

    /// Loads the FMU and builds its plant, with the rig, the rates and the seed of the specification.
    ///
    /// # Errors
    /// [`StructureSectionError`] of keys, of the file, and of the FMU; else [`PlantSpecError`] of the rig.
    pub fn fmu_plant(&self, spec: &PlantSpec) -> Result<Result<Plant, PlantSpecError>, StructureSectionError> {
        self.check_keys()?;
        self.check_allowed()?;
        if spec.rig.shaker.is_some() {
            return Err(StructureSectionError::OwnShaker { what: "of kind `fmu`" });
        }
        let path = self.file.clone().unwrap_or_default();
        // The bytes that are hashed are the bytes that are loaded. Hashing the file and opening it again would
        // leave time to exchange it.
        let bytes = text_file::read_archive(&path).map_err(unreadable(&path))?;
        let got = sha256(&bytes);
        if let Some(expected) = self.sha256.as_ref().filter(|expected| !expected.eq_ignore_ascii_case(&got)) {
            return Err(StructureSectionError::FmuHash { path, got, expected: expected.clone() });
        }
        let wanted = Spec {
            sample_s: 1.0 / spec.sample_rate_hz,
            steps_per_sample: spec.steps_per_sample,
            ..self.fmu_spec(&spec.rig)
        };
        let source = Source::read(bytes, &wanted).map_err(of_file(&path))?;
        Arc::new(source).plant(spec).map_err(of_file(&path))
    }

    /// Returns the channels of the FMU, as the section and the rig name them; the FMU is not read.
    pub(crate) fn fmu_channels(&self, rig: &RigSpec) -> Result<NamedChannels, StructureSectionError> {
        let path = self.file.clone().unwrap_or_default();
        NamedChannels::new(&self.fmu_spec(rig)).map_err(of_file(&path))
    }

    /// Returns the rig's requirements for the FMU, without its steps.
    fn fmu_spec(&self, rig: &RigSpec) -> Spec {
        let place = |at: &Option<PlaceName>| at.as_ref().map(|at| at.as_str().to_owned());
        Spec {
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            parameters: self.parameters.clone(),
            read: self.read,
            exciter: place(&rig.exciter.at),
            accelerometer_b: place(&rig.sensors.b.at),
            accelerometer_c: place(&rig.sensors.c.at),
            sensors: rig.sensors.more.clone(),
            is_filtered: rig.converter != Converter::Instant,
            limits_travel: rig.gate.travel_limit_m.is_some(),
            ..Spec::default()
        }
    }
}
