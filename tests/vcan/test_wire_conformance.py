"""The conformance tool on users' own protocols: controllers that know nothing of Resonarm, and plants that do."""

import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from processes import RESONARM, run, wait_until
from test_conformance import kept_alive, passes_every_case

FOLDER = Path(__file__).parent
EXAMPLES = FOLDER.parents[1] / "examples"
OWN = EXAMPLES / "own-protocol"
SKIPPED = ("-counters", "-before-arming")


def written(folder, text):
    path = folder / "scenario.toml"
    path.write_text(text)
    return path


def own_protocol(folder, name="bench.toml"):
    """The example's scenario at 100 Hz, with a timeout that only a controller that stops exceeds."""
    text = (OWN / name).read_text()
    for old, new in [
        ("rate_hz = 1000", "rate_hz = 100"),
        ("timeout_s = 0.1", "timeout_s = 0.5"),
        ('message = "Meas"\n', 'message = "Meas"\nevery = 1\n'),
        ('dbc = "bench.dbc"', f'dbc = "{OWN / "bench.dbc"}"'),
    ]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return written(folder, text)


def tool(programs, role, scenario, *flags):
    """Starts the tool with these flags and those of a round."""
    common = ["--bus", "vcan0", "--role", role, "--scenario", scenario, "--json", *flags]
    return lambda more: programs.resonarm("conformance", *common, *more)


def cases(*names):
    return [flag for name in names for flag in ("--case", name)]


@pytest.mark.parametrize("mode", ["real-time", "lockstep"])
def test_the_controller_of_the_example_passes_every_case(programs, tmp_path, mode):
    scenario = own_protocol(tmp_path)
    arguments = [OWN / "controller.py", "vcan0", "--samples", 1_000_000]
    node = kept_alive(lambda: programs.start("controller", sys.executable, *arguments))
    report = passes_every_case(tool(programs, "exciter", scenario, "--mode", mode), node, skipped_too=())
    least, most = report["commands"]["force_x_n"]
    assert -20.0 <= least < -1.0 and 1.0 < most <= 20.0


def test_a_client_of_odrive_passes(programs, tmp_path):
    scenario = written(tmp_path, "simulation.rate_hz = 100\n" + (EXAMPLES / "odrive" / "drives.toml").read_text())
    node = kept_alive(lambda: programs.start("client", sys.executable, FOLDER / "odrive_client.py", "vcan0", 0))
    passes_every_case(tool(programs, "exciter", scenario), node, skipped_too=SKIPPED)


def test_a_master_that_heeds_no_fault_fails_the_cases_for_it(programs, tmp_path):
    text = (EXAMPLES / "canopen" / "drives.toml").read_text()
    scenario = written(tmp_path, "simulation.rate_hz = 100\n" + text)
    sheets = [tmp_path / f"{number}.eds" for number in (1, 2)]
    for number, path in enumerate(sheets, 1):
        path.write_text(run(RESONARM, "protocol", "eds", "--scenario", scenario, "--node-id", number))
    master = programs.start("master", sys.executable, FOLDER / "cia402_master.py", "vcan0", *sheets)
    conformance = tool(programs, "exciter", scenario, *cases("exciter-arms", "exciter-in-time", "exciter-plant-f"))([])
    conformance.wait()
    master.end()
    verdicts = {case["case"]: case["verdict"] for case in json.loads(conformance.stdout)["cases"]}
    assert verdicts == {"exciter-arms": "passed"}, conformance.stdout


def test_our_plant_passes_on_the_example(programs, tmp_path):
    scenario, junit, evidence = own_protocol(tmp_path), tmp_path / "report.xml", tmp_path / "evidence.mcap"
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario)
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    start = tool(programs, "plant", scenario)
    files = ["--junit", junit, "--record", evidence]
    skipped = ("-requests", "-not-finite", "-too-large", "-stop")
    first = passes_every_case(lambda more: start(more or files), skipped_too=skipped)
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert len(suite.findall("testcase")) == len(first["cases"])
    decoded = run(RESONARM, "protocol", "decode", "--recording", evidence)
    assert "Drive" in decoded and "Meas" in decoded
