//! Gauss–Legendre collocation with four stages, for the flow of variations over a period: order 8, without numerical
//! damping, with a relative frequency error of −(ωh)⁸/25 401 600.

/// Number of stages of the Gauss–Legendre method.
pub(crate) const S: usize = 4;

/// Butcher's tableau of the collocation method: a, a², b, bᵀa and c.
#[derive(Clone, Debug)]
pub(crate) struct Tableau {
    pub a: [[f64; S]; S],
    pub a_squared: [[f64; S]; S],
    pub b: [f64; S],
    pub b_bar: [f64; S],
    pub c: [f64; S],
}

impl Tableau {
    /// The nodes are the zeros of the Legendre polynomial P₄ on (0, 1), and aᵢⱼ = ∫₀^cᵢ ℓⱼ with the Lagrange
    /// polynomials ℓⱼ (J. C. Butcher, "Implicit Runge–Kutta Processes", Math. Comp. 18 (1964)).
    pub fn new() -> Tableau {
        let inner = libm::sqrt(3.0 / 7.0 - 2.0 / 7.0 * libm::sqrt(1.2));
        let outer = libm::sqrt(3.0 / 7.0 + 2.0 / 7.0 * libm::sqrt(1.2));
        let c = [-outer, -inner, inner, outer].map(|root| 0.5 + 0.5 * root);
        let integrals = |upper: f64| core::array::from_fn(|j| lagrange_integral(&c, j, upper));
        let a: [[f64; S]; S] = c.map(integrals);
        let b: [f64; S] = integrals(1.0);
        let product = |row: &[f64; S]| core::array::from_fn(|j| (0..S).map(|k| row[k] * a[k][j]).sum());
        Tableau { a, a_squared: a.map(|row| product(&row)), b, b_bar: product(&b), c }
    }
}

/// Returns ∫₀^upper ℓⱼ(x) dx with ℓⱼ(x) = Π (x − cₘ)/(cⱼ − cₘ) multiplied out.
fn lagrange_integral(c: &[f64; S], j: usize, upper: f64) -> f64 {
    let mut polynomial = [1.0, 0.0, 0.0, 0.0];
    for (_, node) in c.iter().enumerate().filter(|(m, _)| *m != j) {
        let scale = 1.0 / (c[j] - node);
        // From the highest power down: each new coefficient needs the old one of the power below.
        for power in (0..S).rev() {
            let lower = if power == 0 { 0.0 } else { polynomial[power - 1] };
            polynomial[power] = scale * (lower - node * polynomial[power]);
        }
    }
    (0..S).rev().fold(0.0, |sum, power| (sum + polynomial[power] / (power + 1) as f64) * upper)
}

/// Returns the steps in a period such that the phase error of the fastest mode over the period, in which it turns by
/// `phase_rad`, stays below about 1e-10, and that the harmonics of the response are resolved. Only a few values occur,
/// so that tables can be kept.
pub(crate) fn steps_for(phase_rad: f64, harmonics: usize) -> usize {
    // phase · (phase/steps)⁸ / 25 401 600 = 1e-10, with a tenth more for the response's own effect on the frequency.
    let needed = 1.1 * phase_rad * libm::pow(phase_rad * 1e10 / 25_401_600.0, 0.125);
    let needed = needed.max(3.0 * harmonics as f64).max(8.0);
    // Rounded up to a quarter of an octave.
    let octave = libm::exp2(libm::ceil(4.0 * libm::log2(needed)) / 4.0);
    libm::ceil(octave) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four stages have order 8: the sum of the weights times any polynomial of degree up to 7 is its integral.
    #[test]
    fn tableau_has_the_order_of_gauss() {
        let t = Tableau::new();
        for power in 0..8 {
            let sum: f64 = (0..S).map(|i| t.b[i] * t.c[i].powi(power)).sum();
            assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-15, "{power}: {sum}");
        }
        for i in 0..S {
            assert!((t.a[i].iter().sum::<f64>() - t.c[i]).abs() < 1e-15);
        }
    }
}
