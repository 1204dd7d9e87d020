"""The pytest plugin, run by pytest: suites that pass, and the reports of suites made to fail."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import resonarm
from resonarm.testing import FAULTS, Bench, TimeLimit

pytest_plugins = ["pytester"]
ROOT = Path(__file__).resolve().parents[2]
BENCH = f"""
import pytest

pytestmark = pytest.mark.scenario({str(ROOT / "scenarios/bench.toml")!r}, simulation={{"duration_s": 1.0}})
"""


def run(pytester, suite, *words):
    pytester.makepyfile(BENCH + suite)
    return pytester.runpytest_subprocess("-p", "no:cacheprovider", "--resonarm-bus", "memory", *words)


def test_a_good_run_holds_and_leaves_nothing(pytester):
    result = run(
        pytester,
        """
def test_it(bench):
    result = bench.run()
    result.assert_completed()
    result.assert_no_overrun()
    result.assert_no_refused_command()
    result.assert_force_below(600)
    result.assert_state_reached("operational", within_s=0.1)
    print("KEPT", bench.folder)
""",
        "-s",
    )
    result.assert_outcomes(passed=1)
    assert not Path(re.search(r"KEPT (\S+)", result.stdout.str())[1]).exists()


def test_a_failure_shows_the_signal_and_names_the_recording(pytester):
    result = run(
        pytester,
        """
def test_it(bench):
    with bench.sensor_fault("c", "stuck", axis="x", from_s=0.4):
        result = bench.run()
    result.assert_settled("acceleration_c_x_m_s2", 8.0, from_s=0.1, to_s=0.9)
""",
    )
    result.assert_outcomes(failed=1)
    text = result.stdout.str()
    assert "acceleration_c_x_m_s2 has not settled: its amplitude goes from" in text
    assert "> sample    503" in text
    path = Path(re.search(r"recording: (\S+)", text)[1])
    assert resonarm.Recording(path).summary["integrity"]["state"] == "complete"
    assert "resonarm recordings" in text


def test_recordings_of_all_tests_are_kept_if_asked_for(pytester):
    suite = """
@pytest.mark.parametrize("kind", ["a/b", "c"])
def test_it(bench, kind):
    bench.run().assert_completed()
"""
    run(pytester, suite, "--resonarm-recordings", "kept").assert_outcomes(passed=2)
    kept = sorted(path.relative_to(pytester.path / "kept") for path in (pytester.path / "kept").rglob("*.mcap"))
    name = "test_recordings_of_all_tests_are_kept_if_asked_for.py-test_it"
    first, second = map(str, kept)
    # The slash is replaced; [a-b] may be another test, which may run at the same time.
    assert re.fullmatch(re.escape(f"{name}[a-b]") + r"-[0-9a-f]{8}/run-1\.mcap", first)
    assert second == f"{name}[c]/run-1.mcap"


REPORT = """\
=================================== FAILURES ===================================
___________________________________ test_it ____________________________________
test_the_report_of_a_failure.py:7: in test_it
    result.assert_force_below(50)
E   AssertionError: the force along x reaches 74.76 N: limit 50 N
E     force_x_n:
E     sample    192      0.1920 s           +48
E     sample    193      0.1930 s        +48.24
E     sample    194      0.1940 s         +48.5
E     sample    195      0.1950 s        +48.76
E     sample    196      0.1960 s           +49
E     sample    197      0.1970 s        +49.24
E     sample    198      0.1980 s         +49.5
E     sample    199      0.1990 s        +49.76
E   > sample    200      0.2000 s           +50
E     sample    201      0.2010 s        +50.24
E     sample    202      0.2020 s         +50.5
E     sample    203      0.2030 s        +50.76
E     sample    204      0.2040 s           +51
E     sample    205      0.2050 s        +51.24
E     sample    206      0.2060 s         +51.5
E     sample    207      0.2070 s        +51.76
E     sample    208      0.2080 s           +52
E   recording: FOLDER/run-1.mcap
----------------------------- resonarm recordings ------------------------------
FOLDER/run-1.mcap
on memory, <Scenario of <Chain 'irb1600-fitted': 2 links; 22.16 to 48.9 Hz>: excitation, 1000 Hz, 1 s>
=========================== short test summary info ============================
"""


def test_the_report_of_a_failure(pytester):
    """Word for word, except for the folder of the recording."""
    suite = """
def test_it(bench):
    result = bench.run(lambda measured: (0.25 * measured.sample, 0.0) if measured.sample < 300 else None)
    result.assert_force_below(50)
"""
    lines = run(pytester, suite, "--no-header", "--tb=short").outlines
    first = next(k for k, line in enumerate(lines) if " FAILURES " in line)
    last = next(k for k, line in enumerate(lines) if " short test summary info " in line)
    report = "".join(line + "\n" for line in lines[first : last + 1])
    assert re.sub(r"/\S*/resonarm-\w+", "FOLDER", report) == REPORT


def test_a_test_brings_its_parts_itself(pytester):
    suite = """
import can, resonarm
def test_a_plant_is_heard_and_armed(bench, plant, bus):
    decoder = resonarm.Decoder()
    names = set()
    for _ in range(200):
        names.add(decoder.decode(bus.recv(60)).message)
        if names >= {"PlantHello", "PlantHeartbeat"}:
            break
    assert names == {"PlantHello", "PlantHeartbeat"}
    assert plant.is_running
    joined = can.Bus(interface="resonarm", channel=bus.channel) if bench.bus == "memory" else None
    if joined:
        assert decoder.decode(joined.recv(60)).verdict in ("taken", "refused")
        joined.shutdown()
    assert plant.is_running, "which the other end's leaving does not end"
    result = bench.result(plant)
    result.assert_state_reached("pre_operational", within_s=0.0)
    assert result.plant["outcome"] == "not-armed", result.plant
def test_it_fails(bench, plant, bus):
    assert bus.recv(60) is None
"""
    result = run(pytester, suite)
    result.assert_outcomes(passed=1, failed=1)
    path = Path(re.search(r"^(/\S+/run-1\.mcap)$", result.stdout.str(), re.M)[1])
    assert resonarm.Recording(path).summary["integrity"]["state"] == "complete"


def test_an_overrun_is_found(pytester):
    """The process is stopped for a third of a second, in the midst of a run in real time."""
    suite = """
import os, signal, subprocess
@pytest.mark.scenario(network={"command_timeout_s": 60.0, "partner_timeout_s": 60.0})
def test_it(bench):
    bench.mode = "real-time"
    def controller(measured):
        if measured.sample == 300:
            subprocess.Popen(["sh", "-c", f"sleep 0.3; kill -CONT {os.getpid()}"])
            os.kill(os.getpid(), signal.SIGSTOP)
        return (1.0, 0.0) if measured.sample < 800 else None
    bench.run(controller).assert_no_overrun()
"""
    result = run(pytester, suite)
    result.assert_outcomes(failed=1)
    assert re.search(r"[0-9]+ deadlines were missed", result.stdout.str())


@pytest.mark.parametrize(
    ("fault", "assertion", "message"),
    [
        ("bench.wrong_crc(count=1, ids=[0x201], direction='receive')", "no_refused_command()", "1 frame was invalid"),
        ("bench.link_down(from_s=0.0)", "state_reached('operational', within_s=0.5)", "was never"),
        ("bench.loss(ids=[0x201])", "completed()", "the plant ended faulted"),
        ("bench.delay(0.001)", "force_below(1.0)", "the force along x reaches"),
    ],
)
def test_faults_are_found(pytester, fault, assertion, message):
    suite = f"""
def test_it(bench):
    with {fault}:
        result = bench.run(patience_s=1)
    result.assert_{assertion}
"""
    result = run(pytester, suite)
    result.assert_outcomes(failed=1)
    assert message in result.stdout.str()


def test_each_scenario_of_a_mark_is_run(pytester):
    files = [str(ROOT / f"scenarios/{name}.toml") for name in ("bench", "shaker")]
    result = run(
        pytester,
        f"""
@pytest.mark.scenario({files[0]!r}, {files[1]!r}, simulation={{"duration_s": 0.2}})
def test_it(bench):
    assert bench.run(lambda measured: (1.0, 0.0)).plant["samples"] > 100
""",
        "-v",
    )
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["*test_it?bench? PASSED*", "*test_it?shaker? PASSED*"])


def test_a_program_needs_an_interface(pytester):
    suite = """
def test_a_run(bench):
    bench.run(["controller", "{bus}"])
def test_a_process(controller_process):
    controller_process("controller", "{bus}")
"""
    result = run(pytester, suite, "-rs")
    result.assert_outcomes(skipped=2)
    result.stdout.fnmatch_lines(["*a controller that is a program needs a CAN interface, as by --resonarm-bus vcan0"])


def test_tests_side_by_side_do_not_meet(pytester):
    result = run(
        pytester,
        """
@pytest.mark.parametrize("force_n", range(1, 9))
def test_it(bench, force_n):
    result = bench.run(lambda measured: (force_n, 0.0) if measured.sample < 200 else None)
    assert abs(result.signal("force_x_n")[1]).max() == force_n
""",
        "-n",
        "2",
    )
    result.assert_outcomes(passed=8)


def test_faults_end_with_their_block(tmp_path):
    bench = Bench(resonarm.Scenario(), tmp_path)
    before = bench.scenario
    with bench.loss(probability=0.1), bench.sensor_fault("head", "dropout", from_s=1.0):
        values = bench.scenario.values()
        assert [fault["kind"] for fault in values["network"]["faults"]] == ["loss"]
        assert [fault["kind"] for fault in values["rig"]["faults"]] == ["dropout"]
    assert bench.scenario is before
    with pytest.raises(ValueError, match="unknown variant `flood`"), bench.fault("flood"):
        pass


def test_signals_are_known_by_name(tmp_path):
    bench = resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 0.1})
    result = Bench(bench, tmp_path).run()
    with pytest.raises(ValueError, match="there is no signal 'alpha': expected one of "):
        result.signal("alpha")


def test_a_run_without_an_end_is_ended(pytester):
    """A controller that never returns None, on a scenario without a duration: the test never ended."""
    pytester.makepyfile("""
import pytest
@pytest.mark.scenario(excitation=None)
def test_it(bench):
    bench.run(lambda measured: (1.0, 0.0)).assert_completed()
""")
    result = pytester.runpytest_subprocess(
        "-p", "no:cacheprovider", "--resonarm-bus=memory", "--resonarm-time-limit=0.5", "--tb=short"
    )
    result.assert_outcomes(failed=1)
    text = result.stdout.str()
    assert "the controller has not ended its run within 0.5 s of simulated time" in text
    assert "simulation.duration_s" in text and "--resonarm-time-limit" in text
    path = Path(re.search(r"recording: (\S+)", text)[1])
    assert resonarm.Recording(path).summary["integrity"]["state"] == "complete"


def test_the_time_limit_leaves_runs_with_an_end_alone(tmp_path):
    scenario = resonarm.Scenario().replace(excitation=None)
    with pytest.raises(TimeLimit, match=r"within 0\.2 s"):
        Bench(scenario, tmp_path, time_limit_s=0.2).run(lambda measured: (1.0, 0.0))
    bench = Bench(scenario.replace(simulation={"duration_s": 0.4}), tmp_path, time_limit_s=0.2)
    assert bench.run(lambda measured: (1.0, 0.0)).plant["outcome"] == "completed"
    ended = Bench(scenario, tmp_path, time_limit_s=0.2).run(
        lambda measured: None if measured.sample > 50 else (1.0, 0.0)
    )
    ended.assert_controlled()
    with pytest.raises(ValueError, match=r"time_limit_s is 0: it must be a positive number"):
        Bench(scenario, tmp_path, time_limit_s=0)


@pytest.mark.parametrize(
    ("answer", "count"),
    [
        (lambda measured: None, r"0 of the \d+"),
        (lambda measured: (0.0, 0.0), r"0 of the \d+"),
        (lambda measured: (float(100 < measured.sample < 160), 0.0), r"5\d of the \d+"),
    ],
)
def test_a_controller_that_does_nothing_is_found(tmp_path, answer, count):
    """It passes `assert_completed`."""
    scenario = resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 0.5})
    result = Bench(scenario, tmp_path).run(answer)
    result.assert_completed()
    with pytest.raises(
        AssertionError, match=rf"did not control the arm: a load other than zero acted in {count} samples"
    ):
        result.assert_controlled()
    with pytest.raises(ValueError, match=r"share is 0: it must be above 0 and at most 1"):
        result.assert_controlled(share=0)


def test_a_controller_that_acts_is_in_control(tmp_path):
    scenario = resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 0.5})
    Bench(scenario, tmp_path).run(lambda measured: (0.0, 2.0)).assert_controlled(share=0.9)
    Bench(scenario, tmp_path).run().assert_controlled()


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_the_faults_of_the_list_do_what_they_say(tmp_path, fault):
    scenario = resonarm.Scenario.load(ROOT / "scenarios/bench.toml")
    bench = Bench(scenario, tmp_path)
    with bench.inject(fault):
        result = bench.run(lambda measured: (2.0, 1.0) if measured.sample < 1000 else None)
    assert bench.scenario is scenario
    if fault.ends_run:
        result.assert_faulted()
    else:
        result.assert_controlled(share=0.8)


REPORTED = """
@pytest.mark.requirement("CTRL-1", "CTRL-2")
def test_it(bench):
    bench.run(lambda measured: (1.0, 0.0) if measured.sample < 50 else None).assert_force_below(LIMIT)
"""


@pytest.mark.parametrize("words", [(), ("-n", "1")])
def test_junit_has_requirements_and_recordings(pytester, words):
    words = ["--junitxml", "junit.xml", "--resonarm-recordings", "kept", *words]
    run(pytester, REPORTED.replace("LIMIT", "50"), *words).assert_outcomes(passed=1)
    properties = ElementTree.parse(pytester.path / "junit.xml").getroot().iter("property")
    found = [(given.get("name"), given.get("value")) for given in properties]
    assert found[:2] == [("requirement", "CTRL-1"), ("requirement", "CTRL-2")]
    [(name, path)] = found[2:]
    assert name == "resonarm_recording" and (pytester.path / path).is_file()


def test_pytest_html_and_allure_have_recordings(pytester):
    """With the real plug-ins, which read what this one adds."""
    pytest.importorskip("pytest_html")
    pytest.importorskip("allure_pytest")
    words = ("--html=report.html", "--self-contained-html", "--alluredir=allure")
    run(pytester, REPORTED.replace("LIMIT", "0.5"), *words).assert_outcomes(failed=1)
    page = (pytester.path / "report.html").read_text()
    assert re.search(r"file:///[^&]*/run-1\.mcap", page) and "run-1.mcap" in page
    [document] = (pytester.path / "allure").glob("*-result.json")
    attached = {each["name"]: each["source"] for each in json.loads(document.read_text())["attachments"]}
    assert attached.keys() >= {"run-1.mcap", "scenario"}
    recording = pytester.path / "allure" / attached["run-1.mcap"]
    assert resonarm.Recording(recording).summary["integrity"]["state"] == "complete"


def test_without_the_plugin_its_options_are_unknown_to_nobody(pytester):
    """`-p no:resonarm` reaches the workers of xdist: no fixture, and no traceback of options."""
    pytester.makepyfile("def test_it(bench):\n    pass\n")
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-p", "no:resonarm", "-n", "2")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*fixture 'bench' not found*"])
    assert "conflicting" not in result.stdout.str() + result.stderr.str()


def test_a_worker_that_dies_takes_one_test_with_it(pytester):
    suite = """
import os
@pytest.mark.parametrize("n", range(6))
def test_run(bench, n):
    bench.run(lambda measured: (1.0, 0.0) if measured.sample < 50 else None).assert_completed()
def test_dies(bench):
    os._exit(11)
"""
    result = run(pytester, suite, "-n", "2", "--max-worker-restart", "2")
    result.assert_outcomes(passed=6, failed=1)
    result.stdout.fnmatch_lines(["*worker 'gw*' crashed while running*test_dies*"])


def test_a_folder_that_can_not_be_written_is_named(pytester):
    """A file in its place, which stops an administrator, too."""
    (pytester.path / "out").write_text("")
    result = run(pytester, "def test_it(bench):\n    pass\n", "--resonarm-recordings", "out/kept")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        ["*the folder of --resonarm-recordings can't be made: *Give one that this user may write*"]
    )
