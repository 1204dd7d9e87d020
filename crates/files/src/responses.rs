//! Measured frequency responses in the Universal File Format: dataset 58, function at nodal degree of freedom, in ASCII or
//! binary (58b), with the nodes of dataset 15 or 2411, the trace lines of 82, the elements of 2412 and the units of 164 (SDRC 1988;
//! the University of Cincinnati keeps the layouts at ceas3.uc.edu/sdrluff).
//!
//! Of elements the edges are read, as lines from node to node: those of rods, beams and others of two nodes, of faces of any order,
//! and of solids of first order. Other elements have no lines.
//!
//! Dataset 164 states how many units of the file make a metre, l, and a newton, f, for what follows it. A response over a force in
//! the file's units is multiplied by f/l, and positions are divided by l.

use core::ops::{Range, RangeInclusive};
use core::str::FromStr;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use nalgebra::Complex;
use resonarm_numeric::number::rounded;
use thiserror::Error;

/// Line that begins and ends a dataset.
const DELIMITER: &str = "-1";
/// Bytes about the stated end of binary values within which the delimiter must begin.
const SLACK: usize = 4;
/// Function type of frequency responses.
const FREQUENCY_RESPONSE: usize = 4;
/// Specific data types: frequency; displacement, velocity, acceleration; reaction and excitation force.
const FREQUENCY: i64 = 18;
const QUANTITIES: [(i64, MeasuredQuantity); 3] =
    [(8, MeasuredQuantity::Displacement), (11, MeasuredQuantity::Velocity), (12, MeasuredQuantity::Acceleration)];
const FORCES: [i64; 2] = [9, 13];
/// Lines of the header of dataset 58, after the line of its number.
const HEADER_LINES: usize = 11;
/// Longest line of a dataset, bytes.
const LINE: u64 = 80;
/// Kinds of elements in dataset 2412 that have a line with their orientation: rod, linear, tapered, curved and parabolic beam.
const RODS_AND_BEAMS: [i64; 5] = [11, 21, 22, 23, 24];
/// Kinds of faces: plane stress and strain, plates, membranes, axisymmetric solids, thin shells.
const FACES: RangeInclusive<i64> = 41..=98;
/// Kinds of solids of first order with their numbers of nodes, and their edges: tetrahedron, wedge, brick.
const SOLIDS: [(i64, usize, &[[usize; 2]]); 3] = [
    (111, 4, &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]),
    (112, 6, &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]]),
    (115, 8, &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]),
];
/// Names of the directions 1 to 3.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Largest difference of two responses' frequencies, in steps.
const SAME_FREQUENCY: f64 = 1e-3;
/// Largest difference of two listed steps, relative.
const SAME_STEP: f64 = 0.01;

/// The quantity that measured responses are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredQuantity {
    /// Accelerations over forces, (m/s²)/N.
    Acceleration,
    /// Velocities over forces, (m/s)/N.
    Velocity,
    /// Displacements over forces, m/N.
    Displacement,
}

/// A measured frequency response, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredResponse {
    /// Degree of freedom of the force, such as `node4.y`.
    pub force: String,
    /// Degree of freedom of the response.
    pub response: String,
    /// Values at the frequencies of the set.
    pub values: Vec<Complex<f64>>,
}

/// The frequency responses of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredResponses {
    /// File that they were read from.
    pub path: PathBuf,
    /// What the responses are.
    pub quantity: MeasuredQuantity,
    /// Frequencies of the lines, Hz, equally spaced.
    pub frequency_hz: Vec<f64>,
    /// Responses in the order of the file.
    pub responses: Vec<MeasuredResponse>,
    /// Number of functions that are no frequency responses, such as spectra and coherences, and were left out.
    pub others: usize,
    /// Positions of the file's nodes by their names, such as `node4`, m.
    pub positions_m: BTreeMap<String, [f64; 3]>,
    /// Lines through nodes that have positions: first the trace lines, then the edges of elements, each once.
    pub lines: Vec<Vec<String>>,
}

/// Reason why the responses of a file can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResponsesError {
    /// The file can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// File that was read.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file has no frequency response.
    #[error("{} has no frequency response (dataset 58 of function type 4); it has {content}: export the measured responses over a force from the program that made it", path.display())]
    None {
        /// File that was read.
        path: PathBuf,
        /// What is in it.
        content: String,
    },
    /// A dataset can't be used.
    #[error("{}, frequency response {number}: {fault}", path.display())]
    Function {
        /// File that was read.
        path: PathBuf,
        /// Number of the response in the file, from 1.
        number: usize,
        /// What is wrong with it, with the values.
        fault: ResponseFault,
    },
    /// A dataset does not end where it should.
    #[error("{}: dataset {dataset} {problem}", path.display())]
    End {
        /// File that was read.
        path: PathBuf,
        /// Number of the dataset.
        dataset: String,
        /// What is wrong with its end, and what to do.
        problem: &'static str,
    },
    /// A node or a line can't be read.
    #[error("{}, dataset {dataset}: {fault}", path.display())]
    Geometry {
        /// File that was read.
        path: PathBuf,
        /// Number of the dataset.
        dataset: String,
        /// What is wrong with it, with the values.
        fault: ResponseFault,
    },
    /// The units are not positive.
    #[error("{}: dataset 164 has {length} units in a metre and {force} in a newton: both must be positive", path.display())]
    Units {
        /// File that was read.
        path: PathBuf,
        /// Units of the file in a metre.
        length: f64,
        /// Units of the file in a newton.
        force: f64,
    },
}

/// What is wrong with a frequency response.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ResponseFault {
    /// A number, or the numbers of a line, can't be read.
    #[error("{what} is `{got}`: expected {expected}")]
    Numbers {
        /// What was read there, in words.
        what: &'static str,
        /// What is in its place.
        got: String,
        /// Numbers that belong there, in words.
        expected: &'static str,
    },
    /// An element has fewer nodes than stated.
    #[error("element {element} has {got} nodes, but its first line states {expected}")]
    Nodes {
        /// Number of the element.
        element: i64,
        /// Nodes that are there.
        got: usize,
        /// Nodes that are stated.
        expected: usize,
    },
    /// The values, or one of their axes, are of a kind that can't be used.
    #[error("its {what} {got}: expected {expected}")]
    Kind {
        /// What is of another kind, and what its number is called.
        what: &'static str,
        /// Number of the kind in the file.
        got: i64,
        /// Kinds that can be used with their numbers, and what to do.
        expected: &'static str,
    },
    /// The frequencies are not equally spaced.
    #[error("its frequencies have steps from {least} to {most} Hz: expected equal steps, so export it with an even spacing", least = rounded(.least, 6), most = rounded(.most, 6))]
    Uneven {
        /// Least step between two frequencies, Hz.
        least: f64,
        /// Largest step between two frequencies, Hz.
        most: f64,
    },
    /// A direction is a rotation.
    #[error("node {node} has the direction {got}: expected a translation, ±1 to ±3, or 0 of a scalar")]
    Direction {
        /// Number of the node in the file.
        node: i64,
        /// Number of the direction in the file.
        got: i64,
    },
    /// There are fewer values than stated.
    #[error("it has {got} numbers, but the header states {expected}")]
    Short {
        /// Numbers that are there.
        got: usize,
        /// Numbers of the header.
        expected: usize,
    },
    /// Its frequencies or its quantity differ from the first one's.
    #[error(
        "its {what} differ from those of the first response: expected the same in all, so export the others to another file"
    )]
    Differs {
        /// What differs between the datasets, in words.
        what: &'static str,
    },
}

/// Says whether a file begins as one in the Universal File Format: with a line that has the delimiter alone.
pub fn is_universal_file(path: &Path) -> bool {
    // Opening a pipe would wait for its writer.
    if !fs::metadata(path).is_ok_and(|metadata| metadata.is_file()) {
        return false;
    }
    let Ok(file) = fs::File::open(path) else { return false };
    let mut begin = Vec::new();
    if file.take(LINE).read_to_end(&mut begin).is_err() {
        return false;
    }
    let first = begin.split(|byte| *byte == b'\n').next().unwrap_or_default();
    first.trim_ascii() == DELIMITER.as_bytes()
}

/// Names of the function types of dataset 58, from 0.
const FUNCTIONS: [&str; 13] = [
    "unknown functions",
    "time responses",
    "auto spectra",
    "cross spectra",
    "frequency responses",
    "transmissibilities",
    "coherences",
    "auto correlations",
    "cross correlations",
    "power spectral densities",
    "energy spectral densities",
    "probability densities",
    "spectra",
];

/// What a file has beside frequency responses.
#[derive(Default)]
struct Others {
    /// Number of functions of each type.
    functions: BTreeMap<usize, usize>,
    /// Numbers of the other datasets.
    datasets: Vec<String>,
}

impl Others {
    fn text(&self) -> String {
        let name = |kind: usize| FUNCTIONS.get(kind).copied().unwrap_or("other functions");
        let functions: Vec<String> =
            self.functions.iter().map(|(kind, count)| format!("{} ({count})", name(*kind))).collect();
        match (functions.is_empty(), self.datasets.is_empty()) {
            (false, _) => functions.join(", "),
            (true, false) => {
                let has_shapes = self.datasets.iter().any(|dataset| matches!(dataset.as_str(), "55" | "2414"));
                // Such a file may be what was meant for a structure.
                let hint = if has_shapes { " (mode shapes: name it as `file` of a modal structure)" } else { "" };
                format!("the datasets {}{hint}", self.datasets.join(", "))
            }
            (true, true) => String::from("no datasets"),
        }
    }
}

/// Reads the frequency responses of a file.
///
/// # Errors
/// [`ResponsesError`] if the file can't be read, has no frequency response, or one that can't be used with the others.
pub fn read_responses(path: &Path) -> Result<MeasuredResponses, ResponsesError> {
    let bytes = fs::read(path).map_err(|source| ResponsesError::Read { path: path.to_owned(), source })?;
    responses_of(&bytes, path)
}

/// Reads the frequency responses in the bytes of a file; errors name its path.
///
/// # Errors
/// [`ResponsesError`] if the file has no frequency response, or one that can't be used with the others.
pub fn responses_of(bytes: &[u8], path: &Path) -> Result<MeasuredResponses, ResponsesError> {
    let mut lines = Lines { bytes };
    let mut found: Option<MeasuredResponses> = None;
    let mut units = Units { length: 1.0, force: 1.0 };
    let mut number = 0;
    let mut others = Others::default();
    let mut nodes = BTreeMap::new();
    let mut traces = Vec::new();
    let mut edges = BTreeSet::new();
    while let Some(line) = lines.next() {
        if line.trim() != DELIMITER {
            continue;
        }
        let Some(head) = lines.next() else { break };
        let words: Vec<&str> = head.split_whitespace().collect();
        let dataset = words.first().copied().unwrap_or_default();
        if !matches!(dataset, "58" | "58b") {
            let body = String::from_utf8_lossy(lines.end(path, dataset)?);
            let geometry =
                |fault| ResponsesError::Geometry { path: path.to_owned(), dataset: dataset.to_owned(), fault };
            match dataset {
                "15" => add_nodes(&mut nodes, body.lines(), units).map_err(geometry)?,
                // The position of a node is in the line after it.
                "2411" => {
                    let rows: Vec<&str> = body.lines().collect();
                    let joined: Vec<String> = rows.chunks(2).map(|pair| pair.join(" ")).collect();
                    add_nodes(&mut nodes, joined.iter().map(String::as_str), units).map_err(geometry)?;
                }
                "82" => add_traces(&mut traces, &body).map_err(geometry)?,
                "2412" => add_edges(&mut edges, &body).map_err(geometry)?,
                "164" => units = Units::read(path, &body)?,
                _ => {}
            }
            if !others.datasets.iter().any(|known| known == dataset) {
                others.datasets.push(dataset.to_owned());
            }
            continue;
        }
        let header: Vec<String> = (0..HEADER_LINES).map_while(|_| lines.next()).collect();
        let binary = (dataset == "58b").then(|| words[1..].to_vec());
        let body = match &binary {
            Some(words) => lines.binary(path, dataset, words.get(3).and_then(|word| word.parse().ok()).unwrap_or(0))?,
            None => lines.end(path, dataset)?,
        };
        let kind = field(&header, 5, 0..5).trim().parse().unwrap_or(0);
        if kind != FREQUENCY_RESPONSE {
            *others.functions.entry(kind).or_default() += 1;
            continue;
        }
        number += 1;
        let of = |fault| ResponsesError::Function { path: path.to_owned(), number, fault };
        let (quantity, frequency_hz, response) =
            function(&header, body, binary.as_deref(), units.force / units.length).map_err(of)?;
        match &mut found {
            None => {
                found = Some(MeasuredResponses {
                    path: path.to_owned(),
                    quantity,
                    frequency_hz,
                    responses: vec![response],
                    others: 0,
                    positions_m: BTreeMap::new(),
                    lines: Vec::new(),
                });
            }
            Some(found) => {
                if quantity != found.quantity {
                    return Err(of(ResponseFault::Differs { what: "quantities" }));
                }
                if !are_same(&frequency_hz, &found.frequency_hz) {
                    return Err(of(ResponseFault::Differs { what: "frequencies" }));
                }
                found.responses.push(response);
            }
        }
    }
    let found = found.ok_or_else(|| ResponsesError::None { path: path.to_owned(), content: others.text() })?;
    traces.extend(edges.into_iter().map(Vec::from));
    let name_of = |node: i64| format!("node{node}");
    let drawn = |line: &Vec<i64>| -> Vec<String> {
        line.iter().filter(|node| nodes.contains_key(*node)).map(|node| name_of(*node)).collect()
    };
    Ok(MeasuredResponses {
        others: others.functions.values().sum(),
        lines: traces.iter().map(drawn).filter(|line| line.len() > 1).collect(),
        positions_m: nodes.iter().map(|(node, position)| (name_of(*node), *position)).collect(),
        ..found
    })
}

/// Units of a file in a metre and in a newton.
#[derive(Clone, Copy)]
struct Units {
    length: f64,
    force: f64,
}

impl Units {
    /// Reads the body of dataset 164.
    fn read(path: &Path, body: &str) -> Result<Units, ResponsesError> {
        let factors = body.lines().nth(1).and_then(|line| numbers(line, "the units").ok()).unwrap_or_default();
        let length = factors.first().copied().unwrap_or(0.0);
        let force = factors.get(1).copied().unwrap_or(0.0);
        if length > 0.0 && force > 0.0 {
            Ok(Units { length, force })
        } else {
            Err(ResponsesError::Units { path: path.to_owned(), length, force })
        }
    }
}

/// Adds the positions of nodes, from lines of a node's number, two coordinate systems, a colour and three coordinates.
fn add_nodes<'a>(
    nodes: &mut BTreeMap<i64, [f64; 3]>,
    lines: impl Iterator<Item = &'a str>,
    units: Units,
) -> Result<(), ResponseFault> {
    for line in lines.filter(|line| !line.trim().is_empty()) {
        let [node, _, _, _, x, y, z] = numbers(line, "a node")?[..] else {
            let expected = "its number, two coordinate systems, a colour and three coordinates";
            return Err(ResponseFault::Numbers { what: "a node", got: line.trim().to_owned(), expected });
        };
        nodes.insert(node as i64, [x, y, z].map(|value| value / units.length));
    }
    Ok(())
}

/// Adds the lines of dataset 82: the number of nodes in the first line, a text, the nodes. A node 0 ends a line.
fn add_traces(traces: &mut Vec<Vec<i64>>, body: &str) -> Result<(), ResponseFault> {
    let nodes = body.lines().skip(2).map(|line| numbers(line, "a node of a line")).collect::<Result<Vec<_>, _>>()?;
    let nodes: Vec<i64> = nodes.concat().iter().map(|node| *node as i64).collect();
    traces.extend(nodes.split(|node| *node == 0).filter(|line| line.len() > 1).map(<[i64]>::to_vec));
    Ok(())
}

/// Adds the edges of the elements of dataset 2412, as the lower node and the higher one. An element has a line with its number,
/// kind, properties, colour and number of nodes; of a rod or beam a line with its orientation; and its nodes.
fn add_edges(edges: &mut BTreeSet<[i64; 2]>, body: &str) -> Result<(), ResponseFault> {
    let mut lines = body.lines().filter(|line| !line.trim().is_empty());
    while let Some(line) = lines.next() {
        let [element, kind, _, _, _, count] = numbers(line, "an element")?[..] else {
            let expected = "its number, its kind, two properties, a colour and the number of its nodes";
            return Err(ResponseFault::Numbers { what: "an element", got: line.trim().to_owned(), expected });
        };
        let element = element as i64;
        let kind = kind as i64;
        let expected = count as usize;
        if RODS_AND_BEAMS.contains(&kind) {
            lines.next();
        }
        let mut nodes: Vec<i64> = Vec::new();
        while nodes.len() < expected {
            let Some(line) = lines.next() else {
                return Err(ResponseFault::Nodes { element, got: nodes.len(), expected });
            };
            nodes.extend(numbers(line, "a node of an element")?.iter().map(|node| *node as i64));
        }
        nodes.truncate(expected);
        let mut add = |a: usize, b: usize| {
            let ends = [nodes[a], nodes[b]];
            // With the lower node first, the edge that two elements share is one line.
            edges.insert([ends[0].min(ends[1]), ends[0].max(ends[1])]);
        };
        match kind {
            kind if RODS_AND_BEAMS.contains(&kind) || expected == 2 => (1..expected).for_each(|k| add(k - 1, k)),
            // The nodes go around the face, those within its edges among them.
            kind if FACES.contains(&kind) => (0..expected).for_each(|k| add(k, (k + 1) % expected)),
            _ => {
                let solid = SOLIDS.iter().find(|(of, count, _)| *of == kind && *count == expected);
                solid.iter().flat_map(|(.., edges)| *edges).for_each(|[a, b]| add(*a, *b));
            }
        }
    }
    Ok(())
}

/// Lines of a file that may have binary parts.
struct Lines<'a> {
    bytes: &'a [u8],
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<String> {
        if self.bytes.is_empty() {
            return None;
        }
        let end = self.bytes.iter().position(|byte| *byte == b'\n').unwrap_or(self.bytes.len());
        let line = String::from_utf8_lossy(&self.bytes[..end]).into_owned();
        self.bytes = &self.bytes[(end + 1).min(self.bytes.len())..];
        Some(line)
    }

    /// Returns binary values of this length, in bytes. Some programs count the end of a line that follows, and some write none,
    /// so the delimiter is searched about the stated end.
    fn binary(&mut self, path: &Path, dataset: &str, length: usize) -> Result<&'a [u8], ResponsesError> {
        let bytes = self.bytes;
        let mut near = length.saturating_sub(SLACK)..=length.saturating_add(SLACK);
        let is_end = |at: &usize| bytes.get(*at..).is_some_and(|rest| rest.starts_with(b"    -1"));
        let Some(end) = near.find(is_end) else {
            let problem = "is binary, and does not end where its first line states: export it anew, or as ASCII";
            return Err(ResponsesError::End { path: path.to_owned(), dataset: dataset.to_owned(), problem });
        };
        self.bytes = &bytes[end..];
        self.next();
        Ok(&bytes[..end.min(length)])
    }

    /// Returns the bytes up to the line with the delimiter that ends a dataset.
    fn end(&mut self, path: &Path, dataset: &str) -> Result<&'a [u8], ResponsesError> {
        let start = self.bytes;
        while !self.bytes.is_empty() {
            let before = start.len() - self.bytes.len();
            if self.next().is_some_and(|line| line.trim() == DELIMITER) {
                return Ok(&start[..before]);
            }
        }
        let problem = "has no end: the file is cut off";
        Err(ResponsesError::End { path: path.to_owned(), dataset: dataset.to_owned(), problem })
    }
}

/// Returns the characters of a line of the header in these columns.
fn field(header: &[String], line: usize, columns: Range<usize>) -> String {
    header.get(line).map_or(String::new(), |line| line.chars().skip(columns.start).take(columns.len()).collect())
}

/// Reads a number of the header.
fn number<T: FromStr>(header: &[String], line: usize, columns: Range<usize>) -> Result<T, ResponseFault> {
    let text = field(header, line, columns);
    // FORTRAN marks the exponent of double precision by D.
    let number = text.trim().replace(['D', 'd'], "E").parse();
    number.map_err(|_| not_a_number("a number of the header", text.trim()))
}

fn not_a_number(what: &'static str, got: &str) -> ResponseFault {
    ResponseFault::Numbers { what, got: got.to_owned(), expected: "a number" }
}

/// Reads the numbers of a line. In full columns a sign separates two of them.
fn numbers(line: &str, what: &'static str) -> Result<Vec<f64>, ResponseFault> {
    let mut found = Vec::new();
    for word in line.split_whitespace() {
        let word = word.replace(['D', 'd', 'e'], "E");
        let mut start = 0;
        let signs =
            word.char_indices().skip(1).filter(|(at, c)| matches!(c, '+' | '-') && word.as_bytes()[at - 1] != b'E');
        for end in signs.map(|(at, _)| at).chain([word.len()]) {
            let got = &word[start..end];
            found.push(got.parse().map_err(|_| not_a_number(what, got))?);
            start = end;
        }
    }
    Ok(found)
}

fn are_same(one: &[f64], other: &[f64]) -> bool {
    let step = if let [first, second, ..] = one { second - first } else { 1.0 };
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| (a - b).abs() <= SAME_FREQUENCY * step)
}

/// Returns a degree of freedom and the sign of its direction.
fn dof(node: i64, direction: i64) -> Result<(String, f64), ResponseFault> {
    match direction {
        0 => Ok((format!("node{node}"), 1.0)),
        1..=3 | -3..=-1 => {
            let axis = AXES[direction.unsigned_abs() as usize - 1];
            Ok((format!("node{node}.{axis}"), direction.signum() as f64))
        }
        got => Err(ResponseFault::Direction { node, got }),
    }
}

/// Reads a frequency response: the quantity, the frequencies, the values in SI units.
fn function(
    header: &[String],
    body: &[u8],
    binary: Option<&[&str]>,
    scale: f64,
) -> Result<(MeasuredQuantity, Vec<f64>, MeasuredResponse), ResponseFault> {
    // Line 6: function, then twice a name, a node and a direction: 2(I5, I10), 2(1X, A10, I10, I4).
    let (response, own_sign) = dof(number(header, 5, 41..51)?, number(header, 5, 51..55)?)?;
    let (force, other_sign) = dof(number(header, 5, 66..76)?, number(header, 5, 76..80)?)?;
    // Line 7: 3 I10, 3 E13.5. Lines 8 to 10: I10.
    let kind = number(header, 6, 0..10)?;
    let count = usize::try_from(number::<i64>(header, 6, 10..20)?).unwrap_or(0);
    // Without equal steps each value has its frequency before it.
    let is_listed = number::<i64>(header, 6, 20..30)? != 1;
    let numbers_of_value = if is_listed { 3 } else { 2 };
    let first_hz = number(header, 6, 30..43)?;
    let step_hz = number(header, 6, 43..56)?;
    let is_double = match kind {
        5 => false,
        6 => true,
        got => {
            let expected = "complex numbers, 5 or 6, so export real and imaginary part";
            return Err(ResponseFault::Kind { what: "values have the type", got, expected });
        }
    };
    let got = number(header, 7, 0..10)?;
    if got != FREQUENCY {
        return Err(ResponseFault::Kind { what: "abscissa has the data type", got, expected: "frequency, 18" });
    }
    let got = number(header, 8, 0..10)?;
    let quantity = QUANTITIES.into_iter().find(|(of, _)| *of == got).map(|(_, quantity)| quantity);
    let expected =
        "displacement, velocity or acceleration, 8, 11 or 12 in record 9; export it with the channel's quantity";
    let quantity = quantity.ok_or(ResponseFault::Kind { what: "response has the data type", got, expected })?;
    let got = number(header, 9, 0..10)?;
    if !FORCES.contains(&got) {
        let expected = "a force, 13 in record 10; export it with the channel's quantity";
        return Err(ResponseFault::Kind { what: "reference has the data type", got, expected });
    }
    let parts = match binary {
        Some(words) => binary_numbers(body, words, is_double)?,
        None => {
            let text = String::from_utf8_lossy(body);
            let lines = text.lines().map(|line| numbers(line, "a value"));
            lines.collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    let expected = count.saturating_mul(numbers_of_value);
    if parts.len() < expected {
        return Err(ResponseFault::Short { got: parts.len(), expected });
    }
    // A direction against its axis reverses the sign of the response. Of the force and the response together, the two
    // cancel.
    let factor = scale * own_sign * other_sign;
    let rows = || parts.chunks_exact(numbers_of_value).take(count);
    let complex = |row: &[f64]| Complex::new(row[numbers_of_value - 2], row[numbers_of_value - 1]) * factor;
    let values = rows().map(complex).collect();
    let (first_hz, step_hz) = if is_listed {
        let listed: Vec<f64> = rows().map(|row| row[0]).collect();
        first_and_step(&listed)?
    } else {
        (first_hz, step_hz)
    };
    let frequency_hz = (0..count).map(|line| first_hz + step_hz * line as f64).collect();
    Ok((quantity, frequency_hz, MeasuredResponse { force, response, values }))
}

/// Returns the first of listed frequencies and their step. They are written with few digits, so the step is that of both ends.
fn first_and_step(listed_hz: &[f64]) -> Result<(f64, f64), ResponseFault> {
    let [first, .., last] = listed_hz else { return Ok((listed_hz.first().copied().unwrap_or(0.0), 0.0)) };
    let steps = || listed_hz.windows(2).map(|pair| pair[1] - pair[0]);
    let least = steps().fold(f64::INFINITY, f64::min);
    let most = steps().fold(f64::NEG_INFINITY, f64::max);
    if most - least <= SAME_STEP * most {
        Ok((*first, (last - first) / (listed_hz.len() - 1) as f64))
    } else {
        Err(ResponseFault::Uneven { least, most })
    }
}

/// Reads binary numbers; the line of the dataset's number states the order of their bytes (1 little, 2 big) and their format.
fn binary_numbers(body: &[u8], words: &[&str], is_double: bool) -> Result<Vec<f64>, ResponseFault> {
    let stated = |place: usize| words.get(place).and_then(|word| word.parse::<i64>().ok()).unwrap_or(0);
    if stated(1) != 2 {
        let what = "binary numbers have the format";
        let got = stated(1);
        return Err(ResponseFault::Kind { what, got, expected: "IEEE 754, 2" });
    }
    let is_big = stated(0) == 2;
    let single = |bytes: &[u8]| {
        let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
        f64::from(if is_big { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) })
    };
    let double = |bytes: &[u8]| {
        let bytes = core::array::from_fn(|place| bytes[place]);
        if is_big { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) }
    };
    Ok(if is_double { body.chunks_exact(8).map(double).collect() } else { body.chunks_exact(4).map(single).collect() })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A response at three frequencies, in ASCII, as the layout of dataset 58 has it.
    fn file() -> String {
        let names = "NONE\n".repeat(5);
        let dofs = format!("{:5}{:10}{:5}{:10} {:10}{:10}{:4} {:10}{:10}{:4}", 4, 1, 0, 0, "NONE", 2, 1, "NONE", 1, -1);
        let steps = format!("{:10}{:10}{:10}{:13}{:13}{:13}", 6, 3, 1, "1.0e+01", "5.0e-01", "0.0e+00");
        let axes = [18, 12, 13, 0].map(|kind| format!("{kind:10}{:5}{:5}{:5} {:20} {:20}\n", 0, 0, 0, "NONE", "NONE"));
        let values = "  1.0e+00  2.0e+00  3.0e+00  4.0e+00\n  5.0e+00  6.0e+00\n";
        format!("    -1\n    58\n{names}{dofs}\n{steps}\n{}{values}    -1\n", axes.concat())
    }

    /// A node in a line, and one in two lines; a rod between them, which has a line for its orientation; units of mm.
    const GEOMETRY: &str = "    -1
   164
         1  mm, N                     2
  1.00000000000000000D+03  1.00000000000000000D+00  1.00000000000000000D+00
  0.00000000000000000D+00
    -1
    -1
    15
         1         0         0         1  1.00000E+02-2.50000E+01  0.00000E+00
    -1
    -1
  2411
         2         0         0         1
   2.0000000000000000D+02  -1.0000000000000000D+00   5.0000000000000000D+01
    -1
    -1
  2412
         7        11         1         1         7         2
         0         1         1
         2         1
    -1
";

    #[test]
    fn geometry_is_read_in_metres() {
        let found = responses_of([GEOMETRY, &file()].concat().as_bytes(), Path::new("rod.uff")).unwrap();
        let expected = [("node1", [0.1, -0.025, 0.0]), ("node2", [0.2, -0.001, 0.05])];
        assert_eq!(found.positions_m, expected.map(|(node, at)| (node.to_owned(), at)).into());
        assert_eq!(found.lines, [["node1", "node2"]]);
        // In units of N per mm the response is a thousandth.
        assert_eq!(found.responses[0].values[2], Complex::new(-5.0, -6.0) / 1000.0);
    }

    /// A square and four triangles of a mesh that another program wrote, and elements of other kinds on its nodes. Each edge is
    /// there once; an edge to a node without a position is left out.
    #[test]
    fn elements_have_their_edges_as_lines() {
        let mesh = include_str!("../../../tests/oracles/pyuff/mesh_test_uff2412_mixed.uff");
        let lines = |text: &str| {
            let found = responses_of([text, &file()].concat().as_bytes(), Path::new("mesh.uff")).unwrap();
            let ends = |line: &Vec<String>| line.iter().map(|node| node[4..].parse().unwrap()).collect::<Vec<i64>>();
            found.lines.iter().map(ends).collect::<Vec<_>>()
        };
        let around = [[3, 4], [3, 6], [3, 11], [4, 5], [4, 11], [5, 6], [5, 11], [6, 11]];
        assert_eq!(lines(mesh), around);
        let with =
            |rows: &str| mesh.replacen("    -1\n    -1\n  2412\n", &format!("    -1\n    -1\n  2412\n{rows}"), 1);
        let diagonal = [&around[..1], &[[3, 5]], &around[1..]].concat();
        let beam = "  9 24 1 1 7 3\n  0 1 1\n  3 5 1\n";
        let spring = "  9 136 1 1 7 2\n  5 3\n";
        let parabolic_solid = "  9 118 1 1 7 10\n  1 2 3 4 5 6 7 8\n  9 10\n";
        assert_eq!(lines(&with(beam)), diagonal);
        assert_eq!(lines(&with(spring)), diagonal);
        assert_eq!(lines(&with(parabolic_solid)), around);
        let tetrahedron = "  9 111 1 1 7 4\n  3 4 5 11\n";
        assert_eq!(lines(&with(tetrahedron)).len(), around.len() + 1);
        let fails = |rows: &str| responses_of(with(rows).as_bytes(), Path::new("mesh.uff")).unwrap_err().to_string();
        insta::assert_snapshot!(fails("  9 44 1 1 7\n"), @"mesh.uff, dataset 2412: an element is `9 44 1 1 7`: expected its number, its kind, two properties, a colour and the number of its nodes");
        insta::assert_snapshot!(fails("  9 44 1 1 7 4 x\n"), @"mesh.uff, dataset 2412: an element is `x`: expected a number");
        insta::assert_snapshot!(fails("  9 44 1 1 7 400\n"), @"mesh.uff, dataset 2412: element 9 has 46 nodes, but its first line states 400");
    }

    #[test]
    fn a_direction_against_an_axis_changes_the_sign() {
        let found = responses_of(file().as_bytes(), Path::new("three.uff")).unwrap();
        assert_eq!(found.frequency_hz, [10.0, 10.5, 11.0]);
        let [MeasuredResponse { force, response, values }] = &found.responses[..] else { panic!("{found:?}") };
        assert_eq!((force.as_str(), response.as_str()), ("node1.x", "node2.x"));
        assert_eq!(values[2], Complex::new(-5.0, -6.0));
    }

    proptest! {
        /// Damaged files are read or refused, and never end the program.
        #[test]
        fn damaged_files_do_no_harm(at in any::<prop::sample::Index>(), byte in any::<u8>(), length in 0_usize..3000) {
            let mut bytes = [GEOMETRY, &file()].concat().into_bytes();
            let place = at.index(bytes.len());
            let whole = bytes.len();
            bytes[place] = byte;
            bytes.truncate(length);
            let cut = bytes.len() < whole - 8;
            let found = responses_of(&bytes, Path::new("damaged.uff"));
            prop_assert!(!cut || found.is_err());
        }

        #[test]
        fn any_bytes_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut file = b"    -1\n   58b     1     2    11        48\n".to_vec();
            file.extend(bytes);
            let _ = responses_of(&file, Path::new("any.uff"));
        }
    }
}
