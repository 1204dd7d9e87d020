//! One number or several at once: what the equation of motion is written in.
//!
//! The same source computes a single arm and several motions side by side, so both give the same bits: each lane sees
//! the same operations in the same order, every one rounded as IEEE 754 says, and Rust never contracts a·b + c.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number of the simulated path: `f64`, or [`Lanes`] of them.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// How many numbers these are.
    const WIDTH: usize;
    /// The numbers `of(0)`, `of(1)` … one a lane.
    fn gather(of: impl Fn(usize) -> f64) -> Self;
    /// The number in lane `i`, below [`Real::WIDTH`].
    fn lane(self, i: usize) -> f64;
    /// The same value in every lane.
    fn splat(value: f64) -> Self;
    /// Whether every lane is within ± `limit`, as its square says, which the polynomials need anyway; NaN is not.
    fn all_within(self, limit: f64) -> bool;
    /// Whether every lane is zero.
    fn all_zero(self) -> bool;
    /// The magnitudes.
    fn abs(self) -> Self;
    /// Lane by lane: `value` where `key` is not zero, else `other`.
    fn where_nonzero(key: Self, value: Self, other: Self) -> Self;
    /// Lane by lane: `near` where |key| ≤ `limit`, else `far(constants, key)`.
    fn where_within(
        key: Self,
        limit: f64,
        near: (Self, Self),
        constants: [Self; 2],
        far: fn([f64; 2], f64) -> (f64, f64),
    ) -> (Self, Self);
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

    #[inline(always)]
    fn all_zero(self) -> bool {
        self == 0.0
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        libm::fabs(self)
    }

    #[inline(always)]
    fn where_nonzero(key: f64, value: f64, other: f64) -> f64 {
        if key != 0.0 { value } else { other }
    }

    #[inline(always)]
    fn where_within(
        key: f64,
        limit: f64,
        near: (f64, f64),
        constants: [f64; 2],
        far: fn([f64; 2], f64) -> (f64, f64),
    ) -> (f64, f64) {
        if key.all_within(limit) { near } else { far(constants, key) }
    }
}

/// How many arms go side by side: two registers of AVX2, one of AVX-512, four of SSE2 or NEON.
pub(crate) const LANES: usize = 8;

/// N numbers that take every operation together.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Lanes<const N: usize = LANES>(pub [f64; N]);

// Plain loops: the compiler must see all eight together wherever this is inlined.
impl<const N: usize> Lanes<N> {
    #[inline(always)]
    fn zip(self, other: Lanes<N>, f: impl Fn(f64, f64) -> f64) -> Lanes<N> {
        let mut result = self;
        for i in 0..N {
            result.0[i] = f(self.0[i], other.0[i]);
        }
        result
    }

    /// The lanes where |key| > `limit` by `far`. Out of line, so that the way without it stays in registers.
    #[cold]
    #[inline(never)]
    fn mend(
        key: Lanes<N>,
        limit: f64,
        near: (Lanes<N>, Lanes<N>),
        constants: [Lanes<N>; 2],
        far: fn([f64; 2], f64) -> (f64, f64),
    ) -> (Lanes<N>, Lanes<N>) {
        let mut mixed = near;
        for i in 0..N {
            if !key.0[i].all_within(limit) {
                (mixed.0.0[i], mixed.1.0[i]) = far(constants.map(|lanes| lanes.0[i]), key.0[i]);
            }
        }
        mixed
    }
}

impl<const N: usize> Add for Lanes<N> {
    type Output = Lanes<N>;
    #[inline(always)]
    fn add(self, other: Lanes<N>) -> Lanes<N> {
        self.zip(other, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Lanes<N> {
    type Output = Lanes<N>;
    #[inline(always)]
    fn sub(self, other: Lanes<N>) -> Lanes<N> {
        self.zip(other, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Lanes<N> {
    type Output = Lanes<N>;
    #[inline(always)]
    fn mul(self, other: Lanes<N>) -> Lanes<N> {
        self.zip(other, |a, b| a * b)
    }
}

impl<const N: usize> Div for Lanes<N> {
    type Output = Lanes<N>;
    #[inline(always)]
    fn div(self, other: Lanes<N>) -> Lanes<N> {
        self.zip(other, |a, b| a / b)
    }
}

impl<const N: usize> Neg for Lanes<N> {
    type Output = Lanes<N>;
    #[inline(always)]
    fn neg(self) -> Lanes<N> {
        self.zip(self, |a, _| -a)
    }
}

impl<const N: usize> Real for Lanes<N> {
    const WIDTH: usize = N;

    #[inline(always)]
    fn gather(of: impl Fn(usize) -> f64) -> Lanes<N> {
        let mut result = [0.0; N];
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
    fn splat(value: f64) -> Lanes<N> {
        Lanes([value; N])
    }

    #[inline(always)]
    fn all_within(self, limit: f64) -> bool {
        // Without a short cut, so that the lanes stay together.
        let mut all = true;
        for i in 0..N {
            all &= self.0[i].all_within(limit);
        }
        all
    }

    #[inline(always)]
    fn all_zero(self) -> bool {
        let mut all = true;
        for i in 0..N {
            all &= self.0[i] == 0.0;
        }
        all
    }

    #[inline(always)]
    fn abs(self) -> Lanes<N> {
        self.zip(self, |a, _| libm::fabs(a))
    }

    #[inline(always)]
    fn where_nonzero(key: Lanes<N>, value: Lanes<N>, other: Lanes<N>) -> Lanes<N> {
        let mut result = other;
        for i in 0..N {
            result.0[i] = if key.0[i] != 0.0 { value.0[i] } else { other.0[i] };
        }
        result
    }

    #[inline(always)]
    fn where_within(
        key: Lanes<N>,
        limit: f64,
        near: (Lanes<N>, Lanes<N>),
        constants: [Lanes<N>; 2],
        far: fn([f64; 2], f64) -> (f64, f64),
    ) -> (Lanes<N>, Lanes<N>) {
        if key.all_within(limit) { near } else { Lanes::mend(key, limit, near, constants, far) }
    }
}
