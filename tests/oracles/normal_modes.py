"""Writes normal_modes.json: nonlinear normal modes of two masses by shooting, independent of harmonic balance.

Two masses of 1 kg between three springs of 1 N/m, with 0.5 N/m³ at the first: G. Kerschen, M. Peeters, J. C. Golinval,
A. F. Vakakis, "Nonlinear normal modes, Part I", Mech. Syst. Signal Process. 23 (2009), Sec. 2. A free vibration that
starts at rest in x has no velocity after half a period, v(T/2; x) = 0. These two equations in x and T are followed by
pseudo-arclength from the first linear mode; each point is integrated by SciPy's DOP853, with its variational equation.
The frequency has its extremes where dT/ds = 0.
"""

import json
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

STIFFNESS = np.array([[2.0, -1.0], [-1.0, 2.0]])


def rates(_t, z):
    x, v, flow = z[:2], z[2:4], z[4:].reshape(4, 2)
    tangent = STIFFNESS + np.diag([1.5 * x[0] ** 2, 0.0])
    acceleration = -STIFFNESS @ x - np.array([0.5 * x[0] ** 3, 0.0])
    return np.concatenate([v, acceleration, flow[2:].ravel(), (-tangent @ flow[:2]).ravel()])


def half(x, period):
    start = np.concatenate([x, [0, 0], np.eye(2).ravel(), np.zeros(4)])
    end = solve_ivp(rates, (0, period / 2), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    by_x = end[4:].reshape(4, 2)[2:]
    by_period = rates(0, end)[2:4] / 2
    return end[2:4], np.column_stack([by_x, by_period])


def solve(guess, tangent):
    z = guess.copy()
    for _ in range(20):
        residual, jacobian = half(z[:2], z[2])
        step = np.linalg.solve(np.vstack([jacobian, tangent]), -np.append(residual, tangent @ (z - guess)))
        z += step
        if np.linalg.norm(step) < 1e-11 * np.linalg.norm(z):
            return z, half(z[:2], z[2])[1]
    return None, None


def energy(x):
    return 0.5 * x @ STIFFNESS @ x + 0.125 * x[0] ** 4


def follow(most_energy):
    tangent = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    z, step = np.array([0.0, 0.0, 2 * np.pi]), 0.05
    points = []
    while not points or energy(points[-1][0][:2]) < most_energy:
        new, jacobian = solve(z + step * tangent, tangent)
        if new is None:
            step /= 2
            continue
        null = np.linalg.svd(jacobian)[2][-1]
        null *= np.sign(null @ tangent)
        if null @ tangent < 0.98:
            step /= 2
            continue
        z, tangent = new, null
        points.append((z, tangent))
        step = min(1.3 * step, 0.02 * np.linalg.norm(z) + 0.05)
    return points


def turns(points):
    found = []
    for (a, ta), (_b, tb) in zip(points, points[1:]):
        if ta[2] * tb[2] < 0:
            low, high, start, tangent = 0.0, np.linalg.norm(_b - a), a, ta
            for _ in range(60):
                middle = (low + high) / 2
                z, jacobian = solve(start + middle * tangent, tangent)
                null = np.linalg.svd(jacobian)[2][-1]
                null *= np.sign(null @ tangent)
                low, high = (middle, high) if null[2] * ta[2] > 0 else (low, middle)
            found.append({"rate_rad_s": 2 * np.pi / z[2], "energy_j": energy(z[:2]), "x_m": list(z[:2])})
    return found


if __name__ == "__main__":
    points = follow(1e4)
    print(len(points), "points")
    result = {"turns": turns(points)}
    print(json.dumps(result, indent=1))
    Path("normal_modes.json").write_text(json.dumps(result, indent=1) + "\n")
