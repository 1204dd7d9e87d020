"""The words that calls take are types: a type checker finds a wrong one before it runs."""

import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

import resonarm
from resonarm import own_structure, words

ROOT = Path(__file__).resolve().parents[2]


def listed(message):
    """The words listed in a message."""
    return set(re.split(r", | or ", re.search(r"(?:one of|are|only) ([a-z0-9A-Z_, -]+)", message)[1]))


def test_the_words_of_readings_are_those_of_the_table_of_channels():
    vectors = [vector for vector, _ in resonarm.Plant().reading_channels()]
    assert set(get_args(words.Reading)) == set(vectors)


SCENARIO = resonarm.Scenario()


def own(coordinates):
    return resonarm.Stepped(step=lambda *_: [0.0, 0.0], points=lambda *_: [], initial=[0, 0], coordinates=coordinates)


KNOWN = [
    (words.Preset, lambda: resonarm.Chain.preset("x")),
    (words.Quantity, lambda: resonarm.Chain.preset().frf(1, drive="joint1", quantity="x")),
    (words.Scheme, lambda: resonarm.Chain.preset().simulate(1, scheme="x")),
    (words.RecordingPart, lambda: resonarm.Recording(ROOT / "recordings/fd.mcap").read("x")),
    (own_structure.Coordinates, lambda: resonarm.Plant(structure=own("x"))),
    (words.Mode, lambda: resonarm.run(SCENARIO, "x")),
    (words.Overrun, lambda: resonarm.run(SCENARIO, "real-time", overrun="x")),
    (words.RealTime, lambda: resonarm.run(SCENARIO, "real-time", rt="x")),
    (words.MessageName, lambda: resonarm.Encoder().encode("x")),
]


@pytest.mark.parametrize(("type_", "call"), KNOWN, ids=[call.__code__.co_names[-1] for _, call in KNOWN])
def test_the_words_of_a_type_are_those_that_the_extension_takes(type_, call):
    with pytest.raises(ValueError) as raised:
        call()
    assert all(word in str(raised.value) for word in get_args(type_)), str(raised.value)
    offered = listed(str(raised.value))
    assert set(get_args(type_)) == offered, str(raised.value)


WRONG = """\
import resonarm
from resonarm.testing import Bench

arm, scenario = resonarm.Chain.preset("irb1600-table1"), resonarm.Scenario()
resonarm.Chain.preset("irb")  # wrong
arm.frf(1.0, drive="tip.x", at="tip.y", quantity="mobility")
arm.frf(1.0)  # wrong
arm.frf(1.0, drive="joint1", response="tip.x")  # wrong
arm.frf(1.0, drive="joint1", quantity="inertance")  # wrong
arm.simulate(1.0, scheme="gl6")
arm.simulate(1.0, scheme="euler")  # wrong
arm.simulate(1.0, drive="joint1", frequency_hz=3.0)  # wrong
arm.continuation("frequency", 21, 23, drive={"joint1": 1.0}, curves_in="amplitude", curves_to=2.0)
arm.continuation("frequency", 21, 23)  # wrong
arm.continuation("frequency", 21, 23, torque_nm=1.0)  # wrong
arm.basins(22.0, drive={"joint1": 1.0}, coordinates=("alpha1_rad", "alpha2_rad"))
arm.basins(22.0, drive={"joint1": "1"})  # wrong
arm.ensemble([[0.0, 0.0, 0.0, 0.0]], 3, drive={"joint1": 1.0}, frequency_hz=22.0)
arm.replace({"link2.mass_kg": 40}).plot()
structure: resonarm.Structure = arm
modal = resonarm.Modal([{"frequency_hz": 20.0, "damping_ratio": 0.01, "shape": {"tip.x": 1.0}}])
resonarm.Modal([{"frequency_hz": 20.0, "damping": 0.01, "shape": {"tip.x": 1.0}}])  # wrong
resonarm.Chain([{"length_m": 1.0}])  # wrong
resonarm.Element(kind="gap", at="tip.x", stiffness_n_m=1e5, gap_m=1e-4)
resonarm.Element(kind="spring", at="tip.x")  # wrong
resonarm.Element(kind="gap", at="tip.x", stiffness=1e5)  # wrong
modal.continuation("amplitude", 0, 5, drive="tip.x", frequency_hz=20.0)
structure = modal
resonarm.Stepped(lambda t, dt, x, u: x, lambda t, x, u: (x, x, x), [0.0, 0.0])
resonarm.Stepped(lambda t, x: x, lambda t, x, u: (x, x, x), [0.0, 0.0])  # wrong
resonarm.run(scenario, structure=modal)  # wrong
resonarm.run(scenario, "real-time", overrun="slip", rt="auto", spin_s="auto")
resonarm.run(scenario, "realtime")  # wrong
resonarm.run(scenario, load="weight")  # wrong
resonarm.run(scenario, "real-time", overrun="skip")  # wrong
resonarm.run(scenario, "real-time", rt="on")  # wrong
resonarm.Node("plant", scenario, "vcan0", "lockstep")
resonarm.Node("planet", scenario, "vcan0")  # wrong
resonarm.Node("plant", scenario, "vcan0", "free")  # wrong
resonarm.Network(profile="fd")
resonarm.Network(profile="can-fd")  # wrong
resonarm.Encoder().encode("ForceCommand", force_x_n=1.0)
resonarm.Encoder().encode("Force", force_x_n=1.0)  # wrong
recording = resonarm.Recording("run.mcap")
recording.read("states")
recording.read("state")  # wrong
verdict: str = resonarm.Decoder().decode(resonarm.Frame(1, False, b"", False, False)).verdict
bench = Bench("bench.toml")
with bench.fault("loss", node="exciter"), bench.sensor_fault("head", "stuck"):
    result = bench.run()
with bench.fault("lost"):  # wrong
    pass
with bench.sensor_fault("head", "loose"):  # wrong
    pass
result.signal("force_x_n")
result.assert_state_reached("fault", 1.0)
result.assert_state_reached("faulted", 1.0)  # wrong
result.assert_faulted("command timeout")
result.assert_faulted("timeout")  # wrong
"""


def test_a_checker_finds_wrong_words(tmp_path):
    file = tmp_path / "wrong.py"
    file.write_text(WRONG)
    words = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", tmp_path / "cache", file]
    said = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False, cwd=tmp_path).stdout
    found = sorted({int(line) for line in re.findall(r"^\S*wrong\.py:(\d+): error", said, re.M)})
    assert found == [k for k, line in enumerate(WRONG.splitlines(), 1) if line.endswith("# wrong")], said
