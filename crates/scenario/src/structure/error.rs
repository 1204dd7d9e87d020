//! What is wrong with a structure of a scenario.

use std::path::PathBuf;

use thiserror::Error;

use resonarm_bench::rig::MOST_CHANNELS;

use super::ImportError;
use super::source::StructureFileError;
use resonarm_bench::plant::ShakerAcross;
use resonarm_dynamics::structure::StructureError;
use resonarm_numeric::number::short;

/// Why the section `[structure]` of a scenario, or a file that it names, makes no structure.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureSectionError {
    /// It is no structure.
    #[error("structure: {0}")]
    Structure(#[from] StructureError),
    /// A key that is needed is missing.
    #[error("structure: {missing} missing: {fix}")]
    Missing {
        /// The key, with `is` or `are`.
        missing: &'static str,
        /// How to fix it.
        fix: &'static str,
    },
    /// A structure that a program makes is asked for where there is no such program.
    #[error(
        "structure: `kind` is own: the program that runs the scenario makes the structure, as resonarm.run(…, structure=…) \
         in Python; the scenario alone has none"
    )]
    Own,
    /// A program's own structure in place of one that the scenario has.
    #[error(
        "structure: `kind` is {kind}, and the program has a structure of its own: leave [structure] out, or make `kind` own"
    )]
    NotOwn {
        /// The kind.
        kind: &'static str,
    },
    /// A key that means nothing for the kind of structure.
    #[error("structure: `{key}` says nothing about a structure of kind `{kind}`: leave it out")]
    Idle {
        /// The key.
        key: &'static str,
        /// The kind.
        kind: &'static str,
    },
    /// A key of a kind of structure beside a preset.
    #[error("structure: `preset` is {preset}, a structure of its own, and `kind` is {kind}: leave one of them out")]
    PresetKind {
        /// The preset.
        preset: String,
        /// The kind.
        kind: &'static str,
    },
    /// Links beside a preset.
    #[error("structure: `{key}` is given, and not the kind of structure: add `kind = \"{kind}\"`")]
    KindMissing {
        /// The key.
        key: &'static str,
        /// The kind that has it.
        kind: &'static str,
    },
    /// Angles for another number of links.
    #[error("structure.angles_deg has {got} numbers: give {expected}, one for each link of {preset}")]
    Angles {
        /// How many were given.
        got: usize,
        /// How many links there are.
        expected: usize,
        /// The preset.
        preset: String,
    },
    /// A parameter of `set` is unknown.
    #[error("structure.set: `{name}` is {value}: {source}", value = short(.value))]
    Set {
        /// The name of the parameter.
        name: String,
        /// The value.
        value: f64,
        /// What is wrong with it.
        source: StructureError,
    },
    /// An element lacks a key.
    #[error("structure.elements, number {element}: `{key}` is missing")]
    ElementKeyMissing {
        /// The number of the element, from 1.
        element: usize,
        /// The key.
        key: String,
    },
    /// An element has the key of the other kind of place.
    #[error(
        "structure.elements, number {element}: `{got}` has the unit of {}, and the element is {}: give `{key}`",
        if *.is_joint { "an axis" } else { "a joint" }, if *.is_joint { "at a joint" } else { "at an axis" }
    )]
    ElementUnit {
        /// The number of the element, from 1.
        element: usize,
        /// The key that is given.
        got: String,
        /// The key that it needs.
        key: String,
        /// Whether the element is at a joint.
        is_joint: bool,
    },
    /// An element has a key that it doesn't know.
    #[error(
        "structure.elements, number {element}: there is no `{key}` here{}: the keys are {known}",
        nearest.as_ref().map(|nearest| format!(", did you mean `{nearest}`?")).unwrap_or_default()
    )]
    ElementKeyUnknown {
        /// The number of the element, from 1.
        element: usize,
        /// The key.
        key: String,
        /// The nearest known key.
        nearest: Option<String>,
        /// The known keys.
        known: String,
    },
    /// An element with no place, or several.
    #[error("structure.elements, number {element}: give one of `at`, `joint` and `between`")]
    ElementPlace {
        /// The number of the element, from 1.
        element: usize,
    },
    /// An element without sides has one.
    #[error("structure.elements, number {element}: `side` is of contacts alone: leave it out")]
    SideIdle {
        /// The number of the element, from 1.
        element: usize,
    },
    /// A text that names no place.
    #[error("structure: `{got}` names no place: write point and axis, as in \"tip.x\"")]
    Place {
        /// The text.
        got: String,
    },
    /// A mode without the displacement of a point that another mode has.
    #[error(
        "structure.modes, number {mode}: `{table}` lacks `{place}`: give it in every mode, 0 where it does not move"
    )]
    ShapeMissing {
        /// `shape` or `participation`.
        table: &'static str,
        /// The number of the mode, from 1.
        mode: usize,
        /// Point and axis.
        place: String,
    },
    /// A shape of the base, or a participation factor of another point.
    #[error(
        "structure: `{got}`: `base` is what the structure stands on: its motion excites the modes by the key `participation`, as \
         \"base.z\" = 1.2, √kg, and no point of a shape is called so"
    )]
    Base {
        /// Point and axis.
        got: String,
    },
    /// A line through a point that has no place.
    #[error(
        "structure.lines: nothing says where `{name}` is: give its place in [structure.points]{}",
        if known.is_empty() { String::new() } else { format!("; there are {known}") }
    )]
    Line {
        /// The point.
        name: String,
        /// The points that have places.
        known: String,
    },
    /// The initial state has another length.
    #[error("structure.initial has {got} numbers: give {expected}, the coordinates and their rates")]
    Initial {
        /// How many were given.
        got: usize,
        /// Twice the number of coordinates.
        expected: usize,
    },
    /// A file can't be read.
    #[error("can't read {}: {reason}; paths count from the scenario's folder", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The kind of the refusal.
        kind: std::io::ErrorKind,
        /// Why.
        reason: String,
    },
    /// A file has not what is needed.
    #[error("{}: {fault}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: Box<StructureFileError>,
    },
    /// The files that it names have not been read.
    #[error(
        "structure: `{key}` names a file that has not been read: read the scenario from its file, or give `{makes}`"
    )]
    NotRead {
        /// The key that names it.
        key: &'static str,
        /// The key of what it makes.
        makes: &'static str,
    },
    /// Two sources of one structure.
    #[error("structure: give `file` or `matrices`, not both: modes come from one of them")]
    TwoSources,
    /// A key of structures from another source.
    #[error("structure: `{key}` is of {of}: leave it out")]
    OfSource {
        /// The key.
        key: &'static str,
        /// What has it.
        of: &'static str,
    },
    /// How many modes to keep is impossible, or has to be stated.
    #[error(
        "structure.matrices: `modes` is {}: the matrices have {rows} rows, and 1 to {most} of the lowest modes are kept",
        got.map_or(String::from("missing"), |got| got.to_string())
    )]
    Kept {
        /// What was given.
        got: Option<usize>,
        /// The rows of the matrices.
        rows: usize,
        /// The most that are kept.
        most: usize,
    },
    /// A row that the matrices don't have.
    #[error("structure: `{name}` is row {got}: the matrices have rows 0 to {}", rows - 1)]
    Row {
        /// The degree of freedom.
        name: String,
        /// The row.
        got: usize,
        /// How many there are.
        rows: usize,
    },
    /// Head and sensors have more channels than a rig.
    #[error(
        "[rig.sensors]: head and sensors have {got} channels: a rig has at most {MOST_CHANNELS}; leave some out, or read single axes (\"tip.z\")"
    )]
    TooManyChannels {
        /// Their number.
        got: usize,
    },
    /// Where an instrument or the exciter is can't be found.
    #[error("rig.{instrument}: `at` {reason}")]
    Rig {
        /// The instrument.
        instrument: String,
        /// Why.
        reason: String,
    },
    /// A shaker that pushes where the structure does not move.
    #[error(transparent)]
    Shaker(#[from] ShakerAcross),
    /// A shaker on a structure that the program makes, or on an FMU.
    #[error(
        "rig.shaker needs the arm or a structure of the scenario, as its armature moves with it: leave it out here; a structure {what} \
         is driven by the ideal exciter of `rig.exciter`"
    )]
    OwnShaker {
        /// Whose structure it is.
        what: &'static str,
    },
    /// An FMU where equations are needed.
    #[error(
        "structure: `kind` is fmu: an FMU is stepped and read, in the modes free and lockstep of a run; modes, responses and branches are \
         computed of equations, which it does not show"
    )]
    OfFmu,
    /// An FMU in real time.
    #[error(
        "structure: `kind` is fmu: an FMU is somebody's program, and nothing bounds the time of its steps: take the mode free or lockstep"
    )]
    FmuInRealTime,
    /// The FMU can't be the structure.
    #[error("{}: {fault}", path.display())]
    Fmu {
        /// The FMU.
        path: PathBuf,
        /// Why.
        fault: Box<ImportError>,
    },
    /// The FMU of a recording, which is data: loading it would run code.
    #[error(
        "the recording was made with the FMU {}, {}: nothing that a recording names is loaded, since an FMU is code that runs \
         with your rights; if you trust it, name its file by --fmu FILE (in Python fmu=FILE), whose SHA-256 is compared",
        path.display(), of_hash(sha256)
    )]
    FmuNotAllowed {
        /// The FMU that the recording names.
        path: PathBuf,
        /// The SHA-256 that it notes, if it does.
        sha256: Option<String>,
    },
    /// Another file than the one that is noted.
    #[error(
        "{}: its SHA-256 is {got}, and structure.sha256 is {expected}: it is another FMU than the one that was meant or recorded", path.display()
    )]
    FmuHash {
        /// The FMU.
        path: PathBuf,
        /// Its hash.
        got: String,
        /// The one that is noted.
        expected: String,
    },
}

/// The SHA-256 of an FMU, for a message.
fn of_hash(sha256: &Option<String>) -> String {
    sha256.as_ref().map_or(String::from("whose SHA-256 it does not state"), |sha256| format!("SHA-256 {sha256}"))
}
