//! The number type of the equation of motion: one number, or several at once.
//!
//! The same source computes a single arm and several motions side by side, so both give the same bits: each lane sees
//! the same operations in the same order, each rounded by IEEE 754, and Rust never contracts a·b + c.

use core::ops::{Add, Div, Mul, Neg, Sub};

use wide::{f64x4, f64x8};

/// A number of the simulated path: `f64`, [`Lanes`] of them for arms side by side, [`f64x4`] for the stages of a step.
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

/// Number of arms that are computed side by side: two registers of AVX2, one of AVX-512, four of SSE2 or NEON.
pub(crate) const LANES: usize = 8;

/// Eight numbers that take every operation together.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Lanes(pub [f64; LANES]);

// Plain loops: the compiler must see all eight together wherever this is inlined.
impl Lanes {
    #[inline(always)]
    fn zip(self, other: Lanes, f: impl Fn(f64, f64) -> f64) -> Lanes {
        let mut result = self;
        for i in 0..LANES {
            result.0[i] = f(self.0[i], other.0[i]);
        }
        result
    }
}

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn div(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a / b)
    }
}

impl Neg for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn neg(self) -> Lanes {
        self.zip(self, |a, _| -a)
    }
}

impl Real for Lanes {
    const WIDTH: usize = LANES;

    #[inline(always)]
    fn gather(of: impl Fn(usize) -> f64) -> Lanes {
        let mut result = [0.0; LANES];
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
    fn splat(value: f64) -> Lanes {
        Lanes([value; LANES])
    }

    #[inline(always)]
    fn all_within(self, limit: f64) -> bool {
        // Without a short cut, so that the lanes stay together.
        let mut all = true;
        for i in 0..LANES {
            all &= self.0[i].all_within(limit);
        }
        all
    }
}

// The numbers of [`Lanes`] in vectors of the processor: for formulas so long that the compiler no longer finds the lanes
// in loops.
impl Real for f64x8 {
    const WIDTH: usize = LANES;

    #[inline(always)]
    fn gather(of: impl Fn(usize) -> f64) -> f64x8 {
        let mut result = [0.0; LANES];
        for (i, value) in result.iter_mut().enumerate() {
            *value = of(i);
        }
        f64x8::new(result)
    }

    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.to_array()[i]
    }

    #[inline(always)]
    fn splat(value: f64) -> f64x8 {
        f64x8::splat(value)
    }

    #[inline(always)]
    fn all_within(self, limit: f64) -> bool {
        (self * self).simd_le(f64x8::splat(limit * limit)).all()
    }
}

// A separate type: the compiler keeps `Lanes` in registers in a loop over many arms, but not in a step of one.
impl Real for f64x4 {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn gather(of: impl Fn(usize) -> f64) -> f64x4 {
        f64x4::new([of(0), of(1), of(2), of(3)])
    }

    #[inline(always)]
    fn lane(self, i: usize) -> f64 {
        self.to_array()[i]
    }

    #[inline(always)]
    fn splat(value: f64) -> f64x4 {
        f64x4::splat(value)
    }

    #[inline(always)]
    fn all_within(self, limit: f64) -> bool {
        (self * self).simd_le(f64x4::splat(limit * limit)).all()
    }
}
