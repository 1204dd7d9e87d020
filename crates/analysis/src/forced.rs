//! A structure under a sinusoidal drive.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use resonarm_dynamics::structure::{
    Assembly, BodySpec, Dof, ElementSpec, Law, LoadHarmonic, MOST_COORDINATES, Parameter, Position, StepLoad,
    StructureError,
};

use crate::dense::dot;
use crate::error::{AnalysisError, Place};

/// A structure and its drive, amplitude · sin Ωt: a force along an axis at a point, or a torque at a joint; or several
/// in phase, each with a share of the amplitude. The drive may have harmonics, [`Forced::with_harmonics`].
#[derive(Clone, Debug, PartialEq)]
pub struct Forced {
    pub(super) assembly: Assembly,
    pub(super) drives: Vec<(Dof, f64)>,
    pub(super) amplitude: f64,
    harmonics: Vec<LoadHarmonic>,
}

/// A component of a drive, c cos kΩt + s sin kΩt times the amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Component {
    pub order: usize,
    /// The factors c of the cosine and s of the sine.
    pub parts: [f64; 2],
}

impl Forced {
    /// The structure under amplitude · sin Ωt at `drive`, one of its degrees of freedom; N, N·m at a joint, or m/s² of
    /// the base.
    pub fn new(assembly: Assembly, drive: Dof, amplitude: f64) -> Forced {
        Forced::at_several(assembly, &[(drive, 1.0)], amplitude)
    }

    /// The structure under share · amplitude · sin Ωt at each of several of its degrees of freedom, at least one.
    pub fn at_several(assembly: Assembly, drives: &[(Dof, f64)], amplitude: f64) -> Forced {
        Forced { assembly, drives: drives.to_vec(), amplitude, harmonics: vec![] }
    }

    /// Returns the same structure under the drive amplitude · (sin Ωt + Σ ratio · sin(kΩt + phase)), at the same places
    /// and with the same shares.
    #[must_use]
    pub fn with_harmonics(self, harmonics: Vec<LoadHarmonic>) -> Forced {
        Forced { harmonics, ..self }
    }

    /// The harmonics of the drive beside the fundamental.
    pub fn harmonics(&self) -> &[LoadHarmonic] {
        &self.harmonics
    }

    /// The highest order of the drive; 1 without harmonics.
    pub fn highest_order(&self) -> usize {
        self.harmonics.iter().fold(1, |highest, of| highest.max(of.order))
    }

    /// Returns the components of the drive: r sin(kτ + φ) = r sin φ cos kτ + r cos φ sin kτ.
    pub(super) fn components(&self) -> impl Iterator<Item = Component> + '_ {
        let of = |of: &LoadHarmonic| {
            let (sine, cosine) = libm::sincos(of.phase_rad);
            Component { order: of.order, parts: [of.ratio * sine, of.ratio * cosine] }
        };
        core::iter::once(Component { order: 1, parts: [0.0, 1.0] }).chain(self.harmonics.iter().map(of))
    }

    /// Returns the drive at the amplitude 1 at a phase Ωt, rad.
    pub(super) fn wave(&self, phase_rad: f64) -> f64 {
        LoadHarmonic::sum(phase_rad, &self.harmonics)
    }

    /// Returns the loads over a step, with the peaks of the fundamental.
    pub(super) fn step_load<'a>(&'a self, amplitude: &'a [f64], omega_rad_s: f64) -> StepLoad<'a> {
        if self.harmonics.is_empty() {
            return StepLoad::Sine { amplitude, omega_rad_s };
        }
        StepLoad::Periodic { amplitude, omega_rad_s, harmonics: &self.harmonics }
    }

    /// Returns the same structure and drive without damping: dampers of joints, damping ratios, losses of contacts,
    /// dampers between points.
    ///
    /// # Errors
    /// [`AnalysisError::Dissipates`] for an element whose loss can't be left out.
    pub fn undamped(&self) -> Result<Forced, AnalysisError> {
        Ok(Forced { assembly: undamped(&self.assembly)?, ..self.clone() })
    }

    /// Returns a structure without damping for the free vibrations of a mode, numbered from 0 in the order of frequency.
    ///
    /// They need no drive. Their equations have one all the same, whose amplitude comes out as 0; it acts at the degree
    /// of freedom that the mode moves most, so that it reaches the mode.
    ///
    /// # Errors
    /// [`AnalysisError::Dissipates`] for an element whose loss can't be left out, [`AnalysisError::NoMode`] if there is no
    /// such mode, [`AnalysisError::NotDriven`] if it moves none of the structure's points.
    pub fn free(assembly: &Assembly, mode: usize) -> Result<Forced, AnalysisError> {
        let assembly = undamped(assembly)?;
        let got = mode + 1;
        let modes = assembly.modes();
        let mode = modes.get(mode).ok_or(AnalysisError::NoMode { got, most: modes.len() })?;
        let dofs = assembly.dof_names().into_iter().filter_map(|name| assembly.dof(&name).ok());
        // Displacements count from the base, which none of them moves.
        let moves = |dof: Dof| (dot(&load_at_rest(&assembly, dof), &mode.shape).abs(), dof);
        let most = dofs.filter(|dof| !dof.is_base()).map(moves).max_by(|a, b| a.0.total_cmp(&b.0));
        let at = Place { value: mode.frequency_hz, unit: "Hz" };
        let (_, dof) = most.filter(|(size, _)| *size > 0.0).ok_or(AnalysisError::NotDriven { mode: got, at })?;
        Ok(Forced::new(assembly, dof, 1.0))
    }

    /// Returns the structure without damping, and without elements whose force is friction.
    ///
    /// # Errors
    /// As [`Assembly::new`].
    pub(super) fn without_dissipation(&self) -> Result<Forced, AnalysisError> {
        let mut spec = self.assembly.spec().clone();
        let is_friction = |law: &Law| matches!(law, Law::Friction { .. } | Law::Lugre { .. } | Law::Tanh { .. });
        spec.elements.retain(|element| !matches!(element, ElementSpec::Point { law, .. } if is_friction(law)));
        Forced { assembly: Assembly::new(&spec)?, ..self.clone() }.undamped()
    }

    /// Says whether nothing dissipates energy: no joint, no mode and no element.
    pub fn is_conservative(&self) -> bool {
        let spec = self.assembly.spec();
        let undamped = match &spec.body {
            BodySpec::Chain(chain) => chain.links.iter().all(|link| link.damping_nm_s_rad == 0.0),
            BodySpec::Modal(modal) => modal.modes.iter().all(|mode| mode.damping_ratio == 0.0),
        };
        undamped
            && self.assembly.elements().iter().all(|element| match element.law {
                Law::Cubic { .. } | Law::Gap { .. } => true,
                Law::KelvinVoigt { damping, .. } | Law::HuntCrossley { damping, .. } | Law::Linear { damping, .. } => {
                    damping == 0.0
                }
                Law::Friction { .. } | Law::Lugre { .. } | Law::Tanh { .. } => false,
            })
    }

    /// Says whether the structure is linear: modes with linear elements only.
    pub fn is_linear(&self) -> bool {
        matches!(self.assembly.spec().body, BodySpec::Modal(_))
            && self.assembly.polynomials().is_empty()
            && self.assembly.elements().iter().all(|element| matches!(element.law, Law::Linear { .. }))
    }

    /// Returns the structure under a drive of another amplitude.
    pub fn with_amplitude(&self, amplitude: f64) -> Forced {
        Forced { amplitude, ..self.clone() }
    }

    /// Returns the drive of a structure with another value of a parameter.
    ///
    /// # Errors
    /// As [`Assembly::with`].
    pub fn with_parameter(&self, parameter: Parameter, value: f64) -> Result<Forced, StructureError> {
        Ok(Forced { assembly: self.assembly.with(parameter, value)?, ..self.clone() })
    }

    /// The structure that is driven.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// The degrees of freedom at which it is driven, with their shares of the amplitude.
    pub fn drives(&self) -> &[(Dof, f64)] {
        &self.drives
    }

    /// Writes the generalised force of the drive at the amplitude 1 in a position, n numbers.
    pub(super) fn direction(&self, at: &Position<'_>, out: &mut [f64]) {
        let Some(((first, share), others)) = self.drives.split_first() else { return out.fill(0.0) };
        at.load_direction(*first, out);
        out.iter_mut().for_each(|along| *along *= share);
        for &(dof, share) in others {
            let mut one = [0.0; MOST_COORDINATES];
            at.load_direction(dof, &mut one);
            out.iter_mut().zip(&one).for_each(|(sum, along)| *sum += share * along);
        }
    }

    /// Returns the generalised force of the drive at the amplitude 1 at rest.
    pub(super) fn direction_at_rest(&self) -> Vec<f64> {
        let rest = vec![0.0; self.assembly.coordinates()];
        let mut direction = rest.clone();
        self.direction(&self.assembly.at(&rest), &mut direction);
        direction
    }

    /// Adds `factor` times the derivative of [`Forced::direction`] by the coordinates to a matrix by rows.
    pub(super) fn add_curvature(&self, at: &Position<'_>, factor: f64, matrix: &mut [f64]) {
        for &(dof, share) in &self.drives {
            at.add_curvature(dof, share * factor, matrix);
        }
    }

    /// The peak of the drive, N, or N·m at a joint.
    pub fn amplitude(&self) -> f64 {
        self.amplitude
    }

    /// The unit of the amplitude.
    pub fn unit(&self) -> &'static str {
        let mut units = self.drives.iter().map(|(dof, _)| dof.load_unit());
        let first = units.next().unwrap_or_default();
        if units.all(|unit| unit == first) { first } else { "times the drive" }
    }
}

/// Returns a structure without damping, see [`Forced::undamped`].
fn undamped(assembly: &Assembly) -> Result<Assembly, AnalysisError> {
    let mut spec = assembly.spec().clone();
    match &mut spec.body {
        BodySpec::Chain(chain) => chain.links.iter_mut().for_each(|link| link.damping_nm_s_rad = 0.0),
        BodySpec::Modal(modal) => modal.modes.iter_mut().for_each(|mode| mode.damping_ratio = 0.0),
    }
    for (index, element) in spec.elements.iter_mut().enumerate() {
        let ElementSpec::Point { law, .. } = element else { continue };
        match law {
            Law::KelvinVoigt { damping, .. } | Law::HuntCrossley { damping, .. } | Law::Linear { damping, .. } => {
                *damping = 0.0;
            }
            Law::Cubic { .. } | Law::Gap { .. } => {}
            law => return Err(AnalysisError::Dissipates { element: index + 1, law: law.name() }),
        }
    }
    // A linear element that was only a damper exerts no force any more.
    let idle = Law::Linear { stiffness: 0.0, damping: 0.0 };
    spec.elements.retain(|element| !matches!(element, ElementSpec::Point { law, .. } if *law == idle));
    Ok(Assembly::new(&spec)?)
}

/// The coordinate that varies along a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// Frequency of the drive Ω/2π, Hz.
    FrequencyHz,
    /// The peak of the drive, N, or N·m at a joint.
    Amplitude,
    /// A parameter of the structure, in its unit.
    Parameter(Parameter),
}

/// The name in results: `frequency_hz`, `amplitude`, or that of the parameter.
impl fmt::Display for Coordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Coordinate::FrequencyHz => f.pad("frequency_hz"),
            Coordinate::Amplitude => f.pad("amplitude"),
            Coordinate::Parameter(parameter) => parameter.fmt(f),
        }
    }
}

/// Returns the generalised forces of a unit load at rest.
pub(super) fn load_at_rest(assembly: &Assembly, dof: Dof) -> Vec<f64> {
    let n = assembly.coordinates();
    let rest = vec![0.0; n];
    let mut direction = vec![0.0; n];
    assembly.at(&rest).load_direction(dof, &mut direction);
    direction
}
