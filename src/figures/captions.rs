//! Texts on figures, with a typographic minus sign and subscripts.

use resonarm::arm::Load;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::{ArmSection, Scenario, StructureKind, StructureSection};
use resonarm::structure::BodySpec;
use resonarm_figures::plot::Subtitle;
use resonarm_numeric::number::short;

/// α of each joint.
const ALPHA: [&str; 2] = ["α₁", "α₂"];

/// An angle in degrees, with a minus sign where it is negative.
pub(crate) fn degrees(value: f64) -> String {
    format!("{value}°").replace('-', "−")
}

/// What the structure under test is called in headers, with every parameter that differs from a preset's.
pub(crate) fn label(scenario: &Scenario, tested: &TestedAssembly) -> String {
    called(scenario, tested, scenario.arm.label(), &[])
}

/// The same on a figure, without the parameters that vary, as `link2.angle_deg`: the caption has the parameters that
/// differ from the preset's.
pub(crate) fn structure(scenario: &Scenario, tested: &TestedAssembly, varied: &[String]) -> Subtitle {
    let line = called(scenario, tested, scenario.arm.short_label_without(&[]), varied);
    let (short, long) = (scenario.arm.short_label_without(&[]), scenario.arm.description());
    let is_arm = kind(scenario) == StructureKind::Arm;
    let more = if is_arm && short != long { vec![format!("arm: {long}")] } else { Vec::new() };
    Subtitle { line, more }
}

fn kind(scenario: &Scenario) -> StructureKind {
    scenario.structure.as_ref().map_or(StructureKind::Arm, |section| section.kind)
}

/// The structure, with what is set, the angles of the arm and the elements.
fn called(scenario: &Scenario, tested: &TestedAssembly, arm: String, varied: &[String]) -> String {
    let (section, n) = (scenario.structure.as_ref(), tested.assembly.coordinates());
    let plain = match kind(scenario) {
        StructureKind::Arm => arm,
        StructureKind::Chain => format!("chain of {n} {}", if n == 1 { "link" } else { "links" }),
        StructureKind::Modal | StructureKind::Own | StructureKind::Fmu => {
            format!("{n} {}", if n == 1 { "mode" } else { "modes" })
        }
    };
    let name = section.and_then(|section| section.name.clone());
    let angles = match (&name, &tested.assembly.spec().body) {
        (None, BodySpec::Chain(chain)) if kind(scenario) == StructureKind::Arm => {
            let angle = |(link, number): (&resonarm::structure::Link, usize)| {
                let is_varied = varied.iter().any(|name| *name == format!("link{number}.angle_deg"));
                if is_varied { String::from("…") } else { degrees(link.angle_deg) }
            };
            format!(" at {}", chain.links.iter().zip(1..).map(angle).collect::<Vec<_>>().join(", "))
        }
        _ => String::new(),
    };
    let is_shown = |name: &str| {
        !varied.iter().any(|varied| varied == name) && (angles.is_empty() || !name.ends_with(".angle_deg"))
    };
    let set: Vec<_> = section.iter().flat_map(|section| &section.set).filter(|(name, _)| is_shown(name)).collect();
    let set = match &set[..] {
        [] => String::new(),
        [(name, value)] => format!(" with {name} = {}", short(value)),
        many => format!(" with {} parameters set", many.len()),
    };
    let elements = match tested.assembly.elements() {
        [] => String::new(),
        [one] => format!(" with an element, {}", one.law().name()),
        many => format!(" with {} elements", many.len()),
    };
    format!("{}{set}{angles}{elements}", name.unwrap_or(plain))
}

/// Display name of an external structure: an FMU, or one that a program steps itself.
pub(crate) fn foreign_label(section: &StructureSection) -> String {
    let file = section.file.as_ref().and_then(|file| file.file_name());
    let plain = || file.map_or("a program's own structure".into(), |file| file.to_string_lossy());
    section.name.clone().unwrap_or_else(|| plain().into_owned())
}

/// An arm and its pose; the caption has the parameters that differ from the preset's.
pub(crate) fn pose(arm: &ArmSection) -> Subtitle {
    let (line, description) = (arm.short_label_without(&[]), arm.description());
    let more = if line == description { Vec::new() } else { vec![format!("arm: {description}")] };
    let angles = [("β₁", arm.beta1_deg), ("β₂", arm.beta2_deg)];
    angles.iter().fold(Subtitle { line, more }, |subtitle, (symbol, value)| {
        subtitle.and(format!("{symbol} = {}", degrees(*value)))
    })
}

/// The excitation in words.
pub(crate) fn load(load: &Load) -> String {
    let ([u1, u2], [fx, fy]) = (<[f64; 2]>::from(load.torque_nm), <[f64; 2]>::from(load.force_n));
    let parts = [(u1, "N·m at joint 1"), (u2, "N·m at joint 2"), (fx, "N at C along x"), (fy, "N at C along y")];
    let parts: Vec<String> =
        parts.iter().filter(|(value, _)| *value != 0.0).map(|(value, what)| format!("{value} {what}")).collect();
    parts.join(", ").replace('-', "−")
}

/// The axis of the largest |α| over a period.
pub(crate) fn largest(joint: usize) -> String {
    format!("largest |{}| (rad)", ALPHA[joint])
}
