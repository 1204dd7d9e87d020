//! The plant: a structure and its instruments, sample by sample.
//!
//! One sample is: [`Plant::measure`], a command from outside, [`Plant::advance`] with the command held (zero-order) up
//! to the next sample. The same specification and the same commands give the same states and readings, bit for bit.
//!
//! A held load jumps at every sample, and the accelerations with it, so a reading belongs to the middle of a hold: the
//! last one, or an earlier one if the converter's filter has a delay ([`Converter`](crate::rig::Converter)). Force and
//! accelerations of a sample then agree in phase; read at the edge, the part of the acceleration that follows the force
//! at once would lag the rest by half a period, an error of up to some per cent in a frequency response.

mod assembly_steps;
mod driven_structure;
mod sampler;
mod sampling;
mod shaken;
mod stepped;
mod tested;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use thiserror::Error;

use crate::rig::{Exciter, GateSpec, Load, MOST_CHANNELS, MOST_MORE, Measurement, Rig, RigError, RigSpec, ShakerLimit};
use crate::structure::{Kind, LOADS, LoadSet, MOST_STATES, NATIVE_LOADS, OUTPUTS, States, Structure, StructureError};
use driven_structure::DrivenStructure;
use resonarm_dynamics::integrate::{IntegrateError, Scheme};
pub use resonarm_dynamics::structure::Kinematics;
use resonarm_dynamics::structure::StepError;
use resonarm_numeric::number::{rounded, short};
pub use sampler::instant;
pub use shaken::ShakerAcross;
pub use stepped::Stepped;
pub use tested::{Placed, PlacedSensor, Places, ReadDof, TestedAssembly};

/// The most integration steps a sample: 250 times the default.
pub const MOST_STEPS_PER_SAMPLE: u32 = 1000;

/// Everything that makes a plant of a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSpec {
    /// The scheme by which the structure is integrated.
    pub scheme: Scheme,
    /// Samples a second, Hz, positive.
    pub sample_rate_hz: f64,
    /// Integration steps a sample: even, since the instruments sample in the middle, and from 2 to
    /// [`MOST_STEPS_PER_SAMPLE`].
    pub steps_per_sample: u32,
    /// The exciter and the sensors, with their limits and faults.
    pub rig: RigSpec,
    /// Seed of all noise.
    pub seed: u64,
}

/// Why a plant can't be advanced.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PlantError {
    /// The integrator could not make a step; the plant stays at the sample before.
    #[error("sample {sample}: {source}")]
    Integrate {
        /// The sample from which the step was tried.
        sample: u64,
        /// Why the integrator could not make the step.
        source: IntegrateError,
    },
    /// The shaker's amplifier switched off; the plant stays at the sample before.
    #[error(
        "sample {sample}: the shaker trips: the {what} would be {got} {unit}, and {most} {unit} is its limit \
         (`rig.shaker.{key}`): drive less, or take a larger shaker",
        what = .limit.names()[0], unit = .limit.names()[1], key = .limit.names()[2], got = rounded(.got, 6), most = short(.most)
    )]
    Tripped {
        /// The sample from which the step was tried.
        sample: u64,
        /// The quantity that is limited.
        limit: ShakerLimit,
        /// The value that would result, in the limit's unit.
        got: f64,
        /// The largest value that the amplifier allows, in the same unit.
        most: f64,
    },
    /// A saved state of another plant.
    #[error("a saved state of {got} numbers: the instruments of this plant have gathered more or fewer")]
    Saved {
        /// How many numbers the saved state has.
        got: usize,
    },
    /// The structure can't take up a state, or has other inputs.
    #[error("sample {sample}: {source}")]
    Structure {
        /// The sample at which the structure was.
        sample: u64,
        /// What the structure could not do.
        source: StructureError,
    },
}

impl PlantError {
    fn new(sample: u64, source: StructureError) -> PlantError {
        match source {
            StructureError::Step(StepError::Integrate(source)) => PlantError::Integrate { sample, source },
            StructureError::Tripped { limit, got, most } => PlantError::Tripped { sample, limit, got, most },
            source => PlantError::Structure { sample, source },
        }
    }
}

/// Why a specification is invalid.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PlantSpecError {
    /// An instrument is impossible.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// No steps can be made of the structure at this rate.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The structure can't begin in its initial state.
    #[error(transparent)]
    Start(#[from] StructureError),
    /// A shaker on a structure of one's own.
    #[error(
        "rig.shaker needs a structure of the scenario, as its armature moves with it: leave it out here; \
         a structure that the program makes is driven by the ideal exciter of `rig.exciter`"
    )]
    Shaker,
    /// A shaker that pushes where the structure does not move.
    #[error(transparent)]
    Across(#[from] ShakerAcross),
    /// The current of the shaker's coil changes too slowly for the step.
    #[error("rig.shaker: `inductance_h` is {got_h}: at this resistance and step in voltage mode it must be at most {most_h}", got_h = short(.got_h), most_h = short(.most_h))]
    Inductance {
        /// The given value, H.
        got_h: f64,
        /// The largest valid value, H.
        most_h: f64,
    },
    /// The initial state is not finite.
    #[error("the initial state {0:?} is not finite: give finite numbers, coordinates before rates")]
    Initial(Vec<f64>),
    /// A structure with other channels than a plant takes.
    #[error(
        "the structure has {inputs} inputs, {outputs} outputs and {states} states: it must have the {} loads and the {} \
         outputs of every rig, in this order, before any others, and at most {MOST_STATES} states", NATIVE_LOADS.len(), OUTPUTS.len()
    )]
    Channels {
        /// The number of its inputs.
        inputs: usize,
        /// The number of its outputs.
        outputs: usize,
        /// The number of its states.
        states: usize,
    },
    /// The middle of a sample period is not at an integration step, or a sample has too many steps.
    #[error(
        "`steps_per_sample` is {got}: it must be even, since the instruments sample in the middle, and from 2 to \
         {MOST_STEPS_PER_SAMPLE}"
    )]
    StepsPerSample {
        /// The number of steps that was given.
        got: u32,
    },
}

/// Refuses an invalid number of steps a sample.
///
/// # Errors
/// [`PlantSpecError::StepsPerSample`].
pub fn check_steps_per_sample(got: u32) -> Result<(), PlantSpecError> {
    let fits = got.is_multiple_of(2) && (2..=MOST_STEPS_PER_SAMPLE).contains(&got);
    if fits { Ok(()) } else { Err(PlantSpecError::StepsPerSample { got }) }
}

/// A structure with its instruments at a sample.
#[derive(Clone, Debug)]
pub struct Plant {
    structure: Box<dyn Structure>,
    rig: Rig,
    /// The states of the structure at the sample.
    states: States,
    sample_rate_hz: f64,
    sample: u64,
}

impl Plant {
    /// A plant of a structure, in its initial state at sample 0.
    ///
    /// # Errors
    /// [`PlantSpecError`] says which part of the specification is invalid.
    pub fn new(spec: &PlantSpec, tested: &TestedAssembly) -> Result<Plant, PlantSpecError> {
        let outputs = [&OUTPUTS[..], &tested.places.more_channels()].concat();
        let rig = Rig::new(&spec.rig, &outputs, spec.sample_rate_hz, spec.seed)?;
        Plant::of(Box::new(DrivenStructure::assembly(spec, tested)?), rig, spec.sample_rate_hz)
    }

    /// A plant of a structure of one's own, in its state at sample 0.
    ///
    /// # Errors
    /// [`PlantSpecError`]: of the rig and the rates, [`PlantSpecError::Shaker`] if the rig has a shaker,
    /// [`PlantSpecError::Start`] if the points can't move as the structure says at its start, and
    /// [`PlantSpecError::Channels`] for too many states.
    pub fn stepped(spec: &PlantSpec, structure: Box<dyn Stepped>) -> Result<Plant, PlantSpecError> {
        if spec.rig.shaker.is_some() {
            return Err(PlantSpecError::Shaker);
        }
        let outputs = [&OUTPUTS[..], structure.sensors()].concat();
        let rig = Rig::new(&spec.rig, &outputs, spec.sample_rate_hz, spec.seed)?;
        Plant::of(Box::new(DrivenStructure::new(spec, structure)?), rig, spec.sample_rate_hz)
    }

    /// A plant of any structure with [`LoadSet::NATIVE`] among its loads and outputs that begin with [`OUTPUTS`], at
    /// sample 0 of `sample_rate_hz` samples a second, Hz, positive. The rig was made for these outputs.
    ///
    /// # Errors
    /// [`PlantSpecError::Channels`] if it lacks loads or outputs, or has more states than [`MOST_STATES`].
    pub fn of(structure: Box<dyn Structure>, rig: Rig, sample_rate_hz: f64) -> Result<Plant, PlantSpecError> {
        let inputs = structure.inputs();
        let outputs = structure.outputs();
        let states = structure.states().len();
        let (first, more) = outputs.split_at(OUTPUTS.len().min(outputs.len()));
        if !inputs.has_native() || first != OUTPUTS || more.len() > MOST_MORE || states > MOST_STATES {
            return Err(PlantSpecError::Channels { inputs: inputs.len(), outputs: outputs.len(), states });
        }
        let moving = structure.states().iter().filter(|channel| channel.kind == Kind::State).count();
        let states = States::written(moving, states, |numbers| structure.save(numbers));
        Ok(Plant { structure, rig, states, sample_rate_hz, sample: 0 })
    }

    /// The plant at sample `sample` in the states of that sample. Its motion continues from there; its readings do not,
    /// as converters and instruments have gathered nothing: for them see [`Plant::restored`].
    ///
    /// # Errors
    /// [`PlantError::Structure`] if these are not the states of the structure.
    pub fn at(mut self, sample: u64, states: &[f64]) -> Result<Plant, PlantError> {
        self.structure.restore(states).map_err(|source| PlantError::new(sample, source))?;
        self.structure.save(self.states.numbers_mut());
        self.sample = sample;
        Ok(self)
    }

    /// All that a run at the sample depends on, before its [`Plant::measure`]: the states, and what converters and
    /// instruments have gathered.
    pub fn save(&mut self) -> Vec<f64> {
        let mut saved = vec![0.0; self.structure.saved_len()];
        self.structure.save(&mut saved);
        saved.extend(self.rig.gathered());
        saved
    }

    /// The plant at sample `sample` as [`Plant::save`] had it there: motion and readings continue with the same bits.
    ///
    /// # Errors
    /// [`PlantError::Structure`], [`PlantError::Saved`] if it was another plant.
    pub fn restored(self, sample: u64, saved: &[f64]) -> Result<Plant, PlantError> {
        self.restored_with(sample, sample, saved)
    }

    /// The same of a plant that was saved after the sample's [`Plant::measure`]: it is advanced next.
    ///
    /// # Errors
    /// As [`Plant::restored`].
    pub fn restored_measured(self, sample: u64, saved: &[f64]) -> Result<Plant, PlantError> {
        self.restored_with(sample, sample + 1, saved)
    }

    /// The plant at sample `sample`, whose instruments read sample `next` next.
    fn restored_with(self, sample: u64, next: u64, saved: &[f64]) -> Result<Plant, PlantError> {
        let (structure, instruments) = saved.split_at(self.structure.saved_len().min(saved.len()));
        let mut plant = self.at(sample, structure)?;
        if plant.rig.restore(next, instruments) { Ok(plant) } else { Err(PlantError::Saved { got: saved.len() }) }
    }

    /// The structure under test.
    pub fn structure(&self) -> &dyn Structure {
        &*self.structure
    }

    /// The exciter, which limits the loads.
    pub fn exciter(&self) -> &Exciter {
        self.rig.exciter()
    }

    /// The loads that the plant takes.
    pub fn inputs(&self) -> LoadSet {
        self.structure.inputs()
    }

    /// The limits of commands beyond the exciter's.
    pub fn gate(&self) -> &GateSpec {
        self.rig.gate()
    }

    /// The distance from rest of the point that the exciter acts on, m: that of the tip, or of a shaker's armature,
    /// without sign.
    pub fn travel_m(&self) -> f64 {
        self.structure.travel_m()
    }

    /// The same distance, if the gate limits it.
    pub fn limited_travel_m(&self) -> Option<f64> {
        // Most gates have no such limit, and of a chain it takes the sines of its angles again.
        self.gate().travel_limit_m.map(|_| self.travel_m())
    }

    /// The index of the current sample.
    pub fn sample(&self) -> u64 {
        self.sample
    }

    /// The time of the current sample, s.
    pub fn time_s(&self) -> f64 {
        self.sample as f64 / self.sample_rate_hz
    }

    /// The states at the sample, as [`Structure::states`] names them.
    pub fn states(&self) -> &States {
        &self.states
    }

    /// The readings at the sample: the converters' samples, through the instruments' chains. Before sample 0 all values
    /// have always been those of the start. Call it once a sample: every call draws new noise.
    pub fn measure(&mut self) -> Measurement {
        let mut sampled = [0.0; MOST_CHANNELS];
        let sampled = &mut sampled[..self.structure.outputs().len().min(MOST_CHANNELS)];
        self.structure.sense(sampled);
        self.rig.measure(self.sample, sampled)
    }

    /// Advances to the next sample with `load` held: with a shaker, the force that it would exert if it were blocked.
    ///
    /// # Errors
    /// [`PlantError`] if the structure does not take a part of the load, the step could not be made or the shaker
    /// trips; the plant then stays unchanged.
    pub fn advance(&mut self, load: &Load) -> Result<(), PlantError> {
        let advanced = match self.structure.inputs().lacks(load) {
            Some((place, got)) => Err(StructureError::NoInput { name: LOADS[place].name, got }),
            None => self.structure.advance(self.time_s(), load),
        };
        advanced.map_err(|source| PlantError::new(self.sample, source))?;
        self.structure.save(self.states.numbers_mut());
        self.sample += 1;
        Ok(())
    }
}

/// Writes `numbers`, as many as there is room for; returns the rest.
fn write<'a>(to: &'a mut [f64], numbers: &[f64]) -> &'a mut [f64] {
    let (head, rest) = to.split_at_mut(numbers.len().min(to.len()));
    head.iter_mut().zip(numbers).for_each(|(to, number)| *to = *number);
    rest
}

#[cfg(test)]
mod load_tests;
#[cfg(test)]
mod sampling_tests;
#[cfg(test)]
pub(crate) mod shaken_tests;
#[cfg(test)]
mod stepped_tests;
#[cfg(test)]
mod structure_tests;
#[cfg(test)]
pub(crate) mod tests;
