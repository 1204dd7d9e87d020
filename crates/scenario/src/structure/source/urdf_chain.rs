//! The planar chain of some joints of a robot.
//!
//! All other joints are rigid at their zero. Then the links beyond a joint, up to the next of the chain, are one body,
//! which is projected onto the plane normal to the axes. y of that plane is up, z of the robot, where the axes let it
//! be; with vertical axes its x is that of the robot.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};

use super::JointSection;
use super::body::{Frame, Inertial, Whole, together};
use super::error::{UrdfError, UrdfWarning};
use super::urdf::{Joint, Robot};
use crate::nearest::nearest;
use resonarm_dynamics::structure::Link;

/// How far axes may be from parallel, rad, and components of unit vectors from 0.
const PARALLEL_LIMIT: f64 = 1e-6;
/// How far a centre of mass is off the line between the joints, over the length of the link, to be on it but for rounding.
const ON_LINE: f64 = 1e-9;
/// How far principal moments may be from the triangle's rule, over themselves: files round them.
const TRIANGLE_LIMIT: f64 = 1e-3;
/// The least length of a link, m.
const SHORTEST_M: f64 = 1e-6;

/// What a scenario wants of a robot.
pub(super) struct Wanted<'a> {
    /// The joints, from the base out.
    pub joints: &'a [JointSection],
    /// The link whose frame ends the chain.
    pub tip: Option<&'a str>,
    /// Whether there is gravity along −y.
    pub has_gravity: bool,
}

/// The plane normal to the axes.
struct Plane {
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// The axis of the first joint.
    normal: Vector3<f64>,
}

impl Plane {
    /// y is z of the robot less its part along the axis n; where that is nothing, x is x of the robot.
    fn new(normal: Vector3<f64>, has_gravity: bool) -> Result<Plane, UrdfError> {
        let up = Vector3::z() - normal * normal.z;
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

/// The links of the chain, and what is doubtful about the file.
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
        // An axis the other way round turns the other way.
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

/// Refuses a body whose mass, or whose moment about the axis n, no body has; and warns of principal moments that none
/// has: since each is an integral such as Ix = ∫ (y² + z²) dm, none is negative or more than the others together.
fn check_body(link: &str, body: &Inertial, normal: &Vector3<f64>) -> Result<Option<UrdfWarning>, UrdfError> {
    if body.mass_kg <= 0.0 {
        return Err(UrdfError::Mass { link: link.to_owned(), mass_kg: body.mass_kg });
    }
    let got_kg_m2 = body.about(normal);
    if got_kg_m2 < 0.0 {
        return Err(UrdfError::Moment { link: link.to_owned(), got_kg_m2 });
    }
    let [least, middle, most] = body.principal_kg_m2();
    let is_possible = least >= -TRIANGLE_LIMIT * most && most <= (least + middle) * (1.0 + TRIANGLE_LIMIT);
    Ok((!is_possible).then(|| UrdfWarning::Moments { link: link.to_owned(), principal_kg_m2: [least, middle, most] }))
}

/// Refuses joints that follow the angle of another, if they are of the chain, or ride on it and follow one of it.
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

/// Where a link points with all joints at zero, and how far its own joint is turned from there.
struct Joined {
    direction_rad: f64,
    turn_rad: f64,
}

impl Joined {
    /// The angle against the link before, within (−π, π] but for the turn of the joint.
    fn against(&self, before: &Joined) -> f64 {
        let angle = libm::remainder(self.direction_rad - before.direction_rad, 2.0 * PI);
        angle + self.turn_rad
    }
}

/// Where the centre of mass is: along the line, and off it to the left, m.
fn centre(line: Vector2<f64>, centre: Vector2<f64>) -> [f64; 2] {
    let along = line.normalize();
    let off_m = along.perp(&centre);
    [along.dot(&centre), if off_m.abs() > ON_LINE * line.norm() { off_m } else { 0.0 }]
}

fn inertia(joint: &Joint, whole: &Whole) -> Result<f64, UrdfError> {
    let got_kg_m2 = whole.inertia_kg_m2;
    let is_one = got_kg_m2.is_finite() && got_kg_m2 > 0.0;
    if is_one { Ok(got_kg_m2) } else { Err(UrdfError::Inertia { joint: joint.name.clone(), got_kg_m2 }) }
}

/// The joints of these names: they turn, and each is beyond the one before.
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

/// The names of the joints that turn.
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

/// The frames of all links with all joints at zero, in that of the link at the base of their tree.
fn frames(robot: &Robot) -> BTreeMap<&str, Frame> {
    let mut frames: BTreeMap<&str, Frame> = BTreeMap::new();
    for link in robot.links.keys() {
        let (mut way, mut at) = (vec![], link.as_str());
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

/// The number of the last joint of the chain on the way to each link; none of those before the first.
fn groups<'a>(robot: &'a Robot, joints: &[&Joint]) -> BTreeMap<&'a str, Option<usize>> {
    let mut groups: BTreeMap<&str, Option<usize>> = BTreeMap::new();
    let own = |link: &str| joints.iter().position(|joint| joint.child == link);
    for link in robot.links.keys() {
        let (mut way, mut at) = (vec![link.as_str()], link.as_str());
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

/// The masses of a group, in the frame of the base, with the names of the links.
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

/// The link that ends the chain: the one that is named, or the only one at the end.
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
    let is_parent = |link: &str| robot.joints.iter().any(|joint| joint.parent == link);
    let ends: Vec<&str> =
        robot.links.keys().map(String::as_str).filter(|link| rides(link) && !is_parent(link)).collect();
    match ends[..] {
        [one] => Ok(one),
        _ => Err(UrdfError::Ends { joint: last.name.clone(), ends: ends.join(", ") }),
    }
}
