//! Random numbers from a seed, the same on every machine.

use core::f64::consts::TAU;

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};

/// The upper 53 bits of a number, as a fraction in steps of 2⁻⁵³.
const STEP: f64 = 1.0 / (1_u64 << 53) as f64;

/// A stream of independent random numbers.
#[derive(Debug)]
pub struct Noise {
    generator: ChaCha8Rng,
}

/// The copy continues with the same numbers as the original. The generator has no `Clone`, but gives out its state.
impl Clone for Noise {
    fn clone(&self) -> Noise {
        Noise { generator: ChaCha8Rng::deserialize_state(&self.generator.serialize_state()) }
    }
}

impl Noise {
    /// Stream number `stream` of `seed`; different streams are independent.
    pub fn new(seed: u64, stream: u64) -> Noise {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Noise { generator }
    }

    /// Continues behind the first `normals` normal numbers of the stream.
    pub fn seek(&mut self, normals: u64) {
        // A normal number takes two of 64 bits, in words of 32.
        self.generator.set_word_pos(4 * u128::from(normals));
    }

    /// The next 64 bits, each 0 or 1 with equal probability.
    pub fn bits(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// The next number of a uniform distribution over [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * STEP
    }

    /// The next standard normal number.
    ///
    /// G. E. P. Box, M. E. Muller, "A Note on the Generation of Random Normal Deviates", Ann. Math. Statist. 29 (1958):
    /// with u, v uniform, u in (0, 1], √(−2 ln u) cos 2πv is standard normal.
    pub fn normal(&mut self) -> f64 {
        // One more than the upper 53 bits: u is never 0, whose logarithm is not finite.
        let u = ((self.bits() >> 11) + 1) as f64 * STEP;
        let v = self.uniform();
        libm::sqrt(-2.0 * libm::log(u)) * libm::cos(TAU * v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Copies made at every position in a block of the generator, and beyond its end.
    #[test]
    fn a_copy_continues_as_the_original() {
        let mut noise = Noise::new(3, 2);
        for taken in 0..100 {
            let mut copy = noise.clone();
            let number = noise.normal();
            assert_eq!(copy.normal().to_bits(), number.to_bits(), "after {taken}");
            let mut ahead = noise.clone();
            for k in 0..40 {
                assert_eq!(copy.normal().to_bits(), ahead.normal().to_bits(), "{k} after {taken}");
            }
        }
    }

    #[test]
    fn a_stream_continues_behind_any_number() {
        for taken in 0..70 {
            let mut noise = Noise::new(3, 2);
            let mut sought = Noise::new(3, 2);
            (0..taken).for_each(|_| assert!(noise.normal().is_finite()));
            sought.bits();
            sought.seek(taken);
            for _ in 0..70 {
                assert_eq!(noise.normal().to_bits(), sought.normal().to_bits(), "{taken}");
            }
        }
    }

    /// Recordings are made of these numbers.
    #[test]
    fn the_numbers_of_a_seed_and_a_stream_are_fixed() {
        let bits = |seed, stream| {
            let mut noise = Noise::new(seed, stream);
            [(); 3].map(|()| noise.normal().to_bits())
        };
        assert_eq!(bits(0, 0), [0xbfe9_edc0_972c_a3e0, 0x3fe9_2961_3dae_c946, 0xbfde_ed7d_c67f_fd02]);
        assert_eq!(bits(7, 3), [0x3ff8_aaa9_8ca4_8483, 0xbfba_9f35_00f4_f4a1, 0xbff1_5059_af36_b16b]);
        assert_eq!(bits(u64::MAX, 1 << 40), [0x3fcb_8478_d210_c0fa, 0x3fd5_e148_0f5b_7cfe, 0x3fc1_d4ec_977d_f9c9]);
    }
}
