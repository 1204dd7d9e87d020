//! Discrete Fourier transforms whose results are bit-identical on every machine.

use alloc::vec::Vec;
use core::f64::consts::PI;

use nalgebra::Complex;

/// Σ x(n) e^(−2πi kn/N) over n, for all k: the transform of N values, N a power of two.
#[derive(Clone, Debug)]
pub struct Fft {
    /// e^(−2πi j/N) for j < N/2.
    turns: Vec<Complex<f64>>,
}

impl Fft {
    /// Prepares transforms of at least `length` values: as many as the next power of two.
    pub fn at_least(length: usize) -> Fft {
        let length = length.next_power_of_two();
        Fft { turns: (0..length / 2).map(|j| turn(2 * j as u64, length as u64)).collect() }
    }

    /// The number N of values, at least 1.
    pub fn length(&self) -> usize {
        (2 * self.turns.len()).max(1)
    }

    /// Transforms `values` in place. A slice of another length than N stays unchanged.
    ///
    /// J. W. Cooley, J. W. Tukey, "An Algorithm for the Machine Calculation of Complex Fourier Series", Math. Comp. 19
    /// (1965): values in bit-reversed order, then log₂ N passes in which two transforms of half the length, E of the
    /// even and O of the odd values, make one: E(k) ± e^(−2πi k/m) O(k).
    pub fn forward(&self, values: &mut [Complex<f64>]) {
        let length = self.length();
        if values.len() != length || length < 2 {
            return;
        }
        let unused = usize::BITS - length.trailing_zeros();
        // Bit reversal is its own inverse, so each pair is swapped once, when its smaller index comes.
        for i in 0..length {
            let j = i.reverse_bits() >> unused;
            if i < j {
                values.swap(i, j);
            }
        }
        let mut half = 1;
        while half < length {
            let stride = length / (2 * half);
            for block in values.chunks_exact_mut(2 * half) {
                let (even, odd) = block.split_at_mut(half);
                for (k, (e, o)) in even.iter_mut().zip(odd).enumerate() {
                    // A block of 2 · half values turns by e^(−2πi k/(2 half)), which is every `stride`th entry of the
                    // table for N.
                    let turned = *o * self.turns[k * stride];
                    (*e, *o) = (*e + turned, *e - turned);
                }
            }
            half *= 2;
        }
    }

    /// N times the inverse transform in place: conj F(conj x).
    pub fn backward(&self, values: &mut [Complex<f64>]) {
        values.iter_mut().for_each(|value| *value = value.conj());
        self.forward(values);
        values.iter_mut().for_each(|value| *value = value.conj());
    }
}

/// Some lines of a discrete Fourier transform of any length N: Σ x(n) e^(−2πi kn/N) for k = `first` … `first` + `lines`
/// − 1.
///
/// L. I. Bluestein, "A Linear Filtering Approach to the Computation of Discrete Fourier Transform", IEEE Trans. Audio
/// Electroacoust. 18 (1970): with k = first + m and 2mn = m² + n² − (m − n)², the sum is w(m²) Σ [x(n) e^(−2πi n
/// first/N) w(n²)] w̄((m − n)²), w(j) = e^(−πi j/N): a convolution, which [`Fft`] carries out.
#[derive(Clone, Debug)]
pub struct Lines {
    period: u64,
    inputs: usize,
    first: u64,
    lines: usize,
    fft: Fft,
    /// The transform of w̄(j²), j from −(inputs − 1) to lines − 1, cyclically, over the length.
    chirp: Vec<Complex<f64>>,
}

impl Lines {
    /// Prepares `lines` lines from `first` on of the transform of length `period`, at least 1, of which the first
    /// `inputs` values are given and the others zero.
    pub fn new(period: usize, inputs: usize, first: usize, lines: usize) -> Lines {
        let period = period as u64;
        let first = first as u64;
        // The convolution of the transform is cyclic. With room for inputs and lines no sum that is kept wraps around.
        let fft = Fft::at_least(inputs + lines);
        let length = fft.length();
        let mut chirp = alloc::vec![Complex::new(0.0, 0.0); length];
        // The 1/N of the inverse transform goes into the chirp, where it costs nothing in each transform.
        let scale = 1.0 / length as f64;
        for j in 0..inputs.max(lines) {
            let value = square_turn(j as u64, period).conj() * scale;
            if j < lines {
                chirp[j] = value;
            }
            // The chirp is even in j, and its negative half is at the end of the cycle.
            if j > 0 && j < inputs {
                chirp[length - j] = value;
            }
        }
        fft.forward(&mut chirp);
        Lines { period, inputs, first, lines, fft, chirp }
    }

    /// The lines of the first `inputs` of `values`.
    pub fn transform(&self, values: impl IntoIterator<Item = Complex<f64>>) -> Vec<Complex<f64>> {
        let mut work = alloc::vec![Complex::new(0.0, 0.0); self.fft.length()];
        for ((n, value), slot) in values.into_iter().take(self.inputs).enumerate().zip(&mut work) {
            let n = n as u64;
            // The turns n·first/N are reduced to less than one before they become an angle: an argument of many turns
            // would lose digits.
            *slot = value * turn(2 * (n * self.first % self.period), self.period) * square_turn(n, self.period);
        }
        self.fft.forward(&mut work);
        work.iter_mut().zip(&self.chirp).for_each(|(value, chirp)| *value *= chirp);
        self.fft.backward(&mut work);
        work.truncate(self.lines);
        work.iter_mut().enumerate().for_each(|(m, value)| *value *= square_turn(m as u64, self.period));
        work
    }
}

/// e^(−πi j/N), N being `period`.
fn turn(j: u64, period: u64) -> Complex<f64> {
    let (sine, cosine) = libm::sincos(-PI * (j as f64 / period as f64));
    Complex::new(cosine, sine)
}

/// e^(−πi j²/N); j² is reduced modulo 2N, whole turns, so that no digits are lost.
fn square_turn(j: u64, period: u64) -> Complex<f64> {
    turn(j * j % (2 * period), period)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use nalgebra::Normed as _;
    use proptest::prelude::*;

    fn plain(values: &[Complex<f64>], k: usize, period: usize) -> Complex<f64> {
        let term = |(n, value): (usize, &Complex<f64>)| {
            let angle = -TAU * ((n * k % period) as f64 / period as f64);
            value * Complex::new(libm::cos(angle), libm::sin(angle))
        };
        values.iter().enumerate().map(term).sum()
    }

    fn signal() -> impl Strategy<Value = Vec<Complex<f64>>> {
        proptest::collection::vec((-1.0..1.0, -1.0..1.0).prop_map(|(re, im)| Complex::new(re, im)), 1..300)
    }

    proptest! {
        #[test]
        fn a_transform_is_the_plain_sum(values in signal()) {
            let fft = Fft::at_least(values.len());
            let mut transformed = values.clone();
            transformed.resize(fft.length(), Complex::new(0.0, 0.0));
            fft.forward(&mut transformed);
            for (k, line) in transformed.iter().enumerate() {
                prop_assert!((line - plain(&values, k, fft.length())).norm() < 1e-12 * 300.0, "{k}");
            }
        }

        #[test]
        fn lines_of_any_length_are_the_plain_sum(
            values in signal(), more in 0_usize..200, first in 0_usize..400, lines in 1_usize..50,
        ) {
            let period = values.len() + more;
            let found = Lines::new(period, values.len(), first, lines).transform(values.iter().copied());
            prop_assert_eq!(found.len(), lines);
            for (m, line) in found.iter().enumerate() {
                prop_assert!((line - plain(&values, first + m, period)).norm() < 1e-12 * 300.0, "{}", m);
            }
        }
    }
}
