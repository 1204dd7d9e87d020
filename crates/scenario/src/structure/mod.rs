//! The section `[structure]`: the structure under test. It is a chain of links, of a preset or of the user's
//! own, or a set of vibration modes, with elements at its points.

mod element;
mod element_kind;
mod error;
mod fmu;
mod places;
mod source;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use element::{At, ElementSection};
pub use element_kind::ElementKind;
pub use error::StructureSectionError;
pub use resonarm_fmu_import::{ImportError, Numbers, OutputsOf, ReadAt};
pub use source::{
    JointSection, Matrices, MatricesSection, MatrixError, NotModal, StructureFileError, UffError, UrdfError,
    UrdfWarning,
};

use resonarm_bench::plant::TestedAssembly;
use resonarm_bench::rig::RigSpec;
use resonarm_dynamics::structure::{
    Assembly, BASE, BodySpec, ChainSpec, ElementSpec, Link, ModalSpec, ModeSpec, Parameter, Place, Preset, ShapeSpec,
    StructureSpec,
};

/// Kind of structure, which decides what the other keys mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StructureKind {
    /// A chain that comes with the program, by the name of its preset.
    #[default]
    Preset,
    /// A planar chain of links with compliant joints.
    Chain,
    /// Vibration modes with their shapes.
    Modal,
    /// A structure that the program running the scenario makes.
    Own,
    /// A third-party FMU, which is stepped and read.
    Fmu,
}

impl StructureKind {
    /// Returns whether the equations are external: the structure can be stepped and read, but has no modes or
    /// branches to compute.
    pub const fn is_foreign(self) -> bool {
        matches!(self, StructureKind::Own | StructureKind::Fmu)
    }
}

/// The name of the kind in a scenario.
impl fmt::Display for StructureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// A vibration mode with its shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeSection {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio ζ, dimensionless.
    pub damping_ratio: f64,
    /// Displacement of each point along an axis, `tip.x`, of the shape that is normalised to the modal mass 1 kg,
    /// 1/√kg.
    pub shape: BTreeMap<String, f64>,
    /// Participation factor of a base that moves along an axis, `base.z`, √kg: Γ = φᵀMr of the same shape, with the
    /// displacements r of all masses as the base moves by 1.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub participation: BTreeMap<String, f64>,
}

/// Everything that a scenario states about the structure under test.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StructureSection {
    /// Kind of structure; it decides which other keys apply.
    pub kind: StructureKind,
    /// Display name in headers and figures, 1 to 60 characters. Without it they show the preset and its changed
    /// parameters, or the kind of structure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Name of the preset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Angle of each link of the preset against the link before it, of the first against the x axis, with
    /// relaxed springs, degrees. Without them the angles of the preset.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub angles_deg: Vec<f64>,
    /// File that the structure comes from: a URDF robot for a chain, a UFF file for modes, read where `links`
    /// or `modes` are not given; or the FMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The joints of the robot that become those of the chain, from the base out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<JointSection>,
    /// Link of the robot whose frame ends the chain; without it the only link at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// Nodes of the UFF file that become points, by the points' names; without them all nodes, named like
    /// `node12`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub nodes: BTreeMap<String, u32>,
    /// Modal mass for modes whose modal mass the UFF file leaves at 0, kg. Only the tool that wrote the file
    /// knows how it scales shapes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modal_mass_kg: Option<f64>,
    /// Matrices that the modes are computed from, where `modes` are not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub matrices: Option<MatricesSection>,
    /// Degrees of freedom, `tip.x`, by their rows in the matrices, from 0.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub dofs: BTreeMap<String, usize>,
    /// Rows of the matrices that move by 1 as the base does along an axis, by `base.x`, `base.y` and `base.z`: the
    /// displacements are relative to the base.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub base: BTreeMap<String, Vec<usize>>,
    /// Acceleration of gravity along −y, m/s², of a chain; without it there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_m_s2: Option<f64>,
    /// Parameters that replace the structure's own values, by name: `link2.mass_kg`, `mode1.damping_ratio`,
    /// `element1.gap_m`, `gravity_m_s2`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub set: BTreeMap<String, f64>,
    /// Initial state: coordinates and their rates; at rest without it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub initial: Vec<f64>,
    /// Lines from point to point of a modal structure, for pictures.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<Vec<String>>,
    /// The links of a chain, from the base out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<Link>,
    /// The modes of a modal structure.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<ModeSection>,
    /// Positions of a modal structure's points, m, for pictures; points that no mode moves may be among them.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub points: BTreeMap<String, [f64; 3]>,
    /// Point elements: springs, gaps, contacts, friction.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub elements: Vec<ElementSection>,
    /// SHA-256 of the FMU file, hexadecimal, as a recording states it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Whether the FMU is named by a recording. A recording is data, so its FMU is not loaded until
    /// [`StructureSection::allow_fmu`] names the file.
    #[serde(skip)]
    pub is_recorded: bool,
    /// Doubtful statements of a robot's file, known once it has been read.
    #[serde(skip)]
    pub file_warnings: Vec<UrdfWarning>,
    /// The time within a hold at which the FMU is read.
    #[serde(skip_serializing_if = "is_default")]
    pub read: ReadAt,
    /// The FMU's variables that take loads, by degree of freedom: forces at points, torques at joints.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, String>,
    /// The FMU's variables that are read, by degree of freedom.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub outputs: BTreeMap<String, OutputsOf>,
    /// Values of the FMU's parameters, by their names, in its units.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, Numbers>,
}

/// Returns whether a value is the default and need not be written.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl StructureSection {
    /// Returns the same section with the defaults of its kind written out, such as preset and angles of a
    /// preset.
    #[must_use]
    pub fn with_defaults(mut self) -> StructureSection {
        if self.kind == StructureKind::Preset {
            let name = self.preset.get_or_insert_with(|| Preset::default().name().to_owned());
            // Of an unknown preset no angles are known, which is an error where the structure is made.
            let chain = name.parse::<Preset>().and_then(Preset::chain);
            if let (true, Ok(chain)) = (self.angles_deg.is_empty(), chain) {
                self.angles_deg = chain.links.iter().map(|link| link.angle_deg).collect();
            }
        }
        self
    }

    /// Builds the structure.
    ///
    /// # Errors
    /// [`StructureSectionError`] with the part of the section that is missing, not applicable, or impossible.
    pub fn assembly(&self) -> Result<Assembly, StructureSectionError> {
        self.check_keys()?;
        let gravity_m_s2 = self.gravity_m_s2.unwrap_or(0.0);
        let body = match self.kind {
            StructureKind::Preset => BodySpec::Chain(self.preset_chain()?),
            StructureKind::Chain => {
                BodySpec::Chain(ChainSpec { links: self.links.clone(), gravity_m_s2, unstated: Vec::new() })
            }
            StructureKind::Modal => BodySpec::Modal(self.modal()?),
            StructureKind::Own => return Err(StructureSectionError::Own),
            StructureKind::Fmu => return Err(StructureSectionError::OfFmu),
        };
        let elements = self.elements.iter().zip(1..).map(|(element, number)| element.spec(number));
        let elements: Vec<ElementSpec> = elements.collect::<Result<_, _>>()?;
        let assembly = Assembly::new(&StructureSpec { body, elements })?;
        let mut values = Vec::new();
        // Gravity on a preset needs values of `set`, and is given with them.
        if let (StructureKind::Preset, Some(gravity_m_s2)) = (self.kind, self.gravity_m_s2) {
            values.push((Parameter::GRAVITY, gravity_m_s2));
        }
        for (name, value) in &self.set {
            let unknown = |source| StructureSectionError::Set { name: name.clone(), value: *value, source };
            values.push((assembly.parameter(name).map_err(unknown)?, *value));
        }
        // Parameters are set together and after assembly: one value alone may be impossible where the whole set
        // is not, such as gravity on a preset without masses.
        if values.is_empty() { Ok(assembly) } else { Ok(assembly.with_all(&values)?) }
    }

    /// Returns the chain of the preset at its angles, without gravity.
    fn preset_chain(&self) -> Result<ChainSpec, StructureSectionError> {
        let preset: Preset = self.preset.as_deref().map_or(Ok(Preset::default()), str::parse)?;
        let chain = preset.chain()?;
        let got = self.angles_deg.len();
        let expected = chain.links.len();
        if got != 0 && got != expected {
            return Err(StructureSectionError::Angles { got, expected, preset: preset.name().to_owned() });
        }
        Ok(chain.at_angles_deg(&self.angles_deg))
    }

    /// Builds the structure under test, with its initial state and the places of the rig.
    ///
    /// # Errors
    /// [`StructureSectionError`] as [`StructureSection::assembly`], and for a rig or initial state that does not fit.
    pub fn tested(&self, rig: &RigSpec) -> Result<TestedAssembly, StructureSectionError> {
        let assembly = self.assembly()?;
        // Coordinates and their rates; the internal states of elements are not stated.
        let expected = 2 * assembly.coordinates();
        let initial = match self.initial.len() {
            0 => vec![0.0; expected],
            got if got == expected => self.initial.clone(),
            got => return Err(StructureSectionError::Initial { got, expected }),
        };
        let places = places::places(&assembly, rig)?;
        if let Some(shaker) = &rig.shaker {
            shaker.armature_at(&places.exciter)?;
        }
        Ok(TestedAssembly { assembly, initial, places })
    }

    /// Returns warnings of what is doubtful in the section and in the files that it names.
    pub fn warnings(&self) -> Vec<String> {
        let of_files = self.file_warnings.iter().map(ToString::to_string);
        of_files
            .chain(self.elements.iter().zip(1..).filter_map(|(element, number)| element.unbounded(number)))
            .collect()
    }

    /// Returns the section for a structure that the program makes, with its display name.
    pub fn own(name: Option<String>) -> StructureSection {
        StructureSection { kind: StructureKind::Own, name, ..StructureSection::default() }
    }

    /// Checks that the section leaves the structure to the program, which states the places of the rig itself.
    ///
    /// # Errors
    /// [`StructureSectionError`] if it states another structure, has keys of others, or the rig has places or a shaker.
    pub fn check_own(&self, rig: &RigSpec) -> Result<(), StructureSectionError> {
        if self.kind != StructureKind::Own {
            return Err(StructureSectionError::NotOwn { kind: self.kind });
        }
        self.check_keys()?;
        if rig.shaker.is_some() {
            return Err(StructureSectionError::OwnShaker { what: "that the program makes" });
        }
        let places = [("exciter", &rig.exciter.at), ("sensors.b", &rig.sensors.b.at), ("sensors.c", &rig.sensors.c.at)];
        match places.into_iter().find(|(_, at)| at.is_some()) {
            Some((instrument, _)) => {
                let reason =
                    String::from("is given, and the program that makes the structure says where it is: leave it out");
                Err(StructureSectionError::Rig { instrument: instrument.to_owned(), reason })
            }
            None => Ok(()),
        }
    }

    /// Rejects keys that the kind does not have, and reports those that are missing.
    fn check_keys(&self) -> Result<(), StructureSectionError> {
        // Keys of files come first. Once a file has been read, its `links` or `modes` stand in the section and
        // pass as if they had been written there.
        self.check_source_keys()?;
        if let Some((key, makes, false)) = self.source() {
            return Err(StructureSectionError::NotRead { key, makes });
        }
        let links = ("links", !self.links.is_empty());
        let modes = ("modes", !self.modes.is_empty());
        let gravity = ("gravity_m_s2", self.gravity_m_s2.is_some());
        let points = ("points", !self.points.is_empty());
        let lines = ("lines", !self.lines.is_empty());
        let elements = ("elements", !self.elements.is_empty());
        let initial = ("initial", !self.initial.is_empty());
        let set = ("set", !self.set.is_empty());
        let angles = ("angles_deg", !self.angles_deg.is_empty());
        if let (Some(preset), true) = (&self.preset, self.kind != StructureKind::Preset) {
            return Err(StructureSectionError::PresetKind { preset: preset.clone(), kind: self.kind });
        }
        // One row per kind: the keys that mean nothing for it, and a key that it needs and that is missing.
        let (idle, missing): (&[(&'static str, bool)], _) = match self.kind {
            StructureKind::Own => (&[angles, links, modes, gravity, points, lines, elements, initial, set], None),
            StructureKind::Fmu => {
                let fix = "name the FMU's file";
                let missing = self.file.is_none().then_some(("`file` is", fix));
                (&[angles, links, modes, gravity, points, lines, elements, initial, set], missing)
            }
            StructureKind::Preset if links.1 => {
                return Err(StructureSectionError::KindMissing { key: links.0, kind: StructureKind::Chain });
            }
            StructureKind::Preset if modes.1 => {
                return Err(StructureSectionError::KindMissing { key: modes.0, kind: StructureKind::Modal });
            }
            StructureKind::Preset => (&[points, lines], None),
            StructureKind::Chain => {
                let fix = "add a table [[structure.links]] for every link, from the base out";
                (&[angles, modes, points, lines], (!links.1).then_some(("`links` are", fix)))
            }
            StructureKind::Modal => {
                let fix = "add a table [[structure.modes]] for every mode";
                (&[angles, links, gravity], (!modes.1).then_some(("`modes` are", fix)))
            }
        };
        if let Some((missing, fix)) = missing {
            return Err(StructureSectionError::Missing { missing, fix });
        }
        match idle.iter().find(|(_, is_given)| *is_given) {
            Some((key, _)) => Err(StructureSectionError::Idle { key, kind: self.kind }),
            None => self.check_lines(),
        }
    }

    /// Rejects lines through points whose position is unknown.
    fn check_lines(&self) -> Result<(), StructureSectionError> {
        let known = || self.points.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        match self.lines.iter().flatten().find(|name| !self.points.contains_key(*name)) {
            Some(name) => Err(StructureSectionError::Line { name: name.clone(), known: known() }),
            None => Ok(()),
        }
    }

    fn modal(&self) -> Result<ModalSpec, StructureSectionError> {
        let shapes = self.shapes("shape", |mode| &mode.shape, |point| point != BASE)?;
        let bases = self.shapes("participation", |mode| &mode.participation, |point| point == BASE)?;
        let of = |mode: &ModeSection| ModeSpec { frequency_hz: mode.frequency_hz, damping_ratio: mode.damping_ratio };
        Ok(ModalSpec { modes: self.modes.iter().map(of).collect(), shapes: [shapes, bases].concat() })
    }

    /// Collects the shapes of one table of the modes, whose points must be allowed there.
    fn shapes(
        &self,
        key: &'static str,
        table: fn(&ModeSection) -> &BTreeMap<String, f64>,
        allowed: fn(&str) -> bool,
    ) -> Result<Vec<ShapeSpec>, StructureSectionError> {
        // Every mode must state every name: a missing entry would silently mean a node of the shape.
        let names: std::collections::BTreeSet<&String> =
            self.modes.iter().flat_map(|mode| table(mode).keys()).collect();
        let shape = |name: &&String| {
            let missing = |index: usize| StructureSectionError::ShapeMissing {
                table: key,
                mode: index + 1,
                place: (*name).clone(),
            };
            let value =
                |(index, mode): (usize, &ModeSection)| table(mode).get(*name).copied().ok_or_else(|| missing(index));
            let by_mode = self.modes.iter().enumerate().map(value).collect::<Result<_, _>>()?;
            match element::place(name)? {
                Place::Dof { point, axis } if allowed(&point) => Ok(ShapeSpec { point, axis, by_mode }),
                Place::Dof { .. } => Err(StructureSectionError::Base { got: (*name).clone() }),
                Place::Joint(_) => Err(StructureSectionError::Place { got: (*name).clone() }),
            }
        };
        names.iter().map(shape).collect()
    }
}
