//! Errors of a scenario's section `[structure]`.

use std::path::PathBuf;

use thiserror::Error;

use resonarm_bench::rig::MOST_CHANNELS;

use super::StructureKind;
use super::element_kind::ElementKind;
use super::source::error::StructureFileError;
use resonarm_bench::plant::ShakerAcross;
use resonarm_dynamics::structure::StructureError;
use resonarm_numeric::number::short;

/// Reason why the section `[structure]`, or a file that it names, makes no structure.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureSectionError {
    /// The dynamics reject the structure.
    #[error("structure: {0}")]
    Structure(#[from] StructureError),
    /// A required key is missing.
    #[error("structure: {missing} missing: {fix}")]
    Missing {
        /// Missing key, with the verb `is` or `are`.
        missing: &'static str,
        /// Remedy that the message suggests, in words.
        fix: &'static str,
    },
    /// The structure comes from the program that runs the scenario, and no such program is running it.
    #[error(
        "structure: `kind` is own, but no program provides the structure; run the scenario from a program, as resonarm.run(…, \
         structure=…) in Python"
    )]
    Own,
    /// The program supplies a structure, and the scenario states another one.
    #[error(
        "structure: `kind` is {kind}, but the program has its own structure: leave [structure] out, or set `kind` to own"
    )]
    NotOwn {
        /// Kind of structure that the scenario states.
        kind: StructureKind,
    },
    /// The key has no meaning for this kind of structure.
    #[error("structure: `{key}` does not apply to a structure of kind `{kind}`: leave it out")]
    Idle {
        /// Key that has no meaning there.
        key: &'static str,
        /// Kind of the structure.
        kind: StructureKind,
    },
    /// A preset is combined with another kind of structure.
    #[error("structure: `preset` is {preset}, a structure of its own, and `kind` is {kind}: leave one of them out")]
    PresetKind {
        /// Name of the preset.
        preset: String,
        /// Kind of structure that is stated beside it.
        kind: StructureKind,
    },
    /// Links or modes are given, but the kind that uses them is not.
    #[error("structure: `{key}` is given without the kind of structure: add `kind = \"{kind}\"`")]
    KindMissing {
        /// Key that is given.
        key: &'static str,
        /// Kind of structure that has the key.
        kind: StructureKind,
    },
    /// The number of angles differs from the number of links.
    #[error("structure.angles_deg has {got} numbers: give {expected}, one for each link of {preset}")]
    Angles {
        /// Number of angles that were given.
        got: usize,
        /// Number of links of the preset.
        expected: usize,
        /// Name of the preset.
        preset: String,
    },
    /// A parameter of `set` is unknown.
    #[error("structure.set: `{name}` is {value}: {source}", value = short(.value))]
    Set {
        /// The name of the parameter.
        name: String,
        /// Value that was given.
        value: f64,
        /// Reason why it is rejected.
        source: StructureError,
    },
    /// A required key of an element is missing.
    #[error("structure.elements, number {element}: `{key}` is missing")]
    ElementKeyMissing {
        /// The number of the element, from 1.
        element: usize,
        /// Key that is missing.
        key: String,
    },
    /// The key of an element has the unit of the other kind of place, axis or joint.
    #[error(
        "structure.elements, number {element}: `{got}` has the unit of {}, and the element is {}: give `{key}`",
        if *.is_joint { "an axis" } else { "a joint" }, if *.is_joint { "at a joint" } else { "at an axis" }
    )]
    ElementUnit {
        /// The number of the element, from 1.
        element: usize,
        /// Key that was given.
        got: String,
        /// Key that the element needs.
        key: String,
        /// Whether the element is at a joint.
        is_joint: bool,
    },
    /// A key is unknown for the law of the element.
    #[error(
        "structure.elements, number {element}: there is no `{key}` here{}: the keys are {known}",
        nearest.as_ref().map(|nearest| format!(", did you mean `{nearest}`?")).unwrap_or_default()
    )]
    ElementKeyUnknown {
        /// The number of the element, from 1.
        element: usize,
        /// Key that is unknown.
        key: String,
        /// Known key closest to it.
        nearest: Option<String>,
        /// All known keys, separated by commas.
        known: String,
    },
    /// The element has no place, or several.
    #[error("structure.elements, number {element}: give one of `at`, `joint` and `between`")]
    ElementPlace {
        /// The number of the element, from 1.
        element: usize,
    },
    /// A list of places for an element with one displacement.
    #[error("structure.elements, number {element}: `at` has {got} places: a {kind} has one, a polynomial several")]
    SeveralPlaces {
        /// The number of the element, from 1.
        element: usize,
        /// Number of places that the element states.
        got: usize,
        /// Kind of the element.
        kind: ElementKind,
    },
    /// A polynomial without `at`, or with another place.
    #[error("structure.elements, number {element}: a polynomial needs `at` alone, as in at = [\"tip.x\", \"mid.x\"]")]
    PolynomialPlace {
        /// The number of the element, from 1.
        element: usize,
    },
    /// `terms` are given for an element that is no polynomial.
    #[error("structure.elements, number {element}: `terms` apply only to polynomials, not to a {kind}: leave them out")]
    TermsIdle {
        /// The number of the element, from 1.
        element: usize,
        /// Kind of the element.
        kind: ElementKind,
    },
    /// `side` is given for an element that is not a contact.
    #[error("structure.elements, number {element}: `side` applies only to contacts: leave it out")]
    SideIdle {
        /// The number of the element, from 1.
        element: usize,
    },
    /// The text does not name a place.
    #[error("structure: `{got}` is not a place: write point and axis, as in \"tip.x\"")]
    Place {
        /// Text that was given.
        got: String,
    },
    /// A mode lacks the displacement of a point that another mode has.
    #[error(
        "structure.modes, number {mode}: `{table}` lacks `{place}`: give it in every mode, 0 where it does not move"
    )]
    ShapeMissing {
        /// Table of the mode, `shape` or `participation`.
        table: &'static str,
        /// The number of the mode, from 1.
        mode: usize,
        /// Point and axis, such as `tip.x`.
        place: String,
    },
    /// A shape names the base, or a participation factor names another point.
    #[error(
        "structure: `{got}`: `base` is the base of the structure; state it in `participation`, as \"base.z\" = 1.2 (√kg), and use \
         another name for a point in `shape`"
    )]
    Base {
        /// Point and axis, such as `base.z`.
        got: String,
    },
    /// A line passes through a point without a position.
    #[error(
        "structure.lines: the position of `{name}` is unknown: give it in [structure.points]{}",
        if known.is_empty() { String::new() } else { format!("; there are {known}") }
    )]
    Line {
        /// Name of the point.
        name: String,
        /// Names of the points that have positions.
        known: String,
    },
    /// The initial state has the wrong length.
    #[error("structure.initial has {got} numbers: give {expected}, the coordinates and their rates")]
    Initial {
        /// Length that was given.
        got: usize,
        /// Twice the number of coordinates.
        expected: usize,
    },
    /// A file can't be read.
    #[error("can't read {}: {reason}; paths are relative to the scenario's folder", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Kind of the operating system's error.
        kind: std::io::ErrorKind,
        /// Message of the operating system.
        reason: String,
    },
    /// A file can be read, but its contents make no structure.
    #[error("{}: {fault}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Fault of the contents.
        fault: Box<StructureFileError>,
    },
    /// The files that the section names have not been read.
    #[error(
        "structure: `{key}` names a file that has not been read: read the scenario from its file, or give `{makes}`"
    )]
    NotRead {
        /// Key that names the file.
        key: &'static str,
        /// Key that the contents of the file would fill.
        makes: &'static str,
    },
    /// The section names two sources for one structure.
    #[error("structure: give `file` or `matrices`, not both: modes come from one of them")]
    TwoSources,
    /// The key belongs to structures from another source.
    #[error("structure: `{key}` applies only to {of}: leave it out")]
    OfSource {
        /// Key that does not apply.
        key: &'static str,
        /// Structures that have the key, in words.
        of: &'static str,
    },
    /// The number of modes to keep is out of range, or must be stated.
    #[error(
        "structure.matrices: `modes` is {}: it must be from 1 to {most}, since the matrices have {rows} rows",
        got.map_or(String::from("missing"), |got| got.to_string())
    )]
    Kept {
        /// Number that was given.
        got: Option<usize>,
        /// Number of rows of the matrices.
        rows: usize,
        /// Largest number of modes that can be kept.
        most: usize,
    },
    /// The row lies beyond the matrices.
    #[error("structure: `{name}` is row {got}: the matrices have rows 0 to {}", rows - 1)]
    Row {
        /// Name of the degree of freedom.
        name: String,
        /// Row that was given, from 0.
        got: usize,
        /// Number of rows of the matrices.
        rows: usize,
    },
    /// Impedance head and sensors together have more channels than a rig supports.
    #[error(
        "[rig.sensors]: head and sensors have {got} channels: a rig has at most {MOST_CHANNELS}; leave some out, or read single axes (\"tip.z\")"
    )]
    TooManyChannels {
        /// Number of channels of head and sensors together.
        got: usize,
    },
    /// The place of an instrument or of the exciter is not on the structure.
    #[error("rig.{instrument}: `at` {reason}")]
    Rig {
        /// Name of the instrument.
        instrument: String,
        /// Reason, as the end of a sentence that begins with the key.
        reason: String,
    },
    /// The shaker pushes in a direction in which the structure can't move.
    #[error(transparent)]
    Shaker(#[from] ShakerAcross),
    /// A shaker is combined with a structure of the program or an FMU.
    #[error(
        "rig.shaker needs the arm or a structure of the scenario, since its armature moves with it: leave it out; a structure {what} \
         is driven by the ideal exciter of `rig.exciter`"
    )]
    OwnShaker {
        /// Origin of the structure, in words.
        what: &'static str,
    },
    /// The command needs equations, and an FMU shows none.
    #[error(
        "structure: `kind` is fmu: modes, responses and branches need the equations of a structure, which an FMU does not provide; \
         use it in runs in the modes free and lockstep"
    )]
    OfFmu,
    /// An FMU can't run in real time, since nothing bounds the time of its steps.
    #[error(
        "structure: `kind` is fmu: an FMU is third-party code whose steps can take any time, so it does not run in real time: use the mode free or lockstep"
    )]
    FmuInRealTime,
    /// The scenario is from a recording, and its FMU has not been allowed: loading it would run code.
    #[error(
        "the recording was made with the FMU {}, {}: it is not loaded from the path in the recording, since an FMU is code that runs \
         with your rights; if you trust it, name its file with --fmu FILE (in Python fmu=FILE), whose SHA-256 is compared",
        path.display(), of_hash(sha256)
    )]
    FmuNotAllowed {
        /// Path of the FMU that the recording names.
        path: PathBuf,
        /// SHA-256 that the recording states, if it does.
        sha256: Option<String>,
    },
    /// The file is another FMU than the one whose hash is stated.
    #[error(
        "{}: its SHA-256 is {got}, but structure.sha256 is {expected}, so it is another FMU than the one that was meant or recorded", path.display()
    )]
    FmuHash {
        /// Path of the FMU.
        path: PathBuf,
        /// SHA-256 of the file.
        got: String,
        /// SHA-256 that the scenario states.
        expected: String,
    },
}

/// Words an FMU's SHA-256 for a message.
fn of_hash(sha256: &Option<String>) -> String {
    sha256.as_ref().map_or(String::from("whose SHA-256 it does not state"), |sha256| format!("SHA-256 {sha256}"))
}
