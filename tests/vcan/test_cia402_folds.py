"""A master by the package `canopen` finds the folds of the first resonance, where `continue` computes them."""

import itertools
import json
import math

import numpy as np
import pytest
from cia402_master import Master
from linear_arm import amplitudes
from processes import RESONARM, run, wait_until

GEAR, COUNTS, RATED_NM = 100.0, 1 << 20, 1.5
COUNTS_PER_RAD = GEAR * COUNTS / (2 * math.pi)
STEP_NM = 1e-3 * GEAR * RATED_NM
RATE_HZ, TORQUE_NM, FROM_HZ, TO_HZ = 150, 4000.0, 26.0, 26.8
# Damping ratio 4e-3 and 27 Hz: a time constant of 1.4 s.
DWELL_S, READ_S = 8.4, 1.6
ARM = """
[structure]
angles_deg = [0.0, 120.0]
set = { "link1.damping_nm_s_rad" = 27.0, "link2.damping_nm_s_rad" = 27.0 }
[rig.exciter]
torque_limit_nm = 5000.0
"""
DRIVES = f"""
[simulation]
rate_hz = {RATE_HZ}
[network]
lockstep_timeout_s = 60.0
[wire]
preset = "cia402"
lockstep = "sync"
drives = [
    {{ node_id = 1, joint = 1, gear_ratio = {GEAR}, rated_torque_nm = {RATED_NM}, encoder_counts_per_turn = {COUNTS} }},
    {{ node_id = 2, joint = 2, gear_ratio = {GEAR}, rated_torque_nm = {RATED_NM}, encoder_counts_per_turn = {COUNTS} }},
]
"""


class Sine:
    """A torque at joint 1 whose frequency changes without a jump of its phase."""

    def __init__(self, master):
        self.master, self.phase = master, 0.0

    def dwell(self, frequency_hz):
        """The amplitudes of the angles at a frequency, at the end of its time, rad."""
        angle = 2 * math.pi * frequency_hz / RATE_HZ
        # A torque that is held for a sample has this part of a sine's first harmonic.
        held = math.sin(angle / 2) / (angle / 2)
        counts = []
        for _ in range(round(DWELL_S * RATE_HZ)):
            target = round(TORQUE_NM / held / STEP_NM * math.cos(self.phase))
            counts.append(self.master.cycle([target, 0]))
            self.phase += angle
        read = np.array(counts[-round(READ_S * RATE_HZ) :]) / COUNTS_PER_RAD
        return amplitudes(read, RATE_HZ, frequency_hz, [2 * frequency_hz])


def document(command, scenario, *flags):
    torque = ("--drive", f"joint1={TORQUE_NM}", "--at", "joint1,joint2", "--json")
    return json.loads(run(RESONARM, command, "--scenario", scenario, *torque, *flags))


def swept(scenario, direction, frequencies_hz):
    """The amplitudes of settled responses at evenly stepped frequencies, rad."""
    ends = ("--from-hz", min(frequencies_hz), "--to-hz", max(frequencies_hz), "--points", len(frequencies_hz))
    (sweep,) = document("sweep", scenario, *ends, "--direction", direction)["sweeps"]
    points = sorted(sweep["points"], key=lambda point: point["frequency_hz"], reverse=direction == "down")
    assert [point["frequency_hz"] for point in points] == pytest.approx(frequencies_hz)
    return [[point["readings"][joint]["amplitude"] for joint in ("joint1", "joint2")] for point in points]


def test_steps_jump_at_the_computed_folds_and_have_the_computed_amplitudes(programs, tmp_path):
    """The frequency is stepped up over the one fold and down over the other.

    The grid has five steps between the folds, and each fold in the middle of a step: a jump in the right step is right
    within half a step, 0.07 % of the frequency. Far from the folds steps are left out. A step lasts six time constants
    of the slowest mode, after which a transient has 0.3 %: 1 % is the bound of amplitudes. A motion leaves the end of a
    branch slowly: after the step beyond a fold it is on its way, and after the next on the other branch.
    """
    computed, scenario = tmp_path / "arm.toml", tmp_path / "drives.toml"
    computed.write_text(ARM)
    scenario.write_text(ARM + DRIVES)
    branch = document("continue", computed, "--from-hz", FROM_HZ, "--to-hz", TO_HZ)
    low_hz, high_hz = sorted(
        special["frequency_hz"] for special in branch["bifurcations"] if special["kind"] == "fold"
    )
    grid_hz = [low_hz + (k - 1.5) * (high_hz - low_hz) / 5 for k in range(9)]
    # Places in the grid: the folds are after 1 and after 6.
    steps = {"up": [5, 6, 7, 8], "down": [6, 4, 3, 2, 1, 0]}
    sheets = {number: tmp_path / f"{number}.eds" for number in (1, 2)}
    for number, path in sheets.items():
        path.write_text(run(RESONARM, "protocol", "eds", "--scenario", scenario, "--node-id", number))
    dump = programs.candump()
    plant = programs.resonarm("run", "--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json")
    wait_until(lambda: "701#00" in dump.stdout and "702#00" in dump.stdout, "the drives to boot")
    dump.stop()
    with Master("vcan0", sheets) as master:
        master.set_up()
        master.arm()
        sine = Sine(master)
        found = {way: [sine.dwell(grid_hz[k]) for k in places] for way, places in steps.items()}
        for node in master.nodes:
            node.state = "SWITCH ON DISABLED"
    assert plant.stop() == 0
    assert plant.result()["fault"] is None
    for way, frequencies_hz in (("up", grid_hz), ("down", grid_hz[::-1])):
        expected = dict(zip(frequencies_hz, swept(computed, way, frequencies_hz), strict=True))
        beyond = 7 if way == "up" else 1
        for place, got in zip(steps[way], found[way], strict=True):
            if place != beyond:
                assert got == pytest.approx(expected[grid_hz[place]], rel=0.01), (way, place)
        ratios = [after[0] / before[0] for before, after in itertools.pairwise(found[way])]
        jumps = [place for place, ratio in zip(steps[way][1:], ratios, strict=True) if not 1 / 1.4 < ratio < 1.4]
        assert jumps[0] == beyond, (way, ratios)
