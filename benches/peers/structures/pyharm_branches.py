"""The branches of contact.toml, friction.toml and cubic.toml by pyHarm, one JSON line for each.

Contact and friction are examples among pyHarm's own tests (tests/nonregression), with their options. `--harmonics` and
`--step` refine them. The time is that of `Maestro.operate`, without imports and compilation, which a first run takes.
"""

import argparse
import contextlib
import io
import json
import math
import time

import numpy as np
import pyHarm

SAMPLES = 1024


def analysis(low, high, step, **options):
    """A frequency response between two angular frequencies, rad/s."""
    steps = {"ds0": step, "ds_max": step, "ds_min": 1e-12, "sign_ds": 1}
    common = {"study": "frf", "verbose": False, "stepsizer": "acceptance", "stopper": "bounds", "solver": "scipyroot"}
    return {"FRF": {**common, **steps, "puls_inf": low, "puls_sup": high, **options}}


def substructure(mass, damping, stiffness):
    matrices = {"M": mass, "C": damping, "K": stiffness, "G": 0.0 * mass}
    return {"sub1": {"matrix": matrices, "ndofs": 1}}


def element(kind, node, **values):
    return {"type": kind, "connect": {"sub1": [node]}, "dirs": [0], **values}


def contact(step):
    one = np.eye(1)
    return {
        "analysis": analysis(
            2.0,
            15.0,
            step or 0.1,
            predictor="tangent",
            predictor_options={"verbose": False},
            corrector="arc_length",
            preconditioner="allgower_xpred",
        ),
        "substructures": substructure(one, 0.1 * math.sqrt(40.0) * one, 40.0 * one),
        "connectors": {
            "loading": element("CosinusForcing", 0, amp=100.0),
            "gap": element("PenaltyUnilateralGap", 0, g=10.0, k=1000.0),
        },
        "adim": {"status": True, "lc": 10.0, "wc": 1.0},
    }


def friction(step):
    damping = 0.05 * np.array([[2.0, -1.0], [-1.0, 1.0]])
    return {
        "analysis": analysis(
            24.0,
            28.0,
            step or 0.03,
            predictor="secant",
            predictor_options={"bifurcation_detect": False},
            corrector="pseudo_arc_length",
            preconditioner="nopreconditioner",
        ),
        "substructures": substructure(np.diag([1.0, 0.02]), damping, np.array([[680.0, -40.0], [-40.0, 40.0]])),
        "connectors": {
            "loading": element("CosinusForcing", 0, amp=1.0),
            "friction": element("Jenkins", 1, mu=1.0, N0=5.0, k=200.0),
        },
        "adim": {"status": False, "lc": 1.0, "wc": 1.0},
    }


def cubic(step):
    shapes = np.array([[0.5, -0.4], [0.3, 0.35]])
    omega = 2.0 * math.pi * np.array([20.0, 57.0])
    back = np.linalg.inv(shapes)
    mass, stiffness = back.T @ back, back.T @ np.diag(omega**2) @ back
    damping = back.T @ np.diag(2.0 * np.array([0.004, 0.006]) * omega) @ back
    length_m = 0.01
    return {
        "analysis": analysis(
            2.0 * math.pi * 18.0,
            2.0 * math.pi * 26.0,
            step or 0.05,
            predictor="tangent",
            predictor_options={"verbose": False},
            corrector="arc_length",
            preconditioner="allgower_xpred",
        ),
        "substructures": substructure(mass, damping, stiffness),
        "connectors": {
            "loading": element("CosinusForcing", 0, amp=10.0),
            "spring": element("CubicSpring", 0, k=3711000.0),
        },
        "adim": {"status": True, "lc": length_m, "wc": 2.0 * math.pi * 20.0},
    }


CASES = {"contact": contact, "friction": friction, "cubic": cubic}


def extreme(arc, value):
    """The arclength, and the value there, of the extreme of the parabola through three points."""
    bend, slope, at = np.polyfit(arc - arc[1], value, 2)
    place = -slope / (2.0 * bend)
    return place, at + slope * place + bend * place * place


def figures(case, maestro):
    """The response with the largest displacement and the folds, both located by parabolas."""
    size, scale = case["adim"]["lc"], case["adim"]["wc"]
    if not case["adim"]["status"]:
        size, scale = 1.0, 1.0
    accepted = [solution for solution in maestro.nls["FRF"].SolList if solution.flag_accepted]
    rows = maestro.getIndex("sub1", 0, 0)
    hz = np.array([solution.x[-1] for solution in accepted]) * scale / (2.0 * math.pi)
    series = np.array([solution.x[rows] for solution in accepted]) * size
    harmonics = (series.shape[1] - 1) // 2
    phase = np.arange(4096) * (2.0 * math.pi / 4096)
    columns = [np.ones_like(phase)]
    for order in range(1, harmonics + 1):
        columns += [np.cos(order * phase), np.sin(order * phase)]
    largest = np.abs(series @ np.array(columns)).max(axis=1)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(hz) / np.ptp(hz), np.diff(largest) / np.ptp(largest)))])
    top = int(np.clip(largest.argmax(), 1, len(hz) - 2))
    around = slice(top - 1, top + 2)
    place, peak = extreme(arc[around], largest[around])
    peak_hz = float(np.polyval(np.polyfit(arc[around] - arc[top], hz[around], 2), place))
    turns = [k for k in range(1, len(hz) - 1) if (hz[k] - hz[k - 1]) * (hz[k + 1] - hz[k]) < 0.0]
    folds = [float(extreme(arc[k - 1 : k + 2], hz[k - 1 : k + 2])[1]) for k in turns]
    return {"points": len(hz), "harmonics": harmonics, "peak": [peak_hz, float(peak)], "folds_hz": folds}


def run(name, harmonics, step):
    case = CASES[name](step)
    inputs = {key: value for key, value in case.items() if key != "adim"}
    inputs["system"] = {"type": "Base", "nh": harmonics, "nti": SAMPLES, "adim": case["adim"]}
    maestro = pyHarm.Maestro(inputs)
    start = time.perf_counter()
    maestro.operate("null" if name != "cubic" else None)
    seconds = time.perf_counter() - start
    return {"tool": "pyHarm", "case": name, "seconds": seconds, **figures(case, maestro)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--harmonics", type=int, default=7)
    parser.add_argument("--step", type=float)
    parser.add_argument("--turns", type=int, default=3)
    options = parser.parse_args()
    for name in options.cases:
        with contextlib.redirect_stdout(io.StringIO()):
            turns = [run(name, options.harmonics, options.step) for _ in range(1 + options.turns)][1:]
        print(json.dumps(min(turns, key=lambda turn: turn["seconds"])), flush=True)


main()
