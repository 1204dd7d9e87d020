//! Gauss–Legendre collocation as a [`Collocation`]: J. C. Butcher, "Implicit Runge–Kutta Processes", Math. Comp. 18
//! (1964).
//!
//! Applied to x' = v, v' = a with the stage accelerations as slopes,
//!
//! ```text
//! vᵢ = v + h Σⱼ aᵢⱼ Aⱼ     xᵢ = x + cᵢ h v + h² Σⱼ (a²)ᵢⱼ Aⱼ     v⁺ = v + h Σ bⱼ Aⱼ     x⁺ = x + h v + h² Σ (bᵀa)ⱼ Aⱼ
//! ```

use alloc::vec::Vec;

use super::collocation::{Collocation, LEVELS, MethodCoefficients, Step, least_level};
use super::double_double::DoubleDouble;
use super::dynamics::Dynamics;

/// A Gauss–Legendre method of S stages; its coefficients are p + q √n with rational p and q.
pub(super) struct Tableau<const S: usize> {
    n: f64,
    a: [[Coefficient; S]; S],
    b: [Coefficient; S],
    c: [Coefficient; S],
    /// The largest ωh of a part in small vibration, rad; see [`Collocation::least_level`].
    phase_at_rest_rad: f64,
}

/// Gauss's nodes and weights on [0, 1].
pub(super) struct Nodes<const S: usize> {
    pub c: [DoubleDouble; S],
    pub b: [DoubleDouble; S],
}

/// The four nodes ½ ± ½ √(3/7 ± 2/7 √(6/5)) with the weights ¼ ∓ √30/72 (M.
/// Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, table 25.4).
pub(super) fn four_nodes() -> Nodes<4> {
    let [half, quarter, three, seven] = [0.5, 0.25, 3.0, 7.0].map(DoubleDouble::new);
    let inner_root = DoubleDouble::new(2.0) * (DoubleDouble::new(6.0) / DoubleDouble::new(5.0)).sqrt();
    let half_width = [(three + inner_root) / seven, (three - inner_root) / seven].map(|square| half * square.sqrt());
    let change = DoubleDouble::new(30.0).sqrt() / DoubleDouble::new(72.0);
    let [outer, inner] = half_width;
    Nodes {
        c: [half - outer, half - inner, half + inner, half + outer],
        b: [quarter - change, quarter + change, quarter + change, quarter - change],
    }
}

/// p and q, each as numerator and denominator.
type Coefficient = [[f64; 2]; 2];

const fn rational(numerator: f64, denominator: f64) -> Coefficient {
    [[numerator, denominator], [0.0, 1.0]]
}

/// Two stages, order 4.
pub(super) const GL4: Tableau<2> = Tableau {
    n: 3.0,
    a: [[rational(1.0, 4.0), [[1.0, 4.0], [-1.0, 6.0]]], [[[1.0, 4.0], [1.0, 6.0]], rational(1.0, 4.0)]],
    b: [rational(1.0, 2.0), rational(1.0, 2.0)],
    c: [[[1.0, 2.0], [-1.0, 6.0]], [[1.0, 2.0], [1.0, 6.0]]],
    phase_at_rest_rad: 0.5,
};

/// Three stages, order 6.
pub(super) const GL6: Tableau<3> = Tableau {
    n: 15.0,
    a: [
        [rational(5.0, 36.0), [[2.0, 9.0], [-1.0, 15.0]], [[5.0, 36.0], [-1.0, 30.0]]],
        [[[5.0, 36.0], [1.0, 24.0]], rational(2.0, 9.0), [[5.0, 36.0], [-1.0, 24.0]]],
        [[[5.0, 36.0], [1.0, 30.0]], [[2.0, 9.0], [1.0, 15.0]], rational(5.0, 36.0)],
    ],
    b: [rational(5.0, 18.0), rational(4.0, 9.0), rational(5.0, 18.0)],
    c: [[[1.0, 2.0], [-1.0, 10.0]], rational(1.0, 2.0), [[1.0, 2.0], [1.0, 10.0]]],
    phase_at_rest_rad: 1.0,
};

/// Beyond ωh of about 2 the method, though stable for a linear arm, gains energy from the nonlinearity or finds no
/// stages.
const PHASE_PER_PART_RAD: f64 = 1.5;

impl<const S: usize> Tableau<S> {
    /// The method for steps of `h_s` of a system, and their parts.
    pub fn collocation<const N: usize>(&self, of: &impl Dynamics<N>, h_s: f64) -> Collocation<S, N> {
        let levels: Vec<Step<S, N>> = (0..LEVELS).map(|level| self.step(h_s / f64::from(1_u32 << level))).collect();
        let least_level = least_level(of.fastest_rad_s(), &levels, self.phase_at_rest_rad);
        Collocation { linear: [[[0.0; N]; N]; 2], levels, least_level, phase_per_part_rad: PHASE_PER_PART_RAD }
    }

    pub fn nodes(&self) -> Nodes<S> {
        let values = |coefficients: [Coefficient; S]| coefficients.map(|coefficient| self.value(coefficient));
        Nodes { c: values(self.c), b: values(self.b) }
    }

    fn value(&self, [p, q]: Coefficient) -> DoubleDouble {
        let ratio = |[numerator, denominator]: [f64; 2]| DoubleDouble::new(numerator) / DoubleDouble::new(denominator);
        ratio(p) + ratio(q) * DoubleDouble::new(self.n).sqrt()
    }

    fn step<const N: usize>(&self, h_s: f64) -> Step<S, N> {
        let a = |i: usize, j: usize| self.value(self.a[i][j]);
        let Nodes { b, c } = self.nodes();
        let h = DoubleDouble::new(h_s);
        let sum = |term: &dyn Fn(usize) -> DoubleDouble| (0..S).map(term).fold(DoubleDouble::default(), |s, x| s + x);
        // Of a slope Aⱼ the position of stage i gets h² (a²)ᵢⱼ, the velocity h aᵢⱼ.
        let stage = |i: usize, j: usize| [h * h * sum(&|k| a(i, k) * a(k, j)), h * a(i, j)];
        let weight = |j: usize| [h * h * sum(&|i| b[i] * a(i, j)), h * b[j]];
        Step::new(&MethodCoefficients {
            h_s,
            c,
            b,
            start: &|i, row, column| drift::<N>(c[i] * h, row, column),
            stage: &|i, j, row, column| slope::<N>(stage(i, j), row, column),
            end: &|row, column| drift::<N>(h, row, column),
            weight: &|j, row, column| slope::<N>(weight(j), row, column),
        })
    }
}

/// The change of a motion without acceleration over the time t: x by t v.
fn drift<const N: usize>(t: DoubleDouble, row: usize, column: usize) -> DoubleDouble {
    if column == row + N { t } else { DoubleDouble::default() }
}

/// The share of a slope: the first factor times it is added to the positions, the second to the velocities.
fn slope<const N: usize>(factors: [DoubleDouble; 2], row: usize, column: usize) -> DoubleDouble {
    if row % N == column { factors[row / N] } else { DoubleDouble::default() }
}
