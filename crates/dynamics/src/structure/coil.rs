//! The current in the coil of a shaker in voltage mode over one integration step.
//!
//! Over a step of length h the tip's velocity along the shaker is taken as the polynomial p(x) of degree 4 in x = t/h,
//! 0 ≤ x ≤ 1, with the same values and slopes at both ends and the same integral, which are known from the states
//! there. With λ = hR/L the circuit is
//!
//! ```text
//! di/dx + λ i = (λ/R) (V − Bl p(x))        i(x) = q(x) + (i(0) − q(0)) e^{−λx}
//! q = Σ qₘ xᵐ        qₘ = (V δₘ₀ − Bl pₘ)/R − (m + 1) qₘ₊₁/λ
//! ```
//!
//! which is exact for that polynomial, for any λ, and for λ → ∞ is Ohm's law.

use super::armature::Coil;

/// Least hR/L: below it the sums for q lose digits to cancellation, by 4!/λ⁴.
pub const LEAST_DECAY: f64 = 0.05;

/// Terms of the polynomial.
const TERMS: usize = 5;

/// The circuit, for one step length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circuit {
    /// Force factor Bl, N/A.
    pub force_factor_n_a: f64,
    /// Resistance R of the coil, Ω.
    pub resistance_ohm: f64,
    /// hR/L: how often the current decays by e over a step; infinite without inductance.
    pub decay: f64,
}

/// The velocity of the armature at both ends of a step, m/s, its slope, m/s, per step, and its mean, m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stroke {
    /// ṡ at start and end.
    pub velocity_m_s: [f64; 2],
    /// h s̈ at start and end.
    pub change_m_s: [f64; 2],
    /// Displacement over the step, by its length.
    pub mean_m_s: f64,
}

impl Stroke {
    /// p with p(0), p(1), p'(0), p'(1) and ∫p given: with A = p(1) − p(0) − p'(0), B = p'(1) − p'(0) and
    /// C = ∫p − p(0) − ½ p'(0), p₄ = 30 C − 15 A + 2.5 B, p₂ = 3 A − B + p₄, p₃ = B − 2 A − 2 p₄.
    fn polynomial(&self) -> [f64; TERMS] {
        let [v0, v1] = self.velocity_m_s;
        let [d0, d1] = self.change_m_s;
        let a = v1 - v0 - d0;
        let b = d1 - d0;
        let c = self.mean_m_s - v0 - 0.5 * d0;
        let p4 = 30.0 * c - 15.0 * a + 2.5 * b;
        [v0, d0, 3.0 * a - b + p4, b - 2.0 * a - 2.0 * p4, p4]
    }
}

/// The current over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Current {
    q: [f64; TERMS],
    transient_a: f64,
    decay: f64,
}

impl Circuit {
    /// The circuit of a coil in voltage mode, for steps of `step_s`, s; `None` if the amplifier holds the current, or
    /// the current changes too slowly for the closed form.
    pub fn new(coil: &Coil, step_s: f64) -> Option<Circuit> {
        let Coil::Voltage { force_factor_n_a, resistance_ohm, inductance_h } = *coil else { return None };
        // Infinite without inductance, for which the sums below are Ohm's law.
        let decay = step_s * resistance_ohm / inductance_h;
        (decay >= LEAST_DECAY).then_some(Circuit { force_factor_n_a, resistance_ohm, decay })
    }

    /// The current over a step that starts with `start_a`, at a voltage and a motion of the armature.
    pub fn current(&self, start_a: f64, voltage_v: f64, stroke: &Stroke) -> Current {
        let p = stroke.polynomial();
        let mut q = [0.0; TERMS];
        let mut above = 0.0;
        // From the highest power down, since qₘ needs qₘ₊₁.
        for (m, (value, velocity)) in q.iter_mut().zip(p).enumerate().rev() {
            let drive_v = if m == 0 { voltage_v } else { 0.0 };
            *value = (drive_v - self.force_factor_n_a * velocity) / self.resistance_ohm - above / self.decay;
            above = m as f64 * *value;
        }
        Current { q, transient_a: start_a - q[0], decay: self.decay }
    }
}

impl Current {
    /// A current that stays zero.
    pub const ZERO: Current = Current { q: [0.0; TERMS], transient_a: 0.0, decay: f64::INFINITY };

    /// The coefficients of q, and i(0) − q(0), the factor of e^{−λx}; 0 without inductance.
    pub fn terms(&self) -> ([f64; TERMS], f64) {
        (self.q, if self.decay == f64::INFINITY { 0.0 } else { self.transient_a })
    }

    /// The current at `x` of the step, from 0 to 1, A.
    pub fn at(&self, x: f64) -> f64 {
        let steady = self.q.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient);
        // Without inductance the current is steady at once.
        let left = if self.decay == f64::INFINITY { 0.0 } else { libm::exp(-self.decay * x) };
        steady + self.transient_a * left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// di/dx + λi = (λ/R)(V − Bl p) along the whole step, by a difference quotient, for the velocity of a quartic.
    #[test]
    fn satisfies_the_circuit_s_equation() {
        let velocity = |x: f64| 0.3 - 0.2 * x + 0.05 * x * x - 0.01 * x * x * x + 0.002 * x * x * x * x;
        let slope = |x: f64| -0.2 + 0.1 * x - 0.03 * x * x + 0.008 * x * x * x;
        let mean_m_s = 0.3 - 0.1 + 0.05 / 3.0 - 0.01 / 4.0 + 0.002 / 5.0;
        let stroke =
            Stroke { velocity_m_s: [velocity(0.0), velocity(1.0)], change_m_s: [slope(0.0), slope(1.0)], mean_m_s };
        for decay in [LEAST_DECAY, 0.5, 2.5, 40.0] {
            let coil = Circuit { force_factor_n_a: 20.0, resistance_ohm: 2.0, decay };
            let current = coil.current(1.5, 7.0, &stroke);
            assert!((current.at(0.0) - 1.5).abs() < 1e-9);
            for x in [0.1, 0.35, 0.5, 0.8] {
                let h = 1e-4;
                let rate = (current.at(x + h) - current.at(x - h)) / (2.0 * h);
                let expected = decay / 2.0 * (7.0 - 20.0 * velocity(x)) - decay * current.at(x);
                assert!((rate - expected).abs() < 1e-5 * (1.0 + decay * decay), "{decay} {x}: {rate} {expected}");
            }
        }
        let resistive = Circuit { force_factor_n_a: 20.0, resistance_ohm: 2.0, decay: f64::INFINITY };
        let current = resistive.current(1.5, 7.0, &stroke);
        assert!((current.at(0.5) - (7.0 - 20.0 * velocity(0.5)) / 2.0).abs() < 1e-12);
    }
}
