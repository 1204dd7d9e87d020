//! Poles of the damped structure at rest: the eigenvalues λ of M q̈ + D q̇ + K q = 0.
//!
//! In modal coordinates (λ² + λ C + Ω²) u = 0 with C = ΦᵀDΦ, so the poles are the eigenvalues of
//!
//! ```text
//! [  0   I ]
//! [ −Ω² −C ]
//! ```
//!
//! A mode, a solution of K φ = ω² M φ, does not depend on damping; |λ| equals its ω only where C is diagonal.
//! Identification from readings finds poles.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use serde::Serialize;

use resonarm_dynamics::structure::{Armature, Assembly};
use resonarm_numeric::eigenvalues::eigenvalues;

/// An oscillating pole pair λ, λ̄ of a damped structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pole {
    /// Pole frequency |λ|/(2π), Hz.
    pub pole_frequency_hz: f64,
    /// Damping ratio of the pole, −Re λ/|λ|.
    pub pole_damping_ratio: f64,
}

/// Returns the poles that belong to a structure's modes, in their order; `None` for a mode that does not oscillate.
pub fn structure_poles(of: &Assembly) -> Vec<Option<Pole>> {
    poles(&of.modes().iter().map(|mode| TAU * mode.frequency_hz).collect::<Vec<_>>(), &modal_damping(of))
}

/// Returns C = ΦᵀDΦ by rows.
fn modal_damping(of: &Assembly) -> Vec<f64> {
    let n = of.coordinates();
    let modes = of.modes();
    let linear = of.linear();
    let mut damping = vec![0.0; n * n];
    for (i, row) in modes.iter().enumerate() {
        for (k, column) in modes.iter().enumerate() {
            let forces = linear.damping.chunks_exact(n).map(|entries| dot(entries, &column.shape));
            damping[i * n + k] = row.shape.iter().zip(forces).map(|(shape, force)| shape * force).sum();
        }
    }
    damping
}

/// Returns the time constant of the slowest decay of a structure at rest, 1/min(−Re λ), s, with a shaker's armature on
/// it or without; the shaker's coil has no effect. Infinite without damping.
///
/// In modal coordinates with s = Φᵀw the armature makes (I + m ssᵀ) ü + (C + c ssᵀ) u̇ + (Ω² + k ssᵀ) u = 0, and
/// (I + m ssᵀ)⁻¹ = I − m ssᵀ/(1 + m sᵀs).
pub fn longest_time_constant_s(of: &Assembly, armature: Option<&Armature>) -> f64 {
    let n = of.coordinates();
    let modes = of.modes();
    let rest = vec![0.0; n];
    let mut w = vec![0.0; n];
    let [mut mass_kg, mut damping_n_s_m, mut stiffness_n_m] = [0.0; 3];
    if let Some(armature) = armature {
        armature.direction(&of.at(&rest), &mut w);
        [mass_kg, damping_n_s_m, stiffness_n_m] = [armature.mass_kg, armature.damping_n_s_m, armature.stiffness_n_m];
    }
    let s: Vec<f64> = modes.iter().map(|mode| dot(&mode.shape, &w)).collect();
    let mut damping = modal_damping(of);
    let mut stiffness = vec![0.0; n * n];
    for i in 0..n {
        let omega = TAU * modes[i].frequency_hz;
        stiffness[i * n + i] = omega * omega;
        for k in 0..n {
            damping[i * n + k] += damping_n_s_m * s[i] * s[k];
            stiffness[i * n + k] += stiffness_n_m * s[i] * s[k];
        }
    }
    let share = mass_kg / (1.0 + mass_kg * dot(&s, &s));
    let mut matrix = vec![0.0; 4 * n * n];
    for k in 0..n {
        matrix[k * 2 * n + n + k] = 1.0;
        for (forces, first) in [(&stiffness, 0), (&damping, n)] {
            let along: f64 = (0..n).map(|i| s[i] * forces[i * n + k]).sum();
            (0..n).for_each(|i| matrix[(n + i) * 2 * n + first + k] = share * s[i] * along - forces[i * n + k]);
        }
    }
    let found = eigenvalues(2 * n, &mut matrix).unwrap_or_default();
    1.0 / found.iter().map(|lambda| -lambda.re).fold(f64::INFINITY, f64::min)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the pole of each mode, from the modes' ω, ascending, and C by rows.
fn poles(omega: &[f64], damping: &[f64]) -> Vec<Option<Pole>> {
    let n = omega.len();
    let mut matrix = vec![0.0; 4 * n * n];
    for i in 0..n {
        matrix[i * 2 * n + n + i] = 1.0;
        matrix[(n + i) * 2 * n + i] = -omega[i] * omega[i];
        (0..n).for_each(|k| matrix[(n + i) * 2 * n + n + k] = -damping[i * n + k]);
    }
    let mut of_modes = vec![None; n];
    let Some(found) = eigenvalues(2 * n, &mut matrix) else { return of_modes };
    let mut oscillating: Vec<Pole> = found
        .iter()
        .filter(|lambda| lambda.im > 0.0)
        .map(|lambda| {
            let size = libm::hypot(lambda.re, lambda.im);
            Pole { pole_frequency_hz: size / TAU, pole_damping_ratio: -lambda.re / size }
        })
        .collect();
    oscillating.sort_by(|a, b| a.pole_frequency_hz.total_cmp(&b.pole_frequency_hz));
    // Every mode oscillates: poles and modes correspond in the order of their frequencies.
    if oscillating.len() == n {
        return oscillating.into_iter().map(Some).collect();
    }
    // Some modes are overdamped: each pole belongs to the nearest mode that has none.
    for pole in oscillating {
        let off = |k: usize| libm::fabs(libm::log(TAU * pole.pole_frequency_hz / omega[k]));
        let free = (0..n).filter(|&k| of_modes[k].is_none());
        if let Some(nearest) = free.min_by(|&a, &b| off(a).total_cmp(&off(b))) {
            of_modes[nearest] = Some(pole);
        }
    }
    of_modes
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_dynamics::structure::{Axis, BodySpec, Coil, ModalSpec, ModeSpec, Preset, ShapeSpec, StructureSpec};

    /// The fitted arm at 30°, 60° with other dampers.
    fn arm(damping_nm_s_rad: f64) -> Assembly {
        let mut chain = Preset::Irb1600Fitted.chain().unwrap();
        for (link, angle_deg) in chain.links.iter_mut().zip([30.0, 60.0]) {
            link.angle_deg = angle_deg;
            link.damping_nm_s_rad = damping_nm_s_rad;
        }
        Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap()
    }

    /// With strong dampers that couple the modes, |λ|/2π is not the frequency of the undamped structure. The values are
    /// those of NumPy's `eigvals`.
    #[test]
    fn poles_of_coupled_damping_are_not_the_modes() {
        let arm = arm(60.0);
        let [Some(first), Some(second)] = structure_poles(&arm)[..] else { panic!() };
        let [low, high] = arm.modes() else { panic!() };
        assert!((first.pole_frequency_hz - 22.161_327).abs() < 1e-6, "{first:?}");
        assert!((second.pole_frequency_hz - 48.888_170).abs() < 1e-6, "{second:?}");
        assert!((low.frequency_hz - 22.157_526).abs() < 1e-6 && (high.frequency_hz - 48.896_557).abs() < 1e-6);
    }

    /// One mode: 1/(ζω) alone; with an armature (1 + m φ²) ü + (2ζω + c φ²) u̇ + (ω² + k φ²) u = 0.
    #[test]
    fn an_armature_changes_the_longest_time_constant() {
        let hz = 20.0;
        let zeta = 0.01;
        let phi = 0.5;
        let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![phi] }];
        let modes = vec![ModeSpec { frequency_hz: hz, damping_ratio: zeta }];
        let body = BodySpec::Modal(ModalSpec { modes, shapes });
        let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
        let along = [Some((assembly.dof("tip.x").unwrap(), 1.0)), None];
        let coil = Coil::Current { force_factor_n_a: 1.0 };
        let armature = Armature { along, mass_kg: 0.4, stiffness_n_m: 2e3, damping_n_s_m: 3.0, coil };
        let near = |seen: f64, expected: f64| assert!((seen / expected - 1.0).abs() < 1e-12, "{seen} {expected}");
        near(longest_time_constant_s(&assembly, None), 1.0 / (zeta * TAU * hz));
        let mass = 1.0 + 0.4 * phi * phi;
        let damping = 2.0 * zeta * TAU * hz + 3.0 * phi * phi;
        near(longest_time_constant_s(&assembly, Some(&armature)), 2.0 * mass / damping);
    }

    #[test]
    fn an_overdamped_mode_has_no_pole() {
        // Modal damping ratios of 0.1 and 2.
        let found = poles(&[1.0, 10.0], &[0.2, 0.0, 0.0, 40.0]);
        assert!(found[1].is_none(), "{found:?}");
        let pole = found[0].unwrap();
        assert!((pole.pole_frequency_hz * TAU - 1.0).abs() < 1e-12 && (pole.pole_damping_ratio - 0.1).abs() < 1e-12);
    }
}
