//! The motion of a system, or of several side by side.

use crate::real::Real;

/// Position and velocity of N coordinates, of one system or of several side by side, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T, const N: usize = 2> {
    /// Coordinates, each in its unit.
    pub x: [T; N],
    /// Their rates, 1/s of their unit.
    pub v: [T; N],
}

impl<T, const N: usize> Motion<T, N> {
    /// The same number everywhere.
    #[inline(always)]
    pub(crate) fn splat(value: f64) -> Motion<T, N>
    where
        T: Real,
    {
        Motion { x: [T::splat(value); N], v: [T::splat(value); N] }
    }

    /// The motions of `T::WIDTH` systems side by side.
    #[inline(always)]
    pub(crate) fn gather(of: impl Fn(usize) -> Motion<f64, N>) -> Motion<T, N>
    where
        T: Real,
    {
        let mut gathered = Motion::splat(0.0);
        for n in 0..N {
            gathered.x[n] = T::gather(|i| of(i).x[n]);
            gathered.v[n] = T::gather(|i| of(i).v[n]);
        }
        gathered
    }

    /// The motion of the ith of them.
    #[inline(always)]
    pub(crate) fn lane(&self, i: usize) -> Motion<f64, N>
    where
        T: Real,
    {
        let mut lane = Motion::splat(0.0);
        for n in 0..N {
            lane.x[n] = self.x[n].lane(i);
            lane.v[n] = self.v[n].lane(i);
        }
        lane
    }

    /// Each number of this and the one of `other`.
    #[inline(always)]
    pub(crate) fn zip(&self, other: &Motion<T, N>, f: impl Fn(T, T) -> T) -> Motion<T, N>
    where
        T: Copy,
    {
        // In place: the compiler unrolls this loop early, and not one of `array::from_fn`.
        let mut result = *self;
        for n in 0..N {
            result.x[n] = f(self.x[n], other.x[n]);
            result.v[n] = f(self.v[n], other.v[n]);
        }
        result
    }
}

impl<const N: usize> Motion<f64, N> {
    /// Whether all numbers are finite.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        // Without a short cut, so that there is one branch.
        (0..N).fold(true, |all, n| all & self.x[n].is_finite() & self.v[n].is_finite())
    }
}
