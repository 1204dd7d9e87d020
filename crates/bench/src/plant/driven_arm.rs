//! The arm with its exciter and converters, as a structure.

use alloc::boxed::Box;
use alloc::vec::Vec;

use nalgebra::Vector2;

use super::sampling::{Filter, PointMotion, Step, Sums};
use super::shaker::{Drive, Shaker};
use super::{PlantSpec, PlantSpecError, write};
use crate::rig::Measurement;
use crate::structure::{Channel, Kind, LOADS, OUTPUTS, STATES, Structure, StructureError};
use resonarm_dynamics::arm::{Arm, Load, State};
use resonarm_dynamics::integrate::{IntegrateError, Integrator};

/// The arm at a sample.
#[derive(Clone, Debug)]
pub(super) struct DrivenArm {
    arm: Arm,
    integrator: Integrator,
    steps_per_sample: u32,
    filter: Option<Filter>,
    states: Vec<Channel>,
    /// Point C at rest, m.
    tip_at_rest_m: Vector2<f64>,
    now: Now,
}

/// What changes from sample to sample.
#[derive(Clone, Copy, Debug)]
struct Now {
    state: State,
    shaker: Option<Shaker>,
    /// The converters' last samples: head x, y; B x, y; C x, y.
    sampled: [f64; Measurement::CHANNELS],
    /// The sums of the converters' filter, if they have one.
    sums: Sums,
}

/// A hold in progress.
struct Hold {
    /// When it began, s.
    start_s: f64,
    load: Load,
    /// The motion at the end of the last step, if the drive is continuous there.
    end: Option<PointMotion>,
}

/// Force in the head, N, and accelerations of B and C, m/s², along x and y, at a state of the arm with its attachment;
/// `load` acts on both, and the head is between them.
pub(super) fn instant(arm: &Arm, state: &State, load: &Load) -> [f64; Measurement::CHANNELS] {
    let acceleration_rad_s2 = arm.acceleration(state, load);
    let motion = arm.point_accelerations(state, &acceleration_rad_s2);
    let head_n = load.force_n - arm.attachment_force_n(state, &acceleration_rad_s2);
    [head_n.x, head_n.y, motion.b_m_s2.x, motion.b_m_s2.y, motion.c_m_s2.x, motion.c_m_s2.y]
}

impl DrivenArm {
    /// The arm of a valid rig at sample 0.
    pub fn new(spec: &PlantSpec) -> Result<DrivenArm, PlantSpecError> {
        let arm = spec.arm()?;
        if !spec.initial.is_finite() {
            let (x, v) = (&spec.initial.alpha_rad, &spec.initial.alpha_dot_rad_s);
            return Err(PlantSpecError::Initial([x.x, x.y, v.x, v.y]));
        }
        super::check_steps_per_sample(spec.steps_per_sample)?;
        let rate_hz = spec.sample_rate_hz * f64::from(spec.steps_per_sample);
        let integrator = Integrator::new(spec.scheme, rate_hz, &arm)?;
        let shaker = spec.rig.shaker.map(|shaker| Shaker::new(shaker, integrator.step_s())).transpose()?;
        let decay = shaker.as_ref().map_or(f64::INFINITY, Shaker::decay);
        let filter = Filter::new(spec, integrator.step_s(), decay);
        let is_state = |kind: Kind| kind == Kind::State || (kind == Kind::Internal && shaker.is_some());
        let states = STATES.into_iter().filter(|channel| is_state(channel.kind)).collect();
        let now = Now { state: spec.initial, shaker, sampled: Default::default(), sums: Sums::default() };
        let tip_at_rest_m = arm.points(&Vector2::zeros()).c_m;
        let steps_per_sample = spec.steps_per_sample;
        let mut driven = DrivenArm { arm, integrator, steps_per_sample, filter, states, tip_at_rest_m, now };
        driven.settle();
        Ok(driven)
    }

    /// The converters as if they had always sampled the outputs at the state without a load.
    fn settle(&mut self) {
        self.now.sampled = instant(&self.arm, &self.now.state, &Load::default());
        self.now.sums = self.filter.as_ref().map(|filter| filter.settled(&self.now.sampled)).unwrap_or_default();
    }

    /// Makes step `part` of a hold.
    fn step(&mut self, hold: &mut Hold, part: u32) -> Result<(), IntegrateError> {
        let (Hold { start_s, load, end }, next) = (hold, &mut self.now);
        let t_s = *start_s + f64::from(part) * self.integrator.step_s();
        let from = next.state;
        next.state = match &mut next.shaker {
            None => self.integrator.step(&self.arm, t_s, &from, load),
            Some(shaker) => shaker.step(&self.integrator, &self.arm, t_s, &from, load),
        }?;
        match &self.filter {
            Some(filter) => {
                let drive = next.shaker.as_ref().map_or(Drive::Held(*load), Shaker::drive);
                let at = |state: &State, tau: f64| PointMotion::new(&self.arm, state, &drive.steady(tau));
                let start = end.unwrap_or_else(|| at(&from, 0.0));
                let ended = at(&next.state, 1.0);
                let step = Step { arm: &self.arm, from: &from, start, end: ended, drive: &drive };
                filter.add(&mut next.sums, part as usize, &step);
                *end = matches!(drive, Drive::Held(_)).then_some(ended);
            }
            None if 2 * (part + 1) == self.steps_per_sample => {
                let acting = next.shaker.as_ref().map_or(*load, Shaker::acting);
                next.sampled = instant(&self.arm, &next.state, &acting);
            }
            None => {}
        }
        Ok(())
    }

    /// Makes all steps of a hold. After an error the arm is somewhere within it.
    fn hold(&mut self, start_s: f64, load: Load) -> Result<(), StructureError> {
        let mut hold = Hold { start_s, load, end: None };
        for part in 0..self.steps_per_sample {
            self.step(&mut hold, part)?;
        }
        let now = &mut self.now;
        let exceeded = now.shaker.as_ref().and_then(|shaker| shaker.exceeded(&self.arm, &now.state));
        if let Some((limit, got, most)) = exceeded {
            return Err(StructureError::Tripped { limit, got, most });
        }
        if self.filter.is_some() {
            now.sampled = Filter::read(&mut now.sums);
        }
        Ok(())
    }
}

impl Structure for DrivenArm {
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
        self.states.len() + OUTPUTS.len() + if self.filter.is_some() { self.now.sums.as_flattened().len() } else { 0 }
    }

    fn advance(&mut self, time_s: f64, inputs: &[f64]) -> Result<(), StructureError> {
        let [u1, u2, fx, fy] = *inputs else {
            return Err(StructureError::Inputs { got: inputs.len(), expected: LOADS.len() });
        };
        let load = Load { torque_nm: Vector2::new(u1, u2), force_n: Vector2::new(fx, fy) };
        let before = self.now;
        let held = self.hold(time_s, load);
        if held.is_err() {
            self.now = before;
        }
        held
    }

    fn sense(&self, outputs: &mut [f64]) {
        write(outputs, &self.now.sampled);
    }

    fn save(&self, saved: &mut [f64]) {
        let (x, v) = (&self.now.state.alpha_rad, &self.now.state.alpha_dot_rad_s);
        let rest = write(saved, &[x.x, x.y, v.x, v.y]);
        let rest = match &self.now.shaker {
            Some(shaker) => write(rest, &[shaker.current_a()]),
            None => rest,
        };
        let rest = write(rest, &self.now.sampled);
        write(rest, self.now.sums.as_flattened());
    }

    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError> {
        let (states, all) = (self.states.len(), self.saved_len());
        let got = saved.iter().position(|number| !number.is_finite()).unwrap_or(saved.len());
        let ([x1, x2, v1, v2], rest) = match saved.split_first_chunk() {
            Some(split) if got == saved.len() && (got == states || got == all) => split,
            _ => return Err(StructureError::Saved { got, states, all }),
        };
        self.now.state = State::new([*x1, *x2], [*v1, *v2]);
        let (device, rest) = rest.split_at(states - 4);
        if let (Some(shaker), [current_a]) = (&mut self.now.shaker, device) {
            *shaker = shaker.with_current(*current_a);
        }
        match rest.split_first_chunk() {
            Some((sampled, sums)) => {
                self.now.sampled = *sampled;
                write(self.now.sums.as_flattened_mut(), sums);
            }
            None => self.settle(),
        }
        Ok(())
    }

    fn travel_m(&self) -> f64 {
        match self.now.shaker {
            Some(_) => self.arm.attachment_motion(&self.now.state).0.abs(),
            None => (self.arm.points(&self.now.state.alpha_rad).c_m - self.tip_at_rest_m).norm(),
        }
    }

    fn boxed_clone(&self) -> Box<dyn Structure> {
        Box::new(self.clone())
    }
}
