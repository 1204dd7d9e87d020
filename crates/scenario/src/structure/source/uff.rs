//! Modes in the Universal File Format (SDRC 1988; the University of Cincinnati keeps the layouts at
//! ceas3.uc.edu/sdrluff), in ASCII: dataset 55, data at nodes, of normal modes, with the nodes of dataset 15, or 2411,
//! the lines of 82, and the units of 164.
//!
//! Numbers stand in lines, with an exponent of E or D. Shapes are divided by the root of the modal mass. A node that a
//! mode leaves out is at rest in it; one that all modes leave out is no point. A line passes over nodes that are no
//! points, or have no place.

use std::collections::{BTreeMap, BTreeSet};

use super::super::ModeSection;
use super::error::{UffError, UffFault};

/// Begins and ends a dataset.
const DELIMITER: &str = "-1";
/// Axes of a node.
const AXES: [&str; 3] = ["x", "y", "z"];

/// What a file says.
pub(super) struct ModesRead {
    pub modes: Vec<ModeSection>,
    pub points: BTreeMap<String, [f64; 3]>,
    /// Lines from point to point, of those with places.
    pub lines: Vec<Vec<String>>,
}

/// A line with its number.
type Line<'a> = (usize, &'a str);

/// A normal mode.
struct Mode {
    frequency_hz: f64,
    damping_ratio: f64,
    /// Displacements of unit modal mass, 1/√kg.
    shape: BTreeMap<u32, [f64; 3]>,
}

#[derive(Default)]
struct Contents {
    modes: Vec<Mode>,
    nodes: BTreeMap<u32, [f64; 3]>,
    /// Lines from node to node.
    lines: Vec<Vec<u32>>,
    /// The numbers of all datasets.
    datasets: Vec<String>,
}

/// Reads modes; the points are the nodes of these names, or all, each called `node` with its number.
pub(super) fn read(text: &str, names: &BTreeMap<String, u32>) -> Result<ModesRead, UffError> {
    let contents = contents(text)?;
    if contents.modes.is_empty() {
        let datasets: BTreeSet<&str> = contents.datasets.iter().map(String::as_str).collect();
        let known = Vec::from_iter(datasets).join(", ");
        return Err(UffError::NoModes { known: if known.is_empty() { String::from("none") } else { known } });
    }
    let with_values: BTreeSet<u32> = contents.modes.iter().flat_map(|mode| mode.shape.keys().copied()).collect();
    let points = named(names, &with_values)?;
    let section = |mode: &Mode| {
        let at = |(name, node): (&String, &u32)| {
            let values = mode.shape.get(node).copied().unwrap_or_default();
            AXES.iter().zip(values).map(|(axis, value)| (format!("{name}.{axis}"), value)).collect::<Vec<_>>()
        };
        let shape = points.iter().flat_map(at).collect();
        ModeSection { frequency_hz: mode.frequency_hz, damping_ratio: mode.damping_ratio, shape }
    };
    let places = points.iter().filter_map(|(name, node)| Some((name.clone(), *contents.nodes.get(node)?)));
    let modes = contents.modes.iter().map(section).collect();
    let names: BTreeMap<u32, &String> = points.iter().map(|(name, node)| (*node, name)).collect();
    let drawn = |node: &u32| names.get(node).filter(|_| contents.nodes.contains_key(node)).map(|name| (*name).clone());
    let lines = contents.lines.iter().map(|line| line.iter().filter_map(drawn).collect::<Vec<_>>());
    Ok(ModesRead { modes, points: places.collect(), lines: lines.filter(|line| line.len() > 1).collect() })
}

/// The names of the points with their nodes.
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

fn contents(text: &str) -> Result<Contents, UffError> {
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
        if dataset.strip_suffix('b').is_some_and(|number| number.parse::<u32>().is_ok()) {
            return Err(at(line, UffFault::Binary { dataset }));
        }
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
            "15" => nodes(&mut records, &mut contents.nodes, "dataset 15, a node")?,
            "2411" => nodes_of_two_lines(&mut records, &mut contents.nodes)?,
            "82" => lines_of_nodes(&mut records, &mut contents.lines)?,
            "55" => contents.modes.push(mode(&mut records)?),
            "164" => units(&mut records)?,
            _ => {}
        }
        contents.datasets.push(dataset);
    }
    Ok(contents)
}

fn at(line: usize, fault: UffFault) -> UffError {
    UffError::Line { line, fault }
}

/// The lines of a dataset.
struct Records<'a> {
    lines: std::vec::IntoIter<Line<'a>>,
    /// The last line that was read.
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

    /// The numbers of the next line, at least so many.
    fn numbers(&mut self, what: &'static str, expected: usize) -> Result<Vec<f64>, UffError> {
        let (line, text) = self.next().unwrap_or((self.line, ""));
        let number = |word: &str| {
            let parsed = word.replace(['D', 'd'], "E").parse().ok().filter(|value: &f64| value.is_finite());
            parsed.ok_or_else(|| at(line, UffFault::Number { what, got: word.to_owned() }))
        };
        let numbers: Vec<f64> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
        match numbers.len() {
            got if got < expected => self.refuse(UffFault::Short { what, expected, got }),
            _ => Ok(numbers),
        }
    }

    /// A number that counts or names something.
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

/// Dataset 15: in each line number, two coordinate systems, colour, x, y, z.
fn nodes(records: &mut Records<'_>, into: &mut BTreeMap<u32, [f64; 3]>, what: &'static str) -> Result<(), UffError> {
    while !records.is_at_end() {
        let numbers = records.numbers(what, 7)?;
        let node = records.whole(what, numbers[0])?;
        insert(records, into, node, [numbers[4], numbers[5], numbers[6]])?;
    }
    Ok(())
}

/// Dataset 2411: number, two coordinate systems, colour; in a line of their own x, y, z.
fn nodes_of_two_lines(records: &mut Records<'_>, into: &mut BTreeMap<u32, [f64; 3]>) -> Result<(), UffError> {
    let what = "dataset 2411, a node";
    while !records.is_at_end() {
        let numbers = records.numbers(what, 4)?;
        let node = records.whole(what, numbers[0])?;
        let place = records.numbers(what, 3)?;
        insert(records, into, node, [place[0], place[1], place[2]])?;
    }
    Ok(())
}

/// Dataset 82: the number of the line, how many entries it has, colour; a name; the entries, eight in a line: nodes,
/// and 0 where the line is interrupted.
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
    nodes.truncate(expected);
    into.extend(nodes.split(|node| *node == 0).filter(|line| line.len() > 1).map(<[u32]>::to_vec));
    Ok(())
}

/// Dataset 164: behind the code of the units, their numbers in a metre, a newton and a kelvin.
fn units(records: &mut Records<'_>) -> Result<(), UffError> {
    records.next();
    let factors = records.numbers("dataset 164, the units", 2)?;
    let (length, force) = (factors[0], factors[1]);
    if [length, force] == [1.0; 2] { Ok(()) } else { records.refuse(UffFault::Units { length, force }) }
}

/// Dataset 55: five lines of text; model, analysis, characteristic, quantity, real or complex, values at a node; counts
/// and the number of the mode; frequency, modal mass, damping ratios; then each node and its values.
fn mode(records: &mut Records<'_>) -> Result<Mode, UffError> {
    let what = "dataset 55";
    for _ in 0..5 {
        records.next();
    }
    let kind = records.numbers(what, 6)?;
    let kind: Vec<i64> = kind.into_iter().map(|value| records.whole(what, value)).collect::<Result<_, _>>()?;
    // Complex eigenvalues of displacement and velocity, and complex numbers.
    if matches!(kind[1], 3 | 7) || matches!(kind[4], 5 | 6) {
        return records.refuse(UffFault::Complex);
    }
    if kind[1] != 2 {
        return records.refuse(UffFault::Analysis { got: kind[1] });
    }
    // 0 and 1 are unknown and general.
    if !matches!(kind[3], 0 | 1 | 8) {
        return records.refuse(UffFault::Quantity { got: kind[3] });
    }
    let count = match kind[5] {
        count @ (3 | 6) => count as usize,
        got => return records.refuse(UffFault::Values { got }),
    };
    let counts = records.numbers("dataset 55, the numbers of load case and mode", 4)?;
    let number: i64 = records.whole(what, counts[3])?;
    let [frequency_hz, mass, viscous, hysteretic] = four(records)?;
    if mass <= 0.0 {
        return records.refuse(UffFault::ModalMass { mode: number, got: mass });
    }
    if viscous == 0.0 && hysteretic != 0.0 {
        return records.refuse(UffFault::Hysteretic { mode: number, got: hysteretic });
    }
    let scale = 1.0 / libm::sqrt(mass);
    let mut shape = BTreeMap::new();
    while !records.is_at_end() {
        let node = records.numbers("dataset 55, a node", 1)?;
        let node = records.whole("dataset 55, a node", node[0])?;
        let values = records.numbers("dataset 55, the values at a node", count)?;
        insert(records, &mut shape, node, [0, 1, 2].map(|axis| scale * values[axis]))?;
    }
    Ok(Mode { frequency_hz, damping_ratio: viscous, shape })
}

fn four(records: &mut Records<'_>) -> Result<[f64; 4], UffError> {
    let numbers = records.numbers("dataset 55, frequency, modal mass and damping ratios", 4)?;
    Ok([0, 1, 2, 3].map(|index| numbers[index]))
}
