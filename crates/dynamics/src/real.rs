//! The number type of the equation of motion: one number, or several at once.
//!
//! The same source computes a single arm and several motions side by side, so both give the same bits: each lane sees
//! the same operations in the same order, each rounded by IEEE 754, and Rust never contracts a·b + c.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number of the simulated path: `f64`, or [`Lanes`] of them for the stages of a step and for motions side by side.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The number of lanes.
    const WIDTH: usize;
    /// The numbers `of(0)`, `of(1)` … one a lane.
    fn gather(of: impl Fn(usize) -> f64) -> Self;
    /// The number in lane `i`, below [`Real::WIDTH`].
    fn lane(self, i: usize) -> f64;
    /// The same value in every lane.
    fn splat(value: f64) -> Self;
    /// Whether every lane is within ± `limit`, by its square, which the polynomials need anyway; NaN is not.
    fn all_within(self, limit: f64) -> bool;

    /// Lane by lane: `near` where |key| ≤ `limit`, else `far(key)`.
    #[inline(always)]
    fn where_within(key: Self, limit: f64, near: (Self, Self), far: fn(f64) -> (f64, f64)) -> (Self, Self) {
        if key.all_within(limit) { near } else { far_lanes(key, limit, near, far) }
    }
}

/// Replaces the lanes where |key| > `limit` by `far`. Out of line, so that the usual path stays in registers.
#[cold]
#[inline(never)]
fn far_lanes<T: Real>(key: T, limit: f64, near: (T, T), far: fn(f64) -> (f64, f64)) -> (T, T) {
    let at = |i: usize| {
        let key = key.lane(i);
        if key.all_within(limit) { (near.0.lane(i), near.1.lane(i)) } else { far(key) }
    };
    (T::gather(|i| at(i).0), T::gather(|i| at(i).1))
}

impl Real for f64 {
    const WIDTH: usize = 1;

    #[inline(always)]
    fn gather(of: impl Fn(usize) -> f64) -> f64 {
        of(0)
    }

    #[inline(always)]
    fn lane(self, _i: usize) -> f64 {
        self
    }

    #[inline(always)]
    fn splat(value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn all_within(self, limit: f64) -> bool {
        self * self <= limit * limit
    }
}

/// `W` numbers that take every operation together.
///
/// They are plain arrays and not a vector type, which would be as wide as the registers that every processor has: the
/// compiler makes vectors of them as wide as those of a [`Task`](resonarm_numeric::registers::Task).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub struct Lanes<const W: usize>(pub(crate) [f64; W]);

// Plain loops: the compiler must see all lanes together wherever this is inlined.
impl<const W: usize> Lanes<W> {
    #[inline(always)]
    fn zip(self, other: Lanes<W>, f: impl Fn(f64, f64) -> f64) -> Lanes<W> {
        let mut result = self;
        for i in 0..W {
            result.0[i] = f(self.0[i], other.0[i]);
        }
        result
    }

    /// The magnitude in every lane.
    #[inline(always)]
    pub(crate) fn abs(self) -> Lanes<W> {
        self.zip(self, |a, _| libm::fabs(a))
    }
}

impl<const W: usize> Add for Lanes<W> {
    type Output = Lanes<W>;
    #[inline(always)]
    fn add(self, other: Lanes<W>) -> Lanes<W> {
        self.zip(other, |a, b| a + b)
    }
}

impl<const W: usize> Sub for Lanes<W> {
    type Output = Lanes<W>;
    #[inline(always)]
    fn sub(self, other: Lanes<W>) -> Lanes<W> {
        self.zip(other, |a, b| a - b)
    }
}

impl<const W: usize> Mul for Lanes<W> {
    type Output = Lanes<W>;
    #[inline(always)]
    fn mul(self, other: Lanes<W>) -> Lanes<W> {
        self.zip(other, |a, b| a * b)
    }
}

impl<const W: usize> Div for Lanes<W> {
    type Output = Lanes<W>;
    #[inline(always)]
    fn div(self, other: Lanes<W>) -> Lanes<W> {
        self.zip(other, |a, b| a / b)
    }
}

impl<const W: usize> Neg for Lanes<W> {
    type Output = Lanes<W>;
    #[inline(always)]
    fn neg(self) -> Lanes<W> {
        self.zip(self, |a, _| -a)
    }
}

impl<const W: usize> Real for Lanes<W> {
    const WIDTH: usize = W;

    #[inline(always)]
    fn gather(of: impl Fn(usize) -> f64) -> Lanes<W> {
        let mut result = [0.0; W];
        for (i, value) in result.iter_mut().enumerate() {
            *value = of(i);
        }
        Lanes(result)
    }

    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.0[i]
    }

    #[inline(always)]
    fn splat(value: f64) -> Lanes<W> {
        Lanes([value; W])
    }

    #[inline(always)]
    fn all_within(self, limit: f64) -> bool {
        // Without a short cut, so that the lanes stay together.
        let mut all = true;
        for i in 0..W {
            all &= self.0[i].all_within(limit);
        }
        all
    }
}
