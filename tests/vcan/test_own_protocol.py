"""A controller that knows nothing of Resonarm drives the plant by a DBC: examples/own-protocol, and what goes wrong."""

import importlib.util
import json
import math
import sys
from pathlib import Path

import can
import pytest
from processes import PATIENCE_S, RESONARM, run, wait_until
from recordings import Recording

FOLDER = Path(__file__).parents[2] / "examples" / "own-protocol"
OPERATIONAL, FAULT = 2, 3
COMMAND_TIMEOUT, BUS_LOSS = 1, 2
# Longer than a busy machine stops a process.
TIMEOUT_S = 5.0


@pytest.fixture(scope="module")
def controller():
    specification = importlib.util.spec_from_file_location("own_controller", FOLDER / "controller.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture
def scenario(tmp_path):
    """The example's scenario at 100 Hz, with a timeout that only a test exceeds."""
    text = (FOLDER / "bench.toml").read_text()
    for old, new in [
        ("rate_hz = 1000", "rate_hz = 100"),
        ("timeout_s = 0.1", f"timeout_s = {TIMEOUT_S}"),
        ('message = "Meas"\n', 'message = "Meas"\nevery = 1\n'),
        ('dbc = "bench.dbc"', f'dbc = "{FOLDER / "bench.dbc"}"'),
    ]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = tmp_path / "slow.toml"
    path.write_text(text)
    return path


@pytest.fixture
def shaker(controller):
    with can.Bus(interface="socketcan", channel="vcan0", fd=True) as bus:
        yield controller.Shaker(bus)


def state_of(shaker):
    """Waits for the next reading; its state and reason."""
    while (read := shaker.read(PATIENCE_S))[0] != "Meas":
        pass
    return read[1]["State"], read[1]["Reason"]


def armed(programs, shaker, scenario, path, interface="vcan0"):
    """A plant in real time that this controller has armed and that it drives with 20 N."""
    plant = programs.resonarm("run", "--bus", interface, "--scenario", scenario, "--record", path, "--json")
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    while state_of(shaker)[0] != OPERATIONAL:
        shaker.drive(20.0)
    for _ in range(5):
        shaker.drive(20.0)
        state_of(shaker)
    return plant


def forces(path):
    """The forces that acted, N."""
    return Recording.whole(path).states[:, 6]


def test_the_example_as_its_text_says_in_lockstep(programs, tmp_path):
    path = tmp_path / "run.mcap"
    common = ["--mode", "lockstep", "--stop-on-disarm", "--json", "--record", path]
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", FOLDER / "bench.toml", *common)
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    arguments = [FOLDER / "controller.py", "vcan0", "--timeout-s", PATIENCE_S]
    controller = programs.start("controller", sys.executable, *arguments)
    seen, report = controller.result(), plant.result()
    assert (seen["readings"], seen["poses"], seen["last"]["State"]) == (2000, 200, OPERATIONAL)
    assert (report["outcome"], report["bus"]["refused"], report["bus"]["dropped"]) == ("disarmed", 0, 0)
    played = forces(path)[:1999]
    for index, force_n in enumerate(played):
        asked_n = 20.0 * math.sin(2 * math.pi * 5.0 * (index + 1) / 1000)
        assert abs(force_n - asked_n) <= 0.01 + 1e-9, index
    assert "identical" in run(RESONARM, "resim", path)


def test_two_runs_in_lockstep_have_the_same_bits(programs, tmp_path):
    runs = []
    for number in range(2):
        path = tmp_path / f"{number}.mcap"
        flags = ["--mode", "lockstep", "--stop-on-disarm", "--json", "--record", path]
        plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", FOLDER / "bench.toml", *flags)
        wait_until(lambda plant=plant: "ready on" in plant.stderr, "the plant to be on the bus")
        arguments = ["vcan0", "--samples", "300", "--timeout-s", PATIENCE_S]
        programs.start(f"controller{number}", sys.executable, FOLDER / "controller.py", *arguments).result()
        plant.result()
        runs.append(Recording.whole(path).states[:300].tobytes())
    assert runs[0] == runs[1]


def test_silence_ramps_to_zero_and_is_said_in_the_wires_own_words(programs, shaker, scenario, tmp_path):
    path = tmp_path / "run.mcap"
    plant = armed(programs, shaker, scenario, path)
    while (said := state_of(shaker))[0] == OPERATIONAL:
        pass
    assert said == (FAULT, COMMAND_TIMEOUT)
    for _ in range(10):
        shaker.drive(20.0)
        assert state_of(shaker)[0] == FAULT, "enable is held: that arms nothing"
    shaker.drive(0.0, enable=False, reset=True)
    while state_of(shaker)[0] == FAULT:
        shaker.drive(0.0, enable=False)
    while state_of(shaker)[0] != OPERATIONAL:
        shaker.drive(10.0)
    shaker.drive(0.0, enable=False)
    assert plant.stop() == 0
    acted = forces(path)
    assert 20.0 in acted and 10.0 in acted
    fault = Recording.whole(path).event("state.fault").step
    again = Recording.whole(path).event("state.operational", after=fault).step
    # The ramp takes 50 ms.
    assert again > fault + 10 and set(acted[fault + 5 : again]) == {0.0}


def test_a_killed_controller(programs, scenario, shaker, tmp_path):
    path = tmp_path / "run.mcap"
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario, "--record", path, "--stop-on-disarm")
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    arguments = ["vcan0", "--samples", "1000000", "--timeout-s", PATIENCE_S]
    controller = programs.start("controller", sys.executable, FOLDER / "controller.py", *arguments)
    wait_until(lambda: "armed at sample" in plant.stderr, "the controller to arm the plant")
    controller.kill()
    assert plant.wait() == 1
    assert "no valid command in time" in plant.stderr
    assert forces(path)[-1] == 0.0


def test_stale_counters_and_wrong_checksums_command_nothing(programs, shaker, scenario, tmp_path):
    path = tmp_path / "run.mcap"
    plant = armed(programs, shaker, scenario, path)
    before = shaker.alive
    while (said := state_of(shaker))[0] == OPERATIONAL:
        shaker.alive = before
        shaker.drive(40.0)
    assert said == (FAULT, COMMAND_TIMEOUT)
    plant.stop()
    acted, report = forces(path), json.loads(plant.stdout)
    assert report["bus"]["refused"] > 0
    assert Recording.whole(path).event("frame.counter").value == 0x100
    # The first of them follows the one before, and counts.
    assert 40.0 in acted


def test_the_interface_goes_down_and_comes_back(programs, controller, interface, scenario, tmp_path):
    path = tmp_path / "run.mcap"
    with can.Bus(interface="socketcan", channel=interface, fd=True) as bus:
        plant = armed(programs, controller.Shaker(bus), scenario, path, interface)
        run("ip", "link", "set", interface, "down")
        wait_until(lambda: "is down" in plant.stderr, "the plant to notice")
        run("ip", "link", "set", interface, "up")
    # The socket of the first has an error to report.
    with can.Bus(interface="socketcan", channel=interface, fd=True) as bus:
        assert state_of(controller.Shaker(bus)) == (FAULT, BUS_LOSS)
    plant.stop()
    assert forces(path)[-1] == 0.0
