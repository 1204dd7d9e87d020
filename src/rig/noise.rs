//! Seeded Gaussian noise, the same on every machine.

use core::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A stream of independent standard normal numbers.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    generator: ChaCha8Rng,
}

impl Noise {
    /// Stream number `stream` of `seed`; different streams are independent.
    pub fn new(seed: u64, stream: u64) -> Noise {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Noise { generator }
    }

    /// The next number.
    ///
    /// G. E. P. Box, M. E. Muller (1958): with u, v uniform, u in (0, 1], √(−2 ln u) cos 2πv is standard normal.
    pub fn next(&mut self) -> f64 {
        // The upper 53 bits, as a fraction in steps of 2⁻⁵³.
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        let u = ((self.generator.next_u64() >> 11) + 1) as f64 * STEP;
        let v = (self.generator.next_u64() >> 11) as f64 * STEP;
        libm::sqrt(-2.0 * libm::log(u)) * libm::cos(TAU * v)
    }
}
