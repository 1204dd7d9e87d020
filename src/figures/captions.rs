//! Texts on figures, with a typographic minus sign and subscripts.

use resonarm::plant::TestedAssembly;
use resonarm::scenario::{Scenario, StructureKind, StructureSection};
use resonarm::structure::BodySpec;
use resonarm_figures::plot::Subtitle;

/// Writes an angle in degrees, with a typographic minus sign.
pub(crate) fn degrees(value: f64) -> String {
    format!("{value}°").replace('-', "−")
}

/// Returns the label of the structure under test for headers, with every parameter that is set.
pub(crate) fn label(scenario: &Scenario, tested: &TestedAssembly) -> String {
    called(scenario, tested, &[], &|changes| changes.join(", "))
}

/// Returns the label of the structure on a figure, without the parameters that vary, as `link2.angle_deg`: the caption
/// has those that are set.
pub(crate) fn structure(scenario: &Scenario, tested: &TestedAssembly, varied: &[String]) -> Subtitle {
    let changes = changes(scenario, varied);
    let line = called(scenario, tested, varied, &|changes| match changes {
        [one] => one.clone(),
        many => format!("{} changed parameters", many.len()),
    });
    let more = if changes.len() > 1 { vec![format!("set: {}", changes.join(", "))] } else { Vec::new() };
    Subtitle { line, more }
}

/// Lists the parameters that are set, except those that vary and angles that the line states.
fn changes(scenario: &Scenario, varied: &[String]) -> Vec<String> {
    let shows_angles = shows_angles(scenario);
    let is_shown = |name: &str| {
        // Angles of a preset are in the line already, with the value that `set` gave them.
        let is_in_line = shows_angles && name.ends_with(".angle_deg");
        !is_in_line && varied.iter().all(|varied| varied != name)
    };
    let changes = scenario.structure.changes();
    changes.iter().filter(|change| is_shown(&change.name)).map(ToString::to_string).collect()
}

/// Says whether the line states the angles: of a preset without a name.
fn shows_angles(scenario: &Scenario) -> bool {
    scenario.structure.kind == StructureKind::Preset && scenario.structure.name.is_none()
}

/// Names the structure, with the parameters that are set, the angles of a preset and the elements.
fn called(
    scenario: &Scenario,
    tested: &TestedAssembly,
    varied: &[String],
    set: &dyn Fn(&[String]) -> String,
) -> String {
    let section = &scenario.structure;
    let n = tested.assembly.coordinates();
    let plain = || match section.kind {
        StructureKind::Preset => section.preset.clone().unwrap_or_default(),
        StructureKind::Chain => format!("chain of {n} {}", if n == 1 { "link" } else { "links" }),
        StructureKind::Modal | StructureKind::Own | StructureKind::Fmu => {
            format!("{n} {}", if n == 1 { "mode" } else { "modes" })
        }
    };
    let angles = match &tested.assembly.spec().body {
        BodySpec::Chain(chain) if shows_angles(scenario) => {
            let angle = |(link, number): (&resonarm::structure::Link, usize)| {
                let is_varied = varied.iter().any(|name| *name == format!("link{number}.angle_deg"));
                if is_varied { String::from("…") } else { degrees(link.angle_deg) }
            };
            format!(" at {}", chain.links.iter().zip(1..).map(angle).collect::<Vec<_>>().join(", "))
        }
        _ => String::new(),
    };
    let changes = changes(scenario, varied);
    let set = if changes.is_empty() { String::new() } else { format!(" with {}", set(&changes)) };
    let elements = match &tested.assembly.spec().elements[..] {
        [] => String::new(),
        [one] => format!(" with an element, {}", one.name()),
        many => format!(" with {} elements", many.len()),
    };
    format!("{}{set}{angles}{elements}", section.name.clone().unwrap_or_else(plain))
}

/// Returns the display name of an external structure: an FMU, or one that a program steps itself.
pub(crate) fn foreign_label(section: &StructureSection) -> String {
    let file = section.file.as_ref().and_then(|file| file.file_name());
    let plain = || file.map_or("a program's own structure".into(), |file| file.to_string_lossy());
    section.name.clone().unwrap_or_else(|| plain().into_owned())
}
