"""Both ends on adapters that python-can drives: they end like the native ones."""

from importlib.metadata import version

import numpy as np
import pytest
from conftest import free, session
from recordings import bits

SCENARIO = """
[simulation]
seed = 5
# The serial line's driver takes a system call for every byte, which is slow in a virtual machine.
[network]
lockstep_timeout_s = 30.0
[excitation]
amplitude = { joint1 = 60.0 }
ramp_s = 0.1
profile = { waveform = "dwell", frequency_hz = 20.0, duration_s = 0.5, settle_s = 0.1 }
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("python-can") / "scenario.toml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def native(tmp_path_factory, scenario):
    return session(tmp_path_factory.mktemp("native"), "vcan0", "vcan0", scenario)


@pytest.fixture
def null_modem(tmp_path, programs):
    return programs.null_modem(tmp_path)


def ends_like(run, native):
    assert run.exciter["outcome"] == native.exciter["outcome"] == "finished"
    assert run.exciter["responses"] == native.exciter["responses"]
    assert run.plant["samples"] == native.plant["samples"] > 400
    assert (run.plant["bus"]["dropped"], run.plant["bus"]["refused"]) == (0, 0)
    assert np.abs(run.recording.states[:, 4]).max() > 59
    assert np.array_equal(bits(run.recording.states), bits(native.recording.states))
    assert np.array_equal(bits(run.recording.samples), bits(native.recording.samples))


def test_socketcan(tmp_path, native, scenario):
    bus = "python-can:interface=socketcan,channel=vcan0"
    ends_like(session(tmp_path, bus, bus, scenario, candump="vcan0"), native)


def test_one_end_on_python_can_the_other_native(tmp_path, native, scenario):
    bus = "python-can:interface=socketcan,channel=vcan0"
    ends_like(session(tmp_path, "vcan0", bus, scenario), native)


def test_slcan_over_a_null_modem(tmp_path, native, scenario, null_modem):
    buses = [f"python-can:interface=slcan,channel={end},bitrate=1000000,sleep_after_open=0" for end in null_modem]
    ends_like(session(tmp_path, *buses, scenario), native)


def test_all_give_the_states_of_a_free_run(tmp_path, native, scenario):
    assert np.array_equal(bits(native.recording.states), bits(free(tmp_path, scenario).recording.states))


def test_doctor_says_which_python_can_it_found(programs):
    findings = programs.resonarm("doctor", "--json").result()["findings"]
    found = next(finding for finding in findings if finding["subject"] == "python-can")
    assert found["mend"] is None
    assert found["state"].startswith(f"in this build; {version('python-can')}, of "), found
