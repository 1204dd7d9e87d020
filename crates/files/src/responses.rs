//! Measured frequency responses in the Universal File Format: dataset 58, function at nodal degree of freedom, in ASCII or
//! binary (58b), with the units of dataset 164 (SDRC 1988; the University of Cincinnati keeps the layouts at
//! ceas3.uc.edu/sdrluff).
//!
//! Dataset 164 states how many units of the file make a metre, l, and a newton, f, for what follows it. A response over a force in
//! the file's units is multiplied by f/l.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use nalgebra::Complex;
use thiserror::Error;

/// Function type of frequency responses.
const FREQUENCY_RESPONSE: i64 = 4;
/// Specific data types: frequency; displacement, velocity, acceleration; reaction and excitation force.
const FREQUENCY: i64 = 18;
const QUANTITIES: [(i64, MeasuredQuantity); 3] =
    [(8, MeasuredQuantity::Displacement), (11, MeasuredQuantity::Velocity), (12, MeasuredQuantity::Acceleration)];
const FORCES: [i64; 2] = [9, 13];
/// Lines of the header of dataset 58, after the line of its number.
const HEADER_LINES: usize = 11;
/// Longest line, bytes.
const LINE: u64 = 80;
/// Names of the directions 1 to 3.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Largest difference of two responses' frequencies, in steps.
const SAME_FREQUENCY: f64 = 1e-3;

/// What responses are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredQuantity {
    /// Accelerations over forces.
    Acceleration,
    /// Velocities over forces.
    Velocity,
    /// Displacements over forces.
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
}

/// Reason why the responses of a file can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResponsesError {
    /// The file can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file has no frequency response.
    #[error("{} has no frequency response (dataset 58 of function type 4), but {others} other functions: expected measured responses over a force", path.display())]
    None {
        /// File.
        path: PathBuf,
        /// Number of other functions.
        others: usize,
    },
    /// A dataset can't be used.
    #[error("{}, frequency response {number}: {fault}", path.display())]
    Function {
        /// File.
        path: PathBuf,
        /// Number of the response in the file, from 1.
        number: usize,
        /// What is wrong.
        fault: ResponseFault,
    },
    /// A dataset has no end.
    #[error("{}: dataset {dataset} has no end: the file is cut off", path.display())]
    NoEnd {
        /// File.
        path: PathBuf,
        /// Number of the dataset.
        dataset: String,
    },
    /// The units are not positive.
    #[error("{}: dataset 164 has {length} units in a metre and {force} in a newton: both must be positive", path.display())]
    Units {
        /// File.
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
    /// A number can't be read.
    #[error("{what} is `{got}`: expected a number")]
    Number {
        /// What it is.
        what: &'static str,
        /// What is in its place.
        got: String,
    },
    /// The values are not complex.
    #[error("its values have the type {got}: expected complex numbers, 5 or 6")]
    Real {
        /// Ordinate data type.
        got: i64,
    },
    /// The frequencies are not equally spaced.
    #[error("its frequencies are listed one by one: expected equal steps")]
    Uneven,
    /// The abscissa is no frequency.
    #[error("its abscissa has the data type {got}: expected frequency, 18")]
    Abscissa {
        /// Specific data type.
        got: i64,
    },
    /// The response is no motion.
    #[error("its response has the data type {got}: expected displacement, velocity or acceleration, 8, 11 or 12")]
    Response {
        /// Specific data type.
        got: i64,
    },
    /// The reference is no force.
    #[error("its reference has the data type {got}: expected a force, 13")]
    Reference {
        /// Specific data type.
        got: i64,
    },
    /// A direction is a rotation.
    #[error("node {node} has the direction {got}: expected a translation, ±1 to ±3, or 0 of a scalar")]
    Direction {
        /// Node.
        node: i64,
        /// Direction.
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
    /// The binary format is none of IEEE.
    #[error("its binary numbers have the format {got}: expected IEEE 754, 2")]
    Format {
        /// Floating-point format.
        got: i64,
    },
    /// Its frequencies or its quantity differ from the first one's.
    #[error("its {what} differ from those of the first response: expected the same in all")]
    Differs {
        /// What differs.
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
    first.trim_ascii() == b"-1"
}

/// Reads the frequency responses of a file.
///
/// # Errors
/// [`ResponsesError`] if the file can't be read, has no frequency response, or one that can't be used with the others.
pub fn read_responses(path: &Path) -> Result<MeasuredResponses, ResponsesError> {
    let bytes = fs::read(path).map_err(|source| ResponsesError::Read { path: path.to_owned(), source })?;
    let mut lines = Lines { bytes: &bytes };
    let mut found: Option<MeasuredResponses> = None;
    let (mut scale, mut number, mut others) = (1.0, 0, 0);
    while let Some(line) = lines.next() {
        if line.trim() != "-1" {
            continue;
        }
        let Some(head) = lines.next() else { break };
        let words: Vec<&str> = head.split_whitespace().collect();
        let dataset = words.first().copied().unwrap_or_default();
        match dataset {
            "164" => {
                lines.next();
                let factors = numbers(&lines.next().unwrap_or_default(), "the units").unwrap_or_default();
                let (length, force) = (factors.first().copied().unwrap_or(0.0), factors.get(1).copied().unwrap_or(0.0));
                if !(length > 0.0 && force > 0.0) {
                    return Err(ResponsesError::Units { path: path.to_owned(), length, force });
                }
                scale = force / length;
                lines.end(path, dataset)?;
            }
            "58" | "58b" => {
                let header: Vec<String> = (0..HEADER_LINES).map_while(|_| lines.next()).collect();
                let binary = (dataset == "58b").then(|| words[1..].to_vec());
                let body = match &binary {
                    Some(words) => {
                        let count = words.get(3).and_then(|word| word.parse().ok()).unwrap_or(0);
                        let body = lines.take(count);
                        lines.end(path, dataset)?;
                        body
                    }
                    None => lines.end(path, dataset)?,
                };
                if field(&header, 5, 0..5).trim().parse() != Ok(FREQUENCY_RESPONSE) {
                    others += 1;
                    continue;
                }
                number += 1;
                let of = |fault| ResponsesError::Function { path: path.to_owned(), number, fault };
                let (quantity, frequency_hz, response) =
                    function(&header, body, binary.as_deref(), scale).map_err(of)?;
                match &mut found {
                    None => {
                        let path = path.to_owned();
                        let responses = vec![response];
                        found = Some(MeasuredResponses { path, quantity, frequency_hz, responses, others: 0 });
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
            _ => {
                lines.end(path, dataset)?;
            }
        }
    }
    let found = found.ok_or_else(|| ResponsesError::None { path: path.to_owned(), others })?;
    Ok(MeasuredResponses { others, ..found })
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

    fn take(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.bytes.split_at(count.min(self.bytes.len()));
        self.bytes = rest;
        taken
    }

    /// Returns the bytes up to the line with the delimiter that ends a dataset.
    fn end(&mut self, path: &Path, dataset: &str) -> Result<&'a [u8], ResponsesError> {
        let start = self.bytes;
        while !self.bytes.is_empty() {
            let before = start.len() - self.bytes.len();
            if self.next().is_some_and(|line| line.trim() == "-1") {
                return Ok(&start[..before]);
            }
        }
        Err(ResponsesError::NoEnd { path: path.to_owned(), dataset: dataset.to_owned() })
    }
}

/// Returns the characters of a line of the header in these columns.
fn field(header: &[String], line: usize, columns: core::ops::Range<usize>) -> String {
    header.get(line).map_or(String::new(), |line| line.chars().skip(columns.start).take(columns.len()).collect())
}

fn whole(
    header: &[String],
    line: usize,
    columns: core::ops::Range<usize>,
    what: &'static str,
) -> Result<i64, ResponseFault> {
    let text = field(header, line, columns);
    text.trim().parse().map_err(|_| ResponseFault::Number { what, got: text.trim().to_owned() })
}

fn real(
    header: &[String],
    line: usize,
    columns: core::ops::Range<usize>,
    what: &'static str,
) -> Result<f64, ResponseFault> {
    let text = field(header, line, columns);
    text.trim()
        .replace(['D', 'd'], "E")
        .parse()
        .map_err(|_| ResponseFault::Number { what, got: text.trim().to_owned() })
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
            let value = got.parse().map_err(|_| ResponseFault::Number { what, got: got.to_owned() })?;
            found.push(value);
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
    let what = "a number of the header";
    // Line 6: function, then twice a name, a node and a direction: 2(I5, I10), 2(1X, A10, I10, I4).
    let (response, own_sign) = dof(whole(header, 5, 41..51, what)?, whole(header, 5, 51..55, what)?)?;
    let (force, other_sign) = dof(whole(header, 5, 66..76, what)?, whole(header, 5, 76..80, what)?)?;
    // Line 7: 3 I10, 3 E13.5. Lines 8 to 10: I10.
    let kind = whole(header, 6, 0..10, what)?;
    let count = usize::try_from(whole(header, 6, 10..20, what)?).unwrap_or(0);
    if whole(header, 6, 20..30, what)? != 1 {
        return Err(ResponseFault::Uneven);
    }
    let (first_hz, step_hz) = (real(header, 6, 30..43, what)?, real(header, 6, 43..56, what)?);
    let is_double = match kind {
        5 => false,
        6 => true,
        got => return Err(ResponseFault::Real { got }),
    };
    match whole(header, 7, 0..10, what)? {
        FREQUENCY => {}
        got => return Err(ResponseFault::Abscissa { got }),
    }
    let got = whole(header, 8, 0..10, what)?;
    let quantity = QUANTITIES.into_iter().find(|(of, _)| *of == got).map(|(_, quantity)| quantity);
    let quantity = quantity.ok_or(ResponseFault::Response { got })?;
    let got = whole(header, 9, 0..10, what)?;
    if !FORCES.contains(&got) {
        return Err(ResponseFault::Reference { got });
    }
    let parts = match binary {
        Some(words) => binary_numbers(body, words, is_double)?,
        None => {
            let text = String::from_utf8_lossy(body);
            let lines = text.lines().map(|line| numbers(line, "a value"));
            lines.collect::<Result<Vec<_>, _>>()?.concat()
        }
    };
    if parts.len() < 2 * count {
        return Err(ResponseFault::Short { got: parts.len(), expected: 2 * count });
    }
    let factor = scale * own_sign * other_sign;
    let values = parts.chunks_exact(2).take(count).map(|pair| Complex::new(pair[0], pair[1]) * factor).collect();
    let frequency_hz = (0..count).map(|line| first_hz + step_hz * line as f64).collect();
    Ok((quantity, frequency_hz, MeasuredResponse { force, response, values }))
}

/// Reads binary numbers; the line of the dataset's number states the order of their bytes (1 little, 2 big) and their format.
fn binary_numbers(body: &[u8], words: &[&str], is_double: bool) -> Result<Vec<f64>, ResponseFault> {
    let stated = |place: usize| words.get(place).and_then(|word| word.parse::<i64>().ok()).unwrap_or(0);
    if stated(1) != 2 {
        return Err(ResponseFault::Format { got: stated(1) });
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
