//! Exponential collocation at the Gauss nodes as a [`Collocation`]: M. Hochbruck, A. Ostermann, "Exponential
//! Runge–Kutta methods for parabolic problems", Appl. Numer. Math. 53 (2005); symmetric as E. Celledoni, D. Cohen, B.
//! Owren, "Symmetric Exponential Integrators with an Application to the Cubic Schrödinger Equation", Found. Comput.
//! Math. 8 (2008) ask.
//!
//! The system linearised at rest, y' = L y + B N with B = (0, I)ᵀ, is propagated exactly, and the remainder N = ẍ − Λy,
//! loads included, as the polynomial p through its values at the Gauss nodes: by variation of constants
//!
//! ```text
//! y(t + ch) = e^{chL} y + ∫₀^{ch} e^{(ch−s)L} B p(s) ds        L = [[0, I], [Λ]]
//! ∫₀^τ e^{(τ−s)L} B sᵐ ds = m! τᵐ⁺¹ φₘ₊₁(τL) B
//! ```
//!
//! So a linear system under a load that is constant over the step, or of a degree in time below the number of nodes, is
//! exact at any step length. All φ come out of one exponential, that of the block matrix (A. H. Al-Mohy, N. J. Higham,
//! "Computing the Action of the Matrix Exponential", SIAM J. Sci. Comput. 33 (2011), theorem 2.1), for three nodes
//!
//! ```text
//!         ⎡ L  B  0  0 ⎤        its first block row is
//! exp τ · ⎢ 0  0  I  0 ⎥        e^{τL},  τ φ₁(τL)B,  τ² φ₂(τL)B,  τ³ φ₃(τL)B
//!         ⎢ 0  0  0  I ⎥
//!         ⎣ 0  0  0  0 ⎦
//! ```
//!
//! by Taylor series, scaling and squaring in double-double numbers: an error of e^{hL} of one part in 2⁵³ would change
//! the energy by 1e-9 in 1e7 steps. Each squaring is also the next longer part of the step.

use alloc::vec::Vec;
use core::array;

use super::collocation::{Collocation, LEVELS, LinearPart, MethodCoefficients, Step, least_level};
use super::double_double::DoubleDouble;
use super::dynamics::{Dynamics, Jacobian};
use super::gauss_legendre::Nodes;

/// Most nodes of a method.
const MOST_NODES: usize = 4;
/// Blocks in a row: two for y, and one for each power of time.
const BLOCKS: usize = 2 + MOST_NODES;
/// A matrix of blocks: by row and column of the blocks, then within one.
type Blocks<const N: usize> = [[[[DoubleDouble; N]; N]; BLOCKS]; BLOCKS];

/// Below this norm τL is small enough for the series.
const SERIES_NORM: f64 = 1.0 / 64.0;
/// Terms of the series: 64⁻¹⁶/16! < 1e-41.
const SERIES_TERMS: u32 = 16;

/// The method at these nodes for a system, for steps of `h_s` and their parts. Small vibration turns by
/// `phase_at_rest_rad` at most in a part, see [`Collocation::least_level`]; a linear system would need no bound.
pub(super) fn collocation<const S: usize, const N: usize>(
    nodes: &Nodes<S>,
    phase_at_rest_rad: f64,
    of: &impl Dynamics<N>,
    h_s: f64,
) -> Collocation<S, N> {
    let Jacobian { by_position, by_velocity, .. } = of.linear_part();
    let linear = [by_position, by_velocity];
    // Time in units of 1/ω, ω a power of two: L then has entries near one, and the change of units is exact.
    let unit_rad_s = libm::exp2(libm::ceil(libm::log2(of.fastest_rad_s())));
    let generator = generator(&linear, unit_rad_s);
    let phase = DoubleDouble::new(unit_rad_s * h_s);
    let inner = nodes.c.map(|c| powers(&generator, c * phase));
    let whole = powers(&generator, phase);
    let level = |level: usize| {
        let h_level_s = h_s / f64::from(1_u32 << level);
        step(nodes, array::from_fn(|i| &inner[i][level]), &whole[level], h_level_s, unit_rad_s)
    };
    let levels: Vec<Step<S, N>> = (0..LEVELS).map(level).collect();
    let least_level = least_level(of.fastest_rad_s(), &levels, phase_at_rest_rad);
    Collocation { linear, levels, least_level, phase_per_part_rad: f64::INFINITY }
}

/// The block matrix above, in units of 1/`unit_rad_s`.
fn generator<const N: usize>(linear: &LinearPart<N>, unit_rad_s: f64) -> Blocks<N> {
    let mut blocks = zero();
    for row in 0..N {
        for column in 0..N {
            blocks[1][0][row][column] = DoubleDouble::new(linear[0][row][column] / (unit_rad_s * unit_rad_s));
            blocks[1][1][row][column] = DoubleDouble::new(linear[1][row][column] / unit_rad_s);
        }
    }
    // The first unit block is x' = v and the second adds N to v'. Each further one makes of a power of time the next,
    // so that one exponential holds all φ.
    for row in 0..BLOCKS - 1 {
        blocks[row][row + 1] = unit();
    }
    blocks
}

fn zero<const N: usize>() -> Blocks<N> {
    [[[[DoubleDouble::default(); N]; N]; BLOCKS]; BLOCKS]
}

fn unit<const N: usize>() -> [[DoubleDouble; N]; N] {
    let mut unit = [[DoubleDouble::default(); N]; N];
    for (i, row) in unit.iter_mut().enumerate() {
        row[i] = DoubleDouble::new(1.0);
    }
    unit
}

fn product<const N: usize>(a: &Blocks<N>, b: &Blocks<N>) -> Blocks<N> {
    let mut c = zero();
    for (c, a) in c.iter_mut().zip(a) {
        for (a, b) in a.iter().zip(b) {
            for (c, b) in c.iter_mut().zip(b) {
                add_product(c, a, b);
            }
        }
    }
    c
}

/// c += a b.
fn add_product<const N: usize>(c: &mut [[DoubleDouble; N]; N], a: &[[DoubleDouble; N]; N], b: &[[DoubleDouble; N]; N]) {
    for (c, a) in c.iter_mut().zip(a) {
        // Most entries are zero, those of all blocks below the diagonal but Λ among them.
        for (factor, b) in a.iter().zip(b).filter(|(factor, _)| factor.high != 0.0) {
            for (sum, value) in c.iter_mut().zip(b).filter(|(_, value)| value.high != 0.0) {
                *sum = *sum + *factor * *value;
            }
        }
    }
}

/// exp(τ W) for τ, τ/2, τ/4 … of all levels.
fn powers<const N: usize>(generator: &Blocks<N>, tau: DoubleDouble) -> Vec<Blocks<N>> {
    // The largest sum of magnitudes in a row bounds every product with the matrix, which is all that the series asks
    // for.
    let row_norm = |blocks: &[[[DoubleDouble; N]; N]; BLOCKS], row: usize| -> f64 {
        blocks.iter().flat_map(|block| &block[row]).map(|entry| libm::fabs(entry.high)).sum()
    };
    let norm = generator.iter().flat_map(|blocks| (0..N).map(|row| row_norm(blocks, row))).fold(0.0, f64::max);
    let needed = libm::ceil(libm::log2(norm * tau.high / SERIES_NORM)).max(0.0) as usize;
    // At least one halving a level: each squaring then is the exponential of the next longer part.
    let halvings = needed.max(LEVELS - 1);
    let shortest = DoubleDouble::new(libm::scalbn(1.0, -(halvings as i32))) * tau;
    let mut exponential = series(generator, shortest);
    let mut levels = Vec::with_capacity(LEVELS);
    for halving in (0..=halvings).rev() {
        if halving < LEVELS {
            levels.push(exponential);
        }
        exponential = product(&exponential, &exponential);
    }
    // Squaring goes from the shortest part up, and level 0 is the whole step.
    levels.reverse();
    levels
}

/// exp(τ W) = I + τW (I + τW/2 (I + τW/3 (…))).
fn series<const N: usize>(generator: &Blocks<N>, tau: DoubleDouble) -> Blocks<N> {
    let mut sum = identity();
    for k in (1..=SERIES_TERMS).rev() {
        sum = product(generator, &sum);
        let factor = tau / DoubleDouble::new(f64::from(k));
        for entry in sum.as_flattened_mut().as_flattened_mut().as_flattened_mut() {
            *entry = *entry * factor;
        }
        for (i, blocks) in sum.iter_mut().enumerate() {
            for (n, row) in blocks[i].iter_mut().enumerate() {
                row[n] = row[n] + DoubleDouble::new(1.0);
            }
        }
    }
    sum
}

fn identity<const N: usize>() -> Blocks<N> {
    let mut blocks = zero();
    for (i, row) in blocks.iter_mut().enumerate() {
        row[i] = unit();
    }
    blocks
}

/// The step from the exponentials at its nodes and its end.
fn step<const S: usize, const N: usize>(
    nodes: &Nodes<S>,
    inner: [&Blocks<N>; S],
    end: &Blocks<N>,
    h_s: f64,
    unit_rad_s: f64,
) -> Step<S, N> {
    let mut factors = [[DoubleDouble::default(); S]; S];
    for (j, factors) in factors.iter_mut().enumerate() {
        *factors = slope_factors(&nodes.c, j, h_s * unit_rad_s);
    }
    Step::new(&MethodCoefficients {
        h_s,
        c: nodes.c,
        b: nodes.b,
        start: &|i, row, column| state_entry(inner[i], row, column, unit_rad_s),
        stage: &|i, j, row, column| slope_entry(inner[i], &factors[j], row, column, unit_rad_s),
        end: &|row, column| state_entry(end, row, column, unit_rad_s),
        weight: &|j, row, column| slope_entry(end, &factors[j], row, column, unit_rad_s),
    })
}

/// An entry of e^{τL} − I, in SI units.
fn state_entry<const N: usize>(blocks: &Blocks<N>, row: usize, column: usize, unit_rad_s: f64) -> DoubleDouble {
    // In units of time of 1/ω a position keeps its number, and a velocity is in units of ω.
    let unit = [1.0, unit_rad_s];
    let own = DoubleDouble::new(if row == column { 1.0 } else { 0.0 });
    let entry = blocks[row / N][column / N][row % N][column % N];
    (entry - own) * DoubleDouble::new(unit[row / N] / unit[column / N])
}

/// An entry of ∫ e^{(τ−s)L} B ℓⱼ(s/h) ds with Lagrange's polynomial ℓⱼ of node j, in SI units: Σ of the factors times
/// block m.
fn slope_entry<const N: usize>(
    blocks: &Blocks<N>,
    factors: &[DoubleDouble],
    row: usize,
    column: usize,
    unit_rad_s: f64,
) -> DoubleDouble {
    // In units of time of 1/ω an acceleration N is N/ω². A position gets that, and a velocity, in units of ω, N/ω.
    let unit = [unit_rad_s * unit_rad_s, unit_rad_s];
    let of_powers = &blocks[row / N][2..];
    let terms = factors.iter().zip(of_powers).map(|(factor, block)| *factor * block[row % N][column]);
    terms.fold(DoubleDouble::default(), |sum, term| sum + term) / DoubleDouble::new(unit[row / N])
}

/// λⱼₘ m! (ωh)⁻ᵐ of every m, with ℓⱼ = Σ λⱼₘ sᵐ.
fn slope_factors<const S: usize>(c: &[DoubleDouble; S], j: usize, phase: f64) -> [DoubleDouble; S] {
    let mut factors = lagrange(c, j);
    let phase = DoubleDouble::new(phase);
    let mut factorial = DoubleDouble::new(1.0);
    let mut power = phase;
    for (m, factor) in factors.iter_mut().enumerate().skip(1) {
        factorial = factorial * DoubleDouble::new(m as f64);
        *factor = factorial * *factor / power;
        power = power * phase;
    }
    factors
}

/// Coefficients of ℓⱼ(s) = Π (s − cₖ)/(cⱼ − cₖ) over the other nodes k, from s⁰ up.
fn lagrange<const S: usize>(c: &[DoubleDouble; S], j: usize) -> [DoubleDouble; S] {
    let [zero, one] = [0.0, 1.0].map(DoubleDouble::new);
    let mut coefficients = [zero; S];
    let mut divisor = one;
    coefficients[0] = one;
    for k in (1..S).map(|n| (j + n) % S) {
        // From the highest power down, so that the coefficient below is still that of the polynomial before.
        for m in (0..S).rev() {
            let below = if m == 0 { zero } else { coefficients[m - 1] };
            coefficients[m] = below - c[k] * coefficients[m];
        }
        divisor = divisor * (c[j] - c[k]);
    }
    coefficients.map(|coefficient| coefficient / divisor)
}
