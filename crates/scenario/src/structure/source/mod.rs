//! Structures from the files of other tools: chains from URDF, modes from the Universal File Format or from
//! matrices.
//!
//! The contents of a file are resolved into `links` and `modes` when the scenario is read. Where these are
//! given next to the file, they take precedence and the file is a note of their origin. So a recording holds
//! the numbers, and its re-simulation does not need the file.

mod body;
pub(super) mod error;
mod matrices;
mod mtx;
mod npy;
mod of_modes;
#[cfg(test)]
mod tests;
mod uff;
mod urdf;
mod urdf_chain;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use error::{MatrixError, StructureFileError, UffError, UrdfError, UrdfWarning};
pub use matrices::{Matrices, MatricesSection};
pub use of_modes::NotModal;

use super::error::StructureSectionError;
use super::{StructureKind, StructureSection};
use crate::text_file;
use resonarm_fmu_import::ReadAt;

/// Name of structures with keys of an FMU, for messages.
const FMU: &str = "a structure of kind `fmu`";

/// A joint of a URDF file that becomes a joint of the chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointSection {
    /// Name of the joint in the file.
    pub name: String,
    /// Torsional stiffness, N·m/rad, positive.
    pub stiffness_nm_rad: f64,
    /// Viscous damping, N·m·s/rad, not negative.
    pub damping_nm_s_rad: f64,
    /// Angle of the pose from the file's zero, about the joint's own axis, degrees, −360 to 360.
    #[serde(default)]
    pub angle_deg: f64,
}

impl StructureSection {
    /// Reads the structure from the key `configuration.structure` of a command's document. A chain is made from
    /// the links in the document, whichever preset and angles they come from.
    ///
    /// # Errors
    /// If a key is unknown, or a value of another type than it must be.
    pub fn from_document(mut structure: serde_json::Value) -> Result<StructureSection, serde_json::Error> {
        if let Some(keys) = structure.as_object_mut().filter(|keys| keys.contains_key("links")) {
            keys.retain(|key, _| !matches!(key.as_str(), "preset" | "angles_deg"));
            keys.insert(String::from("kind"), serde_json::json!(StructureKind::Chain));
        }
        serde_json::from_value::<StructureSection>(structure).map(|section| section.without_source())
    }

    /// Returns the same structure without the files that it comes from.
    #[must_use]
    pub fn without_source(&self) -> StructureSection {
        StructureSection {
            file: None,
            joints: Vec::new(),
            tip: None,
            nodes: BTreeMap::new(),
            modal_mass_kg: None,
            matrices: None,
            dofs: BTreeMap::new(),
            base: BTreeMap::new(),
            ..self.clone()
        }
    }

    /// Returns the key of the files that make this structure, if there is one, with the key that they fill and
    /// whether that is filled.
    pub(super) fn source(&self) -> Option<(&'static str, &'static str, bool)> {
        match (self.kind, &self.file, &self.matrices) {
            (StructureKind::Chain, Some(_), _) => Some(("file", "links", !self.links.is_empty())),
            (StructureKind::Modal, Some(_), _) => Some(("file", "modes", !self.modes.is_empty())),
            (StructureKind::Modal, None, Some(_)) => Some(("matrices", "modes", !self.modes.is_empty())),
            _ => None,
        }
    }

    /// Reads the files that the section names, unless `links` or `modes` are already given; paths count from
    /// `folder`.
    ///
    /// # Errors
    /// [`StructureSectionError::Read`] and [`StructureSectionError::File`]; of keys that contradict what
    /// [`StructureSection::assembly`] says.
    pub fn read(&mut self, folder: &Path) -> Result<(), StructureSectionError> {
        self.check_source_keys()?;
        if self.kind == StructureKind::Fmu {
            return self.read_fmu(folder);
        }
        let Some((_, _, false)) = self.source() else { return Ok(()) };
        match (self.kind, &self.file, &self.matrices) {
            (StructureKind::Chain, Some(file), _) => {
                let path = folder.join(file);
                let text = text_file::read(&path).map_err(unreadable(&path))?;
                let robot = urdf::Robot::parse(&text).map_err(of_file(&path))?;
                let wanted = urdf_chain::Wanted {
                    joints: &self.joints,
                    tip: self.tip.as_deref(),
                    has_gravity: self.gravity_m_s2.is_some(),
                };
                (self.links, self.file_warnings) = urdf_chain::links(&robot, &wanted).map_err(of_file(&path))?;
            }
            (_, Some(file), _) => {
                let path = folder.join(file);
                let bytes = text_file::read_bytes(&path).map_err(unreadable(&path))?;
                // Identification lines may be in any encoding, and no number is read from them. Invalid bytes
                // can be replaced without harm.
                let text = String::from_utf8_lossy(&bytes);
                let read = uff::read(&text, &self.nodes, self.modal_mass_kg).map_err(of_file(&path))?;
                // Points and lines of the scenario win over those of the file.
                self.modes = read.modes;
                for (name, at) in read.points {
                    self.points.entry(name).or_insert(at);
                }
                if self.lines.is_empty() {
                    self.lines = read.lines;
                }
            }
            (_, None, Some(matrices)) => self.modes = matrices.read(folder, &self.dofs, &self.base)?,
            (_, None, None) => {}
        }
        Ok(())
    }

    /// Rejects keys about a file where there is none, or that the kind of structure does not have.
    pub(super) fn check_source_keys(&self) -> Result<(), StructureSectionError> {
        let is_chain = self.kind == StructureKind::Chain && self.file.is_some();
        let is_uff = self.kind == StructureKind::Modal && self.file.is_some();
        let is_matrices = self.kind == StructureKind::Modal && self.matrices.is_some();
        let is_fmu = self.kind == StructureKind::Fmu;
        if is_uff && is_matrices {
            return Err(StructureSectionError::TwoSources);
        }
        if matches!(self.kind, StructureKind::Preset | StructureKind::Own)
            && (self.file.is_some() || self.matrices.is_some())
        {
            let key = if self.file.is_some() { "file" } else { "matrices" };
            return Err(StructureSectionError::Idle { key, kind: self.kind });
        }
        if matches!(self.kind, StructureKind::Chain | StructureKind::Fmu) && self.matrices.is_some() {
            return Err(StructureSectionError::Idle { key: "matrices", kind: self.kind });
        }
        let keys = [
            ("joints", !self.joints.is_empty(), is_chain, "a chain with the `file` of a robot, URDF"),
            ("tip", self.tip.is_some(), is_chain, "a chain with the `file` of a robot, URDF"),
            ("nodes", !self.nodes.is_empty(), is_uff, "a modal structure with the `file` of its modes, UFF"),
            (
                "modal_mass_kg",
                self.modal_mass_kg.is_some(),
                is_uff,
                "a modal structure with the `file` of its modes, UFF",
            ),
            ("dofs", !self.dofs.is_empty(), is_matrices, "a modal structure with `matrices`"),
            ("base", !self.base.is_empty(), is_matrices, "a modal structure with `matrices`"),
            ("sha256", self.sha256.is_some(), is_fmu, FMU),
            ("read", self.read != ReadAt::default(), is_fmu, FMU),
            ("inputs", !self.inputs.is_empty(), is_fmu, FMU),
            ("outputs", !self.outputs.is_empty(), is_fmu, FMU),
            ("parameters", !self.parameters.is_empty(), is_fmu, FMU),
        ];
        match keys.into_iter().find(|(_, is_given, is_used, _)| *is_given && !is_used) {
            Some((key, _, _, of)) => Err(StructureSectionError::OfSource { key, of }),
            None => Ok(()),
        }
    }
}

pub(super) fn unreadable(path: &Path) -> impl FnOnce(std::io::Error) -> StructureSectionError {
    let path = PathBuf::from(path);
    move |source| StructureSectionError::Read { path, kind: source.kind(), reason: source.to_string() }
}

pub(super) fn of_file<E: Into<StructureFileError>>(path: &Path) -> impl FnOnce(E) -> StructureSectionError {
    let path = PathBuf::from(path);
    move |fault| StructureSectionError::File { path, fault: Box::new(fault.into()) }
}
