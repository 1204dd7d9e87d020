"""The pytest plugin, by pytest itself: suites that pass, and suites made to fail whose reports are looked at."""

import re
from pathlib import Path

import pytest

import resonarm
from resonarm.testing import Bench

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
    with bench.sensor_fault("accelerometer_c", "stuck", axis="x", from_s=0.4):
        result = bench.run()
    result.assert_settled("acceleration_c_m_s2_x", 8.0, from_s=0.1, to_s=0.9)
""",
    )
    result.assert_outcomes(failed=1)
    text = result.stdout.str()
    assert "acceleration_c_m_s2_x has not settled: its amplitude goes from" in text
    assert "> sample    501" in text
    path = Path(re.search(r"recording: (\S+)", text)[1])
    assert resonarm.Recording(path).summary["integrity"]["state"] == "complete"
    assert "resonarm recordings" in text


@pytest.mark.parametrize(
    ("fault", "assertion", "message"),
    [
        ("bench.wrong_crc(count=1, ids=[0x201], direction='receive')", "no_refused_command()", "1 frames were invalid"),
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
    result = run(pytester, "\ndef test_it(bench):\n    bench.run(['controller', '{bus}'])\n", "-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["*a controller that is a program needs a CAN interface: --resonarm-bus vcan0"])


def test_tests_side_by_side_do_not_meet(pytester):
    result = run(
        pytester,
        """
@pytest.mark.parametrize("force_n", range(1, 9))
def test_it(bench, force_n):
    result = bench.run(lambda measured: (force_n, 0.0) if measured.sample < 200 else None)
    assert abs(result.signal("force_n_x")[1]).max() == force_n
""",
        "-n",
        "2",
    )
    result.assert_outcomes(passed=8)


def test_faults_end_with_their_block(tmp_path):
    bench = Bench(resonarm.Scenario(), tmp_path)
    before = bench.scenario
    with bench.loss(probability=0.1), bench.sensor_fault("impedance_head", "dropout", from_s=1.0):
        values = bench.scenario.values()
        assert [fault["kind"] for fault in values["network"]["faults"]] == ["loss"]
        assert [fault["kind"] for fault in values["rig"]["faults"]] == ["dropout"]
    assert bench.scenario is before
    with pytest.raises(ValueError, match="unknown variant `flood`"), bench.fault("flood"):
        pass


def test_signals_are_known_by_name(tmp_path):
    bench = resonarm.Scenario.load(ROOT / "scenarios/bench.toml", simulation={"duration_s": 0.1})
    result = Bench(bench, tmp_path).run()
    with pytest.raises(ValueError, match="there is no signal 'alpha', only acceleration_b_m_s2_x"):
        result.signal("alpha")
