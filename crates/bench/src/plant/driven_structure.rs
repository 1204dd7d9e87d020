//! A structure that is stepped, with an ideal exciter or a shaker, and converters.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Vector2;

use super::assembly_steps::AssemblySteps;
use super::other_sensors::{CurrentChange, OtherSensors};
use super::sampling::{Filter, PointMotion, Sums};
use super::shaken::Shaken;
use super::stepped::Stepped;
use super::tested::TestedAssembly;
use super::{PlantSpec, PlantSpecError, write};
use crate::rig::{Load, Measurement};
use crate::structure::{Channel, LoadSet, OUTPUTS, Structure, StructureError};

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
}

/// The structure at a sample.
#[derive(Clone, Debug)]
pub(super) struct DrivenStructure {
    steps: Steps,
    steps_per_sample: u32,
    step_s: f64,
    filter: Option<Filter>,
    /// The converters' last samples: head x, y; B x, y; C x, y.
    sampled: [f64; Measurement::CHANNELS],
    sums: Sums,
    /// The sensors beside B and C.
    more: OtherSensors,
    /// What the converters sample: head, B, C and those sensors.
    outputs: Vec<Channel>,
    /// The state at the start of a hold, to which a hold that can't be finished returns.
    before: Vec<f64>,
}

/// The motion at the start of the first step of a hold, of length `step_s`, s, under the loads of the hold.
fn begun(steps: &dyn Stepped, from: &PointMotion, to: &PointMotion, step_s: f64) -> PointMotion {
    let start = |point: usize, axis: usize| {
        let velocity = [from, to].map(|at| at.velocity_m_s[point][axis]);
        let acceleration = [from, to].map(|at| at.acceleration_m_s2[point][axis]);
        steps.acceleration_at_start(velocity, acceleration, step_s)
    };
    let acceleration_m_s2 = [0, 1].map(|point| Vector2::new(start(point, 0), start(point, 1)));
    PointMotion { acceleration_m_s2, ..*from }
}

/// The integration step, s.
fn step_s(spec: &PlantSpec) -> f64 {
    1.0 / (spec.sample_rate_hz * f64::from(spec.steps_per_sample))
}

impl DrivenStructure {
    /// The structure of a valid specification with an ideal exciter, in its state at sample 0.
    pub fn new(spec: &PlantSpec, steps: Box<dyn Stepped>) -> Result<DrivenStructure, PlantSpecError> {
        let more = steps.sensors().to_vec();
        DrivenStructure::of(spec, Steps::Ideal(steps), f64::INFINITY, more)
    }

    /// The structure of a valid specification, with its shaker if it has one, at sample 0.
    pub fn assembly(spec: &PlantSpec, tested: &TestedAssembly) -> Result<DrivenStructure, PlantSpecError> {
        let more = tested.places.more_channels();
        match spec.rig.shaker {
            None => {
                let steps = Steps::Ideal(Box::new(AssemblySteps::new(spec, tested)?));
                DrivenStructure::of(spec, steps, f64::INFINITY, more)
            }
            Some(shaker) => {
                let shaken = Shaken::new(spec, tested, shaker, step_s(spec))?;
                let decay = shaken.decay();
                DrivenStructure::of(spec, Steps::Shaken(Box::new(shaken)), decay, more)
            }
        }
    }

    fn of(spec: &PlantSpec, steps: Steps, decay: f64, more: Vec<Channel>) -> Result<DrivenStructure, PlantSpecError> {
        super::check_steps_per_sample(spec.steps_per_sample)?;
        let step_s = step_s(spec);
        let mut driven = DrivenStructure {
            steps_per_sample: spec.steps_per_sample,
            step_s,
            filter: Filter::new(spec, step_s, decay),
            sampled: [0.0; Measurement::CHANNELS],
            sums: Sums::default(),
            outputs: [&OUTPUTS[..], &more].concat(),
            more: OtherSensors::new(more),
            before: vec![0.0; steps.of().states().len()],
            steps,
        };
        driven.settle()?;
        Ok(driven)
    }

    /// The converters as if they had always sampled the outputs at the state without a load.
    fn settle(&mut self) -> Result<(), StructureError> {
        let none = Load::default();
        self.sampled = match &self.steps {
            Steps::Ideal(steps) => Self::instant(&steps.points(0.0, &none)?, &none),
            Steps::Shaken(shaken) => shaken.instant(&none),
        };
        let filter = self.filter.as_ref();
        self.sums = filter.map(|filter| filter.settled(&self.sampled)).unwrap_or_default();
        match &self.steps {
            Steps::Ideal(steps) => {
                steps.more(0.0, &none, &mut self.more.start)?;
                self.more.settle(filter);
            }
            Steps::Shaken(shaken) => shaken.settle_more(&mut self.more, filter),
        }
        Ok(())
    }

    /// What the outputs are at an instant: with an ideal exciter the head reads the force.
    fn instant(at: &PointMotion, load: &Load) -> [f64; Measurement::CHANNELS] {
        let [b, c] = at.acceleration_m_s2;
        [load.force_n.x, load.force_n.y, b.x, b.y, c.x, c.y]
    }

    /// Makes the steps of a hold.
    fn hold(&mut self, time_s: f64, load: &Load) -> Result<(), StructureError> {
        let (mut sums, mut sampled) = (self.sums, self.sampled);
        let more = &mut self.more;
        let steps = match &mut self.steps {
            Steps::Ideal(steps) => steps,
            Steps::Shaken(shaken) => {
                let filter = self.filter.as_ref();
                sampled = shaken.hold((time_s, self.steps_per_sample), load, (filter, &mut sums), more)?;
                self.gather(sums, sampled);
                return Ok(());
            }
        };
        let mut start = self.filter.as_ref().map(|_| steps.points(time_s, load)).transpose()?;
        if start.is_some() && !more.is_empty() {
            steps.more(time_s, load, &mut more.end)?;
        }
        for part in 0..self.steps_per_sample {
            let t_s = time_s + f64::from(part) * self.step_s;
            steps.advance(t_s, load)?;
            let end_s = t_s + self.step_s;
            if let (Some(filter), Some(from)) = (&self.filter, start) {
                let ended = steps.points(end_s, load)?;
                let from = if part == 0 { begun(&**steps, &from, &ended, self.step_s) } else { from };
                filter.add_held(&mut sums, part as usize, &from, &ended, [load.force_n.x, load.force_n.y]);
                start = Some(ended);
                if !more.is_empty() {
                    more.step_on();
                    steps.more(end_s, load, &mut more.end)?;
                    if part == 0 {
                        more.begin_step(|velocity, acceleration| {
                            steps.acceleration_at_start(velocity, acceleration, self.step_s)
                        });
                    }
                    more.add(filter, part as usize, CurrentChange::default());
                }
            } else if 2 * (part + 1) == self.steps_per_sample {
                sampled = Self::instant(&steps.points(end_s, load)?, load);
                if !more.is_empty() {
                    steps.more(end_s, load, &mut more.end)?;
                    more.sample();
                }
            }
        }
        self.gather(sums, sampled);
        Ok(())
    }

    /// Ends a hold with the sums of the filter, or with what was sampled without one.
    fn gather(&mut self, mut sums: Sums, sampled: [f64; Measurement::CHANNELS]) {
        self.sampled = if self.filter.is_some() { Filter::read(&mut sums) } else { sampled };
        self.sums = sums;
        if self.filter.is_some() {
            self.more.read();
        }
    }
}

impl Structure for DrivenStructure {
    fn inputs(&self) -> LoadSet {
        self.steps.of().inputs()
    }

    fn outputs(&self) -> &[Channel] {
        &self.outputs
    }

    fn states(&self) -> &[Channel] {
        self.steps.of().states()
    }

    fn saved_len(&self) -> usize {
        let has_filter = self.filter.is_some();
        let sums = if has_filter { self.sums.as_flattened().len() } else { 0 };
        self.states().len() + OUTPUTS.len() + sums + self.more.saved_len(has_filter)
    }

    fn advance(&mut self, time_s: f64, load: &Load) -> Result<(), StructureError> {
        self.steps.of().save(&mut self.before);
        self.more.begin();
        let held = self.hold(time_s, load);
        if held.is_err() {
            self.steps.of_mut().restore(&self.before)?;
            self.more.undo();
        }
        held
    }

    fn sense(&self, outputs: &mut [f64]) {
        self.more.sense(write(outputs, &self.sampled));
    }

    fn save(&self, saved: &mut [f64]) {
        let (states, rest) = saved.split_at_mut(self.states().len().min(saved.len()));
        if states.len() == self.states().len() {
            self.steps.of().save(states);
            let mut rest = write(rest, &self.sampled);
            if self.filter.is_some() {
                rest = write(rest, self.sums.as_flattened());
            }
            self.more.save(rest, self.filter.is_some());
        }
    }

    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError> {
        let (states, all) = (self.states().len(), self.saved_len());
        let got = saved.iter().position(|number| !number.is_finite()).unwrap_or(saved.len());
        if got != saved.len() || (got != states && got != all) {
            return Err(StructureError::Saved { got, states, all });
        }
        let (states, rest) = saved.split_at(states);
        self.steps.of_mut().restore(states)?;
        match rest.split_first_chunk() {
            Some((sampled, rest)) => {
                self.sampled = *sampled;
                let sums = self.sums.as_flattened_mut();
                let count = if self.filter.is_some() { sums.len() } else { 0 };
                let (own, more) = rest.split_at(count.min(rest.len()));
                write(sums, own);
                self.more.restore(more, self.filter.is_some());
                Ok(())
            }
            None => self.settle(),
        }
    }

    fn travel_m(&self) -> f64 {
        self.steps.of().travel_m()
    }

    fn boxed_clone(&self) -> Box<dyn Structure> {
        Box::new(self.clone())
    }
}
