#!/usr/bin/env python3
"""Writes switches.json: two modes with piecewise linear elements under held forces, in closed form between switches.

On every branch of the elements the motion is linear, y' = A y with y = (q, v, z, 1), and its flow exp(A t) y is summed
as a Taylor series in extended precision. Switches are bracketed on a grid of 1/128 of a sample and found by bisection.
The equations are written from the laws, not from the code that they test.
"""

import itertools
import json
import pathlib

import numpy as np

REAL = np.longdouble
MODES = [(20.0, 0.004), (57.0, 0.006)]
SHAPES = {"tip": (0.5, -0.4), "mid": (0.3, 0.35)}
RATE_HZ, SAMPLES, GRID = 1000, 250, 128
FORCE_N, FREQUENCY_HZ = 40.0, 21.3

GAP = {"kind": "gap", "at": "tip", "stiffness": 2e5, "gap": 0.000928}
CONTACT = {"kind": "kelvin-voigt", "at": "tip", "stiffness": 2e5, "damping": 30.0, "gap": 0.0004, "side": 1}
BETWEEN = {"kind": "kelvin-voigt", "at": "mid", "to": "tip", "stiffness": 5e4, "damping": 8.0, "gap": 0.0, "side": -1}
FRICTION = {"kind": "friction", "at": "mid", "stiffness": 4e4, "slip": 25.0}
CASES = [[GAP], [CONTACT], [BETWEEN], [FRICTION], [GAP, FRICTION]]


def row(element):
    """How the displacement of an element follows from the modal coordinates."""
    at = np.array(SHAPES[element["at"]], REAL)
    return at - np.array(SHAPES[element["to"]], REAL) if "to" in element else at


def measures(element, y, index):
    """Displacement, velocity and state of an element."""
    w = row(element)
    return w @ y[0:2], w @ y[2:4], y[4 + index]


def margins(element, branch, y, index):
    """What must not be negative on a branch, each with the branch beyond."""
    x, v, z = measures(element, y, index)
    if element["kind"] == "gap":
        g = REAL(element["gap"])
        return {0: [(g - x, 1), (g + x, -1)], 1: [(x - g, 0)], -1: [(-x - g, 0)]}[branch]
    if element["kind"] == "kelvin-voigt":
        depth = element["side"] * x - REAL(element["gap"])
        pushing = depth + REAL(element["damping"]) / REAL(element["stiffness"]) * element["side"] * v
        return [(-min(depth, pushing), 1)] if branch == 0 else [(min(depth, pushing), 0)]
    most = REAL(element["slip"]) / REAL(element["stiffness"])
    return {0: [(most - z, 1), (most + z, -1)], 1: [(v, 0)], -1: [(-v, 0)]}[branch]


def generator(elements, branches, force_n):
    """A on the branches under a force at the tip."""
    size = 5 + len(elements)
    a = np.zeros((size, size), REAL)
    for i, (hz, zeta) in enumerate(MODES):
        omega = 2 * REAL(np.pi) * REAL(hz)
        a[i, 2 + i] = 1
        a[2 + i, i] = -omega**2
        a[2 + i, 2 + i] = -2 * REAL(zeta) * omega
    a[2:4, -1] = np.array(SHAPES["tip"], REAL) * REAL(force_n)
    for i, (element, branch) in enumerate(zip(elements, branches)):
        w, k = row(element), REAL(element["stiffness"])
        if element["kind"] == "gap" and branch:
            a[2:4, 0:2] -= k * np.outer(w, w)
            a[2:4, -1] += w * k * REAL(element["gap"]) * branch
        elif element["kind"] == "kelvin-voigt" and branch:
            a[2:4, 0:2] -= k * np.outer(w, w)
            a[2:4, 2:4] -= REAL(element["damping"]) * np.outer(w, w)
            a[2:4, -1] += w * k * REAL(element["gap"]) * element["side"]
        elif element["kind"] == "friction":
            a[2:4, 4 + i] -= k * w
            if branch == 0:
                a[4 + i, 2:4] = w
    return a


def flow(a, time_s, y):
    """exp(A t) y."""
    term, total = y, y.copy()
    for order in itertools.count(1):
        term = a @ term * (time_s / order)
        total = total + term
        if np.all(np.abs(term) <= 1e-21 * (1e-12 + np.abs(total))) or order > 60:
            return total


def worst(elements, branches, y):
    """The least margin."""
    return min(m for i, (e, b) in enumerate(zip(elements, branches)) for m, _ in margins(e, b, y, i))


def sample(elements, branches, y, force_n):
    """One sample, and the number of switches in it."""
    left, switches = REAL(1) / RATE_HZ, 0
    while left > 0:
        a = generator(elements, branches, force_n)
        h = min(left, REAL(1) / RATE_HZ / GRID)
        after = flow(a, h, y)
        if worst(elements, branches, after) >= 0:
            y, left = after, left - h if left > h * REAL(1 + 1e-12) else REAL(0)
            continue
        low, high = REAL(0), h
        for _ in range(70):
            middle = (low + high) / 2
            low, high = (middle, high) if worst(elements, branches, flow(a, middle, y)) >= 0 else (low, middle)
        y, left = flow(a, high, y), left - high
        for i, element in enumerate(elements):
            for margin, beyond in margins(element, branches[i], y, i):
                if margin < 0:
                    branches[i], switches = beyond, switches + 1
                    if element["kind"] == "friction" and beyond:
                        y[4 + i] = beyond * REAL(element["slip"]) / REAL(element["stiffness"])
                    break
    return y, switches


def case(elements):
    """The motion from rest."""
    y = np.zeros(5 + len(elements), REAL)
    y[-1] = 1
    branches, switches, states = [0] * len(elements), 0, []
    for k in range(SAMPLES):
        force_n = float(FORCE_N * np.sin(2 * np.pi * FREQUENCY_HZ * k / RATE_HZ))
        y, more = sample(elements, branches, y, force_n)
        switches += more
        if (k + 1) % 50 == 0:
            states.append([float(value) for value in y[:4]])
    return {"elements": elements, "switches": switches, "every_50_samples": states}


def main():
    """Writes the file beside this one."""
    file = {
        "force_n": FORCE_N,
        "frequency_hz": FREQUENCY_HZ,
        "rate_hz": RATE_HZ,
        "samples": SAMPLES,
        "cases": [case(elements) for elements in CASES],
    }
    pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(file, indent=1) + "\n")


if __name__ == "__main__":
    main()
