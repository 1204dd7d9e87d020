//! Arms in the lanes of the processor.

use super::Stretch;
use crate::arm::Load;
use crate::arm::kernel::{Coefficients, Loads, Motion};
use crate::arm::real::{Lanes, Real, Two};
use crate::integrate::Excitation;
use crate::integrate::explicit::{self, Rk4Step};

/// The most arms side by side.
pub(super) const WIDEST: usize = Two::<Lanes>::WIDTH;

/// Takes a group of arms through some steps under the same loads.
pub(super) type Kernel<T> = fn(&Coefficients<T>, &mut Motion<T>, &StepLoads<T>, &Rk4Step<T>, u32);

/// The loads at 0, ½ and 1 of a step.
type StepLoads<T> = [Loads<T>; 3];

impl Stretch {
    /// Takes every arm through the steps, with the widest registers the processor has.
    pub fn advance<E: Excitation>(self, arms: &[Coefficients<f64>], motions: &mut [Motion<f64>], excitations: &[E]) {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        {
            if std::arch::is_x86_feature_detected!("avx512f") {
                return self.side_by_side(arms, motions, excitations, x86::with_avx512);
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                return self.side_by_side(arms, motions, excitations, x86::with_avx2);
            }
        }
        self.side_by_side(arms, motions, excitations, portable::<Lanes>);
    }

    /// Groups of `T::WIDTH` arms, one after the other; lanes that are left over repeat the last arm.
    pub(super) fn side_by_side<T: Real, E: Excitation>(
        self,
        arms: &[Coefficients<f64>],
        motions: &mut [Motion<f64>],
        excitations: &[E],
        kernel: Kernel<T>,
    ) {
        let h = Rk4Step::new(self.step_s);
        let groups = arms.chunks(T::WIDTH).zip(motions.chunks_mut(T::WIDTH)).zip(excitations.chunks(T::WIDTH));
        for ((arms, motions), excitations) in groups {
            let last = arms.len() - 1;
            let arm = Coefficients::gather(|i| &arms[i.min(last)]);
            let mut motion = Motion::gather(|i| motions[i.min(last)]);
            if excitations.iter().all(Excitation::is_constant) {
                kernel(&arm, &mut motion, &[loads_at(excitations, self.time_s(0)); 3], &h, self.steps);
            } else {
                for k in 0..self.steps {
                    let at = |part: f64| loads_at(excitations, self.time_s(k) + part * self.step_s);
                    kernel(&arm, &mut motion, &[at(0.0), at(0.5), at(1.0)], &h, 1);
                }
            }
            for (i, own) in motions.iter_mut().enumerate() {
                *own = motion.lane(i);
            }
        }
    }
}

/// The loads of a group at one time.
fn loads_at<T: Real, E: Excitation>(excitations: &[E], t_s: f64) -> Loads<T> {
    let mut loads = [Load::default(); WIDEST];
    for (load, excitation) in loads.iter_mut().zip(excitations) {
        *load = excitation.load(t_s);
    }
    for i in excitations.len()..T::WIDTH {
        loads[i] = loads[i - 1];
    }
    Loads::gather(|i| loads[i])
}

/// The kernel as the target at hand compiles it; the ones below are the same source for wider registers.
#[inline(always)]
pub(super) fn portable<T: Real>(
    arm: &Coefficients<T>,
    motion: &mut Motion<T>,
    loads: &StepLoads<T>,
    h: &Rk4Step<T>,
    steps: u32,
) {
    let (arm, loads, mut moving) = (*arm, *loads, *motion);
    for _ in 0..steps {
        moving = explicit::rk4(&arm, h, &moving, &loads);
    }
    *motion = moving;
}

/// The kernel for wider registers of x86-64. FMA stays off: a·b + c is two roundings everywhere.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod x86 {
    use super::{Coefficients, Lanes, Motion, Rk4Step, StepLoads, Two, portable};

    type Pair = Two<Lanes>;

    #[allow(unsafe_code)]
    pub fn with_avx512(
        arm: &Coefficients<Pair>,
        motion: &mut Motion<Pair>,
        loads: &StepLoads<Pair>,
        h: &Rk4Step<Pair>,
        steps: u32,
    ) {
        // SAFETY: `Stretch::advance` takes this kernel only where the processor says that it has AVX-512 F.
        unsafe { avx512(arm, motion, loads, h, steps) }
    }

    #[target_feature(enable = "avx512f")]
    fn avx512(
        arm: &Coefficients<Pair>,
        motion: &mut Motion<Pair>,
        loads: &StepLoads<Pair>,
        h: &Rk4Step<Pair>,
        steps: u32,
    ) {
        portable(arm, motion, loads, h, steps);
    }

    #[allow(unsafe_code)]
    pub fn with_avx2(
        arm: &Coefficients<Lanes>,
        motion: &mut Motion<Lanes>,
        loads: &StepLoads<Lanes>,
        h: &Rk4Step<Lanes>,
        steps: u32,
    ) {
        // SAFETY: `Stretch::advance` takes this kernel only where the processor says that it has AVX2.
        unsafe { avx2(arm, motion, loads, h, steps) }
    }

    #[target_feature(enable = "avx2")]
    fn avx2(
        arm: &Coefficients<Lanes>,
        motion: &mut Motion<Lanes>,
        loads: &StepLoads<Lanes>,
        h: &Rk4Step<Lanes>,
        steps: u32,
    ) {
        portable(arm, motion, loads, h, steps);
    }
}
