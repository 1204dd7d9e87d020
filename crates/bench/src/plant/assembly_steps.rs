//! The steps of a chain of links or of vibration modes under test.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Vector2;

use super::sampling::PointMotion;
use super::stepped::{Loads, Stepped};
use super::tested::{Placed, Places, TestedAssembly};
use super::{PlantSpec, PlantSpecError};
use crate::structure::{
    Channel, Coordinates, LOADS, StructureError, branch_channel, coordinate_channels, element_channel,
};
use resonarm_dynamics::structure::{Assembly, CoordinateUnit, Dof, MOST_COORDINATES, Stepper};

/// The steps of the structure under test.
#[derive(Clone, Debug)]
pub(super) struct AssemblySteps {
    stepper: Stepper,
    places: Places,
    /// Which load of the plant acts on each degree of freedom of the drive.
    acting: Vec<usize>,
    states: Vec<Channel>,
}

/// The loads as the drive takes them.
struct Drive {
    numbers: Loads,
    count: usize,
}

impl Drive {
    fn acting(&self) -> &[f64] {
        &self.numbers[..self.count]
    }
}

impl AssemblySteps {
    /// The structure of a valid specification at sample 0.
    pub fn new(spec: &PlantSpec, tested: &TestedAssembly) -> Result<AssemblySteps, PlantSpecError> {
        super::check_steps_per_sample(spec.steps_per_sample)?;
        let rate_hz = spec.sample_rate_hz * f64::from(spec.steps_per_sample);
        let TestedAssembly { assembly, initial, places } = tested;
        let (acting, drive): (Vec<usize>, Vec<Dof>) =
            tested.loaded().into_iter().enumerate().filter_map(|(load, dof)| Some((load, dof?))).unzip();
        let mut stepper = Stepper::new(assembly, &drive, spec.scheme, rate_hz)?;
        let start: Vec<f64> = initial.iter().copied().chain(vec![0.0; assembly.element_states()]).collect();
        stepper.restore(&start)?;
        Ok(AssemblySteps { places: *places, acting, states: state_channels(assembly, stepper.saved_len()), stepper })
    }

    /// The loads of the plant as the drive takes them.
    fn drive(&self, loads: &Loads) -> Result<Drive, StructureError> {
        let idle = |(load, value): (usize, &f64)| *value != 0.0 && !self.acting.contains(&load);
        if let Some((load, got)) = loads.iter().enumerate().find(|(load, value)| idle((*load, value))) {
            return Err(StructureError::NoInput { name: LOADS[load].name, got: *got });
        }
        let mut numbers = [0.0; LOADS.len()];
        numbers.iter_mut().zip(&self.acting).for_each(|(number, load)| *number = loads[*load]);
        Ok(Drive { numbers, count: self.acting.len() })
    }
}

/// The channels of the states that a stepper saves: coordinates, rates, states of elements, and, if it saves them, the
/// branches.
fn state_channels(assembly: &Assembly, saved: usize) -> Vec<Channel> {
    let of = match assembly.coordinate_unit() {
        CoordinateUnit::Radian => Coordinates::Joints,
        CoordinateUnit::MetreRootKilogram => Coordinates::Modes,
    };
    let elements = || assembly.elements().iter().enumerate();
    let with_state = elements().filter(|(_, element)| element.state().is_some());
    let states = with_state.filter_map(|(index, element)| element_channel(index, element.at().is_angle()));
    let mut channels: Vec<Channel> =
        coordinate_channels(of, assembly.coordinates()).into_iter().chain(states).collect();
    channels.extend(elements().filter_map(|(index, _)| branch_channel(index)).take(saved - channels.len()));
    channels
}

impl Stepped for AssemblySteps {
    fn states(&self) -> &[Channel] {
        &self.states
    }

    fn advance(&mut self, t_s: f64, loads: &Loads) -> Result<(), StructureError> {
        let drive = self.drive(loads)?;
        Ok(self.stepper.advance(t_s, drive.acting())?)
    }

    fn points(&self, _t_s: f64, loads: &Loads) -> Result<PointMotion, StructureError> {
        let (stepper, assembly, drive) = (&self.stepper, self.stepper.assembly(), self.drive(loads)?);
        let mut acceleration = [0.0; MOST_COORDINATES];
        let a = &mut acceleration[..assembly.coordinates()];
        stepper.acceleration(drive.acting(), a)?;
        let (q, v) = (stepper.position(), stepper.velocity());
        let along = |placed: &Placed, of: &dyn Fn(Dof) -> f64| {
            let [x, y] = placed.along.map(|dof| dof.map_or(0.0, of));
            Vector2::new(x, y)
        };
        let velocity = |dof: Dof| assembly.velocity(dof, q, v);
        let acceleration = |dof: Dof| assembly.acceleration(dof, q, v, a);
        let points = [&self.places.accelerometer_b, &self.places.accelerometer_c];
        Ok(PointMotion {
            velocity_m_s: points.map(|point| along(point, &velocity)),
            acceleration_m_s2: points.map(|point| along(point, &acceleration)),
        })
    }

    fn travel_m(&self) -> f64 {
        let (assembly, q) = (self.stepper.assembly(), self.stepper.position());
        let [x, y] = self.places.exciter.along.map(|dof| dof.map_or(0.0, |dof| assembly.displacement(dof, q)));
        libm::hypot(x, y)
    }

    fn save(&self, states: &mut [f64]) {
        // It has as many numbers as there are channels.
        let _ = self.stepper.save(states);
    }

    fn restore(&mut self, states: &[f64]) -> Result<(), StructureError> {
        Ok(self.stepper.restore(states)?)
    }

    fn boxed_clone(&self) -> Box<dyn Stepped> {
        Box::new(self.clone())
    }
}
