//! Bilinear forms of the matrices of a balance, and how they change with the motion.

use alloc::vec::Vec;

use nalgebra::Matrix2;

use super::{Coordinate, HarmonicBalance, Linearisation, Oscillator};
use crate::dense::norm;
use crate::fourier::{Basis, Harmonics, Motion, mean, uniform};

/// Two series of the same frequencies, on the left and on the right of a matrix.
#[derive(Clone, Debug)]
pub(crate) struct Forms {
    /// Their frequencies.
    pub harmonics: Harmonics,
    /// On the left.
    pub w: Vec<f64>,
    /// On the right.
    pub v: Vec<f64>,
}

/// Computes derivatives of forms, with the storage for it.
#[derive(Clone, Debug)]
pub(crate) struct FormGradient {
    basis: Basis,
    weights: Vec<f64>,
    w: Motion,
    v: Motion,
    /// The factors of position, velocity and acceleration in the mean, each by degree of freedom.
    rows: [Vec<f64>; 6],
    /// The derivatives by X.
    pub by_x: Vec<f64>,
}

impl Default for FormGradient {
    fn default() -> FormGradient {
        FormGradient {
            basis: Basis::uniform(Harmonics::Integer(0), 0),
            weights: Vec::new(),
            w: Motion::default(),
            v: Motion::default(),
            rows: Default::default(),
            by_x: Vec::new(),
        }
    }
}

impl FormGradient {
    /// For fixed series w and v of the same frequencies as `forms`, the derivatives of wᵀA v, A being the matrix of
    /// [`HarmonicBalance::jacobian`], by X (into `self.by_x`) and by the coordinates (returned in their order).
    ///
    /// wᵀA v is the mean over the period of W(t)·(S v + G v̇ + M v̈), W being w with the factors of the rows, and (S,
    /// G, M) change with the motion as the second derivative of r, which is symmetric. So its gradient is the mean of
    /// W·(∂S φ + ∂G φ̇ + ∂M φ̈) for each φ of X, where ∂ is the derivative along v: a central difference of the
    /// analytic S, G, M with a step of 1e-5 rad, exact to ten digits.
    pub fn compute<O: Oscillator, const C: usize>(
        &mut self,
        balance: &mut HarmonicBalance<O>,
        x: &[f64],
        forms: &Forms,
        coordinates: [Coordinate<O::Parameter>; C],
    ) -> [f64; C] {
        self.synthesise(balance, forms);
        balance.basis.synthesise(x, balance.base_rad_s(), &mut balance.motion);
        let size = forms.v.iter().fold(f64::MIN_POSITIVE, |size: f64, value| size.max(value.abs()));
        let step = 1e-5 / size;
        let mut by_coordinates = [0.0; C];
        for j in 0..balance.basis.samples() {
            let weight = self.w.at(0, j);
            let [above, below] = [step, -step].map(|h| {
                let mut at = balance.instant(j);
                at.position += self.v.at(0, j) * h;
                at.velocity += self.v.at(1, j) * h;
                at.acceleration += self.v.at(2, j) * h;
                (balance.oscillator.linearise(&at), at)
            });
            let difference =
                |f: fn(&Linearisation) -> &Matrix2<f64>| (f(&above.0) - f(&below.0)).tr_mul(&weight) / (2.0 * step);
            let parts =
                [difference(|l| &l.by_position), difference(|l| &l.by_velocity), difference(|l| &l.by_acceleration)];
            for (row, value) in self.rows.iter_mut().zip(parts.iter().flat_map(|part| part.iter())) {
                row.push(*value);
            }
            for (sum, which) in by_coordinates.iter_mut().zip(coordinates) {
                let [above, below] = [&above, &below].map(|(linear, at)| balance.by_coordinate_at(which, at, linear));
                *sum += weight.dot(&(above - below)) / (2.0 * step) / balance.basis.samples() as f64;
            }
        }
        self.gather(balance);
        by_coordinates
    }

    /// W and v at the samples, and empty rows.
    fn synthesise<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>, forms: &Forms) {
        let samples = balance.basis.samples();
        if self.basis.harmonics() != forms.harmonics || self.basis.samples() != samples {
            self.basis.set(forms.harmonics, uniform(samples));
        }
        self.weigh(balance, forms);
        self.basis.synthesise(&self.weights, 1.0, &mut self.w);
        self.basis.synthesise(&forms.v, balance.base_rad_s(), &mut self.v);
        self.rows.iter_mut().for_each(Vec::clear);
    }

    /// w with the factors that its rows carry: the row's scale, and 2 for what is projected on cosines and sines.
    fn weigh<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>, forms: &Forms) {
        let constants = forms.harmonics.constants();
        let factor = |row: usize| {
            if row < constants {
                balance.row_scale(0.0)
            } else {
                2.0 * balance.row_scale(forms.harmonics.order((row - constants) / 2))
            }
        };
        self.weights.clear();
        self.weights.extend(forms.w.iter().enumerate().map(|(at, value)| value * factor(at / 2)));
    }

    /// The mean of s·φ + g·φ̇ + m·φ̈ for each function φ of X; the rows are s, g, m, each by degree of freedom.
    fn gather<O: Oscillator>(&mut self, balance: &HarmonicBalance<O>) {
        self.by_x.clear();
        self.by_x.resize(balance.dimension(), 0.0);
        for dof in 0..2 {
            let [s, g, m] = [&self.rows[dof], &self.rows[2 + dof], &self.rows[4 + dof]];
            self.by_x[dof] = mean(s);
            for k in 1..=balance.harmonics {
                let rate = k as f64 * balance.base_rad_s();
                let [s, g, m] = [s, g, m].map(|signal| balance.basis.project(k - 1, signal));
                self.by_x[4 * k - 2 + dof] = 0.5 * (s.0 - rate * g.1 - rate * rate * m.0);
                self.by_x[4 * k + dof] = 0.5 * (s.1 + rate * g.0 - rate * rate * m.1);
            }
        }
    }
}

impl<O: Oscillator> HarmonicBalance<O> {
    /// [`HarmonicBalance::truncation_error_rad`] for a variation in place of the motion: for the null vector of a
    /// matrix of [`HarmonicBalance::jacobian`], relative to its size, how far S v + G v̇ + M v̈ is from zero in the
    /// frequencies beyond those of v.
    pub(crate) fn variation_error(&self, forms: &Forms) -> f64 {
        let count = forms.harmonics.count();
        let wide = match forms.harmonics {
            Harmonics::Integer(_) => Harmonics::Integer(2 * count),
            Harmonics::HalfOdd(_) => Harmonics::HalfOdd(2 * count),
        };
        let basis = Basis::uniform(wide, self.basis.samples());
        let mut motion = Motion::default();
        basis.synthesise(&forms.v, self.base_rad_s(), &mut motion);
        let mut signal = [Vec::new(), Vec::new()];
        for (j, linear) in self.linear.iter().enumerate() {
            let value = linear.by_position * motion.at(0, j)
                + linear.by_velocity * motion.at(1, j)
                + linear.by_acceleration * motion.at(2, j);
            signal[0].push(value.x);
            signal[1].push(value.y);
        }
        self.missing(&basis, count..2 * count, &signal) / norm(&forms.v)
    }
}
