//! The equation of motion at rest and along a motion, as matrices.

use alloc::vec;
use alloc::vec::Vec;

/// The linear part of a structure at rest, by rows of n numbers: M q̈ + D q̇ + K q = p. With what
/// [`Assembly::linear`](super::assembly::Assembly::linear) takes of elements.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Number n of coordinates.
    pub coordinates: usize,
    /// M; kg·m² of a chain, dimensionless of modes.
    pub mass: Vec<f64>,
    /// D; N·m·s/rad, or 1/s.
    pub damping: Vec<f64>,
    /// K; N·m/rad, or 1/s².
    pub stiffness: Vec<f64>,
}

/// The unbalance of a motion and its derivatives, matrices by rows of n numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearised {
    /// M(q) a + c(q, v) + D v + K q + g(q) − g(0) − p.
    pub unbalance: Vec<f64>,
    /// Derivatives of the unbalance by q.
    pub by_position: Vec<f64>,
    /// Derivatives of the unbalance by v.
    pub by_velocity: Vec<f64>,
    /// Derivatives of the unbalance by a: M(q).
    pub by_acceleration: Vec<f64>,
}

impl Linearised {
    /// Room for n coordinates.
    pub fn new(coordinates: usize) -> Linearised {
        let matrix = vec![0.0; coordinates * coordinates];
        Linearised {
            unbalance: vec![0.0; coordinates],
            by_position: matrix.clone(),
            by_velocity: matrix.clone(),
            by_acceleration: matrix,
        }
    }
}
