//! A structure that is stepped, with an ideal exciter or a shaker, and converters.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::assembly_steps::AssemblySteps;
use super::sampler::{CurrentChange, Sampler};
use super::sampling::{Course, Filter};
use super::shaken::Shaken;
use super::stepped::Stepped;
use super::tested::TestedAssembly;
use super::{PlantSpec, PlantSpecError};
use crate::rig::Load;
use crate::structure::{Channel, LoadSet, Structure, StructureError};

/// What makes the steps, by what drives it.
#[derive(Clone, Debug)]
enum Steps {
    /// The steps of a structure that an ideal exciter drives.
    Ideal(Box<dyn Stepped>),
    /// The steps of a structure with the coil of a shaker.
    Shaken(Box<Shaken>),
}

impl Steps {
    fn of(&self) -> &dyn Stepped {
        match self {
            Steps::Ideal(steps) => &**steps,
            Steps::Shaken(shaken) => &shaken.steps,
        }
    }

    fn of_mut(&mut self) -> &mut dyn Stepped {
        match self {
            Steps::Ideal(steps) => &mut **steps,
            Steps::Shaken(shaken) => &mut shaken.steps,
        }
    }

    /// Reads the motion at the time `t_s`, s, as that at the end of a step.
    fn read(&mut self, t_s: f64, load: &Load, sampler: &mut Sampler) -> Result<(), StructureError> {
        match self {
            Steps::Ideal(steps) => steps.read(t_s, load, &mut sampler.end),
            Steps::Shaken(shaken) => {
                shaken.read(load, sampler);
                Ok(())
            }
        }
    }

    /// Makes the end of a step the start of the next.
    fn step_on(&mut self) {
        if let Steps::Shaken(shaken) = self {
            shaken.step_on();
        }
    }

    /// The force in the head at the end of a step, N: with an ideal exciter the head reads the force of the load.
    fn head_n(&self, load: &Load) -> [f64; 2] {
        match self {
            Steps::Ideal(_) => [load.force_n.x, load.force_n.y],
            Steps::Shaken(shaken) => shaken.head_n(),
        }
    }

    /// The force in the head over a step, N, and how the current of a coil changes over it.
    fn course(&self, filter: &Filter, load: &Load) -> ([Course; 2], Option<CurrentChange>) {
        match self {
            Steps::Ideal(_) => ([load.force_n.x, load.force_n.y].map(|held_n| [held_n, 0.0, 0.0, 0.0, 0.0, 0.0]), None),
            Steps::Shaken(shaken) => {
                let (head_n, change) = shaken.course(filter, load);
                (head_n, Some(change))
            }
        }
    }

    /// Checks what may end a hold.
    fn check_limits(&self, load: &Load) -> Result<(), StructureError> {
        match self {
            Steps::Ideal(_) => Ok(()),
            Steps::Shaken(shaken) => shaken.check_limits(load),
        }
    }
}

/// The structure at a sample.
#[derive(Clone, Debug)]
pub(super) struct DrivenStructure {
    steps: Steps,
    steps_per_sample: u32,
    step_s: f64,
    sampler: Sampler,
    /// The state at the start of a hold, to which a hold that can't be finished returns.
    before: Vec<f64>,
}

/// The integration step, s.
fn step_s(spec: &PlantSpec) -> f64 {
    1.0 / (spec.sample_rate_hz * f64::from(spec.steps_per_sample))
}

impl DrivenStructure {
    /// The structure of a valid specification with an ideal exciter, in its state at sample 0.
    pub fn new(spec: &PlantSpec, steps: Box<dyn Stepped>) -> Result<DrivenStructure, PlantSpecError> {
        DrivenStructure::of(spec, Steps::Ideal(steps), f64::INFINITY)
    }

    /// The structure of a valid specification, with its shaker if it has one, at sample 0.
    pub fn assembly(spec: &PlantSpec, tested: &TestedAssembly) -> Result<DrivenStructure, PlantSpecError> {
        match spec.rig.shaker {
            None => DrivenStructure::new(spec, Box::new(AssemblySteps::new(spec, tested)?)),
            Some(shaker) => {
                let shaken = Shaken::new(spec, tested, shaker, step_s(spec))?;
                let decay = shaken.decay();
                DrivenStructure::of(spec, Steps::Shaken(Box::new(shaken)), decay)
            }
        }
    }

    /// `decay` is λ of the filter's courses: infinite without a coil.
    fn of(spec: &PlantSpec, steps: Steps, decay: f64) -> Result<DrivenStructure, PlantSpecError> {
        super::check_steps_per_sample(spec.steps_per_sample)?;
        let step_s = step_s(spec);
        let mut driven = DrivenStructure {
            steps_per_sample: spec.steps_per_sample,
            step_s,
            sampler: Sampler::new(Filter::new(spec, step_s, decay), steps.of().sensors()),
            before: vec![0.0; steps.of().states().len()],
            steps,
        };
        driven.settle()?;
        Ok(driven)
    }

    /// The converters as if they had always sampled the outputs at the state without a load.
    fn settle(&mut self) -> Result<(), StructureError> {
        let none = Load::default();
        self.steps.read(0.0, &none, &mut self.sampler)?;
        self.sampler.settle(self.steps.head_n(&none));
        Ok(())
    }

    /// Makes the steps of a hold.
    fn hold(&mut self, time_s: f64, load: &Load) -> Result<(), StructureError> {
        let DrivenStructure { steps, sampler, step_s, .. } = self;
        let is_filtered = sampler.filter().is_some();
        if is_filtered {
            // The load has jumped, and the accelerations with it: the motion is read anew.
            steps.read(time_s, load, sampler)?;
        }
        for part in 0..self.steps_per_sample {
            let t_s = time_s + f64::from(part) * *step_s;
            steps.of_mut().advance(t_s, load)?;
            let end_s = t_s + *step_s;
            if is_filtered {
                sampler.step_on();
                steps.step_on();
                steps.read(end_s, load, sampler)?;
                if part == 0 {
                    let stepped = steps.of();
                    sampler.begin_step(|velocity, acceleration| {
                        stepped.acceleration_at_start(velocity, acceleration, *step_s)
                    });
                }
                if let Some(filter) = sampler.filter() {
                    let (head_n, change) = steps.course(filter, load);
                    sampler.add(part as usize, &head_n, change);
                }
            } else if 2 * (part + 1) == self.steps_per_sample {
                steps.read(end_s, load, sampler)?;
                sampler.sample(steps.head_n(load));
            }
        }
        sampler.end_hold();
        steps.check_limits(load)
    }
}

impl Structure for DrivenStructure {
    fn inputs(&self) -> LoadSet {
        self.steps.of().inputs()
    }

    fn outputs(&self) -> &[Channel] {
        self.sampler.channels()
    }

    fn states(&self) -> &[Channel] {
        self.steps.of().states()
    }

    fn saved_len(&self) -> usize {
        self.states().len() + self.sampler.saved_len()
    }

    fn advance(&mut self, time_s: f64, load: &Load) -> Result<(), StructureError> {
        self.steps.of().save(&mut self.before);
        self.sampler.begin();
        let held = self.hold(time_s, load);
        if held.is_err() {
            self.steps.of_mut().restore(&self.before)?;
            self.sampler.undo();
        }
        held
    }

    fn sense(&self, outputs: &mut [f64]) {
        self.sampler.sense(outputs);
    }

    fn save(&self, saved: &mut [f64]) {
        let (states, gathered) = saved.split_at_mut(self.states().len().min(saved.len()));
        if states.len() == self.states().len() {
            self.steps.of().save(states);
            self.sampler.save(gathered);
        }
    }

    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError> {
        let states = self.states().len();
        let all = self.saved_len();
        let got = saved.iter().position(|number| !number.is_finite()).unwrap_or(saved.len());
        if got != saved.len() || (got != states && got != all) {
            return Err(StructureError::Saved { got, states, all });
        }
        let (states, gathered) = saved.split_at(states);
        self.steps.of_mut().restore(states)?;
        if gathered.is_empty() {
            return self.settle();
        }
        self.sampler.restore(gathered);
        Ok(())
    }

    fn travel_m(&self) -> f64 {
        self.steps.of().travel_m()
    }

    fn boxed_clone(&self) -> Box<dyn Structure> {
        Box::new(self.clone())
    }
}
