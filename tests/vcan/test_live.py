"""Plant and exciter as two processes on a real CAN interface, each with a live view: watched, steered, faulted."""

import json
import struct

import numpy as np
import pytest
from conftest import SCENARIOS
from foxglove_schemas import decoders
from live_view import OPEN, Viewer, address
from processes import PATIENCE_S
from recordings import RECEIVED, SENT, unpacked
from websockets.sync.client import connect

COMMON = ("--mode", "lockstep", "--live", "--scenario")


@pytest.fixture
def bench(tmp_path):
    """The bench with so small a range for C that its accelerometer clips."""
    ranges = (SCENARIOS / "bench.toml").read_text().split("[rig.sensors.c]\nrange_m_s2 = 490.0")
    assert len(ranges) == 2
    scenario = tmp_path / "bench.toml"
    scenario.write_text("[rig.sensors.c]\nrange_m_s2 = 0.2".join(ranges))
    return scenario


@pytest.fixture
def plant(programs, bench):
    started = programs.resonarm("run", "--bus", "vcan0", "--speed", 1, *COMMON, bench)
    return started, Viewer(*address(started))


def exciter(programs, bench):
    started = programs.resonarm("exciter", "--bus", "vcan0", "--steer", *COMMON, bench)
    return started, Viewer(*address(started))


def test_a_set_point_of_the_exciter_s_page_moves_the_plant_and_the_plant_s_page_disarms(programs, plant, bench):
    plant, plant_view = plant
    exciter_end, exciter_view = exciter(programs, bench)
    assert (plant_view.about["role"], plant_view.about["place"]) == ("plant", "vcan0")
    assert plant_view.about["actions"] == ["arm", "disarm", "reset"]
    assert exciter_view.about["actions"] == ["disarm", "set"]
    for view in (plant_view, exciter_view):
        view.next("state", lambda message: message["state"] == "operational")
    assert exciter_view.ask({"set": {"load": 30, "frequency_hz": 16, "phase_deg": 0}}) == {"kind": "taken"}
    # The load as the exciter commands it; it knows no angles. In the plant's head what was commanded, and the angles.
    commanded = exciter_view.next("update", lambda message: np.any(message["largest"][:, 2] > 29.5))
    assert np.isnan(commanded["largest"][:, 10:]).all()
    acting = plant_view.next("update", lambda message: np.any(message["largest"][:, 4] > 29.5))["largest"]
    # After a stall an update begins before the force does.
    assert np.all(np.abs(acting[acting[:, 4] > 29.5, 10]) > 1e-6)
    point = exciter_view.next("response")
    assert point["frequency_hz"] == 16 and abs(point["load"] - 30) < 0.1
    # Both axes of C clip, which the frames to the exciter state; those of B don't.
    assert point["clipped"] == [True, True, False, False]
    c_x, c_y = (1 << exciter_view.about["clipped_bits"].index(f"acceleration_c_{axis}_m_s2") for axis in "xy")
    for view in (plant_view, exciter_view):
        seen = 0
        while seen != c_x | c_y:
            for bits in view.next("update")["stretches_clipped"]:
                seen |= bits
                assert bits & ~(c_x | c_y) == 0
    assert plant_view.ask("disarm") == {"kind": "taken"}
    plant_view.next("event", lambda message: message["name"] == "request.disarm")
    plant_view.next("state", lambda message: message["state"] == "pre-operational")
    assert exciter_end.wait() == 0
    assert plant.running() and plant.stop() == 0


def test_a_plant_whose_exciter_died_faults_is_reset_and_not_armed_without_one(programs, plant, bench):
    _, view = plant
    exciter_end, exciter_view = exciter(programs, bench)
    view.next("state", lambda message: message["state"] == "operational")
    assert exciter_view.ask({"set": {"load": 10, "frequency_hz": 16, "phase_deg": 0}}) == {"kind": "taken"}
    view.next("update", lambda message: np.any(message["largest"][:, 4] > 2))
    exciter_end.kill()
    fault = view.next("state", lambda message: message["state"] == "fault")
    assert fault["fault"]
    assert view.ask("arm") == {"kind": "taken"}
    view.next("event", lambda message: message["name"] == "request.arm")
    assert view.ask("reset") == {"kind": "taken"}
    view.next("state", lambda message: message["state"] == "pre-operational")
    # Another exciter finds a plant that can be armed.
    exciter(programs, bench)
    view.next("state", lambda message: message["state"] == "operational")


def foxglove_messages(program):
    """Topics and decoded messages that a Foxglove WebSocket client gets that subscribes to everything."""
    url = address(program)[0].replace("http:", "ws:")
    with connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None, **OPEN) as client:
        assert json.loads(client.recv(PATIENCE_S))["op"] == "serverInfo"
        channels = {channel["id"]: channel for channel in json.loads(client.recv(PATIENCE_S))["channels"]}
        decode = decoders(channels.values())
        wanted = [{"id": number, "channelId": number} for number in channels]
        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        while True:
            operation, number, _ = struct.unpack_from("<BIQ", message := client.recv(PATIENCE_S))
            assert operation == 1
            topic = channels[number]["topic"]
            yield topic, decode[topic](message[13:])


def test_an_exciter_streams_what_it_sees_and_commands(programs, plant, bench):
    exciter_end, _ = exciter(programs, bench)
    samples, commands, frames = [], [], []
    for topic, message in foxglove_messages(exciter_end):
        assert topic in {"/plant/samples", "/plant/sensors", "/plant/command", "/can/frames", "/events"}
        if topic == "/plant/samples":
            samples += range(message.first_step, message.first_step + len(message.head_force_x_n))
        elif topic == "/plant/command":
            commands.append(message.step)
        elif topic == "/can/frames":
            assert message.interface == "vcan0"
            frames += unpacked(message)
        if len(samples) > 500 and len(commands) > 50 and len(frames) > 2000:
            break
    # Every sample, of the commands one of ten; the frames of the samples received, and those of the answers sent.
    assert samples == list(range(samples[0], samples[0] + len(samples)))
    assert commands == list(range(commands[0], commands[0] + 10 * len(commands), 10))
    ids = {way: {frame.id for frame in frames if frame.direction == way} for way in (RECEIVED, SENT)}
    assert ids[RECEIVED] >= {0x203, 0x204, 0x205} and not ids[RECEIVED] & ids[SENT]
    assert ids[SENT] & {0x201, 0x202}
