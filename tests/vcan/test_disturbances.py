"""A run must survive garbage, floods, and an interface that goes away."""

import random
import socket
import struct

import numpy as np
import pytest
import wire
from conftest import SCENARIOS
from e2e.p11 import e2e_p11_protect
from processes import run, wait_until
from recordings import Recording, bits

CAN_RAW_FD_FRAMES = 5
SCENARIO = """
[excitation]
amplitude = { exciter_x = 50.0 }
ramp_s = 0.2
profile = { waveform = "dwell", frequency_hz = 18.0, duration_s = 2.0, settle_s = 0.2 }
"""


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_text(SCENARIO)
    return path


class Intruder:
    """Sends frames byte by byte as it likes."""

    def __init__(self, interface):
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1)
        self.socket.bind((interface,))

    def send(self, identifier, data):
        self.socket.send(struct.pack("=IB3x8s", identifier, len(data), bytes(data)))

    def send_fd(self, identifier, data):
        self.socket.send(struct.pack("=IBB2x64s", identifier, len(data), 1, bytes(data)))


def garbage(dice):
    """Frames that the plant must reject: on identifiers of the exciter's messages, wrong in one thing each."""
    force = wire.DBC.get_message_by_name("ForceCommand").frame_id
    for _ in range(200):
        content = bytearray(dice.randbytes(8))
        e2e_p11_protect(content, 0x5202)
        flipped = bytearray(content)
        flipped[dice.randrange(1, 8)] ^= 1 << dice.randrange(8)
        yield force, flipped
        yield force, content[: dice.randrange(8)]
        yield force, bytes([content[0], content[1] | 0x0F]) + content[2:]
        yield 0x702, dice.randbytes(8)
        yield 0x702, [dice.choice([1, 2, 3, 6, 126, 128, 255])]


def run_both(programs, tmp_path, scenario, interface="vcan0"):
    path = tmp_path / "run.mcap"
    common = ["--bus", interface, "--mode", "lockstep", "--scenario", scenario, "--json"]
    plant = programs.resonarm("run", *common, "--stop-on-disarm", "--record", path)
    exciter = programs.resonarm("exciter", *common)
    return plant, exciter, path


@pytest.fixture
def undisturbed(programs, tmp_path, scenario):
    path = tmp_path / "undisturbed.mcap"
    programs.resonarm("run", "--mode", "free", "--scenario", scenario, "--record", path, "--json").result()
    return Recording.whole(path)


def test_garbage_is_refused_and_counted_and_changes_nothing(programs, tmp_path, scenario, undisturbed):
    intruder = Intruder("vcan0")
    refused = list(garbage(random.Random(1)))
    dump = programs.candump()
    plant, exciter, path = run_both(programs, tmp_path, scenario)
    wait_until(lambda: " vcan0 201#" in dump.stdout, "commands")
    for identifier, data in refused:
        intruder.send(identifier, data)
    for fd in (0x201, 0x205, 0x702):
        intruder.send_fd(fd, bytes(64))
    assert exciter.result()["outcome"] == "finished"
    ended = plant.result()
    recording = Recording.whole(path)
    # Frames of CAN FD on identifiers of the protocol are refused too; that of 0x205 is of the plant itself, but not
    # from it.
    assert ended["bus"]["refused"] == len(refused) + 3
    assert [event.name for event in recording.topics["/events"]].count("state.fault") == 0
    assert np.array_equal(bits(recording.states), bits(undisturbed.states))


def test_a_flood_of_foreign_frames_changes_nothing(programs, tmp_path, scenario, undisturbed):
    plant, exciter, path = run_both(programs, tmp_path, scenario)
    # As fast as a wire of 1 Mbit/s could carry them beside a run, not as fast as a virtual one, which loses frames
    # then.
    flood = programs.start("cangen", "cangen", "vcan0", "-g", "0.25", "-n", "4000", "-I", "123", "-L", "8")
    assert exciter.result()["outcome"] == "finished"
    assert flood.wait() == 0
    ended = plant.result()
    recording = Recording.whole(path)
    assert ended["bus"]["refused"] == 0
    assert len(recording.frames_of(1, 0x123)) + ended["bus"]["dropped"] > 100
    assert np.array_equal(bits(recording.states), bits(undisturbed.states))


def test_cansend_of_nonsense_to_an_idle_plant(programs):
    plant = programs.resonarm("run", "--bus", "vcan0", "--rate-hz", 100, "--json")
    dump = programs.candump()
    wait_until(lambda: " vcan0 205#" in dump.stdout, "samples")
    of_the_protocol = ("201#", "200#00", "200#FFFFFFFFFFFFFFFF", "207#0102030405060708")
    for frame in (*of_the_protocol, "7DF#020105", "123#R8", "12345678#00"):
        run("cansend", "vcan0", frame)
    wait_until(lambda: " vcan0 12345678#00" in dump.stdout, "the last of the nonsense")
    assert plant.stop() == 0
    assert plant.result()["bus"]["refused"] == 4
    assert " vcan0 701#05" not in dump.stdout


@pytest.mark.parametrize("mode", ["real-time", "lockstep"])
def test_an_interface_that_goes_down_ends_the_run_with_a_whole_recording(programs, tmp_path, interface, mode):
    path, scenario = tmp_path / "run.mcap", tmp_path / "patient.toml"
    # Stalls of the machine are not tested here.
    patient = (SCENARIOS / "bench.toml").read_text().replace("[network]\n", "[network]\ncommand_timeout_s = 5.0\n")
    scenario.write_text(patient)
    common = ["--bus", interface, "--mode", mode, "--rate-hz", 100, "--scenario", scenario]
    plant = programs.resonarm("run", *common, "--record", path, "--json")
    exciter = programs.resonarm("exciter", *common, "--json")
    dump = programs.candump(interface)
    wait_until(lambda: dump.stdout.count(f" {interface} 205#") > 20, "samples")
    run("ip", "link", "set", interface, "down")
    ended = plant.result(code=3)
    assert f"{interface} is down. Bring it up with `sudo ip link set {interface} up`" in plant.stderr
    code = exciter.wait()
    assert code == 3, (exciter.stdout, exciter.stderr)
    assert f"{interface} is down" in exciter.stderr
    recording = Recording.whole(path)
    assert len(recording.frames) == ended["bus"]["sent"] + ended["bus"]["received"]
    assert programs.resonarm("inspect", path).wait() == 0
    assert programs.resonarm("resim", path, "--json").result()["identical"]


def test_a_missing_interface_is_said(programs):
    plant = programs.resonarm("run", "--bus", "vcan9", "--mode", "lockstep")
    assert plant.wait() == 3
    assert "the CAN interface vcan9 does not exist (CAN interfaces: vcan0, vcan1)" in plant.stderr
    assert "Create it with `sudo ip link add vcan9 type vcan && sudo ip link set vcan9 mtu 72 up`" in plant.stderr
