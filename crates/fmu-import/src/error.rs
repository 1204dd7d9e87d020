//! The reasons why an FMU can't be the structure under test.

use thiserror::Error;

use resonarm_bench::structure::NothingSensed;

use resonarm_bench::structure::ForeignFault;

/// Why an FMU can't be the structure under test.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The archive is none.
    #[error("not a ZIP archive, as an FMU is: {reason}")]
    Zip {
        /// Error that reading the archive reports.
        reason: String,
    },
    /// A name in the archive that would leave its folder.
    #[error("`{name}` in the archive {what}: names must stay within the FMU; nothing of it is unpacked")]
    Name {
        /// Name of the entry in the archive.
        name: String,
        /// Description of how the name would leave the folder.
        what: &'static str,
    },
    /// The archive is too large when it is unpacked.
    #[error(
        "the archive unpacks to more than {most_mb} MB, at `{name}`: an FMU may have 2000 MB, and no more than 100 MB and 100 times the size of \
         its archive; pack its resources less densely if it really has so many"
    )]
    TooLarge {
        /// Name of the entry at which the limit was exceeded.
        name: String,
        /// Largest unpacked size, MB.
        most_mb: u64,
    },
    /// The archive has more entries than an FMU.
    #[error(
        "the archive has {got} entries: at most {most} are read; put the files of a large folder into one archive among its resources"
    )]
    Entries {
        /// How many it has.
        got: usize,
        /// Largest number of entries that is read.
        most: usize,
    },
    /// A file of every FMU is missing.
    #[error("no `{name}` in the archive: it is no FMU")]
    NoFile {
        /// Name of the missing file.
        name: &'static str,
    },
    /// The folder of an instance can't be written.
    #[error("can't unpack the FMU into a temporary folder: {reason}; TMPDIR names another place for it")]
    Unpack {
        /// Error of the operating system.
        reason: String,
    },
    /// The description can't be read as XML of FMI.
    #[error("modelDescription.xml: {reason}")]
    Xml {
        /// Error of the parser, with its place.
        reason: String,
    },
    /// The description lacks something.
    #[error("modelDescription.xml: <{element}> has no {attribute}")]
    Lacks {
        /// Name of the XML element.
        element: String,
        /// The attribute or element that it lacks.
        attribute: &'static str,
    },
    /// An attribute in the description has an invalid value.
    #[error("modelDescription.xml: {attribute} of `{of}` is `{got}`: it must be {expected}")]
    Attribute {
        /// The element or variable.
        of: String,
        /// Name of the attribute.
        attribute: &'static str,
        /// Text of the attribute.
        got: String,
        /// Description of the valid texts.
        expected: &'static str,
    },
    /// Another version of FMI.
    #[error("fmiVersion is `{got}`: FMUs of FMI 2.0 and 3.0 are taken")]
    Version {
        /// FMI version that the description states.
        got: String,
    },
    /// The FMU does not support co-simulation.
    #[error("the FMU has no co-simulation, only {has}: export it for co-simulation")]
    NoCoSimulation {
        /// Interface types that the FMU has instead.
        has: String,
    },
    /// The FMU can't run without the tool that wrote it.
    #[error("the FMU needs its tool to run (needsExecutionTool): export one that runs alone")]
    NeedsTool,
    /// No library for this machine.
    #[error("no `{expected}` in the FMU: it {}", if has.is_empty() { "has no libraries".to_owned() } else { format!("is for {has}") })]
    Platform {
        /// The library that is needed.
        expected: String,
        /// The platforms that it has.
        has: String,
    },
    /// The library can't be loaded.
    #[error("the library of the FMU can't be loaded: {reason}")]
    Load {
        /// What the loader says.
        reason: String,
    },
    /// The library lacks a function.
    #[error("the library of the FMU has no function `{name}`")]
    Function {
        /// Name of the missing function.
        name: String,
    },
    /// The process in which the FMU is to run can't be started.
    #[error("can't start a process for the FMU: {reason}")]
    Process {
        /// Reason why the process could not be started.
        reason: String,
    },
    /// The FMU ended its process, or lost its connection, before the simulation began or as it was let go.
    #[error("{during} the FMU, {fault}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Ended {
        /// What was being done: `loading` or `unloading`.
        during: &'static str,
        /// How the process or its connection ended.
        fault: ForeignFault,
        /// The last message of the FMU.
        log: Option<String>,
    },
    /// A call before the simulation failed.
    #[error("{call} returned {status}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Call {
        /// Name of the FMI function that failed.
        call: String,
        /// Status that the function returned, in words.
        status: &'static str,
        /// The last message of the FMU.
        log: Option<String>,
    },
    /// The outputs at the start can't be read.
    #[error("{reason}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Start {
        /// Description of what could not be read.
        reason: String,
        /// The last message of the FMU.
        log: Option<String>,
    },
    /// A variable that the FMU does not have.
    #[error(
        "structure.{key}: the FMU has no variable `{name}`{}",
        nearest.as_ref().map(|nearest| format!(", did you mean `{nearest}`?")).unwrap_or_default()
    )]
    Variable {
        /// The key that names it.
        key: String,
        /// Name that is not in the FMU.
        name: String,
        /// Variable with the nearest name, if any is near enough.
        nearest: Option<String>,
    },
    /// A variable of another causality.
    #[error("structure.{key}: `{name}` is of causality {got}: it must be {expected}")]
    Causality {
        /// The key that names it.
        key: String,
        /// Name of the variable.
        name: String,
        /// Causality of the variable in the FMU.
        got: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A variable of another type.
    #[error("structure.{key}: `{name}` is of type {got}: {expected} is taken")]
    Type {
        /// The key that names it.
        key: String,
        /// Name of the variable.
        name: String,
        /// Type of the variable in the FMU.
        got: String,
        /// Type of real numbers in this version of FMI.
        expected: &'static str,
    },
    /// An array where a number is needed, or an element that it does not have.
    #[error(
        "structure.{key}: `{name}` is an array of {elements}: name one element, `{name}[1]` to `{name}[{elements}]`"
    )]
    Element {
        /// The key that names it.
        key: String,
        /// Name of the array variable.
        name: String,
        /// Number of elements of the array.
        elements: usize,
    },
    /// Another number of values than the parameter has.
    #[error("structure.parameters: `{name}` has {expected} numbers, and {got} are given")]
    Length {
        /// Name of the parameter.
        name: String,
        /// Number of values given in the scenario.
        got: usize,
        /// The number of its elements.
        expected: usize,
    },
    /// A number that is not finite.
    #[error("structure.parameters: `{name}` is {got}: it must be finite")]
    Value {
        /// Name of the parameter.
        name: String,
        /// Value given in the scenario.
        got: f64,
    },
    /// A unit of another quantity.
    #[error("structure.{key}: the unit `{unit}` of `{name}` is {got} in base units: {expected} is needed")]
    Unit {
        /// The key that names it.
        key: String,
        /// Name of the variable.
        name: String,
        /// Unit of the variable in the FMU.
        unit: String,
        /// Exponents of the unit in SI base units.
        got: String,
        /// Exponents that the quantity needs.
        expected: String,
    },
    /// A key that names no degree of freedom.
    #[error(
        "structure.{key}: `{got}` names no degree of freedom: write point and axis, as in \"tip.x\", or joint1, or mode1"
    )]
    Dof {
        /// Section of the structure with the key.
        key: &'static str,
        /// Text that names no degree of freedom.
        got: String,
    },
    /// A degree of freedom on which no load acts.
    #[error("structure.inputs: `{got}` can't be driven: loads are forces at points and torques at joint1 to joint8")]
    Driven {
        /// The degree of freedom.
        got: String,
    },
    /// Nothing is read or driven where an instrument or the exciter is.
    #[error("rig.{instrument}: no variable of structure.{section} is at `{at}`; there are {known}")]
    Place {
        /// Name of the instrument in the scenario.
        instrument: &'static str,
        /// The section in which it has to be.
        section: &'static str,
        /// Degree of freedom at which the instrument is.
        at: String,
        /// The degrees of freedom that there are.
        known: String,
    },
    /// A sensor is where nothing is read.
    #[error(transparent)]
    NothingSensed(#[from] NothingSensed),
    /// A variable that is needed is not mapped.
    #[error("structure.outputs.\"{dof}\": `{missing}` is missing: {why}")]
    Missing {
        /// The degree of freedom.
        dof: String,
        /// Key of the missing variable, such as `velocity`.
        missing: &'static str,
        /// Reason why the variable is needed.
        why: &'static str,
    },
    /// A force is mapped although the FMU is read after each step.
    #[error(
        "structure.outputs.\"{dof}\": `force` is of an FMU that samples it itself: leave it out, or take `read = \"end\"`"
    )]
    Force {
        /// The degree of freedom.
        dof: String,
    },
    /// Coordinates of several kinds.
    #[error(
        "structure.outputs: `{one}` and `{other}` are coordinates of different kinds: give displacement and velocity of one kind alone"
    )]
    Kinds {
        /// A degree of freedom.
        one: String,
        /// One of another kind.
        other: String,
    },
    /// More coordinates than a recording holds, or numbers with a gap.
    #[error(
        "structure.outputs: displacement and velocity are given for {got} {what}: a recording has at most {most}, numbered from 1 without a gap"
    )]
    Coordinates {
        /// Kind of the coordinates, in words.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// Largest number that a recording holds.
        most: usize,
    },
    /// One of our own FMUs, which has sampled its motion already.
    #[error(
        "structure: `read` is middle, and the FMU, of {tool}, samples its motion itself: take `read = \"end\"`, and the variables `true.…`"
    )]
    SamplesItself {
        /// Tool that generated the FMU.
        tool: String,
    },
}

impl ImportError {
    /// Whether the system lacks something, such as memory or space for files, and the FMU may be all right.
    pub fn is_of_the_system(&self) -> bool {
        matches!(self, ImportError::Process { .. } | ImportError::Unpack { .. })
    }
}
