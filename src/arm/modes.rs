//! Natural frequencies of the linearised arm in its pose.

use nalgebra::Vector2;

use super::Arm;

impl Arm {
    /// ω1 ≤ ω2: natural angular frequencies without damping, Eq. (30), rad/s.
    ///
    /// det(K − ω² M0) = 0 is A ω⁴ − B ω² + k1 k2 = 0 with A = det M0 and B = M11 k2 + M22 k1, so that
    /// ω² = 2 k1 k2 / (B ± √(B² − 4 A k1 k2)); this form loses no digits in ω1. The root is real, since
    /// B² − 4 A k1 k2 = (M11 k2 − M22 k1)² + 4 M12² k1 k2.
    pub fn angular_frequencies_rad_s(&self) -> [f64; 2] {
        let m = self.mass_matrix(&Vector2::zeros());
        let (k1, k2) = (self.parameters.stiffness1_nm_rad, self.parameters.stiffness2_nm_rad);
        let b = m.m11 * k2 + m.m22 * k1;
        let difference = m.m11 * k2 - m.m22 * k1;
        let root = libm::sqrt(difference * difference + 4.0 * m.m12 * m.m12 * k1 * k2);
        let determinant = m.m11 * m.m22 - m.m12 * m.m12;
        let larger = 0.5 * (b + root);
        [libm::sqrt(k1 * k2 / larger), libm::sqrt(larger / determinant)]
    }

    /// A bound of the natural angular frequencies at the deflection `alpha_rad`, rad/s: ω1² + ω2² = tr(M⁻¹K), so ω2 is
    /// less than its root, and near it where ω2 is well above ω1.
    pub fn angular_frequency_bound_rad_s(&self, alpha_rad: &Vector2<f64>) -> f64 {
        let m = self.mass_matrix(alpha_rad);
        let (k1, k2) = (self.parameters.stiffness1_nm_rad, self.parameters.stiffness2_nm_rad);
        libm::sqrt((m.m11 * k2 + m.m22 * k1) / (m.m11 * m.m22 - m.m12 * m.m12))
    }
}
