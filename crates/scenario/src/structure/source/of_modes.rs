//! Converts a chain, or the two-link arm, into a modal structure.
//!
//! With q = Φη, ΦᵀMΦ = 1 and ΦᵀKΦ = Ω², the motion about rest is η̈ + Cη̇ + Ω²η = Φᵀp with C = ΦᵀDΦ. A modal structure
//! has the diagonal of C alone, 2ζᵢωᵢ = φᵢᵀDφᵢ. Where mode j moves at its frequency, what is left out moves mode i by
//! the fraction |Cᵢⱼ| ωⱼ/|ωᵢ² − ωⱼ²| of it (T. K. Hasselman, "Modal Coupling in Lightly Damped Structures", AIAA J. 14
//! (1976)): small if the damping is light and the frequencies are apart, whatever the damping is.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use thiserror::Error;

use super::super::{ModeSection, StructureKind, StructureSection};
use resonarm_dynamics::structure::{Assembly, StructureMode};
use resonarm_numeric::number::rounded;

/// Largest fraction by which damping may couple modes that are kept separate.
const COUPLING_LIMIT: f64 = 1e-2;

/// Reason why a structure can't be converted into modes.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NotModal {
    /// The structure has elements, which modes leave out.
    #[error(
        "the structure has elements ({count}), but only its linear part has modes; leave them out, and add them to the modal structure"
    )]
    Elements {
        /// Number of elements of the structure.
        count: usize,
    },
    /// The number of modes to keep is out of range.
    #[error("{got} modes can't be kept: it must be from 1 to {most}, the modes of the structure")]
    Kept {
        /// Number that was given.
        got: usize,
        /// Number of modes of the structure.
        most: usize,
    },
    /// The damping couples two modes too strongly.
    #[error(
        "its damping couples modes {} and {}: one moves the other by {} of its motion, but a modal structure may neglect at most \
         {most}; keep the structure as it is, or use less damping",
        modes[0], modes[1], rounded(.coupling, 3)
    )]
    Coupled {
        /// The modes, from 1.
        modes: [usize; 2],
        /// Fraction of one mode's motion that appears in the other.
        coupling: f64,
        /// Largest fraction that may be left out.
        most: f64,
    },
}

impl StructureSection {
    /// Returns the modal structure of the lowest `modes` of a structure without elements about its rest, all
    /// modes if it is `None`. Its points are those of the structure, at their positions, with a line along the
    /// links; joints are left out.
    ///
    /// # Errors
    /// [`NotModal`] for elements, an impossible number of modes, or damping that couples modes by more than 0.01.
    pub fn from_modes(of: &Assembly, modes: Option<usize>) -> Result<StructureSection, NotModal> {
        if of.has_elements() {
            return Err(NotModal::Elements { count: of.spec().elements.len() });
        }
        let most = of.modes().len();
        let keep = modes.unwrap_or(most);
        let kept = match of.modes().get(..keep) {
            Some(kept) if keep > 0 => kept,
            _ => return Err(NotModal::Kept { got: keep, most }),
        };
        let damping = damping(of, kept)?;
        let section = |(mode, own): (&StructureMode, f64)| ModeSection {
            frequency_hz: mode.frequency_hz,
            damping_ratio: if own == 0.0 { 0.0 } else { own / (2.0 * TAU * mode.frequency_hz) },
            shape: shape(of, mode),
            participation: BTreeMap::new(),
        };
        let modes = kept.iter().zip(damping).map(section).collect();
        let rest_m = of.rest_m().unwrap_or_default();
        let lines = if rest_m.is_empty() { Vec::new() } else { vec![of.points()] };
        // Chains are planar, and lie in z = 0.
        let points = of.points().into_iter().zip(rest_m).map(|(name, [x, y])| (name, [x, y, 0.0])).collect();
        Ok(StructureSection { kind: StructureKind::Modal, modes, points, lines, ..StructureSection::default() })
    }
}

/// Returns the displacements of all points in a mode, 1/√kg.
fn shape(of: &Assembly, mode: &StructureMode) -> BTreeMap<String, f64> {
    let mut moved = BTreeMap::new();
    for name in of.dof_names() {
        if let Some(dof) = of.dof(&name).ok().filter(|dof| !dof.is_angle() && !dof.is_base()) {
            moved.insert(name, of.direction_at_rest(dof).iter().zip(&mode.shape).map(|(x, q)| x * q).sum());
        }
    }
    moved
}

/// Returns the diagonal of C, 1/s, if the off-diagonal terms may be neglected.
fn damping(of: &Assembly, modes: &[StructureMode]) -> Result<Vec<f64>, NotModal> {
    let n = of.coordinates();
    let linear = of.linear();
    let entry = |i: usize, j: usize| {
        let row = |k: usize| (0..n).map(|m| linear.damping[k * n + m] * modes[j].shape[m]).sum::<f64>();
        (0..n).map(|k| modes[i].shape[k] * row(k)).sum::<f64>()
    };
    for i in 1..modes.len() {
        for j in 0..i {
            // The larger of the two fractions in the module documentation: the mode of higher frequency drives
            // the other more strongly by its velocity.
            let [low, high] = [j, i].map(|mode| TAU * modes[mode].frequency_hz);
            let coupling = entry(i, j).abs() * high / (high * high - low * low);
            if coupling > COUPLING_LIMIT {
                return Err(NotModal::Coupled { modes: [j + 1, i + 1], coupling, most: COUPLING_LIMIT });
            }
        }
    }
    Ok((0..modes.len()).map(|mode| entry(mode, mode)).collect())
}
