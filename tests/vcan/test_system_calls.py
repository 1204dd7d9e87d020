"""What the real-time loop asks of the kernel: what docs/real-time.md says, and nothing else."""

import json
import re
from pathlib import Path

from processes import RESONARM

DOCUMENTED = Path(__file__).parents[2] / "docs/real-time.md"

SCENARIO = """
simulation = { rate_hz = 200 }
network = { command_timeout_s = 10, partner_timeout_s = 30 }
[excitation]
amplitude = { force_x_n = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 1, settle_s = 0.2 }
"""


def documented():
    """The names in the table's column for SocketCAN."""
    table = DOCUMENTED.read_text().split("## System calls", 1)[1].split("\n## ", 1)[0]
    rows = re.findall(r"^\| .* \| yes \|$", table, re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`(\w+)`", row)}


def test_the_loop_makes_no_other_system_calls_than_documented(tmp_path, programs):
    scenario, trace = tmp_path / "scenario.toml", tmp_path / "trace"
    scenario.write_text(SCENARIO)
    common = ["--bus", "vcan0", "--scenario", scenario]
    record = ["--record", tmp_path / "run.mcap", "--stop-on-disarm", "--spin", "auto", "--json"]
    plant = programs.start("strace", "strace", "-f", "-o", trace, RESONARM, "run", *common, *record)
    assert programs.resonarm("exciter", *common, "--patience-s", 60).wait() == 0
    assert plant.wait() == 0, plant.stderr
    # `PID NAME(…`; the end of a call that another thread's came between has no name at this place.
    calls = re.findall(r"^(\d+) +(\w+)\(", trace.read_text(), re.MULTILINE)
    loop = max({thread for thread, name in calls}, key=lambda thread: calls.count((thread, "sendmmsg")))
    names = [name for thread, name in calls if thread == loop]
    # From the first frames that are sent to the last.
    first, last = names.index("sendmmsg"), len(names) - names[::-1].index("sendmmsg")
    made = names[first:last]
    count = {name: made.count(name) for name in set(made)}
    assert set(made) <= documented(), count
    assert count["sendmmsg"] > 200 and count["recvmmsg"] > 200, count
    # Each tick takes in and sends with one call each, by construction: no batch of this run fills, and vcan's queue
    # takes all. The plant's end, where it says that it leaves, makes one turn more, with no receiving.
    ticks = json.loads(plant.stdout)["samples"]
    assert count["recvmmsg"] <= ticks and count["sendmmsg"] <= ticks + 1, (ticks, count)
