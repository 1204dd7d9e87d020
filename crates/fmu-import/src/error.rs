//! What keeps an FMU from being the structure.

use thiserror::Error;

use resonarm_bench::structure::ForeignFault;

/// Why an FMU can't be the structure under test.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The archive is none.
    #[error("not a ZIP archive, as an FMU is: {reason}")]
    Zip {
        /// What is wrong.
        reason: String,
    },
    /// A name in the archive that would leave its folder.
    #[error("`{name}` in the archive {what}: names must stay within the FMU; nothing of it is unpacked")]
    Name {
        /// The name.
        name: String,
        /// What it does.
        what: &'static str,
    },
    /// The archive is too large when it is unpacked.
    #[error(
        "the archive unpacks to more than {most_mb} MB, at `{name}`: an FMU may have 2000 MB, and no more than 100 MB and 100 times the size of \
         its archive; pack its resources less densely if it really has so many"
    )]
    TooLarge {
        /// The entry.
        name: String,
        /// The limit, MB.
        most_mb: u64,
    },
    /// The archive has more entries than an FMU.
    #[error(
        "the archive has {got} entries: at most {most} are read; put the files of a large folder into one archive among its resources"
    )]
    Entries {
        /// How many it has.
        got: usize,
        /// The limit.
        most: usize,
    },
    /// A file of every FMU is missing.
    #[error("no `{name}` in the archive: it is no FMU")]
    NoFile {
        /// The file.
        name: &'static str,
    },
    /// The folder of an instance can't be written.
    #[error("can't unpack the FMU into a temporary folder: {reason}; TMPDIR names another place for it")]
    Unpack {
        /// Why.
        reason: String,
    },
    /// The description is no XML that is read here.
    #[error("modelDescription.xml: {reason}")]
    Xml {
        /// Why.
        reason: String,
    },
    /// The description lacks something.
    #[error("modelDescription.xml: <{element}> has no {attribute}")]
    Lacks {
        /// The element.
        element: String,
        /// The attribute or element that it lacks.
        attribute: &'static str,
    },
    /// A text in the description that says nothing.
    #[error("modelDescription.xml: {attribute} of `{of}` is `{got}`: it must be {expected}")]
    Attribute {
        /// The element or variable.
        of: String,
        /// The attribute.
        attribute: &'static str,
        /// Its text.
        got: String,
        /// What is valid.
        expected: &'static str,
    },
    /// Another version of FMI.
    #[error("fmiVersion is `{got}`: FMUs of FMI 2.0 and 3.0 are taken")]
    Version {
        /// The version.
        got: String,
    },
    /// Not for co-simulation.
    #[error("the FMU has no co-simulation, only {has}: export it for co-simulation")]
    NoCoSimulation {
        /// What it has.
        has: String,
    },
    /// It needs a tool.
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
        /// The function.
        name: String,
    },
    /// The process in which the FMU is to run can't be started.
    #[error("can't start a process for the FMU: {reason}")]
    Process {
        /// Why.
        reason: String,
    },
    /// The FMU ended its process, or lost its connection, before the simulation began or as it was let go.
    #[error("{during} the FMU, {fault}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Ended {
        /// What was being done.
        during: &'static str,
        /// What it did.
        fault: ForeignFault,
        /// The last message of the FMU.
        log: Option<String>,
    },
    /// A call before the simulation failed.
    #[error("{call} returned {status}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Call {
        /// The function.
        call: String,
        /// What it returned.
        status: &'static str,
        /// The last message of the FMU.
        log: Option<String>,
    },
    /// The outputs at the start can't be read.
    #[error("{reason}{}", log.as_ref().map(|log| format!("; the FMU says: {log}")).unwrap_or_default())]
    Start {
        /// What failed.
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
        /// The name.
        name: String,
        /// The nearest one.
        nearest: Option<String>,
    },
    /// A variable of another causality.
    #[error("structure.{key}: `{name}` is of causality {got}: it must be {expected}")]
    Causality {
        /// The key that names it.
        key: String,
        /// The variable.
        name: String,
        /// Its causality.
        got: String,
        /// What it must be.
        expected: &'static str,
    },
    /// A variable of another type.
    #[error("structure.{key}: `{name}` is of type {got}: {expected} is taken")]
    Type {
        /// The key that names it.
        key: String,
        /// The variable.
        name: String,
        /// Its type.
        got: String,
        /// The type that is.
        expected: &'static str,
    },
    /// An array where a number is needed, or an element that it does not have.
    #[error(
        "structure.{key}: `{name}` is an array of {elements}: name one element, `{name}[1]` to `{name}[{elements}]`"
    )]
    Element {
        /// The key that names it.
        key: String,
        /// The variable.
        name: String,
        /// How many it has.
        elements: usize,
    },
    /// Another number of values than the parameter has.
    #[error("structure.parameters: `{name}` has {expected} numbers, and {got} are given")]
    Length {
        /// The parameter.
        name: String,
        /// Numbers given.
        got: usize,
        /// The number of its elements.
        expected: usize,
    },
    /// A number that is not finite.
    #[error("structure.parameters: `{name}` is {got}: it must be finite")]
    Value {
        /// The parameter.
        name: String,
        /// The value.
        got: f64,
    },
    /// A unit of another quantity.
    #[error("structure.{key}: the unit `{unit}` of `{name}` is {got} in base units: {expected} is needed")]
    Unit {
        /// The key that names it.
        key: String,
        /// The variable.
        name: String,
        /// Its unit.
        unit: String,
        /// Its exponents.
        got: String,
        /// The exponents of the quantity.
        expected: String,
    },
    /// A key that names no degree of freedom.
    #[error(
        "structure.{key}: `{got}` names no degree of freedom: write point and axis, as in \"tip.x\", or joint1, or mode1"
    )]
    Dof {
        /// The section.
        key: &'static str,
        /// The text.
        got: String,
    },
    /// A degree of freedom on which no load acts.
    #[error("structure.inputs: `{got}` is not driven: loads are forces at points and torques at joint1 and joint2")]
    Driven {
        /// The degree of freedom.
        got: String,
    },
    /// Nothing is read or driven where an instrument or the exciter is.
    #[error("rig.{instrument}: nothing of structure.{section} is at `{at}`; there are {known}")]
    Place {
        /// The instrument.
        instrument: &'static str,
        /// The section in which it has to be.
        section: &'static str,
        /// Where it is.
        at: String,
        /// The degrees of freedom that there are.
        known: String,
    },
    /// A variable that is needed is not mapped.
    #[error("structure.outputs.\"{dof}\": `{missing}` is missing: {why}")]
    Missing {
        /// The degree of freedom.
        dof: String,
        /// The key.
        missing: &'static str,
        /// What needs it.
        why: &'static str,
    },
    /// A key that is of the other way to read.
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
        "structure.outputs: {got} {what} with displacement and velocity: a recording has {what} 1 to {most}, without a gap"
    )]
    Coordinates {
        /// What they are.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// The most.
        most: usize,
    },
    /// One of our own FMUs, which has sampled its motion already.
    #[error(
        "structure: `read` is middle, and the FMU, of {tool}, samples its motion itself: take `read = \"end\"`, and the variables `true.…`"
    )]
    SamplesItself {
        /// What wrote it.
        tool: String,
    },
}

impl ImportError {
    /// Whether the system lacks something, such as memory or space for files, and the FMU may be all right.
    pub fn is_of_the_system(&self) -> bool {
        matches!(self, ImportError::Process { .. } | ImportError::Unpack { .. })
    }
}
