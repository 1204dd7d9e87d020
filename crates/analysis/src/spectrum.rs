//! The linearisation along a motion in the frequency domain, and the matrices made of it.

use alloc::vec::Vec;

use nalgebra::Matrix2;

use super::Linearisation;
use super::fourier::{Basis, Harmonics};

/// 2/T ∫ f cos mτ and 2/T ∫ f sin mτ of one function, m = 0, 1, ….
#[derive(Clone, Debug, Default)]
struct Line {
    cosines: Vec<f64>,
    sines: Vec<f64>,
}

/// The lines of S, G and M, each 2 × 2.
#[derive(Clone, Debug, Default)]
pub(super) struct Spectrum {
    lines: [[Line; 4]; 3],
    signal: Vec<f64>,
    even: Line,
    odd: Line,
}

/// The element i, j of S, G or M.
fn element(at: &Linearisation, which: usize, position: usize) -> f64 {
    let matrix = match which {
        0 => &at.by_position,
        1 => &at.by_velocity,
        _ => &at.by_acceleration,
    };
    matrix[(position / 2, position % 2)]
}

impl Line {
    fn transform(&mut self, basis: &Basis, signal: &[f64]) {
        self.cosines.clear();
        self.sines.clear();
        let first = signal[0];
        let constant = signal.iter().all(|value| *value == first);
        let total: f64 = if constant { first * signal.len() as f64 } else { signal.iter().sum() };
        self.cosines.push(2.0 * total / signal.len() as f64);
        self.sines.push(0.0);
        for i in 0..basis.harmonics().count() {
            let (c, s) = if constant { (0.0, 0.0) } else { basis.project(i, signal) };
            self.cosines.push(c);
            self.sines.push(s);
        }
    }

    /// The combination a·f + b·g of two lines, element by element, for m from −H to 2H+1 at the index m + H: the
    /// cosines are even in m, the sines odd.
    fn combine(&mut self, lines: [(&Line, f64); 2], below: usize) {
        self.cosines.clear();
        self.sines.clear();
        let [(f, a), (g, b)] = lines;
        let negative = (1..=below).rev();
        self.cosines.extend(negative.clone().map(|m| a * f.cosines[m] + b * g.cosines[m]));
        self.sines.extend(negative.map(|m| -(a * f.sines[m] + b * g.sines[m])));
        self.cosines.extend(f.cosines.iter().zip(&g.cosines).map(|(f, g)| a * f + b * g));
        self.sines.extend(f.sines.iter().zip(&g.sines).map(|(f, g)| a * f + b * g));
    }
}

impl Spectrum {
    /// The spectrum of the samples of a linearisation.
    pub fn transform(&mut self, basis: &Basis, linear: &[Linearisation]) {
        for (which, lines) in self.lines.iter_mut().enumerate() {
            for (position, line) in lines.iter_mut().enumerate() {
                self.signal.clear();
                self.signal.extend(linear.iter().map(|at| element(at, which, position)));
                line.transform(basis, &self.signal);
            }
        }
    }

    /// The means of S, G and M over the period.
    pub fn means(&self) -> [Matrix2<f64>; 3] {
        core::array::from_fn(|which| Matrix2::from_fn(|i, j| 0.5 * self.lines[which][2 * i + j].cosines[0]))
    }

    /// The matrix of φ ↦ S φ + G φ̇ + M φ̈ on series of the frequencies given.
    ///
    /// S φ + G φ̇ + M φ̈ is E cos lτ − lωG sin lτ for φ = cos lτ, and E sin lτ + lωG cos lτ for φ = sin lτ, with
    /// E = S − l²ω²M. With C(m), S(m) the lines of a function f, the components of its products are
    ///
    /// ```text
    /// along cos kτ:  f cos lτ → ½ (C(k−l) + C(k+l))      f sin lτ → ½ (S(k+l) − S(k−l))
    /// along sin kτ:  f cos lτ → ½ (S(k+l) + S(k−l))      f sin lτ → ½ (C(k−l) − C(k+l))
    /// ```
    ///
    /// and along 1 half of the first line for k = 0. Sums and differences of half-odd frequencies are integers.
    pub fn assemble(
        &mut self,
        harmonics: Harmonics,
        omega_rad_s: f64,
        row_scale: impl Fn(f64) -> f64,
        matrix: &mut [f64],
        stride: usize,
    ) {
        for position in 0..4 {
            let (row, column) = (position / 2, position % 2);
            let [s, g, m] = [0, 1, 2].map(|which| &self.lines[which][position]);
            if harmonics.constants() == 1 {
                constant_column(s, harmonics, &mut matrix[column * stride..][..stride], row);
            }
            let below = harmonics.count() + 1;
            for i in 0..harmonics.count() {
                let rate = harmonics.order(i) * omega_rad_s;
                self.even.combine([(s, 1.0), (m, -rate * rate)], below);
                self.odd.combine([(g, rate), (g, 0.0)], below);
                let at = (2 * (harmonics.constants() + 2 * i) + column) * stride;
                let (cosine, sine) = matrix[at..at + 3 * stride].split_at_mut(2 * stride);
                let columns = [&mut cosine[..stride], sine];
                Pair { even: &self.even, odd: &self.odd, below, harmonics, row }.fill(i, columns);
            }
        }
        let columns = 2 * harmonics.rows();
        for column in matrix.chunks_mut(stride).take(columns) {
            for (row, pair) in column[..columns].chunks_exact_mut(2).enumerate() {
                let constants = harmonics.constants();
                let order = if row < constants { 0.0 } else { harmonics.order((row - constants) / 2) };
                let scale = row_scale(order);
                pair.iter_mut().for_each(|value| *value *= scale);
            }
        }
    }
}

/// The column of the constant: the components of f itself.
fn constant_column(f: &Line, harmonics: Harmonics, column: &mut [f64], row: usize) {
    column[row] = 0.5 * f.cosines[0];
    for k in 1..=harmonics.count() {
        column[4 * k - 2 + row] = f.cosines[k];
        column[4 * k + row] = f.sines[k];
    }
}

/// Two combined lines, and where in the matrix they go.
struct Pair<'a> {
    even: &'a Line,
    odd: &'a Line,
    below: usize,
    harmonics: Harmonics,
    row: usize,
}

impl Pair<'_> {
    /// Fills the columns of cos lτ and sin lτ, l being the i-th frequency.
    fn fill(&self, i: usize, [cosine, sine]: [&mut [f64]; 2]) {
        let (constants, row) = (self.harmonics.constants(), self.row);
        let (e, o) = (self.even, self.odd);
        if constants == 1 {
            let at = self.below + i + 1;
            cosine[row] = 0.5 * (e.cosines[at] - o.sines[at]);
            sine[row] = 0.5 * (e.sines[at] + o.cosines[at]);
        }
        // k − l at `minus`, k + l at `plus`, k running over all frequencies.
        let count = self.harmonics.count();
        let lowest = self.harmonics.twice_order(0);
        let minus = self.below - i;
        let plus = self.below + (lowest + self.harmonics.twice_order(i)) / 2;
        for k in 0..count {
            let (m, p) = (minus + k, plus + k);
            let at = 2 * (constants + 2 * k) + row;
            cosine[at] = 0.5 * (e.cosines[m] + e.cosines[p] - o.sines[p] + o.sines[m]);
            cosine[at + 2] = 0.5 * (e.sines[p] + e.sines[m] - o.cosines[m] + o.cosines[p]);
            sine[at] = 0.5 * (e.sines[p] - e.sines[m] + o.cosines[m] + o.cosines[p]);
            sine[at + 2] = 0.5 * (e.cosines[m] - e.cosines[p] + o.sines[p] + o.sines[m]);
        }
    }
}
