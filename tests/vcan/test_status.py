"""The status line of a run, on a terminal and without one."""

import json
import os
import pty
import re
import subprocess
import termios
import threading

from processes import RESONARM

SCENARIO = """
simulation = { rate_hz = 200 }
network = { command_timeout_s = 10, partner_timeout_s = 30 }
[excitation]
amplitude = { exciter_x = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 3, settle_s = 0.2 }
"""
PLANT = r"armed, \d+ samples/s, load [\d.]+ %, late \d+ µs, [\d.]+ N"
# Far longer than a machine that stalls takes; ends a hang.
LIMIT_S = 120


class OnTerminal:
    """A command whose standard error is a terminal."""

    def __init__(self, *arguments):
        end, terminal = pty.openpty()
        termios.tcsetwinsize(terminal, (24, 120))
        self.process = subprocess.Popen(
            [RESONARM, *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=terminal
        )
        os.close(terminal)
        self.seen = b""
        self.reader = threading.Thread(target=self.read, args=(end,))
        self.reader.start()

    def read(self, end):
        # Linux ends the reading of a terminal that no process has open by EIO.
        try:
            while piece := os.read(end, 4096):
                self.seen += piece
        except OSError:
            pass
        os.close(end)

    def result(self):
        output, _ = self.process.communicate(timeout=LIMIT_S)
        self.reader.join(LIMIT_S)
        return json.loads(output), self.seen.decode()


def both(tmp_path):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO)
    return ["--bus", "vcan0", "--scenario", scenario, "--json"]


def test_a_terminal_shows_both_ends_in_one_line_each(tmp_path):
    common = both(tmp_path)
    plant = OnTerminal("run", *common, "--stop-on-disarm")
    exciter = OnTerminal("exciter", *common, "--patience-s", LIMIT_S)
    (played, shown), (ended, seen) = exciter.result(), plant.result()
    assert played["outcome"] == "finished" and ended["outcome"] == "disarmed"
    # Rewritten by a carriage return, never on a separate line; events are.
    assert sum(re.search(PLANT, line) is not None for line in seen.split("\r")) > 3, seen
    assert not re.search(PLANT + r"[^\r]*\n", seen), seen
    assert "ready on vcan0" in seen and re.search(r"\r[^\r]*armed, \d+ samples/s", shown), (seen, shown)


def test_where_there_is_no_terminal_lines_come_if_they_are_asked_for(tmp_path, programs):
    common = both(tmp_path)
    plant = programs.resonarm("run", *common, "--stop-on-disarm", "--status-s", 0.5)
    exciter = programs.resonarm("exciter", *common, "--patience-s", LIMIT_S)
    assert exciter.result()["outcome"] == "finished"
    assert plant.result()["outcome"] == "disarmed"
    lines = [line for line in plant.stderr.splitlines() if re.fullmatch(PLANT + r"(, \d+ overruns)?", line)]
    assert len(lines) >= 2 and "samples/s" not in exciter.stderr, (plant.stderr, exciter.stderr)


def test_json_on_standard_error_is_not_mixed_with_lines(programs):
    refused = programs.resonarm("run", "--bus", "vcan0", "--json-events", "--status-s", 1)
    assert refused.wait() == 2 and "give one of them" in refused.stderr
