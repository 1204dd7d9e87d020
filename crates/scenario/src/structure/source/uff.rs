//! Modes in the Universal File Format (SDRC 1988; the University of Cincinnati keeps the layouts at
//! ceas3.uc.edu/sdrluff), in ASCII: dataset 55, data at nodes, or 2414, analysis data, of normal modes, with the nodes
//! of dataset 15, or 2411, the lines of 82, and the units of 164.
//!
//! Numbers stand in lines, with an exponent of E or D. Shapes are divided by the root of the modal mass. A node
//! that is missing in a mode is at rest in it; one that is missing in all modes is not a point. A line skips
//! nodes that are not points or have no position.
//!
//! Dataset 164 states how many units of the file make a metre, l, and a newton, f, for what follows it.
//! Positions are divided by l. The file's unit of mass is its unit of force times s² over its unit of length,
//! l/f kg: a kilogram with mm and mN, a tonne with mm and N. A modal mass μ = φᵀMφ belongs to the numbers φ of
//! its shape, so that φ/√(μ l/f) has the modal mass 1 kg, whatever the unit and the scale of φ.
//!
//! Test software also writes normal modes as complex ones: with a complex eigenvalue λ = σ + jω (analysis type
//! 3), complex numbers at the nodes, or both. Then f = |λ|/2π and ζ = −σ/|λ|. A complex shape φ of a normal
//! mode is a real one, ψ, rotated by an angle: φ = ψ exp(jθ). The real parts of φ exp(−jθ) have the sum of
//! squares (Σ|φᵢ|² + Re(exp(−2jθ) Σφᵢ²))/2, which is largest for 2θ = arg Σφᵢ²; what remains in the imaginary
//! parts has (Σ|φᵢ|² − |Σφᵢ²|)/2. The mode counts as normal if the root of that over Σ|φᵢ|² is at most
//! [`MOST_IMAGINARY`]. In place of the modal mass such a file has modal A, a = φᵀ(2λM + C)φ = 2jωμ exp(2jθ)
//! with ψᵀCψ = −2σμ, so that μ = a exp(−2jθ)/2jω, which must be real within the same share.

use std::collections::{BTreeMap, BTreeSet};

use super::super::ModeSection;
use super::error::{UffError, UffFault};

/// Line that begins and ends a dataset.
const DELIMITER: &str = "-1";
/// Largest imaginary part of a normal mode's shape relative to the shape, and of its modal mass. `of_modes`
/// neglects as much at most, where damping couples two modes.
const MOST_IMAGINARY: f64 = 0.01;
/// Names of the axes at a node.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Modes, positions and lines of a file.
pub(super) struct ModesRead {
    pub modes: Vec<ModeSection>,
    pub points: BTreeMap<String, [f64; 3]>,
    /// Lines between points that have positions.
    pub lines: Vec<Vec<String>>,
}

/// A line with its number.
type Line<'a> = (usize, &'a str);

/// A normal mode, normalised and in SI units.
struct Mode {
    frequency_hz: f64,
    damping_ratio: f64,
    /// Displacements of unit modal mass, 1/√kg.
    shape: BTreeMap<u32, [f64; 3]>,
    /// Whether the modal mass comes from the scenario, not from the file.
    has_stated_mass: bool,
}

/// Number of the file's units in a metre and in a newton.
#[derive(Clone, Copy)]
struct Units {
    length: f64,
    force: f64,
}

impl Default for Units {
    fn default() -> Units {
        Units { length: 1.0, force: 1.0 }
    }
}

/// Header of a mode's dataset, before the values at the nodes.
struct ModeHead {
    number: i64,
    dynamics: Dynamics,
    /// Whether each value at a node is two numbers, real and imaginary part.
    is_complex: bool,
    /// Number of values at a node.
    values: usize,
    /// Names of a node's record and of the values' record, for messages.
    names: [&'static str; 2],
}

/// What a header states about the motion of its mode.
#[derive(Clone, Copy)]
struct Dynamics {
    frequency_hz: f64,
    damping_ratio: f64,
    mass: HeadMass,
}

/// Modal mass in a header, in the units of the file; 0 if it is not known.
#[derive(Clone, Copy)]
enum HeadMass {
    Modal(f64),
    /// Real and imaginary part of modal A, and the imaginary part of the mode's eigenvalue, rad/s.
    ModalA([f64; 2], f64),
}

impl HeadMass {
    /// Returns real and imaginary part of the modal mass after turning the shape back by θ; the argument is 2θ.
    fn turned(self, twice_rad: f64) -> [f64; 2] {
        match self {
            HeadMass::Modal(mass) => [mass, 0.0],
            HeadMass::ModalA([re, im], omega_rad_s) => {
                // μ = a exp(−2jθ)/2jω, as the module documentation derives. Dividing by j swaps the parts and
                // negates one.
                let sin = libm::sin(twice_rad);
                let cos = libm::cos(twice_rad);
                let (re, im) = (re * cos + im * sin, im * cos - re * sin);
                [im / (2.0 * omega_rad_s), -re / (2.0 * omega_rad_s)]
            }
        }
    }
}

#[derive(Default)]
struct Contents {
    modes: Vec<Mode>,
    units: Units,
    nodes: BTreeMap<u32, [f64; 3]>,
    /// Lines from node to node, by node numbers.
    lines: Vec<Vec<u32>>,
    /// Numbers of all datasets in the file.
    datasets: Vec<String>,
}

/// Reads the modes of a file. Its points are the nodes with these names, or all nodes, each called `node` with
/// its number. Modes whose modal mass the file leaves at 0 get the stated one.
pub(super) fn read(
    text: &str,
    names: &BTreeMap<String, u32>,
    modal_mass_kg: Option<f64>,
) -> Result<ModesRead, UffError> {
    if let Some(got) = modal_mass_kg.filter(|mass_kg| !(mass_kg.is_finite() && *mass_kg > 0.0)) {
        return Err(UffError::StatedMass { got });
    }
    let contents = contents(text, modal_mass_kg)?;
    if contents.modes.is_empty() {
        let datasets: BTreeSet<&str> = contents.datasets.iter().map(String::as_str).collect();
        let known = Vec::from_iter(datasets).join(", ");
        return Err(UffError::NoModes { known: if known.is_empty() { String::from("none") } else { known } });
    }
    if modal_mass_kg.is_some() && !contents.modes.iter().any(|mode| mode.has_stated_mass) {
        return Err(UffError::MassIdle);
    }
    let with_values: BTreeSet<u32> = contents.modes.iter().flat_map(|mode| mode.shape.keys().copied()).collect();
    let points = named(names, &with_values)?;
    let section = |mode: &Mode| {
        let at = |(name, node): (&String, &u32)| {
            let values = mode.shape.get(node).copied().unwrap_or_default();
            AXES.iter().zip(values).map(|(axis, value)| (format!("{name}.{axis}"), value)).collect::<Vec<_>>()
        };
        let shape = points.iter().flat_map(at).collect();
        ModeSection {
            frequency_hz: mode.frequency_hz,
            damping_ratio: mode.damping_ratio,
            shape,
            participation: BTreeMap::new(),
        }
    };
    let places = points.iter().filter_map(|(name, node)| Some((name.clone(), *contents.nodes.get(node)?)));
    let modes = contents.modes.iter().map(section).collect();
    let names: BTreeMap<u32, &String> = points.iter().map(|(name, node)| (*node, name)).collect();
    // A line goes on through the points that are left: nodes that are no points or have no position are skipped.
    let drawn = |node: &u32| names.get(node).filter(|_| contents.nodes.contains_key(node)).map(|name| (*name).clone());
    let lines = contents.lines.iter().map(|line| line.iter().filter_map(drawn).collect::<Vec<_>>());
    Ok(ModesRead { modes, points: places.collect(), lines: lines.filter(|line| line.len() > 1).collect() })
}

/// Returns the points' names with their nodes.
fn named(names: &BTreeMap<String, u32>, with_values: &BTreeSet<u32>) -> Result<BTreeMap<String, u32>, UffError> {
    if names.is_empty() {
        return Ok(with_values.iter().map(|node| (format!("node{node}"), *node)).collect());
    }
    let mut name_of: BTreeMap<u32, &String> = BTreeMap::new();
    for (name, &node) in names {
        if !with_values.contains(&node) {
            let known = with_values.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
            return Err(UffError::NoNode { name: name.clone(), node, known });
        }
        if let Some(other) = name_of.insert(node, name) {
            return Err(UffError::NodeTwice { names: [other.clone(), name.clone()], node });
        }
    }
    Ok(names.clone())
}

fn contents(text: &str, modal_mass_kg: Option<f64>) -> Result<Contents, UffError> {
    let mut contents = Contents::default();
    let mut lines = (1..).zip(text.lines());
    while let Some((line, text)) = lines.next() {
        if text.trim().is_empty() {
            continue;
        }
        if text.trim() != DELIMITER {
            return Err(at(line, UffFault::Outside { got: text.trim().to_owned() }));
        }
        let Some((line, head)) = lines.next() else { break };
        let dataset = head.split_whitespace().next().unwrap_or_default().to_owned();
        if let Some(number) = dataset.strip_suffix('b').and_then(|number| number.parse::<u32>().ok()) {
            if matches!(number, 55 | 2414) {
                return Err(at(line, UffFault::Binary { dataset }));
            }
            // Binary measurement data hold no modes. The closing delimiter may stand at the end of the last
            // line of binary data.
            lines.by_ref().find(|(_, text)| text.trim_end().ends_with(DELIMITER));
            contents.datasets.push(dataset);
            continue;
        }
        // Datasets that are not read are passed over by their end, whatever their layout is, but a number is always
        // their head.
        if dataset.parse::<u32>().is_err() {
            return Err(at(line, UffFault::Dataset { got: head.trim().to_owned() }));
        }
        let mut body: Vec<Line<'_>> = Vec::new();
        loop {
            match lines.next() {
                Some((_, text)) if text.trim() == DELIMITER => break,
                Some(line) => body.push(line),
                None => return Err(UffError::NoEnd { dataset, line }),
            }
        }
        let mut records = Records { lines: body.into_iter(), line };
        match dataset.as_str() {
            "15" => nodes(&mut records, &mut contents.nodes, contents.units)?,
            "2411" => nodes_of_two_lines(&mut records, &mut contents.nodes, contents.units)?,
            "82" => lines_of_nodes(&mut records, &mut contents.lines)?,
            "55" => {
                let head = head_of_55(&mut records)?;
                contents.modes.push(mode(&mut records, &head, contents.units, modal_mass_kg)?);
            }
            "2414" => {
                if let Some(head) = head_of_2414(&mut records)? {
                    contents.modes.push(mode(&mut records, &head, contents.units, modal_mass_kg)?);
                }
            }
            // The units apply to the datasets that follow, so they are taken in the order of the file.
            "164" => contents.units = units(&mut records)?,
            _ => {}
        }
        contents.datasets.push(dataset);
    }
    Ok(contents)
}

fn at(line: usize, fault: UffFault) -> UffError {
    UffError::Line { line, fault }
}

/// Lines of one dataset.
struct Records<'a> {
    lines: std::vec::IntoIter<Line<'a>>,
    /// Number of the last line that was read.
    line: usize,
}

impl<'a> Records<'a> {
    fn next(&mut self) -> Option<Line<'a>> {
        let next = self.lines.next();
        self.line = next.map_or(self.line, |(line, _)| line);
        next
    }

    fn is_at_end(&self) -> bool {
        self.lines.as_slice().iter().all(|(_, text)| text.trim().is_empty())
    }

    fn refuse<T>(&self, fault: UffFault) -> Result<T, UffError> {
        Err(at(self.line, fault))
    }

    /// Reads the numbers of the next line, which must be at least `expected`.
    fn numbers(&mut self, what: &'static str, expected: usize) -> Result<Vec<f64>, UffError> {
        // At the end of a dataset the record counts as an empty line, so that the message tells what is missing
        // there.
        let (line, text) = self.next().unwrap_or((self.line, ""));
        let number = |word: &str| {
            // Fortran writes double precision exponents with a D.
            let parsed = word.replace(['D', 'd'], "E").parse().ok().filter(|value: &f64| value.is_finite());
            parsed.ok_or_else(|| at(line, UffFault::Number { what, got: word.to_owned() }))
        };
        let numbers: Vec<f64> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
        match numbers.len() {
            got if got < expected => self.refuse(UffFault::Short { what, expected, got }),
            _ => Ok(numbers),
        }
    }

    /// Converts a number that counts or names something to an integer.
    fn whole<T: TryFrom<i64>>(&self, what: &'static str, value: f64) -> Result<T, UffError> {
        let whole = value as i64;
        let exact = (whole as f64 == value).then_some(whole).and_then(|whole| T::try_from(whole).ok());
        exact.map_or_else(|| self.refuse(UffFault::Number { what, got: value.to_string() }), Ok)
    }
}

fn insert(
    records: &Records<'_>,
    nodes: &mut BTreeMap<u32, [f64; 3]>,
    node: u32,
    values: [f64; 3],
) -> Result<(), UffError> {
    match nodes.insert(node, values) {
        Some(_) => records.refuse(UffFault::NodeAgain { node }),
        None => Ok(()),
    }
}

/// Reads dataset 15, a node per line: number, two coordinate systems, colour, x, y, z.
fn nodes(records: &mut Records<'_>, into: &mut BTreeMap<u32, [f64; 3]>, units: Units) -> Result<(), UffError> {
    let what = "dataset 15, a node";
    while !records.is_at_end() {
        let numbers = records.numbers(what, 7)?;
        let node = records.whole(what, numbers[0])?;
        insert(records, into, node, [4, 5, 6].map(|axis| numbers[axis] / units.length))?;
    }
    Ok(())
}

/// Reads dataset 2411, two lines per node: number, two coordinate systems, colour; then x, y, z.
fn nodes_of_two_lines(
    records: &mut Records<'_>,
    into: &mut BTreeMap<u32, [f64; 3]>,
    units: Units,
) -> Result<(), UffError> {
    let what = "dataset 2411, a node";
    while !records.is_at_end() {
        let numbers = records.numbers(what, 4)?;
        let node = records.whole(what, numbers[0])?;
        let place = records.numbers(what, 3)?;
        insert(records, into, node, [0, 1, 2].map(|axis| place[axis] / units.length))?;
    }
    Ok(())
}

/// Reads dataset 82: the number of the line, how many entries it has, colour; a name; the entries, eight in a line:
/// nodes, and 0 where the line is interrupted.
fn lines_of_nodes(records: &mut Records<'_>, into: &mut Vec<Vec<u32>>) -> Result<(), UffError> {
    let what = "dataset 82, a line of nodes";
    let head = records.numbers(what, 2)?;
    let expected: usize = records.whole(what, head[1])?;
    records.next();
    let mut nodes: Vec<u32> = Vec::new();
    while nodes.len() < expected {
        for value in records.numbers(what, 1)? {
            nodes.push(records.whole(what, value)?);
        }
    }
    // The last line of eight may be padded.
    nodes.truncate(expected);
    into.extend(nodes.split(|node| *node == 0).filter(|line| line.len() > 1).map(<[u32]>::to_vec));
    Ok(())
}

/// Reads dataset 164: after the code of the units, the number of units in a metre, a newton and a kelvin.
fn units(records: &mut Records<'_>) -> Result<Units, UffError> {
    records.next();
    let factors = records.numbers("dataset 164, the units", 2)?;
    let length = factors[0];
    let force = factors[1];
    if length > 0.0 && force > 0.0 {
        Ok(Units { length, force })
    } else {
        records.refuse(UffFault::Units { length, force })
    }
}

/// Reads the head of dataset 55: five lines of text; model, analysis, characteristic, quantity, real or complex, values
/// at a node; counts and the number of the mode; frequency, modal mass, damping ratios. Each node and its values
/// follow.
fn head_of_55(records: &mut Records<'_>) -> Result<ModeHead, UffError> {
    let what = "dataset 55";
    for _ in 0..5 {
        records.next();
    }
    let kind = kind(records, what)?;
    if !matches!(kind[1], NORMAL_MODE | COMPLEX_EIGENVALUE) {
        let expected = "2 (normal mode) or 3 (complex eigenvalue of first order)";
        return records.refuse(UffFault::Type { dataset: 55, what: "analysis type", got: kind[1], expected });
    }
    let values = values_at_a_node(records, 55, &kind)?;
    let counts = records.numbers("dataset 55, the numbers of load case and mode", 4)?;
    let number = records.whole(what, counts[3])?;
    let names = ["dataset 55, a node", "dataset 55, the values at a node"];
    let dynamics = if kind[1] == COMPLEX_EIGENVALUE {
        let numbers = records.numbers("dataset 55, eigenvalue and modal A", 4)?;
        complex(records, number, &numbers)?
    } else {
        let numbers = records.numbers("dataset 55, frequency, modal mass and damping ratios", 4)?;
        normal(records, number, [0, 1, 2, 3].map(|index| numbers[index]))?
    };
    Ok(ModeHead { number, dynamics, is_complex: has_complex_values(&kind), values, names })
}

/// Returns the dynamics of a mode with a complex eigenvalue, from the numbers of the eigenvalue and of modal A.
fn complex(records: &Records<'_>, mode: i64, numbers: &[f64]) -> Result<Dynamics, UffError> {
    let sigma = numbers[0];
    let omega = numbers[1];
    if omega <= 0.0 {
        return records.refuse(UffFault::Eigenvalue { mode, got: [sigma, omega] });
    }
    let magnitude = libm::hypot(sigma, omega);
    Ok(Dynamics {
        frequency_hz: magnitude / core::f64::consts::TAU,
        damping_ratio: -sigma / magnitude,
        mass: HeadMass::ModalA([numbers[2], numbers[3]], omega),
    })
}

/// Returns the dynamics of a normal mode, from its frequency, modal mass, viscous and hysteretic damping ratio.
/// Hysteretic damping alone is rejected.
fn normal(records: &Records<'_>, mode: i64, numbers: [f64; 4]) -> Result<Dynamics, UffError> {
    let [frequency_hz, modal_mass, damping_ratio, hysteretic] = numbers;
    if damping_ratio == 0.0 && hysteretic != 0.0 {
        return records.refuse(UffFault::Hysteretic { mode, got: hysteretic });
    }
    Ok(Dynamics { frequency_hz, damping_ratio, mass: HeadMass::Modal(modal_mass) })
}

/// Reads the head of dataset 2414: its label, a name, where the data are, five lines of text; a line as in dataset 55;
/// eight numbers, the sixth that of the mode, and two more; time, frequency, eigenvalue, modal mass and both damping
/// ratios; a line of complex eigenvalues. Each node and its values follow. Returns `None` for analyses, quantities and
/// places other than displacements of modes at nodes: a file has many.
fn head_of_2414(records: &mut Records<'_>) -> Result<Option<ModeHead>, UffError> {
    const AT_NODES: i64 = 1;
    let what = "dataset 2414";
    records.next();
    records.next();
    let place = records.numbers(what, 1)?;
    // Analysis data may stand at elements or at their corners as well, and with stresses in them.
    let is_at_nodes = records.whole::<i64>(what, place[0])? == AT_NODES;
    for _ in 0..5 {
        records.next();
    }
    let kind = kind(records, what)?;
    if !is_at_nodes || !matches!(kind[3], UNKNOWN | GENERAL | DISPLACEMENT) {
        return Ok(None);
    }
    if !matches!(kind[1], NORMAL_MODE | COMPLEX_EIGENVALUE) {
        return Ok(None);
    }
    let values = values_at_a_node(records, 2414, &kind)?;
    let counts = records.numbers("dataset 2414, the numbers of the analysis", 6)?;
    let number = records.whole(what, counts[5])?;
    records.next();
    let numbers = records.numbers("dataset 2414, frequency, modal mass and damping ratios", 6)?;
    let names = ["dataset 2414, a node", "dataset 2414, the values at a node"];
    let dynamics = if kind[1] == COMPLEX_EIGENVALUE {
        let numbers = records.numbers("dataset 2414, eigenvalue and modal A", 4)?;
        complex(records, number, &numbers)?
    } else {
        records.next();
        normal(records, number, [1, 3, 4, 5].map(|index| numbers[index]))?
    };
    Ok(Some(ModeHead { number, dynamics, is_complex: has_complex_values(&kind), values, names }))
}

/// Code of an analysis: a normal mode.
const NORMAL_MODE: i64 = 2;
/// Code of an analysis: complex eigenvalues of first order, with displacements. Type 7, with velocities, has
/// another scale and is not read.
const COMPLEX_EIGENVALUE: i64 = 3;
const UNKNOWN: i64 = 0;
const GENERAL: i64 = 1;
const DISPLACEMENT: i64 = 8;

/// Reads the codes of a dataset: model, analysis, characteristic, quantity, real or complex, values at a node.
fn kind(records: &mut Records<'_>, what: &'static str) -> Result<[i64; 6], UffError> {
    let numbers = records.numbers(what, 6)?;
    let mut kind = [0; 6];
    for (code, number) in kind.iter_mut().zip(numbers) {
        *code = records.whole(what, number)?;
    }
    Ok(kind)
}

/// Returns whether values are complex, in single or in double precision.
const fn has_complex_values(kind: &[i64; 6]) -> bool {
    matches!(kind[4], 5 | 6)
}

/// Returns the number of values at a node, which must be displacements.
fn values_at_a_node(records: &Records<'_>, dataset: u32, kind: &[i64; 6]) -> Result<usize, UffError> {
    if !matches!(kind[3], UNKNOWN | GENERAL | DISPLACEMENT) {
        let what = "specific data type";
        let expected = "8 (displacement)";
        return records.refuse(UffFault::Type { dataset, what, got: kind[3], expected });
    }
    match kind[5] {
        count @ (3 | 6) => Ok(count as usize),
        got => records.refuse(UffFault::Values { dataset, got }),
    }
}

/// Reads the values at the nodes and completes the mode of a header.
fn mode(
    records: &mut Records<'_>,
    head: &ModeHead,
    units: Units,
    modal_mass_kg: Option<f64>,
) -> Result<Mode, UffError> {
    let ModeHead { number, dynamics: Dynamics { frequency_hz, damping_ratio, mass }, is_complex, values, names } =
        *head;
    // Faults of a mode are reported at its head, where mass and eigenvalue stand, and not behind its last node.
    let line = records.line;
    let mut shape: BTreeMap<u32, [[f64; 2]; 3]> = BTreeMap::new();
    while !records.is_at_end() {
        let node = records.numbers(names[0], 1)?;
        let node = records.whole(names[0], node[0])?;
        let values = match is_complex {
            false => Vec::from_iter(records.numbers(names[1], values)?.into_iter().map(|value| [value, 0.0])),
            true => {
                // Six complex values take two lines.
                let mut numbers = Vec::new();
                while numbers.len() < 2 * values {
                    numbers.extend(records.numbers(names[1], 1)?);
                }
                // Pairs of real and imaginary part; a number that is left over at the end belongs to no value.
                numbers.as_chunks().0.to_vec()
            }
        };
        if shape.insert(node, [0, 1, 2].map(|axis| values[axis])).is_some() {
            return records.refuse(UffFault::NodeAgain { node });
        }
    }
    // Σφᵢ² and Σ|φᵢ|² give the angle that makes the shape most nearly real, and the share that stays imaginary;
    // see the module documentation.
    let mut square = [0.0, 0.0];
    let mut sum = 0.0;
    for &[re, im] in shape.values().flatten() {
        square = [square[0] + (re * re - im * im), square[1] + 2.0 * re * im];
        sum += re * re + im * im;
    }
    let twice_rad = libm::atan2(square[1], square[0]);
    let left = libm::sqrt(f64::max(0.5 * (1.0 - libm::hypot(square[0], square[1]) / sum), 0.0));
    if left > MOST_IMAGINARY {
        return Err(at(line, UffFault::ComplexShape { mode: number, share: left, most: MOST_IMAGINARY }));
    }
    let is_known = !matches!(mass, HeadMass::Modal(0.0) | HeadMass::ModalA([0.0, 0.0], _));
    let mass_kg = match (modal_mass_kg, mass.turned(twice_rad)) {
        (Some(mass_kg), _) if !is_known => mass_kg,
        // The mass of the file is in its own units. One of its units of mass is l/f kg.
        (_, [mass, left]) if mass > 0.0 && left.abs() <= MOST_IMAGINARY * mass => mass * units.length / units.force,
        (_, [got, 0.0]) => return Err(at(line, UffFault::ModalMass { mode: number, got })),
        (_, got) => return Err(at(line, UffFault::ModalA { mode: number, got, most: MOST_IMAGINARY })),
    };
    let scale = 1.0 / libm::sqrt(mass_kg);
    let sin = libm::sin(0.5 * twice_rad);
    let cos = libm::cos(0.5 * twice_rad);
    let real = |[re, im]: [f64; 2]| scale * if is_complex { re * cos + im * sin } else { re };
    let shape = shape.into_iter().map(|(node, values)| (node, values.map(real))).collect();
    Ok(Mode { frequency_hz, damping_ratio, shape, has_stated_mass: !is_known })
}
