"""The conformance tool against the program's own nodes, as processes."""

import xml.etree.ElementTree as ElementTree

RATE_HZ = 200

SCENARIO = f"""
[simulation]
rate_hz = {RATE_HZ}
[excitation]
amplitude = {{ force_x_n = 20.0 }}
ramp_s = 0.1
profile = {{ waveform = "dwell", frequency_hz = 15.0, duration_s = 60.0, settle_s = 0.2 }}
"""


def test_our_plant_fails_no_case(tmp_path, programs):
    scenario, junit = tmp_path / "scenario.toml", tmp_path / "report.xml"
    scenario.write_text(SCENARIO)
    programs.resonarm("run", "--bus", "vcan0", "--scenario", scenario)
    tool = programs.resonarm(
        "conformance", "--bus", "vcan0", "--role", "plant", "--beyond-n", 650, "--junit", junit, "--json"
    )
    report = tool.result()
    # A machine that holds the tester up makes a case inconclusive, never failed.
    assert report["failed"] == 0 and report["skipped"] == 0, report
    assert report["passed"] >= 20, report
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert len(suite.findall("testcase")) == int(suite.get("tests")) == len(report["cases"])


def test_our_exciter_fails_no_case(tmp_path, programs):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO)
    for case in ("exciter-answers", "exciter-sensor-timeout", "exciter-plant-leaves"):
        tool = programs.resonarm("conformance", "--bus", "vcan0", "--role", "exciter", "--case", case, "--json")
        exciter = programs.resonarm("exciter", "--bus", "vcan0", "--scenario", scenario)
        report = tool.result()
        assert (report["failed"], report["passed"] + report["inconclusive"]) == (0, 1), report
        exciter.wait()
