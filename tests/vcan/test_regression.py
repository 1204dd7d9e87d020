"""`resonarm replay --against`: the reference controller in C passes, and with a flaw in its source it is caught."""

import functools
import shutil
from pathlib import Path

import pytest
import wire
from processes import run, wait_until
from recordings import RECEIVED, SENT, Recording
from test_c_controller import CONTROLLER

SOURCES = Path(__file__).parents[2] / "firmware-protocol/c"
OPEN_LOOP = "controller/open_loop.c"
# The changes in each file.
FLAWS = {
    "two per cent too much": (OPEN_LOOP, "spec->amplitude_n * shape", "1.02 * spec->amplitude_n * shape"),
    "no disarm": (OPEN_LOOP, ".action = RESONARM_FINISH", ".action = RESONARM_HOLD_FORCE"),
}
# A virtual machine may hold a process up for longer than the 20 ms that the specification allows.
SCENARIO = """
[simulation]
rate_hz = 200
[network]
command_timeout_s = 0.5
partner_timeout_s = 2.0
"""
PLAYED = ["--open-loop", "--frequencies-hz", 12, "--amplitude-n", 50, "--dwell-s", 1, "--ramp-s", 0.2]
PATIENT = ["--rate-hz", 200, "--command-timeout-s", 0.5, "--partner-timeout-s", 2]
# How candump logs a heartbeat of the controller.
HEARTBEAT = " vcan0 702#"
FLAGS = {"lockstep": ["--lockstep"], "real-time": []}
SPEEDS = {"lockstep": 0, "real-time": 1}


def controller(programs, program, mode):
    return programs.start("controller", program, "vcan0", *FLAGS[mode], *PLAYED, *PATIENT)


@pytest.fixture(scope="module")
def flawed(tmp_path_factory):
    """The controller, built with a flaw."""

    @functools.cache
    def build(flaw):
        folder = tmp_path_factory.mktemp("flawed")
        copy = folder / "c"
        shutil.copytree(SOURCES, copy, ignore=shutil.ignore_patterns("build"))
        path, healthy, ill = FLAWS[flaw]
        source = (copy / path).read_text()
        assert source.count(healthy) == 1
        (copy / path).write_text(source.replace(healthy, ill))
        run("make", "--silent", "-C", copy, f"OUT={folder}/build")
        return folder / "build/controller"

    return build


@pytest.fixture(params=SPEEDS)
def recorded(request, programs, tmp_path):
    """Mode and recording of a run with the healthy controller."""
    (tmp_path / "plant.toml").write_text(SCENARIO)
    path = tmp_path / "run.mcap"
    common = ["--bus", "vcan0", "--mode", request.param, "--scenario", tmp_path / "plant.toml", "--json"]
    plant = programs.resonarm("run", *common, "--stop-on-disarm", "--record", path)
    assert controller(programs, CONTROLLER, request.param).wait() == 0
    plant.result()
    return request.param, path


def against(programs, recorded, program, code, patience_s=10):
    mode, path = recorded
    dump = programs.candump()
    run = controller(programs, program, mode)
    wait_until(lambda: HEARTBEAT in dump.stdout, "the controller to be on the bus")
    flags = ["--bus", "vcan0", "--against", "--speed", SPEEDS[mode], "--patience-s", patience_s, "--json"]
    compared = programs.resonarm("replay", path, *flags).result(code=code)
    # One that misses its plant ends as well.
    run.wait()
    return compared


def commands(path):
    """Sample and force along x of each recorded command; in real time a sample may have several, or none."""
    frames = Recording.whole(path).frames_of(RECEIVED, 0x201)
    return [(frame.step, wire.decode(wire.Frame(0, frame.id, frame.data))[1]["force_x_n"]) for frame in frames]


def test_the_healthy_controller_passes(programs, recorded):
    compared = against(programs, recorded, CONTROLLER, 0)
    assert compared["first_difference"] is None
    assert compared["largest_force_difference_n"] == compared["largest_torque_difference_nm"] == 0
    assert compared["commands"] == len(commands(recorded[1])) > 150
    sent = [frame for frame in Recording.whole(recorded[1]).frames if frame.direction == SENT]
    assert compared["frames"] == len(sent)


def test_an_amplitude_that_is_off_is_caught(programs, flawed, recorded):
    compared = against(programs, recorded, flawed("two per cent too much"), 1)
    first, expected = compared["first_difference"], commands(recorded[1])
    assert first["kind"] == "command"
    assert first["expected"]["exciter_x"] in [pytest.approx(force_n) for sample, force_n in expected if sample == first["sample"]]
    # The wire has 0.02 N: a force differs as soon as it is large enough, which those before are not.
    assert first["got"]["exciter_x"] == pytest.approx(1.02 * first["expected"]["exciter_x"], abs=0.02)
    assert all(abs(force_n) < 2 for sample, force_n in expected if sample < first["sample"])
    assert compared["largest_force_difference_n"] == pytest.approx(0.02 * 50, abs=0.05)


def test_a_disarm_that_is_missing_is_caught(programs, flawed, recorded):
    program = flawed("no disarm")
    # The plant has waited long enough, or before that the controller misses a plant that waits.
    for patience_s, kind in ((1, "no-request"), (10, "fault")):
        compared = against(programs, recorded, program, 1, patience_s)
        first = compared["first_difference"]
        assert (first["kind"], first["expected"]) == (kind, "disarm"), compared
    assert compared["commands"] == len(commands(recorded[1]))
    assert compared["largest_force_difference_n"] == 0
