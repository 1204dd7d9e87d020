"""Recordings judged by specifications, whose densities are those of the recordings themselves."""

import re
from pathlib import Path

import numpy as np
import pytest

import resonarm
from resonarm.testing import Bench, assert_in_specification

READING = "acceleration_c_x_m_s2"

# Far above its only mode the structure is a mass of 1 kg.
SCENARIO = """
[structure]
kind = "modal"
modes = [{ frequency_hz = 1.0, damping_ratio = 0.05, shape = { "tip.x" = 1.0, "mid.x" = 1.0 } }]
[rig.exciter]
at = "tip.x"
[rig.sensors.b]
at = "mid"
[rig.sensors.c]
at = "tip"
[excitation]
amplitude = { exciter_x = 20.0 }
profile = { waveform = "random", from_hz = 5, to_hz = 100, seed = 3, duration_s = 60 }
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    (folder / "random.toml").write_text(SCENARIO)
    with Bench(folder / "random.toml", folder) as bench:
        return bench.run()


SWEEP = SCENARIO.replace("20.0 }", "3.0 }").replace(
    'waveform = "random", from_hz = 5, to_hz = 100, seed = 3, duration_s = 60',
    'waveform = "swept-sine", law = "logarithmic", from_hz = 15, to_hz = 60, duration_s = 30',
)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swept")
    (folder / "sweep.toml").write_text(SWEEP)
    with Bench(folder / "sweep.toml", folder) as bench:
        return bench.run()


def sine(result, name, *, acceleration_m_s2=3.0, rate_oct_min=4.0):
    """A file that specifies a sweep from 15 to 60 Hz."""
    path = result.recording.path.parent / f"{name}.toml"
    path.write_text(
        "spec = { kind = 'sine', sources = [] }\ncontrol = { channels = ['c.x'] }\n[sine]\nfrom_hz = 15\n"
        f"rate_oct_min = {rate_oct_min}\ntolerance = 0.1\nrate_tolerance = 0.1\n"
        f"segments = [{{ to_hz = 60, acceleration_m_s2 = {acceleration_m_s2} }}]\n"
    )
    return path


def specification(result, name, *, factor=1.0, tolerance_db=3.0):
    """A file that specifies the density of the recording, times a factor."""
    psd = result.recording.psd(READING, segment_s=1.0).psd[READING]
    points = ", ".join(f"[{hz}, {factor * np.mean(psd[hz - 5 : hz + 5]):e}]" for hz in (15, 40, 80))
    path = result.recording.path.parent / f"{name}.toml"
    path.write_text(
        "spec = { kind = 'random', sources = [] }\ncontrol = { channels = ['c.x'] }\n"
        f"[random]\nunit = '(m/s2)2/Hz'\nlines_hz = 1\nbreakpoints = [{points}]\n"
        f"tolerance_db = [-{tolerance_db}, {tolerance_db}]\nrms_tolerance = 0.2\n"
    )
    return path


def test_a_recording_of_the_specified_density_is_in(result):
    path = specification(result, "good")
    judged = assert_in_specification(result.recording, path)
    assert judged["verdict"] == "in" and judged["clipped"] == 0
    assert judged["configuration"]["channels"] == [READING]
    assert judged["found"]["counts"] == [62, 0, 0]
    # A path and the channel by its name, and the same by the result.
    assert assert_in_specification(result.recording.path, path, READING) == judged
    assert result.assert_in_specification(path, "c.x") == judged


def test_the_document_is_that_of_the_command(result, sweep, command):
    random, swept = specification(result, "same"), sine(sweep, "same")
    for recording, path, reference in ((result.recording, random, None), (sweep.recording, swept, "head_force_x_n")):
        options = [] if reference is None else ["--reference", reference]
        told = command("verdict", path, recording.path, *options)
        assert told["configuration"].pop("undecided") == "fail"
        assert recording.judge(path, reference=reference) == told


def test_a_sweep_is_in_and_begins_where_the_excitation_does(sweep):
    judged = sweep.assert_in_specification(sine(sweep, "good"), reference="head_force_x_n")
    assert judged["begins_by"] == "sweep" and abs(judged["begins_s"]) < 0.5
    assert judged["found"]["passes"][0]["rate"] == pytest.approx(4.0, rel=0.01)


def test_a_sweep_that_fails_says_the_worst_amplitude_and_its_limit(sweep):
    with pytest.raises(AssertionError, match=r"amplitude out: worst [+-]\d\d\.\d % at \d\d.* Hz; tolerance 10 %"):
        sweep.assert_in_specification(sine(sweep, "high", acceleration_m_s2=4.0))
    with pytest.raises(AssertionError, match=r"sweep rate out: (3\.9|4|4\.0)"):
        sweep.assert_in_specification(sine(sweep, "fast", rate_oct_min=8.0))


def test_a_recording_without_a_sweep_is_undecided(result):
    path = sine(result, "none")
    judged = result.recording.judge(path)
    assert judged["verdict"] == "undecided" and judged["begins_s"] is None
    with pytest.raises(AssertionError, match=r"no sweep between 17\.25 and 52\.17"):
        assert_in_specification(result.recording, path)


def test_a_recording_in_which_no_test_begins_does_not_pass_by_choice(result):
    with pytest.raises(AssertionError, match=r"no test begins in the record, which undecided=\"pass\" does not cover"):
        result.assert_in_specification(sine(result, "never"), undecided="pass")
    # 4 dB below the level, and within a tolerance of 9 dB.
    path = specification(result, "far", factor=10**0.4, tolerance_db=9.0)
    path.write_text(path.read_text().replace("rms_tolerance = 0.2\n", ""))
    judged = result.recording.judge(path)
    assert judged["verdict"] == "undecided" and judged["found"]["verdict"] == "in" and judged["begins_s"] is None
    with pytest.raises(AssertionError, match="no test begins in the record"):
        result.assert_in_specification(path, undecided="pass")
    assert result.assert_in_specification(path, from_s=1.0)["verdict"] == "in"


def test_a_recording_far_below_it_fails_with_what_was_found(result):
    path = specification(result, "high", factor=4.0)
    with pytest.raises(AssertionError) as failed:
        assert_in_specification(result.recording, path, undecided="pass")
    said = str(failed.value)
    assert f"s: out by the specification {path}" in said and "profile out: 0 lines in" in said
    assert re.search(r"worst line \d+ Hz out: -\d\.\d\d dB, .*; tolerance -3 to \+3 dB", said)
    assert "no stretch is within 2 dB" in said and said.endswith(f"recording: {result.recording.path}")


def test_a_record_that_does_not_decide_fails_or_passes_by_choice(result):
    path = specification(result, "short")
    with pytest.raises(AssertionError, match="degrees of freedom would decide it"):
        result.assert_in_specification(path, to_s=4.0)
    judged = result.assert_in_specification(path, to_s=4.0, undecided="pass")
    assert judged["verdict"] == "undecided" and judged["configuration"]["to_s"] < 4.01


def test_what_can_not_be_judged_is_an_error(result, tmp_path):
    path = specification(result, "good")
    for call, said in (
        (lambda: result.recording.judge(tmp_path / "none.toml"), "can't read the specification"),
        (lambda: result.recording.judge(path, "head_force_x_n"), "head_force_x_n is in N"),
        (lambda: result.recording.judge("navmat-p-9492"), "the control channel is missing"),
        (lambda: result.recording.judge("navmat-p-9492", "c.x"), "the specification reaches 2000 Hz"),
        (lambda: assert_in_specification(result.recording, path, undecided="maybe"), "expected one of fail, pass"),
    ):
        with pytest.raises(ValueError, match=said):
            call()
    with pytest.raises(resonarm.ResonarmError):
        result.recording.judge(path, from_s=1000.0)


def test_the_pathless_preset_is_not_read_from_a_file(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("navmat-p-9492").write_text("[spec]")
    with pytest.raises(ValueError, match="navmat-p-9492"):
        result.recording.judge("navmat-p-9492", "c.x")
