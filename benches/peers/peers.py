"""The arm's step in MuJoCo and in hand-written numba. Prints one JSON line per peer: name and steps per second.

Every peer steps the same arm, irb1600-fitted at beta2 = 60 degrees, from the same state, without load.
"""
import json
import math
import time

import mujoco
import numba
import numpy as np

L1, L2, LC2, M2, I_A1, I_S2 = 0.63, 0.6, 0.1, 50.58, 0.55, 1.5
K1, K2, D1, D2 = 555e3, 128e3, 0.9, 0.9
BETA2 = math.radians(60.0)
STATE = (0.02, -0.03, 0.0, 0.0)
STEP_S = 1.0 / 8000.0
ROUNDS = 7

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


def main():
    print(json.dumps({"name": "MuJoCo RK4", "steps_per_s": rate(mujoco_runner(), 20_000)}))
    print(json.dumps({"name": "numba RK4", "steps_per_s": rate(lambda n: rk4(STATE, n, STEP_S, 0.0, 0.0), 500_000)}))
    print(json.dumps({"name": "state", "state": rk4(STATE, 800, STEP_S, 0.0, 0.0)}))


main()
