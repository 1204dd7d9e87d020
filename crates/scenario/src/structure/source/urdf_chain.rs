//! Reduces some joints of a robot to a planar chain.
//!
//! All other joints are rigid at their zero. The links beyond a joint, up to the next joint of the chain, are
//! then one body, which is projected onto the plane normal to the axes. The plane's y axis points up, along z
//! of the robot, where the axes allow it; with vertical axes the plane's x axis is that of the robot.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};

use super::JointSection;
use super::body::{Frame, Inertial, Whole, together};
use super::error::{UrdfError, UrdfWarning};
use super::urdf::{Joint, Robot};
use crate::nearest::nearest;
use resonarm_dynamics::structure::Link;

/// Largest angle between axes that count as parallel, rad, and largest component of a unit vector that counts
/// as 0.
const PARALLEL_LIMIT: f64 = 1e-6;
/// Largest distance of a centre of mass from the line between the joints, relative to the link's length, that
/// counts as rounding.
const ON_LINE: f64 = 1e-9;
/// Relative tolerance of the triangle inequality of principal moments, since files round them.
const TRIANGLE_LIMIT: f64 = 1e-3;
/// Shortest length of a link, m.
const SHORTEST_M: f64 = 1e-6;

/// The chain that a scenario requests of a robot: its joints, its tip, and gravity.
pub(super) struct Wanted<'a> {
    /// Joints of the chain, from the base out.
    pub joints: &'a [JointSection],
    /// Link whose frame ends the chain.
    pub tip: Option<&'a str>,
    /// Whether gravity acts along −y.
    pub has_gravity: bool,
}

/// Plane of motion, normal to the axes.
struct Plane {
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// Axis of the first joint, a unit vector.
    normal: Vector3<f64>,
}

impl Plane {
    /// Builds the plane: y is z of the robot less its component along the axis n; where nothing is left, x is x
    /// of the robot.
    fn new(normal: Vector3<f64>, has_gravity: bool) -> Result<Plane, UrdfError> {
        let up = Vector3::z() - normal * normal.z;
        // With axes that are not horizontal a part of gravity would act along them, and the rest would be less than
        // the scenario states.
        if has_gravity && normal.z.abs() > PARALLEL_LIMIT {
            return Err(UrdfError::Gravity { tilt_deg: libm::asin(normal.z.clamp(-1.0, 1.0)).to_degrees() });
        }
        let y = match up.norm() {
            length if length > PARALLEL_LIMIT => up / length,
            _ => normal.cross(&Vector3::x()).normalize(),
        };
        Ok(Plane { x: y.cross(&normal), y, normal })
    }

    fn check_parallel(&self, joint: &Joint, axis: &Vector3<f64>, first: &Joint) -> Result<(), UrdfError> {
        // The cross product is the sine of the angle, and vanishes for opposite axes, too. Near zero it is exact,
        // where the cosine would have lost the angle to rounding.
        let off = axis.cross(&self.normal).norm();
        if off <= PARALLEL_LIMIT {
            return Ok(());
        }
        let off_deg = libm::asin(off.min(1.0)).to_degrees();
        let axis_is_default = joint.axis_is_default;
        Err(UrdfError::NotParallel { joint: joint.name.clone(), first: first.name.clone(), off_deg, axis_is_default })
    }

    fn project(&self, at: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.x.dot(at), self.y.dot(at))
    }
}

/// Builds the links of the chain, with warnings about the file.
pub(super) fn links(robot: &Robot, wanted: &Wanted<'_>) -> Result<(Vec<Link>, Vec<UrdfWarning>), UrdfError> {
    let joints = named(robot, wanted.joints)?;
    let frames = frames(robot);
    let axis = |joint: &Joint| frames[joint.child.as_str()].turn * joint.axis;
    let Some(first) = joints.first() else { return Err(UrdfError::NoJoints { known: turning(robot) }) };
    let plane = Plane::new(axis(first), wanted.has_gravity)?;
    joints.iter().try_for_each(|joint| plane.check_parallel(joint, &axis(joint), first))?;
    let groups = groups(robot, &joints);
    check_mimics(robot, &joints, &groups)?;
    let mut warnings = Vec::new();
    let last = joints.len() - 1;
    let tip = tip(robot, wanted.tip, joints[last], &groups)?;
    let place = |link: &str| plane.project(&frames[link].at);
    let mut before = Joined { direction_rad: 0.0, turn_rad: 0.0 };
    let mut links = Vec::with_capacity(joints.len());
    for (i, (joint, section)) in joints.iter().zip(wanted.joints).enumerate() {
        let end = if i < last { joints[i + 1].child.as_str() } else { tip };
        let line = place(end) - place(&joint.child);
        if line.norm() < SHORTEST_M {
            let axis_is_default = joint.axis_is_default;
            return Err(UrdfError::NoLength { joint: joint.name.clone(), end: end.to_owned(), axis_is_default });
        }
        let bodies = bodies(robot, &frames, &groups, i);
        for (link, body) in &bodies {
            warnings.extend(check_body(link, body, &plane.normal)?);
        }
        let bodies: Vec<Inertial> = bodies.into_iter().map(|(_, body)| body).collect();
        let no_mass = || UrdfError::NoInertial { joint: joint.name.clone(), link: joint.child.clone() };
        let whole = together(&bodies, &plane.normal).ok_or_else(no_mass)?;
        let [centre_of_mass_m, centre_of_mass_off_m] = centre(line, plane.project(&whole.centre) - place(&joint.child));
        let direction_rad = libm::atan2(line.y, line.x);
        // Parallel axes may point in opposite directions, and then turn in opposite senses.
        let turn_rad = section.angle_deg.to_radians() * axis(joint).dot(&plane.normal).signum();
        let joined = Joined { direction_rad, turn_rad };
        links.push(Link {
            length_m: line.norm(),
            mass_kg: whole.mass_kg,
            centre_of_mass_m,
            centre_of_mass_off_m,
            inertia_kg_m2: inertia(joint, &whole)?,
            angle_deg: joined.against(&before).to_degrees(),
            stiffness_nm_rad: section.stiffness_nm_rad,
            damping_nm_s_rad: section.damping_nm_s_rad,
        });
        before = joined;
    }
    Ok((links, warnings))
}

/// Rejects a body with an impossible mass or moment about the axis n, and warns about impossible principal
/// moments: each is an integral such as Ix = ∫ (y² + z²) dm, so none is negative or exceeds the sum of the
/// others.
fn check_body(link: &str, body: &Inertial, normal: &Vector3<f64>) -> Result<Option<UrdfWarning>, UrdfError> {
    if body.mass_kg <= 0.0 {
        return Err(UrdfError::Mass { link: link.to_owned(), mass_kg: body.mass_kg });
    }
    let got_kg_m2 = body.about(normal);
    if got_kg_m2 < 0.0 {
        return Err(UrdfError::Moment { link: link.to_owned(), got_kg_m2 });
    }
    // Only a warning: the chain turns about a single axis, and the moment about that has been checked.
    let [least, middle, most] = body.principal_kg_m2();
    let is_possible = least >= -TRIANGLE_LIMIT * most && most <= (least + middle) * (1.0 + TRIANGLE_LIMIT);
    Ok((!is_possible).then(|| UrdfWarning::Moments { link: link.to_owned(), principal_kg_m2: [least, middle, most] }))
}

/// Rejects joints that mimic another joint, if they belong to the chain, or move with it and follow one of its
/// joints.
fn check_mimics(robot: &Robot, joints: &[&Joint], groups: &BTreeMap<&str, Option<usize>>) -> Result<(), UrdfError> {
    let is_named = |name: &str| joints.iter().any(|joint| joint.name == name);
    for joint in &robot.joints {
        let Some(followed) = &joint.mimics else { continue };
        let rides = groups.get(joint.child.as_str()).copied().flatten().is_some();
        let is_of_chain = is_named(&joint.name);
        if is_of_chain || (rides && is_named(followed)) {
            return Err(UrdfError::Mimic { joint: joint.name.clone(), followed: followed.clone(), is_of_chain });
        }
    }
    Ok(())
}

/// Direction of a link with all joints at zero, and the turn of its own joint from there.
struct Joined {
    direction_rad: f64,
    turn_rad: f64,
}

impl Joined {
    /// Returns the angle against the link before; before the turn of the joint it lies within (−π, π].
    fn against(&self, before: &Joined) -> f64 {
        // The turn is added after the wrap: a pose of 350° stays 350°, as the scenario states it.
        let angle = libm::remainder(self.direction_rad - before.direction_rad, 2.0 * PI);
        angle + self.turn_rad
    }
}

/// Returns the centre of mass along the line and off it to the left, m.
fn centre(line: Vector2<f64>, centre: Vector2<f64>) -> [f64; 2] {
    // A robot that is straight on paper has its centres of mass off the line by rounding alone, and would get a chain
    // with an offset that nobody meant.
    let along = line.normalize();
    let off_m = along.perp(&centre);
    [along.dot(&centre), if off_m.abs() > ON_LINE * line.norm() { off_m } else { 0.0 }]
}

fn inertia(joint: &Joint, whole: &Whole) -> Result<f64, UrdfError> {
    let got_kg_m2 = whole.inertia_kg_m2;
    let is_one = got_kg_m2.is_finite() && got_kg_m2 > 0.0;
    if is_one { Ok(got_kg_m2) } else { Err(UrdfError::Inertia { joint: joint.name.clone(), got_kg_m2 }) }
}

/// Looks up the named joints, each of which must turn and be further out than the one before.
fn named<'a>(robot: &'a Robot, sections: &[JointSection]) -> Result<Vec<&'a Joint>, UrdfError> {
    let mut joints: Vec<&Joint> = Vec::with_capacity(sections.len());
    for JointSection { name, .. } in sections {
        let Some(joint) = robot.joints.iter().find(|joint| joint.name == *name) else {
            let nearest = nearest(name, robot.joints.iter().map(|joint| joint.name.as_str()));
            return Err(UrdfError::NoJoint { got: name.clone(), nearest, known: turning(robot) });
        };
        if !turns(joint) {
            return Err(UrdfError::NotRevolute { joint: name.clone(), kind: joint.kind.clone() });
        }
        if joint.axis.norm() == 0.0 {
            return Err(UrdfError::NoAxis { joint: name.clone() });
        }
        if let Some(before) = joints.last()
            && !is_beyond(robot, joint, before)
        {
            // Naming the joints from the tip in is the usual mistake, and has its own remedy in the message.
            let reversed = is_beyond(robot, before, joint);
            return Err(UrdfError::NotBeyond { joint: name.clone(), before: before.name.clone(), reversed });
        }
        joints.push(joint);
    }
    Ok(joints)
}

fn turns(joint: &Joint) -> bool {
    matches!(joint.kind.as_str(), "revolute" | "continuous")
}

/// Returns the names of the joints that turn, for messages.
fn turning(robot: &Robot) -> String {
    let names: Vec<&str> = robot.joints.iter().filter(|joint| turns(joint)).map(|joint| joint.name.as_str()).collect();
    if names.is_empty() { String::from("none") } else { names.join(", ") }
}

fn is_beyond(robot: &Robot, joint: &Joint, before: &Joint) -> bool {
    let mut at = robot.above(&joint.parent);
    while let Some(joint) = at {
        if joint.name == before.name {
            return true;
        }
        at = robot.above(&joint.parent);
    }
    false
}

/// Returns the frames of all links with all joints at zero, relative to the link at the base of their tree.
fn frames(robot: &Robot) -> BTreeMap<&str, Frame> {
    let mut frames: BTreeMap<&str, Frame> = BTreeMap::new();
    for link in robot.links.keys() {
        // Iterative and memoised: a recursion over a file's links would be as deep as the file likes.
        let mut way = vec![];
        let mut at = link.as_str();
        while let (false, Some(joint)) = (frames.contains_key(at), robot.above(at)) {
            way.push(joint);
            at = &joint.parent;
        }
        let mut frame = *frames.entry(at).or_insert_with(Frame::identity);
        for joint in way.into_iter().rev() {
            frame = frame.then(&joint.frame);
            frames.insert(&joint.child, frame);
        }
    }
    frames
}

/// Returns the index of the last chain joint on the way to each link; `None` for links before the first.
fn groups<'a>(robot: &'a Robot, joints: &[&Joint]) -> BTreeMap<&'a str, Option<usize>> {
    let mut groups: BTreeMap<&str, Option<usize>> = BTreeMap::new();
    let own = |link: &str| joints.iter().position(|joint| joint.child == link);
    for link in robot.links.keys() {
        let mut way = vec![link.as_str()];
        let mut at = link.as_str();
        let group = loop {
            match (groups.get(at), own(at), robot.above(at)) {
                (Some(group), _, _) => break *group,
                (None, Some(joint), _) => break Some(joint),
                (None, None, None) => break None,
                (None, None, Some(joint)) => {
                    at = &joint.parent;
                    way.push(at);
                }
            }
        };
        groups.extend(way.into_iter().map(|link| (link, group)));
    }
    groups
}

/// Returns the bodies of a group in the frame of the base, with the names of their links.
fn bodies<'a>(
    robot: &'a Robot,
    frames: &BTreeMap<&str, Frame>,
    groups: &BTreeMap<&str, Option<usize>>,
    group: usize,
) -> Vec<(&'a str, Inertial)> {
    let of_group = robot.links.iter().filter(|(link, _)| groups.get(link.as_str()) == Some(&Some(group)));
    let placed = of_group.filter_map(|(link, inertial)| {
        let inertial = (*inertial)?;
        Some((link.as_str(), Inertial { frame: frames.get(link.as_str())?.then(&inertial.frame), ..inertial }))
    });
    placed.collect()
}

/// Returns the link that ends the chain: the named one, or the only one at the end.
fn tip<'a>(
    robot: &'a Robot,
    wanted: Option<&'a str>,
    last: &Joint,
    groups: &BTreeMap<&'a str, Option<usize>>,
) -> Result<&'a str, UrdfError> {
    let group = groups.get(last.child.as_str()).copied().flatten();
    let rides = |link: &str| group.is_some() && groups.get(link).copied().flatten() == group;
    if let Some(tip) = wanted {
        let known = || robot.links.keys().filter(|link| rides(link)).cloned().collect::<Vec<_>>();
        return match rides(tip) {
            true => Ok(tip),
            false => Err(UrdfError::Tip { got: tip.to_owned(), joint: last.name.clone(), known: known().join(", ") }),
        };
    }
    // A link that carries another one, even by a rigid joint, is not where the chain ends.
    let is_parent = |link: &str| robot.joints.iter().any(|joint| joint.parent == link);
    let ends: Vec<&str> =
        robot.links.keys().map(String::as_str).filter(|link| rides(link) && !is_parent(link)).collect();
    match ends[..] {
        [one] => Ok(one),
        _ => Err(UrdfError::Ends { joint: last.name.clone(), ends: ends.join(", ") }),
    }
}
