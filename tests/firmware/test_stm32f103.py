"""The exciter's node in C and in Rust on an emulated STM32F103 shakes the plant in lockstep, over a serial line as CAN
adapters have it (slcan): no kernel's CAN is needed. While the plant's answer is awaited the controller's time stands
still, so that it does not matter how fast either of them is. Arbitration, bus off and the time on the wire are not
emulated."""

import os
import struct
import subprocess
from pathlib import Path

import can
import labwired
import numpy as np
import pytest
from processes import PATIENCE_S, Programs
from recordings import Recording, bits
from shaker import SHAKER, fundamental

# Where the makefile puts them.
BUILD = Path(os.environ.get("RESONARM_FIRMWARE", "firmware-protocol/c/build"))
SYSTEM = Path(__file__).with_name("stm32f103.yaml")
# The other end may be slow: the plant waits, by the clock, as long as a program that hangs is waited for.
PATIENT = f"""
[network]
lockstep_timeout_s = {PATIENCE_S}.0
[structure]
angles_deg = [30.0, 60.0]
"""
# The sines of the port's main.c and of the firmware in Rust.
SINES = """
[excitation]
amplitude = { exciter_x = 150.0 }
ramp_s = 0.2
profile = { waveform = "sine-list", frequencies_hz = [19.7, 26.0], dwell_s = 0.4, settle_s = 0.1 }
"""
FORCE_COMMAND, IMPEDANCE_HEAD, ACCELEROMETER_C, EXCITER_EMERGENCY = 0x201, 0x203, 0x205, 0x082
PLANT_HEARTBEAT, EXCITER_HEARTBEAT = 0x701, 0x702
# Faults of a Cortex-M3 (Configurable Fault Status Register), and frames in bxCAN's FIFO 0.
CFSR, CAN_RF0R = 0xE000ED28, 0x4000640C
STEP = "20us"
# The settings in the port's held_spec.h, and a count of forces in the classic profile.
HELD_N, HELD_HZ, HEAD_N = 20.0, 45.0, 0.02
# The longest silence of a firmware that lives: a heartbeat's period, and half of one.
SILENCE_S = 0.15


class Firmware:
    """A controller on an emulated processor; `CFSR` shows in a failure whether it has trapped."""

    def __init__(self, sim):
        self.sim, self.spoken_s = sim, 0.0

    def step(self):
        """Runs for a short time; returns the frames it sent."""
        self.sim.run_for(STEP)
        frames = [frame["payload"] for frame in self.sim.frames()]
        sent = [frame for frame in frames if frame["direction"] == "tx"]
        if sent:
            self.spoken_s = self.sim.time
        silence_s = self.sim.time - self.spoken_s
        assert silence_s < SILENCE_S, f"no frame for {silence_s} s, CFSR {self.sim.read_u32(CFSR):#x}"
        return [can.Message(arbitration_id=frame["id"], data=frame["data"], is_extended_id=False) for frame in sent]

    def has_room(self):
        """Whether all frames were taken out of the FIFO."""
        return self.sim.read_u32(CAN_RF0R) & 3 == 0

    def take(self, message):
        self.sim.inject_can("bxcan1", message.arbitration_id, message.data)


def carry(bus, firmware):
    """Carries frames between plant and controller until the controller has left: what each has sent. While the plant
    owes a sample, the controller is stepped for the frames alone that come."""
    is_plants_turn, heard, sent = False, [], []
    while not (sent and sent[-1].arbitration_id == EXCITER_EMERGENCY):
        message = bus.recv(PATIENCE_S if is_plants_turn else 0) if firmware.has_room() else None
        if message is not None:
            firmware.take(message)
            heard.append(message)
            # Of a plant that is no longer armed no sample need come.
            is_plants_turn &= message.arbitration_id not in (ACCELEROMETER_C, PLANT_HEARTBEAT)
        for answer in firmware.step():
            bus.send(answer)
            sent.append(answer)
            is_plants_turn |= answer.arbitration_id == FORCE_COMMAND
    return heard, sent


@pytest.fixture
def programs():
    with Programs() as programs:
        yield programs


@pytest.fixture
def null_modem(tmp_path, programs):
    return programs.null_modem(tmp_path)


@pytest.fixture
def firmware(request):
    with labwired.Sim(str(BUILD / request.param), system=SYSTEM) as sim:
        yield Firmware(sim)


on = pytest.mark.parametrize("firmware", ["stm32f103.elf", "stm32f103-rust.elf"], indirect=True)
holding = pytest.mark.parametrize("firmware", ["stm32f103-held.elf"], indirect=True)


def drive(programs, null_modem, scenario, recording, firmware):
    """A plant that the firmware drives until it leaves; the plant's program, and the frames that both have sent."""
    bus = [f"python-can:interface=slcan,channel={null_modem[0]},bitrate=1000000,sleep_after_open=0", "--stop-on-disarm"]
    lockstep = ["--mode", "lockstep", "--scenario", scenario, "--record", recording, "--json"]
    plant = programs.resonarm("run", "--bus", *bus, *lockstep)
    with can.Bus(interface="slcan", channel=str(null_modem[1]), bitrate=1000000, sleep_after_open=0) as bus:
        return plant, *carry(bus, firmware)


def states(sent):
    """The states in the controller's heartbeats, each change once."""
    states = [message.data[0] for message in sent if message.arbitration_id == EXCITER_HEARTBEAT]
    return [state for state, before in zip(states, [None, *states], strict=False) if state != before]


@on
def test_it_gives_the_states_of_the_emulated_controller_bit_for_bit(tmp_path, programs, null_modem, firmware):
    scenario = tmp_path / "sines.toml"
    scenario.write_text(PATIENT + SINES)
    record = ["--record", tmp_path / "free.mcap", "--json"]
    free = programs.resonarm("run", "--mode", "free", "--scenario", scenario, *record)
    plant, _, sent = drive(programs, null_modem, scenario, tmp_path / "stm32.mcap", firmware)
    assert states(sent) == [0, 127, 5, 127]
    assert plant.result()["outcome"] == free.result()["outcome"] == "disarmed"
    stm32, rust = (Recording.whole(tmp_path / f"{name}.mcap") for name in ("stm32", "free"))
    assert len(rust.states) > 800 and np.abs(rust.states).max(axis=0)[:4].min() > 1e-4
    assert np.array_equal(bits(stm32.states), bits(rust.states))
    assert np.array_equal(bits(stm32.samples), bits(rust.samples))


def signals(messages, identifier):
    """The counts along x, and the index of the sample, of the commands or of the head's messages."""
    found = [message.data for message in messages if message.arbitration_id == identifier]
    return np.array([(*struct.unpack("<h2xH", data[2:8]),) for data in found])


@holding
def test_it_holds_the_force_by_the_commands_that_the_same_controller_makes_here(
    tmp_path, programs, null_modem, firmware
):
    scenario = tmp_path / "shaker.toml"
    scenario.write_text(PATIENT + SHAKER.format(stroke_m=0.0127))
    plant, heard, sent = drive(programs, null_modem, scenario, tmp_path / "held.mcap", firmware)
    assert plant.result()["outcome"] == "disarmed"
    assert states(sent) == [0, 127, 5, 127]
    commands, head = signals(sent, FORCE_COMMAND), signals(heard, IMPEDANCE_HEAD)
    assert np.array_equal(head[: len(commands), 1], commands[:, 1])
    forces_n = head[: len(commands) + 1, 0] * HEAD_N
    text = "".join(f"{force_n!r}\n" for force_n in forces_n.tolist())
    here = subprocess.run([BUILD / "held_answers"], input=text, capture_output=True, text=True, check=True)
    *answers, end, point = here.stdout.splitlines()
    # In counts, as they are sent: to the nearest, ties to even.
    held = [round(float(answer.removeprefix("hold ")) / HEAD_N) for answer in answers]
    assert held == commands[:, 0].tolist() and end == "finish"
    command_n, force_n, tries, first, after = map(float, point.removeprefix("point ").split())
    assert abs(command_n / HELD_N - 1) > 0.02 and tries > 1, "the command is not the force: it had to be found"
    assert fundamental(forces_n[int(first) : int(after)], 1000.0, HELD_HZ) == pytest.approx(HELD_N, rel=0.005)
    assert force_n == pytest.approx(HELD_N, rel=0.003)


@on
def test_a_fault_of_the_plant_ends_it(tmp_path, programs, null_modem, firmware):
    scenario = tmp_path / "trips.toml"
    scenario.write_text(PATIENT + SHAKER.format(stroke_m=1e-6))
    plant, _, sent = drive(programs, null_modem, scenario, tmp_path / "trips.mcap", firmware)
    assert states(sent) == [0, 127, 5, 4]
    assert plant.result(code=1)["fault"]["code"] == 14
