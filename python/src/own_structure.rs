//! A structure whose step is written in Python.

use std::sync::{Arc, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use resonarm::plant::{Kinematics, Stepped};
use resonarm::rig::Load;
use resonarm::scenario::Scenario;
use resonarm::structure::{Channel, Coordinates, LOADS, LoadSet, StructureError, coordinate_channels, named_readings};

use crate::errors::{self, Raised};
use crate::rows::numbers;

/// A structure as Python gives it: the calls of its step and its points, which take and give the bytes of arrays; what
/// its coordinates are, these and their rates at the start, its name, the names of its loads, and what its sensors may
/// read with the call that gives it.
#[derive(Debug, FromPyObject)]
pub struct OwnParts(
    Py<PyAny>,
    Py<PyAny>,
    String,
    Vec<f64>,
    Option<String>,
    Vec<String>,
    Vec<String>,
    Option<Py<PyAny>>,
);

/// The calls; that of the sensors if they read anything.
#[derive(Debug)]
struct Calls {
    step: Py<PyAny>,
    points: Py<PyAny>,
    sensors: Option<Py<PyAny>>,
}

/// The structure in a state.
#[derive(Clone, Debug)]
struct OwnStructure {
    // Shared, since a `Py` can be cloned only under the interpreter's lock, and clones are made without it.
    calls: Arc<Calls>,
    channels: Vec<Channel>,
    /// The place among all loads of each that its functions take, in their order.
    loads: Vec<usize>,
    /// The channels of the sensors beside B and C, and the place of what each reads among the `sensed` degrees of freedom.
    sensor_channels: Vec<Channel>,
    sensor_places: Vec<usize>,
    sensed: usize,
    state: Vec<f64>,
    /// Time to which the structure has come, s.
    t_s: f64,
    step_s: f64,
    raised: Raised,
}

/// The degrees of freedom of the points: B x, y and C x, y.
const POINT_DOFS: usize = 4;

impl OwnParts {
    /// Writes the structure's name into the scenario, if this does not say already that the program has a structure.
    pub fn name(&self, scenario: &mut Scenario) {
        let OwnParts(.., name, _loads, _sensed, _sensors) = self;
        scenario.leave_structure_to_program(name.clone());
    }

    /// The structure at its start, with the step of the scenario. An exception of a call is stored in `raised`.
    pub fn structure(self, scenario: &Scenario, raised: &Raised) -> PyResult<Box<dyn Stepped>> {
        let OwnParts(step, points, coordinates, initial, _name, loads, sensed, sensors) = self;
        let of = match coordinates.as_str() {
            "angles" => Coordinates::Joints,
            "displacements" => Coordinates::Displacements,
            "modal" => Coordinates::Modes,
            other => {
                let message = format!("coordinates is `{other}`: it must be one of angles, displacements, modal");
                return Err(errors::value(message));
            }
        };
        let count = initial.len();
        let most = 2 * of.most();
        // Each coordinate comes with its rate, so the count is even.
        if count == 0 || !count.is_multiple_of(2) || count > most {
            let message =
                format!("initial has {count} numbers: give the {coordinates} and their rates, 2 to {most} in all");
            return Err(errors::value(message));
        }
        if let Some(at) = initial.iter().position(|number| !number.is_finite()) {
            return Err(errors::value(format!("initial is {} at index {at}: it must be a finite number", initial[at])));
        }
        let place = |name: &String| {
            let place = Load::NAMES.iter().position(|known| known == name);
            place.ok_or_else(|| {
                errors::value(format!("loads: there is no load {name:?}: expected one of {}", Load::NAMES.join(", ")))
            })
        };
        let loads = loads.iter().map(place).collect::<PyResult<Vec<usize>>>()?;
        let dofs: Vec<&str> = sensed.iter().map(String::as_str).collect();
        let readings =
            named_readings(&scenario.rig.sensors.more, &dofs).map_err(|error| errors::value(error.to_string()))?;
        Ok(Box::new(OwnStructure {
            loads,
            sensor_channels: readings.iter().map(|reading| reading.channel).collect(),
            sensor_places: readings.iter().map(|reading| reading.dof).collect(),
            sensed: sensed.len(),
            calls: Arc::new(Calls { step, points, sensors }),
            channels: coordinate_channels(of, count / 2),
            state: initial,
            t_s: 0.0,
            step_s: 1.0 / scenario.simulation.step_rate_hz(),
            raised: Arc::clone(raised),
        }))
    }
}

/// Numbers as the bytes of an array.
fn bytes<'py>(py: Python<'py>, numbers: &[f64]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, size_of_val(numbers), |bytes| {
        let (places, _) = bytes.as_chunks_mut();
        places.iter_mut().zip(numbers).for_each(|(place, number)| *place = number.to_le_bytes());
        Ok(())
    })
}

impl OwnStructure {
    /// The `count` numbers that a call gives; an exception is kept.
    fn call(
        &self,
        count: usize,
        call: impl FnOnce(Python<'_>) -> PyResult<Py<PyAny>>,
    ) -> Result<Vec<f64>, StructureError> {
        let given = Python::attach(|py| {
            let given = numbers(call(py)?.bind(py).cast::<PyBytes>()?.as_bytes());
            let wrong = || errors::value(format!("got {} numbers, expected {count}", given.len()));
            if given.len() == count { Ok(given) } else { Err(wrong()) }
        });
        given.map_err(|error| {
            // The first exception stays: those after it are its consequences.
            self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            StructureError::Own
        })
    }

    /// The loads that its functions take, in their order.
    ///
    /// # Errors
    /// [`StructureError::NoInput`] if another load is not 0.
    fn loads(&self, load: &Load) -> Result<Vec<f64>, StructureError> {
        let parts = load.parts();
        // A load that the functions don't take would otherwise be lost without a word.
        match (0..Load::PARTS).find(|place| parts[*place] != 0.0 && !self.loads.contains(place)) {
            Some(place) => Err(StructureError::NoInput { name: LOADS[place].name, got: parts[place] }),
            None => Ok(self.loads.iter().map(|place| parts[*place]).collect()),
        }
    }

    /// What a call gives of `count` degrees of freedom at a time, s, under a load: all displacements, all velocities, all
    /// accelerations.
    fn read_by(
        &self,
        call: &Py<PyAny>,
        count: usize,
        t_s: f64,
        load: &Load,
    ) -> Result<Vec<Kinematics>, StructureError> {
        let loads = self.loads(load)?;
        let given = self.call(3 * count, |py| call.call1(py, (t_s, bytes(py, &self.state)?, bytes(py, &loads)?)))?;
        let (displacements, rest) = given.split_at(count);
        let (velocities, accelerations) = rest.split_at(count);
        let motions = displacements.iter().zip(velocities).zip(accelerations);
        Ok(motions
            .map(|((&displacement, &velocity), &acceleration)| Kinematics { displacement, velocity, acceleration })
            .collect())
    }
}

impl Stepped for OwnStructure {
    fn states(&self) -> &[Channel] {
        &self.channels
    }

    fn inputs(&self) -> LoadSet {
        LoadSet::native_and(self.loads.iter().copied())
    }

    fn advance(&mut self, t_s: f64, load: &Load) -> Result<(), StructureError> {
        let loads = self.loads(load)?;
        let call =
            |py: Python<'_>| self.calls.step.call1(py, (t_s, self.step_s, bytes(py, &self.state)?, bytes(py, &loads)?));
        self.state = self.call(self.state.len(), call)?;
        // Kept for `travel_m`, which is asked without a time.
        self.t_s = t_s + self.step_s;
        Ok(())
    }

    fn sensors(&self) -> &[Channel] {
        &self.sensor_channels
    }

    fn read(&self, t_s: f64, load: &Load, out: &mut [Kinematics]) -> Result<(), StructureError> {
        let (points, others) = out.split_at_mut(POINT_DOFS);
        points.copy_from_slice(&self.read_by(&self.calls.points, POINT_DOFS, t_s, load)?);
        // The sensors are asked only where the rig has some: each call takes the lock of the interpreter.
        let Some(sensors) = self.calls.sensors.as_ref().filter(|_| !others.is_empty()) else { return Ok(()) };
        let sensed = self.read_by(sensors, self.sensed, t_s, load)?;
        others.iter_mut().zip(&self.sensor_places).for_each(|(to, place)| *to = sensed[*place]);
        Ok(())
    }

    /// NaN, which no limit lets pass, if there is an exception.
    fn travel_m(&self) -> f64 {
        match self.read_by(&self.calls.points, POINT_DOFS, self.t_s, &Load::default()).as_deref() {
            Ok([_, _, x, y]) => (x.displacement * x.displacement + y.displacement * y.displacement).sqrt(),
            _ => f64::NAN,
        }
    }

    fn save(&self, states: &mut [f64]) {
        states.iter_mut().zip(&self.state).for_each(|(to, number)| *to = *number);
    }

    fn restore(&mut self, states: &[f64]) -> Result<(), StructureError> {
        self.state.clear();
        self.state.extend_from_slice(states);
        Ok(())
    }

    fn boxed_clone(&self) -> Box<dyn Stepped> {
        Box::new(self.clone())
    }
}
