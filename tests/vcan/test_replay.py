"""Recordings back on the bus, and simulated again."""

import statistics

import pytest
import wire
from conftest import session
from recordings import RECEIVED, SENT, Recording

SHORT = """
[excitation]
amplitude = { force_x_n = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 1.2, settle_s = 0.2 }
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    folder = tmp_path_factory.mktemp("short")
    (folder / "short.toml").write_text(SHORT)
    return session(folder, "vcan0", "vcan0", folder / "short.toml")


def replayed(programs, path, *options):
    """What `resonarm replay` says, and the frames that candump sees."""
    dump = programs.candump()
    played = programs.resonarm("replay", path, "--bus", "vcan0", "--json", *options).result()
    return played, wire.log(dump)


def contents(frames):
    return [(frame.id, frame.data) for frame in frames]


def test_a_lockstep_run_simulates_again_bit_for_bit(lockstep, programs):
    verdict = programs.resonarm("resim", lockstep.path, "--json").result()
    assert verdict == {
        "identical": True,
        "integrity": {"state": "complete"},
        "samples": lockstep.plant["samples"],
        "steps": lockstep.plant["steps"],
        "first_divergence": None,
        "max_drift_rad": 0.0,
    }


def test_every_frame_comes_back_in_order(short, programs):
    played, frames = replayed(programs, short.path, "--speed", "4")
    assert played["frames"] == len(short.recording.frames)
    assert [frame.content for frame in frames] == contents(short.recording.frames)


def test_one_direction_alone(short, programs):
    for which, direction in (("received", RECEIVED), ("sent", SENT)):
        _, frames = replayed(programs, short.path, "--frames", which, "--speed", "20")
        expected = [frame for frame in short.recording.frames if frame.direction == direction]
        assert [frame.content for frame in frames] == contents(expected)


def test_the_timing_is_the_recorded_one(programs, tmp_path):
    path = tmp_path / "slow.mcap"
    programs.resonarm("run", "--bus", "vcan0", "--rate-hz", 100, "--duration-s", 1, "--record", path, "--json").result()
    recorded_s = [frame.time_ns * 1e-9 for frame in Recording.whole(path).frames]
    for speed in (1, 2):
        played, frames = replayed(programs, path, "--speed", speed)
        assert played["recorded_s"] == pytest.approx(recorded_s[-1] - recorded_s[0])
        # How late each frame was, which is what the machine holds it up; half of them by less than 50 ms;
        # at a wrong speed it would be a quarter of a second and more.
        late_s = [
            frame.time_s - frames[0].time_s - (at_s - recorded_s[0]) / speed
            for frame, at_s in zip(frames, recorded_s, strict=True)
        ]
        assert abs(statistics.median(late_s)) < 0.05, late_s


def test_speed_0_is_as_fast_as_it_goes(short, programs):
    played, frames = replayed(programs, short.path, "--speed", "0")
    assert [frame.content for frame in frames] == contents(short.recording.frames)
    assert played["recorded_s"] > 1


def test_an_impossible_speed_is_said(short, programs):
    replay = programs.resonarm("replay", short.path, "--bus", "vcan0", "--speed", "-1")
    assert replay.wait() == 2
    assert "the speed is -1: it must be 0, which is as fast as it goes, or from 0.001 to 1000000" in replay.stderr
