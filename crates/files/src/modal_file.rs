//! Writes identified modes in the Universal File Format, in ASCII (SDRC 1988; the University of Cincinnati keeps the layouts at
//! ceas3.uc.edu/sdrluff): datasets 151, header; 164, units, SI; 15, nodes; 82, trace lines; 55, complex mode shapes; 58, the
//! measured frequency responses.
//!
//! Dataset 55 has analysis type 3, complex eigenvalue, with the pole λ = σ + jω in place of frequency and damping ratio. Its
//! modal A is a = φᵀ(2λM + C)φ: 2jω for a shape φ of the modal mass 1 kg; modal B is −λa. Both are 0, which stands for unknown,
//! for a shape without a scale.
//!
//! Numbers of dataset 15 and 55 are in columns of 13 characters, with 6 to 11 digits; values of 58 have 13 digits.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

use nalgebra::Complex;

use crate::responses::MeasuredQuantity;
use crate::staged::write_whole;
use crate::universal::{DELIMITER, NONE, axis, e20, in_13, units, words80};

/// Specific data types of dataset 58: frequency, force.
const FREQUENCY: u32 = 18;
const FORCE: u32 = 13;
/// Complex values in a line of dataset 58.
const IN_LINE: usize = 2;
/// Nodes in a line of dataset 82, and in one trace line.
const NODES_IN_LINE: usize = 8;
const NODES_IN_TRACE: usize = 250;
/// Prefix of points that were nodes of a file.
const NODE: &str = "node";

/// Modes and what they were identified from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModalFile {
    /// Name of the model: that of the structure or of the file.
    pub title: String,
    /// Positions of the points, m. Points without a position are written at the origin.
    pub positions_m: BTreeMap<String, [f64; 3]>,
    /// Lines through points that have positions.
    pub lines: Vec<Vec<String>>,
    /// Degrees of freedom of the shapes, such as `tip.x`.
    pub at: Vec<String>,
    /// Modes by rising frequency.
    pub modes: Vec<FileMode>,
    /// The frequency responses that were measured.
    pub responses: Vec<FileResponse>,
}

/// A mode that was identified, as the file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct FileMode {
    /// Pole λ of the mode, rad/s; its real part is negative.
    pub pole_rad_s: Complex<f64>,
    /// Components at the degrees of freedom of the file, 1/√kg for the modal mass 1 kg, or without a scale; `None` where it is
    /// unknown.
    pub shape: Vec<Option<Complex<f64>>>,
    /// Modal mass of the shape that is 1 at the driving point, kg; `None` of a shape without a scale.
    pub modal_mass_kg: Option<f64>,
}

/// A measured frequency response at equally spaced frequencies.
#[derive(Clone, Debug, PartialEq)]
pub struct FileResponse {
    /// Degree of freedom of the response.
    pub response: String,
    /// Degree of freedom of the force.
    pub force: String,
    /// What the response is.
    pub quantity: MeasuredQuantity,
    /// First frequency and step, Hz.
    pub first_and_step_hz: [f64; 2],
    /// Values in SI units.
    pub values: Vec<Complex<f64>>,
}

/// Divides the name of a degree of freedom into its point and the number of its direction, 0 of one that is along no axis, such
/// as an oblique force.
fn point_of(dof: &str) -> (&str, i32) {
    match dof.rsplit_once('.') {
        Some((point, "x")) => (point, 1),
        Some((point, "y")) => (point, 2),
        Some((point, "z")) => (point, 3),
        _ => (dof.split('.').next().unwrap_or(dof), 0),
    }
}

fn by_number<'a>(nodes: &BTreeMap<&'a str, u32>) -> Vec<(u32, &'a str)> {
    let mut sorted: Vec<(u32, &str)> = nodes.iter().map(|(point, number)| (*number, *point)).collect();
    sorted.sort_unstable();
    sorted
}

impl ModalFile {
    /// Returns a degree of freedom of the shapes that is along no axis: a file can't hold it.
    pub fn without_axis(&self) -> Option<&str> {
        self.at.iter().map(String::as_str).find(|dof| point_of(dof).1 == 0)
    }

    /// Writes the file, replacing an existing one when the new one is whole. Components of shapes that are along no axis are left
    /// out ([`without_axis`](Self::without_axis)).
    ///
    /// # Errors
    /// The error of the operating system.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let mut out = Vec::new();
        self.write_to(&mut out)?;
        write_whole(path, &out)
    }

    fn write_to(&self, out: &mut impl Write) -> io::Result<()> {
        let nodes = self.nodes();
        self.header(out, &nodes)?;
        units(out)?;
        self.write_nodes(out, &nodes)?;
        self.write_lines(out, &nodes)?;
        (1..).zip(&self.modes).try_for_each(|(number, mode)| self.write_mode(out, &nodes, number, mode))?;
        (1..).zip(&self.responses).try_for_each(|(number, response)| response.write_to(out, &nodes, number))
    }

    /// Returns the number of each point in the file, from 1: in the order of the shapes' degrees of freedom, then of the
    /// responses', then of the positions. Points that were nodes of a file keep their numbers, and the others follow.
    pub fn nodes(&self) -> BTreeMap<&str, u32> {
        let of_shapes = self.at.iter().map(|dof| point_of(dof).0);
        let of_responses = self.responses.iter().flat_map(|of| [point_of(&of.response).0, point_of(&of.force).0]);
        let mut points: Vec<&str> = Vec::new();
        for point in of_shapes.chain(of_responses).chain(self.positions_m.keys().map(String::as_str)) {
            if !points.contains(&point) {
                points.push(point);
            }
        }
        let own = |point: &&str| point.strip_prefix(NODE)?.parse::<u32>().ok().filter(|number| *number > 0);
        let mut nodes: BTreeMap<&str, u32> = points.iter().filter_map(|point| Some((*point, own(point)?))).collect();
        let first = nodes.values().copied().max().unwrap_or(0) + 1;
        let others = points.into_iter().filter(|point| own(point).is_none());
        nodes.extend((first..).zip(others).map(|(number, point)| (point, number)));
        nodes
    }

    fn header(&self, out: &mut impl Write, nodes: &BTreeMap<&str, u32>) -> io::Result<()> {
        let names: Vec<String> = by_number(nodes).iter().map(|(number, point)| format!("{number} {point}")).collect();
        writeln!(out, "{DELIMITER}\n{:6}{:74}", 151, "")?;
        writeln!(out, "{}\n{}", words80(&self.title), words80(&format!("nodes: {}", names.join(", "))))?;
        // The program that made the database, dates and times, which would make every file another one, and the program that
        // made the file.
        writeln!(out, "{:80}", "Resonarm")?;
        writeln!(out, "{:10}{:10}{:10}{:10}{:10}", "NONE", "NONE", 0, 0, 0)?;
        writeln!(out, "{:10}{:10}\n{:80}\n{:10}{:10}\n{DELIMITER}", "NONE", "NONE", "Resonarm", "NONE", "NONE")
    }

    fn write_nodes(&self, out: &mut impl Write, nodes: &BTreeMap<&str, u32>) -> io::Result<()> {
        writeln!(out, "{DELIMITER}\n{:6}{:74}", 15, "")?;
        for (number, point) in by_number(nodes) {
            let [x, y, z] = self.positions_m.get(point).copied().unwrap_or_default().map(in_13);
            writeln!(out, "{number:10}{:10}{:10}{:10}{x}{y}{z}", 0, 0, 1)?;
        }
        writeln!(out, "{DELIMITER}")
    }

    fn write_lines(&self, out: &mut impl Write, nodes: &BTreeMap<&str, u32>) -> io::Result<()> {
        let of_points =
            |line: &Vec<String>| line.iter().filter_map(|point| nodes.get(point.as_str()).copied()).collect();
        let lines: Vec<Vec<u32>> = self.lines.iter().map(of_points).collect();
        // A line that is too long is continued from its last node.
        let traces = lines.iter().flat_map(|line| {
            // Each trace begins with the last node of the one before, which is why the step is one less than the
            // length: else a piece of the line would be missing.
            let starts = (0..line.len().saturating_sub(1)).step_by(NODES_IN_TRACE - 1);
            starts.map(|start| &line[start..(start + NODES_IN_TRACE).min(line.len())])
        });
        for (number, trace) in (1..).zip(traces) {
            writeln!(out, "{DELIMITER}\n{:6}{:74}", 82, "")?;
            writeln!(out, "{number:10}{:10}{:10}\n{:80}", trace.len(), 1, "NONE")?;
            for row in trace.chunks(NODES_IN_LINE) {
                let row: String = row.iter().map(|node| format!("{node:10}")).collect();
                writeln!(out, "{row}")?;
            }
            writeln!(out, "{DELIMITER}")?;
        }
        Ok(())
    }

    fn write_mode(
        &self,
        out: &mut impl Write,
        nodes: &BTreeMap<&str, u32>,
        number: usize,
        mode: &FileMode,
    ) -> io::Result<()> {
        let FileMode { pole_rad_s, shape, modal_mass_kg } = mode;
        let size = libm::hypot(pole_rad_s.re, pole_rad_s.im);
        let frequency_hz = size / core::f64::consts::TAU;
        let damping_ratio = -pole_rad_s.re / size;
        let mass = modal_mass_kg.map_or(String::from("shape without a scale: its modal mass is unknown"), |mass_kg| {
            format!("modal mass 1 kg; {mass_kg:.6} kg of the shape that is 1 at the driving point")
        });
        let zero = Complex::new(0.0, 0.0);
        let modal_a = if modal_mass_kg.is_some() { Complex::new(0.0, 2.0 * pole_rad_s.im) } else { zero };
        writeln!(out, "{DELIMITER}\n{:6}{:74}", 55, "")?;
        writeln!(out, "{}", words80(&format!("mode {number}")))?;
        let pole = format!("pole frequency {frequency_hz:.6} Hz, damping ratio {damping_ratio:.6e}");
        writeln!(out, "{}\n{}\n{:80}\n{:80}", words80(&pole), words80(&mass), "NONE", "NONE")?;
        // A structure, complex eigenvalue, three translations, displacement, complex, three values at a node.
        writeln!(out, "{:10}{:10}{:10}{:10}{:10}{:10}", 1, 3, 2, 8, 5, 3)?;
        // Two whole and six real numbers: load case and number; pole, modal A, modal B.
        writeln!(out, "{:10}{:10}{:10}{number:10}", 2, 6, 0)?;
        writeln!(out, "{}", complex(&[*pole_rad_s, modal_a, -pole_rad_s * modal_a]))?;
        let mut at_nodes: BTreeMap<u32, [Complex<f64>; 3]> = BTreeMap::new();
        for (dof, value) in self.at.iter().zip(shape) {
            let (point, direction) = point_of(dof);
            let place = usize::try_from(direction - 1).ok();
            if let (Some(node), Some(place), Some(value)) = (nodes.get(point), place, value) {
                at_nodes.entry(*node).or_insert([zero; 3])[place] = *value;
            }
        }
        at_nodes.iter().try_for_each(|(node, values)| writeln!(out, "{node:10}\n{}", complex(values)))?;
        writeln!(out, "{DELIMITER}")
    }
}

/// Formats three complex numbers as a line of six numbers.
fn complex(values: &[Complex<f64>; 3]) -> String {
    // −0 + 0 is +0.
    values.iter().flat_map(|value| [value.re, value.im]).map(|part| in_13(part + 0.0)).collect()
}

impl FileResponse {
    fn write_to(&self, out: &mut impl Write, nodes: &BTreeMap<&str, u32>, number: usize) -> io::Result<()> {
        let dof = |name: &str| {
            let (point, direction) = point_of(name);
            format!(" {:10}{:10}{direction:4}", "NONE", nodes.get(point).copied().unwrap_or(0))
        };
        let (kind, label, unit) = match self.quantity {
            MeasuredQuantity::Acceleration => (12, "Acceleration", "m/s^2"),
            MeasuredQuantity::Velocity => (11, "Velocity", "m/s"),
            MeasuredQuantity::Displacement => (8, "Displacement", "m"),
        };
        writeln!(out, "{DELIMITER}\n{:6}{:74}", 58, "")?;
        writeln!(out, "{}", words80(&format!("{} over {}", self.response, self.force)))?;
        writeln!(out, "{0:80}\n{0:80}\n{0:80}\n{0:80}", "NONE")?;
        // A frequency response, its number, version and load case, its two degrees of freedom.
        writeln!(out, "{:5}{number:10}{:5}{:10}{}{}", 4, 0, 0, dof(&self.response), dof(&self.force))?;
        // Complex numbers of double precision at equal steps.
        let [first, step] = self.first_and_step_hz.map(in_13);
        writeln!(out, "{:10}{:10}{:10}{first}{step}{}", 6, self.values.len(), 1, in_13(0.0))?;
        axis(out, FREQUENCY, [0; 3], "Frequency", "Hz")?;
        axis(out, kind, [1, 0, 0], label, unit)?;
        axis(out, FORCE, [0, 1, 0], "Force", "N")?;
        axis(out, NONE, [0; 3], "NONE", "NONE")?;
        for row in self.values.chunks(IN_LINE) {
            let row: String = row.iter().flat_map(|value| [value.re, value.im]).map(e20).collect();
            writeln!(out, "{row}")?;
        }
        writeln!(out, "{DELIMITER}")
    }
}
