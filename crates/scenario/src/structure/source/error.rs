//! What is wrong with a file that a structure is made from.

use thiserror::Error;

use resonarm_numeric::number::short;

/// Why a file makes no structure.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureFileError {
    /// Of a robot.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// Of modes.
    #[error(transparent)]
    Uff(#[from] UffError),
    /// Of a matrix.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
}

/// Why a URDF file makes no chain.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// It is no XML.
    #[error("it is no XML: {reason}")]
    Xml {
        /// Why, and where.
        reason: String,
    },
    /// The file is a xacro, from which a URDF is made.
    #[error(
        "line {line}: {got}: the file is xacro, not URDF: expand it first, xacro file.urdf.xacro > file.urdf, and name that file"
    )]
    Xacro {
        /// The line, from 1.
        line: u32,
        /// The tag or attribute.
        got: String,
    },
    /// The XML is of something else.
    #[error("it is no robot: its root is <{got}>, not <robot>")]
    NotARobot {
        /// The root's tag.
        got: String,
    },
    /// An attribute is missing.
    #[error("line {line}: <{element}> lacks `{name}`")]
    Attribute {
        /// The line, from 1.
        line: u32,
        /// The tag.
        element: String,
        /// The attribute.
        name: &'static str,
    },
    /// An attribute is no number.
    #[error("line {line}: `{name}` is {got:?}: it must be {expected}")]
    Number {
        /// The line, from 1.
        line: u32,
        /// The attribute.
        name: &'static str,
        /// Its text.
        got: String,
        /// What would do.
        expected: &'static str,
    },
    /// An element is missing.
    #[error("{element} lacks <{what}>")]
    Missing {
        /// Where it is missing.
        element: String,
        /// The tag.
        what: &'static str,
    },
    /// Two parts have one name.
    #[error("there are two of the {what} `{name}`")]
    Twice {
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A joint of a link that the file does not have.
    #[error("joint `{joint}`: there is no link `{link}`")]
    NoLink {
        /// The joint.
        joint: String,
        /// Name of the link.
        link: String,
    },
    /// A link at the end of two joints.
    #[error("link `{link}` is the child of two joints, `{}` and `{}`: a robot is a tree", joints[0], joints[1])]
    TwoParents {
        /// Name of the link.
        link: String,
        /// The joints.
        joints: [String; 2],
    },
    /// A joint beyond itself.
    #[error("joint `{joint}` is beyond itself: a robot is a tree")]
    Cycle {
        /// The joint.
        joint: String,
    },
    /// A link with moments of inertia, and without a positive mass.
    #[error(
        "link `{link}`: its mass is {} kg: it must be positive, or, with all moments of inertia, 0, as that of a frame", short(.mass_kg)
    )]
    Mass {
        /// Name of the link.
        link: String,
        /// kg.
        mass_kg: f64,
    },
    /// A link with a negative moment of inertia.
    #[error("link `{link}`: its moment of inertia about the joints' axis is {} kg·m²: no body has a negative one", short(.got_kg_m2))]
    Moment {
        /// Name of the link.
        link: String,
        /// About the axis through its centre of mass, kg·m².
        got_kg_m2: f64,
    },
    /// A joint that follows the angle of another.
    #[error(
        "joint `{joint}` mimics `{followed}`, {}",
        if *is_of_chain {
            "so that it turns with that joint and has no spring of its own: the joints of a chain turn freely"
        } else {
            "which is a joint of the chain, and it is not named, so that it would be rigid: remove <mimic> from the file where \
             that will do"
        }
    )]
    Mimic {
        /// The joint.
        joint: String,
        /// The joint that it follows.
        followed: String,
        /// Whether it is named as a joint of the chain.
        is_of_chain: bool,
    },
    /// No joints are named.
    #[error("name the chain's joints, from the base out, in tables [[structure.joints]]: those that turn are {known}")]
    NoJoints {
        /// The joints that turn.
        known: String,
    },
    /// There is no such joint.
    #[error(
        "there is no joint `{got}`{}: those that turn are {known}",
        nearest.as_ref().map(|nearest| format!(", did you mean `{nearest}`?")).unwrap_or_default()
    )]
    NoJoint {
        /// The name.
        got: String,
        /// The nearest name.
        nearest: Option<String>,
        /// The joints that turn.
        known: String,
    },
    /// A joint that does not turn.
    #[error("joint `{joint}` is {kind}: a chain has revolute joints; what is not named is rigid")]
    NotRevolute {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A joint that turns about nothing.
    #[error("joint `{joint}`: its axis is 0 0 0")]
    NoAxis {
        /// The joint.
        joint: String,
    },
    /// A joint that is not beyond the one before.
    #[error(
        "joint `{joint}` is not beyond `{before}`: {}",
        if *reversed { "name the joints from the base out" } else { "a chain has joints of one branch" }
    )]
    NotBeyond {
        /// The joint.
        joint: String,
        /// The one that is named before it.
        before: String,
        /// Whether it is the other way round.
        reversed: bool,
    },
    /// Axes that are not parallel.
    #[error(
        "the axis of joint `{joint}` is {off_deg:.3}° from that of `{first}`: those of a planar chain are parallel{}",
        if *axis_is_default { "; the joint has no <axis>, so that its axis is the default, x" } else { "" }
    )]
    NotParallel {
        /// The joint.
        joint: String,
        /// The first joint.
        first: String,
        /// The angle between them, degrees.
        off_deg: f64,
        /// Whether the file states no axis of the joint.
        axis_is_default: bool,
    },
    /// Gravity across the plane.
    #[error(
        "`gravity_m_s2` acts in the plane of motion: here the axes are {tilt_deg:.3}° from horizontal; leave it out"
    )]
    Gravity {
        /// How far the axes are from horizontal, degrees.
        tilt_deg: f64,
    },
    /// Two joints, or a joint and the tip, at one place.
    #[error(
        "from joint `{joint}` to `{end}` there is no length in the plane of motion: {}",
        if *axis_is_default {
            "the joint has no <axis>, so that it turns about the default, x; state its axis"
        } else {
            "leave one out, or state `tip`"
        }
    )]
    NoLength {
        /// The joint.
        joint: String,
        /// The link that ends it.
        end: String,
        /// Whether the file states no axis of the joint.
        axis_is_default: bool,
    },
    /// Nothing has a mass.
    #[error(
        "nothing beyond joint `{joint}`, up to the next of the chain, has a mass: give link `{link}` an <inertial>"
    )]
    NoInertial {
        /// The joint.
        joint: String,
        /// Its link.
        link: String,
    },
    /// An impossible inertia.
    #[error("the moment of inertia beyond joint `{joint}` comes out as {} kg·m²: it must be positive", short(.got_kg_m2))]
    Inertia {
        /// The joint.
        joint: String,
        /// About the axis through the centre of mass, kg·m².
        got_kg_m2: f64,
    },
    /// The link that ends the chain does not ride on its last joint.
    #[error("structure.tip: link `{got}` does not ride on joint `{joint}`: these do: {known}")]
    Tip {
        /// Name of the link.
        got: String,
        /// The last joint.
        joint: String,
        /// The links that do.
        known: String,
    },
    /// Where the chain ends is not clear.
    #[error("beyond joint `{joint}` there are several ends: say by `tip` which is the chain's: {ends}")]
    Ends {
        /// The last joint.
        joint: String,
        /// The links at the ends.
        ends: String,
    },
}

/// What is doubtful about a URDF file that makes a chain.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfWarning {
    /// Moments of inertia that no body has.
    #[error(
        "link `{link}`: its principal moments of inertia are {}, {} and {} kg·m²: no body has a negative one, or one above the sum of \
         the other two; the chain takes the moment about the joints' axis as it is",
        short(&principal_kg_m2[0]), short(&principal_kg_m2[1]), short(&principal_kg_m2[2])
    )]
    Moments {
        /// Name of the link.
        link: String,
        /// The least first, kg·m².
        principal_kg_m2: [f64; 3],
    },
}

/// Why a file in the Universal File Format gives no modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UffError {
    /// A line is not what its dataset has there.
    #[error("line {line}: {fault}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        fault: UffFault,
    },
    /// The file ends inside a dataset.
    #[error("dataset {dataset}, from line {line}, has no end: a line -1")]
    NoEnd {
        /// Number of the dataset, as the file has it.
        dataset: String,
        /// Its first line, from 1.
        line: usize,
    },
    /// There are no modes.
    #[error("there are no modes: no dataset 55 or 2414 of normal modes; there are {known}")]
    NoModes {
        /// The datasets.
        known: String,
    },
    /// A node that no mode has.
    #[error("structure.nodes: `{name}` is node {node}: no mode has values there; nodes with values are {known}")]
    NoNode {
        /// The point's name.
        name: String,
        /// The node's number.
        node: u32,
        /// The nodes with values.
        known: String,
    },
    /// A stated modal mass that no mode has.
    #[error("structure.modal_mass_kg is {}: it must be a positive number", short(.got))]
    StatedMass {
        /// kg.
        got: f64,
    },
    /// A stated modal mass that no mode needs.
    #[error("structure.modal_mass_kg is of modes whose modal mass the file leaves at 0, and it has none: leave it out")]
    MassIdle,
    /// Two names of one node.
    #[error("structure.nodes: `{}` and `{}` are both node {node}", names[0], names[1])]
    NodeTwice {
        /// The names.
        names: [String; 2],
        /// The node's number.
        node: u32,
    },
}

/// What is wrong with a line of a Universal File.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UffFault {
    /// Text outside a dataset.
    #[error("{got:?} is outside the datasets, which begin and end with a line -1")]
    Outside {
        /// The line.
        got: String,
    },
    /// The type of a dataset is no number.
    #[error("{got:?} is not the number of a dataset")]
    Dataset {
        /// The text.
        got: String,
    },
    /// A binary dataset.
    #[error("dataset {dataset} is binary: export the modes as ASCII")]
    Binary {
        /// Number of the dataset, as the file has it.
        dataset: String,
    },
    /// Too few numbers.
    #[error("{what} needs {expected} numbers here: there are {got}")]
    Short {
        /// The record.
        what: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many there are.
        got: usize,
    },
    /// A number that is none.
    #[error("{what}: {got:?} is not a finite number")]
    Number {
        /// The record.
        what: &'static str,
        /// The text.
        got: String,
    },
    /// Units without a size.
    #[error("the file is in units of which {} make a metre and {} a newton: both must be positive", short(.length), short(.force))]
    Units {
        /// Units of length in a metre.
        length: f64,
        /// Units of force in a newton.
        force: f64,
    },
    /// A complex mode.
    #[error(
        "mode {mode} is complex: turned so that it is as real as it can be, its shape has an imaginary part of {} of the \
         shape; a modal structure has normal modes, with {} at most. Identify normal modes, or write the structure as \
         matrices, with its dampers as elements of kind `linear`", short(&(libm::round(share * 1e4) / 1e4)), short(.most)
    )]
    ComplexShape {
        /// The number of the mode in the file.
        mode: i64,
        /// The imaginary part over the shape.
        share: f64,
        /// The most that a normal mode may have.
        most: f64,
    },
    /// Modal A of another mode.
    #[error(
        "mode {mode}: modal A, over twice its eigenvalue's imaginary part, is a modal mass of {} + {}j: that of a normal \
         mode is positive, with an imaginary part of {} of it at most", short(&got[0]), short(&got[1]), short(.most)
    )]
    ModalA {
        /// The number of the mode in the file.
        mode: i64,
        /// Real and imaginary part of the modal mass, in the units of the file.
        got: [f64; 2],
        /// The most of the imaginary part, over the real one.
        most: f64,
    },
    /// An eigenvalue that is not of a vibration.
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
    /// A dataset of something else.
    #[error(
        "dataset {dataset} of analysis type {got}: modes have 2, normal mode, or 3, complex eigenvalue of first order"
    )]
    Analysis {
        /// Number of the dataset, as the file has it.
        dataset: u32,
        /// The analysis type.
        got: i64,
    },
    /// Not displacements.
    #[error("dataset {dataset} of specific data type {got}: shapes are displacements, 8")]
    Quantity {
        /// Number of the dataset, as the file has it.
        dataset: u32,
        /// The specific data type.
        got: i64,
    },
    /// Values of another kind at the nodes.
    #[error("dataset {dataset} has {got} values at a node: vectors have 3, or 6 with rotations")]
    Values {
        /// Number of the dataset, as the file has it.
        dataset: u32,
        /// How many.
        got: i64,
    },
    /// A modal mass that nothing can be normalised with.
    #[error(
        "mode {mode}: its modal mass is {}: shapes are normalised with it, so it must be positive{}", short(.got),
        if *got == 0.0 { "; state the one of modes that the file leaves at 0 by structure.modal_mass_kg" } else { "" }
    )]
    ModalMass {
        /// The number of the mode in the file.
        mode: i64,
        /// kg.
        got: f64,
    },
    /// Hysteretic damping.
    #[error("mode {mode} has hysteretic damping, {}, and no viscous: state it as viscous damping, half the loss factor", short(.got))]
    Hysteretic {
        /// The number of the mode in the file.
        mode: i64,
        /// The ratio.
        got: f64,
    },
    /// A node stands twice in one dataset.
    #[error("node {node} stands here for the second time")]
    NodeAgain {
        /// The node's number.
        node: u32,
    },
}

/// Why matrices make no modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MatrixError {
    /// It is no file of NumPy.
    #[error("it is no NumPy file: {what}")]
    NotNpy {
        /// What is not as it should be.
        what: &'static str,
    },
    /// It is no matrix of Matrix Market.
    #[error("line {line} is not as Matrix Market has it: {what}")]
    NotMtx {
        /// The line, from 1.
        line: usize,
        /// What is not as it should be.
        what: &'static str,
    },
    /// Too few or too many entries.
    #[error("it has {got} entries: its sizes say {expected}")]
    Entries {
        /// How many, up to the first that is too much.
        got: usize,
        /// How many there must be.
        expected: usize,
    },
    /// Numbers of another type.
    #[error("its numbers are of type {got:?}: save float64, numpy.save(path, matrix.astype(\"<f8\"))")]
    Type {
        /// `descr` of the file.
        got: String,
    },
    /// It is not square.
    #[error("its shape is {got}: it must be square, with 1 to {most} rows")]
    Shape {
        /// The shape.
        got: String,
        /// The most rows.
        most: usize,
    },
    /// Too few or too many bytes.
    #[error("it has {got} bytes of numbers: its shape needs {expected}")]
    Length {
        /// How many.
        got: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A number that is not finite.
    #[error("entry {row}, {column} is {got}: all must be finite")]
    NotFinite {
        /// The row, from 0.
        row: usize,
        /// The column, from 0.
        column: usize,
        /// The number.
        got: f64,
    },
    /// It is not symmetric.
    #[error("it is not symmetric: entry {row}, {column} is {}, and entry {column}, {row} is {}", short(&got[0]), short(&got[1]))]
    NotSymmetric {
        /// The row, from 0.
        row: usize,
        /// The column, from 0.
        column: usize,
        /// Both entries.
        got: [f64; 2],
    },
    /// It is of another size than the mass matrix.
    #[error("it has {got} rows: the mass matrix has {expected}")]
    Size {
        /// How many.
        got: usize,
        /// The rows of the mass matrix.
        expected: usize,
    },
    /// It is not positive definite.
    #[error("it is not positive definite: {fix}")]
    NotPositive {
        /// What that means.
        fix: &'static str,
    },
    /// A degree of freedom without mass that nothing holds.
    #[error(
        "degrees of freedom without mass, from row {row} on, are not held by stiffness: their displacement does not follow from the \
         others'; give them a stiffness, or leave them out"
    )]
    MasslessFree {
        /// The first such row, from 0.
        row: usize,
    },
    /// Damping of a degree of freedom without mass.
    #[error(
        "row {row} has no mass, and its damping moves it against the stiffness: such a degree of freedom can't be condensed; take \
         damping that is Rayleigh's, C = aM + bK, or give it a mass"
    )]
    MasslessDamped {
        /// The row, from 0.
        row: usize,
    },
    /// Damping of a rigid mode.
    #[error(
        "its damping acts on mode {}, which is rigid, at 0 Hz: φᵢᵀCφⱼ with mode {} is {} 1/s, and no damping ratio states that; take it \
         out, as the part aM of Rayleigh's, and state what damps the whole structure as elements of kind linear", modes[0], modes[1], short(.got)
    )]
    RigidDamped {
        /// The modes, from 1; the first is rigid.
        modes: [usize; 2],
        /// φᵢᵀCφⱼ, 1/s.
        got: f64,
    },
    /// The eigenproblem is not solved.
    #[error("its modes can't be computed: the eigenvalues do not converge")]
    NotSolved,
    /// Damping that is not modal.
    #[error(
        "its damping couples modes {} and {}: φᵢᵀCφⱼ is {} of √(φᵢᵀCφᵢ φⱼᵀCφⱼ), and modal damping has at most {}; take \
         damping that is, such as Rayleigh's, C = aM + bK, and state single dampers as elements of kind linear", modes[0], modes[1], short(.coupling), short(.most)
    )]
    Coupled {
        /// The modes, from 1.
        modes: [usize; 2],
        /// The coupling, dimensionless.
        coupling: f64,
        /// The most that does.
        most: f64,
    },
}
