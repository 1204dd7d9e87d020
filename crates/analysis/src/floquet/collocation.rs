//! The flow of a smooth chain's variations (δu, δu′) over a period by Gauss–Legendre collocation.
//!
//! In the phase τ = ωt, ω the base frequency, a variation y satisfies y″ = P y + Q y′ with P = −M⁻¹S/ω² and Q =
//! −M⁻¹G/ω, S, G and M being the derivatives of the unbalance by u, u̇ and ü along the response. They are computed at
//! the stages τᵢ of every step, so that the stage accelerations kᵢ solve a linear system, once for all columns of the
//! flow together:
//!
//! ```text
//! kᵢ = Pᵢ (y + cᵢ h y′ + h² Σⱼ (a²)ᵢⱼ kⱼ) + Qᵢ (y′ + h Σⱼ aᵢⱼ kⱼ)
//! y⁺ = y + h y′ + h² Σ (bᵀa)ⱼ kⱼ        y′⁺ = y′ + h Σ bⱼ kⱼ
//! ```

use alloc::vec;
use core::f64::consts::TAU;

use nalgebra::DMatrix;
use resonarm_numeric::linear_solve::solve;

use super::rows::eliminate;
use super::{ACCURACY, Stability, multipliers};
use crate::balance::Balance;
use crate::gauss::{S, Tableau, steps_for};
use crate::samples::{Contacts, Samples};

/// Steps whose stages are computed together: it bounds the storage under a slow drive.
const CHUNK: usize = 2048;

/// The stages of some steps, to which the phases of [`Samples`] are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stages {
    harmonics: usize,
    /// Number of collocation steps in a period.
    steps: usize,
    /// Index of the first of these steps in the period.
    first: usize,
}

/// Returns the multipliers of the response X of a balance of a smooth chain. `set` holds the stages to which the phases
/// of `samples` are set.
pub(super) fn stability(
    balance: &Balance,
    x: &[f64],
    samples: &mut Samples,
    set: &mut Option<Stages>,
) -> Option<Stability> {
    let find = match balance.unknowns.count() {
        1 => flow::<1, 2>,
        2 => flow::<2, 4>,
        3 => flow::<3, 6>,
        4 => flow::<4, 8>,
        5 => flow::<5, 10>,
        6 => flow::<6, 12>,
        7 => flow::<7, 14>,
        // A chain has at most eight links.
        _ => flow::<8, 16>,
    };
    let multipliers = multipliers(find(balance, x, samples, set)?)?;
    Some(Stability { multipliers, accuracy: ACCURACY, conservative: false })
}

/// Returns the flow over the period of N coordinates, with `W` = 2N columns; `None` if it can't be computed.
fn flow<const N: usize, const W: usize>(
    balance: &Balance,
    x: &[f64],
    samples: &mut Samples,
    set: &mut Option<Stages>,
) -> Option<DMatrix<f64>> {
    let fastest_hz = balance.forced.assembly().modes().last().map_or(0.0, |mode| mode.frequency_hz);
    let steps = steps_for(TAU * fastest_hz / balance.base_hz(), balance.harmonics());
    // The drive is a function, too.
    let harmonics = balance.harmonics().max(balance.period());
    let tableau = Tableau::new();
    let h = TAU / steps as f64;
    let mut flow = [[0.0; W]; W];
    (0..W).for_each(|i| flow[i][i] = 1.0);
    let mut matrix = vec![0.0; S * N * S * N];
    for first in (0..steps).step_by(CHUNK) {
        let stages = Stages { harmonics, steps, first };
        // Usually a period is one chunk, whose tables stay as they are from one response to the next.
        if *set != Some(stages) {
            let within = S * first..S * steps.min(first + CHUNK);
            let phases = within.map(|at| TAU * ((at / S) as f64 + tableau.c[at % S]) / steps as f64);
            samples.set_phases(harmonics, phases);
            *set = Some(stages);
        }
        samples.synthesise(x, &balance.unknowns, balance.omega_rad_s());
        samples.evaluate(&balance.forced, &balance.unknowns, balance.frequency_hz, Contacts::Averaged);
        for at in (0..samples.count()).step_by(S) {
            let mut rates = [Rates { by_position: [[0.0; N]; N], by_velocity: [[0.0; N]; N] }; S];
            for (i, rates) in rates.iter_mut().enumerate() {
                *rates = Rates::new::<W>(samples, at + i, balance.omega_rad_s())?;
            }
            step(&tableau, h, &rates, &mut matrix, &mut flow)?;
        }
    }
    Some(DMatrix::from_row_slice(W, W, flow.as_flattened()))
}

/// The matrices P and Q at a stage.
#[derive(Clone, Copy)]
struct Rates<const N: usize> {
    by_position: [[f64; N]; N],
    by_velocity: [[f64; N]; N],
}

impl<const N: usize> Rates<N> {
    /// Computes them from the derivatives at a point; `None` if M has no inverse.
    #[inline(always)]
    fn new<const W: usize>(samples: &Samples, point: usize, omega_rad_s: f64) -> Option<Rates<N>> {
        let count = samples.count();
        let by = |derivative: usize, i: usize, j: usize| samples.by[derivative][(i * N + j) * count + point];
        let mut mass = [[0.0; N]; N];
        let mut right = [[0.0; W]; N];
        let scales = [-1.0 / (omega_rad_s * omega_rad_s), -1.0 / omega_rad_s];
        for i in 0..N {
            for j in 0..N {
                mass[i][j] = by(2, i, j);
                right[i][j] = scales[0] * by(0, i, j);
                right[i][N + j] = scales[1] * by(1, i, j);
            }
        }
        eliminate(mass.as_flattened_mut(), right.as_flattened_mut(), N)?;
        let mut rates = Rates { by_position: [[0.0; N]; N], by_velocity: [[0.0; N]; N] };
        for (i, right) in right.iter().enumerate() {
            rates.by_position[i].copy_from_slice(&right[..N]);
            rates.by_velocity[i].copy_from_slice(&right[N..]);
        }
        Some(rates)
    }
}

/// Takes one step of all columns; `matrix` is storage for (SN)² numbers.
#[inline(always)]
fn step<const N: usize, const W: usize>(
    tableau: &Tableau,
    h: f64,
    rates: &[Rates<N>; S],
    matrix: &mut [f64],
    flow: &mut [[f64; W]; W],
) -> Option<()> {
    let mut stages = [[[0.0; W]; N]; S];
    for (i, (Rates { by_position, by_velocity }, stage)) in rates.iter().zip(&mut stages).enumerate() {
        // y + cᵢ h y′ of every coordinate.
        let mut drifted = [[0.0; W]; N];
        for (k, drifted) in drifted.iter_mut().enumerate() {
            for (column, drifted) in drifted.iter_mut().enumerate() {
                *drifted = flow[k][column] + tableau.c[i] * h * flow[N + k][column];
            }
        }
        for (r, right) in stage.iter_mut().enumerate() {
            let row = &mut matrix[(i * N + r) * S * N..(i * N + r + 1) * S * N];
            for (j, block) in row.chunks_exact_mut(N).enumerate() {
                let a = h * tableau.a[i][j];
                let a2 = h * h * tableau.a_squared[i][j];
                for (k, entry) in block.iter_mut().enumerate() {
                    *entry = -(a2 * by_position[r][k] + a * by_velocity[r][k]);
                }
            }
            row[i * N + r] += 1.0;
            for k in 0..N {
                for column in 0..W {
                    right[column] += by_position[r][k] * drifted[k][column] + by_velocity[r][k] * flow[N + k][column];
                }
            }
        }
    }
    solve(matrix, stages.as_flattened_mut())?;
    let (positions, velocities) = flow.split_at_mut(N);
    for (k, (position, velocity)) in positions.iter_mut().zip(velocities).enumerate() {
        for column in 0..W {
            let mut moved = h * velocity[column];
            let mut pushed = 0.0;
            for (i, stage) in stages.iter().enumerate() {
                moved += h * h * tableau.b_bar[i] * stage[k][column];
                pushed += h * tableau.b[i] * stage[k][column];
            }
            position[column] += moved;
            velocity[column] += pushed;
        }
    }
    Some(())
}
