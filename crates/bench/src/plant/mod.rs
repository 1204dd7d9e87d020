//! The plant: the arm, its instruments and an integrator, sample by sample.
//!
//! One sample is: [`Plant::measure`], a command from outside, [`Plant::advance`] with the command held (zero-order) up
//! to the next sample. The same specification and the same commands give the same states and readings, bit for bit.
//!
//! A held load jumps at every sample, and the accelerations with it, so a reading belongs to the middle of a hold: the
//! last one, or an earlier one if the converter's filter has a delay ([`Converter`](crate::rig::Converter)). Force and
//! accelerations of a sample then agree in phase; read at the edge, the part of the acceleration that follows the force
//! at once would lag the rest by half a period, an error of up to some per cent in a frequency response.

mod sampling;
mod shaker;

use nalgebra::Vector2;
use thiserror::Error;

use crate::rig::{Exciter, GateSpec, Measurement, Rig, RigError, RigSpec, ShakerLimit};
use resonarm_dynamics::arm::{Arm, ArmError, Load, Parameters, Pose, State};
use resonarm_dynamics::integrate::{IntegrateError, Integrator, Scheme};
use resonarm_numeric::number::{rounded, short};
use sampling::{End, Filter, Step, Sums};
use shaker::{Drive, Shaker};

/// The most integration steps a sample: 250 times the default.
pub const MOST_STEPS_PER_SAMPLE: u32 = 1000;

/// Everything that makes a plant.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSpec {
    /// The arm's parameters.
    pub parameters: Parameters,
    /// The arm's pose.
    pub pose: Pose,
    /// The state at sample 0.
    pub initial: State,
    /// The integration scheme.
    pub scheme: Scheme,
    /// Samples a second, Hz, positive.
    pub sample_rate_hz: f64,
    /// Integration steps a sample: even, since the instruments sample in the middle, and from 2 to
    /// [`MOST_STEPS_PER_SAMPLE`].
    pub steps_per_sample: u32,
    /// The instruments.
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
        /// Why.
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
        /// The limit.
        most: f64,
    },
}

/// Why a specification is invalid.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PlantSpecError {
    /// The arm is impossible.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// An instrument is impossible.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The scheme can't carry the arm at this rate.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// The current of the shaker's coil changes too slowly for the step.
    #[error("rig.shaker: `inductance_h` is {got_h}: at this resistance and step in voltage mode it must be at most {most_h}", got_h = short(.got_h), most_h = short(.most_h))]
    Inductance {
        /// The given value, H.
        got_h: f64,
        /// The largest valid value, H.
        most_h: f64,
    },
    /// The initial state is not finite.
    #[error("the initial state {0:?} is not finite: give four numbers, rad and rad/s")]
    Initial([f64; 4]),
    /// The middle of a sample period is not at an integration step, or a sample has too many steps.
    #[error(
        "`steps_per_sample` is {got}: it must be even, since the instruments sample in the middle, and from 2 to \
         {MOST_STEPS_PER_SAMPLE}"
    )]
    StepsPerSample {
        /// The given value.
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

/// A plant at a sample.
#[derive(Clone, Debug)]
pub struct Plant {
    arm: Arm,
    integrator: Integrator,
    rig: Rig,
    shaker: Option<Shaker>,
    sample_rate_hz: f64,
    steps_per_sample: u32,
    sample: u64,
    state: State,
    /// The converters' last samples: head x, y; B x, y; C x, y.
    sampled: [f64; Measurement::CHANNELS],
    /// The converters' filter, if they have one, and its sums.
    filter: Option<Filter>,
    sums: Sums,
}

/// Force in the head, N, and accelerations of B and C, m/s², along x and y, at a state of the arm with its attachment;
/// `load` acts on both, and the head is between them.
fn instant(arm: &Arm, state: &State, load: &Load) -> [f64; Measurement::CHANNELS] {
    let acceleration_rad_s2 = arm.acceleration(state, load);
    let motion = arm.point_accelerations(state, &acceleration_rad_s2);
    let head_n = load.force_n - arm.attachment_force_n(state, &acceleration_rad_s2);
    [head_n.x, head_n.y, motion.b_m_s2.x, motion.b_m_s2.y, motion.c_m_s2.x, motion.c_m_s2.y]
}

impl Plant {
    /// A plant at sample 0.
    ///
    /// # Errors
    /// [`PlantSpecError`] says which part of the specification is invalid.
    pub fn new(spec: &PlantSpec) -> Result<Plant, PlantSpecError> {
        let rig = Rig::new(&spec.rig, spec.sample_rate_hz, spec.seed)?;
        let mut arm = Arm::new(spec.parameters, spec.pose)?;
        if let Some(shaker) = &spec.rig.shaker {
            arm = arm.with_attachment(shaker.armature())?;
        }
        if !spec.initial.is_finite() {
            let (x, v) = (&spec.initial.alpha_rad, &spec.initial.alpha_dot_rad_s);
            return Err(PlantSpecError::Initial([x.x, x.y, v.x, v.y]));
        }
        check_steps_per_sample(spec.steps_per_sample)?;
        let rate_hz = spec.sample_rate_hz * f64::from(spec.steps_per_sample);
        let integrator = Integrator::new(spec.scheme, rate_hz, &arm)?;
        let shaker = spec.rig.shaker.map(|shaker| Shaker::new(shaker, integrator.step_s())).transpose()?;
        let decay = shaker.as_ref().map_or(f64::INFINITY, Shaker::decay);
        let filter = Filter::new(spec, integrator.step_s(), decay);
        let sampled = instant(&arm, &spec.initial, &Load::default());
        let settled = |filter: &Filter| filter.settled(spec.rig.converter, &sampled);
        Ok(Plant {
            sums: filter.as_ref().map(settled).unwrap_or_default(),
            shaker,
            integrator,
            sampled,
            filter,
            arm,
            rig,
            sample_rate_hz: spec.sample_rate_hz,
            steps_per_sample: spec.steps_per_sample,
            sample: 0,
            state: spec.initial,
        })
    }

    /// The plant with its current sample numbered `sample`, for a run that continues from there.
    #[must_use]
    pub fn at_sample(self, sample: u64) -> Plant {
        Plant { sample, ..self }
    }

    /// The plant with a current in its shaker's coil, A; unchanged without a shaker.
    #[must_use]
    pub fn with_coil_current(self, current_a: f64) -> Plant {
        Plant { shaker: self.shaker.map(|shaker| shaker.with_current(current_a)), ..self }
    }

    /// The current in the coil of the shaker at the sample, A; `None` without a shaker.
    pub fn coil_current_a(&self) -> Option<f64> {
        self.shaker.as_ref().map(Shaker::current_a)
    }

    /// The arm, with the shaker's armature at its tip if there is one.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// The exciter of the arm.
    pub fn exciter(&self) -> &Exciter {
        self.rig.exciter()
    }

    /// The limits of commands beyond the exciter's.
    pub fn gate(&self) -> &GateSpec {
        self.rig.gate()
    }

    /// The distance from rest of the point that the exciter acts on, m: that of the tip, or of a shaker's armature,
    /// without sign.
    pub fn travel_m(&self) -> f64 {
        match self.shaker {
            Some(_) => self.arm.attachment_motion(&self.state).0.abs(),
            None => {
                let tip_m = |alpha_rad| self.arm.points(alpha_rad).c_m;
                (tip_m(&self.state.alpha_rad) - tip_m(&Vector2::zeros())).norm()
            }
        }
    }

    /// The index of the current sample.
    pub fn sample(&self) -> u64 {
        self.sample
    }

    /// The time of the current sample, s.
    pub fn time_s(&self) -> f64 {
        self.sample as f64 / self.sample_rate_hz
    }

    /// The state of the arm at the sample.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The readings at the sample: the converters' samples, through the instruments' chains. Before sample 0 all values
    /// have always been those of the start. Call it once a sample: every call draws new noise.
    pub fn measure(&mut self) -> Measurement {
        self.rig.measure(self.sample, &self.sampled)
    }

    /// Advances to the next sample with `load` held: with a shaker, the force that it would exert if it were blocked.
    ///
    /// # Errors
    /// [`PlantError`] if the step could not be made or the shaker trips; the plant then stays unchanged.
    pub fn advance(&mut self, load: &Load) -> Result<(), PlantError> {
        let mut hold =
            Hold { state: self.state, shaker: self.shaker, end: None, sums: self.sums, sampled: self.sampled };
        for part in 0..self.steps_per_sample {
            hold.step(self, part, load).map_err(|source| PlantError::Integrate { sample: self.sample, source })?;
        }
        if let Some((limit, got, most)) =
            hold.shaker.as_ref().and_then(|shaker| shaker.exceeded(&self.arm, &hold.state))
        {
            return Err(PlantError::Tripped { sample: self.sample, limit, got, most });
        }
        if self.filter.is_some() {
            hold.sampled = Filter::read(&mut hold.sums);
        }
        (self.state, self.shaker, self.sums, self.sampled) = (hold.state, hold.shaker, hold.sums, hold.sampled);
        self.sample += 1;
        Ok(())
    }
}

/// A hold in progress.
struct Hold {
    state: State,
    shaker: Option<Shaker>,
    /// The motion at the end of the last step, if the drive is continuous there.
    end: Option<End>,
    sums: Sums,
    sampled: [f64; Measurement::CHANNELS],
}

impl Hold {
    /// Makes step `part` of the hold.
    fn step(&mut self, plant: &Plant, part: u32, load: &Load) -> Result<(), IntegrateError> {
        let t_s = plant.time_s() + f64::from(part) * plant.integrator.step_s();
        let from = self.state;
        self.state = match &mut self.shaker {
            None => plant.integrator.step(&plant.arm, t_s, &from, load),
            Some(shaker) => shaker.step(&plant.integrator, &plant.arm, t_s, &from, load),
        }?;
        match &plant.filter {
            Some(filter) => {
                let drive = self.shaker.as_ref().map_or(Drive::Held(*load), Shaker::drive);
                let at = |state: &State, tau: f64| End::new(&plant.arm, state, &drive.steady(tau));
                let start = self.end.unwrap_or_else(|| at(&from, 0.0));
                let end = at(&self.state, 1.0);
                let step = Step { arm: &plant.arm, from: &from, start, end, drive: &drive };
                filter.add(&mut self.sums, part as usize, &step);
                self.end = matches!(drive, Drive::Held(_)).then_some(end);
            }
            None if 2 * (part + 1) == plant.steps_per_sample => {
                let acting = self.shaker.as_ref().map_or(*load, Shaker::acting);
                self.sampled = instant(&plant.arm, &self.state, &acting);
            }
            None => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod sampling_tests;
#[cfg(test)]
mod tests;
