"""An interface that goes down and up again, and a controller that reports errors, while plant and exciter work."""

import json
import socket
import struct

import pytest
from processes import PATIENCE_S, run, wait_until
from recordings import Recording

BUS_LOSS = 9
# Error frames of `linux/can/error.h`: the flag, classes, and the bits of the byte for the controller's state.
ERROR_FLAG = 0x2000_0000
CONTROLLER, PROTOCOL, NO_ACK, BUS_OFF, RESTARTED = 0x004, 0x008, 0x020, 0x040, 0x100
TX_WARNING, TX_PASSIVE, ACTIVE = 0x08, 0x20, 0x40
COMMAND_ID = 0x201

# Timeouts longer than anything that a busy machine does to either end, so that only what is tested makes a fault.
SCENARIO = """
[simulation]
rate_hz = 100
[network]
command_timeout_s = 20.0
partner_timeout_s = 30.0
lockstep_timeout_s = 30.0
[excitation]
amplitude = { exciter_x = 50.0 }
ramp_s = 0.1
profile = { waveform = "dwell", frequency_hz = 11.3, duration_s = %s, settle_s = 0.1 }
"""


class Wire:
    """A raw socket on an interface."""

    def __init__(self, interface):
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        only = struct.pack("=II", COMMAND_ID, socket.CAN_SFF_MASK)
        self.socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, only)
        self.socket.bind((interface,))
        self.socket.settimeout(PATIENCE_S)

    def commands(self, count):
        """Waits for so many commands of the exciter."""
        for _ in range(count):
            self.socket.recv(16)

    def error(self, classes, controller=0):
        """Sends a controller's error frame: the kernel passes it to every socket that asked for the class."""
        self.socket.send(struct.pack("=IB3x8s", ERROR_FLAG | classes, 8, bytes([0, controller])))


@pytest.fixture
def wire(interface):
    return Wire(interface)


def events_of(plant):
    """The events of a plant with `--json-events` so far, each with its state or code if it has one."""
    events = [json.loads(line) for line in plant.stderr.splitlines() if line.startswith("{")]
    return [(e["event"], e.get("state") or e.get("fault", {}).get("code")) for e in events if e["event"] != "slipped"]


def start(programs, tmp_path, bus, mode, duration_s, *pace, rearm=1):
    """Plant and exciter."""
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO % duration_s)
    common = ["--bus", bus, "--mode", mode, "--scenario", scenario, "--json"]
    plant = programs.resonarm("run", *common, "--json-events", "--record", tmp_path / "run.mcap", *pace)
    wait_until(lambda: events_of(plant), "the plant")
    return plant, programs.resonarm("exciter", *common, "--rearm", rearm)


# Paced in lockstep, or the excitation would be over before the interface is down.
@pytest.mark.parametrize("mode, pace", [("real-time", []), ("lockstep", ["--speed", 1])], ids=["real-time", "lockstep"])
def test_both_ends_outlive_an_interface_that_goes_down_and_up(programs, tmp_path, interface, wire, mode, pace):
    plant, exciter = start(programs, tmp_path, interface, mode, 4.0, *pace)
    wire.commands(20)
    run("ip", "link", "set", interface, "down")
    wait_until(lambda: ("faulted", BUS_LOSS) in events_of(plant), "the plant to fault")
    run("ip", "link", "set", interface, "up")
    played = exciter.result()
    assert (played["outcome"], played["samples_played"], played["rearmed"]) == ("finished", 401, 1), played
    assert plant.stop() == 0, plant.stderr
    assert plant.result()["fault"] is None
    names = [name for name, _ in events_of(plant)]
    for name, count in (("armed", 2), ("bus-lost", 1), ("faulted", 1), ("bus-back", 1), ("disarmed", 1)):
        assert names.count(name) == count, names
    recording = Recording.whole(tmp_path / "run.mcap")
    # In this order; between samples that were late together no sample need lie.
    names = [event.name for event in recording.topics["/events"]]
    back = names.index("bus.back", names.index("bus.lost"))
    assert "state.operational" in names[back:], names


@pytest.mark.parametrize("bus", ["%s", "python-can:interface=socketcan,channel=%s"], ids=["native", "python-can"])
def test_a_plant_continues_and_says_so_while_its_controller_reports_errors(programs, tmp_path, interface, wire, bus):
    plant, exciter = start(programs, tmp_path, bus % interface, "real-time", 60.0, rearm=0)
    wire.commands(20)
    states = [(TX_WARNING, "error-warning"), (TX_PASSIVE, "error-passive"), (ACTIVE, "error-active")]
    for byte, state in states:
        wire.error(CONTROLLER | PROTOCOL | NO_ACK, byte)
        wait_until(lambda state=state: events_of(plant)[-1] == ("controller", state), state)
        # It still takes commands.
        wire.commands(20)
    assert [name for name, _ in events_of(plant)] == ["ready", "armed", *["controller"] * 3]
    wire.error(BUS_OFF)
    wait_until(lambda: ("faulted", BUS_LOSS) in events_of(plant), "the plant to fault")
    assert ("controller", "bus-off") in events_of(plant)
    wire.error(RESTARTED)
    # The bus is back with the next frame that is sent.
    wait_until(lambda: events_of(plant).count(("controller", "error-active")) == 2, "the restart")
    played = exciter.result(code=1)
    assert played["outcome"] == "faulted" and played["bus"]["errors"]["bus_off"] == 1, played
    assert plant.stop() == 1, "faulted"
    once = {"warning": 1, "passive": 1, "bus_off": 1, "restarted": 1}
    counted = {"protocol": 3, "no_ack": 3, "overflow": 0, **once, "other": 0}
    assert plant.result(code=1)["bus"]["errors"] == counted
    recording = Recording.whole(tmp_path / "run.mcap")
    names = ["bus.error_warning", "bus.error_passive", "bus.error_active", "bus.off", "bus.error_active"]
    step = -1
    for name in names:
        step = recording.event(name, after=step).step
