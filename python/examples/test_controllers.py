"""A suite for controllers that shake the tip with 2 N at 14 Hz: the emulated one, one in Python, and a program.

    pytest python/examples --resonarm-bus vcan0

The program is the reference controller in C (`make -C firmware-protocol/c`); `RESONARM_C_CONTROLLER` says where it is.
On a bus in memory it is left out. One's own controller is one more line in CONTROLLERS.
"""

import math
import os
from pathlib import Path

import pytest

FREQUENCY_HZ, FORCE_N, RAMP_S, LENGTH_S = 14.0, 2.0, 0.3, 2.5
SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/bench.toml"
EXCITATION = {
    "amplitude": {"exciter_x": FORCE_N},
    "ramp_s": RAMP_S,
    "profile": {"waveform": "dwell", "frequency_hz": FREQUENCY_HZ, "duration_s": LENGTH_S, "settle_s": 0.5},
}
PROGRAM = os.environ.get("RESONARM_C_CONTROLLER", "firmware-protocol/c/build/controller")
HELD = f"--frequencies-hz {FREQUENCY_HZ:g} --amplitude-n {FORCE_N:g} --ramp-s {RAMP_S} --settle-s 0.3 --window-s 1"


def sine(measured):
    """A sine that grows over the ramp, from the time of the sample alone."""
    t = measured.sample / 1000
    if t >= LENGTH_S:
        return None
    return (FORCE_N * min(t / RAMP_S, 1.0) * math.sin(2 * math.pi * FREQUENCY_HZ * t), 0.0)


CONTROLLERS = {"emulated": None, "python": sine, "c": [PROGRAM, "{bus}", "--lockstep", *HELD.split()]}
pytestmark = pytest.mark.scenario(SCENARIO, excitation=EXCITATION)


@pytest.fixture(params=CONTROLLERS)
def controller(request):
    return CONTROLLERS[request.param]


def test_holds_its_force(bench, controller):
    result = bench.run(controller)
    result.assert_completed()
    result.assert_no_refused_command()
    result.assert_no_overrun()
    result.assert_force_below(1.5 * FORCE_N)
    settled = {"from_s": 0.8, "to_s": 1.6}
    result.assert_settled("head_force_x_n", FREQUENCY_HZ, amplitude=FORCE_N, within=0.05, **settled)


def test_its_force_drops_when_commands_are_lost(bench, controller):
    """The plant faults because no command arrives, or in lockstep because its exciter faults, and ramps to zero."""
    with bench.loss(ids=[0x201], direction="receive", probability=0.8):
        result = bench.run(controller)
    result.assert_faulted()
    assert result.plant["fault"]["name"] in ("command timeout", "partner fault")
    result.assert_force_below(1.5 * FORCE_N)
    assert result.signal("force_x_n")[1][-1] == 0


def test_nothing_of_a_corrupt_frame_reaches_the_arm(bench, controller):
    with bench.wrong_crc(ids=[0x201], direction="receive", probability=1.0):
        result = bench.run(controller)
    assert result.plant["bus"]["refused"] > 0
    result.assert_faulted()
    assert result.plant["fault"]["name"] in ("command timeout", "partner fault")
    result.assert_force_below(1e-9)
