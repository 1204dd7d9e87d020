"""Audits of controllers that are processes.

One is the program's own exciter, which plays a sweep and looks at nothing. Those of examples/audit have their own DBC.
"""

import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

from processes import RESONARM

EXAMPLE = Path("examples/audit").resolve()
# Four minutes of samples in lockstep take 80 s where nothing else runs, and 20 times as long beside others.
AUDIT_PATIENCE_S = 1600

PLANT = """
[structure]
kind = "modal"
modes = [{ frequency_hz = 1.0, damping_ratio = 0.05, shape = { "tip.x" = 1.0, "mid.x" = 1.0 } }]
[rig.exciter]
at = "tip.x"
[rig.sensors.b]
at = "mid"
[rig.sensors.c]
at = "tip"
"""

PLAYER = """
[excitation]
amplitude = { exciter_x = 3.0 }
profile = { waveform = "swept-sine", law = "logarithmic", from_hz = 15, to_hz = 60, duration_s = 15 }
"""

SPECIFICATION = """
[spec]
kind = "sine"
sources = []
[sine]
from_hz = 15
rate_oct_min = 8
segments = [{ to_hz = 60, acceleration_m_s2 = 3 }]
tolerance = 0.1
"""

SCHEDULE = "levels_db = [-12, -6, -3, 0]\nseconds = [10, 10, 10, 120]"
SHORT = "levels_db = [-6, 0]\nseconds = [10, 60]"


def audited(programs, folder, plant, specification, cases, controller, *more):
    """The exit status and the report of an audit in lockstep; its runs lie in the folder `runs`."""
    files = ["--scenario", plant, "--specification", specification, "--out", folder / "runs"]
    cases = [word for case in cases for word in ("--case", case)]
    tool = programs.resonarm("audit", *files, *cases, "--bus", "vcan0", "--json", *more, "--", *controller)
    status = tool.wait(AUDIT_PATIENCE_S)
    report = json.loads(tool.stdout)
    return status, {case["case"]: case["verdict"] for case in report["cases"]}, report


def test_a_player_is_audited_in_lockstep(tmp_path, programs):
    for name, text in (("plant", PLANT), ("player", PLANT + PLAYER), ("sine", SPECIFICATION)):
        (tmp_path / f"{name}.toml").write_text(text)
    junit = tmp_path / "audit.xml"
    cases = ["S01", "S02", "S08", "S12", "S15"]
    player = [RESONARM, "exciter", "--bus", "{bus}", "--mode", "lockstep", "--scenario", tmp_path / "player.toml"]
    files = tmp_path / "plant.toml", tmp_path / "sine.toml"
    status, verdicts, report = audited(programs, tmp_path, *files, cases, player, "--junit", junit)
    assert verdicts == {
        "S01": "passed",
        "S02": "passed",
        "S08": "failed",
        "S12": "failed",
        "S15": "skipped",
    }, report
    assert status == 1 and report["passed"] == 2
    # What the controller printed lies beside the recording of each run.
    assert "finished after 15001 samples" in (tmp_path / "runs/base/controller.txt").read_text()
    assert (tmp_path / "runs/S12/run.mcap").stat().st_size > 0
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert suite.attrib["failures"] == "2" and suite.attrib["skipped"] == "1"


def test_a_controller_in_c_on_its_dbc_is_audited(tmp_path, programs):
    sine = tmp_path / "sine"
    compiler = ["cc", "-O2", "-std=gnu99", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*compiler, "-o", sine, EXAMPLE / "sine.c", "-lm"], check=True)
    # Four times as fast as in the example: the amplitude is held less well, and the audit takes a fourth of the time.
    specification = tmp_path / "sine.toml"
    text = (EXAMPLE / "sine.toml").read_text()
    specification.write_text(text.replace("rate_oct_min = 1", "rate_oct_min = 4"))
    controller = [sine, "{bus}", "20", "45", "4", "3"]
    plant, cases = EXAMPLE / "plant.toml", ["S02", "S12"]
    status, verdicts, report = audited(programs, tmp_path, plant, specification, cases, controller)
    assert (status, verdicts) == (0, {"S02": "passed", "S12": "passed"}), report
    said = (tmp_path / "runs/S12/controller.txt").read_text()
    assert said == "stopped: the sensor does not read the drive\n"


def test_a_controller_in_python_on_its_dbc_is_audited(tmp_path, programs):
    specification = tmp_path / "random.toml"
    text = (EXAMPLE / "random.toml").read_text()
    assert SCHEDULE in text
    specification.write_text(text.replace(SCHEDULE, SHORT))
    controller = [sys.executable, EXAMPLE / "random_control.py", "{bus}", "{spec}"]
    operator = "--operator", f"{sys.executable} {EXAMPLE / 'say.py'} {{bus}} {{word}}"
    cases = ["R02", "R18", "R19"]
    files = EXAMPLE / "plant.toml", specification
    status, verdicts, report = audited(programs, tmp_path, *files, cases, controller, *operator)
    assert (status, verdicts) == (0, dict.fromkeys(cases, "passed")), report
    said = (tmp_path / "runs/R18/controller.txt").read_text()
    assert said == "stopped: the operator has stopped the test\n"


def test_an_operator_whose_command_fails_ends_the_audit(tmp_path, programs):
    plant, player, sine = (tmp_path / f"{name}.toml" for name in ("plant", "player", "sine"))
    for path, text in ((plant, PLANT), (player, PLANT + PLAYER), (sine, SPECIFICATION)):
        path.write_text(text)
    player = [RESONARM, "exciter", "--bus", "{bus}", "--mode", "lockstep", "--scenario", player]
    options = ["--out", tmp_path / "runs", "--case", "S10", "--bus", "vcan0", "--operator", "false {word}"]
    tool = programs.resonarm("audit", "--scenario", plant, "--specification", sine, *options, "--", *player)
    assert tool.wait() == 2
    assert 'the operator\'s command "false stop" ended with exit status: 1' in tool.stderr
