//! Frequency responses from averaged spectra.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{Complex, DMatrix};

use super::CrossSpectra;
use super::error::SpectraError;

/// Least part of the power of an input that no other input explains; below it the inputs are taken as dependent.
const LEAST_OWN_PART: f64 = 1e-9;

const NAN: Complex<f64> = Complex::new(f64::NAN, f64::NAN);

/// Estimator of frequency responses. The name says whose noise averages out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Estimator {
    /// H = Sxx⁻¹ Sxy: noise of the outputs averages out; noise of the inputs makes it too small.
    #[default]
    H1,
    /// H = Syy/Syx, for a single input: noise of the input averages out; noise of the output makes it too large.
    H2,
    /// Total least squares: noise of inputs and outputs averages out if the ratio of their powers is right. G. T. Rocklin, J.
    /// Crowley, H. Vold, "A Comparison of H1, H2, and Hv Frequency Response Functions", Proc. 3rd IMAC (1985).
    Hv {
        /// Noise power of an output over that of each input, in (unit of the output/unit of the input)²; positive. Towards
        /// ∞ the estimate is H1, towards 0 it is H2.
        noise_ratio: f64,
    },
}

/// Estimated frequency responses of all outputs to all inputs.
///
/// Values are NaN at lines where an input has no power, or the inputs are linearly dependent.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyResponses {
    /// Estimator that was used.
    pub estimator: Estimator,
    /// Frequencies of the lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// Responses: `[o][i][line]`, in units of output o per unit of input i.
    pub responses: Vec<Vec<Vec<Complex<f64>>>>,
    /// Multiple coherence of each output with all inputs, 0 to 1: `[o][line]`. For a single input it is the ordinary coherence
    /// |Sxy|²/(Sxx Syy). 1 − coherence is the part of the output's power that no linear combination of the inputs explains.
    pub coherence: Vec<Vec<f64>>,
    /// Unexplained power of output o times the inverse spectra of the inputs, Snn [Sxx⁻¹]ᵢᵢ: `[o][i][line]`, from which the
    /// deviations follow.
    scatter: Vec<Vec<Vec<f64>>>,
    /// Effective number of averages, ν/2, less the number of inputs.
    surplus: f64,
}

impl FrequencyResponses {
    /// Returns the standard deviation of the response H1 of output `output` to input `input` at each line, of its complex
    /// value: √(Snn [Sxx⁻¹]ᵢᵢ/(n − q)) with n = ν/2 effective averages and q inputs. It covers noise of the output, not
    /// leakage, which shifts the response itself. `None` if there is no such channel.
    pub fn standard_deviation(&self, output: usize, input: usize) -> Option<Vec<f64>> {
        let scatter = self.scatter.get(output)?.get(input)?;
        Some(scatter.iter().map(|scatter| libm::sqrt(scatter / self.surplus)).collect())
    }
}

impl CrossSpectra {
    /// Returns the coherence |Sxy|²/(Sxx Syy) of an input and an output at each line, 0 to 1; `None` if there is no such
    /// channel. For a single segment it is always 1.
    pub fn coherence(&self, input: usize, output: usize) -> Option<Vec<f64>> {
        let power = self.between_inputs.get(input)?.get(input)?;
        let cross = self.to_outputs[input].get(output)?;
        let lines = cross.iter().zip(power).zip(&self.outputs[output]);
        Some(lines.map(|((cross, x), y)| cross.norm_sqr() / (x.re * y)).collect())
    }

    /// Estimates the frequency responses of all outputs to all inputs.
    ///
    /// # Errors
    /// [`SpectraError`] if there is no input or no output, if there are not more effective averages than inputs, and for H2
    /// with several inputs. A single segment of a single input is allowed: an impact that is recorded as a whole. It has no
    /// coherence, and its deviations are not finite.
    pub fn responses(&self, estimator: Estimator) -> Result<FrequencyResponses, SpectraError> {
        let inputs = self.between_inputs.len();
        let outputs = self.outputs.len();
        if inputs == 0 || outputs == 0 {
            return Err(SpectraError::NoResponse { inputs, outputs });
        }
        if self.averages < inputs {
            return Err(SpectraError::TooFewAverages { averages: self.averages, inputs });
        }
        match estimator {
            Estimator::H2 if inputs > 1 => return Err(SpectraError::SeveralInputs { inputs }),
            Estimator::Hv { noise_ratio } if !(noise_ratio > 0.0 && noise_ratio.is_finite()) => {
                return Err(SpectraError::NoiseRatio { ratio: noise_ratio });
            }
            _ => {}
        }
        let lines = self.frequency_hz.len();
        let mut found = FrequencyResponses {
            estimator,
            frequency_hz: self.frequency_hz.clone(),
            responses: vec![vec![vec![NAN; lines]; inputs]; outputs],
            coherence: vec![vec![f64::NAN; lines]; outputs],
            scatter: vec![vec![vec![f64::NAN; lines]; inputs]; outputs],
            surplus: 0.5 * self.degrees_of_freedom - inputs as f64,
        };
        for line in 0..lines {
            let Some(inverse) = self.inverse_of_inputs(line) else { continue };
            for output in 0..outputs {
                self.response_at(line, output, &inverse, &mut found);
            }
        }
        Ok(found)
    }

    /// Returns the inverse of the spectra between the inputs at a line, by Cholesky's factors of the spectra that are scaled
    /// to powers of 1: the square of a diagonal element of the factor is the part of an input's power that those before it
    /// don't explain.
    fn inverse_of_inputs(&self, line: usize) -> Option<DMatrix<Complex<f64>>> {
        let inputs = self.between_inputs.len();
        let scale: Vec<f64> = (0..inputs).map(|i| 1.0 / libm::sqrt(self.between_inputs[i][i][line].re)).collect();
        if scale.iter().any(|scale| !scale.is_finite()) {
            return None;
        }
        // Inputs may have different units, a force and a torque. Scaled, one threshold for dependence serves all.
        let scaled = DMatrix::from_fn(inputs, inputs, |i, j| self.between_inputs[i][j][line] * (scale[i] * scale[j]));
        let factor = scaled.cholesky()?;
        // Only the diagonal is read: `l_dirty` leaves what was above it.
        if factor.l_dirty().diagonal().iter().any(|own| own.norm_sqr() < LEAST_OWN_PART) {
            return None;
        }
        let inverse = factor.inverse();
        Some(DMatrix::from_fn(inputs, inputs, |i, j| inverse[(i, j)] * (scale[i] * scale[j])))
    }

    /// Computes the responses of one output at one line.
    fn response_at(&self, line: usize, output: usize, inverse: &DMatrix<Complex<f64>>, found: &mut FrequencyResponses) {
        let inputs = inverse.nrows();
        let power = self.outputs[output][line];
        let cross = |i: usize| self.to_outputs[i][output][line];
        // conj(xᵢ) y = Σⱼ conj(xᵢ) xⱼ Hⱼ, averaged.
        let h1: Vec<Complex<f64>> =
            (0..inputs).map(|i| (0..inputs).map(|j| inverse[(i, j)] * cross(j)).sum()).collect();
        let explained: f64 = h1.iter().enumerate().map(|(i, h)| (h * cross(i).conj()).re).sum();
        found.coherence[output][line] = explained / power;
        // Rounding may make the explained part the larger one where the coherence is 1.
        let unexplained = (power - explained).max(0.0);
        for i in 0..inputs {
            found.scatter[output][i][line] = unexplained * inverse[(i, i)].re;
        }
        let response: Vec<Complex<f64>> = match found.estimator {
            Estimator::H1 => h1,
            Estimator::H2 => vec![Complex::new(power, 0.0) / cross(0).conj()],
            Estimator::Hv { noise_ratio } => self.total_least_squares(line, output, noise_ratio),
        };
        response.into_iter().enumerate().for_each(|(i, value)| found.responses[output][i][line] = value);
    }

    /// Returns the responses that explain inputs and output with the least noise in both.
    ///
    /// With z = (x₁ … x_q, y/√κ), whose noise is alike, and M the averages of conj(zₐ) z_b, the vector n = (H₁/√κ … H_q/√κ,
    /// −1) is the eigenvector of the smallest eigenvalue of M.
    fn total_least_squares(&self, line: usize, output: usize, ratio: f64) -> Vec<Complex<f64>> {
        let inputs = self.between_inputs.len();
        let scale = 1.0 / libm::sqrt(ratio);
        let spectra = DMatrix::from_fn(inputs + 1, inputs + 1, |a, b| match (a < inputs, b < inputs) {
            (true, true) => self.between_inputs[a][b][line],
            (true, false) => self.to_outputs[a][output][line] * scale,
            (false, true) => self.to_outputs[b][output][line].conj() * scale,
            (false, false) => Complex::new(self.outputs[output][line] * scale * scale, 0.0),
        });
        let eigen = spectra.symmetric_eigen();
        let least = eigen.eigenvalues.imin();
        let vector = eigen.eigenvectors.column(least);
        (0..inputs).map(|i| -vector[i] / vector[inputs] / scale).collect()
    }
}
