//! A chain of links or vibration modes with an ideal exciter and converters, as a structure.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Vector2;

use super::sampling::{End, Filter, Sums};
use super::{PlantSpec, PlantSpecError, write};
use crate::rig::Measurement;
use crate::structure::{
    Channel, Coordinates, LOADS, OUTPUTS, Structure, StructureError, branch_channel, coordinate_channels,
    element_channel,
};
use resonarm_dynamics::structure::{Assembly, CoordinateUnit, Dof, MOST_COORDINATES, Stepper};

/// What the exciter or an instrument is at: the degrees of freedom that are its x and y, if the structure has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Along x and y.
    pub along: [Option<Dof>; 2],
}

/// Where a rig is on a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Places {
    /// The exciter, with the impedance head.
    pub exciter: Placed,
    /// Accelerometer B.
    pub accelerometer_b: Placed,
    /// Accelerometer C.
    pub accelerometer_c: Placed,
}

/// A chain of links or vibration modes under test.
#[derive(Clone, Debug, PartialEq)]
pub struct TestedAssembly {
    /// The structure.
    pub assembly: Assembly,
    /// Its coordinates and their rates at sample 0.
    pub initial: Vec<f64>,
    /// Where the rig is on it.
    pub places: Places,
}

/// The most loads: forces along x and y, torques at joints 1 and 2.
const MOST_LOADS: usize = 4;

/// The structure at a sample.
#[derive(Clone, Debug)]
pub(super) struct DrivenAssembly {
    stepper: Stepper,
    places: Places,
    /// Which load of the plant acts on each degree of freedom of the drive.
    acting: Vec<usize>,
    steps_per_sample: u32,
    filter: Option<Filter>,
    states: Vec<Channel>,
    /// The converters' last samples: head x, y; B x, y; C x, y.
    sampled: [f64; Measurement::CHANNELS],
    sums: Sums,
    /// The state at the start of a hold, to which a hold that can't be finished returns.
    before: Vec<f64>,
}

/// The loads as the drive takes them.
struct Drive {
    numbers: [f64; MOST_LOADS],
    count: usize,
    /// Along x and y of the head.
    force_n: [f64; 2],
}

impl Drive {
    fn acting(&self) -> &[f64] {
        &self.numbers[..self.count]
    }
}

impl DrivenAssembly {
    /// The structure of a valid specification at sample 0.
    pub fn new(spec: &PlantSpec, tested: &TestedAssembly) -> Result<DrivenAssembly, PlantSpecError> {
        super::check_steps_per_sample(spec.steps_per_sample)?;
        let rate_hz = spec.sample_rate_hz * f64::from(spec.steps_per_sample);
        let TestedAssembly { assembly, initial, places } = tested;
        let joints = ["joint1", "joint2"].map(|joint| assembly.dof(joint).ok());
        let [x, y] = places.exciter.along;
        let (acting, drive): (Vec<usize>, Vec<Dof>) =
            [joints[0], joints[1], x, y].into_iter().enumerate().filter_map(|(load, dof)| Some((load, dof?))).unzip();
        let mut stepper = Stepper::new(assembly, &drive, spec.scheme, rate_hz)?;
        let start: Vec<f64> = initial.iter().copied().chain(vec![0.0; assembly.element_states()]).collect();
        stepper.restore(&start)?;
        let filter = Filter::new(spec, stepper.step_s(), f64::INFINITY);
        let mut driven = DrivenAssembly {
            places: *places,
            acting,
            steps_per_sample: spec.steps_per_sample,
            filter,
            states: state_channels(assembly, stepper.saved_len()),
            sampled: [0.0; Measurement::CHANNELS],
            sums: Sums::default(),
            before: vec![0.0; stepper.saved_len()],
            stepper,
        };
        driven.settle()?;
        Ok(driven)
    }

    /// The converters as if they had always sampled the outputs at the state without a load.
    fn settle(&mut self) -> Result<(), StructureError> {
        let none = Drive { numbers: [0.0; MOST_LOADS], count: self.acting.len(), force_n: [0.0; 2] };
        self.sampled = Self::instant(&self.end(&none)?, &none);
        self.sums = self.filter.as_ref().map(|filter| filter.settled(&self.sampled)).unwrap_or_default();
        Ok(())
    }

    /// The loads of the plant as the drive takes them.
    fn drive(&self, inputs: &[f64]) -> Result<Drive, StructureError> {
        let [u1, u2, fx, fy] = *inputs else {
            return Err(StructureError::Inputs { got: inputs.len(), expected: LOADS.len() });
        };
        let loads = [u1, u2, fx, fy];
        let idle = |(load, value): (usize, &f64)| *value != 0.0 && !self.acting.contains(&load);
        if let Some((load, got)) = loads.iter().enumerate().find(|(load, value)| idle((*load, value))) {
            return Err(StructureError::NoInput { name: LOADS[load].name, got: *got });
        }
        let mut numbers = [0.0; MOST_LOADS];
        numbers.iter_mut().zip(&self.acting).for_each(|(number, load)| *number = loads[*load]);
        Ok(Drive { numbers, count: self.acting.len(), force_n: [fx, fy] })
    }

    /// Velocities and accelerations of B and C at the state under the loads.
    fn end(&self, drive: &Drive) -> Result<End, StructureError> {
        let (stepper, assembly) = (&self.stepper, self.stepper.assembly());
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
        Ok(End {
            velocity_m_s: points.map(|point| along(point, &velocity)),
            acceleration_m_s2: points.map(|point| along(point, &acceleration)),
        })
    }

    /// What the outputs are at an instant: with an ideal exciter the head reads the force.
    fn instant(at: &End, drive: &Drive) -> [f64; Measurement::CHANNELS] {
        let [b, c] = at.acceleration_m_s2;
        [drive.force_n[0], drive.force_n[1], b.x, b.y, c.x, c.y]
    }

    /// Makes the steps of a hold.
    fn hold(&mut self, time_s: f64, drive: &Drive) -> Result<(), StructureError> {
        let mut sums = self.sums;
        let mut start = self.filter.as_ref().map(|_| self.end(drive)).transpose()?;
        let mut sampled = self.sampled;
        for part in 0..self.steps_per_sample {
            let t_s = time_s + f64::from(part) * self.stepper.step_s();
            self.stepper.advance(t_s, drive.acting())?;
            if let (Some(filter), Some(from)) = (&self.filter, start) {
                let ended = self.end(drive)?;
                filter.add_held(&mut sums, part as usize, &from, &ended, drive.force_n);
                start = Some(ended);
            } else if 2 * (part + 1) == self.steps_per_sample {
                sampled = Self::instant(&self.end(drive)?, drive);
            }
        }
        self.sampled = if self.filter.is_some() { Filter::read(&mut sums) } else { sampled };
        self.sums = sums;
        Ok(())
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

impl Structure for DrivenAssembly {
    fn inputs(&self) -> &[Channel] {
        &LOADS
    }

    fn outputs(&self) -> &[Channel] {
        &OUTPUTS
    }

    fn states(&self) -> &[Channel] {
        &self.states
    }

    fn saved_len(&self) -> usize {
        self.states.len() + OUTPUTS.len() + if self.filter.is_some() { self.sums.as_flattened().len() } else { 0 }
    }

    fn advance(&mut self, time_s: f64, inputs: &[f64]) -> Result<(), StructureError> {
        let drive = self.drive(inputs)?;
        self.stepper.save(&mut self.before)?;
        let held = self.hold(time_s, &drive);
        if held.is_err() {
            self.stepper.restore(&self.before)?;
        }
        held
    }

    fn sense(&self, outputs: &mut [f64]) {
        write(outputs, &self.sampled);
    }

    fn save(&self, saved: &mut [f64]) {
        let (states, rest) = saved.split_at_mut(self.states.len().min(saved.len()));
        // It has as many numbers as there are states.
        if self.stepper.save(states).is_ok() {
            let rest = write(rest, &self.sampled);
            write(rest, self.sums.as_flattened());
        }
    }

    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError> {
        let (states, all) = (self.states.len(), self.saved_len());
        let got = saved.iter().position(|number| !number.is_finite()).unwrap_or(saved.len());
        if got != saved.len() || (got != states && got != all) {
            return Err(StructureError::Saved { got, states, all });
        }
        let (states, rest) = saved.split_at(states);
        self.stepper.restore(states)?;
        match rest.split_first_chunk() {
            Some((sampled, sums)) => {
                self.sampled = *sampled;
                write(self.sums.as_flattened_mut(), sums);
                Ok(())
            }
            None => self.settle(),
        }
    }

    fn travel_m(&self) -> f64 {
        let (assembly, q) = (self.stepper.assembly(), self.stepper.position());
        let [x, y] = self.places.exciter.along.map(|dof| dof.map_or(0.0, |dof| assembly.displacement(dof, q)));
        libm::hypot(x, y)
    }

    fn boxed_clone(&self) -> Box<dyn Structure> {
        Box::new(self.clone())
    }
}
