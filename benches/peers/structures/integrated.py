"""The largest displacements of contact.toml and friction.toml at a frequency, by integration in time: the judge where
harmonic balances differ. `python integrated.py contact 1.3587` climbs to it from below and settles there."""

import math
import sys

import numpy as np
from scipy.integrate import solve_ivp

# Relative error of a step.
ACCURACY = 1e-10
SAMPLES = 4000


def contact(t, state, omega):
    """One mass on 40 N/m under 100 N, with a stop of 1000 N/m from 10 m on."""
    x, v = state
    return [v, 100.0 * math.cos(omega * t) - 0.1 * math.sqrt(40.0) * v - 40.0 * x - 1000.0 * max(x - 10.0, 0.0)]


def friction(t, state, omega):
    """Two masses under 1 N; the small one slips where its spring of 200 N/m carries 5 N."""
    x, y, v, w, z = state
    sticks = abs(z) < 0.025 or z * w < 0.0
    of_x = math.cos(omega * t) - 0.05 * (2.0 * v - w) - 680.0 * x + 40.0 * y
    of_y = -0.05 * (w - v) + 40.0 * (x - y) - 200.0 * z
    return [v, w, of_x, of_y / 0.02, w if sticks else 0.0]


# The system, the size of its state, the first frequency, Hz, the steps from it, and the periods to settle.
CASES = {"contact": (contact, 2, 1.1, 30, 60), "friction": (friction, 5, 4.0, 1, 200)}


def largest(name, hz):
    """The largest displacement of the driven mass in the settled response."""
    system, size, first_hz, steps, settle = CASES[name]
    state = np.zeros(size)
    for step_hz in np.linspace(first_hz, hz, steps + 1):
        omega = 2.0 * math.pi * step_hz
        period_s = 1.0 / step_hz
        # Where a slope jumps the step control finds it: no step is longer than a fraction of the period.
        options = {"method": "DOP853", "rtol": ACCURACY, "atol": ACCURACY * 1e-3, "max_step": period_s / 50}
        end_s = settle * period_s
        state = solve_ivp(system, (0.0, end_s), state, args=(omega,), **options).y[:, -1]
    times = np.linspace(0.0, period_s, SAMPLES)
    motion = solve_ivp(system, (0.0, period_s), state, args=(omega,), t_eval=times, **options)
    return float(np.abs(motion.y[0]).max())


if __name__ == "__main__":
    print(largest(sys.argv[1], float(sys.argv[2])))
