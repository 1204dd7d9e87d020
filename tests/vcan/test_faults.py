"""What happens when one end of a run in real time is killed: SPEC.md, section 8, and the recording up to its last
flush."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import wire
from processes import Programs, wait_until
from recordings import RECEIVED, Recording

RATE_HZ = 100
DT_S = 1 / RATE_HZ
FORCE_N = 100.0
# The timeout is longer than the 20 ms of the specification, which a virtual machine may hold a controller up for at any
# time.
COMMAND_TIMEOUT_S, FORCE_RAMP_S, FLUSH_S = 0.2, 0.050, 1.0
SCHEDULE_SLIPPED = 11
# Samples after the last controller.
QUIET = round(0.5 * FLUSH_S * RATE_HZ)
# How candump logs a heartbeat of the plant, and an acceleration of C, one a sample.
HEARTBEAT, READING = " vcan0 701#", " vcan0 205#"
# A controller that is held up for longer yet faults the plant, as it must, and the next one arms it again.
CONTROLLERS = 5

SCENARIO = f"""
[structure]
angles_deg = [30.0, 60.0]
[simulation]
rate_hz = {RATE_HZ}
[network]
command_timeout_s = {COMMAND_TIMEOUT_S}
[excitation]
amplitude = {{ exciter_x = {FORCE_N} }}
ramp_s = 0.1
profile = {{ waveform = "dwell", frequency_hz = 11.3, duration_s = %s, settle_s = 0.1 }}
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """A controller killed while it shakes the plant, further ones that shall finish, and the plant killed after
    them."""
    folder = tmp_path_factory.mktemp("killed")
    long, short = folder / "long.toml", folder / "short.toml"
    long.write_text(SCENARIO % 60)
    short.write_text(SCENARIO % 0.6)
    path = folder / "killed.mcap"
    with Programs() as programs:
        dump = programs.candump()
        plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", short, "--record", path)
        first = programs.resonarm("exciter", "--bus", "vcan0", "--scenario", long)
        wait_until(lambda: len(dump.stdout.split(" vcan0 201#")) > 60, "60 commands")
        first.kill()
        # Code 1 is in bytes 2 and 3. A plant that was held up has reported that before, by a notice with code 11.
        wait_until(lambda: re.search(r" vcan0 081#.{4}0100", dump.stdout), "the plant's emergency")
        # Three more heartbeats: the fault must stay in each, and the ramp, shorter than their cycle, is over by then.
        before = dump.stdout.count(HEARTBEAT)
        wait_until(lambda: dump.stdout.count(HEARTBEAT) >= before + 3, "three heartbeats")
        controllers = []
        while len(controllers) < CONTROLLERS and not (controllers and controllers[-1]["outcome"] == "finished"):
            exciter = programs.resonarm("exciter", "--bus", "vcan0", "--scenario", short, "--json")
            assert exciter.wait() in (0, 1), exciter.stderr
            controllers.append(json.loads(exciter.stdout))
        # What is left of the recording shall reach into the quiet after the last controller.
        quiet = dump.stdout.count(READING) + QUIET
        wait_until(lambda: len(Recording.cut_off(path).states) >= quiet, "a flush")
        assert plant.running()
        plant.kill()
        frames, recording = wire.log(dump), Recording.cut_off(path)
        return SimpleNamespace(path=path, frames=frames, controllers=controllers, recording=recording)


def test_the_force_is_zero_within_the_time_of_the_specification(killed):
    states, ticks = killed.recording.states, killed.recording.column("/timing/ticks", ["wakeup_ns"])[:, 0] * 1e-9
    fault = killed.recording.event("state.fault")
    # A frame is handled in the tick that ends its sample period. The last command before the fault is one that was
    # taken.
    taken = max(f.step for f in killed.recording.frames_of(RECEIVED, 0x201) if f.step < fault.step) + 1
    loads = np.abs(states[:, 4:]).max(axis=1)
    held = taken - 1 + np.flatnonzero(loads[taken - 1 :] == 0)[0]
    assert loads[taken - 1] > 0
    # Held from sample `held` on; its period ends with the tick after it. While a plant is held up its timeouts rest.
    assert (held - taken) * DT_S <= COMMAND_TIMEOUT_S + FORCE_RAMP_S + DT_S + ticks[taken : held + 1].max()
    # A ramp in equal steps down to zero, which then stays until the next controller.
    ramp = loads[fault.step - 1 : held + 1]
    assert np.allclose(np.diff(ramp), -ramp[0] * DT_S / FORCE_RAMP_S), ramp
    armed_again = killed.recording.event("state.operational", after=fault.step)
    assert armed_again.step > fault.step and not loads[held : armed_again.step].any()


def test_the_fault_latches_and_is_told(killed):
    times = [(frame.time_s, *wire.decode(frame)) for frame in killed.frames]
    emergencies = [(t, signals["code"]) for t, name, signals in times if name == "PlantEmergency"]
    # A plant that was held up reports that by a notice, which is no fault.
    at_s, code = next((t, code) for t, code in emergencies if code != SCHEDULE_SLIPPED)
    assert code == 1, "command timeout"
    reset_s = next(t for t, name, s in times if name == "OperatorCommand" and s["request"] == 3 and t > at_s)
    states = [s["state"] for t, name, s in times if name == "PlantHeartbeat" and at_s < t < reset_s]
    assert len(states) >= 3 and set(states) == {4}, states
    # It lives on: it measures and sends all the while, but for when it was held up itself; its index stands still then.
    sent = [(t, s["sample"]) for t, name, s in times if name == "AccelerometerC" and at_s < t < reset_s]
    times_s, indices = np.array(sent).T
    assert len(sent) >= 10 and np.all(np.diff(indices) == 1), indices
    gaps_s = np.diff(times_s)
    assert np.median(gaps_s) <= 1.25 * DT_S, gaps_s


def test_a_new_controller_arms_it_again_and_finishes(killed):
    assert killed.controllers[-1]["outcome"] == "finished", killed.controllers
    assert killed.controllers[-1]["samples_played"] == 0.6 * RATE_HZ + 1
    assert np.abs(killed.recording.states[-QUIET:, 4:]).max() == 0, "disarmed at the end"


def test_inspect_says_that_the_recording_is_truncated(killed, programs):
    inspect = programs.resonarm("inspect", killed.path, "--json")
    summary = inspect.result(code=1)
    assert summary["integrity"]["state"] == "truncated"
    assert summary["topics"]["/plant/steps"]["records"] == len(killed.recording.states)
    said = programs.resonarm("inspect", killed.path)
    assert said.wait() == 1 and "the recording is truncated: " in said.stdout


def test_a_killed_plant_loses_no_more_than_a_flush(killed):
    sent = len(wire.messages(killed.frames, "AccelerometerC"))
    assert sent - FLUSH_S * RATE_HZ <= len(killed.recording.states) <= sent + 1


def test_what_is_left_simulates_again_bit_for_bit(killed, programs):
    verdict = programs.resonarm("resim", killed.path, "--json").result(code=1)
    assert (verdict["identical"], verdict["integrity"]["state"]) == (True, "truncated")
    assert (verdict["samples"], verdict["first_divergence"]) == (len(killed.recording.states), None)


@pytest.mark.parametrize("mode", ["real-time", "lockstep"])
def test_a_plant_that_stops_on_disarm_ends_at_a_fault_and_says_it(programs, tmp_path, mode):
    scenario, path = tmp_path / "long.toml", tmp_path / "run.mcap"
    scenario.write_text(SCENARIO % 60)
    common = ["--bus", "vcan0", "--mode", mode, "--scenario", scenario]
    plant = programs.resonarm("run", *common, "--stop-on-disarm", "--record", path, "--json")
    dump = programs.candump()
    exciter = programs.resonarm("exciter", *common)
    wait_until(lambda: " vcan0 201#" in dump.stdout, "a command")
    exciter.kill()
    ended = plant.result(code=1)
    fault = ended["fault"]
    assert (ended["outcome"], fault["code"], fault["name"]) == ("faulted", 1, "command timeout"), ended
    assert "fault of the plant, code 1: no valid command in time" in plant.stderr, plant.stderr
    assert Recording.whole(path).event("state.fault")
