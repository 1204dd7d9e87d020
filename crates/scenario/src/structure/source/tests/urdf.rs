//! Tests of chains that are read from URDF.

use super::super::urdf::Robot;
use super::super::urdf_chain::{Wanted, links};
use super::super::{JointSection, UrdfError, UrdfWarning};
use super::{close, examples, says};
use crate::Scenario;
use resonarm_dynamics::structure::Link;

/// Two links in the plane of x and y; the second bent by 90°, with a payload on it.
const ROBOT: &str = r#"<robot name="two">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0 0.3"/><mass value="10"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="0.3"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.1 0 0"/><mass value="6"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="0.1"/></inertial></link>
<link name="payload"><inertial><origin rpy="1.5707963267948966 0 0"/><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="1"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 2"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
<origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 -1"/></joint>
<joint name="grip" type="prismatic"><parent link="lower"/><child link="payload"/><origin xyz="0.4 0 0"/></joint>
</robot>"#;

fn joint(name: &str, angle_deg: f64) -> JointSection {
    JointSection { name: name.to_owned(), stiffness_nm_rad: 2e5, damping_nm_s_rad: 5.0, angle_deg }
}

fn chain(text: &str, joints: &[JointSection], tip: Option<&str>) -> Result<Vec<Link>, UrdfError> {
    links(&Robot::parse(text)?, &Wanted { joints, tip, has_gravity: false }).map(|(links, _)| links)
}

/// Frames of mass 0, as descriptions of UR and Panda have them, are as links without an inertial: at the base, where the
/// mass says nothing, in the chain, and at its end.
#[test]
fn links_of_mass_0_are_frames() {
    let zero = "<inertial><mass value=\"0\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0.0\"/></inertial>";
    let frames = |inertial: &str| {
        let frame = format!(
            "<link name=\"flange\">{inertial}</link><joint name=\"at\" type=\"fixed\"><parent link=\"payload\"/>\
             <child link=\"flange\"/><origin xyz=\"0.1 0 0\"/></joint></robot>"
        );
        let text = ROBOT.replace("</robot>", &frame);
        text.replace("<link name=\"base\"/>", &format!("<link name=\"base\">{inertial}</link>"))
    };
    let both = [joint("shoulder", 0.0), joint("elbow", 0.0)];
    let expected = chain(&frames(""), &both, None).unwrap();
    close(expected[1].length_m, 0.5, 1e-12);
    assert_eq!(chain(&frames(zero), &both, None).unwrap(), expected);
    // What is before the first joint is fixed, whatever its inertia.
    let base = frames(zero).replacen("<mass value=\"0\"/>", "<mass value=\"-1\"/>", 1);
    assert_eq!(chain(&base, &both, None).unwrap(), expected);
}

/// A moment above the sum of the others, as no body has it, is said with link and numbers; a rod and a rounded plate
/// aren't.
#[test]
fn an_impossible_inertia_is_a_warning() {
    let warnings = |moments: [f64; 3]| -> Vec<UrdfWarning> {
        let [x, y, z] = moments;
        let inertia = format!("ixx=\"{x}\" ixy=\"0\" ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"");
        let text = ROBOT.replace("ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"0.3\"", &inertia);
        assert_ne!(text.contains(&inertia), ROBOT.contains(&inertia));
        let joints = [joint("shoulder", 0.0), joint("elbow", 0.0)];
        let wanted = Wanted { joints: &joints, tip: None, has_gravity: false };
        let warnings = links(&Robot::parse(&text).unwrap(), &wanted).unwrap().1;
        warnings.into_iter().filter(|UrdfWarning::Moments { link, .. }| link == "upper").collect()
    };
    let triangle = warnings([0.001, 0.001, 0.5]);
    insta::assert_snapshot!(triangle[0], @"link `upper`: its principal moments of inertia are 0.001, 0.001 and 0.5 kg·m², but no body has a negative one, or one above the sum of the other two; the chain uses the moment about the joints' axis unchanged");
    assert_eq!(warnings([-0.1, 0.3, 0.3]).len(), 1);
    assert_eq!(warnings([0.0, 0.2, 0.2]), []);
    assert_eq!(warnings([0.1, 0.2, 0.3001]), []);
}

#[test]
fn bodies_that_are_rigid_are_one() {
    let links = chain(ROBOT, &[joint("shoulder", 30.0), joint("elbow", 20.0)], None).unwrap();
    let [first, second] = links[..] else { panic!("{links:?}") };
    // The height of the first centre of mass, along the axis, says nothing.
    let expected = [0.5, 10.0, 0.2, 0.3, 30.0];
    let numbers =
        |link: &Link| [link.length_m, link.mass_kg, link.centre_of_mass_m, link.inertia_kg_m2, link.angle_deg];
    numbers(&first).into_iter().zip(expected).for_each(|(got, expected)| close(got, expected, 1e-12));
    // m = 6 + 2, lc = (6 · 0.1 + 2 · 0.4)/8, I = 0.1 + 0.05 + 6 (0.1 − lc)² + 2 (0.4 − lc)², and the joint turns back.
    let expected = [0.4, 8.0, 0.175, 0.15 + 6.0 * 0.075 * 0.075 + 2.0 * 0.225 * 0.225, 90.0 - 20.0];
    numbers(&second).into_iter().zip(expected).for_each(|(got, expected)| close(got, expected, 1e-12));
    assert_eq!((second.stiffness_nm_rad, second.damping_nm_s_rad), (2e5, 5.0));
}

/// The robot has the modes of a chain with its numbers, in its pose.
#[test]
fn a_robot_in_a_pose_is_the_chain_of_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.urdf"), ROBOT).unwrap();
    let joints = "joints = [{ name = 'shoulder', stiffness_nm_rad = 2e5, damping_nm_s_rad = 5.0 },\n\
                  { name = 'elbow', stiffness_nm_rad = 1e5, damping_nm_s_rad = 3.0, angle_deg = 30.0 }]\n";
    let text = format!("[structure]\nkind = 'chain'\nfile = 'two.urdf'\n{joints}");
    let of_robot = super::read_in(folder.path(), &text).unwrap().under_test().unwrap();
    let own = "[structure]\nkind = 'chain'\nlinks = [\n\
        { length_m = 0.5, mass_kg = 10.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.3, angle_deg = 0.0, \
        stiffness_nm_rad = 2e5, damping_nm_s_rad = 5.0 },\n\
        { length_m = 0.4, mass_kg = 8.0, centre_of_mass_m = 0.175, inertia_kg_m2 = 0.285, angle_deg = 60.0, \
        stiffness_nm_rad = 1e5, damping_nm_s_rad = 3.0 },\n]\n";
    let own = Scenario::parse(own, "own.toml").unwrap().under_test().unwrap();
    for (got, expected) in of_robot.assembly.modes().iter().zip(own.assembly.modes()) {
        close(got.frequency_hz, expected.frequency_hz, 1e-12);
        close(got.damping_ratio, expected.damping_ratio, 1e-12);
    }
}

/// Numbers of `arm6.urdf` by other code, in NumPy: length, mass, centre of mass, inertia, angle at zero.
#[test]
fn six_joints_are_projected_onto_their_plane() {
    let scenario = Scenario::read(&examples().join("chain.toml")).unwrap();
    let links = scenario.structure.links;
    let expected = [
        [0.6, 34.0, 0.25, 1.1, 90.0 - 20.0],
        [0.5, 27.0, 0.144_444_444_444_444_4, 0.926_666_666_666_666_5, 35.0],
        [0.4, 12.0, 0.15, 0.16, 90.0],
        [0.3, 7.0, 0.12, 0.06, -10.0],
        [0.2, 4.0, 0.06, 0.02, 0.0],
        [0.2, 4.5, 0.096_666_666_666_666_68, 0.023, 0.0],
    ];
    assert_eq!(links.len(), expected.len());
    for (link, expected) in links.iter().zip(expected) {
        let got = [link.length_m, link.mass_kg, link.centre_of_mass_m, link.inertia_kg_m2, link.angle_deg];
        for (got, expected) in got.into_iter().zip(expected) {
            assert!((got - expected).abs() < 1e-12 * expected.abs().max(1.0), "{link:?}");
        }
    }
}

/// Left of the line is positive, whichever way the axis points; what is along the axis says nothing.
#[test]
fn a_centre_of_mass_off_the_line_is_an_offset() {
    let both = [joint("shoulder", 0.0), joint("elbow", 0.0)];
    let links = chain(&ROBOT.replace("0.2 0 0.3", "0.2 0.03 0.3"), &both, None).unwrap();
    close(links[0].centre_of_mass_m, 0.2, 1e-14);
    close(links[0].centre_of_mass_off_m, 0.03, 1e-14);
    close(links[0].inertia_kg_m2, 0.3, 1e-14);
    // In the frame of the elbow, which is turned by 90° about z, left of the lower link is its y.
    let links = chain(&ROBOT.replace("xyz=\"0.1 0 0\"", "xyz=\"0.1 -0.04 0\""), &both, None).unwrap();
    close(links[1].centre_of_mass_off_m, -0.04 * 6.0 / 8.0, 1e-12);
    // Rounding is no offset.
    let links = chain(&ROBOT.replace("0.2 0 0.3", "0.2 1e-12 0.3"), &both, None).unwrap();
    assert_eq!(links[0].centre_of_mass_off_m, 0.0);
}

/// The message about a robot with a change.
fn of(from: &str, to: &str, joints: &[&str]) -> String {
    let text = ROBOT.replacen(from, to, 1);
    assert!(from.is_empty() || text != ROBOT, "{from}");
    let joints: Vec<JointSection> = joints.iter().map(|name| joint(name, 0.0)).collect();
    chain(&text, &joints, None).unwrap_err().to_string()
}

#[test]
fn what_is_no_robot_is_said() {
    let both = ["shoulder", "elbow"];
    insta::assert_snapshot!(of("<link name=\"base\"/>", "<link name=\"base\">", &both), @"the file is not XML: expected 'link' tag, not 'robot' at 13:1");
    insta::assert_snapshot!(of("<robot name=\"two\">", "<robot name=\"two\" xmlns=\"\">&payload;", &both), @"the file is not XML: unknown entity reference 'payload' at 1:28");
    insta::assert_snapshot!(chain("<sdf/>", &[], None).unwrap_err(), @"the file is not a robot: its root is <sdf>, not <robot>");
    insta::assert_snapshot!(of("<link name=\"base\"/>", "<link/>", &both), @"line 2: <link> lacks `name`");
    insta::assert_snapshot!(of("<mass value=\"10\"/>", "<mass value=\"ten\"/>", &both), @r#"line 3: `value` is "ten": it must be a finite number"#);
    insta::assert_snapshot!(of("0.5 0 0", "0.5 0", &both), @r#"line 11: `xyz` is "0.5 0": it must be three finite numbers"#);
    insta::assert_snapshot!(of("<mass value=\"10\"/>", "", &both), @"the inertial of link upper lacks <mass>");
    insta::assert_snapshot!(of("<mass value=\"10\"/>", "<mass value=\"0\"/>", &both), @"link `upper`: its mass is 0 kg: it must be positive, or 0 together with all moments of inertia, for a frame");
    insta::assert_snapshot!(of("<mass value=\"10\"/>", "<mass value=\"nan\"/>", &both), @r#"line 3: `value` is "nan": it must be a finite number"#);
    let declared = "<robot name=\"two\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">";
    insta::assert_snapshot!(of("<robot name=\"two\">", &format!("{declared}<xacro:property name=\"a\" value=\"1\"/>"), &both), @"line 1: <xacro:property>: the file is xacro, not URDF: expand it first, xacro file.urdf.xacro > file.urdf, and name that file");
    insta::assert_snapshot!(of("<link name=\"base\"/>", "<xacro:base name=\"base\"/>", &both), @"line 2: a tag of xacro: the file is xacro, not URDF: expand it first, xacro file.urdf.xacro > file.urdf, and name that file");
    insta::assert_snapshot!(of("0.5 0 0", "${len} 0 0", &both), @r#"line 11: xyz="${len} 0 0": the file is xacro, not URDF: expand it first, xacro file.urdf.xacro > file.urdf, and name that file"#);
    insta::assert_snapshot!(of("<child link=\"upper\"/>", "", &both), @"joint shoulder lacks <child>");
    insta::assert_snapshot!(of("<link name=\"base\"/>", "<link name=\"upper\"/>", &both), @"there are two of the link `upper`");
    insta::assert_snapshot!(of("joint name=\"grip\"", "joint name=\"elbow\"", &both), @"there are two of the joint `elbow`");
    insta::assert_snapshot!(of("<parent link=\"upper\"/>", "<parent link=\"uper\"/>", &both), @"joint `elbow`: there is no link `uper`");
    insta::assert_snapshot!(of("<child link=\"payload\"/>", "<child link=\"lower\"/>", &both), @"link `lower` is the child of two joints, `elbow` and `grip`: a robot must be a tree");
    insta::assert_snapshot!(of("<parent link=\"base\"/>", "<parent link=\"payload\"/>", &both), @"joint `shoulder` is in a closed loop: a robot must be a tree");
}

#[test]
fn what_is_no_chain_is_said() {
    let both = ["shoulder", "elbow"];
    insta::assert_snapshot!(of("", "", &[]), @"name the chain's joints, from the base out, in tables [[structure.joints]]: those that turn are shoulder, elbow");
    insta::assert_snapshot!(of("", "", &["shoulder", "elbo"]), @"there is no joint `elbo`, did you mean `elbow`?: those that turn are shoulder, elbow");
    insta::assert_snapshot!(of("", "", &["shoulder", "grip"]), @"joint `grip` is prismatic: a chain has only revolute joints; joints that are not named are rigid");
    insta::assert_snapshot!(of("0 0 2", "0 0 0", &both), @"joint `shoulder`: its axis is 0 0 0: it must have a direction");
    insta::assert_snapshot!(of("", "", &["elbow", "shoulder"]), @"joint `shoulder` is not beyond `elbow`: name the joints from the base out");
    insta::assert_snapshot!(of("<parent link=\"upper\"/>", "<parent link=\"base\"/>", &both), @"joint `elbow` is not beyond `shoulder`: a chain has joints of one branch");
    insta::assert_snapshot!(of("0 0 -1", "1 0 -1", &both), @"the axis of joint `elbow` is 45.000° from that of `shoulder`: the axes of a planar chain must be parallel");
    insta::assert_snapshot!(of("0.5 0 0", "0 0 0.5", &both), @"from joint `shoulder` to `lower` there is no length in the plane of motion: leave one out, or state `tip`");
    insta::assert_snapshot!(of("izz=\"0.3\"", "izz=\"-0.3\"", &both), @"link `upper`: its moment of inertia about the joints' axis is -0.3 kg·m²: it must not be negative");
    let bare = "<link name=\"upper\"/><joint name=\"other\" type=\"fixed\"><parent link=\"lower\"/><child link=\"base2\"/></joint>\
        <link name=\"base2\"/><link name=\"unused\">";
    insta::assert_snapshot!(of("<link name=\"upper\">", bare, &both), @"the chain has several ends beyond joint `elbow`: name one of them in `tip`: base2, payload");
    insta::assert_snapshot!(of("<link name=\"upper\">", "<link name=\"upper\"/><link name=\"unused\">", &both), @"no body between joint `shoulder` and the next joint of the chain has a mass: give link `upper` an <inertial>");
    insta::assert_snapshot!(of("<axis xyz=\"0 0 -1\"/>", "", &both), @"the axis of joint `elbow` is 90.000° from that of `shoulder`: the axes of a planar chain must be parallel; the joint has no <axis>, so its axis is the default, x");
    let no_axis = ROBOT
        .replace("<axis xyz=\"0 0 -1\"/>", "")
        .replace("<axis xyz=\"0 0 2\"/>", "")
        .replace(" rpy=\"0 0 1.5707963267948966\"", "");
    insta::assert_snapshot!(chain(&no_axis, &both.map(|name| joint(name, 0.0)), None).unwrap_err(), @"from joint `shoulder` to `lower` there is no length in the plane of motion: the joint has no <axis>, so it turns about the default, x; state its axis");
    let mimic = ["0 0 -1\"/>", "0 0 -1\"/><mimic joint=\"shoulder\" multiplier=\"-1\"/>"];
    insta::assert_snapshot!(of(mimic[0], mimic[1], &both), @"joint `elbow` mimics `shoulder`, so it turns with that joint and has no spring of its own; the joints of a chain must turn freely");
    insta::assert_snapshot!(of(mimic[0], mimic[1], &["shoulder"]), @"joint `elbow` mimics `shoulder`, which is a joint of the chain, but it is itself not named and would be rigid; remove <mimic> from the file if a rigid joint is acceptable");
    let tip = chain(ROBOT, &[joint("shoulder", 0.0), joint("elbow", 0.0)], Some("upper"));
    insta::assert_snapshot!(tip.unwrap_err(), @"structure.tip: link `upper` does not move with joint `elbow`: these links do: lower, payload");
    let joints = "joints = [{ name = 'turn', stiffness_nm_rad = 1, damping_nm_s_rad = 1 }]";
    let turning = format!("[structure]\nkind = 'chain'\nfile = 'arm6.urdf'\ngravity_m_s2 = 9.81\n{joints}\n");
    insta::assert_snapshot!(says(&turning), @"examples/arm6.urdf: `gravity_m_s2` needs horizontal axes, so that it acts in the plane of motion; they are 90.000° from horizontal: leave it out");
}
