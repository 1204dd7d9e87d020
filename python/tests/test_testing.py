"""The bench without pytest: its runs, faults in simulated time, and assertions that no bad run passes."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import resonarm
from resonarm.export import columns
from resonarm.testing import Bench

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios/bench.toml"
FORCE_N = 10.0


def pulse(measured):
    """Ten newtons for a fifth of a second."""
    return (FORCE_N, 0.0) if measured.sample < 200 else None


@pytest.fixture
def bench():
    with Bench(SCENARIO) as bench:
        bench.scenario = bench.scenario.replace(simulation={"duration_s": 1.0})
        yield bench


def test_a_bench_of_a_path_has_a_temporary_folder():
    with Bench(str(SCENARIO)) as bench:
        assert bench.scenario == resonarm.Scenario.load(SCENARIO)
        result = bench.run(pulse)
        folder = result.recording.path.parent
        assert folder.is_dir()
        assert (
            repr(result) == f"<Result: plant disarmed, exciter finished, 251 samples, {str(result.recording.path)!r}>"
        )
        assert repr(bench) == f"<Bench of {bench.scenario!r} on memory: 1 run in {str(folder)!r}>"
    assert not folder.exists()


def test_a_bench_in_a_folder_keeps_its_recordings(tmp_path):
    folder = str(tmp_path / "one" / "two")
    with Bench(SCENARIO, folder) as bench:
        first = bench.run(pulse).recording.path
    with Bench(SCENARIO, folder) as again:
        second = again.run(pulse).recording.path
    assert [first.name, second.name] == ["run-1.mcap", "run-2.mcap"] and first.parent == second.parent == Path(folder)
    # The same run in simulated time: the same bytes, whatever the machine does.
    assert first.read_bytes() == second.read_bytes()
    assert Bench(folder=folder).scenario == resonarm.Scenario()


LEFT = """
from resonarm.testing import Bench
result = Bench().run(lambda measured: None)
print(result.recording.path, len(result.recording.states) > 0)
"""


def test_a_temporary_folder_is_gone_with_its_process():
    said = subprocess.run([sys.executable, "-c", LEFT], capture_output=True, text=True, check=True).stdout.split()
    assert said[1] == "True" and not Path(said[0]).exists()


@pytest.mark.parametrize(("periods", "later"), [(1, 0), (1.5, 1), (3, 2), (7, 6)])
def test_a_delay_is_of_simulated_time(bench, periods, later):
    """A controller has a sample period for its answer; a later answer acts later. The run ends as without delay."""
    delay_s, seen = periods / bench.scenario.sample_rate_hz, []

    def controller(measured):
        seen.append(measured.sample)
        return (FORCE_N if measured.sample >= 100 else 1.0, 0.0) if measured.sample < 200 else None

    direct = bench.run(controller)
    seen.clear()
    with bench.delay(delay_s, direction="receive", from_s=0.05):
        late = bench.run(controller)
    late.assert_completed()
    late.assert_no_refused_command()
    assert (late.plant["outcome"], late.exciter["outcome"]) == ("disarmed", "finished")
    for result, acts in ((direct, 100), (late, 100 + later)):
        assert np.flatnonzero(result.signal("force_x_n")[1] == FORCE_N)[0] == acts
    assert seen == list(range(seen[0], 201)), "every sample was answered"


def test_a_delay_beyond_the_timeout_faults_as_in_real_time(bench):
    with bench.delay(0.03):
        result = bench.run(pulse)
    with pytest.raises(AssertionError, match="the plant ended faulted: command timeout"):
        result.assert_completed()
    result.assert_faulted("command timeout")


def test_the_times_of_faults_are_simulated(bench):
    """The run survives a link that is down for 10 ms of simulated time, and not for 30 ms."""
    for length_s, outcome in ((0.01, "disarmed"), (0.03, "faulted")):
        with bench.link_down(from_s=0.1, to_s=0.1 + length_s):
            assert bench.run(pulse).plant["outcome"] == outcome


def test_a_run_in_lockstep_is_asked_for(bench):
    bench.mode = "lockstep"
    result = bench.run(pulse)
    result.assert_completed()
    assert result.recording.summary["origin"]["time"] == "lockstep"
    bench.mode = None
    assert bench.run(pulse).recording.summary["origin"]["time"] == "simulated"


ASSERTIONS = {
    "completed": lambda result: result.assert_completed(),
    "no overrun": lambda result: result.assert_no_overrun(),
    "no rejected command": lambda result: result.assert_no_refused_command(),
    "force": lambda result: result.assert_force_below(600),
    "state": lambda result: result.assert_state_reached("operational", within_s=0.5),
    "settled": lambda result: result.assert_settled("force_x_n", 50.0, from_s=0.0, to_s=0.1),
}


def nan(measured):
    return (float("nan"), 0.0)


FAULTS = {
    "the plant's": lambda bench: bench.loss(ids=[0x201], direction="receive", from_s=0.15),
    "before anything": lambda bench: bench.wrong_crc(ids=[0x201], direction="receive", probability=1.0),
    "the exciter's": lambda bench: bench.loss(node="exciter", direction="receive", from_s=0.15),
}


def sine(measured):
    return (5.0 * np.sin(2 * np.pi * 0.05 * measured.sample), 0.0) if measured.sample < 200 else None


@pytest.mark.parametrize("assertion", ASSERTIONS)
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("mode", ["free", "lockstep"])
def test_no_assertion_passes_on_a_run_that_faulted(bench, assertion, fault, mode):
    if mode == "lockstep" and fault != "before anything":
        # There the times of faults follow the clock: from the first command on.
        faults = bench.loss(node="plant", ids=[0x201], direction="receive", probability=0.1)
    else:
        faults = FAULTS[fault](bench)
    bench.mode = mode
    with faults:
        result = bench.run(sine)
    assert result.plant["outcome"] == "faulted"
    with pytest.raises(AssertionError) as raised:
        ASSERTIONS[assertion](result)
    assert "the plant ended faulted: " in str(raised.value)
    assert f"recording: {result.recording.path}" in str(raised.value)


def test_the_assertions_hold_of_the_same_run_without_fault(bench):
    for assertion in ASSERTIONS.values():
        assertion(bench.run(sine))


def test_an_expected_fault_is_asserted_before_the_rest(bench):
    with bench.loss(ids=[0x201], direction="receive", from_s=0.15):
        result = bench.run(pulse)
    with pytest.raises(
        AssertionError, match=r"faulted: command timeout \(code 1\) at sample 169; expected the fault 'overrun'"
    ):
        result.assert_faulted("overrun")
    with pytest.raises(AssertionError, match="the plant ended faulted"):
        result.assert_force_below(20)
    result.assert_state_reached("fault", within_s=0.2)
    result.assert_faulted("command timeout")
    result.assert_force_below(20)
    result.assert_state_reached("operational", within_s=0.1)
    with pytest.raises(AssertionError, match="reaches 10 N: limit 10 N"):
        result.assert_force_below(10)
    with pytest.raises(AssertionError, match="the plant ended faulted: command timeout"):
        result.assert_completed()
    with pytest.raises(AssertionError, match="to end by a fault: the plant ended disarmed, the exciter finished"):
        bench.run(pulse).assert_faulted()


def test_every_assertion_fails_if_the_plant_was_never_armed(bench):
    with bench.link_down(from_s=0.0):
        result = bench.run(pulse)
    for assertion in ASSERTIONS.values():
        with pytest.raises(AssertionError, match=r"the plant was never armed|the state operational was never reached"):
            assertion(result)
    result.assert_state_reached("pre_operational", within_s=0.0)


def test_a_refused_command_is_found_at_its_sample(bench):
    """One command of the run exceeds the limit of the rig's exciter."""
    limits = {"force_limit_n": 8.0}

    def controller(measured):
        return (9.0 if measured.sample == 120 else 1.0, 0.0) if measured.sample < 200 else None

    bench.scenario = bench.scenario.replace(excitation=None, rig={"exciter": limits})
    result = bench.run(controller)
    with pytest.raises(AssertionError) as raised:
        result.assert_no_refused_command()
    assert "commands were rejected: 1 out_of_range" in str(raised.value)
    assert "\n> sample    120 " in str(raised.value)


def test_a_corrupt_frame_is_found_at_its_sample(bench):
    with bench.wrong_crc(ids=[0x201], direction="receive", from_s=0.15, to_s=0.1501, probability=1.0):
        result = bench.run(pulse)
    with pytest.raises(AssertionError, match="1 frame was invalid") as raised:
        result.assert_no_refused_command()
    at = int(str(raised.value).partition("\n> sample")[2].split()[0])
    assert 140 < at < 160


def test_an_invalid_number_is_named(bench):
    result = bench.run(pulse)
    nothing = float("nan")
    for call, message in [
        (lambda: result.assert_force_below(nothing), "limit_n is nan: it must be a number"),
        (lambda: result.assert_state_reached("operational", nothing), "within_s is nan: it must be a number"),
        (lambda: result.assert_state_reached("awake", 1.0), "there is no state 'awake': expected one of boot_up"),
        (lambda: result.amplitude("force_x_n", nothing), "frequency_hz is nan: it must be a positive number"),
        (
            lambda: result.amplitude("force_x_n", 600.0),
            "frequency_hz is 600: at a sample rate of 1000 Hz it must be below",
        ),
        (
            lambda: result.amplitude("force_x_n", 50.0, 0.2, 0.1),
            "from_s is 0.2 and to_s 0.1: give the earlier one first",
        ),
        (lambda: result.amplitude("force_x_n", 50.0, 0.1, 9.0), "to_s is 9: the run ends at 0.249 s"),
        (lambda: result.amplitude("force_x_n", 50.0, 0.1, 0.11), "0.1 s to 0.11 s are 11 samples: a period of"),
        (
            lambda: result.assert_settled("force_x_n", 50.0, from_s=0.1, to_s=0.12),
            "from_s is 0.1 and to_s 0.12: a half of it has 11 samples, a period of 50 Hz has 20",
        ),
        (lambda: result.assert_settled("force_x_n", 50.0, from_s=0.1, to_s=0.105), "0.1 s to 0.105 s are 6 samples:"),
        (
            lambda: result.assert_settled("force_x_n", 50.0, from_s=0.2, to_s=5.7),
            "to_s is 5.7: the run ends at 0.249 s",
        ),
        (
            lambda: result.assert_settled("force_x_n", 50.0, from_s=5.7, to_s=0.2),
            "from_s is 5.7 and to_s 0.2: give the earlier one first",
        ),
    ]:
        with pytest.raises(ValueError) as raised:
            call()
        assert message in str(raised.value)


def test_a_signal_is_the_channel_of_its_name(bench):
    """Readings, states and loads, as the recording's tables name them; the state at the end of a run has no load."""
    result = bench.run(pulse)
    parts = {part: columns(result.recording.read(part)) for part in ("states", "samples")}
    for name in ("acceleration_b_x_m_s2", "head_force_y_n", "alpha2_dot_rad_s", "force_x_n", "torque2_nm"):
        part = "states" if name in parts["states"] else "samples"
        count = len(parts["states"]["is_end"]) - 1 if name in ("force_x_n", "torque2_nm") else None
        times, values = result.signal(name)
        np.testing.assert_array_equal(values, parts[part][name][:count], name)
        np.testing.assert_array_equal(times, parts[part]["time_s"][:count], name)
    with pytest.raises(
        ValueError, match=r"there is no signal 'torque_nm_x': expected one of .*, torque1_nm, torque2_nm, "
    ):
        result.signal("torque_nm_x")


def test_a_signal_at_rest_has_not_settled(bench):
    result = bench.run(pulse)
    with pytest.raises(AssertionError, match="force_y_n does not vibrate at 50 Hz"):
        result.assert_settled("force_y_n", 50.0, from_s=0.0, to_s=0.15)


def test_nan_in_a_signal_is_named_with_its_sample(bench, tmp_path):
    """A recording of another program, with one NaN."""
    from recordings import with_column

    result = bench.run(sine)
    path = with_column(result.recording.path, tmp_path / "nan.mcap", "/plant/steps", "force_x_n", 120, float("nan"))
    result.recording = resonarm.Recording(path)
    for call in (
        lambda: result.assert_force_below(600),
        lambda: result.assert_settled("force_x_n", 50.0, from_s=0.05, to_s=0.15),
        lambda: result.amplitude("force_x_n", 50.0, 0.05, 0.15),
    ):
        with pytest.raises(AssertionError) as raised:
            call()
        assert str(raised.value).startswith("force_x_n is NaN at sample 120 (0.12 s)\n")
        assert "\n  > sample    120      0.1200 s          +nan" in str(raised.value).replace("\n>", "\n  >")


def test_a_controller_that_returns_nan_is_named(bench):
    with pytest.raises(ValueError, match=r"the controller returned \(nan, 0\.0\) for sample 0"):
        bench.run(nan)


def test_a_failure_names_the_mistake_of_the_controller_and_shows_the_fault(bench):
    """The failure said "partner fault (code 4, detail 2)" and showed the ramp to zero."""

    def unstable(measured):
        return (1.0 if measured.sample < 100 else 1e6, 0.0)

    with pytest.raises(AssertionError) as raised:
        bench.run(unstable).assert_completed()
    said = str(raised.value)
    assert "the exciter ended faulted: " in said.splitlines()[0]
    assert "the controller commands exciter_x = 1000000 N at sample 100" in said
    assert "> sample    100" in said


def test_a_failure_names_the_first_refused_command_and_frame(bench):
    strong = bench.scenario.replace(rig={"exciter": {"force_limit_n": 300.0}})
    bench.scenario = strong
    with bench.wrong_crc(ids=[0x201], direction="receive", count=1), pytest.raises(AssertionError) as raised:
        bench.run(lambda measured: (1.0 if measured.sample < 100 else 310.0, 0.0)).assert_completed()
    said = str(raised.value)
    first = r"the first of them is exciter_x = 310 N at sample 100"
    assert re.search(rf"commands were rejected: \d+ out_of_range; {first}", said)
    assert "frames that the plant rejected: 1; the first of them is 201#" in said
