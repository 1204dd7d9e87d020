//! Errors of the files that a structure is made from.

use thiserror::Error;

use resonarm_fmu_import::ImportError;
use resonarm_numeric::number::short;

/// Reason why a file makes no structure.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureFileError {
    /// The URDF file makes no chain.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// The UFF file gives no modes.
    #[error(transparent)]
    Uff(#[from] UffError),
    /// The matrix can't be used.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// The FMU can't be the structure under test.
    #[error(transparent)]
    Fmu(#[from] ImportError),
}

/// Reason why a URDF file makes no chain.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// The file is not XML.
    #[error("the file is not XML: {reason}")]
    Xml {
        /// Message of the XML parser, with the position.
        reason: String,
    },
    /// The file is a xacro, from which a URDF is made.
    #[error(
        "line {line}: {got}: the file is xacro, not URDF: expand it first, xacro file.urdf.xacro > file.urdf, and name that file"
    )]
    Xacro {
        /// The line, from 1.
        line: u32,
        /// Tag or attribute that belongs to xacro.
        got: String,
    },
    /// The XML describes something other than a robot.
    #[error("the file is not a robot: its root is <{got}>, not <robot>")]
    NotARobot {
        /// Tag of the root element.
        got: String,
    },
    /// An element lacks an attribute.
    #[error("line {line}: <{element}> lacks `{name}`")]
    Attribute {
        /// The line, from 1.
        line: u32,
        /// Tag of the element.
        element: String,
        /// Name of the missing attribute.
        name: &'static str,
    },
    /// An attribute is not a number.
    #[error("line {line}: `{name}` is {got:?}: it must be {expected}")]
    Number {
        /// The line, from 1.
        line: u32,
        /// Name of the attribute.
        name: &'static str,
        /// Text of the attribute.
        got: String,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// An element lacks a child element.
    #[error("{element} lacks <{what}>")]
    Missing {
        /// Element that lacks the child, in words.
        element: String,
        /// Tag of the missing child.
        what: &'static str,
    },
    /// Two parts have the same name.
    #[error("there are two of the {what} `{name}`")]
    Twice {
        /// Kind of part, `link` or `joint`.
        what: &'static str,
        /// Name that occurs twice.
        name: String,
    },
    /// A joint names a link that the file does not have.
    #[error("joint `{joint}`: there is no link `{link}`")]
    NoLink {
        /// Name of the joint.
        joint: String,
        /// Name of the link.
        link: String,
    },
    /// A link is the child of two joints.
    #[error("link `{link}` is the child of two joints, `{}` and `{}`: a robot must be a tree", joints[0], joints[1])]
    TwoParents {
        /// Name of the link.
        link: String,
        /// Names of the two joints.
        joints: [String; 2],
    },
    /// The joints form a closed loop.
    #[error("joint `{joint}` is in a closed loop: a robot must be a tree")]
    Cycle {
        /// Name of a joint in the loop.
        joint: String,
    },
    /// A link has moments of inertia but no positive mass.
    #[error(
        "link `{link}`: its mass is {} kg: it must be positive, or 0 together with all moments of inertia, for a frame", short(.mass_kg)
    )]
    Mass {
        /// Name of the link.
        link: String,
        /// Mass as the file states it, kg.
        mass_kg: f64,
    },
    /// A link has a negative moment of inertia about the joints' axis.
    #[error("link `{link}`: its moment of inertia about the joints' axis is {} kg·m²: it must not be negative", short(.got_kg_m2))]
    Moment {
        /// Name of the link.
        link: String,
        /// About the axis through its centre of mass, kg·m².
        got_kg_m2: f64,
    },
    /// A joint of the chain mimics the angle of another, or would have to move with the chain.
    #[error(
        "joint `{joint}` mimics `{followed}`, {}",
        if *is_of_chain {
            "so it turns with that joint and has no spring of its own; the joints of a chain must turn freely"
        } else {
            "which is a joint of the chain, but it is itself not named and would be rigid; remove <mimic> from the file if a rigid \
             joint is acceptable"
        }
    )]
    Mimic {
        /// Name of the joint.
        joint: String,
        /// The joint that it follows.
        followed: String,
        /// Whether it is named as a joint of the chain.
        is_of_chain: bool,
    },
    /// The scenario names no joints.
    #[error("name the chain's joints, from the base out, in tables [[structure.joints]]: those that turn are {known}")]
    NoJoints {
        /// The joints that turn.
        known: String,
    },
    /// The file has no joint of this name.
    #[error(
        "there is no joint `{got}`{}: those that turn are {known}",
        nearest.as_ref().map(|nearest| format!(", did you mean `{nearest}`?")).unwrap_or_default()
    )]
    NoJoint {
        /// Name that the scenario gives.
        got: String,
        /// Existing name closest to it.
        nearest: Option<String>,
        /// The joints that turn.
        known: String,
    },
    /// A named joint does not turn.
    #[error("joint `{joint}` is {kind}: a chain has only revolute joints; joints that are not named are rigid")]
    NotRevolute {
        /// Name of the joint.
        joint: String,
        /// Type of the joint in the file.
        kind: String,
    },
    /// A joint has the axis 0 0 0.
    #[error("joint `{joint}`: its axis is 0 0 0: it must have a direction")]
    NoAxis {
        /// Name of the joint.
        joint: String,
    },
    /// A joint is not further out than the one named before it.
    #[error(
        "joint `{joint}` is not beyond `{before}`: {}",
        if *reversed { "name the joints from the base out" } else { "a chain has joints of one branch" }
    )]
    NotBeyond {
        /// Name of the joint.
        joint: String,
        /// Name of the joint before it in the scenario.
        before: String,
        /// Whether the two joints are named in reverse order.
        reversed: bool,
    },
    /// The axes of two joints are not parallel.
    #[error(
        "the axis of joint `{joint}` is {off_deg:.3}° from that of `{first}`: the axes of a planar chain must be parallel{}",
        if *axis_is_default { "; the joint has no <axis>, so its axis is the default, x" } else { "" }
    )]
    NotParallel {
        /// Name of the joint.
        joint: String,
        /// Name of the first joint of the chain.
        first: String,
        /// The angle between them, degrees.
        off_deg: f64,
        /// Whether the file states no axis of the joint.
        axis_is_default: bool,
    },
    /// Gravity does not act in the plane of motion.
    #[error(
        "`gravity_m_s2` needs horizontal axes, so that it acts in the plane of motion; they are {tilt_deg:.3}° from horizontal: leave it out"
    )]
    Gravity {
        /// Angle of the axes to the horizontal, degrees.
        tilt_deg: f64,
    },
    /// A link of the chain has no length in the plane of motion.
    #[error(
        "from joint `{joint}` to `{end}` there is no length in the plane of motion: {}",
        if *axis_is_default {
            "the joint has no <axis>, so it turns about the default, x; state its axis"
        } else {
            "leave one out, or state `tip`"
        }
    )]
    NoLength {
        /// Name of the joint at the start of the link.
        joint: String,
        /// Name of the URDF link whose frame ends it.
        end: String,
        /// Whether the file states no axis of the joint.
        axis_is_default: bool,
    },
    /// No body of a link of the chain has a mass.
    #[error(
        "no body between joint `{joint}` and the next joint of the chain has a mass: give link `{link}` an <inertial>"
    )]
    NoInertial {
        /// Name of the joint at the start of the link.
        joint: String,
        /// Name of the child link of that joint.
        link: String,
    },
    /// The combined moment of inertia of a link is not positive.
    #[error("the moment of inertia beyond joint `{joint}` is {} kg·m²: it must be positive", short(.got_kg_m2))]
    Inertia {
        /// Name of the joint at the start of the link.
        joint: String,
        /// About the axis through the centre of mass, kg·m².
        got_kg_m2: f64,
    },
    /// The link named as the tip does not move with the last joint.
    #[error("structure.tip: link `{got}` does not move with joint `{joint}`: these links do: {known}")]
    Tip {
        /// Name of the link.
        got: String,
        /// Name of the last joint of the chain.
        joint: String,
        /// Links that move with it, separated by commas.
        known: String,
    },
    /// The chain could end at several links.
    #[error("the chain has several ends beyond joint `{joint}`: name one of them in `tip`: {ends}")]
    Ends {
        /// Name of the last joint of the chain.
        joint: String,
        /// Links at the ends, separated by commas.
        ends: String,
    },
}

/// Doubtful statement of a URDF file that nevertheless makes a chain.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfWarning {
    /// The moments of inertia belong to no physical body.
    #[error(
        "link `{link}`: its principal moments of inertia are {}, {} and {} kg·m², but no body has a negative one, or one above the sum \
         of the other two; the chain uses the moment about the joints' axis unchanged",
        short(&principal_kg_m2[0]), short(&principal_kg_m2[1]), short(&principal_kg_m2[2])
    )]
    Moments {
        /// Name of the link.
        link: String,
        /// Principal moments, ascending, kg·m².
        principal_kg_m2: [f64; 3],
    },
}

/// Reason why a file in the Universal File Format gives no modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UffError {
    /// A line does not follow the layout of its dataset.
    #[error("line {line}: {fault}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// Fault of the line.
        fault: UffFault,
    },
    /// The file ends inside a dataset.
    #[error("dataset {dataset}, which begins in line {line}, lacks its end, a line -1")]
    NoEnd {
        /// Number of the dataset, as the file has it.
        dataset: String,
        /// First line of the dataset, from 1.
        line: usize,
    },
    /// The file has no dataset with modes.
    #[error("the file has no modes: it needs a dataset 55 or 2414 of normal modes, and it has {known}")]
    NoModes {
        /// Numbers of the datasets that it has.
        known: String,
    },
    /// The named node has no values in any mode.
    #[error("structure.nodes: `{name}` is node {node}, where no mode has values; nodes with values are {known}")]
    NoNode {
        /// Name of the point.
        name: String,
        /// Number of the node.
        node: u32,
        /// Numbers of the nodes that have values.
        known: String,
    },
    /// The modal mass that the scenario states is not positive.
    #[error("structure.modal_mass_kg is {}: it must be a positive number", short(.got))]
    StatedMass {
        /// Modal mass that was given, kg.
        got: f64,
    },
    /// A modal mass is stated, but the file states that of every mode.
    #[error(
        "structure.modal_mass_kg applies only to modes whose modal mass is 0 in the file, and there are none: leave it out"
    )]
    MassIdle,
    /// Two points have the same node.
    #[error("structure.nodes: `{}` and `{}` are both node {node}", names[0], names[1])]
    NodeTwice {
        /// Names of the two points.
        names: [String; 2],
        /// Number of the node.
        node: u32,
    },
}

/// Fault of a line of a Universal File.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UffFault {
    /// The line is outside every dataset.
    #[error("{got:?} is outside the datasets, which begin and end with a line -1")]
    Outside {
        /// Text of the line.
        got: String,
    },
    /// The type of a dataset is not a number.
    #[error("{got:?} is not the number of a dataset")]
    Dataset {
        /// Text in the place of the number.
        got: String,
    },
    /// The dataset is binary, and only ASCII is read.
    #[error("dataset {dataset} is binary: export the modes as ASCII")]
    Binary {
        /// Number of the dataset, as the file has it.
        dataset: String,
    },
    /// The line has too few numbers.
    #[error("{what}: expected {expected} numbers, got {got}")]
    Short {
        /// Record that the line belongs to.
        what: &'static str,
        /// Numbers that the record needs.
        expected: usize,
        /// Numbers that the line has.
        got: usize,
    },
    /// A field is not a finite number.
    #[error("{what}: {got:?} is not a finite number")]
    Number {
        /// Record that the line belongs to.
        what: &'static str,
        /// Text of the field.
        got: String,
    },
    /// The units of length or force are not positive.
    #[error("the file is in units of which {} make a metre and {} a newton: both must be positive", short(.length), short(.force))]
    Units {
        /// Units of length in a metre.
        length: f64,
        /// Units of force in a newton.
        force: f64,
    },
    /// The mode is complex: no rotation makes its shape real.
    #[error(
        "mode {mode} is complex: after the best rotation, its shape has an imaginary part of {} of the shape; normal modes may have \
         at most {}. Identify normal modes, or write the structure as matrices, with its dampers as elements of kind `linear`",
         short(&(libm::round(share * 1e4) / 1e4)), short(.most)
    )]
    ComplexShape {
        /// The number of the mode in the file.
        mode: i64,
        /// Norm of the imaginary part over the norm of the shape.
        share: f64,
        /// Largest ratio that counts as a normal mode.
        most: f64,
    },
    /// Modal A does not yield a positive real modal mass.
    #[error(
        "mode {mode}: modal A, over twice its eigenvalue's imaginary part, gives a modal mass of {} + {}j: it must be positive, with \
         an imaginary part of at most {} of it", short(&got[0]), short(&got[1]), short(.most)
    )]
    ModalA {
        /// The number of the mode in the file.
        mode: i64,
        /// Real and imaginary part of the modal mass, in the units of the file.
        got: [f64; 2],
        /// Largest ratio of the imaginary to the real part.
        most: f64,
    },
    /// The eigenvalue does not oscillate, or is the conjugate of the expected one.
    #[error(
        "mode {mode}: its eigenvalue is {} + {}j rad/s: expected the one of its pair with a positive imaginary part",
        short(&got[0]), short(&got[1])
    )]
    Eigenvalue {
        /// The number of the mode in the file.
        mode: i64,
        /// Real and imaginary part, rad/s.
        got: [f64; 2],
    },
    /// The dataset is of another type of analysis, or its values at the nodes are not displacements.
    #[error("dataset {dataset} has {what} {got}: it must be {expected}")]
    Type {
        /// Number of the dataset, as the file has it.
        dataset: u32,
        /// Which of the types of the dataset is meant.
        what: &'static str,
        /// Code of the type in the file.
        got: i64,
        /// Codes that are read, with their meaning.
        expected: &'static str,
    },
    /// The number of values at a node is not that of a vector.
    #[error("dataset {dataset} has {got} values at a node: it must have 3, or 6 with rotations")]
    Values {
        /// Number of the dataset, as the file has it.
        dataset: u32,
        /// Number of values at a node.
        got: i64,
    },
    /// The modal mass is not positive, so that the shape can't be normalised.
    #[error(
        "mode {mode}: its modal mass is {}: shapes are normalised with it, so it must be positive{}", short(.got),
        if *got == 0.0 { "; state it in structure.modal_mass_kg" } else { "" }
    )]
    ModalMass {
        /// The number of the mode in the file.
        mode: i64,
        /// Modal mass as the file states it.
        got: f64,
    },
    /// The mode has hysteretic damping only.
    #[error("mode {mode} has hysteretic damping, {}, but no viscous damping; state it as viscous damping, half the loss factor", short(.got))]
    Hysteretic {
        /// The number of the mode in the file.
        mode: i64,
        /// Hysteretic damping ratio in the file.
        got: f64,
    },
    /// A node occurs twice in one dataset.
    #[error("node {node} occurs for the second time")]
    NodeAgain {
        /// Number of the node.
        node: u32,
    },
}

/// Reason why matrices give no modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MatrixError {
    /// The file is not in NumPy's format.
    #[error("it is not a NumPy file: {what}")]
    NotNpy {
        /// Violated rule of the format.
        what: &'static str,
    },
    /// The file is not in the Matrix Market format.
    #[error("line {line} violates the Matrix Market format: {what}")]
    NotMtx {
        /// The line, from 1.
        line: usize,
        /// Violated rule of the format.
        what: &'static str,
    },
    /// Too few or too many entries.
    #[error("it has {got} entries: its sizes require {expected}")]
    Entries {
        /// Entries in the file, up to the first that is too many.
        got: usize,
        /// Entries that the sizes require.
        expected: usize,
    },
    /// The numbers are of another type than float64.
    #[error("its numbers are of type {got:?}: save float64, numpy.save(path, matrix.astype(\"<f8\"))")]
    Type {
        /// Type as the key `descr` of the file states it.
        got: String,
    },
    /// The matrix is not square, or too large.
    #[error("its shape is {got}: it must be square, with 1 to {most} rows")]
    Shape {
        /// Shape of the matrix, as text.
        got: String,
        /// Largest number of rows.
        most: usize,
    },
    /// The number of bytes does not match the shape.
    #[error("it has {got} bytes of numbers: its shape needs {expected}")]
    Length {
        /// Bytes of numbers in the file.
        got: usize,
        /// Bytes that the shape requires.
        expected: usize,
    },
    /// An entry is infinite or not a number.
    #[error("entry {row}, {column} is {got}: all must be finite")]
    NotFinite {
        /// The row, from 0.
        row: usize,
        /// The column, from 0.
        column: usize,
        /// Value of the entry.
        got: f64,
    },
    /// The matrix is not symmetric.
    #[error("it is not symmetric: entry {row}, {column} is {}, and entry {column}, {row} is {}", short(&got[0]), short(&got[1]))]
    NotSymmetric {
        /// The row, from 0.
        row: usize,
        /// The column, from 0.
        column: usize,
        /// Entry and its mirror image.
        got: [f64; 2],
    },
    /// The matrix has another size than the mass matrix.
    #[error("it has {got} rows: the mass matrix has {expected}")]
    Size {
        /// Number of rows of this matrix.
        got: usize,
        /// Number of rows of the mass matrix.
        expected: usize,
    },
    /// The matrix is not positive definite.
    #[error("it is not positive definite: {fix}")]
    NotPositive {
        /// Consequence or remedy, in words.
        fix: &'static str,
    },
    /// Degrees of freedom without mass are not held by stiffness, so that they can't be condensed.
    #[error(
        "degrees of freedom without mass, from row {row} on, are not held by stiffness, so their displacement does not follow from the \
         others'; give them a stiffness, or leave them out"
    )]
    MasslessFree {
        /// The first such row, from 0.
        row: usize,
    },
    /// Damping acts on a degree of freedom without mass other than by its stiffness.
    #[error(
        "row {row} has no mass, and its damping moves it against the stiffness, so it can't be condensed; use Rayleigh damping, \
         C = aM + bK, or give it a mass"
    )]
    MasslessDamped {
        /// The row, from 0.
        row: usize,
    },
    /// Damping acts on a rigid-body mode.
    #[error(
        "its damping acts on mode {}, which is rigid, at 0 Hz: φᵢᵀCφⱼ with mode {} is {} 1/s, which no damping ratio can state; remove \
         this part, such as aM of Rayleigh damping, and state dampers of the whole structure as elements of kind linear", modes[0], modes[1], short(.got)
    )]
    RigidDamped {
        /// The modes, from 1; the first is rigid.
        modes: [usize; 2],
        /// Generalised damping coefficient φᵢᵀCφⱼ, 1/s.
        got: f64,
    },
    /// The eigenvalue solver did not converge.
    #[error("its modes can't be computed: the eigenvalues do not converge")]
    NotSolved,
    /// The damping matrix couples the modes.
    #[error(
        "its damping couples modes {} and {}: φᵢᵀCφⱼ is {} of √(φᵢᵀCφᵢ φⱼᵀCφⱼ), and modal damping may have at most {}; use \
         modal damping, such as Rayleigh's, C = aM + bK, and state single dampers as elements of kind linear", modes[0], modes[1], short(.coupling), short(.most)
    )]
    Coupled {
        /// The modes, from 1.
        modes: [usize; 2],
        /// Coupling φᵢᵀCφⱼ over √(φᵢᵀCφᵢ φⱼᵀCφⱼ), dimensionless.
        coupling: f64,
        /// Largest coupling that counts as modal damping.
        most: f64,
    },
}
