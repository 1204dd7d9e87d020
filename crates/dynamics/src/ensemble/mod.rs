//! Many motions of one arm under one excitation at once, side by side in the lanes of the processor.
//!
//! Each motion has the same states, bit for bit, as if it were alone, on every processor: the step is the source of
//! [`Integrator::step`](crate::integrate::Integrator::step) with `dop853`, generic over one number or eight. The
//! implicit schemes, the default among them, can't run side by side: the number of iterations, the pivots and the
//! division of a step differ from motion to motion.

use crate::arm::coefficients::Coefficients;
use crate::arm::explicit;
use crate::arm::external::External;
use crate::arm::{Arm, Load, State};
use crate::integrate::Motion;
use crate::integrate::tableau::DOP853;
use crate::real::{Lanes, Real};
use resonarm_numeric::registers::{Task, widest};

/// Stages of a step.
pub const STAGES: usize = DOP853.c.len();

/// The points in a step at which its stages need the load, as fractions of the step.
pub const NODES: [f64; STAGES] = DOP853.c;

/// The loads of consecutive steps, each at its [`NODES`].
pub type Stretch = [[Load; STAGES]];

/// Takes every motion through a stretch of steps of `h_s`, `times` times, with the widest registers of the processor. A
/// motion that grows without bound ends in a state that is not finite.
pub fn advance(arm: &Arm, h_s: f64, stretch: &Stretch, times: u32, states: &mut [State]) {
    let steps = Steps { arm: &arm.coefficients, h_s, stretch, times };
    side_by_side(|motion| widest(Group::<Lanes> { steps, motion }), states);
}

/// Groups of `T::WIDTH` motions, one after the other; lanes that are left over repeat the last motion.
fn side_by_side<T: Real>(advance: impl Fn(&mut Motion<T>), states: &mut [State]) {
    for group in states.chunks_mut(T::WIDTH) {
        let mut together = Motion::gather(|lane| Motion::from(&group[lane.min(group.len() - 1)]));
        advance(&mut together);
        for (lane, own) in group.iter_mut().enumerate() {
            *own = State::from(together.lane(lane));
        }
    }
}

/// A stretch of steps, some times.
#[derive(Clone, Copy)]
struct Steps<'a> {
    arm: &'a Coefficients<f64>,
    h_s: f64,
    stretch: &'a Stretch,
    times: u32,
}

/// A group of motions that takes them.
struct Group<'a, T> {
    steps: Steps<'a>,
    motion: &'a mut Motion<T>,
}

impl<T: Real> Task for Group<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Steps { arm, h_s, stretch, times } = self.steps;
        let every = Coefficients::<T>::gather(|_lane| arm);
        for _ in 0..times {
            for loads in stretch {
                let external = loads.each_ref().map(|load| External::new(arm, load));
                *self.motion = explicit::step(&DOP853, &every, h_s, self.motion, &external);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Sine;
    use crate::arm::tests::any_arm;
    use crate::integrate::{Excitation, Integrator, Scheme};
    use alloc::vec::Vec;
    use proptest::prelude::*;

    fn bits(state: &State) -> [u64; 4] {
        [state.alpha_rad.x, state.alpha_rad.y, state.alpha_dot_rad_s.x, state.alpha_dot_rad_s.y].map(f64::to_bits)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// Arms with and without gravity and force, small and large deflections, whole groups and not, with every
        /// instruction set that the processor has: each motion is that of the integrator alone.
        #[test]
        fn every_motion_goes_as_if_it_were_alone(
            arm in any_arm(),
            states in prop::collection::vec(
                (
                    prop_oneof![
                        prop::array::uniform2(-1e-3..1e-3),
                        prop::array::uniform2(-0.4..0.4),
                        prop::array::uniform2(-1.5..1.5),
                    ],
                    prop::array::uniform2(-20.0..20.0),
                ),
                1..20,
            ),
            torque_nm in prop::array::uniform2(-500.0..500.0),
            force_n in prop_oneof![Just([0.0, 0.0]), Just([0.0, 30.0]), prop::array::uniform2(-100.0..100.0)],
        ) {
            let states: Vec<State> = states.into_iter().map(|(x, v)| State::new(x, v)).collect();
            let amplitude = Load { torque_nm: torque_nm.into(), force_n: force_n.into() };
            let (rate_hz, steps, sine) = (16_000.0, 20_u32, Sine { amplitude, frequency_hz: 22.0 });
            let integrator = Integrator::new(Scheme::Dop853, rate_hz, &arm).unwrap();
            let h_s = integrator.step_s();
            let start_s = |k: u32| f64::from(k) * h_s;
            let alone = |state: &State| {
                let once = |state| {
                    (0..steps).try_fold(state, |state, k| integrator.step(&arm, start_s(k), &state, &sine))
                };
                once(*state).and_then(once)
            };
            let Ok(expected) = states.iter().map(alone).collect::<Result<Vec<State>, _>>() else { return Ok(()) };
            let expected: Vec<_> = expected.iter().map(bits).collect();
            let stretch: Vec<_> =
                (0..steps).map(|k| DOP853.c.map(|part| sine.load(start_s(k) + part * h_s))).collect();
            let seen = |advance: &dyn Fn(&mut [State])| {
                let mut states = states.clone();
                advance(&mut states);
                states.iter().map(bits).collect::<Vec<_>>()
            };
            prop_assert_eq!(seen(&|states| advance(&arm, h_s, &stretch, 2, states)), &expected[..]);
            let steps = Steps { arm: &arm.coefficients, h_s, stretch: &stretch, times: 2 };
            let plain = |states: &mut [State]| {
                side_by_side(|motion| Group::<Lanes> { steps, motion }.run(), states);
            };
            prop_assert_eq!(seen(&plain), &expected[..]);
            let singly = |states: &mut [State]| {
                side_by_side(|motion| Group::<f64> { steps, motion }.run(), states);
            };
            prop_assert_eq!(seen(&singly), &expected[..]);
        }
    }
}
