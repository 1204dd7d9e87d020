"""A planar chain of links with compliant joints, from its Lagrangian, without a line of the program.

In absolute angles θ = T(β + α), T lower triangular of ones, with c_ii = I_i + m_i lc_i² + l_i² Σ_{k>i} m_k and
c_ij = l_i (m_j lc_j + l_j Σ_{k>j} m_k) for j > i, the motion is

    Tᵀ ([c_ij cos(θ_i − θ_j)] θ̈ + [c_ij sin(θ_i − θ_j)] θ̇² + w cos θ) + D α̇ + K α = Q

with the weights w_i = g (m_i lc_i + l_i Σ_{k>i} m_k). α counts from the relaxed springs.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class PlanarChain:
    links: list
    gravity_m_s2: float = 0.0

    def of(self, key):
        return np.array([link[key] for link in self.links])

    @cached_property
    def turns(self):
        return np.tril(np.ones((len(self.links), len(self.links))))

    @cached_property
    def stiffness(self):
        return np.diag(self.of("stiffness_nm_rad"))

    @cached_property
    def damping(self):
        return np.diag(self.of("damping_nm_s_rad"))

    def theta(self, alpha):
        return self.turns @ (np.radians(self.of("angle_deg")) + alpha)

    def beyond(self):
        """Σ_{k>i} m_k."""
        mass = self.of("mass_kg")
        return mass[::-1].cumsum()[::-1] - mass

    @cached_property
    def inertias(self):
        length, mass, centre = self.of("length_m"), self.of("mass_kg"), self.of("centre_of_mass_m")
        moments = mass * centre + length * self.beyond()
        c = np.triu(np.outer(length, moments), 1)
        own = self.of("inertia_kg_m2") + mass * centre**2 + length**2 * self.beyond()
        return c + c.T + np.diag(own)

    @cached_property
    def weights(self):
        own, beyond = self.of("mass_kg") * self.of("centre_of_mass_m"), self.of("length_m") * self.beyond()
        return self.gravity_m_s2 * (own + beyond)

    def mass(self, alpha):
        theta = self.theta(alpha)
        return self.turns.T @ (self.inertias * np.cos(np.subtract.outer(theta, theta))) @ self.turns

    def rest(self):
        """α under the weight, by Newton's method."""
        alpha = np.zeros(len(self.links))
        for _ in range(50):
            theta = self.theta(alpha)
            unbalance = self.turns.T @ (self.weights * np.cos(theta)) + self.stiffness @ alpha
            alpha = alpha - np.linalg.solve(self.slope(alpha), unbalance)
        return alpha

    def slope(self, alpha):
        """The stiffness about α, with that of the weight."""
        weight = np.diag(self.weights * np.sin(self.theta(alpha)))
        return self.stiffness - self.turns.T @ weight @ self.turns

    def tip(self, alpha):
        """∂(x, y)/∂α of the tip."""
        theta, length = self.theta(alpha), self.of("length_m")
        return np.array([-length * np.sin(theta), length * np.cos(theta)]) @ self.turns

    def acceleration(self, alpha, rate, force_n=(0.0, 0.0)):
        theta, turning = self.theta(alpha), self.turns @ rate
        swing = (self.inertias * np.sin(np.subtract.outer(theta, theta))) @ turning**2
        load = self.tip(alpha).T @ np.asarray(force_n) - self.damping @ rate - self.stiffness @ alpha
        load = load - self.turns.T @ (swing + self.weights * np.cos(theta))
        return np.linalg.solve(self.mass(alpha), load)


def runge_kutta(rate, state, step_s, steps):
    """The states of ẋ = rate(t, x) by the classical method of order 4 (W. Kutta, 1901)."""
    states, t_s = [state], 0.0
    for k in range(steps):
        t_s, x = k * step_s, states[-1]
        k1 = rate(t_s, x)
        k2 = rate(t_s + step_s / 2, x + step_s / 2 * k1)
        k3 = rate(t_s + step_s / 2, x + step_s / 2 * k2)
        k4 = rate(t_s + step_s, x + step_s * k3)
        states.append(x + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.array(states)
