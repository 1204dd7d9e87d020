//! The steps of a chain of links or of vibration modes under test.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::stepped::Stepped;
use super::tested::{Placed, Places, TestedAssembly};
use super::{PlantSpec, PlantSpecError};
use crate::rig::{Load, MOST_CHANNELS, ShakerSpec};
use crate::structure::{Channel, LOADS, LoadSet, StructureError, branch_channel};
use resonarm_dynamics::structure::{Armature, Dof, Kinematics, Stepper};

/// The steps of the structure under test.
#[derive(Clone, Debug)]
pub(super) struct AssemblySteps {
    stepper: Stepper,
    exciter: Placed,
    exciter_z: Option<Dof>,
    /// Which load of the plant acts on each degree of freedom of the drive; none with a shaker.
    acting: Vec<usize>,
    /// Which loads of the plant act on nothing, so that they must be 0; none with a shaker.
    idle: Vec<usize>,
    inputs: LoadSet,
    /// That of the last step: all steps and readings of a hold have the same.
    held: Drive,
    shaker: Option<(ShakerSpec, Armature)>,
    /// What is read: the degrees of freedom of the sensors that the structure has, then what a shaker's armature moves
    /// along.
    read: Vec<Dof>,
    /// The place of each of the sensors' degrees of freedom among those of [`Stepped::read`]: B and C may have an axis
    /// along which the structure does not move.
    places: Vec<usize>,
    /// The channels of the sensors beside B and C.
    sensors: Vec<Channel>,
    states: Vec<Channel>,
}

/// The most degrees of freedom that are read: those of the sensors and two axes of an armature, which take the places of
/// the head's two channels.
const MOST_READ: usize = MOST_CHANNELS;

/// A load as the drive takes it.
#[derive(Clone, Copy, Debug, Default)]
struct Drive {
    load: Load,
    numbers: [f64; Load::PARTS],
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
        if !initial.iter().all(|number| number.is_finite()) {
            return Err(PlantSpecError::Initial(initial.clone()));
        }
        let (acting, drive): (Vec<usize>, Vec<Dof>) =
            tested.loaded().into_iter().enumerate().filter_map(|(load, dof)| Some((load, dof?))).unzip();
        let shaker = match spec.rig.shaker {
            Some(shaker) => Some((shaker, shaker.armature_at(&places.exciter)?)),
            None => None,
        };
        let idle = (0..Load::PARTS).filter(|place| !acting.contains(place)).collect();
        let (mut stepper, acting, idle) = match &shaker {
            Some((_, armature)) => (Stepper::shaken(assembly, armature, spec.scheme, rate_hz)?, Vec::new(), Vec::new()),
            None => (Stepper::new(assembly, &drive, spec.scheme, rate_hz)?, acting, idle),
        };
        let devices = stepper.states() - initial.len().min(stepper.states());
        let start: Vec<f64> = initial.iter().copied().chain(vec![0.0; devices]).collect();
        stepper.restore(&start)?;
        let states = saved_channels(tested, shaker.is_some(), stepper.saved_len());
        let accelerometers = [&places.accelerometer_b, &places.accelerometer_c].into_iter().flat_map(|at| at.along);
        let others = places.more.iter().flat_map(|sensor| &sensor.along).map(|(_, dof)| Some(*dof));
        let sensed = accelerometers.chain(others).enumerate();
        let (places_read, mut read): (Vec<usize>, Vec<Dof>) =
            sensed.filter_map(|(place, dof)| Some((place, dof?))).unzip();
        read.extend(shaker.iter().flat_map(|(_, armature)| armature.dofs()).map(|(dof, _)| dof));
        let sensors = places.more_channels();
        let &Places { exciter, exciter_z, .. } = places;
        let inputs = LoadSet::native_and(acting.iter().copied());
        let mut steps = AssemblySteps {
            exciter,
            exciter_z,
            acting,
            idle,
            inputs,
            held: Drive::default(),
            shaker,
            read,
            places: places_read,
            sensors,
            states,
            stepper,
        };
        steps.held = steps.drive(&Load::default());
        Ok(steps)
    }

    /// The armature's s, m, and ṡ, m/s, and the current in its coil, A, under a command, N; zeros without a shaker.
    pub fn shaker_state(&self, blocked_n: f64) -> (f64, f64, f64) {
        let (Some((_, armature)), Some(motion)) = (&self.shaker, self.stepper.armature_motion()) else {
            return (0.0, 0.0, 0.0);
        };
        let state_a = self.stepper.current_a().unwrap_or(0.0);
        let current_a = armature.coil.current_a(state_a, blocked_n, motion.velocity_m_s);
        (motion.displacement_m, motion.velocity_m_s, current_a)
    }

    /// Writes the motion that the sensors read with a current in the coil, A, and returns s̈ of the armature, m/s².
    pub fn read_at_current(&self, current_a: f64, out: &mut [Kinematics]) -> f64 {
        let mut read = [Kinematics::default(); MOST_READ];
        self.stepper.read_at_current(current_a, &self.read, &mut read);
        self.hand_out(&read, out);
        let armature = self.shaker.iter().flat_map(|(_, armature)| armature.dofs());
        armature.zip(&read[self.places.len()..]).map(|((_, share), at)| share * at.acceleration).sum()
    }

    /// Writes what was read to its places; the others stay as they are.
    fn hand_out(&self, read: &[Kinematics; MOST_READ], out: &mut [Kinematics]) {
        self.places.iter().zip(read).for_each(|(place, at)| out[*place] = *at);
    }

    /// The loads of the plant as the drive takes them; parts that it doesn't take are left out.
    fn drive(&self, load: &Load) -> Drive {
        let mut numbers = [0.0; Load::PARTS];
        if let Some((shaker, _)) = &self.shaker {
            numbers[0] = shaker.along_n(load) + 0.0;
            return Drive { load: *load, numbers, count: 1 };
        }
        let parts = load.parts();
        // A load of -0 equals one of 0, and must give the same bits: -0 + 0 is 0.
        numbers.iter_mut().zip(&self.acting).for_each(|(number, place)| *number = parts[*place] + 0.0);
        Drive { load: *load, numbers, count: self.acting.len() }
    }

    /// Refuses a load of which the drive doesn't take every part.
    fn check(&self, load: &Load) -> Result<(), StructureError> {
        let parts = load.parts();
        match self.idle.iter().find(|place| parts[**place] != 0.0) {
            Some(place) => Err(StructureError::NoInput { name: LOADS[*place].name, got: parts[*place] }),
            None => Ok(()),
        }
    }
}

/// The channels of the states that a stepper saves: those of the structure, and, if it saves them, the branches.
fn saved_channels(tested: &TestedAssembly, has_coil: bool, saved: usize) -> Vec<Channel> {
    let mut channels = tested.states(has_coil);
    let branches = tested.assembly.elements().iter().filter_map(|element| branch_channel(element.number - 1));
    channels.extend(branches.take(saved - channels.len()));
    channels
}

impl Stepped for AssemblySteps {
    fn states(&self) -> &[Channel] {
        &self.states
    }

    fn inputs(&self) -> LoadSet {
        self.inputs
    }

    fn advance(&mut self, t_s: f64, load: &Load) -> Result<(), StructureError> {
        if self.held.load != *load {
            self.check(load)?;
            self.held = self.drive(load);
        }
        Ok(self.stepper.advance(t_s, self.held.acting())?)
    }

    fn sensors(&self) -> &[Channel] {
        &self.sensors
    }

    fn read(&self, _t_s: f64, load: &Load, out: &mut [Kinematics]) -> Result<(), StructureError> {
        // Borrowed, since a drive is long and this is done for every reading.
        let other;
        let drive = if self.held.load == *load {
            &self.held
        } else {
            other = self.drive(load);
            &other
        };
        let dofs = &self.read[..self.places.len()];
        // Usually the structure has every degree of freedom, and their order is that of the places.
        if dofs.len() == out.len() {
            return Ok(self.stepper.read(drive.acting(), dofs, out)?);
        }
        let mut read = [Kinematics::default(); MOST_READ];
        self.stepper.read(drive.acting(), dofs, &mut read)?;
        self.hand_out(&read, out);
        Ok(())
    }

    fn travel_m(&self) -> f64 {
        if let Some(motion) = self.stepper.armature_motion() {
            return motion.displacement_m.abs();
        }
        let at = self.stepper.assembly().at(self.stepper.position());
        let moved_m = self.exciter.vector(|dof| at.displacement(dof));
        let plane_m = libm::hypot(moved_m.x, moved_m.y);
        self.exciter_z.map_or(plane_m, |dof| libm::hypot(plane_m, at.displacement(dof)))
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
