//! Natural frequencies of the linearised arm in its pose.

use nalgebra::Vector2;

use super::Arm;

impl Arm {
    /// ω1 ≤ ω2: natural angular frequencies without damping, Eq. (30), rad/s.
    ///
    /// det(K − ω² M0) = 0 is A ω⁴ − B ω² + C = 0 with A = det M0, B = M11 K22 + M22 K11 − 2 M12 K12 and C = det K, so
    /// that ω² = 2C / (B ± √(B² − 4AC)); this form loses no digits in ω1. K is the stiffness at rest, which is diagonal
    /// without gravity. The root is real, since B² − 4AC = (M11 K22 − M22 K11)² + 4 (M12 K11 − M11 K12) (M12 K22 − M22
    /// K12), and M is positive definite.
    pub fn angular_frequencies_rad_s(&self) -> [f64; 2] {
        let rest = Vector2::zeros();
        let (m, k) = (self.mass_matrix(&rest), self.tangent_stiffness_matrix(&rest));
        let b = m.m11 * k.m22 + m.m22 * k.m11 - 2.0 * (m.m12 * k.m12);
        let difference = m.m11 * k.m22 - m.m22 * k.m11;
        let product = (m.m12 * k.m11 - m.m11 * k.m12) * (m.m12 * k.m22 - m.m22 * k.m12);
        let larger = 0.5 * (b + libm::sqrt(difference * difference + 4.0 * product));
        let determinant = k.m11 * k.m22 - k.m12 * k.m12;
        [libm::sqrt(determinant / larger), libm::sqrt(larger / (m.m11 * m.m22 - m.m12 * m.m12))]
    }

    /// A bound of the natural angular frequencies at the deflection `alpha_rad`, rad/s: ω1² + ω2² = tr(M⁻¹K), so ω2 is
    /// less than its root, and near it where ω2 is well above ω1. K is that of the springs alone: the weight adds
    /// thousandths to springs that hold an arm still.
    pub fn angular_frequency_bound_rad_s(&self, alpha_rad: &Vector2<f64>) -> f64 {
        let m = self.mass_matrix(alpha_rad);
        let determinant = m.m11 * m.m22 - m.m12 * m.m12;
        let (k1, k2) = (self.parameters.stiffness1_nm_rad, self.parameters.stiffness2_nm_rad);
        let joints = m.m11 * k2 + m.m22 * k1;
        if self.attachment().is_none() {
            return libm::sqrt(joints / determinant);
        }
        let k = self.attached_stiffness(alpha_rad);
        libm::sqrt((joints + m.m11 * k.m22 + m.m22 * k.m11 - 2.0 * (m.m12 * k.m12)) / determinant)
    }
}
