//! The model of a spectrum: modes, terms for modes outside the band, and the transient.
//!
//! With s = j2πf, q = e^(−s/fs) and poles λᵣ, the response of output o to the references Uᵢ is
//!
//! ```text
//! Yₒ = Σᵢ Gₒᵢ Uᵢ + Tₒ,   G = sᵖ Σᵣ [Rᵣ/(s − λᵣ) + R̄ᵣ/(s − λ̄ᵣ)] + a sᵖ⁻² + b sᵖ,
//! Tₒ = Σᵣ [τᵣ/(1 − zᵣ q) + τ̄ᵣ/(1 − z̄ᵣ q)] + polynomial of degree 3 in f,   zᵣ = e^(λᵣ/fs)
//! ```
//!
//! with p = 2 for accelerations, 1 for velocities, 0 for displacements. R and τ are complex, a (modes below the band) and b
//! (modes above it) are real, and differ between outputs. T is what is left of the time before the record and what the end
//! of the record cuts off; it is exact for sampled decays, and the polynomial, of Chebyshev's with complex coefficients,
//! stands for the transients of modes outside the band (R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain
//! Approach", 2nd edition 2012, chapter 6).
//!
//! Given the poles, all unknowns enter linearly, with real coefficients: R = x + jy multiplies the columns (α + β, j(α − β))
//! with α = sᵖ U/(s − λ) and β = sᵖ U/(s − λ̄). The derivatives with Re λ and Im λ are linear in the same x and y: with the
//! columns (p, q) = (α' + β', j(α' − β')), α' = sᵖ U/(s − λ)² and β' alike,
//!
//! ```text
//! ∂/∂Re λ = x p + y q,   ∂/∂Im λ = x q − y p
//! ```
//!
//! So one matrix of products of all these columns serves every output, whatever its coefficients.

use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::ops::Range;

use nalgebra::Complex;
use resonarm_numeric::registers::{Task, four_wide};

use crate::columns::{Columns, LANES, Lane, lanes};
use crate::complex::exp;

/// Number of Chebyshev polynomials of a transient, degrees 0 to 3.
const POLYNOMIALS: usize = 4;

/// Terms a and b.
pub(crate) const RESIDUAL_TERMS: usize = 2;

/// What the responses are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// Accelerations; over forces, accelerance.
    #[default]
    Acceleration,
    /// Velocities; over forces, mobility.
    Velocity,
    /// Displacements; over forces, receptance.
    Displacement,
}

/// Residues that a mode may have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResidueKind {
    /// Complex residues, of complex modes, whose points reach their largest displacements at different times.
    #[default]
    Complex,
    /// Imaginary residues, of normal modes: proportional damping, all points in phase or opposite.
    Imaginary,
}

impl ResidueKind {
    /// Number of real unknowns.
    pub(crate) fn unknowns(self) -> usize {
        match self {
            ResidueKind::Complex => 2,
            ResidueKind::Imaginary => 1,
        }
    }
}

/// Places of the unknowns of one output of a run: residues and residual terms of every reference, the transients, and the
/// polynomial; and places of the columns of derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub modes: usize,
    pub references: usize,
    pub residues: ResidueKind,
    pub transient: bool,
}

impl Layout {
    /// Number of unknowns of the gain of one reference.
    pub fn gain(&self) -> usize {
        self.residues.unknowns() * self.modes + RESIDUAL_TERMS
    }

    /// Returns the number of unknowns of the model.
    pub fn unknowns(&self) -> usize {
        let transient = if self.transient { 2 * self.modes + 2 * POLYNOMIALS } else { 0 };
        self.references * self.gain() + transient
    }

    /// Unknowns of a residue.
    pub fn residue(&self, reference: usize, mode: usize) -> Range<usize> {
        let each = self.residues.unknowns();
        let start = reference * self.gain() + each * mode;
        start..start + each
    }

    /// Unknowns of the terms a and b.
    pub fn residual_terms(&self, reference: usize) -> Range<usize> {
        (reference + 1) * self.gain() - RESIDUAL_TERMS..(reference + 1) * self.gain()
    }

    /// Unknowns of the transient of a mode.
    pub fn transient_of(&self, mode: usize) -> Range<usize> {
        let start = self.references * self.gain() + 2 * mode;
        if self.transient { start..start + 2 } else { 0..0 }
    }

    /// All unknowns of a mode.
    pub fn of_mode(&self, mode: usize) -> Vec<usize> {
        let residues = (0..self.references).flat_map(|reference| self.residue(reference, mode));
        residues.chain(self.transient_of(mode)).collect()
    }

    /// Number of columns of derivatives.
    pub fn slopes(&self) -> usize {
        2 * self.modes * (self.references + usize::from(self.transient))
    }

    /// Returns, for each pair of columns (p, q) of derivatives of a mode, the place of p and the coefficients x and y.
    pub fn slopes_of<'a>(&self, mode: usize, unknowns: &'a [f64]) -> impl Iterator<Item = (usize, [f64; 2])> + use<'a> {
        let layout = *self;
        (0..layout.references + usize::from(layout.transient)).map(move |block| {
            let place = 2 * (layout.modes * block + mode);
            let range = if block < layout.references { layout.residue(block, mode) } else { layout.transient_of(mode) };
            (place, real_and_imaginary(&unknowns[range]))
        })
    }

    /// Returns a residue from the unknowns.
    pub fn residue_value(&self, reference: usize, mode: usize, unknowns: &[f64]) -> Complex<f64> {
        let [re, im] = real_and_imaginary(&unknowns[self.residue(reference, mode)]);
        Complex::new(re, im)
    }
}

/// The parts of a residue or of a transient; an imaginary residue has one unknown.
fn real_and_imaginary(unknowns: &[f64]) -> [f64; 2] {
    match unknowns {
        [x, y] => [*x, *y],
        [y] => [0.0, *y],
        _ => [0.0; 2],
    }
}

/// Lines of a run, and all of the model that does not depend on poles.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub frequency_hz: Vec<f64>,
    pub rate_hz: f64,
    /// 2πf; 0 beyond the last line.
    omega: Vec<Lane>,
    /// sᵖ, and q; both 0 beyond the last line.
    factors: Columns,
    /// 1 at lines, 0 beyond.
    mask: Vec<Lane>,
    /// sᵖ⁻² and sᵖ, scaled to about 1.
    residual: Columns,
    /// Scales of the residual terms: the terms a and b are the unknowns times these.
    pub residual_scales: [f64; RESIDUAL_TERMS],
    polynomial: Columns,
}

impl Grid {
    pub fn new(frequency_hz: Vec<f64>, rate_hz: f64, quantity: Quantity) -> Grid {
        let lines = frequency_hz.len();
        let omega: Vec<f64> = frequency_hz.iter().map(|f| TAU * f).collect();
        let order = match quantity {
            Quantity::Acceleration => 2,
            Quantity::Velocity => 1,
            Quantity::Displacement => 0,
        };
        // (jω)ⁿ, n from −2 to 2.
        let power = |omega: f64, exponent: i32| match exponent {
            2 => Complex::new(-omega * omega, 0.0),
            1 => Complex::new(0.0, omega),
            -1 => Complex::new(0.0, -1.0 / omega),
            -2 => Complex::new(-1.0 / (omega * omega), 0.0),
            _ => Complex::new(1.0, 0.0),
        };
        let values = |f: &dyn Fn(f64) -> Complex<f64>| omega.iter().map(|omega| f(*omega)).collect::<Vec<_>>();
        let delay = |omega: f64| {
            let (sine, cosine) = libm::sincos(-omega / rate_hz);
            Complex::new(cosine, sine)
        };
        let factors = [values(&|omega| power(omega, order)), values(&delay)];
        let [first, last] = [0, lines - 1].map(|line| omega[line]);
        let centre = libm::sqrt(first * last);
        let residual_scales = [libm::pow(centre, f64::from(2 - order)), libm::pow(centre, f64::from(-order))];
        let residual = [0, 1].map(|term| {
            let exponent = order - 2 + 2 * term;
            values(&|omega| power(omega, exponent) * residual_scales[term as usize])
        });
        // Chebyshev polynomials over the band, by their recursion.
        let mut polynomial = Columns::zeros(lines, 2 * POLYNOMIALS);
        let place = |omega: f64| if last > first { (2.0 * omega - first - last) / (last - first) } else { 0.0 };
        let (mut before, mut now) = (values(&|omega| place(omega).into()), values(&|_| 1.0.into()));
        for degree in 0..POLYNOMIALS {
            polynomial.set(2 * degree, &now);
            polynomial
                .set(2 * degree + 1, &now.iter().map(|value| Complex::new(-value.im, value.re)).collect::<Vec<_>>());
            let next = (0..lines).map(|k| now[k] * (2.0 * place(omega[k])) - before[k]).collect();
            before = core::mem::replace(&mut now, next);
        }
        Grid {
            rate_hz,
            omega: lanes(lines, |k| omega[k]),
            factors: Columns::of_values(lines, factors.iter().map(Vec::as_slice)),
            mask: lanes(lines, |_| 1.0),
            residual: Columns::of_values(lines, residual.iter().map(Vec::as_slice)),
            residual_scales,
            polynomial,
            frequency_hz,
        }
    }

    pub fn lines(&self) -> usize {
        self.frequency_hz.len()
    }

    /// Returns the columns of the gain of a unit reference: those of the residues and of a and b, and those of derivatives.
    pub fn gain_columns(&self, poles: &[Complex<f64>], residues: ResidueKind) -> [Columns; 2] {
        let each = residues.unknowns();
        let mut gain = Columns::zeros(self.lines(), each * poles.len() + RESIDUAL_TERMS);
        let mut slopes = Columns::zeros(self.lines(), 2 * poles.len());
        for (mode, pole) in poles.iter().enumerate() {
            let mut pair = Columns::zeros(self.lines(), 4);
            let [re, im] = self.factors.parts(0);
            four_wide(Resonance { omega: &self.omega, factor: [re, im], pole: *pole, pair: &mut pair });
            for k in 0..each {
                gain.column_mut(each * mode + k).copy_from_slice(pair.column(2 - each + k));
            }
            (0..2).for_each(|k| slopes.column_mut(2 * mode + k).copy_from_slice(pair.column(2 + k)));
        }
        for term in 0..RESIDUAL_TERMS {
            gain.column_mut(each * poles.len() + term).copy_from_slice(self.residual.column(term));
        }
        [gain, slopes]
    }

    /// Returns all columns of a run with these references: first those of [`Layout::unknowns`], then those of derivatives.
    pub fn columns(
        &self,
        poles: &[Complex<f64>],
        references: &Columns,
        layout: &Layout,
        gain: &[Columns; 2],
    ) -> Columns {
        let mut all = Columns::zeros(self.lines(), layout.unknowns() + layout.slopes());
        for reference in 0..layout.references {
            for (columns, start) in
                [(&gain[0], reference * layout.gain()), (&gain[1], layout.unknowns() + 2 * layout.modes * reference)]
            {
                for k in 0..columns.count() {
                    let product =
                        Product { a: references.parts(reference), b: columns.parts(k), to: all.parts_mut(start + k) };
                    four_wide(product);
                }
            }
        }
        if layout.transient {
            for (mode, pole) in poles.iter().enumerate() {
                let mut pair = Columns::zeros(self.lines(), 4);
                let turn = exp(pole / self.rate_hz);
                let decay = Decay {
                    delay: self.factors.parts(1),
                    mask: &self.mask,
                    turn,
                    rate_hz: self.rate_hz,
                    pair: &mut pair,
                };
                four_wide(decay);
                let slopes = layout.unknowns() + 2 * (layout.modes * layout.references + mode);
                for k in 0..2 {
                    all.column_mut(layout.transient_of(mode).start + k).copy_from_slice(pair.column(k));
                    all.column_mut(slopes + k).copy_from_slice(pair.column(2 + k));
                }
            }
            let start = layout.unknowns() - 2 * POLYNOMIALS;
            for k in 0..2 * POLYNOMIALS {
                all.column_mut(start + k).copy_from_slice(self.polynomial.column(k));
            }
        }
        all
    }
}

/// The columns α + β, j(α − β) and their derivatives p, q of a pole, as a task.
struct Resonance<'a> {
    omega: &'a [Lane],
    factor: [&'a [Lane]; 2],
    pole: Complex<f64>,
    pair: &'a mut Columns,
}

impl Task for Resonance<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Complex { re: sigma, im: centre } = self.pole;
        for (n, omega) in self.omega.iter().enumerate() {
            let mut out = [[0.0; LANES]; 8];
            for lane in 0..LANES {
                // 1/(s − λ) and 1/(s − λ̄).
                let x = omega[lane] - centre;
                let y = omega[lane] + centre;
                let u = 1.0 / (sigma * sigma + x * x);
                let v = 1.0 / (sigma * sigma + y * y);
                let a = [-sigma * u, -x * u];
                let b = [-sigma * v, -y * v];
                let factor = [self.factor[0][n][lane], self.factor[1][n][lane]];
                let columns = pairs(a, b);
                let slopes = pairs(square(a), square(b));
                for (k, value) in [columns[0], columns[1], slopes[0], slopes[1]].into_iter().enumerate() {
                    let value = times(factor, value);
                    out[2 * k][lane] = value[0];
                    out[2 * k + 1][lane] = value[1];
                }
            }
            for k in 0..4 {
                let [re, im] = self.pair.parts_mut(k);
                re[n] = out[2 * k];
                im[n] = out[2 * k + 1];
            }
        }
    }
}

/// The columns t + t', j(t − t') with t = 1/(1 − zq), t' = 1/(1 − z̄q), and their derivatives from dt/dλ = t² zq/fs, as a
/// task.
struct Decay<'a> {
    delay: [&'a [Lane]; 2],
    mask: &'a [Lane],
    turn: Complex<f64>,
    rate_hz: f64,
    pair: &'a mut Columns,
}

impl Task for Decay<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let by_rate = 1.0 / self.rate_hz;
        for n in 0..self.mask.len() {
            let mut out = [[0.0; LANES]; 8];
            (0..LANES).for_each(|lane| {
                let q = [self.delay[0][n][lane], self.delay[1][n][lane]];
                let mask = self.mask[n][lane];
                let zq = [self.turn.im, -self.turn.im].map(|im| times([self.turn.re, im], q));
                let t = zq.map(|zq| inverse([1.0 - zq[0], -zq[1]])).map(|t| [t[0] * mask, t[1] * mask]);
                let columns = pairs(t[0], t[1]);
                let slope = |k: usize| times(times(square(t[k]), zq[k]), [by_rate, 0.0]);
                let slopes = pairs(slope(0), slope(1));
                for (k, value) in [columns[0], columns[1], slopes[0], slopes[1]].into_iter().enumerate() {
                    out[2 * k][lane] = value[0];
                    out[2 * k + 1][lane] = value[1];
                }
            });
            for k in 0..4 {
                let [re, im] = self.pair.parts_mut(k);
                re[n] = out[2 * k];
                im[n] = out[2 * k + 1];
            }
        }
    }
}

/// The product of two columns, line by line, as a task.
struct Product<'a> {
    a: [&'a [Lane]; 2],
    b: [&'a [Lane]; 2],
    to: [&'a mut [Lane]; 2],
}

impl Task for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [re, im] = self.to;
        for n in 0..re.len() {
            for lane in 0..LANES {
                let a = [self.a[0][n][lane], self.a[1][n][lane]];
                let b = [self.b[0][n][lane], self.b[1][n][lane]];
                let product = times(a, b);
                re[n][lane] = product[0];
                im[n][lane] = product[1];
            }
        }
    }
}

/// The sum a + b, and j(a − b), of complex numbers (re, im).
#[inline(always)]
fn pairs(a: [f64; 2], b: [f64; 2]) -> [[f64; 2]; 2] {
    [[a[0] + b[0], a[1] + b[1]], [b[1] - a[1], a[0] - b[0]]]
}

#[inline(always)]
fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

#[inline(always)]
fn square(a: [f64; 2]) -> [f64; 2] {
    times(a, a)
}

#[inline(always)]
fn inverse(a: [f64; 2]) -> [f64; 2] {
    let scale = 1.0 / (a[0] * a[0] + a[1] * a[1]);
    [a[0] * scale, -a[1] * scale]
}
