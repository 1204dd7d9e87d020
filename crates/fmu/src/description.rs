//! `modelDescription.xml` (FMI 3.0.2, section 2.4).

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::content::{Content, Interface, Role, Settings, VERSION};
use crate::operation::MIME;
use crate::units::Unit;
use crate::variables::{Causality, Kind, Source, Variable};

/// The identifier of the library in the archive, and of the model.
pub(crate) const IDENTIFIER: &str = "resonarm";

/// The description of an FMU called `name`.
pub(crate) fn model_description(name: &str, token: &str, content: &Content, variables: &[Variable]) -> String {
    // The shortest text that reads back as the same number.
    let step_s = format!("{:?}", 1.0 / content.scenario.simulation.rate_hz);
    let what = match content.settings.role {
        Role::Plant => "a structure with its exciter and instruments",
        Role::Exciter => "an exciter controller",
        Role::Bus => "a CAN bus",
    };
    let Settings { interface, role, .. } = content.settings;
    // Only the plant has states to save, and only those by signals have a form as bytes: `Model::save` and
    // `instance::saved`.
    let has_states = role == Role::Plant;
    let serializes = interface == Interface::Signals;
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"3.0\" modelName=\"{name}\" instantiationToken=\"{token}\" \
         description=\"Resonarm: {what}\" generationTool=\"resonarm {VERSION}\" license=\"Apache-2.0 OR MIT\" \
         variableNamingConvention=\"structured\">\n\
         \x20 <CoSimulation modelIdentifier=\"{IDENTIFIER}\" canGetAndSetFMUState=\"{has_states}\" \
         canSerializeFMUState=\"{serializes}\" canHandleVariableCommunicationStepSize=\"true\" fixedInternalStepSize=\"{step_s}\" hasEventMode=\"true\"/>\n",
        name = escaped(name)
    );
    xml += &units(variables);
    xml += "  <LogCategories>\n    <Category name=\"logStatusError\" description=\"errors\"/>\n  </LogCategories>\n";
    let _ = writeln!(xml, "  <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"{step_s}\"/>");
    xml += "  <ModelVariables>\n";
    variables.iter().enumerate().for_each(|(reference, variable)| xml += &element(reference, variable));
    xml += "  </ModelVariables>\n  <ModelStructure>\n";
    let outputs = || variables.iter().enumerate().filter(|(_, variable)| variable.causality == Causality::Output);
    // No output depends on an input of the same instant: loads act from a sample on, and are felt at the next.
    for (reference, _) in outputs() {
        let _ = writeln!(xml, "    <Output valueReference=\"{reference}\" dependencies=\"\"/>");
    }
    // Not of what is clocked, which has no value at the start.
    for (reference, _) in outputs().filter(|(_, variable)| variable.kind != Kind::Binary) {
        let _ = writeln!(xml, "    <InitialUnknown valueReference=\"{reference}\"/>");
    }
    xml + "  </ModelStructure>\n</fmiModelDescription>\n"
}

/// The units of all variables.
fn units(variables: &[Variable]) -> String {
    let units: BTreeSet<Unit> = variables.iter().filter_map(|variable| variable.unit).collect();
    let unit = |Unit { name, base }: Unit| match base {
        "" => format!("    <Unit name=\"{name}\"/>\n"),
        base => format!("    <Unit name=\"{name}\"><BaseUnit {base}/></Unit>\n"),
    };
    let all: String = units.into_iter().map(unit).collect();
    format!("  <UnitDefinitions>\n{all}  </UnitDefinitions>\n")
}

/// The element of a variable.
fn element(reference: usize, variable: &Variable) -> String {
    match variable.kind {
        Kind::Binary => return binary(reference, variable),
        Kind::Clock => return clock(reference, variable),
        _ => {}
    }
    let (causality, variability, initial) = match (variable.causality, variable.kind) {
        (Causality::Independent, _) => ("independent", "continuous", ""),
        (Causality::Parameter, _) => ("parameter", "fixed", " initial=\"exact\""),
        (Causality::Input, _) => ("input", "continuous", ""),
        (Causality::Output, Kind::Float64) => ("output", "continuous", " initial=\"calculated\""),
        (Causality::Output, _) => ("output", "discrete", " initial=\"calculated\""),
    };
    let kind = variable.kind.name();
    let unit = variable.unit.map(|unit| format!(" unit=\"{}\"", unit.name)).unwrap_or_default();
    let [name, description] = [&variable.name, &variable.description].map(|text| escaped(text));
    let head = format!(
        "    <{kind} name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\" \
         variability=\"{variability}\"{initial} description=\"{description}\""
    );
    match (&variable.start, variable.kind) {
        (Some(start), Kind::String) => format!("{head}><Start value=\"{}\"/></{kind}>\n", escaped(start)),
        (Some(start), _) => format!("{head}{unit} start=\"{start}\"/>\n"),
        (None, _) => format!("{head}{unit}/>\n"),
    }
}

/// Data of a terminal, whose clock is the next variable.
fn binary(reference: usize, Variable { name, causality, description, .. }: &Variable) -> String {
    let is_input = *causality == Causality::Input;
    let causality = if is_input { "input" } else { "output" };
    // What is calculated has no start.
    let (initial, start) = if is_input { ("exact", "><Start value=\"\"/></Binary>") } else { ("calculated", "/>") };
    format!(
        "    <Binary name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\" variability=\"discrete\" \
         initial=\"{initial}\" clocks=\"{clock}\" mimeType=\"{mime}\" description=\"{description}\"{start}\n",
        clock = reference + 1,
        mime = escaped(MIME)
    )
}

/// A clock of a terminal.
fn clock(reference: usize, Variable { name, source, causality, description, .. }: &Variable) -> String {
    let (causality, interval) = match (causality, source) {
        (Causality::Input, Source::TxClock(_)) => ("input", "countdown"),
        (Causality::Input, _) => ("input", "triggered"),
        _ => ("output", "triggered"),
    };
    format!(
        "    <Clock name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\" \
         intervalVariability=\"{interval}\" description=\"{description}\"/>\n"
    )
}

/// A text within an attribute or an element.
pub(crate) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            letter => escaped.push(letter),
        }
    }
    escaped
}
