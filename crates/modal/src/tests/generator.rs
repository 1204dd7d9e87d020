//! Random numbers of the oracles' generator.

use core::f64::consts::TAU;

/// SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014).
pub struct SplitMix(pub u64);

impl SplitMix {
    /// The next number of a uniform distribution over [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// `count` standard normal numbers in pairs, by the method of Box and Muller; the second of the last pair is lost if
    /// `count` is odd.
    pub fn normals(&mut self, count: usize) -> Vec<f64> {
        let mut numbers = Vec::new();
        while numbers.len() < count {
            let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
            let (sine, cosine) = libm::sincos(TAU * self.uniform());
            numbers.extend([radius * cosine, radius * sine]);
        }
        numbers.truncate(count);
        numbers
    }
}
