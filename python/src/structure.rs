//! Chains and modal structures: modes, frequency responses, motion under a sine, branches of periodic responses.

use core::f64::consts::TAU;
use std::collections::BTreeMap;
use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};
use resonarm::analysis::LinearResponse;
use resonarm::analysis::Quantity;
use resonarm::drawing::Drawing;
use resonarm::integrate::Scheme;
use resonarm::scenario::Scenario;
use resonarm::scenario::structure::{Matrices, StructureSection, StructureSectionError};
use resonarm::structure::{
    self, BodySpec, ChainSpec, Channel, CoordinateUnit, Coordinates, Dof, Link, LoadHarmonic, StepError, StepLoad,
    Stepper, coordinate_channels, element_channel,
};
use toml::Value;

use crate::errors;
use crate::forced::Drive;
use crate::modes::{Mode, scheme};
use crate::rows::{Rows, numbers};
use crate::values;

/// The structure of `resonarm.Chain` and `resonarm.Modal`.
#[pyclass(frozen, subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Assembly {
    pub inner: structure::Assembly,
    /// Section `[structure]`, with the files that it names read in.
    section: StructureSection,
}

/// Steps between two looks for signals: some 20 ms of work.
const STEPS_A_LOOK: u64 = 1 << 15;

/// A vector of numbers in rows: its name, and the names of its components.
pub type Vector = (String, Vec<String>);

/// The names of points, lines from point to point, and places of the points, at rest and moved, m.
type Drawn = (Vec<String>, Vec<Vec<usize>>, Vec<[f64; 3]>, Vec<[f64; 3]>);

/// The vectors of channels that stand in order.
pub fn vectors(channels: &[Channel]) -> Vec<Vector> {
    let vector = |vector: &[Channel]| {
        (vector[0].vector.to_string(), vector.iter().map(|channel| channel.name.to_string()).collect())
    };
    channels.chunk_by(|one, next| one.vector == next.vector).map(vector).collect()
}

/// The section `[structure]` of matrices given as the bytes of arrays, mass, stiffness, damping, with degrees of
/// freedom and what moves with the base by their rows, and how many modes to keep.
#[pyfunction]
pub fn modes_of_matrices<'py>(
    py: Python<'py>,
    matrices: (Vec<u8>, Vec<u8>, Option<Vec<u8>>),
    dofs: BTreeMap<String, usize>,
    base: BTreeMap<String, Vec<usize>>,
    modes: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let (mass, stiffness, damping) = matrices;
    let mass = numbers(&mass);
    let stiffness = numbers(&stiffness);
    let damping = damping.as_deref().map(numbers);
    let matrices = Matrices { mass: &mass, stiffness: &stiffness, damping: damping.as_deref() };
    let section =
        py.detach(|| StructureSection::from_matrices(&matrices, &dofs, &base, modes)).map_err(errors::value)?;
    values::document(py, &section)
}

/// The section `[structure]` of the lowest modes of a structure, all if it is not said how many.
#[pyfunction]
pub fn modes_of_structure<'py>(
    py: Python<'py>,
    structure: &Assembly,
    modes: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    values::document(py, &StructureSection::from_modes(&structure.inner, modes).map_err(errors::value)?)
}

#[pymethods]
impl Assembly {
    /// The structure of the section `[structure]`.
    #[new]
    fn new(structure: &Bound<'_, PyDict>) -> PyResult<Assembly> {
        let mut sections = toml::Table::new();
        sections.insert(String::from("structure"), Value::Table(values::table("structure", structure)?));
        let mut scenario = Scenario::parse(&sections.to_string(), "the structure").map_err(errors::scenario)?;
        // There is no scenario file whose folder counts: paths are relative to the working directory.
        scenario.read_files(Path::new("")).map_err(errors::scenario)?;
        let section = scenario.structure;
        let inner = section.assembly().map_err(errors::value)?;
        let expected = 2 * inner.coordinates();
        match section.initial.len() {
            0 => {}
            got if got == expected => {}
            got => return Err(errors::value(StructureSectionError::Initial { got, expected })),
        }
        Ok(Assembly { inner, section })
    }

    /// The section `[structure]`, with the links or modes from files in it.
    #[getter]
    fn section<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::document(py, &self.section)
    }

    /// The names of all parameters, as `link2.mass_kg`, `mode1.damping_ratio` or `element1.gap_m`.
    #[getter]
    fn parameters(&self) -> Vec<String> {
        self.inner.parameters().iter().map(ToString::to_string).collect()
    }

    /// The value of a parameter, and its unit, empty if it has none.
    fn parameter(&self, name: &str) -> PyResult<(f64, &'static str)> {
        let parameter = self.inner.parameter(name).map_err(errors::value)?;
        Ok((self.inner.value(parameter).map_err(errors::value)?, parameter.unit()))
    }

    /// The links of a chain; of an arm those of the chain that moves as it does.
    #[getter]
    fn chain_links<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let links: &[Link] = self.chain().map_or(&[], |chain| chain.links.as_slice());
        values::document(py, &links)
    }

    /// The section without notes of the files that it is from.
    #[getter]
    fn numbers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::document(py, &self.section.without_source())
    }

    /// Acceleration of gravity along −y, m/s²; 0 without.
    #[getter]
    fn chain_gravity_m_s2(&self) -> f64 {
        self.chain().map_or(0.0, |chain| chain.gravity_m_s2)
    }

    /// The names of the points.
    #[getter]
    fn point_names(&self) -> Vec<String> {
        self.inner.points()
    }

    /// Degrees of freedom on which a load can act, and which can be read: point and axis, or a joint.
    #[getter]
    fn dofs(&self) -> Vec<String> {
        self.inner.dof_names()
    }

    /// The units of a displacement and of a load at a degree of freedom, which `name` calls in messages.
    fn units(&self, name: &str, dof: &str) -> PyResult<(&'static str, &'static str)> {
        Ok(if self.dof(name, dof)?.is_angle() { ("rad", "N·m") } else { ("m", "N") })
    }

    /// The vectors in rows of a motion: coordinates, rates, states of elements.
    fn channels(&self) -> Vec<Vector> {
        let of = match self.inner.coordinate_unit() {
            CoordinateUnit::Radian => Coordinates::Joints,
            CoordinateUnit::MetreRootKilogram => Coordinates::Modes,
        };
        let mut channels = coordinate_channels(of, self.inner.coordinates());
        let elements = self.inner.elements().iter().filter(|element| element.state.is_some());
        let channel = |element: &structure::Element| element_channel(element.number - 1, element.at.is_angle());
        // Element states follow the coordinates and rates, as in the rows of `Motion::push`.
        channels.extend(elements.filter_map(channel));
        vectors(&channels)
    }

    /// The natural modes at rest, by frequency.
    fn modes(&self) -> Vec<Mode> {
        self.inner
            .modes()
            .iter()
            .map(|mode| Mode::new(mode.frequency_hz, mode.damping_ratio, mode.shape.clone()))
            .collect()
    }

    /// Returns the drawing of the structure: the lines between points, by the points' places, and the positions of the
    /// points at rest and at these coordinates, the vibration as large as pictures have it, m. None of modes without
    /// places.
    fn drawn(&self, coordinates: Vec<f64>) -> Option<Drawn> {
        let drawing = Drawing::of_assembly(&self.section, &self.inner)?;
        let magnification = 1.0 / drawing.vibration(&coordinates);
        // At rest there is nothing to magnify, and the quotient is not finite.
        let moved = drawing.positions_m(&coordinates, if magnification.is_finite() { magnification } else { 0.0 });
        Some((drawing.points, drawing.lines, drawing.rest_m, moved))
    }

    /// Complex responses of the linear part at these frequencies, Hz, given as the bytes of an array.
    fn frf_at<'py>(
        &self,
        py: Python<'py>,
        frequency_hz: &[u8],
        terms: (String, String, String),
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let (drive, at, quantity) = terms;
        let drive = self.dof("drive", &drive)?;
        let response = self.dof("at", &at)?;
        let quantity: Quantity = quantity.parse().map_err(errors::value)?;
        let mut rows = Rows::default();
        py.detach(|| {
            let linear = LinearResponse::new(&self.inner);
            numbers(frequency_hz).into_iter().try_for_each(|hz| {
                let found = linear.at(quantity, drive, response, hz)?;
                rows.numbers(&[found.re, found.im]);
                Ok(())
            })
        })
        .map_err(errors::frf)?;
        rows.into_bytes(py)
    }

    /// Rows of t, coordinates, rates and states of elements from `initial` on under a drive, and how many steps
    /// met more switches than are located. `stepping` is a scheme and the steps a second, `length` the number of steps
    /// and the number from row to row; the end has a row, too.
    fn motion<'py>(
        &self,
        py: Python<'py>,
        initial: Option<Vec<f64>>,
        drive: Option<Drive>,
        stepping: (Option<String>, f64),
        length: (u64, u64),
    ) -> PyResult<(Bound<'py, PyByteArray>, u64)> {
        let (name, rate_hz) = stepping;
        let (steps, every) = length;
        let mut motion = Motion::new(self, initial, drive, (scheme(name.as_deref())?, rate_hz))?;
        let mut rows = Rows::default();
        motion.push(&mut rows, 0.0);
        let mut step = 0;
        while step < steps {
            let until = steps.min(step + STEPS_A_LOOK);
            py.detach(|| {
                for k in step..until {
                    // By the number of the step: a time that is summed up would drift by rounding.
                    motion.advance(k as f64 / rate_hz)?;
                    if (k + 1) % every == 0 || k + 1 == steps {
                        motion.push(&mut rows, (k + 1) as f64 / rate_hz);
                    }
                }
                Ok(())
            })
            .map_err(|error: StepError| errors::failed(error))?;
            py.check_signals()?;
            step = until;
        }
        Ok((rows.into_bytes(py)?, motion.stepper.fallbacks()))
    }
}

impl Assembly {
    /// The degree of freedom of an argument.
    pub fn dof(&self, argument: &str, name: &str) -> PyResult<Dof> {
        self.inner.dof(name).map_err(|error| errors::value(format!("{argument} {name}: {error}")))
    }

    fn chain(&self) -> Option<&ChainSpec> {
        match &self.inner.spec().body {
            BodySpec::Chain(chain) => Some(chain),
            BodySpec::Modal(_) => None,
        }
    }

    /// The state at the start: the one given, or the section's, or rest.
    fn start(&self, initial: Option<Vec<f64>>) -> PyResult<Vec<f64>> {
        let moving = 2 * self.inner.coordinates();
        let elements = self.inner.element_states();
        let mut start = match initial {
            Some(initial) => initial,
            None if self.section.initial.is_empty() => vec![0.0; moving],
            None => self.section.initial.clone(),
        };
        if let Some(at) = start.iter().position(|number| !number.is_finite()) {
            return Err(errors::value(format!("initial is {} at index {at}: it must be a finite number", start[at])));
        }
        let all = moving + elements;
        if start.len() != moving && start.len() != all {
            let more = if elements > 0 { format!(", or {all} with the states of its elements") } else { String::new() };
            let message =
                format!("initial has {} numbers: give {moving}, the coordinates and their rates{more}", start.len());
            return Err(errors::value(message));
        }
        // The states of elements may be left out: at rest they are zero.
        start.resize(all, 0.0);
        Ok(start)
    }
}

/// A structure that moves under a drive.
struct Motion {
    stepper: Stepper,
    amplitude: Vec<f64>,
    omega_rad_s: f64,
    harmonics: Vec<LoadHarmonic>,
}

impl Motion {
    fn new(
        of: &Assembly,
        initial: Option<Vec<f64>>,
        drive: Option<Drive>,
        (scheme, rate_hz): (Scheme, f64),
    ) -> PyResult<Motion> {
        let (shares, all, frequency_hz, harmonics) = match drive {
            Some(drive) => (drive.shares(of)?, drive.1, drive.2, drive.harmonics()),
            None => (Vec::new(), 0.0, 0.0, Vec::new()),
        };
        let (drive, amplitude): (Vec<Dof>, Vec<f64>) = shares.iter().map(|(dof, share)| (*dof, share * all)).unzip();
        let mut stepper = Stepper::new(&of.inner, &drive, scheme, rate_hz).map_err(errors::value)?;
        stepper.restore(&of.start(initial)?).map_err(errors::value)?;
        Ok(Motion { stepper, amplitude, omega_rad_s: TAU * frequency_hz, harmonics })
    }

    fn advance(&mut self, t_s: f64) -> Result<(), StepError> {
        let Motion { stepper, amplitude, omega_rad_s, harmonics } = self;
        stepper.advance_under(t_s, &StepLoad::Periodic { amplitude, omega_rad_s: *omega_rad_s, harmonics })
    }

    fn push(&self, rows: &mut Rows, t_s: f64) {
        rows.numbers(&[t_s]);
        rows.numbers(self.stepper.position());
        rows.numbers(self.stepper.velocity());
        rows.numbers(self.stepper.element_states());
    }
}
