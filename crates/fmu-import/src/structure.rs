//! The FMU as a structure: stepped within a hold, or sampled by itself.

use std::sync::Arc;

use crate::error::ImportError;
use crate::instance::Instance;
use crate::mapping::{Sensed, Slot};
use crate::source::Source;
use crate::spec::ReadAt;
use resonarm_bench::plant::{Kinematics, Plant, PlantSpec, PlantSpecError, Stepped, instant};
use resonarm_bench::rig::{Load, Rig};
use resonarm_bench::structure::{Channel, ForeignFault, LOADS, LoadSet, OUTPUTS, Structure, StructureError};

impl Source {
    /// The plant of the FMU with the rig, the rates and the seed of a specification. The FMU is loaded to see how it
    /// begins; a run loads it again.
    ///
    /// # Errors
    /// [`ImportError`] if it can't be loaded, else [`PlantSpecError`] of the rig.
    pub fn plant(self: &Arc<Source>, spec: &PlantSpec) -> Result<Result<Plant, PlantSpecError>, ImportError> {
        let held = Held::new(Arc::clone(self))?;
        Ok(match self.read {
            ReadAt::Middle => Plant::stepped(spec, Box::new(held)),
            ReadAt::End => {
                let sampled = Sampled::new(held);
                Rig::new(&spec.rig, &sampled.outputs, spec.sample_rate_hz, spec.seed)
                    .map_err(PlantSpecError::from)
                    .and_then(|rig| Plant::of(Box::new(sampled), rig, spec.sample_rate_hz))
            }
        })
    }
}

/// The state of an FMU: whether it is loaded, and whether it can be stepped.
#[derive(Debug)]
enum Run {
    /// It is at its start; it is loaded with the first step.
    AtStart,
    Running(Box<Instance>),
    /// A step has failed, so that it can't be used any more.
    Failed,
    /// A copy of one that has moved, whose state no copy can have.
    Lost,
}

/// An FMU with what was read of it last.
#[derive(Debug)]
pub(crate) struct Held {
    source: Arc<Source>,
    run: Run,
    /// The variables that are set and read, in the units of the FMU.
    set: Vec<f64>,
    read: Vec<f64>,
    /// Receives what is read in a step; exchanged with `read` once the step has succeeded.
    next: Vec<f64>,
    /// The states to which a hold that failed has returned.
    kept: Vec<f64>,
    /// The loads that are set.
    loads: Option<[f64; Load::PARTS]>,
}

impl Clone for Held {
    /// A copy at the start; of an FMU that has moved one that can't be stepped.
    fn clone(&self) -> Held {
        let run = if matches!(self.run, Run::AtStart) { Run::AtStart } else { Run::Lost };
        let set = self.set.clone();
        let read = self.read.clone();
        let next = self.next.clone();
        let kept = self.kept.clone();
        Held { source: Arc::clone(&self.source), run, set, read, next, kept, loads: None }
    }
}

impl Held {
    /// The FMU at its start. It is loaded to read its outputs there, and let go again: there may be one instance alone.
    pub fn new(source: Arc<Source>) -> Result<Held, ImportError> {
        let mut read = vec![0.0; source.mapping.read.count];
        // One that ends the process when it is unloaded is refused here, before a run.
        Instance::start(&source, &mut read)?.end()?;
        let set = source.mapping.set_at_rest();
        Ok(Held { run: Run::AtStart, set, next: read.clone(), read, kept: Vec::new(), loads: None, source })
    }

    /// The instance, loaded if it is at its start.
    fn instance(&mut self, t_s: f64) -> Result<&mut Instance, StructureError> {
        let fails = |call, fault| StructureError::Foreign { call, t_s, fault };
        if matches!(self.run, Run::AtStart) {
            let mut at_start = vec![0.0; self.source.mapping.read.count];
            let started = Instance::start(&self.source, &mut at_start).map_err(|error| {
                tracing::error!("{error}");
                fails("loading", ForeignFault::NotLoaded)
            });
            self.run = Run::Running(Box::new(started?));
        }
        match &mut self.run {
            Run::Running(instance) => Ok(instance),
            Run::AtStart | Run::Failed => Err(fails("the step", ForeignFault::HasFailed)),
            Run::Lost => Err(fails("the step", ForeignFault::CopyOfRunning)),
        }
    }

    fn try_step(&mut self, t_s: f64, loads: &[f64; Load::PARTS]) -> Result<(), StructureError> {
        let source = Arc::clone(&self.source);
        let mapping = &source.mapping;
        // Compared by their bits: +0 and −0 are different inputs, and a NaN would never equal itself.
        let changes = self.loads.as_ref().map(|set| set.map(f64::to_bits)) != Some(loads.map(f64::to_bits));
        if changes {
            for (slot, load) in mapping.inputs.iter().zip(loads) {
                slot.iter().for_each(|slot| self.set[slot.index] = slot.conversion.of_si(*load));
            }
        }
        // Both are taken out of `self`, which `instance` borrows as a whole, and put back before an error is
        // returned.
        let set = core::mem::take(&mut self.set);
        let mut next = core::mem::take(&mut self.next);
        let done =
            self.instance(t_s).and_then(|instance| instance.step(t_s, source.step_s, (changes, &set), &mut next));
        self.set = set;
        self.next = next;
        done?;
        core::mem::swap(&mut self.read, &mut self.next);
        self.loads = Some(*loads);
        Ok(())
    }

    /// A number that was read, in SI units.
    fn si(&self, slot: &Slot) -> f64 {
        self.read.get(slot.index).map_or(f64::NAN, |value| slot.conversion.to_si(*value))
    }

    /// The motion that a sensor reads; 0 for the derivatives that it does not need.
    fn sensed(&self, sensed: &Sensed) -> Kinematics {
        let number = |slot: Option<Slot>| slot.map_or(0.0, |slot| self.si(&slot));
        Kinematics {
            displacement: number(sensed.displacement),
            velocity: number(sensed.velocity),
            acceleration: number(sensed.acceleration),
        }
    }
}

/// The FMU that is read after each step.
impl Stepped for Held {
    fn states(&self) -> &[Channel] {
        &self.source.mapping.channels
    }

    fn inputs(&self) -> LoadSet {
        self.source.mapping.loads()
    }

    /// A communication step with the loads held. They are set where they have changed.
    fn advance(&mut self, t_s: f64, load: &Load) -> Result<(), StructureError> {
        let loads = load.parts();
        let idle = self.source.mapping.inputs.iter().zip(loads).zip(&LOADS);
        if let Some(((_, got), channel)) = idle.into_iter().find(|((slot, load), _)| slot.is_none() && *load != 0.0) {
            return Err(StructureError::NoInput { name: channel.name, got });
        }
        let stepped = self.try_step(t_s, &loads);
        if stepped.is_err() {
            self.run = Run::Failed;
        }
        stepped
    }

    fn sensors(&self) -> &[Channel] {
        &self.source.mapping.sensor_channels
    }

    /// The motion at the end of the last step, under the loads of that step.
    fn read(&self, _t_s: f64, _load: &Load, out: &mut [Kinematics]) -> Result<(), StructureError> {
        let sensors = &self.source.mapping.sensors;
        out.iter_mut().zip(sensors).for_each(|(to, sensed)| *to = self.sensed(sensed));
        Ok(())
    }

    /// An FMU gives no accelerations under loads that were set and not yet stepped with. With a course that is linear
    /// over the step, that at its start follows from the mean, the change of velocity:
    ///
    /// ```text
    /// (v(h) − v(0)) / h = (a(0) + a(h)) / 2
    /// ```
    fn acceleration_at_start(&self, [from, to]: [f64; 2], [_, at_end]: [f64; 2], step_s: f64) -> f64 {
        (to - from) * (2.0 / step_s) - at_end
    }

    fn travel_m(&self) -> f64 {
        let [x, y, z] = self.source.mapping.travel.map(|slot| slot.map_or(0.0, |slot| self.si(&slot)));
        libm::hypot(libm::hypot(x, y), z)
    }

    fn save(&self, states: &mut [f64]) {
        states.iter_mut().zip(&self.source.mapping.states).for_each(|(to, slot)| *to = self.si(slot));
        states.iter_mut().zip(&self.kept).for_each(|(to, kept)| *to = *kept);
    }

    /// Takes up states: those that it has, if it is at its start.
    fn restore(&mut self, states: &[f64]) -> Result<(), StructureError> {
        let same = || {
            let own = self.source.mapping.states.iter().map(|slot| self.si(slot).to_bits());
            own.eq(states.iter().map(|state| state.to_bits()))
        };
        match self.run {
            Run::AtStart if same() => Ok(()),
            // What has failed has said so already, and can't be stepped: it stays at the sample before.
            Run::Failed => {
                self.kept = states.to_vec();
                Ok(())
            }
            _ => Err(StructureError::ForeignState),
        }
    }

    fn boxed_clone(&self) -> Box<dyn Stepped> {
        Box::new(self.clone())
    }
}

/// The FMU that samples its motion itself.
#[derive(Clone, Debug)]
pub(crate) struct Sampled {
    held: Held,
    outputs: Vec<Channel>,
    /// The force in the head, where the FMU does not give it: that of the last hold.
    force_n: [f64; 2],
}

impl Sampled {
    pub fn new(held: Held) -> Sampled {
        let outputs = [&OUTPUTS[..], &held.source.mapping.sensor_channels].concat();
        Sampled { held, outputs, force_n: [0.0; 2] }
    }
}

impl Structure for Sampled {
    fn inputs(&self) -> LoadSet {
        self.held.inputs()
    }

    fn outputs(&self) -> &[Channel] {
        &self.outputs
    }

    fn states(&self) -> &[Channel] {
        self.held.states()
    }

    fn saved_len(&self) -> usize {
        self.states().len() + self.outputs.len()
    }

    fn advance(&mut self, time_s: f64, load: &Load) -> Result<(), StructureError> {
        self.held.advance(time_s, load)?;
        self.force_n = [load.force_n.x, load.force_n.y];
        Ok(())
    }

    fn sense(&self, outputs: &mut [f64]) {
        let mapping = &self.held.source.mapping;
        let force = mapping.force.iter().zip(self.force_n);
        let head_n = force.map(|(slot, held_n)| slot.map_or(held_n, |slot| self.held.si(&slot)));
        let motions = mapping.sensors.iter().map(|sensed| self.held.sensed(sensed));
        // The channels of the head come first.
        let sensors = self.outputs[self.force_n.len()..].iter().zip(motions);
        let sensed = sensors.map(|(channel, motion)| instant(channel.quantity, &motion));
        outputs.iter_mut().zip(head_n.chain(sensed)).for_each(|(to, number)| *to = number);
    }

    fn save(&self, saved: &mut [f64]) {
        let (states, rest) = saved.split_at_mut(self.states().len().min(saved.len()));
        self.held.save(states);
        self.sense(rest);
    }

    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError> {
        let states = self.states().len();
        let all = self.saved_len();
        let got = saved.iter().position(|number| !number.is_finite()).unwrap_or(saved.len());
        if got != saved.len() || (got != states && got != all) {
            return Err(StructureError::Saved { got, states, all });
        }
        self.held.restore(&saved[..states])
    }

    fn travel_m(&self) -> f64 {
        self.held.travel_m()
    }

    fn boxed_clone(&self) -> Box<dyn Structure> {
        Box::new(self.clone())
    }
}
