"""Steps per second of the same arm in MuJoCo, in hand-written numba and in Resonarm, and the ratios.

Every one steps irb1600-fitted at beta2 = 60 degrees from the same state, without load, and must arrive at the same
state. The three are measured in turn, several times over: in each turn the best short round of each counts, and the
ratios are the medians of those in a turn, because the clock of a shared machine changes between turns. """
import json
import math
import statistics
import subprocess
import time

import mujoco
import numba
import numpy as np

L1, L2, LC2, M2, I_A1, I_S2 = 0.63, 0.6, 0.1, 50.58, 0.55, 1.5
K1, K2, D1, D2 = 555e3, 128e3, 0.9, 0.9
BETA2 = math.radians(60.0)
STATE = (0.02, -0.03, 0.0, 0.0)
STEP_S = 1.0 / 8000.0
ROUNDS = 100
REPEATS = 25

A1 = I_A1 + I_S2 + M2 * (L1 * L1 + LC2 * LC2)
A2 = M2 * L1 * LC2
A3 = I_S2 + M2 * LC2 * LC2


@numba.njit(inline="always")
def acceleration(x1, x2, v1, v2, u1, u2):
    angle = BETA2 + x2
    c, h = A2 * math.cos(angle), A2 * math.sin(angle)
    m11, m12 = A1 + 2.0 * c, A3 + c
    r1 = u1 - D1 * v1 - K1 * x1 + h * (2.0 * v1 + v2) * v2
    r2 = u2 - D2 * v2 - K2 * x2 - h * v1 * v1
    inverse = 1.0 / (m11 * A3 - m12 * m12)
    return (A3 * r1 - m12 * r2) * inverse, (m11 * r2 - m12 * r1) * inverse


@numba.njit
def rk4(state, steps, h, u1, u2):
    x1, x2, v1, v2 = state
    half, sixth = 0.5 * h, h / 6.0
    for _ in range(steps):
        a1, a2 = acceleration(x1, x2, v1, v2, u1, u2)
        p1, p2, w1, w2 = x1 + half * v1, x2 + half * v2, v1 + half * a1, v2 + half * a2
        b1, b2 = acceleration(p1, p2, w1, w2, u1, u2)
        q1, q2, y1, y2 = x1 + half * w1, x2 + half * w2, v1 + half * b1, v2 + half * b2
        c1, c2 = acceleration(q1, q2, y1, y2, u1, u2)
        r1, r2, z1, z2 = x1 + h * y1, x2 + h * y2, v1 + h * c1, v2 + h * c2
        d1, d2 = acceleration(r1, r2, z1, z2, u1, u2)
        x1 += sixth * (v1 + 2.0 * (w1 + y1) + z1)
        x2 += sixth * (v2 + 2.0 * (w2 + y2) + z2)
        v1 += sixth * (a1 + 2.0 * (b1 + c1) + d1)
        v2 += sixth * (a2 + 2.0 * (b2 + c2) + d2)
    return x1, x2, v1, v2


MODEL = f"""
<mujoco>
  <option timestep="{STEP_S}" integrator="RK4" gravity="0 0 0"/>
  <worldbody>
    <body>
      <inertial pos="0 0 0" mass="1e-9" diaginertia="{I_A1} {I_A1} {I_A1}"/>
      <joint axis="0 0 1" stiffness="{K1}" damping="{D1}"/>
      <body pos="{L1} 0 0" euler="0 0 60">
        <inertial pos="{LC2} 0 0" mass="{M2}" diaginertia="{I_S2} {I_S2} {I_S2}"/>
        <joint axis="0 0 1" stiffness="{K2}" damping="{D2}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def rate(run, steps):
    run(steps)
    best = math.inf
    for _ in range(ROUNDS):
        start = time.perf_counter()
        run(steps)
        best = min(best, time.perf_counter() - start)
    return steps / best


def mujoco_runner():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = STATE[:2], STATE[2:]

    # The same motion, or the comparison means nothing.
    mujoco.mj_step(model, data, 800)
    expected = rk4(STATE, 800, STEP_S, 0.0, 0.0)
    seen = (*data.qpos, *data.qvel)
    assert np.allclose(seen, expected, rtol=1e-6, atol=1e-9), (seen, expected)
    return lambda steps: mujoco.mj_step(model, data, steps)


def ours():
    """Runs Resonarm's side, already built, and returns its end state and its rates by name."""
    build = ["cargo", "bench", "--quiet", "--bench", "peers"]
    lines = subprocess.run(build, check=True, capture_output=True, text=True).stdout.splitlines()
    results = [json.loads(line) for line in lines if line.startswith("{")]
    state = next(result["state"] for result in results if result["name"] == "state")
    return state, {result["name"]: result["steps_per_s"] for result in results if "steps_per_s" in result}


def main():
    expected = rk4(STATE, 800, STEP_S, 0.0, 0.0)
    step_mujoco = mujoco_runner()
    turns = []
    for _ in range(REPEATS):
        state, rates = ours()
        assert np.allclose(state, expected, rtol=1e-10, atol=1e-14), (state, expected)
        rates["numba RK4"] = rate(lambda n: rk4(STATE, n, STEP_S, 0.0, 0.0), 2_000)
        rates["MuJoCo RK4"] = rate(step_mujoco, 40)
        turns.append(rates)
    print(f"{'':24} {'steps/s':>12} {'x numba':>9} {'x MuJoCo':>9}")
    for name in turns[0]:
        over_numba, over_mujoco = (
            statistics.median(turn[name] / turn[peer] for turn in turns) for peer in ("numba RK4", "MuJoCo RK4")
        )
        typical = statistics.median(turn[name] for turn in turns)
        print(f"{name:24} {typical:12.4g} {over_numba:9.2f} {over_mujoco:9.1f}")


main()
