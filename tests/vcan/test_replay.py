"""Recordings back on the bus, against live controllers, and simulated again."""

import pytest
import wire
from conftest import session
from recordings import RECEIVED, SENT, Recording

SHORT = """
[excitation]
amplitude = { exciter_x = 50.0 }
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 1.2, settle_s = 0.2 }
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    folder = tmp_path_factory.mktemp("short")
    (folder / "short.toml").write_text(SHORT)
    return session(folder, "vcan0", "vcan0", folder / "short.toml")


def replayed(programs, path, *options):
    """The output of `resonarm replay`, and the frames that candump sees."""
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
        _, frames = replayed(programs, short.path, "--direction", which, "--speed", "20")
        expected = [frame for frame in short.recording.frames if frame.direction == direction]
        assert [frame.content for frame in frames] == contents(expected)


def test_the_timing_is_the_recorded_one(programs, tmp_path):
    path = tmp_path / "slow.mcap"
    programs.resonarm("run", "--bus", "vcan0", "--rate-hz", 100, "--duration-s", 1, "--record", path, "--json").result()
    recorded_s = [frame.time_ns * 1e-9 for frame in Recording.whole(path).frames]
    for speed in (1, 2):
        played, frames = replayed(programs, path, "--speed", speed)
        assert played["recorded_s"] == pytest.approx(recorded_s[-1] - recorded_s[0])
        # Against the first frame, which may be late itself. No frame is further off than the replay says of its latest
        # one, however long the machine held it up; at a wrong speed they would be by a quarter of a second and more.
        late_s = [
            frame.time_s - frames[0].time_s - (at_s - recorded_s[0]) / speed
            for frame, at_s in zip(frames, recorded_s, strict=True)
        ]
        assert max(map(abs, late_s)) < played["latest_s"] + 1e-3, late_s


def test_speed_0_is_as_fast_as_it_goes(short, programs):
    played, frames = replayed(programs, short.path, "--speed", "0")
    assert [frame.content for frame in frames] == contents(short.recording.frames)
    assert played["recorded_s"] > 1


def test_an_impossible_speed_is_said(short, programs):
    replay = programs.resonarm("replay", short.path, "--bus", "vcan0", "--speed", "-1")
    assert replay.wait() == 2
    assert "the speed is -1: it must be 0 (as fast as possible), or from 0.001 to 1000000" in replay.stderr


def test_some_frames_again_and_again_under_other_identifiers(short, programs):
    chosen = ["--id", "203,206", "--map", "203=213", "--from-s", "0.1", "--to-s", "0.2", "--loop", "3", "--speed", "20"]
    played, frames = replayed(programs, short.path, *chosen)
    once = [
        (0x213 if frame.id == 0x203 else frame.id, frame.data)
        for frame in short.recording.frames
        if frame.id in (0x203, 0x206) and 100 <= frame.step <= 200
    ]
    assert len(once) >= 101
    assert [frame.content for frame in frames] == 3 * once
    assert played["frames"] == len(frames)


def test_a_log_that_is_captured_is_a_recording_again(short, programs, tmp_path):
    """Exported, played by canplayer, captured by candump, imported: the frames are the recorded ones."""
    programs.resonarm("export", short.path, "--to", "candump", "--out", tmp_path / "short", "--json").result()
    dump = programs.candump()
    assert programs.start("canplayer", "canplayer", "-t", "-I", tmp_path / "short.log").wait() == 0
    frames = wire.log(dump)
    assert [frame.content for frame in frames] == contents(short.recording.frames)
    (tmp_path / "back.log").write_text(dump.stdout)
    back = tmp_path / "back.mcap"
    imported = programs.resonarm("import", tmp_path / "back.log", back, "--json").result()
    assert imported["frames"] == len(frames)
    assert [(frame.direction, frame.data) for frame in Recording.whole(back).frames] == [
        (frame.direction, frame.data) for frame in short.recording.frames
    ]
    _, again = replayed(programs, back, "--speed", "0")
    assert [frame.content for frame in again] == contents(short.recording.frames)


def against(programs, path, scenario, *options, code=0):
    """A recorded plant, and the exciter of a scenario that it tests."""
    replay = programs.resonarm("replay", path, "--bus", "vcan0", "--against", "--speed", "0", "--json", *options)
    programs.resonarm("exciter", "--bus", "vcan0", "--mode", "lockstep", "--scenario", scenario, "--json")
    return replay.result(code=code)


def commands(recording):
    """Sample and force of each recorded command."""
    received = recording.frames_of(RECEIVED, 0x201)
    decoded = [(frame.step, wire.decode(wire.Frame(0, frame.id, frame.data))[1]) for frame in received]
    return [(step, [signals["force_x_n"], signals["force_y_n"]]) for step, signals in decoded]


def test_the_same_controller_passes(short, programs):
    compared = against(programs, short.path, short.path.parent / "short.toml")
    assert compared == {
        "frames": len([frame for frame in short.recording.frames if frame.direction == SENT]),
        "commands": len(commands(short.recording)),
        "largest_force_difference_n": 0.0,
        "largest_torque_difference_nm": 0.0,
        "first_difference": None,
    }


def test_a_controller_that_commands_something_else_is_caught(short, programs, tmp_path):
    (tmp_path / "other.toml").write_text(SHORT.replace("50.0", "50.5"))
    compared = against(programs, short.path, tmp_path / "other.toml", code=1)
    recorded = commands(short.recording)
    # Half a newton of fifty: with the wire's 0.1 N it shows as soon as the force is large enough, at most at its peak.
    peak = max(abs(force_n) for _, (force_n, _) in recorded)
    assert compared["commands"] == len(recorded)
    assert 0.4 <= compared["largest_force_difference_n"] <= 0.6
    first = compared["first_difference"]
    expected = dict(recorded)[first["sample"]]
    assert (first["kind"], [first["expected"].get(axis, 0.0) for axis in ("exciter_x", "exciter_y")]) == ("command", pytest.approx(expected))
    assert 0 < abs(expected[0]) < peak
    # The same difference passes within limits.
    assert against(programs, short.path, tmp_path / "other.toml", "--limit-n", "1")["first_difference"] is None


def test_a_controller_that_ends_early_is_caught(short, programs, tmp_path):
    (tmp_path / "early.toml").write_text(SHORT.replace("duration_s = 1.2", "duration_s = 0.6"))
    compared = against(programs, short.path, tmp_path / "early.toml", code=1)
    assert compared["first_difference"]["kind"] == "no-answer"
    assert 0 < compared["commands"] < len(commands(short.recording))


def test_no_controller_is_said(short, programs):
    replay = programs.resonarm("replay", short.path, "--bus", "vcan0", "--against", "--patience-s", "0.2")
    assert replay.wait() == 3
    assert "no controller was heard on the bus within 0.2 s" in replay.stderr
