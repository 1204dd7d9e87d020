//! The plant: the arm, its instruments and an integrator, sample by sample.
//!
//! One sample is: [`Plant::measure`], a command from outside, [`Plant::advance`] with the command held (zero-order) up to the
//! next sample. The same specification and the same commands give the same states and readings, bit for bit.
//!
//! A held load jumps at every sample, and the accelerations with it, so the instruments sample half a period before: in the
//! middle of the hold, as converters do that are triggered away from the edges of the output. Force and accelerations of a
//! sample then belong together in phase; read at the edge, the part of the acceleration that follows the force at once would
//! lag the rest by half a period, an error of a frequency response that reaches per cents.

use thiserror::Error;

use crate::arm::{Arm, ArmError, Load, Parameters, PointMotion, Pose, State};
use crate::integrate::{IntegrateError, Integrator, Scheme};
use crate::rig::{ExciterSpec, Measurement, Rig, RigError, RigSpec};

/// Everything that makes a plant.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Integration steps a sample: even and positive, since the instruments sample in the middle.
    pub steps_per_sample: u32,
    /// The instruments.
    pub rig: RigSpec,
    /// Seed of all noise.
    pub seed: u64,
}

/// What keeps a plant from being made or from going on.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PlantError {
    /// The integrator could not go on; the plant stays at the sample before.
    #[error("sample {sample}: {source}")]
    Integrate {
        /// The sample from which the step was tried.
        sample: u64,
        /// Why.
        source: IntegrateError,
    },
}

/// Why a specification makes no plant.
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
    /// The initial state is not finite.
    #[error("the initial state {0:?} is not finite: give four numbers, rad and rad/s")]
    Initial([f64; 4]),
    /// The middle of a sample period is no integration step.
    #[error("`steps_per_sample` is {got}: it must be even and at least 2, since the instruments sample in the middle")]
    StepsPerSample {
        /// What was given.
        got: u32,
    },
}

/// A plant at a sample.
#[derive(Clone, Debug)]
pub struct Plant {
    arm: Arm,
    integrator: Integrator,
    rig: Rig,
    sample_rate_hz: f64,
    steps_per_sample: u32,
    sample: u64,
    state: State,
    /// What the instruments sample: the truth in the middle of the last sample period; before the first, at its start.
    sensed: Sensed,
}

#[derive(Clone, Copy, Debug)]
struct Sensed {
    motion: PointMotion,
    load: Load,
}

impl Sensed {
    fn new(arm: &Arm, state: &State, load: &Load) -> Sensed {
        let motion = arm.point_accelerations(state, &arm.acceleration(state, load));
        Sensed { motion, load: *load }
    }
}

impl Plant {
    /// A plant at sample 0.
    ///
    /// # Errors
    /// [`PlantSpecError`] says what in the specification is impossible.
    pub fn new(spec: &PlantSpec) -> Result<Plant, PlantSpecError> {
        let arm = Arm::new(spec.parameters, spec.pose)?;
        if !spec.initial.is_finite() {
            let (x, v) = (&spec.initial.alpha_rad, &spec.initial.alpha_dot_rad_s);
            return Err(PlantSpecError::Initial([x.x, x.y, v.x, v.y]));
        }
        if spec.steps_per_sample == 0 || !spec.steps_per_sample.is_multiple_of(2) {
            return Err(PlantSpecError::StepsPerSample { got: spec.steps_per_sample });
        }
        let rate_hz = spec.sample_rate_hz * f64::from(spec.steps_per_sample);
        Ok(Plant {
            integrator: Integrator::new(spec.scheme, rate_hz, &arm)?,
            sensed: Sensed::new(&arm, &spec.initial, &Load::default()),
            arm,
            rig: Rig::new(&spec.rig, spec.seed)?,
            sample_rate_hz: spec.sample_rate_hz,
            steps_per_sample: spec.steps_per_sample,
            sample: 0,
            state: spec.initial,
        })
    }

    /// The arm.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// What the exciter can do.
    pub fn exciter(&self) -> &ExciterSpec {
        self.rig.exciter()
    }

    /// The index of the sample at which the plant stands.
    pub fn sample(&self) -> u64 {
        self.sample
    }

    /// The time of the sample at which the plant stands, s.
    pub fn time_s(&self) -> f64 {
        self.sample as f64 / self.sample_rate_hz
    }

    /// The state of the arm at the sample.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// What the instruments say at the sample: the truth half a sample period before, with noise, resolution and range. Call
    /// it once a sample: every call draws new noise.
    pub fn measure(&mut self) -> Measurement {
        self.rig.measure(self.sample, &self.sensed.motion, &self.sensed.load)
    }

    /// Advances to the next sample with `load` held.
    ///
    /// # Errors
    /// [`PlantError::Integrate`] if the step could not be made; the plant then stays as it was.
    pub fn advance(&mut self, load: &Load) -> Result<(), PlantError> {
        let start_s = self.time_s();
        let (mut state, mut sensed) = (self.state, self.sensed);
        for part in 0..self.steps_per_sample {
            let t_s = start_s + f64::from(part) * self.integrator.step_s();
            state = self
                .integrator
                .step(&self.arm, t_s, &state, load)
                .map_err(|source| PlantError::Integrate { sample: self.sample, source })?;
            if 2 * (part + 1) == self.steps_per_sample {
                sensed = Sensed::new(&self.arm, &state, load);
            }
        }
        self.state = state;
        self.sensed = sensed;
        self.sample += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Preset;

    fn spec() -> PlantSpec {
        PlantSpec {
            parameters: Preset::default().parameters().unwrap(),
            pose: Pose { beta1_deg: 20.0, beta2_deg: 60.0 },
            initial: State::default(),
            scheme: Scheme::default(),
            sample_rate_hz: 1000.0,
            steps_per_sample: 4,
            rig: RigSpec::default(),
            seed: 1,
        }
    }

    #[test]
    fn same_commands_give_the_same_bits() {
        let [mut a, mut b] = [(); 2].map(|()| Plant::new(&spec()).unwrap());
        for k in 0..500_u32 {
            assert_eq!(a.measure(), b.measure());
            let load = Load::force_n(f64::from(k % 17) - 8.0, 3.0);
            a.advance(&load).unwrap();
            b.advance(&load).unwrap();
            assert_eq!(a.state(), b.state());
        }
        assert_eq!(a.sample(), 500);
        assert!(a.state().alpha_rad.norm() > 1e-6);
    }

    #[test]
    fn at_rest_the_instruments_tell_the_held_force() {
        let mut plant = Plant::new(&spec()).unwrap();
        plant.advance(&Load::force_n(50.0, -20.0)).unwrap();
        let head = plant.measure().head_force_n;
        assert!((head[0].value - 50.0).abs() < 0.1 && (head[1].value + 20.0).abs() < 0.1, "{head:?}");
    }

    #[test]
    fn a_step_that_fails_changes_nothing() {
        let mut plant = Plant::new(&spec()).unwrap();
        plant.advance(&Load::force_n(1.0, 1.0)).unwrap();
        let before = *plant.state();
        let error = plant.advance(&Load::torque_nm(f64::MAX, f64::MAX)).unwrap_err();
        assert!(matches!(error, PlantError::Integrate { sample: 1, .. }), "{error}");
        assert_eq!((plant.sample(), *plant.state()), (1, before));
    }

    #[test]
    fn says_what_is_wrong_with_a_plant() {
        let says = |spec: PlantSpec| Plant::new(&spec).unwrap_err().to_string();
        insta::assert_snapshot!(says(PlantSpec { steps_per_sample: 0, ..spec() }), @"`steps_per_sample` is 0: it must be even and at least 2, since the instruments sample in the middle");
        let initial = State::new([0.0, f64::NAN], [0.0, 1.0]);
        insta::assert_snapshot!(says(PlantSpec { initial, ..spec() }), @"the initial state [0.0, NaN, 0.0, 1.0] is not finite: give four numbers, rad and rad/s");
        insta::assert_snapshot!(says(PlantSpec { sample_rate_hz: 0.0, ..spec() }), @"integration rate 0 Hz: it must be a positive number");
    }
}
