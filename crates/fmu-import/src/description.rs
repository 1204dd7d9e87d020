//! `modelDescription.xml` of FMI 2.0 and 3.0: what of it a structure needs.

use std::collections::BTreeMap;

use roxmltree::{Document, Node, ParsingOptions};

use crate::error::ImportError;
use crate::units::{self, Unit};

/// The most elements and texts of a description: some 100 000 variables.
const MOST_NODES: u32 = 4_000_000;
/// The most numbers of an array.
const MOST_ELEMENTS: u64 = 1 << 20;

/// A version of FMI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Version {
    Fmi2,
    Fmi3,
}

impl Version {
    /// The folder of libraries for this machine.
    pub const fn platform(self) -> &'static str {
        match (self, cfg!(target_arch = "aarch64")) {
            (Version::Fmi2, false) => "linux64",
            (Version::Fmi3, false) => "x86_64-linux",
            (_, true) => "aarch64-linux",
        }
    }

    /// The type of real numbers.
    pub const fn real(self) -> &'static str {
        match self {
            Version::Fmi2 => "Real",
            Version::Fmi3 => "Float64",
        }
    }
}

/// A variable of the model description.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Variable {
    pub reference: u32,
    /// Its type as the standard calls it.
    pub kind: String,
    pub causality: String,
    /// Whether its start value may be set before the simulation.
    pub is_exact: bool,
    /// The name of its unit, and whether the unit's offset counts.
    pub unit: Option<String>,
    pub is_relative: bool,
    /// The numbers of an array; `None` of a scalar.
    pub elements: Option<usize>,
}

/// An FMU as it describes itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Description {
    pub version: Version,
    pub identifier: String,
    pub token: String,
    /// Tool that generated the FMU.
    pub tool: Option<String>,
    pub own_step_s: Option<f64>,
    pub variables: BTreeMap<String, Variable>,
    pub units: BTreeMap<String, Unit>,
}

fn child<'a, 'i>(node: &Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn attribute<'a>(node: &Node<'a, '_>, name: &'static str) -> Result<&'a str, ImportError> {
    let lacks = || ImportError::Lacks { element: node.tag_name().name().to_owned(), attribute: name };
    node.attribute(name).ok_or_else(lacks)
}

fn is_true(node: &Node<'_, '_>, name: &str) -> bool {
    node.attribute(name).is_some_and(|text| matches!(text, "true" | "1"))
}

impl Description {
    /// Parses the text of `modelDescription.xml`.
    pub fn parse(text: &str) -> Result<Description, ImportError> {
        let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options);
        let document = document.map_err(|error| ImportError::Xml { reason: error.to_string() })?;
        let root = document.root_element();
        if !root.has_tag_name("fmiModelDescription") {
            let reason = format!("the element <{}> in place of <fmiModelDescription>", root.tag_name().name());
            return Err(ImportError::Xml { reason });
        }
        let version = match attribute(&root, "fmiVersion")? {
            "2.0" => Version::Fmi2,
            "3.0" => Version::Fmi3,
            got => return Err(ImportError::Version { got: got.to_owned() }),
        };
        let simulation = child(&root, "CoSimulation").ok_or_else(|| {
            let others = ["ModelExchange", "ScheduledExecution"];
            let has: Vec<&str> = others.into_iter().filter(|name| child(&root, name).is_some()).collect();
            ImportError::NoCoSimulation { has: if has.is_empty() { "nothing".into() } else { has.join(" and ") } }
        })?;
        if is_true(&simulation, "needsExecutionTool") {
            return Err(ImportError::NeedsTool);
        }
        let token = if version == Version::Fmi2 { "guid" } else { "instantiationToken" };
        let own_step = simulation.attribute("fixedInternalStepSize");
        let own_step_s = own_step.map(|text| positive("CoSimulation", "fixedInternalStepSize", text)).transpose()?;
        let identifier = attribute(&simulation, "modelIdentifier")?;
        check_identifier(identifier)?;
        Ok(Description {
            version,
            identifier: identifier.to_owned(),
            token: attribute(&root, token)?.to_owned(),
            tool: root.attribute("generationTool").map(str::to_owned),
            own_step_s,
            variables: variables(&root, version)?,
            units: units::read(&root),
        })
    }

    /// The file of the library for this machine.
    pub fn library(&self) -> String {
        format!("binaries/{}/{}.so", self.version.platform(), self.identifier)
    }
}

/// Refuses what is no name of a C function, since it becomes one of a file.
fn check_identifier(got: &str) -> Result<(), ImportError> {
    let is_word = |text: &str| text.chars().all(|letter| letter.is_alphanumeric() || "_-.".contains(letter));
    if !got.is_empty() && !got.starts_with('.') && is_word(got) {
        return Ok(());
    }
    let of = String::from("CoSimulation");
    let got = got.to_owned();
    Err(ImportError::Attribute { of, attribute: "modelIdentifier", got, expected: "a name of letters, digits and _" })
}

fn positive(of: &str, attribute: &'static str, text: &str) -> Result<f64, ImportError> {
    let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    let of = of.to_owned();
    let got = text.to_owned();
    number.ok_or(ImportError::Attribute { of, attribute, got, expected: "a positive number" })
}

/// Units of types, by the name of the type.
fn types<'a>(root: &Node<'a, '_>) -> BTreeMap<&'a str, (Option<&'a str>, bool)> {
    let all = child(root, "TypeDefinitions").into_iter().flat_map(|node| node.children());
    let unit = |node: Node<'a, '_>| {
        let of = child(&node, "Real").unwrap_or(node);
        Some((node.attribute("name")?, (of.attribute("unit"), is_true(&of, "relativeQuantity"))))
    };
    all.filter(Node::is_element).filter_map(unit).collect()
}

fn variables(root: &Node<'_, '_>, version: Version) -> Result<BTreeMap<String, Variable>, ImportError> {
    let all = child(root, "ModelVariables");
    let all =
        all.ok_or_else(|| ImportError::Lacks { element: "fmiModelDescription".into(), attribute: "ModelVariables" })?;
    let types = types(root);
    let mut variables = BTreeMap::new();
    let mut sizes = BTreeMap::new();
    let mut dimensions = Vec::new();
    for node in all.children().filter(Node::is_element) {
        let name = attribute(&node, "name")?.to_owned();
        let text = attribute(&node, "valueReference")?;
        let number = || ImportError::Attribute {
            of: name.clone(),
            attribute: "valueReference",
            got: text.to_owned(),
            expected: "a number from 0 to 4294967295",
        };
        let reference: u32 = text.trim().parse().map_err(|_| number())?;
        // FMI 2 has the type in an element of its own.
        let typed = match version {
            Version::Fmi2 => node.children().find(Node::is_element).unwrap_or(node),
            Version::Fmi3 => node,
        };
        let of_type = typed.attribute("declaredType").and_then(|name| types.get(name)).copied().unwrap_or_default();
        let causality = node.attribute("causality").unwrap_or("local");
        // By default the start values of parameters and inputs are exact, those of other variables if `initial` says
        // so.
        let starts = causality == "parameter" || causality == "input" || node.attribute("initial") == Some("exact");
        let variable = Variable {
            reference,
            kind: typed.tag_name().name().to_owned(),
            causality: causality.to_owned(),
            is_exact: starts,
            unit: typed.attribute("unit").or(of_type.0).map(str::to_owned),
            is_relative: is_true(&typed, "relativeQuantity") || of_type.1,
            elements: None,
        };
        // The length of an array may be the start value of a structural parameter, which can come behind the array:
        // lengths are looked up when all variables are read.
        if let Some(start) = node.attribute("start").and_then(|text| text.trim().parse().ok()) {
            sizes.insert(reference, start);
        }
        if node.children().any(|node| node.has_tag_name("Dimension")) {
            dimensions.push((name.clone(), reference, node));
        }
        for alias in node.children().filter(|node| node.has_tag_name("Alias")) {
            variables.insert(attribute(&alias, "name")?.to_owned(), variable.clone());
        }
        variables.insert(name, variable);
    }
    for (name, reference, node) in dimensions {
        let elements = elements(&name, &node, &sizes)?;
        // With the aliases of the array, which have its reference.
        let arrays = variables.values_mut().filter(|variable| variable.reference == reference);
        arrays.for_each(|variable| variable.elements = Some(elements));
    }
    Ok(variables)
}

/// The numbers of an array: of dimensions that are stated, or those of structural parameters at their start.
fn elements(name: &str, node: &Node<'_, '_>, sizes: &BTreeMap<u32, u64>) -> Result<usize, ImportError> {
    let size = |dimension: &Node<'_, '_>| match (dimension.attribute("start"), dimension.attribute("valueReference")) {
        (Some(start), _) => start.trim().parse().ok(),
        (None, Some(reference)) => sizes.get(&reference.trim().parse().ok()?).copied(),
        (None, None) => None,
    };
    let mut all: u64 = 1;
    for dimension in node.children().filter(|node| node.has_tag_name("Dimension")) {
        let length = size(&dimension).and_then(|length| all.checked_mul(length)).filter(|all| *all <= MOST_ELEMENTS);
        all = length.ok_or_else(|| ImportError::Attribute {
            of: name.to_owned(),
            attribute: "Dimension",
            got: dimension.attribute("start").or(dimension.attribute("valueReference")).unwrap_or_default().to_owned(),
            expected: "a length, or the value reference of one",
        })?;
    }
    Ok(all as usize)
}
