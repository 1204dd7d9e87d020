"""Plant and exciter as two processes on a real CAN interface, each with a live view: watched, steered, faulted."""

import numpy as np
import pytest
from conftest import SCENARIOS
from live_view import Viewer, address

COMMON = ("--mode", "lockstep", "--scenario", SCENARIOS / "bench.toml", "--live")


@pytest.fixture
def plant(programs):
    started = programs.resonarm("run", "--bus", "vcan0", "--speed", 1, *COMMON)
    return started, Viewer(*address(started))


def exciter(programs):
    started = programs.resonarm("exciter", "--bus", "vcan0", *COMMON, "--steer")
    return started, Viewer(*address(started))


def test_a_set_point_of_the_exciter_s_page_moves_the_plant_and_the_plant_s_page_disarms(programs, plant):
    plant, plant_view = plant
    exciter_end, exciter_view = exciter(programs)
    assert (plant_view.about["role"], plant_view.about["place"]) == ("plant", "vcan0")
    assert plant_view.about["actions"] == ["arm", "disarm", "reset"]
    assert exciter_view.about["actions"] == ["disarm", "set"]
    for view in (plant_view, exciter_view):
        view.next("state", lambda told: told["state"] == "operational")
    assert exciter_view.ask({"set": {"load": 30, "frequency_hz": 16, "phase_deg": 0}}) == {"kind": "taken"}
    # The load as the exciter commands it; it knows no angles. In the plant's head what was commanded, and the angles.
    commanded = exciter_view.next("update", lambda told: np.any(told["largest"][:, 2] > 29.5))
    assert np.isnan(commanded["largest"][:, 10:]).all()
    acting = plant_view.next("update", lambda told: np.any(told["largest"][:, 4] > 29.5))["largest"]
    # After a stall an update begins before the force does.
    assert np.all(np.abs(acting[acting[:, 4] > 29.5, 10]) > 1e-6)
    point = exciter_view.next("response")
    assert point["frequency_hz"] == 16 and abs(point["load"] - 30) < 0.1
    assert plant_view.ask("disarm") == {"kind": "taken"}
    plant_view.next("event", lambda told: told["name"] == "request.disarm")
    plant_view.next("state", lambda told: told["state"] == "pre-operational")
    assert exciter_end.wait() == 0
    assert plant.running() and plant.stop() == 0


def test_a_plant_whose_exciter_died_faults_is_reset_and_not_armed_without_one(programs, plant):
    _, view = plant
    exciter_end, exciter_view = exciter(programs)
    view.next("state", lambda told: told["state"] == "operational")
    assert exciter_view.ask({"set": {"load": 10, "frequency_hz": 16, "phase_deg": 0}}) == {"kind": "taken"}
    view.next("update", lambda told: np.any(told["largest"][:, 4] > 2))
    exciter_end.kill()
    fault = view.next("state", lambda told: told["state"] == "fault")
    assert fault["fault"]
    assert view.ask("arm") == {"kind": "taken"}
    view.next("event", lambda told: told["name"] == "request.arm")
    assert view.ask("reset") == {"kind": "taken"}
    view.next("state", lambda told: told["state"] == "pre-operational")
    # Another exciter finds a plant that can be armed.
    exciter(programs)
    view.next("state", lambda told: told["state"] == "operational")
