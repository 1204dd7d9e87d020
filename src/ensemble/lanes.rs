//! Arms in the lanes of the processor.

use super::{LaneScheme, Stretch};
use crate::arm::kernel::{Coefficients, Loads, Motion};
use crate::arm::real::{Lanes, Real, Two};
use crate::integrate::{Excitation, dop853, explicit};

impl Stretch {
    /// Takes every arm through the steps, with the widest registers the processor has.
    pub fn advance<E: Excitation>(self, arms: &[Coefficients<f64>], motions: &mut [Motion<f64>], excitations: &[E]) {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        {
            if std::arch::is_x86_feature_detected!("avx512f") {
                // SAFETY: the processor has AVX-512 F, as just asked.
                #[allow(unsafe_code)]
                return unsafe { self.advance_avx512(arms, motions, excitations) };
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has AVX2, as just asked.
                #[allow(unsafe_code)]
                return unsafe { self.advance_avx2(arms, motions, excitations) };
            }
        }
        self.side_by_side::<Lanes, E>(arms, motions, excitations);
    }

    /// The same source, compiled for AVX-512 F: thirty-two registers of eight numbers hold sixteen arms.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    #[target_feature(enable = "avx512f")]
    fn advance_avx512<E: Excitation>(self, arms: &[Coefficients<f64>], motions: &mut [Motion<f64>], excitations: &[E]) {
        self.side_by_side::<Two<Lanes>, E>(arms, motions, excitations);
    }

    /// The same source, compiled for AVX2, without FMA: a·b + c stays two roundings.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    #[target_feature(enable = "avx2")]
    fn advance_avx2<E: Excitation>(self, arms: &[Coefficients<f64>], motions: &mut [Motion<f64>], excitations: &[E]) {
        self.side_by_side::<Lanes, E>(arms, motions, excitations);
    }

    /// Groups of `T::WIDTH` arms, one after the other; lanes that are left over repeat the last arm.
    #[inline(always)]
    pub(super) fn side_by_side<T: Real, E: Excitation>(
        self,
        arms: &[Coefficients<f64>],
        motions: &mut [Motion<f64>],
        excitations: &[E],
    ) {
        let groups = arms.chunks(T::WIDTH).zip(motions.chunks_mut(T::WIDTH)).zip(excitations.chunks(T::WIDTH));
        for ((arms, motions), excitations) in groups {
            let last = arms.len() - 1;
            let coefficients = Coefficients::<T>::gather(|i| &arms[i.min(last)]);
            let mut motion = Motion::<T>::gather(|i| motions[i.min(last)]);
            for k in 0..self.steps {
                let t_s = self.time_s(k);
                let load = |part: f64| {
                    let t_s = t_s + part * self.step_s;
                    Loads::<T>::gather(|i| Loads::from(&excitations[i.min(last)].load(t_s)))
                };
                motion = match self.scheme {
                    LaneScheme::Rk4 => explicit::rk4(&coefficients, self.step_s, &motion, load),
                    LaneScheme::Dop853 => explicit::step(&dop853::DOP853, &coefficients, self.step_s, &motion, load),
                };
            }
            for (i, own) in motions.iter_mut().enumerate() {
                *own = motion.lane(i);
            }
        }
    }
}
