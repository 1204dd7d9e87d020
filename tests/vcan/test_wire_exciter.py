"""The emulated exciter on protocols of others, by the DBC of examples/own-protocol, ODrive's messages and CANopen: it
drives the plant, and a plant that knows nothing of Resonarm."""

import importlib.util
import json
import math
import threading
from pathlib import Path

import can
import numpy as np
import pytest
from conftest import free, session
from processes import RESONARM, run, wait_until
from recordings import Recording, bits

EXAMPLES = Path(__file__).parents[2] / "examples"
OWN = EXAMPLES / "own-protocol"
EXCITATION = """
[excitation]
amplitude = {{ {load} }}
profile = {{ waveform = "dwell", frequency_hz = 20.0, duration_s = 0.4, settle_s = 0.2 }}
"""
# Longer than a busy machine stops a process.
PATIENT = "[network]\npartner_timeout_s = 5.0\n"


@pytest.fixture(scope="module")
def controller():
    specification = importlib.util.spec_from_file_location("own_controller", OWN / "controller.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def own_protocol(folder):
    text = (OWN / "bench.toml").read_text().replace("timeout_s = 0.1", "timeout_s = 5.0")
    text = text.replace('dbc = "bench.dbc"', f'dbc = "{OWN / "bench.dbc"}"')
    return write(folder, PATIENT + text + EXCITATION.format(load="exciter_x = 20.0"))


def odrive(folder, lockstep=""):
    text = (EXAMPLES / "odrive" / "drives.toml").read_text().replace("timeout_s = 0.5", f"timeout_s = 5.0\n{lockstep}")
    return write(folder, PATIENT + text + EXCITATION.format(load="joint1 = 20.0, joint2 = 10.0"))


def write(folder, text):
    path = folder / "scenario.toml"
    path.write_text(text)
    return path


def in_real_time(programs, scenario, path):
    """The reports of plant and exciter, as two processes."""
    flags = ["--bus", "vcan0", "--scenario", scenario, "--json"]
    plant = programs.resonarm("run", *flags, "--stop-on-disarm", "--record", path)
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    exciter = programs.resonarm("exciter", *flags)
    return plant.result(), exciter.result()


def both_torques_act(programs, folder, scenario, in_lockstep):
    """A whole run of two processes, in which 20 and 10 N·m act at the joints."""
    path = folder / "run.mcap"
    if in_lockstep:
        both = session(folder, "vcan0", "vcan0", scenario)
        plant, exciter = both.plant, both.exciter
    else:
        plant, exciter = in_real_time(programs, scenario, path)
    assert (plant["outcome"], exciter["outcome"]) == ("disarmed", "finished")
    torques = abs(Recording.whole(path).states[:, 4:6]).max(axis=0)
    assert torques.tolist() == pytest.approx([20.0, 10.0], rel=0.05)
    assert "identical" in run(RESONARM, "resim", path)


def test_in_lockstep_the_dbc_gives_the_bits_of_a_free_run(tmp_path):
    scenario = own_protocol(tmp_path)
    lockstep = session(tmp_path, "vcan0", "vcan0", scenario)
    assert (lockstep.plant["outcome"], lockstep.exciter["outcome"]) == ("disarmed", "finished")
    assert (lockstep.plant["bus"]["refused"], lockstep.exciter["bus"]["refused"]) == (0, 0)
    assert (lockstep.exciter["samples_played"], lockstep.exciter["missed_samples"]) == (401, 0)
    assert "identical" in run(RESONARM, "resim", lockstep.path)
    in_one_loop = free(tmp_path, scenario)
    assert "identical" in run(RESONARM, "resim", in_one_loop.path)
    assert np.array_equal(bits(lockstep.recording.states[:400]), bits(in_one_loop.recording.states[:400]))
    forces = lockstep.recording.states[:400, 6]
    asked = [20.0 * math.sin(2 * math.pi * 20.0 * index / 1000) for index in range(400)]
    # The profile fades in and out.
    assert max(abs(forces - asked)[100:300]) <= 0.01 + 1e-9


def test_in_real_time_by_the_dbc(programs, tmp_path):
    path = tmp_path / "run.mcap"
    plant, exciter = in_real_time(programs, own_protocol(tmp_path), path)
    assert (plant["outcome"], exciter["outcome"], plant["bus"]["refused"]) == ("disarmed", "finished", 0)
    assert abs(Recording.whole(path).states[:, 6]).max() == pytest.approx(20.0, abs=0.5)
    assert "identical" in run(RESONARM, "resim", path)


@pytest.mark.parametrize("lockstep", ["", 'lockstep = "command"'])
def test_two_axes_of_odrive(programs, tmp_path, lockstep):
    both_torques_act(programs, tmp_path, odrive(tmp_path, lockstep), in_lockstep=bool(lockstep))


@pytest.mark.parametrize("in_lockstep", [False, True])
def test_canopen_drives(programs, tmp_path, in_lockstep):
    text = (EXAMPLES / "canopen" / "drives.toml").read_text().replace("timeout_s = 0.5", "timeout_s = 5.0")
    scenario = write(tmp_path, PATIENT + text + EXCITATION.format(load="joint1 = 20.0, joint2 = 10.0"))
    both_torques_act(programs, tmp_path, scenario, in_lockstep)


class Spring:
    """Somebody's plant: a mass of 1 g that follows the force at once, by python-can and cantools, which answers each
    command with a reading."""

    def __init__(self, bus, controller):
        self.bus, self.controller = bus, controller
        self.state, self.sample, self.forces, self.is_over = 1, 0, [], threading.Event()

    def read(self, frame):
        """Takes a command."""
        drive = self.controller.DRIVE.decode(frame.data, decode_choices=False)
        assert self.controller.crc8(self.controller.DRIVE_ID, frame.data) == frame.data[7]
        if drive["Enable"] == 1:
            self.state = 2
            self.forces.append(drive["Force"])
        elif self.state == 2:
            self.state = 1
            self.is_over.set()

    def send(self):
        force_n = self.forces[-1] if self.forces else 0.0
        values = {"AccX": force_n / 10, "AccY": 0.0, "State": self.state, "Reason": 0, "Sample": self.sample % 256}
        meas = self.controller.MEAS
        payload = bytearray(meas.encode(values | {"Alive": self.sample % 15, "Crc": 0}))
        payload[7] = self.controller.crc8(self.controller.MEAS_ID, payload)
        self.sample += 1
        self.bus.send(can.Message(arbitration_id=meas.frame_id, data=payload, is_extended_id=False))

    def work(self):
        while not self.is_over.is_set():
            while (frame := self.bus.recv(0.0)) is not None:
                if frame.arbitration_id == self.controller.DRIVE.frame_id:
                    self.read(frame)
            self.send()
            self.is_over.wait(0.01)
        self.send()


def test_a_plant_that_knows_nothing_of_resonarm(programs, controller, tmp_path):
    scenario = own_protocol(tmp_path)
    scenario.write_text(scenario.read_text() + "[simulation]\nrate_hz = 100\n")
    text = scenario.read_text().replace("[simulation]\nrate_hz = 1000\n", "")
    scenario.write_text(text.replace('message = "Meas"\n', 'message = "Meas"\nevery = 1\n'))
    with can.Bus(interface="socketcan", channel="vcan0", fd=True) as bus:
        plant = Spring(bus, controller)
        thread = threading.Thread(target=plant.work)
        thread.start()
        exciter = programs.resonarm("exciter", "--bus", "vcan0", "--scenario", scenario, "--json")
        code = exciter.wait()
        plant.is_over.set()
        thread.join()
    report = json.loads(exciter.stdout)
    assert (code, report["outcome"], report["bus"]["refused"]) == (0, "finished", 0), exciter.stderr
    assert report["samples_played"] == 41
    assert max(plant.forces) == pytest.approx(20.0, abs=2.0) and plant.state == 1
