"""The interface `resonarm` of python-can with a protocol of the user's own, examples/own-protocol."""

import importlib.util
from pathlib import Path

import can
import pytest

import resonarm

FOLDER = Path(__file__).parents[2] / "examples" / "own-protocol"


@pytest.fixture
def controller():
    specification = importlib.util.spec_from_file_location("own_controller", FOLDER / "controller.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_unchanged_controller_drives_a_plant_in_this_process(controller, tmp_path):
    path = tmp_path / "run.mcap"
    arguments = {"scenario": FOLDER / "bench.toml", "mode": "lockstep", "record": path}
    with can.Bus(interface="resonarm", channel="own", **arguments) as bus:
        readings, poses = controller.sine(controller.Shaker(bus), 20.0, 5.0, 500, 60.0)
    assert (len(readings), readings[-1]["State"]) == (500, 2)
    # Every tenth sample has one, and sample 0 again and again until the plant is armed.
    assert 50 <= len(poses) < 150
    forces = resonarm.Recording(path).states["force_n"][:499, 0]
    assert abs(forces).max() == pytest.approx(20.0, abs=0.01)


def test_a_scenario_of_text_finds_the_dbc_from_its_folder():
    text = (FOLDER / "bench.toml").read_text()
    assert resonarm.Scenario(text, folder=FOLDER).values()["wire"]["node"] == "Shaker"
    with pytest.raises(ValueError, match="can't read the DBC"):
        resonarm.Scenario(text)
