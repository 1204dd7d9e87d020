//! Functions of complex numbers from `libm`, which give the same bits on every machine.

use nalgebra::Complex;

/// Returns e^z by pure Rust, so that bits do not depend on the machine.
pub(crate) fn exp(z: Complex<f64>) -> Complex<f64> {
    let (sine, cosine) = libm::sincos(z.im);
    Complex::new(cosine, sine) * libm::exp(z.re)
}

/// Returns the principal logarithm.
pub(crate) fn log(z: Complex<f64>) -> Complex<f64> {
    Complex::new(libm::log(magnitude(z)), libm::atan2(z.im, z.re))
}

/// Returns the magnitude |z| without overflow.
pub(crate) fn magnitude(z: Complex<f64>) -> f64 {
    libm::hypot(z.re, z.im)
}

/// Returns the square root whose real part is not negative.
pub(crate) fn root(z: Complex<f64>) -> Complex<f64> {
    let size = magnitude(z);
    // |z| and |Re z| are added, never subtracted. The part that would need their difference follows from 2 · Re · Im =
    // Im z.
    let re = libm::sqrt(0.5 * (size + z.re.abs()));
    if re == 0.0 {
        return Complex::new(0.0, 0.0);
    }
    let im = 0.5 * z.im / re;
    if z.re >= 0.0 { Complex::new(re, im) } else { Complex::new(im.abs(), libm::copysign(re, z.im)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_and_logarithms_are_inverses() {
        for (re, im) in [(2.0, 1.0), (2.0, -1.0), (-2.0, 1e-9), (-3.0, -0.1), (0.0, 4.0), (0.0, 0.0)] {
            let z = Complex::new(re, im);
            let half = root(z);
            assert!((half * half - z).norm_sqr() < 1e-28 && half.re >= 0.0, "{z} {half}");
            if z.norm_sqr() > 0.0 {
                assert!((exp(log(z)) - z).norm_sqr() < 1e-28, "{z}");
            }
        }
    }
}
