//! Robots in the Unified Robot Description Format of ROS (wiki.ros.org/urdf/XML): links, joints, inertias.
//!
//! A file is XML without a schema. The reader uses `link` with its `inertial`, and `joint` with type, parent, child,
//! origin, axis and `mimic`; the rest does not affect the dynamics. A link of mass 0 without moments of inertia is a
//! frame, as one without `inertial` is: exporters write both.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

use super::body::{Frame, Inertial};
use super::error::UrdfError;

/// Axis of a joint that states none, according to the specification.
const DEFAULT_AXIS: [f64; 3] = [1.0, 0.0, 0.0];

/// A joint of a robot: two links, a frame, and an axis.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub name: String,
    /// Type of the joint: `revolute`, `continuous`, `fixed` or another.
    pub kind: String,
    pub parent: String,
    pub child: String,
    /// Frame of the joint relative to the parent link; at angle 0 the child's frame coincides with it.
    pub frame: Frame,
    /// Unit vector of the axis in the joint's frame.
    pub axis: Vector3<f64>,
    /// Whether the file states no `axis`, so that the default x applies.
    pub axis_is_default: bool,
    /// Name of the joint whose angle this one follows.
    pub mimics: Option<String>,
}

/// A robot: a tree of links.
#[derive(Clone, Debug)]
pub(super) struct Robot {
    /// Links by name, with their inertia; a link may have none.
    pub links: BTreeMap<String, Option<Inertial>>,
    /// Joints in the order of the file.
    pub joints: Vec<Joint>,
    /// Index in `joints` of the joint that leads to a link, by the name of the link.
    above: BTreeMap<String, usize>,
}

impl Robot {
    /// Reads a robot from its text.
    pub fn parse(text: &str) -> Result<Robot, UrdfError> {
        let document = Document::parse(text).map_err(|error| match text.contains("<xacro:") {
            // An undeclared prefix makes a xacro file invalid XML. The xacro error says what to do about it.
            true => UrdfError::Xacro { line: error.pos().row, got: String::from("a tag of xacro") },
            false => UrdfError::Xml { reason: error.to_string() },
        })?;
        let root = document.root_element();
        if root.tag_name().name() != "robot" {
            return Err(UrdfError::NotARobot { got: root.tag_name().name().to_owned() });
        }
        if let Some((line, got)) = document.descendants().find_map(|node| xacro(&node)) {
            return Err(UrdfError::Xacro { line, got });
        }
        let mut robot = Robot { links: BTreeMap::new(), joints: Vec::new(), above: BTreeMap::new() };
        let mut names = BTreeSet::new();
        for element in root.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "link" => {
                    let name = attribute(&element, "name")?.to_owned();
                    let inertial = child(&element, "inertial").map(|inertial| body(&inertial, &name)).transpose()?;
                    let inertial =
                        // A mass of 0 with moments of inertia is kept, so that it is reported as the fault that it
                        // is.
                        inertial.filter(|body| body.mass_kg != 0.0 || body.inertia_kg_m2 != Matrix3::zeros());
                    if robot.links.insert(name.clone(), inertial).is_some() {
                        return Err(UrdfError::Twice { what: "link", name });
                    }
                }
                "joint" => {
                    let joint = joint(&element)?;
                    if !names.insert(joint.name.clone()) {
                        return Err(UrdfError::Twice { what: "joint", name: joint.name });
                    }
                    robot.joints.push(joint);
                }
                _ => {}
            }
        }
        robot.connect()?;
        Ok(robot)
    }

    /// Returns the joint that leads to a link, if there is one.
    pub fn above(&self, link: &str) -> Option<&Joint> {
        self.above.get(link).and_then(|&joint| self.joints.get(joint))
    }

    /// Connects joints and links to a tree, and rejects missing links, links with two parents, and closed
    /// loops.
    fn connect(&mut self) -> Result<(), UrdfError> {
        for (number, joint) in self.joints.iter().enumerate() {
            for link in [&joint.parent, &joint.child] {
                if !self.links.contains_key(link) {
                    return Err(UrdfError::NoLink { joint: joint.name.clone(), link: link.clone() });
                }
            }
            if let Some(other) = self.above.insert(joint.child.clone(), number) {
                let joints = [self.joints[other].name.clone(), joint.name.clone()];
                return Err(UrdfError::TwoParents { link: joint.child.clone(), joints });
            }
        }
        // Every walk goes towards the base and marks the links it passes with its own number. It ends at the
        // base, or at a link that an earlier walk has passed. If it meets its own number, the joints form a
        // loop. Each link is so visited only once.
        let mut walk_of: BTreeMap<&str, usize> = BTreeMap::new();
        for (walk, joint) in self.joints.iter().enumerate() {
            let mut at = Some(joint);
            while let Some(joint) = at {
                match walk_of.insert(&joint.child, walk) {
                    Some(other) if other == walk => return Err(UrdfError::Cycle { joint: joint.name.clone() }),
                    Some(_) => break,
                    None => at = self.above(&joint.parent),
                }
            }
        }
        Ok(())
    }
}

fn joint(element: &Node<'_, '_>) -> Result<Joint, UrdfError> {
    let name = attribute(element, "name")?.to_owned();
    let of = |tag: &'static str| {
        let missing = || UrdfError::Missing { element: format!("joint {name}"), what: tag };
        attribute(&child(element, tag).ok_or_else(missing)?, "link").map(str::to_owned)
    };
    let parent = of("parent")?;
    let child_link = of("child")?;
    let stated = child(element, "axis");
    let axis_is_default = stated.is_none_or(|axis| axis.attribute("xyz").is_none());
    let axis = match stated {
        Some(axis) => numbers(&axis, "xyz", DEFAULT_AXIS)?,
        None => DEFAULT_AXIS,
    };
    let axis = Vector3::from(axis);
    // A fixed joint may state the axis 0 0 0, which has no direction.
    let length = axis.norm();
    let axis = if length > 0.0 { axis / length } else { axis };
    let kind = attribute(element, "type")?.to_owned();
    let mimic = child(element, "mimic");
    let mimics = mimic.map(|mimic| attribute(&mimic, "joint").map(str::to_owned)).transpose()?;
    Ok(Joint { kind, parent, child: child_link, frame: origin(element)?, axis, axis_is_default, mimics, name })
}

/// Returns line and text of a xacro tag, or of a xacro expression in an attribute, if the node has one.
fn xacro(node: &Node<'_, '_>) -> Option<(u32, String)> {
    if !node.is_element() {
        return None;
    }
    if node.tag_name().namespace().is_some_and(|namespace| namespace.contains("xacro")) {
        return Some((line(node), format!("<xacro:{}>", node.tag_name().name())));
    }
    let is_expression = |value: &str| value.contains("${") || value.contains("$(");
    // Only the elements that are read are searched: plug-ins of simulators may use dollar signs of their own
    // elsewhere.
    let is_read = matches!(
        node.tag_name().name(),
        "link" | "joint" | "inertial" | "mass" | "inertia" | "origin" | "parent" | "child" | "axis" | "mimic"
    );
    let expression = node.attributes().find(|attribute| is_read && is_expression(attribute.value()))?;
    Some((line(node), format!("{}=\"{}\"", expression.name(), expression.value())))
}

fn body(inertial: &Node<'_, '_>, link: &str) -> Result<Inertial, UrdfError> {
    let missing = |what| UrdfError::Missing { element: format!("the inertial of link {link}"), what };
    let mass_kg = number(&child(inertial, "mass").ok_or_else(|| missing("mass"))?, "value")?;
    let inertia = child(inertial, "inertia").ok_or_else(|| missing("inertia"))?;
    let entry = |name| number(&inertia, name);
    let xx = entry("ixx")?;
    let yy = entry("iyy")?;
    let zz = entry("izz")?;
    let xy = entry("ixy")?;
    let xz = entry("ixz")?;
    let yz = entry("iyz")?;
    let inertia_kg_m2 = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    Ok(Inertial { frame: origin(inertial)?, mass_kg, inertia_kg_m2 })
}

fn origin(element: &Node<'_, '_>) -> Result<Frame, UrdfError> {
    let Some(origin) = child(element, "origin") else { return Ok(Frame::identity()) };
    Ok(Frame::new(numbers(&origin, "xyz", [0.0; 3])?, numbers(&origin, "rpy", [0.0; 3])?))
}

fn child<'a, 'input>(element: &Node<'a, 'input>, tag: &str) -> Option<Node<'a, 'input>> {
    element.children().find(|child| child.is_element() && child.tag_name().name() == tag)
}

fn line(element: &Node<'_, '_>) -> u32 {
    element.document().text_pos_at(element.range().start).row
}

fn attribute<'a>(element: &Node<'a, '_>, name: &'static str) -> Result<&'a str, UrdfError> {
    let missing = || UrdfError::Attribute { line: line(element), element: element.tag_name().name().to_owned(), name };
    element.attribute(name).ok_or_else(missing)
}

fn number(element: &Node<'_, '_>, name: &'static str) -> Result<f64, UrdfError> {
    let text = attribute(element, name)?;
    let not_one = || UrdfError::Number { line: line(element), name, got: text.to_owned(), expected: "a finite number" };
    text.trim().parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(not_one)
}

/// Reads an attribute of three numbers, or returns `without` if it is missing.
fn numbers(element: &Node<'_, '_>, name: &'static str, without: [f64; 3]) -> Result<[f64; 3], UrdfError> {
    let Some(text) = element.attribute(name) else { return Ok(without) };
    let values: Option<Vec<f64>> =
        text.split_whitespace().map(|word| word.parse().ok().filter(|value: &f64| value.is_finite())).collect();
    let not_three =
        || UrdfError::Number { line: line(element), name, got: text.to_owned(), expected: "three finite numbers" };
    values.and_then(|values| <[f64; 3]>::try_from(values).ok()).ok_or_else(not_three)
}
