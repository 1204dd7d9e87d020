//! The flow of a chain's variations (δu, δu̇, δz) by the implicit midpoint rule, (1 − ½hA) y⁺ = (1 + ½hA) y.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::DMatrix;

use super::{Variations, identity};
use crate::dense::Lu;

/// The flow over the period in steps over `points` points; none if it can't be computed.
pub(super) fn flow(of: &Variations, points: usize) -> Option<DMatrix<f64>> {
    let (n, states) = (of.unknowns(), of.states.len());
    let size = 2 * n + states;
    let h = points as f64 * of.spacing_s;
    let mut flow = identity(size);
    let (mut left, mut mass) = (Lu::default(), Lu::default());
    let mut next = vec![0.0; size];
    for middle in (points / 2..of.samples.count()).step_by(points) {
        let a = rates(of, [middle, points], &mut mass)?;
        let matrix = left.zeroed(size);
        for (cell, (at, rate)) in matrix.iter_mut().zip(a.iter().enumerate()) {
            *cell = if at % size == at / size { 1.0 } else { 0.0 } - 0.5 * h * rate;
        }
        left.factor().ok()?;
        for column in flow.chunks_exact_mut(size) {
            next.copy_from_slice(column);
            for (rates, value) in a.chunks_exact(size).zip(column.iter()) {
                next.iter_mut().zip(rates).for_each(|(next, rate)| *next += 0.5 * h * rate * value);
            }
            left.solve(&mut next);
            column.copy_from_slice(&next);
        }
        for state in 0..states {
            if of.state(state, middle, points).by_state.is_none() {
                flow.iter_mut().skip(2 * n + state).step_by(size).for_each(|z| *z = 0.0);
            }
        }
    }
    Some(DMatrix::from_column_slice(size, size, &flow))
}

/// A of ẏ = A y in the middle of a step over some points, column by column: δü = −M⁻¹ (S δu + G δu̇ + w f_z δz), δż = a
/// (wᵀδu̇ + ∂v/∂u δu) + b δz.
fn rates(of: &Variations, [point, points]: [usize; 2], mass: &mut Lu) -> Option<Vec<f64>> {
    let (n, states) = (of.unknowns(), of.states.len());
    let size = 2 * n + states;
    let matrix = mass.zeroed(n);
    for (at, cell) in matrix.iter_mut().enumerate() {
        *cell = of.by(2, [at % n, at / n], point);
    }
    mass.factor().ok()?;
    let mut a = vec![0.0; size * size];
    for k in 0..n {
        a[(n + k) * size + k] = 1.0;
        for d in 0..2 {
            let column = &mut a[(d * n + k) * size + n..][..n];
            column.iter_mut().enumerate().for_each(|(i, value)| *value = -of.by(d, [i, k], point));
            mass.solve(column);
        }
    }
    for state in 0..states {
        let (at, geometry) = (of.state(state, point, points), of.geometry(state, point));
        let row = 2 * n + state;
        for k in 0..n {
            a[k * size + row] = at.by_velocity * geometry.velocity_by_position(k);
            a[(n + k) * size + row] = at.by_velocity * geometry.direction[k];
        }
        let column = &mut a[row * size..(row + 1) * size];
        (0..n).for_each(|i| column[n + i] = -at.force * geometry.direction[i]);
        mass.solve(&mut column[n..2 * n]);
        column[row] = at.by_state.unwrap_or(0.0);
    }
    Some(a)
}
