"""One end of a run in real time is stopped for 300 ms by SIGSTOP, as a busy machine may do: SPEC.md, sections 6 and
8."""

import json
import signal
import time

import numpy as np
from processes import wait_until
from recordings import Recording

RATE_HZ = 200
STALL_S = 0.3
COMMAND_TIMEOUT_S, FORCE_RAMP_S = 0.020, 0.050

# A machine that runs this may hold up either end for more than 20 ms by itself, so the timeout is longer where a fault
# does not belong to the test.
SCENARIO = f"""
[simulation]
rate_hz = {RATE_HZ}
[network]
command_timeout_s = %s
[excitation]
amplitude = {{ exciter_x = 50.0 }}
ramp_s = 0.1
profile = {{ waveform = "dwell", frequency_hz = 15.0, duration_s = 3, settle_s = 0.2 }}
"""


def stop(program):
    """Stops a program for at least STALL_S, whatever else the machine does."""
    program.process.send_signal(signal.SIGSTOP)
    time.sleep(STALL_S)
    program.process.send_signal(signal.SIGCONT)


def both(programs, folder, timeout_s, *exciter_flags):
    scenario, path = folder / "scenario.toml", folder / "run.mcap"
    scenario.write_text(SCENARIO % timeout_s)
    common = ["--bus", "vcan0", "--scenario", scenario, "--json"]
    plant = programs.resonarm("run", *common, "--json-events", "--record", path)
    exciter = programs.resonarm("exciter", *common, *exciter_flags)
    return plant, exciter, path


def events(plant, name):
    lines = [line for line in plant.stderr.splitlines() if line.startswith("{")]
    return [event for event in map(json.loads, lines) if event["event"] == name]


def test_a_plant_that_was_stopped_faults_nobody(programs, tmp_path):
    plant, exciter, path = both(programs, tmp_path, 0.5)
    dump = programs.candump()
    wait_until(lambda: dump.stdout.count(" vcan0 201#") > 100, "100 commands")
    stop(plant)
    assert exciter.result()["outcome"] == "finished"
    assert plant.stop() == 0
    ended, recording = plant.result(), Recording.whole(path)
    assert ended["fault"] is None and events(plant, "faulted") == []
    # Every deadline that passed in the stall is an overrun, and the schedule moved; the controller was notified.
    assert ended["overruns"] >= ended["slipped"] >= (STALL_S - 0.01) * RATE_HZ - 1
    assert recording.column("/timing/ticks", ["overruns"]).sum() == ended["overruns"]
    assert sum(ended["overrun_causes"].values()) == ended["overruns"]
    assert exciter.result()["slipped_periods"] >= (STALL_S - 0.01) * RATE_HZ - 1
    assert sum(event["periods"] for event in events(plant, "slipped")) == ended["slipped"]
    assert programs.resonarm("resim", path, "--json").result()["identical"]


def test_a_controller_that_was_stopped_is_a_fault_and_arms_again(programs, tmp_path):
    # Each stall of the machine's own is one more fault, after which the controller arms again, too.
    plant, exciter, path = both(programs, tmp_path, COMMAND_TIMEOUT_S, "--rearm", 50)
    dump = programs.candump()
    wait_until(lambda: dump.stdout.count(" vcan0 201#") > 100, "100 commands")
    stop(exciter)
    ended = exciter.result()
    assert ended["outcome"] == "finished" and ended["rearmed"] >= 1
    assert plant.stop() == 0
    faults = events(plant, "faulted")
    assert faults and {fault["fault"]["code"] for fault in faults} <= {1, 4}
    assert faults[0]["fault"]["code"] == 1 and plant.result()["fault"] is None
    assert len(events(plant, "armed")) == ended["rearmed"] + 1
    # In simulated time: from the last accepted command to zero force within timeout, ramp and one sample period.
    recording = Recording.whole(path)
    force_n = recording.states[:, 6]
    for fault in recording.topics["/events"]:
        if fault.name == "state.fault":
            zero = fault.step + int(FORCE_RAMP_S * RATE_HZ)
            assert not force_n[zero : zero + 5].any(), "the ramp is over, and nothing is armed so soon"
    assert programs.resonarm("resim", path, "--json").result()["identical"]


def test_hangup_disarms_and_leaves_a_whole_recording(programs, tmp_path):
    plant, exciter, path = both(programs, tmp_path, 0.5)
    dump = programs.candump()
    wait_until(lambda: dump.stdout.count(" vcan0 201#") > 100, "100 commands")
    plant.process.send_signal(signal.SIGHUP)
    assert plant.wait() == 0 and plant.result()["outcome"] == "stopped"
    assert exciter.result(code=1)["outcome"] == "plant-left"
    force_n = Recording.whole(path).states[:, 6]
    # It ramped, by at most a tenth of the amplitude a sample beyond what the excitation does.
    assert np.abs(force_n).max() > 40 and force_n[-1] == 0
