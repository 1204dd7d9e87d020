"""Faulty recordings: damaged, without a scenario, from other programs."""

import pickle
import subprocess
import sys
import warnings
from pathlib import Path

import can
import mcap.reader
import mcap.writer
import numpy as np
import pytest

import resonarm
from resonarm import __main__ as program

ROOT = Path(__file__).resolve().parents[2]
SWEEP = ROOT / "recordings/free-sweep.mcap"
LONG = ROOT / "recordings/phase-walk.mcap"


@pytest.fixture
def cut_short(tmp_path):
    """A recording whose last third is missing."""
    path = tmp_path / "cut.mcap"
    path.write_bytes(LONG.read_bytes()[: LONG.stat().st_size * 2 // 3])
    return path


@pytest.fixture
def damaged(tmp_path):
    """A recording with one wrong byte after its middle."""
    path, data = tmp_path / "damaged.mcap", bytearray(LONG.read_bytes())
    data[len(data) * 2 // 3] ^= 1
    path.write_bytes(data)
    return path


def foreign(path, changed):
    """The reference recording, written again by the package `mcap`, with other metadata."""
    with SWEEP.open("rb") as source, path.open("wb") as target:
        reader, writer = mcap.reader.make_reader(source), mcap.writer.Writer(target)
        writer.start()
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, {**record.metadata, **changed.get(record.name, {})})
        schemas, channels = {}, {}
        for schema, channel, message in reader.iter_messages():
            if channel.topic not in channels:
                schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
                of = (channel.topic, channel.message_encoding, schemas[schema.name], channel.metadata)
                channels[channel.topic] = writer.register_channel(*of)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


def test_a_recording_without_a_scenario_is_a_table(tmp_path):
    with can.Logger(tmp_path / "log.mcap") as log:
        log(can.Message(timestamp=1.8e9, arbitration_id=0x123, is_extended_id=False, data=b"\1\2"))
    recording = resonarm.Recording(tmp_path / "log.mcap")
    table = recording.arrow("frames")
    assert table["data"].to_pylist() == [b"\1\2"]
    assert b"scenario" not in table.schema.metadata
    with pytest.raises(ValueError, match="scenario"):
        _ = recording.scenario


def test_a_recording_whose_scenario_is_of_another_version_is_a_table(tmp_path):
    path = foreign(tmp_path / "later.mcap", {"resonarm.configuration": {"scenario": "[structure]\nlater = 1\n"}})
    recording = resonarm.Recording(path)
    table = recording.arrow("states")
    np.testing.assert_array_equal(table["alpha1_rad"].to_numpy(), recording.states["alpha_rad"][:, 0])
    assert table.schema.metadata[b"scenario"] == b"[structure]\nlater = 1\n"


def test_a_whole_recording_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = resonarm.Recording(SWEEP, strict=True)
    assert recording.damage is None


@pytest.mark.parametrize(("kind", "state"), [("cut_short", "truncated"), ("damaged", "damaged")])
def test_a_recording_that_is_not_whole_warns_or_raises(kind, state, request):
    path = request.getfixturevalue(kind)
    with pytest.warns(resonarm.RecordingWarning, match=f"{path.name}` is {state}") as warned:
        recording = resonarm.Recording(path)
    assert [Path(warning.filename) for warning in warned] == [Path(__file__)], "it names the caller's line"
    assert recording.summary["integrity"]["state"] == state
    last = recording.summary["integrity"]["last_sample"]
    assert f"samples up to {last}" in recording.damage and recording.states["sample"][-1] == last
    with pytest.raises(resonarm.ResonarmError) as raised:
        resonarm.Recording(path, strict=True)
    assert str(raised.value) == str(warned[0].message)
    assert "`resonarm recover`" in str(raised.value)


def test_readers_of_logs_warn_too(cut_short):
    with pytest.warns(resonarm.RecordingWarning, match="is truncated"):
        assert len(list(can.LogReader(cut_short))) > 100


def test_the_command_warns_in_a_line(cut_short, tmp_path, capsys):
    assert program.main(["export", str(cut_short), "--to", "blf", "--out", str(tmp_path / "cut")]) == 1
    said = capsys.readouterr().err
    assert said.startswith("warning: recording `") and "is truncated" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("range_", "message"),
    [
        ({"from_sample": -1}, "from_sample is -1: it must be 0 or more"),
        ({"to_sample": -1}, "to_sample is -1: it must be 0 or more"),
        ({"from_sample": 20, "to_sample": 10}, "from_sample is 20 and to_sample 10: give the earlier one first"),
    ],
)
def test_a_range_goes_forwards(range_, message):
    recording = resonarm.Recording(SWEEP)
    calls = [recording.read, recording.arrow, lambda part, **of: next(recording.chunks(part, **of))]
    for call in [*calls, lambda part, **of: next(recording.batches(part, **of)), lambda _, **of: recording.plot(**of)]:
        with pytest.raises(ValueError) as raised:
            call("states", **range_)
        assert str(raised.value) == message


@pytest.mark.parametrize("rows", [0, -1])
def test_chunks_have_rows(rows):
    for call in (resonarm.Recording(SWEEP).chunks, resonarm.Recording(SWEEP).batches):
        with pytest.raises(ValueError, match=f"rows is {rows}: it must be 1 or more"):
            next(call("states", rows))


ESCAPE = "\x1b]0;owned\x07\x9b2J"


def test_control_characters_of_a_file_are_escaped(tmp_path):
    """A name, a scenario and metadata with control sequences for a terminal."""
    scenario = {"scenario": f'[structure]\npreset = "{ESCAPE}"\n'.replace("\x1b", "\\u001b").replace("\x07", "\\u0007")}
    named = foreign(tmp_path / "named\x1b[2J.mcap", {"resonarm.configuration": scenario})
    recording = resonarm.Recording(named)
    time = foreign(tmp_path / "time.mcap", {"resonarm.recording": {"time": ESCAPE}})
    broken = foreign(tmp_path / "broken.mcap", {"resonarm.configuration": {"scenario": f"arm = '{ESCAPE}'"}})
    said = [repr(recording), str(recording), f"{recording}"]
    for call in (
        lambda: repr(recording.scenario),
        lambda: resonarm.Recording(time),
        lambda: resonarm.Recording(broken).scenario,
        lambda: resonarm.Recording(tmp_path / "none\x1b[2J.mcap"),
    ):
        with pytest.raises((ValueError, resonarm.ResonarmError, OSError)) as raised:
            call()
        said.append(str(raised.value))
    for text in said:
        assert not [c for c in text if not c.isprintable() and c != "\n"], repr(text)
    assert "owned" in said[3] + said[4] + said[5]


READER = """
import pickle, sys, resonarm
recording = pickle.load(sys.stdin.buffer)
parts = {part: recording.read(part) for part in ("states", "samples", "frames", "events")}
sys.stdout.buffer.write(pickle.dumps(parts))
"""


def test_arrays_go_from_process_to_process():
    recording = resonarm.Recording(SWEEP)
    done = subprocess.run(
        [sys.executable, "-c", READER], input=pickle.dumps(recording), capture_output=True, check=True, cwd="/"
    )
    for part, rows in pickle.loads(done.stdout).items():
        own = recording.read(part)
        assert rows.dtype == own.dtype
        np.testing.assert_array_equal(rows, own, part)
