//! The plant, sample by sample and in batches.

use std::sync::Arc;

use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict, PyTuple};
use resonarm::plant::{self, PlantError};
use resonarm::recording::Topic;
use resonarm::recording::channels::Channels;
use resonarm::rig::{self, Load, MOST_JOINTS, Reading, Readings};
use resonarm::run::sample_record;
use resonarm::structure::States;

use crate::errors::{self, Raised, taken};
use crate::own_structure::OwnParts;
use crate::rows::{Rows, numbers};
use crate::scenario::Scenario;
use crate::structure::{self, Vector};
use crate::values;

/// The readings of the instruments at a sample.
#[pyclass(frozen, eq, module = "resonarm._resonarm")]
#[derive(Debug, PartialEq)]
pub struct Measurement {
    inner: rig::Measurement,
    /// The names of the readings of the sensors beside B and C.
    names: Names,
}

/// Names of channels, which many measurements share.
type Names = Arc<[String]>;

impl From<rig::Measurement> for Measurement {
    /// A measurement as a controller gets it from the protocol, which carries head, B and C.
    fn from(inner: rig::Measurement) -> Measurement {
        Measurement { inner: rig::Measurement { more: Readings::NONE, ..inner }, names: Names::default() }
    }
}

/// The readings of a sample: its index; the head's, B's and C's; which were clipped; those of other sensors.
type MeasurementParts = (u64, (f64, f64), (f64, f64), (f64, f64), u32, Vec<(String, f64)>);

#[pymethods]
impl Measurement {
    #[new]
    #[pyo3(signature = (
        sample, head_force_n = (0.0, 0.0), acceleration_b_m_s2 = (0.0, 0.0), acceleration_c_m_s2 = (0.0, 0.0), clipped = 0,
        sensors = Vec::new()
    ))]
    fn new(
        sample: u64,
        head_force_n: (f64, f64),
        acceleration_b_m_s2: (f64, f64),
        acceleration_c_m_s2: (f64, f64),
        clipped: u32,
        sensors: Vec<(String, f64)>,
    ) -> PyResult<Measurement> {
        let (names, values): (Vec<String>, Vec<f64>) = sensors.into_iter().unzip();
        let more = Readings::new(&values, clipped >> rig::Measurement::CHANNELS).ok_or_else(|| {
            let bits = rig::Measurement::CHANNELS + values.len();
            errors::value(format!("clipped is {clipped}: it must have at most one bit for each of the {bits} readings"))
        })?;
        // The bits are in the order B, C, head of a recording, and the arguments in the order of a measurement.
        let reading = |value, bit: u32| Reading { value, clipped: clipped >> bit & 1 == 1 };
        let pair = |(x, y), bit| [reading(x, bit), reading(y, bit + 1)];
        Ok(Measurement {
            inner: rig::Measurement {
                sample,
                head_force_n: pair(head_force_n, 4),
                acceleration_b_m_s2: pair(acceleration_b_m_s2, 0),
                acceleration_c_m_s2: pair(acceleration_c_m_s2, 2),
                more,
            },
            names: names.into(),
        })
    }

    fn __getnewargs__(&self) -> MeasurementParts {
        let head = self.head_force_n();
        let b = self.acceleration_b_m_s2();
        let c = self.acceleration_c_m_s2();
        (self.sample(), head, b, c, self.clipped(), self.named())
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        let (sample, head, b, c, clipped, sensors) = self.__getnewargs__();
        // Of the parts that `__eq__` compares. A list has no hash, so the sensors become a tuple.
        (sample, head, b, c, clipped, PyTuple::new(py, sensors)?).into_pyobject(py)?.hash()
    }

    /// Index of the sample.
    #[getter]
    fn sample(&self) -> u64 {
        self.inner.sample
    }

    /// Force in the impedance head along x and y, N.
    #[getter]
    fn head_force_n(&self) -> (f64, f64) {
        self.inner.head_force_n.map(|reading| reading.value).into()
    }

    /// Acceleration of the elbow B along x and y, m/s².
    #[getter]
    fn acceleration_b_m_s2(&self) -> (f64, f64) {
        self.inner.acceleration_b_m_s2.map(|reading| reading.value).into()
    }

    /// Acceleration of the tip C along x and y, m/s².
    #[getter]
    fn acceleration_c_m_s2(&self) -> (f64, f64) {
        self.inner.acceleration_c_m_s2.map(|reading| reading.value).into()
    }

    /// Readings that were beyond the range of their sensor: bits 0 and 1 for B, 2 and 3 for C, 4 and 5 for the head,
    /// those above for the other sensors in their order.
    #[getter]
    fn clipped(&self) -> u32 {
        sample_record(&self.inner).clipped_bits()
    }

    /// The readings of the sensors beside B and C by the names of their channels, such as `acceleration_m3_z_m_s2`.
    #[getter]
    fn sensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        self.named().into_iter().try_for_each(|(name, value)| all.set_item(name, value))?;
        Ok(all)
    }

    fn __repr__(&self) -> String {
        let head = self.head_force_n();
        let b = self.acceleration_b_m_s2();
        let c = self.acceleration_c_m_s2();
        let sample = self.inner.sample;
        let clipped = self.clipped();
        let sensors = match self.names.is_empty() {
            true => String::new(),
            false => format!(", sensors={:?}", self.named()),
        };
        format!(
            "Measurement(sample={sample}, head_force_n={head:?}, acceleration_b_m_s2={b:?}, acceleration_c_m_s2={c:?}, \
             clipped={clipped}{sensors})"
        )
    }
}

impl Measurement {
    /// The readings of the sensors beside B and C, with their names.
    fn named(&self) -> Vec<(String, f64)> {
        self.names.iter().cloned().zip(self.inner.more.values().iter().copied()).collect()
    }
}

/// A plant at a sample: the arm or another structure, its instruments and an integrator.
#[pyclass(subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Plant {
    inner: plant::Plant,
    /// The names of the readings of the sensors beside B and C.
    names: Names,
    /// The exception of a structure in Python.
    raised: Raised,
}

/// Samples between two checks for signals: some 20 ms of work.
const SAMPLES_A_LOOK: usize = 1 << 14;

#[pymethods]
impl Plant {
    #[new]
    #[pyo3(signature = (scenario, structure = None))]
    fn new(scenario: &Scenario, structure: Option<OwnParts>) -> PyResult<Plant> {
        let scenario = &scenario.inner;
        let raised = Raised::default();
        let made = match structure {
            // An FMU does not show its equations, so the scenario makes its plant.
            None if scenario.is_fmu() => Ok(scenario.plant().map_err(errors::scenario)?),
            None => plant::Plant::new(&scenario.plant_spec(), &scenario.under_test().map_err(errors::scenario)?),
            Some(parts) => {
                let spec = scenario.own_plant_spec().map_err(errors::scenario)?;
                plant::Plant::stepped(&spec, parts.structure(scenario, &raised)?)
            }
        };
        let inner = made.map_err(|error| taken(&raised).unwrap_or_else(|| errors::value(error)))?;
        let others = inner.structure().outputs().iter().skip(rig::Measurement::CHANNELS);
        let names = others.map(|channel| channel.name.to_string()).collect();
        Ok(Plant { inner, names, raised })
    }

    /// The index of the plant's current sample.
    #[getter]
    fn sample(&self) -> u64 {
        self.inner.sample()
    }

    /// The time of that sample, s.
    #[getter]
    fn time_s(&self) -> f64 {
        self.inner.time_s()
    }

    /// The deflections of the joints there, rad.
    #[getter]
    fn alpha_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        self.vector(py, "alpha_rad")
    }

    /// Rates of the coordinates, rad/s.
    #[getter]
    fn alpha_dot_rad_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        self.vector(py, "alpha_dot_rad_s")
    }

    /// All states there, by the names of their vectors.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        let states = self.inner.states();
        // The states are one list; the channels say how many numbers of it each vector has.
        let mut rest = &states[..];
        for (name, components) in self.channels() {
            let (vector, after) = rest.split_at(components.len());
            all.set_item(name, PyTuple::new(py, vector)?)?;
            rest = after;
        }
        Ok(all)
    }

    /// The vectors of the states: name, and names of the components.
    fn channels(&self) -> Vec<Vector> {
        structure::vectors(self.inner.structure().states())
    }

    /// The vectors of the readings: name, and names of the components.
    fn reading_channels(&self) -> Vec<Vector> {
        structure::vectors(Channels::of_structure(self.inner.structure()).of(Topic::Samples))
    }

    /// The readings of the instruments at the sample. Every call draws new noise: call it once a sample.
    fn measure(&mut self) -> Measurement {
        Measurement { inner: self.inner.measure(), names: self.names.clone() }
    }

    /// Advances to the next sample with a load held.
    #[pyo3(signature = (force_n = None, torque_nm = None))]
    fn advance(&mut self, force_n: Option<&Bound<'_, PyAny>>, torque_nm: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let sample = self.inner.sample();
        let force_n = force_n.map_or(Ok([0.0; 3]), |given| {
            let message = |text: &str| {
                format!("force_n is {text} at sample {sample}: it must be two finite numbers, or three with z")
            };
            values::two_or_more(given, message)
        })?;
        let torque_nm = torque_nm.map_or(Ok([0.0; MOST_JOINTS]), |given| {
            let message = |text: &str| {
                format!("torque_nm is {text} at sample {sample}: it must be two to {MOST_JOINTS} finite numbers")
            };
            values::two_or_more(given, message)
        })?;
        let load = Load { torque_nm: torque_nm.into(), force_n: force_n.into() };
        self.inner.advance(&load).map_err(|error| self.failed(error))
    }

    /// Measures and advances once for each row of three forces and eight torques, given as the bytes of arrays; a row
    /// of readings and states for each.
    fn play_rows<'py>(
        &mut self,
        py: Python<'py>,
        force_n: &[u8],
        torque_nm: &[u8],
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let forces_n = numbers(force_n);
        let torques_nm = numbers(torque_nm);
        let rows_of = forces_n.as_chunks::<3>().0.iter().zip(torques_nm.as_chunks::<MOST_JOINTS>().0);
        let loads: Vec<Load> = rows_of
            .map(|(force_n, torque_nm)| Load { torque_nm: (*torque_nm).into(), force_n: (*force_n).into() })
            .collect();
        let mut rows = Rows::default();
        // In parts, so that Ctrl-C ends a long batch; other threads of Python run during each part.
        for part in loads.chunks(SAMPLES_A_LOOK) {
            py.detach(|| {
                part.iter().try_for_each(|load| {
                    let measured = self.inner.measure();
                    push(&mut rows, self.inner.states(), &measured);
                    self.inner.advance(load)
                })
            })
            .map_err(|error| self.failed(error))?;
            py.check_signals()?;
        }
        rows.into_bytes(py)
    }
}

impl Plant {
    /// The exception for a sample that could not be finished: that of a structure in Python, if it raised one.
    fn failed(&self, error: PlantError) -> PyErr {
        taken(&self.raised).unwrap_or_else(|| errors::failed(error))
    }

    /// The states of one vector.
    fn vector<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyTuple>> {
        let channels = self.inner.structure().states();
        let first = channels.iter().position(|channel| channel.vector == name);
        // `Plant.__getattr__` says what there is.
        let first = first.ok_or_else(|| PyAttributeError::new_err(name.to_owned()))?;
        let count = channels[first..].iter().take_while(|channel| channel.vector == name).count();
        PyTuple::new(py, &self.inner.states()[first..first + count])
    }
}

fn push(rows: &mut Rows, states: &States, measured: &rig::Measurement) {
    let read = sample_record(measured);
    rows.word(read.sample);
    rows.numbers(states);
    rows.numbers(&read.values());
    rows.word(read.clipped_bits());
}
