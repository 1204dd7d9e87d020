//! The unknowns of harmonic balance.
//!
//! For a chain they are all its coordinates, since every force is nonlinear in them. For modes they are only the
//! displacements u of the elements, each place once; or, of forces that are not smooth and need many harmonics, the
//! coordinates of the modes if these are fewer. With the compliance H(s) = Σ φφᵀ/(ω² + 2ζω s + s²) the harmonics satisfy
//!
//! ```text
//! uₖ + H_uu(ikΩ) Qₖ(u) − H_ud(ikΩ) pₖ = 0
//! ```
//!
//! Q being the forces at the places, p the drive's at d. The number of modes costs only the sums in H. The coordinates of the
//! modes are places, too: φ is 1 for one mode each, and an element's displacement is a sum of several places.
//!
//! A rigid mode, ω = 0, has no compliance at rest. As long as no element sees it, nothing drives its mean, which is 0;
//! a structure with such an element is rejected ([`Unknowns::check_held`]).
//!
//! At the natural frequency of a mode without damping H has a pole. A backbone begins there, and so has the first
//! harmonic of its mode as an unknown of its own ([`Kept`]), which H₁ then leaves out.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

use resonarm_dynamics::structure::{Assembly, BodySpec, Dof, Polynomial};

use crate::error::AnalysisError;
use crate::forced::Forced;

/// Displacements between points below this fraction of those of the points are rounding.
const RIGID: f64 = 1e-9;

/// A harmonic nearer than this, as a fraction, to the natural frequency of an undamped mode is at the pole of H.
const AT_POLE: f64 = 1e-9;

/// The unknowns of a structure.
#[derive(Clone, Debug)]
pub(super) struct Unknowns {
    pub body: Body,
    count: usize,
    /// ν: the periods of the drive after which the response repeats.
    pub period: usize,
}

#[derive(Clone, Debug)]
pub(super) enum Body {
    /// A chain: the unknowns are those of its coordinates.
    Chain,
    /// The displacements of the elements.
    Condensed(Condensed),
}

/// A displacement as a sum over places, each with its weight.
pub(super) type Weights = Vec<(usize, f64)>;

/// Modes seen from the places of the elements.
#[derive(Clone, Debug)]
pub(super) struct Condensed {
    /// The displacement of each element with one.
    pub of_element: Vec<Weights>,
    /// The displacements of each polynomial.
    pub of_polynomial: Vec<Vec<Weights>>,
    /// For each place, those whose displacements its forces depend on.
    pub coupled: Vec<Vec<usize>>,
    /// Whether the places are the coordinates of the modes, between which there is no compliance.
    pub is_by_modes: bool,
    /// φ of each mode at each place.
    pub places: Vec<Vec<f64>>,
    /// φ of each mode at the drive.
    pub drive: Vec<f64>,
    /// ω, rad/s, and ζ.
    pub modes: Vec<[f64; 2]>,
}

/// The mode whose first harmonic, c cos Ωt, is an unknown of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kept {
    pub mode: usize,
    /// Coefficient of the cosine, m·√kg.
    pub cosine: f64,
}

/// H between places at one frequency, and its derivative by ω.
#[derive(Clone, Debug, Default)]
pub(super) struct Compliance {
    /// Between the places, by rows.
    pub places: Vec<[Complex<f64>; 2]>,
    /// From the drive to the places.
    pub drive: Vec<[Complex<f64>; 2]>,
}

impl Unknowns {
    /// The unknowns of responses with `period` periods of the drive.
    pub fn with_period(forced: &Forced, period: usize) -> Unknowns {
        let by_places = Unknowns::by_places(forced, period);
        match by_places.body {
            Body::Condensed(condensed)
                if !forced.assembly.is_smooth() && condensed.modes.len() < condensed.places.len() =>
            {
                let condensed = condensed.by_modes();
                Unknowns { count: condensed.places.len(), body: Body::Condensed(condensed), period }
            }
            _ => by_places,
        }
    }

    /// The same with the displacements of the elements, even if the modes are fewer.
    pub fn by_places(forced: &Forced, period: usize) -> Unknowns {
        let assembly = &forced.assembly;
        match &assembly.spec().body {
            BodySpec::Chain(_) => Unknowns { body: Body::Chain, count: assembly.coordinates(), period },
            BodySpec::Modal(modal) => {
                let modes = modal.modes.iter().map(|mode| [TAU * mode.frequency_hz, mode.damping_ratio]).collect();
                let condensed = Condensed::new(forced, modes);
                let count = condensed.places.len();
                Unknowns { body: Body::Condensed(condensed), count, period }
            }
        }
    }

    /// Rejects a structure with a rigid mode that an element alone holds.
    pub fn check_held(&self, assembly: &Assembly) -> Result<(), AnalysisError> {
        let Body::Condensed(condensed) = &self.body else { return Ok(()) };
        let rigid = condensed.modes.iter().enumerate().filter(|(_, mode)| mode[0] == 0.0).map(|(mode, _)| mode);
        let elements = assembly.elements().iter().map(|element| element.number).zip(&condensed.of_element);
        let polynomials = assembly.polynomials().iter().map(Polynomial::number).zip(&condensed.of_polynomial);
        let elements = elements.map(|(number, weights)| (number, core::slice::from_ref(weights)));
        let all: Vec<(usize, &[Weights])> =
            elements.chain(polynomials.map(|(number, displacements)| (number, &displacements[..]))).collect();
        let sees = |displacements: &[Weights], mode: usize| {
            displacements.iter().flatten().any(|(place, _)| condensed.places[*place][mode] != 0.0)
        };
        let by = |mode: usize| all.iter().find(|(_, displacements)| sees(displacements, mode));
        match rigid.into_iter().find_map(|mode| Some((mode, by(mode)?.0))) {
            Some((mode, element)) => Err(AnalysisError::HeldByElement { mode: mode + 1, element }),
            None => Ok(()),
        }
    }

    /// Returns the error if one of so many harmonics of a rate has the natural frequency of a mode without damping of its
    /// own, where H has a pole, even though elements may damp the mode.
    pub fn undamped_at(&self, rate_rad_s: f64, harmonics: usize) -> Option<AnalysisError> {
        let Body::Condensed(condensed) = &self.body else { return None };
        let harmonic = |omega: f64| libm::round(omega / rate_rad_s);
        let is_at = |omega: f64| (harmonic(omega) * rate_rad_s / omega - 1.0).abs() < AT_POLE;
        let at = |&[omega, zeta]: &[f64; 2]| {
            zeta == 0.0 && omega > 0.0 && is_at(omega) && (1.0..=harmonics as f64).contains(&harmonic(omega))
        };
        let mode = condensed.modes.iter().position(at)?;
        let omega = condensed.modes[mode][0];
        let harmonic = harmonic(omega) as usize;
        Some(AnalysisError::AtUndampedMode { mode: mode + 1, natural_hz: omega / TAU, harmonic })
    }

    /// Number of unknowns of a harmonic, m.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// Returns the places that forces couple with each place: an element those of its displacement, a polynomial those of all of
/// its own.
fn coupled(count: usize, of_element: &[Weights], of_polynomial: &[Vec<Weights>]) -> Vec<Vec<usize>> {
    let polynomials = of_polynomial.iter().map(|displacements| displacements.concat());
    let groups: Vec<Weights> = of_element.iter().cloned().chain(polynomials).collect();
    let has = |group: &Weights, place: usize| group.iter().any(|(own, _)| *own == place);
    let are_coupled =
        |one: usize, other: usize| one == other || groups.iter().any(|group| has(group, one) && has(group, other));
    (0..count).map(|one| (0..count).filter(|other| are_coupled(one, *other)).collect()).collect()
}

impl Condensed {
    /// Without elements the one place is that of the drive.
    fn new(forced: &Forced, modes: Vec<[f64; 2]>) -> Condensed {
        let assembly = &forced.assembly;
        let mut ends = vec![];
        let mut places = vec![];
        let drive = forced.direction_at_rest();
        let mut place_of = |at: Dof, to: Option<Dof>| {
            let own = (at, to);
            // Elements between the same two ends share an unknown.
            let place = ends.iter().position(|ends| *ends == own).unwrap_or(ends.len());
            if place == ends.len() {
                ends.push(own);
                let end = assembly.direction_at_rest(at);
                let other = to.map(|to| assembly.direction_at_rest(to));
                let mut direction = end.clone();
                direction.iter_mut().zip(other.iter().flatten()).for_each(|(along, other)| *along -= other);
                // Between two points a rigid mode moves nothing, but for rounding.
                for ((along, end), _) in direction.iter_mut().zip(end).zip(&modes).filter(|(_, mode)| mode[0] == 0.0) {
                    *along = if along.abs() <= RIGID * libm::fabs(end) { 0.0 } else { *along };
                }
                places.push(direction);
            }
            place
        };
        let alone = |place: usize| vec![(place, 1.0)];
        let of_element: Vec<Weights> =
            assembly.elements().iter().map(|element| alone(place_of(element.at, element.to))).collect();
        let polynomials = assembly.polynomials().iter();
        let of_polynomial: Vec<Vec<Weights>> =
            polynomials.map(|of| of.at().iter().map(|at| alone(place_of(*at, None))).collect()).collect();
        if places.is_empty() {
            places.push(drive.clone());
        }
        let coupled = coupled(places.len(), &of_element, &of_polynomial);
        Condensed { of_element, of_polynomial, coupled, is_by_modes: false, places, drive, modes }
    }

    /// The same with the coordinates of the modes as places.
    fn by_modes(self) -> Condensed {
        let Condensed { of_element, of_polynomial, places, drive, modes, .. } = self;
        let spread = |weights: &Weights| -> Weights {
            let along = |mode: usize| weights.iter().map(|(place, weight)| weight * places[*place][mode]).sum();
            let all = (0..modes.len()).map(|mode| (mode, along(mode)));
            all.filter(|(_, weight): &(usize, f64)| *weight != 0.0).collect()
        };
        let of_element: Vec<Weights> = of_element.iter().map(spread).collect();
        let of_polynomial: Vec<Vec<Weights>> =
            of_polynomial.iter().map(|displacements| displacements.iter().map(spread).collect()).collect();
        let coupled = coupled(modes.len(), &of_element, &of_polynomial);
        let unit = |place: usize| (0..modes.len()).map(|mode| f64::from(u8::from(mode == place))).collect();
        let places = (0..modes.len()).map(unit).collect();
        Condensed { of_element, of_polynomial, coupled, is_by_modes: true, places, drive, modes }
    }

    /// Returns each mode's 1/(ω² + 2ζω s + s²) at s = i `rate`, and its derivative by the rate; zeros for the mode left
    /// out.
    fn poles(&self, rate_rad_s: f64, without: Option<usize>) -> impl Iterator<Item = [Complex<f64>; 2]> + '_ {
        self.modes.iter().enumerate().map(move |(mode, &[omega, zeta])| {
            // Nothing drives the mean of a rigid mode, and its compliance at rest would be infinite.
            let is_rigid_at_rest = omega == 0.0 && rate_rad_s == 0.0;
            if without == Some(mode) || is_rigid_at_rest {
                return [Complex::new(0.0, 0.0); 2];
            }
            let value = Complex::new(omega * omega - rate_rad_s * rate_rad_s, 2.0 * zeta * omega * rate_rad_s).inv();
            // d(1/D) = −dD/D² with D = ω² − r² + 2iζωr.
            let slope = -value * value * Complex::new(-2.0 * rate_rad_s, 2.0 * zeta * omega);
            [value, slope]
        })
    }

    /// Computes H at a frequency, rad/s, of all modes or all but one.
    pub fn compliance(&self, rate_rad_s: f64, without: Option<usize>, out: &mut Compliance) {
        self.sum(self.poles(rate_rad_s, without), out);
    }

    /// Computes `factor` times the derivative of H at a frequency by a damper in proportion to the mass, 1/s; the
    /// derivatives by the frequency are left at zero.
    pub fn compliance_by_damper(&self, rate_rad_s: f64, factor: f64, out: &mut Compliance) {
        // The damper adds c s to the denominator ω² + 2ζω s + s².
        let by_damper = |[pole, _]: [Complex<f64>; 2]| -pole * pole * Complex::new(0.0, factor * rate_rad_s);
        self.sum(self.poles(rate_rad_s, None).map(|pole| [by_damper(pole), Complex::new(0.0, 0.0)]), out);
    }

    /// Computes the sums of φφᵀ over modes, with these factors.
    fn sum(&self, factors: impl Iterator<Item = [Complex<f64>; 2]>, out: &mut Compliance) {
        let m = self.places.len();
        let zero = [Complex::new(0.0, 0.0); 2];
        out.places.clear();
        out.places.resize(m * m, zero);
        out.drive.clear();
        out.drive.resize(m, zero);
        for (mode, pole) in factors.enumerate() {
            for i in 0..m {
                let phi = self.places[i][mode];
                for (d, pole) in pole.iter().enumerate() {
                    for k in 0..m {
                        out.places[i * m + k][d] += pole * (phi * self.places[k][mode]);
                    }
                    out.drive[i][d] += pole * (phi * self.drive[mode]);
                }
            }
        }
    }

    /// The harmonic of a displacement along `direction`: Σ φ/(…) (φ_d p − Σ φ_j Q_j), from the drive's p and Q. A mode
    /// that is kept adds its own.
    pub fn harmonic(
        &self,
        rate_rad_s: f64,
        direction: &[f64],
        kept: Option<Kept>,
        p: Complex<f64>,
        q: &[Complex<f64>],
    ) -> Complex<f64> {
        let mut sum = Complex::new(kept.map_or(0.0, |kept| direction[kept.mode] * kept.cosine), 0.0);
        for (mode, [pole, _]) in self.poles(rate_rad_s, kept.map(|kept| kept.mode)).enumerate() {
            let mut force = p * self.drive[mode];
            for (place, q) in self.places.iter().zip(q) {
                force -= q * place[mode];
            }
            sum += pole * force * direction[mode];
        }
        sum
    }
}
