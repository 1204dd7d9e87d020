"""The audit of a controller that is a process: the program's own exciter, which plays a sweep and looks at nothing."""

import json
import xml.etree.ElementTree as ElementTree

from processes import RESONARM

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
profile = { waveform = "swept-sine", law = "logarithmic", from_hz = 15, to_hz = 60, duration_s = 30 }
"""

SPECIFICATION = """
[spec]
kind = "sine"
sources = []
[sine]
from_hz = 15
rate_oct_min = 4
segments = [{ to_hz = 60, acceleration_m_s2 = 3 }]
tolerance = 0.1
"""


def test_a_player_is_audited_in_lockstep(tmp_path, programs):
    for name, text in (
        ("plant", PLANT),
        ("player", PLANT + PLAYER),
        ("sine", SPECIFICATION),
    ):
        (tmp_path / f"{name}.toml").write_text(text)
    junit = tmp_path / "audit.xml"
    where = [
        "--scenario",
        tmp_path / "plant.toml",
        "--specification",
        tmp_path / "sine.toml",
        "--out",
        tmp_path / "runs",
    ]
    cases = [
        word
        for case in ("S01", "S02", "S08", "S12", "S15")
        for word in ("--case", case)
    ]
    player = [
        RESONARM,
        "exciter",
        "--bus",
        "{bus}",
        "--mode",
        "lockstep",
        "--scenario",
        tmp_path / "player.toml",
    ]
    tool = programs.resonarm(
        "audit",
        *where,
        *cases,
        "--bus",
        "vcan0",
        "--json",
        "--junit",
        junit,
        "--",
        *player,
    )
    status = tool.wait()
    report = json.loads(tool.stdout)
    verdicts = {case["case"]: case["verdict"] for case in report["cases"]}
    assert verdicts == {
        "S01": "passed",
        "S02": "passed",
        "S08": "failed",
        "S12": "failed",
        "S15": "skipped",
    }, report
    assert status == 1 and report["passed"] == 2
    # What the controller printed lies beside the recording of each run.
    assert (
        "finished after 30001 samples"
        in (tmp_path / "runs/base/controller.txt").read_text()
    )
    assert (tmp_path / "runs/S12/run.mcap").stat().st_size > 0
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert suite.attrib["failures"] == "2" and suite.attrib["skipped"] == "1"
