"""The linear arm, from the equations of Gierlak & Warmiński (Appl. Sci. 2023, 13, 11941), without a line of the
program.

For α = Re(A e^{iωt}) the arm linearised in its pose is (K − ω²M + iωD) A = Jᵀ F, and a point with the Jacobian J_P has
the acceleration −ω² J_P A. Numbers from Table 1 of the paper, but I_S2 = 1.5 kg·m² (fitted) and l2 = 0.6 m (assumed).
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LinearArm:
    beta1_deg: float
    beta2_deg: float
    d1: float = 0.9
    d2: float = 0.9

    I_A1, I_S2, m2 = 0.55, 1.5, 50.58
    l1, l2, lc2 = 0.63, 0.6, 0.1
    k1, k2 = 555e3, 128e3

    @property
    def mass(self):
        a1 = self.I_A1 + self.I_S2 + self.m2 * (self.l1**2 + self.lc2**2)
        a2 = self.m2 * self.l1 * self.lc2
        a3 = self.I_S2 + self.m2 * self.lc2**2
        c = math.cos(math.radians(self.beta2_deg))
        return np.array([[a1 + 2 * a2 * c, a3 + a2 * c], [a3 + a2 * c, a3]])

    @property
    def stiffness(self):
        return np.diag([self.k1, self.k2])

    def jacobians(self):
        """Of B and of C."""
        first, both = math.radians(self.beta1_deg), math.radians(self.beta1_deg + self.beta2_deg)
        b = self.l1 * np.array([[-math.sin(first), 0], [math.cos(first), 0]])
        link2 = self.l2 * np.array([[-math.sin(both)] * 2, [math.cos(both)] * 2])
        return b, b + link2

    def natural_frequencies_hz(self):
        return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(self.mass, self.stiffness)).real)) / (2 * math.pi)

    def accelerations(self, frequency_hz, force_n):
        """Complex accelerations B_x, B_y, C_x, C_y (m/s²) under a force F_x, F_y (N) at C."""
        omega = 2 * math.pi * frequency_hz
        dynamic_stiffness = self.stiffness - omega**2 * self.mass + 1j * omega * np.diag([self.d1, self.d2])
        of_b, of_c = self.jacobians()
        angles = np.linalg.solve(dynamic_stiffness, of_c.T @ np.asarray(force_n))
        return -(omega**2) * np.concatenate([of_b @ angles, of_c @ angles])


def amplitudes(samples, rate_hz, frequency_hz, ringing_hz=()):
    """Amplitude of a sine in each column of `samples` by least squares, beside an offset and sines of the
    `ringing_hz`."""
    t = np.arange(len(samples)) / rate_hz
    columns = [np.ones_like(t)]
    for hz in (frequency_hz, *ringing_hz):
        columns += [np.cos(2 * math.pi * hz * t), np.sin(2 * math.pi * hz * t)]
    fit, *_ = np.linalg.lstsq(np.stack(columns, axis=1), samples, rcond=None)
    return np.hypot(fit[1], fit[2])
