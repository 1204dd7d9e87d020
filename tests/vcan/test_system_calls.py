"""The real-time loop makes only the system calls that docs/real-time.md lists."""

import json
import re
import time
from collections import Counter
from pathlib import Path

import pytest
from processes import RESONARM

# How often a node sends a heartbeat, at least (firmware-protocol/SPEC.md).
HEARTBEAT_S = 0.1
DOCUMENTED = Path(__file__).parents[2] / "docs/real-time.md"

SCENARIO = """
simulation = { rate_hz = 200 }
network = { command_timeout_s = 10, partner_timeout_s = 30 }
[excitation]
amplitude = { exciter_x = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 1, settle_s = 0.2 }
"""


def documented():
    """The names in the table's column for SocketCAN."""
    table = DOCUMENTED.read_text().split("## System calls", 1)[1].split("\n## ", 1)[0]
    rows = re.findall(r"^\| .* \| yes \|$", table, re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`(\w+)`", row)}


def made_by_the_loop(trace):
    """The names of the calls of the loop's thread, from the first frames that it sends to the last."""
    # `PID NAME(…`; the end of a call that another thread's came between has no name at this place.
    calls = re.findall(r"^(\d+) +(\w+)\(", trace.read_text(), re.MULTILINE)
    loop = max({thread for thread, name in calls}, key=lambda thread: calls.count((thread, "sendmmsg")))
    names = [name for thread, name in calls if thread == loop]
    first, last = names.index("sendmmsg"), len(names) - names[::-1].index("sendmmsg")
    return Counter(names[first:last])


def test_the_loop_makes_no_other_system_calls_than_documented(tmp_path, programs):
    scenario, trace = tmp_path / "scenario.toml", tmp_path / "trace"
    scenario.write_text(SCENARIO)
    common = ["--bus", "vcan0", "--scenario", scenario]
    record = ["--record", tmp_path / "run.mcap", "--stop-on-disarm", "--spin", "auto", "--json"]
    plant = programs.start("strace", "strace", "-f", "-o", trace, RESONARM, "run", *common, *record)
    assert programs.resonarm("exciter", *common, "--patience-s", 60).wait() == 0
    assert plant.wait() == 0, plant.stderr
    count = made_by_the_loop(trace)
    assert set(count) <= documented(), count
    assert count["sendmmsg"] > 200 and count["recvmmsg"] > 200, count
    # Each tick takes in and sends with one call each, by construction; once more after 32 frames, as many as wait if
    # the plant was stopped. vcan's queue takes all. The plant's end, where it says that it leaves, makes one turn
    # more, with no receiving.
    ticks = json.loads(plant.stdout)["samples"]
    full = len(re.findall(r"recvmmsg.* = 32$", trace.read_text(), re.MULTILINE))
    assert count["recvmmsg"] <= ticks + full and count["sendmmsg"] <= ticks + 1, (ticks, full, count)


# A command is one frame, a sample three: where both processes have a core, each may wake the other.
@pytest.mark.parametrize(("traced", "frames", "looks"), [("run", 1, 3), ("exciter", 3, 1)])
def test_a_round_of_lockstep_makes_two_calls_for_frames_in_each_process_and_four_looks_at_the_clock(
    tmp_path, programs, traced, frames, looks
):
    scenario, trace = tmp_path / "scenario.toml", tmp_path / "trace"
    scenario.write_text(SCENARIO)
    arguments = {"run": ["--stop-on-disarm", "--json"], "exciter": ["--patience-s", 60, "--json"]}
    started, began_s = {}, time.monotonic()
    for role, own in arguments.items():
        words = [RESONARM, role, "--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, *own]
        tracer = ["strace", "-f", "-o", trace] if role == traced else []
        started[role] = programs.start(role, *tracer, *words)
    for program in started.values():
        assert program.wait() == 0, program.stderr
    took_s = time.monotonic() - began_s
    rounds = json.loads(started["run"].stdout)["samples"]
    count = made_by_the_loop(trace)
    wakes = count["recvmmsg"]
    # Heartbeats and waits for what comes late, also while a process is stopped, come to a few rounds' worth of calls.
    few = 0.3 * rounds
    assert rounds > 200
    assert count["sendmmsg"] < rounds + few and wakes < frames * rounds + few, count
    # A few samples are the plant's alone: those after the controller has ended.
    assert min(count["sendmmsg"], wakes) > rounds - few, count
    # A wait that ends shortly, as before a heartbeat, is a poll: how many there are depends on how long the run takes.
    heartbeats = took_s / HEARTBEAT_S
    assert count["poll"] + count["ppoll"] < few + 2 * heartbeats, (count, took_s)
    # Where the clock is no system call, it has no count.
    assert count["clock_gettime"] < looks * wakes + few, count
