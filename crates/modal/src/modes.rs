//! Results: modes with residues, shapes and deviations.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

use crate::complex::{exp, log, magnitude, root};
use crate::deviations::{Block, Covariance, Place};
use crate::fit::{Fit, Problem};
use crate::model::Quantity;
use crate::pole::{block, damping_ratio, deviations, frequency_hz};
use crate::start::Stabilisation;

/// Modal phase collinearity below which a shape is reported as complex.
const COLLINEAR: f64 = 0.95;
/// Least number of degrees of freedom for that: two points are always nearly collinear, or say nothing.
const LEAST_POINTS: usize = 3;

/// Systematic errors of the instruments, as parts of each value; they are added to the deviations (root of the sum of
/// squares). All 0 by default.
///
/// A force that is held between its samples has images above half the sample rate, which the readings fold onto the band. Of
/// converters with N integrators (sincᴺ) the share of an image at fs − f is (f/(fs − f))ᴺ⁺¹: with N = 5, frequencies were right to
/// 2.5e-8 and damping ratios to 5e-7; residues and shapes to about 3 (f/(fs − f))⁶.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Floor {
    /// Relative error of natural frequencies.
    pub frequency: f64,
    /// Relative error of damping ratios.
    pub damping_ratio: f64,
    /// Relative error of residues and shapes, multiplied by (f/(fs − f)) to the power `image_order`, with f the frequency of the
    /// mode and fs the sample rate. Frequency responses have no sample rate: there the power must be 0.
    pub shape: f64,
    /// That power; 0 for an error that does not depend on the frequency.
    pub image_order: u8,
}

impl Floor {
    /// Relative error of residues and shapes at a frequency.
    fn shape_at(&self, frequency_hz: f64, rate_hz: f64) -> f64 {
        let share = frequency_hz / (rate_hz - frequency_hz);
        (0..self.image_order).fold(self.shape, |floor, _| floor * share)
    }
}

/// Standard deviations of a pole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoleDeviations {
    /// Of the natural frequency, Hz.
    pub frequency_hz: f64,
    /// Of the damping ratio.
    pub damping_ratio: f64,
}

/// Reason why the deviations of a mode can't be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// The residuals of channels exceed the known noise of their instruments: the structure is not linear, or something is
    /// missing in the model.
    AboveInstrument {
        /// Degree of freedom of the channel that exceeds it most.
        dof: usize,
        /// Whether the channel is a reference.
        is_reference: bool,
        /// Estimated standard deviation of its noise over the known one, above 1.5.
        ratio: f64,
        /// Number of other channels, of all runs, for which this ratio is above 1.5.
        others: usize,
    },
    /// The residual is not white: a mode is missing, or the structure is not linear.
    NotWhite {
        /// Frequency of the largest residual, Hz.
        frequency_hz: f64,
        /// Its smoothed power over the median.
        ratio: f64,
    },
    /// The damping ratio is uncertain, so that deviations to first order don't hold.
    Uncertain {
        /// Deviation over damping ratio, above 0.3.
        ratio: f64,
    },
    /// The half-power bandwidth has too few lines, and the record is not at rest at its ends.
    TooShort {
        /// Lines in the bandwidth 2ζf, below 0.3.
        lines: f64,
    },
    /// The noise of a reference is a large part of its power near the mode, so that deviations to first order don't hold.
    NoisyReference {
        /// Degree of freedom of the reference.
        dof: usize,
        /// Noise power over power in the half-power band, above 0.01.
        share: f64,
    },
    /// Another pole is as near as the poles scatter.
    Close {
        /// Natural frequency of the other mode, Hz.
        frequency_hz: f64,
        /// Distance of the poles in standard deviations of that distance, below 2.
        distance: f64,
    },
    /// The poles differ between two levels of excitation.
    Nonlinear {
        /// Largest difference in standard deviations, above 4.
        z: f64,
    },
}

/// Something about a mode that a user should look at; its figures stay as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warning {
    /// The shape is complex: its points don't reach their largest displacements together. True modes may be complex; a mode of
    /// noise always is.
    Complex {
        /// Modal phase collinearity, below 0.95.
        collinearity: f64,
        /// Mean phase deviation, degrees.
        phase_deviation_deg: f64,
    },
    /// The response at the driving point is opposite to the force: the sensor or the force sensor is mounted the other way
    /// round, or the point is not the driving point. The shape's scale is wrong.
    DrivingPoint {
        /// Degree of freedom of the driving point.
        dof: usize,
        /// Phase of the modal constant 2jωR there, degrees; 0 for a normal mode.
        phase_deg: f64,
    },
}

/// A residue of the receptance H = Σ R/(s − λ) + R̄/(s − λ̄).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residue {
    /// Degree of freedom of the reference.
    pub reference: usize,
    /// Degree of freedom of the response.
    pub response: usize,
    /// Index of the run, from 0.
    pub run: usize,
    /// Value, unit of the response's displacement over that of the reference, per second.
    pub value: Complex<f64>,
    /// Standard deviations of its real and its imaginary part.
    pub deviation: Complex<f64>,
}

/// A component of a mode shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// Degree of freedom whose displacement it is.
    pub dof: usize,
    /// Value for unit modal mass, 1/√kg with N and m. Its imaginary part is small for a nearly normal mode.
    pub value: Complex<f64>,
    /// Standard deviations of its real and its imaginary part.
    pub deviation: Complex<f64>,
    /// Covariances of its real part with that of the driving point's component, and of the imaginary parts. The deviation of a
    /// sum of both components, such as the motion along another direction at the driving point, follows from them.
    pub with_driving_point: Complex<f64>,
}

/// A mode shape, scaled to unit modal mass at a driving point: a = 2jωR with the damped frequency ω = Im λ, φ_d = √a_d, φₒ =
/// aₒ/φ_d.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Degree of freedom of the driving point: that of the references with the least uncertain residue.
    pub driving_point: usize,
    /// Components by rising degree of freedom; that of the driving point has a positive real part.
    pub components: Vec<Component>,
    /// Modal mass of the shape that is 1 at the driving point, 1/|a_d|: kg with N and m.
    pub modal_mass: f64,
    /// Standard deviation of the modal mass, in the unit of the mass.
    pub modal_mass_deviation: f64,
    /// Modal phase collinearity, 0 to 1; 1 for a normal mode. J.-N. Juang, R. S. Pappa, "An Eigensystem Realization Algorithm
    /// for Modal Parameter Identification and Model Reduction", J. Guid. Control Dyn. 8 (1985).
    pub collinearity: f64,
    /// Mean phase deviation from the direction of the shape in the complex plane, degrees, weighted by magnitude: 0 for a
    /// normal mode. W. Heylen, S. Lammens, P. Sas, "Modal Analysis Theory and Testing" (1997).
    pub phase_deviation_deg: f64,
}

impl Shape {
    /// Returns the normal shape: the parts of the components along the shape's direction in the complex plane, with the sign
    /// of their real parts.
    pub fn normal(&self) -> Vec<(usize, f64)> {
        let values: Vec<Complex<f64>> = self.components.iter().map(|component| component.value).collect();
        self.components.iter().map(|component| component.dof).zip(normal(&values)).collect()
    }
}

/// An identified mode: pole, shape and modal mass, with their standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Pole λ, rad/s; the other of the pair is its conjugate.
    pub pole: Complex<f64>,
    /// Natural frequency |λ|/2π, Hz.
    pub frequency_hz: f64,
    /// Damping ratio −Re λ/|λ|.
    pub damping_ratio: f64,
    /// Standard deviations as they follow from the model of the noise. [`Mode::deviations`] returns them if there is no doubt.
    pub computed: PoleDeviations,
    /// Residues of all responses and references.
    pub residues: Vec<Residue>,
    /// Shape; `None` if no reference has its driving point among the responses.
    pub shape: Option<Shape>,
    /// Reasons why the deviations, those of residues and shape too, can't be trusted.
    pub doubts: Vec<Doubt>,
    /// What a user should look at.
    pub warnings: Vec<Warning>,
}

impl Mode {
    /// Returns the standard deviations of the pole, or the reasons why none can be stated.
    ///
    /// # Errors
    /// The [`doubts`](Mode::doubts), if there are any.
    pub fn deviations(&self) -> Result<PoleDeviations, &[Doubt]> {
        if self.doubts.is_empty() { Ok(self.computed) } else { Err(&self.doubts) }
    }
}

/// Estimated noise of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelNoise {
    /// Degree of freedom that the channel measures.
    pub dof: usize,
    /// Estimated standard deviation, of a sample of a record or of a complex value of a frequency response.
    pub estimated: f64,
    /// Known standard deviation of the instrument, if it was given.
    pub known: Option<f64>,
}

/// What is known of a run after the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct RunReport {
    /// Number of lines in the band.
    pub lines: usize,
    /// Distance of two lines, Hz.
    pub spacing_hz: f64,
    /// Whether the transient was a part of the model.
    pub transient: bool,
    /// Noise of the references; none for measured frequency responses, which have no references.
    pub reference_noise: Vec<ChannelNoise>,
    /// Noise of the responses. For a set of frequency responses, in the order of the functions.
    pub response_noise: Vec<ChannelNoise>,
}

/// Terms of a response for modes outside the band: a sᵖ⁻² + b sᵖ with p = 2 for accelerations, 1 for velocities, 0 for
/// displacements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualTerms {
    /// Degree of freedom of the reference.
    pub reference: usize,
    /// Degree of freedom of the response.
    pub response: usize,
    /// Index of the run, from 0.
    pub run: usize,
    /// Term a of the modes below the band: as receptance, a/s².
    pub below: f64,
    /// Term b of the modes above the band: as receptance, the constant b.
    pub above: f64,
}

/// Result of an identification.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Modes by rising frequency.
    pub modes: Vec<Mode>,
    /// Poles over the orders, and the clusters that the fit started from.
    pub stabilisation: Stabilisation,
    /// What the responses are.
    pub quantity: Quantity,
    /// Terms for modes outside the band, of every response and reference.
    pub residual_terms: Vec<ResidualTerms>,
    /// The runs, in the order in which they were given; a set of frequency responses is one run.
    pub runs: Vec<RunReport>,
}

impl Identification {
    /// Returns the fitted frequency response of a response to a reference of a run at a frequency, in the quantity of the
    /// measurement; `None` if they were not measured.
    pub fn response(&self, run: usize, reference: usize, response: usize, frequency_hz: f64) -> Option<Complex<f64>> {
        let s = Complex::new(0.0, TAU * frequency_hz);
        let terms = self
            .residual_terms
            .iter()
            .find(|terms| (terms.run, terms.reference, terms.response) == (run, reference, response))?;
        let mut receptance = Complex::new(terms.above, 0.0) + Complex::new(terms.below, 0.0) / (s * s);
        for mode in &self.modes {
            let residue = mode
                .residues
                .iter()
                .find(|residue| (residue.run, residue.reference, residue.response) == (run, reference, response))?;
            receptance += residue.value / (s - mode.pole) + residue.value.conj() / (s - mode.pole.conj());
        }
        Some(match self.quantity {
            Quantity::Acceleration => receptance * s * s,
            Quantity::Velocity => receptance * s,
            Quantity::Displacement => receptance,
        })
    }
}

/// Modal assurance criterion |aᴴb|²/(aᴴa bᴴb) of two shapes over the same degrees of freedom, 0 to 1. R. J. Allemang, D. L.
/// Brown, "A Correlation Coefficient for Modal Vector Analysis", Proc. 1st IMAC (1982).
pub fn assurance(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    let product: Complex<f64> = a.iter().zip(b).map(|(a, b)| a.conj() * b).sum();
    let power = |shape: &[Complex<f64>]| shape.iter().map(Complex::norm_sqr).sum::<f64>();
    product.norm_sqr() / (power(a) * power(b))
}

/// Returns the normal shape of complex components: their parts along the principal axis of the shape in the complex plane, with
/// the sign of their real parts.
pub fn normal(values: &[Complex<f64>]) -> Vec<f64> {
    let direction = direction(values);
    values.iter().map(|value| (value * direction.conj()).re).collect()
}

/// Returns the modal phase collinearity of a shape, ((Sxx − Syy)² + 4 Sxy²)/(Sxx + Syy)² with the sums of products of real and
/// imaginary parts.
fn collinearity(values: &[Complex<f64>]) -> f64 {
    let [xx, yy, xy] = moments(values);
    ((xx - yy) * (xx - yy) + 4.0 * xy * xy) / ((xx + yy) * (xx + yy))
}

fn moments(values: &[Complex<f64>]) -> [f64; 3] {
    values.iter().fold([0.0; 3], |[xx, yy, xy], value| {
        [xx + value.re * value.re, yy + value.im * value.im, xy + value.re * value.im]
    })
}

/// Returns the direction of a shape in the complex plane, e^(jθ) with −π/2 < θ ≤ π/2: the principal axis of its components.
fn direction(values: &[Complex<f64>]) -> Complex<f64> {
    let [xx, yy, xy] = moments(values);
    exp(Complex::new(0.0, 0.5 * libm::atan2(2.0 * xy, xx - yy)))
}

/// Returns the mean phase deviation from the shape's direction, degrees.
fn phase_deviation_deg(values: &[Complex<f64>]) -> f64 {
    let direction = direction(values);
    let mut sum = 0.0;
    let mut weights = 0.0;
    for value in values {
        let turned = value * direction.conj();
        let size = magnitude(*value);
        sum += size * libm::atan2(turned.im.abs(), turned.re.abs());
        weights += size;
    }
    (sum / weights).to_degrees()
}

/// Collects the modes of a fit.
pub(crate) fn modes(problem: &Problem, fit: &Fit, covariance: &Covariance, floor: &Floor) -> Vec<Mode> {
    let places: Vec<Place> = places(problem);
    (0..fit.poles.len())
        .map(|index| {
            let pole = fit.poles[index];
            let shape_floor = floor.shape_at(frequency_hz(pole), problem.runs[0].grid.rate_hz);
            let [frequency, damping] = deviations(pole, block(&covariance.poles, fit.poles.len(), index));
            let residues: Vec<Residue> = places
                .iter()
                .map(|place| {
                    let [reference, response] = problem.runs[place.run].pairs.dofs(place.output, place.reference);
                    let value = residue(fit, *place, index);
                    let deviation = spread(covariance.of(*place, index), shape_floor * magnitude(value));
                    Residue { reference, response, run: place.run, value, deviation }
                })
                .collect();
            let shape = shape(problem, fit, covariance, shape_floor, index, &places);
            Mode {
                pole,
                frequency_hz: frequency_hz(pole),
                damping_ratio: damping_ratio(pole),
                computed: PoleDeviations {
                    frequency_hz: libm::hypot(frequency, floor.frequency * frequency_hz(pole)),
                    damping_ratio: libm::hypot(damping, floor.damping_ratio * damping_ratio(pole)),
                },
                residues,
                warnings: shape.as_ref().map_or_else(Vec::new, warnings),
                shape,
                doubts: Vec::new(),
            }
        })
        .collect()
}

/// All residues of a fit.
pub(crate) fn places(problem: &Problem) -> Vec<Place> {
    let of_run = |(run, data): (usize, &crate::run::Run)| {
        let outputs = data.outputs();
        let references = data.inputs();
        (0..outputs).flat_map(move |output| (0..references).map(move |reference| Place { run, output, reference }))
    };
    problem.runs.iter().enumerate().flat_map(of_run).collect()
}

fn residue(fit: &Fit, place: Place, mode: usize) -> Complex<f64> {
    let found = &fit.runs[place.run];
    found.layout.residue_value(place.reference, mode, &found.outputs[place.output].unknowns)
}

/// Standard deviations of the real and imaginary part, with a systematic error.
fn spread(covariance: Block, floor: f64) -> Complex<f64> {
    let of = |variance: f64| libm::sqrt(variance.max(0.0) + floor * floor);
    Complex::new(of(covariance[0][0]), of(covariance[1][1]))
}

/// The shape of a mode at the driving point with the least uncertain residue.
///
/// The deviation of φₒ = aₒ/√a_d is that of δaₒ/√a_d − ½ aₒ a_d^(−3/2) δa_d; the error of ω is smaller by orders of magnitude.
fn shape(
    problem: &Problem,
    fit: &Fit,
    covariance: &Covariance,
    floor: f64,
    mode: usize,
    places: &[Place],
) -> Option<Shape> {
    let dofs = |place: &Place| problem.runs[place.run].pairs.dofs(place.output, place.reference);
    let uncertainty = |place: &Place| {
        let block = covariance.of(*place, mode);
        (block[0][0] + block[1][1]) / residue(fit, *place, mode).norm_sqr()
    };
    let drive = places
        .iter()
        .filter(|place| dofs(place)[0] == dofs(place)[1])
        .min_by(|a, b| uncertainty(a).total_cmp(&uncertainty(b)))?;
    let driving_point = dofs(drive)[0];
    let turn = Complex::new(0.0, 2.0 * fit.poles[mode].im);
    let driven = turn * residue(fit, *drive, mode);
    let scale = root(driven);
    let mut components: Vec<Component> = Vec::new();
    for place in places.iter().filter(|place| dofs(place)[0] == driving_point) {
        let dof = dofs(place)[1];
        if components.iter().any(|component| component.dof == dof) {
            // Measured again by another run.
            continue;
        }
        let value = if dof == driving_point { scale } else { turn * residue(fit, *place, mode) / scale };
        // δφ_d = turn/(2 φ_d) δR_d.
        let of_drive = turn / (scale * 2.0);
        let (block, common) = if dof == driving_point {
            let block = turned(of_drive, covariance.of(*drive, mode), of_drive);
            (block, block)
        } else {
            let own = turn / scale;
            let other = -value / (driven * 2.0) * turn;
            let with_own = turned(own, covariance.with_drive(*place, *drive, mode), of_drive);
            let with_other = turned(other, covariance.of(*drive, mode), of_drive);
            let joint = turned(own, covariance.with_drive(*place, *drive, mode), other);
            let parts = [
                turned(own, covariance.of(*place, mode), own),
                turned(other, covariance.of(*drive, mode), other),
                joint,
                // The covariance of two different errors counts both ways round, the second time transposed.
                [[joint[0][0], joint[1][0]], [joint[0][1], joint[1][1]]],
            ];
            (sum_of_blocks(&parts), sum_of_blocks(&[with_own, with_other]))
        };
        components.push(Component {
            dof,
            value,
            deviation: spread(block, floor * magnitude(value)),
            with_driving_point: Complex::new(common[0][0], common[1][1]),
        });
    }
    components.sort_by_key(|component| component.dof);
    let values: Vec<Complex<f64>> = components.iter().map(|component| component.value).collect();
    // d|a| = Re(ā da)/|a|.
    let size = magnitude(driven);
    let along = turned(driven.conj() * turn / size, covariance.of(*drive, mode), driven.conj() * turn / size)[0][0];
    Some(Shape {
        driving_point,
        components,
        modal_mass: 1.0 / size,
        modal_mass_deviation: libm::hypot(libm::sqrt(along.max(0.0)) / size, floor) / size,
        collinearity: collinearity(&values),
        phase_deviation_deg: phase_deviation_deg(&values),
    })
}

fn sum_of_blocks(parts: &[Block]) -> Block {
    parts.iter().fold([[0.0; 2]; 2], |sum, part| {
        [[sum[0][0] + part[0][0], sum[0][1] + part[0][1]], [sum[1][0] + part[1][0], sum[1][1] + part[1][1]]]
    })
}

/// The covariance of a x and b y, for complex factors a, b and the covariance of x and y over real and imaginary parts.
fn turned(a: Complex<f64>, block: Block, b: Complex<f64>) -> Block {
    let matrix = |z: Complex<f64>| [[z.re, -z.im], [z.im, z.re]];
    let left = matrix(a);
    let right = matrix(b);
    let mut found = [[0.0; 2]; 2];
    for (i, row) in found.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            for k in 0..2 {
                for l in 0..2 {
                    *value += left[i][k] * block[k][l] * right[j][l];
                }
            }
        }
    }
    found
}

fn warnings(shape: &Shape) -> Vec<Warning> {
    let mut found = Vec::new();
    if shape.components.len() >= LEAST_POINTS && shape.collinearity < COLLINEAR {
        let Shape { collinearity, phase_deviation_deg, .. } = *shape;
        found.push(Warning::Complex { collinearity, phase_deviation_deg });
    }
    // φ_d = √a_d: twice its phase is that of a_d.
    let driving = shape.components.iter().find(|component| component.dof == shape.driving_point);
    if let Some(component) = driving {
        // Beyond 90° the modal constant is nearer to a negative number than to a positive one, which that of a normal
        // mode is.
        let phase = 2.0 * log(component.value).im;
        if phase.abs() > 0.5 * core::f64::consts::PI {
            found.push(Warning::DrivingPoint { dof: shape.driving_point, phase_deg: phase.to_degrees() });
        }
    }
    found
}
