//! Many motions of one chain under one sine at once, side by side in the lanes of the processor.
//!
//! Each motion has the same states, bit for bit, as if it were alone, on every processor: the step is the source of
//! [`Integrator::step`](crate::integrate::Integrator::step) with `dop853`, generic over one number or several.

use alloc::vec::Vec;

use crate::integrate::Motion;
use crate::integrate::explicit::combined;
use crate::integrate::tableau::DOP853;
use crate::real::{Lanes, Real};
use crate::structure::links::{Links, LinksLoad};
use resonarm_numeric::registers::{Task, four_wide, widest};

/// The most links of a chain whose motions go side by side: the numbers of more don't fit the registers.
pub(super) const MOST_LINKS: usize = 3;

/// Number of motions that go side by side: two registers of AVX2, one of AVX-512, four of SSE2 or NEON.
const LANES: usize = 8;

/// Number of motions of the last group, if no more are left over.
const HALF: usize = LANES / 2;

/// Stages of a step of `dop853`.
const STAGES: usize = DOP853.c.len();

/// The times of the stages in a step of `dop853`, as fractions of the step.
pub const STAGE_TIMES: [f64; STAGES] = DOP853.c;

/// Steps under amplitude · sin(Ωt), which many motions take together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SineSteps<'a> {
    /// The peaks, one for each degree of freedom of the drive, N or N·m.
    pub amplitude: &'a [f64],
    /// sin(Ωt) at the [`STAGE_TIMES`] of each step.
    pub sines: &'a [[f64; STAGES]],
    /// Number of times that all the steps are taken, the sines being those of a whole number of periods.
    pub times: u32,
}

/// Takes every state through the steps of `h_s`, with the widest registers of the processor.
pub(super) fn advance<const N: usize>(
    links: &Links<N>,
    h_s: f64,
    load: &LinksLoad<f64, N>,
    steps: &SineSteps<'_>,
    states: &mut [Vec<f64>],
) {
    let steps = Steps { links, h_s, load, sines: steps.sines, times: steps.times };
    // At most half a group is left over where half the lanes hold it. With AVX2 half a group takes half as long as a whole
    // one. With AVX-512 it takes longer than a whole one, so it uses AVX2 there, too: five sixths of a whole one's time.
    let left_over = states.len() % LANES;
    let whole = if left_over <= HALF { states.len() - left_over } else { states.len() };
    let (whole, rest) = states.split_at_mut(whole);
    side_by_side(|motion: &mut Motion<Lanes<LANES>, N>| widest(Group { steps, motion }), whole);
    side_by_side(|motion: &mut Motion<Lanes<HALF>, N>| four_wide(Group { steps, motion }), rest);
}

/// Groups of `T::WIDTH` motions, one after the other; lanes that are left over repeat the last motion.
fn side_by_side<T: Real, const N: usize>(advance: impl Fn(&mut Motion<T, N>), states: &mut [Vec<f64>]) {
    for group in states.chunks_mut(T::WIDTH) {
        let mut together = Motion::gather(|lane| {
            let mut motion = Motion { x: [0.0; N], v: [0.0; N] };
            let state = &group[lane.min(group.len() - 1)];
            motion.x.iter_mut().chain(&mut motion.v).zip(state).for_each(|(number, state)| *number = *state);
            motion
        });
        advance(&mut together);
        for (lane, own) in group.iter_mut().enumerate() {
            let Motion { x, v } = together.lane(lane);
            own.iter_mut().zip(x.iter().chain(&v)).for_each(|(own, number)| *own = *number);
        }
    }
}

/// Steps of a chain.
#[derive(Clone, Copy)]
struct Steps<'a, const N: usize> {
    links: &'a Links<N>,
    h_s: f64,
    load: &'a LinksLoad<f64, N>,
    sines: &'a [[f64; STAGES]],
    times: u32,
}

/// A group of motions that takes them.
struct Group<'a, T, const N: usize> {
    steps: Steps<'a, N>,
    motion: &'a mut Motion<T, N>,
}

impl<T: Real, const N: usize> Task for Group<'_, T, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Steps { links, h_s, load, sines, times } = self.steps;
        let links = links.side_by_side::<T>();
        let motion = self.motion;
        for _ in 0..times {
            for sines in sines {
                let mut slopes = [Motion::splat(0.0); STAGES];
                for (stage, sine) in sines.iter().enumerate() {
                    let at = combined(motion, h_s, &DOP853.a[stage], &slopes);
                    slopes[stage] = Motion { x: at.v, v: links.acceleration(&at, &load.times(*sine).splat()) };
                }
                *motion = combined(motion, h_s, &DOP853.b, &slopes);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::integrate::Scheme;
    use crate::structure::{
        Assembly, Axis, BodySpec, ChainSpec, ElementSpec, Law, Link, Place, StepLoad, Stepper, StructureSpec, Term,
    };
    use proptest::prelude::*;

    /// A chain with elements or without.
    fn chain(links: usize, gravity_m_s2: f64, off_m: f64, with_elements: bool) -> Assembly {
        let link = |i: usize| Link {
            length_m: 0.4 + 0.1 * i as f64,
            mass_kg: 12.0 - i as f64,
            centre_of_mass_m: 0.2,
            centre_of_mass_off_m: off_m,
            inertia_kg_m2: 0.5,
            angle_deg: [40.0, -70.0, 30.0][i],
            stiffness_nm_rad: 4e5 / (1.0 + i as f64),
            damping_nm_s_rad: 3.0,
        };
        let laws = [
            (Place::Joint(1), Law::Cubic { stiffness3: 3e6, stiffness5: 1e7 }),
            (Place::Dof { point: "tip".into(), axis: Axis::Y }, Law::Tanh { slip: 30.0, velocity: 0.1 }),
        ];
        let point = |(at, law)| ElementSpec::Point { at, to: None, law };
        let places = [Axis::X, Axis::Y].map(|axis| Place::Dof { point: "tip".into(), axis });
        let terms = [([2, 1], 4e6), ([1, 3], -3e6)].map(|(powers, energy)| Term { powers: powers.into(), energy });
        let polynomial = ElementSpec::Polynomial { at: places.into(), terms: terms.into() };
        let elements = laws.into_iter().map(point).chain([polynomial]).filter(|_| with_elements);
        let body = BodySpec::Chain(ChainSpec { links: (0..links).map(link).collect(), gravity_m_s2, unstated: vec![] });
        Assembly::new(&StructureSpec { body, elements: elements.collect() }).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// Chains of every number of links that goes side by side, with gravity, elements and centres of mass off the
        /// line or without, small deflections and large, whole groups and not, with the widest registers and without,
        /// and one at a time: each motion is that of a stepper alone.
        #[test]
        fn every_motion_goes_as_if_it_were_alone(
            count in 1..=MOST_LINKS,
            gravity_m_s2 in prop_oneof![Just(0.0), Just(9.81)],
            off_m in prop_oneof![Just(0.0), Just(0.05)],
            with_elements in any::<bool>(),
            starts in prop::collection::vec(
                (prop_oneof![Just(1e-3), Just(0.4), Just(1.5)], prop::array::uniform6(-1.0..1.0)),
                1..20,
            ),
            amplitude in prop::array::uniform2(-300.0..300.0),
        ) {
            let assembly = chain(count, gravity_m_s2, off_m, with_elements);
            let drive = ["joint1", "tip.x"].map(|name| assembly.dof(name).unwrap());
            let rate_hz = 16_000.0;
            let omega_rad_s = 140.0;
            let steps = 20_u32;
            let mut stepper = Stepper::new(&assembly, &drive, Scheme::Dop853, rate_hz).unwrap();
            let start = |(size, numbers): &(f64, [f64; 6])| {
                let scale = |(i, number): (usize, &f64)| number * if i < count { *size } else { 20.0 };
                numbers[..2 * count].iter().enumerate().map(scale).collect::<Vec<f64>>()
            };
            let starts: Vec<Vec<f64>> = starts.iter().map(start).collect();
            let start_s = |k: u32| f64::from(k) * stepper.step_s();
            let times: Vec<f64> = (0..steps).map(start_s).collect();
            let h_s = stepper.step_s();
            let mut alone = |start: &Vec<f64>| {
                stepper.restore(start)?;
                for _ in 0..2 {
                    let load = StepLoad::Sine { amplitude: &amplitude, omega_rad_s };
                    times.iter().try_for_each(|t_s| stepper.advance_under(*t_s, &load))?;
                }
                Ok([stepper.position(), stepper.velocity()].concat())
            };
            let expected: Result<Vec<Vec<f64>>, crate::structure::StepError> = starts.iter().map(&mut alone).collect();
            let Ok(expected) = expected else { return Ok(()) };
            let sines: Vec<_> =
                times.iter().map(|t_s| STAGE_TIMES.map(|part| libm::sin(omega_rad_s * (t_s + part * h_s)))).collect();
            let steps = SineSteps { amplitude: &amplitude, sines: &sines, times: 2 };
            let mut states = starts.clone();
            prop_assert!(stepper.advance_together(&steps, &mut states).unwrap());
            prop_assert_eq!(&states, &expected);
            let fewer = SineSteps { amplitude: &[1.0], ..steps };
            prop_assert!(stepper.advance_together(&fewer, &mut states).is_err());
        }
    }

    /// Without the widest registers, and one at a time, the bits are the same.
    #[test]
    fn no_register_changes_a_bit() {
        let assembly = chain(2, 9.81, 0.05, true);
        let crate::structure::body::Body::Chain(chain) = &assembly.body else { panic!() };
        let links = Links::<2>::new(chain, &assembly, None);
        let load = LinksLoad { torque_nm: [60.0, 0.0], force_n: [[10.0, 0.0]; 2] };
        let sines = [STAGE_TIMES.map(|part| libm::sin(0.3 * part)); 7];
        let steps = SineSteps { amplitude: &[], sines: &sines, times: 3 };
        let starts: Vec<Vec<f64>> = (0..11).map(|k| vec![0.05 * f64::from(k), -0.02, 1.0, f64::from(k)]).collect();
        let mut expected = starts.clone();
        advance(&links, 1e-4, &load, &steps, &mut expected);
        let steps = Steps { links: &links, h_s: 1e-4, load: &load, sines: &sines, times: 3 };
        let mut plain = starts.clone();
        let mut singly = starts;
        side_by_side(|motion: &mut Motion<Lanes<LANES>, 2>| Group { steps, motion }.run(), &mut plain);
        side_by_side(|motion: &mut Motion<f64, 2>| Group { steps, motion }.run(), &mut singly);
        assert_eq!([&plain, &singly], [&expected; 2]);
    }

    /// Chains of more links, implicit schemes and shakers are left as they are.
    #[test]
    fn others_are_refused() {
        let assembly = chain(2, 0.0, 0.0, false);
        let joint = assembly.dof("joint1").unwrap();
        let stepper = Stepper::new(&assembly, &[joint], Scheme::Exponential8, 4000.0).unwrap();
        let mut states = vec![vec![0.1, 0.0, 0.0, 0.0]];
        let sines = [[1.0; STAGES]];
        let steps = SineSteps { amplitude: &[1.0], sines: &sines, times: 1 };
        assert_eq!(stepper.advance_together(&steps, &mut states), Ok(false));
        assert_eq!(states, [[0.1, 0.0, 0.0, 0.0]]);
    }
}
