"""The conformance tool on users' own protocols: controllers that know nothing of Resonarm, and plants that do."""

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from processes import RESONARM, run, wait_until
from test_conformance import judged, kept_alive, passes_every_case

FOLDER = Path(__file__).parent
EXAMPLES = FOLDER.parents[1] / "examples"
OWN = EXAMPLES / "own-protocol"


def written(folder, text):
    path = folder / "scenario.toml"
    path.write_text(text)
    return path


def own_protocol(folder):
    """The example's scenario at 100 Hz, with a timeout that only a controller that stops exceeds."""
    text = (OWN / "bench.toml").read_text()
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


# Each case starts the controller anew, which takes most of the time: some cases stand for all, which
# `crates/conformance` runs in virtual time.
@pytest.mark.parametrize(
    ("mode", "names"),
    [
        ("real-time", ["exciter-before-arming", "exciter-plant-disarmed"]),
        ("lockstep", ["lockstep-exciter-waits"]),
    ],
)
def test_the_controller_of_the_example_passes(programs, tmp_path, mode, names):
    scenario = own_protocol(tmp_path)
    arguments = [OWN / "controller.py", "vcan0", "--samples", 1_000_000]
    node = kept_alive(lambda: programs.start("controller", sys.executable, *arguments))
    flags = ["--mode", mode, *cases(*names)]
    report = passes_every_case(tool(programs, "exciter", scenario, *flags), node, skipped_too=())
    assert [case["case"] for case in report["cases"]] == names


def test_a_client_of_odrive_passes(programs, tmp_path):
    scenario = written(tmp_path, "simulation.rate_hz = 100\n" + (EXAMPLES / "odrive" / "drives.toml").read_text())
    node = kept_alive(lambda: programs.start("client", sys.executable, FOLDER / "odrive_client.py", "vcan0", 0))
    flags = cases("exciter-plant-faults")
    report = passes_every_case(tool(programs, "exciter", scenario, *flags), node, skipped_too=())
    least, most = report["commands"]["torque1_nm"]
    assert -10.0 <= least < most <= 10.0


def test_a_master_that_ignores_faults_fails_the_case_for_it(programs, tmp_path):
    """That of `test_cia402`, which commands whatever the drives say."""
    text = (EXAMPLES / "canopen" / "drives.toml").read_text().replace("timeout_s = 0.5", "timeout_s = 5.0")
    scenario = written(tmp_path, "simulation.rate_hz = 100\n" + text)
    sheets = [tmp_path / f"{number}.eds" for number in (1, 2)]
    for number, path in enumerate(sheets, 1):
        path.write_text(run(RESONARM, "protocol", "eds", "--scenario", scenario, "--node-id", number))
    arguments = [FOLDER / "cia402_master.py", "vcan0", *sheets]
    master = kept_alive(lambda: programs.start("master", sys.executable, *arguments))
    # Longer than a master waits for a drive that was not there yet, and takes to start.
    start = tool(programs, "exciter", scenario, "--patience-s", 30, *cases("exciter-plant-faults"))
    case = judged(lambda: start([]), master)
    assert case["verdict"] == "failed" and "and the plant is in fault for" in case["reason"], case


def test_our_plant_passes_on_the_example(programs, tmp_path):
    scenario, junit, evidence = own_protocol(tmp_path), tmp_path / "report.xml", tmp_path / "evidence.mcap"
    plant = programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario)
    wait_until(lambda: "ready on" in plant.stderr, "the plant to be on the bus")
    names = ["plant-arms", "plant-commands-act", "plant-wrong-checksum", "plant-stop"]
    start = tool(programs, "plant", scenario)
    files = ["--junit", junit, "--record", evidence, *cases(*names)]
    first = passes_every_case(lambda more: start(more or files), skipped_too=("-stop",))
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert [case.get("name") for case in suite] == names == [case["case"] for case in first["cases"]]
    # Damaged frames are among them, so it ends with 1.
    decode = programs.resonarm("protocol", "decode", "--recording", evidence)
    assert decode.wait() == 1
    assert "checksum" in decode.stdout and "head_force_x_n" in decode.stdout
