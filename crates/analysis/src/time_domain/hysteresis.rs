//! The values at which two sweeps, up and down, have different responses.

use alloc::vec::Vec;

/// Returns the intervals in which the responses at the same values differ, each from its first value to its last. A
/// response is given as its value and its amplitudes, for the arm the largest |α1| and |α2|; both sweeps go up.
/// Amplitudes that differ by more than the part `different` belong to different responses.
pub fn hysteresis<A: AsRef<[f64]>>(up: &[(f64, A)], down: &[(f64, A)], different: f64) -> Vec<[f64; 2]> {
    let differ = |&(a, b): &(&(f64, A), &(f64, A))| {
        let mut pairs = a.1.as_ref().iter().zip(b.1.as_ref());
        pairs.any(|(a, b)| libm::fabs(a - b) > different * b)
    };
    let pairs: Vec<_> = up.iter().zip(down).collect();
    let stretches = pairs.chunk_by(|a, b| differ(a) == differ(b)).filter(|stretch| differ(&stretch[0]));
    stretches.map(|stretch| [stretch[0].0.0, stretch[stretch.len() - 1].0.0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_every_interval_in_which_they_differ() {
        let up = [1.0, 1.0, 2.0, 3.0, 1.0, 1.0].map(|a| [a, 1.0]);
        let down = [1.0, 1.5, 2.5, 3.0, 1.0 + 1e-9, 1.0].map(|a| [a, 1.0]);
        let at = |amplitudes: [[f64; 2]; 6]| (0..6).map(f64::from).zip(amplitudes).collect::<Vec<_>>();
        assert_eq!(hysteresis(&at(up), &at(down), 1e-6), [[1.0, 2.0]]);
        let mut joint2 = down;
        joint2[5][1] = 7.0;
        assert_eq!(hysteresis(&at(up), &at(joint2), 1e-6), [[1.0, 2.0], [5.0, 5.0]]);
        assert!(hysteresis(&at(up), &at(up), 1e-6).is_empty());
    }
}
