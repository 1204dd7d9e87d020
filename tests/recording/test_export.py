"""Files of `resonarm export`, opened by independent readers of each format and compared value for value with the
recording as the package `mcap` reads it."""

import csv
import json
import os
import re
import subprocess
from collections import defaultdict
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
import pyuff
import soundfile
from foxglove_schemas import declared, published
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from processes import RESONARM, run
from recordings import LOAD, SENSORS, STATE, SENT, Recording, bits

# As candump writes a frame: identifier, flags of CAN FD, data.
FRAME = re.compile(r" ([0-9A-F]+)#(#[0-9A-F])?([0-9A-F]*)\b")

ROOT = Path(__file__).resolve().parents[2]
FD = """
[network]
profile = "fd"
"""
DWELL = """
[excitation]
amplitude = { joint1 = 60.0 }
profile = { waveform = "dwell", frequency_hz = 22.1, duration_s = 1.0, settle_s = 0.2 }
"""


def export(folder, recording, *arguments):
    """Exports into the folder under the name `x`."""
    return run(RESONARM, "export", recording, "--out", folder / "x", *arguments)


@pytest.fixture(scope="module", params=["classic", "fd"])
def recorded(request, tmp_path_factory):
    """A free run, whose frames have simulated times, and its contents as the package `mcap` reads them."""
    folder = tmp_path_factory.mktemp(request.param)
    (folder / "run.toml").write_text(DWELL + (FD if request.param == "fd" else ""))
    path = folder / "run.mcap"
    run(RESONARM, "run", "--mode", "free", "--scenario", folder / "run.toml", "--duration-s", "1.1", "--record", path)
    return path, Recording.whole(path)


def rows(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def columns(table, names):
    return np.array([[float(row[name]) for name in names] for row in table])


def test_csv_has_every_value(recorded, tmp_path):
    path, recording = recorded
    export(tmp_path, path, "--to", "csv")
    states, samples = rows(tmp_path / "x-states.csv"), rows(tmp_path / "x-samples.csv")
    assert (bits(columns(states, STATE + LOAD)) == bits(recording.states)).all()
    assert (bits(columns(samples, SENSORS)) == bits(recording.samples)).all()
    assert [row["is_end"] for row in states] == ["0"] * (len(states) - 1) + ["1"]
    assert columns(states, ["sample", "time_s"]) == pytest.approx(np.array([[k, k * 1e-3] for k in range(len(states))]))
    # The filter of the converter delays readings by 2.5 samples.
    assert columns(samples, ["time_s"])[:3, 0] == pytest.approx([-0.0025, -0.0015, -0.0005])
    clipped = [value for batch in recording.topics["/plant/samples"] for value in batch.clipped]
    assert [int(row["clipped"]) for row in samples] == clipped
    events = [(str(event.step), event.name, str(event.value)) for event in recording.topics["/events"]]
    assert [(row["sample"], row["name"], row["value"]) for row in rows(tmp_path / "x-events.csv")] == events
    frames = rows(tmp_path / "x-frames.csv")
    exported = [(int(row["sample"]), int(row["identifier"]), row["fd"], bytes.fromhex(row["data"])) for row in frames]
    assert exported == [(frame.step, frame.id, str(int(frame.fd)), frame.data) for frame in recording.frames]
    assert [row["time_s"] for row in frames] == [f"{frame.time_ns / 1e9:.9f}" for frame in recording.frames]


def content(message):
    flags = message.is_fd, message.bitrate_switch, message.is_extended_id, message.is_remote_frame, message.is_rx
    return message.arbitration_id, flags, bytes(message.data)


@pytest.mark.parametrize(
    ("form", "ending", "reader"),
    [("candump", "log", can.CanutilsLogReader), ("asc", "asc", can.ASCReader), ("blf", "blf", can.BLFReader)],
)
def test_logs_have_every_frame(recorded, tmp_path, form, ending, reader):
    path, recording = recorded
    export(tmp_path, path, "--to", form)
    messages = list(reader(tmp_path / f"x.{ending}"))
    expected = [
        (frame.id, (frame.fd, frame.brs, frame.extended, frame.remote, frame.direction != SENT), frame.data)
        for frame in recording.frames
    ]
    assert [content(message) for message in messages] == expected
    for message, frame in zip(messages, recording.frames, strict=True):
        # The texts have microseconds.
        assert message.timestamp == pytest.approx(frame.time_ns * 1e-9, abs=1.1e-6)


def test_can_utils_read_the_asc_log(recorded, tmp_path):
    path, recording = recorded
    export(tmp_path, path, "--to", "asc")
    lines = run("asc2log", "-I", tmp_path / "x.asc").splitlines()
    frames = [FRAME.search(line).groups() for line in lines if "#" in line]
    assert [(int(identifier, 16), bool(fd), bytes.fromhex(data)) for identifier, fd, data in frames] == [
        (frame.id, frame.fd, frame.data) for frame in recording.frames
    ]


def test_uff58_has_every_value(recorded, tmp_path):
    path, recording = recorded
    export(tmp_path, path, "--to", "uff58")
    units, *datasets = pyuff.UFF(str(tmp_path / "x.uff")).read_sets()
    assert (units["type"], units["units_code"], units["length"], units["force"]) == (164, 1, 1.0, 1.0)
    found = {dataset["id1"]: dataset for dataset in datasets}
    assert list(found) == [*STATE, *LOAD, *SENSORS]
    for names, values, start_s in ((STATE + LOAD, recording.states, 0), (SENSORS, recording.samples, -0.0025)):
        for column, name in enumerate(names):
            # The format has 13 digits.
            assert found[name]["data"] == pytest.approx(values[:, column], rel=5e-13, abs=0), name
            assert found[name]["num_pts"] == len(values)
            assert found[name]["x"] == pytest.approx(start_s + 1e-3 * np.arange(len(values)))
    head = found["head_force_y_n"]
    assert (head["ordinate_spec_data_type"], head["rsp_node"], head["rsp_dir"], head["func_type"]) == (13, 3, 2, 1)
    assert (head["ordinate_axis_units_lab"], head["abscissa_spec_data_type"]) == ("N", 17)
    assert found["acceleration_b_x_m_s2"]["ordinate_axis_units_lab"] == "m/s^2"


def test_wav_has_every_value(recorded, tmp_path):
    path, recording = recorded
    export(tmp_path, path, "--to", "wav")
    for part, expected in (("states", recording.states), ("samples", recording.samples)):
        values, rate_hz = soundfile.read(tmp_path / f"x-{part}.wav", dtype="float32", always_2d=True)
        assert (rate_hz, values.shape) == (1000, expected.shape)
        assert (values == expected.astype(np.float32)).all()


def test_viewers_find_every_sample(recorded, tmp_path):
    path, recording = recorded
    export(tmp_path, path, "--to", "foxglove")
    rows, times, schemas = defaultdict(list), defaultdict(list), {}
    with (tmp_path / "x-foxglove.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            schemas[channel.topic] = schema.name, json.loads(schema.data)
            rows[channel.topic].append(json.loads(message.data))
            times[channel.topic].append(message.log_time)
        attached = {attachment.name: attachment.data.decode() for attachment in reader.iter_attachments()}
    for topic, names, expected in (
        ("/states", STATE + LOAD, recording.states),
        ("/samples", SENSORS, recording.samples),
    ):
        found = np.array([[row[name] for name in names] for row in rows[topic]])
        assert (found == expected).all()
        assert set(schemas[topic][1]["properties"]) == set(rows[topic][0]) == {*names, "sample"}
    assert times["/states"][:3] == [0, 1_000_000, 2_000_000]
    # Readings from before the run are placed at its beginning.
    assert times["/samples"][:5] == [0, 0, 0, 500_000, 1_500_000]
    assert schemas["/log"][0] == "foxglove.Log"
    assert [log["name"] for log in rows["/log"]] == [event.name for event in recording.topics["/events"]]
    for log in rows["/log"]:
        published(Log.DESCRIPTOR, log)
    declared(Log.DESCRIPTOR, schemas["/log"][1])
    # The moving arm is only there on request.
    assert set(schemas) == {"/states", "/samples", "/log"}
    assert attached["scenario.toml"] == recording.metadata["resonarm.configuration"]["scenario"]
    assert cantools.database.load_string(attached["resonarm.dbc"]).messages

    layout = json.loads((ROOT / "docs/foxglove-layout.json").read_text())
    paths = [series["value"] for panel in layout["configById"].values() for series in panel.get("paths", [])]
    assert len(paths) == 14 - 2
    for value in paths:
        topic, field = value.split(".")
        assert schemas[topic][1]["properties"][field] == {"type": "number"}
        assert all(type(row[field]) is float for row in rows[topic])
    logs = [panel["topicToRender"] for name, panel in layout["configById"].items() if name.startswith("RosOut!")]
    assert [schemas[topic][0] for topic in logs] == ["foxglove.Log"]
    # The 3D view shows the additions of `--moving-arm`.
    assert [panel["topics"] for name, panel in layout["configById"].items() if name.startswith("3D!")] == [
        {"/structure": {"visible": True}}
    ]
    panels = re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))
    assert sorted(panels) == sorted(layout["configById"])


def test_the_moving_arm(recorded, tmp_path):
    path, recording = recorded
    export(tmp_path, path, "--to", "foxglove", "--moving-arm", "20", "--to-s", "0.3")
    with (tmp_path / "x-foxglove.mcap").open("rb") as stream:
        updates = list(make_reader(stream, validate_crcs=True).iter_messages(topics=["/structure"]))
    assert [message.log_time for _, _, message in updates] == [k * 1_000_000 for k in range(301)]
    schema = updates[0][0]
    assert (schema.name, schema.encoding) == ("foxglove.SceneUpdate", "jsonschema")
    declared(SceneUpdate.DESCRIPTOR, json.loads(schema.data))
    # The arm of the preset, straight along x at β1 = 0, bent by β2 = 60°.
    beta, length_m = np.radians([0.0, 60.0]), (0.63, 0.6)
    for (_, _, message), (alpha1, alpha2) in zip(updates, recording.states[:, :2], strict=False):
        update = json.loads(message.data)
        published(SceneUpdate.DESCRIPTOR, update)
        (entity,) = update["entities"]
        assert (entity["id"], entity["frame_id"]) == ("structure", "base")
        assert entity["metadata"] == [{"key": "magnification", "value": "20"}]
        (line,) = entity["lines"]
        first, second = beta[0] + 20 * alpha1, beta.sum() + 20 * (alpha1 + alpha2)
        elbow = length_m[0] * np.array([np.cos(first), np.sin(first), 0.0])
        tip = elbow + length_m[1] * np.array([np.cos(second), np.sin(second), 0.0])
        found = np.array([[point["x"], point["y"], point["z"]] for point in line["points"]])
        assert found == pytest.approx(np.array([np.zeros(3), elbow, tip]), abs=1e-12)


def test_a_range_of_time(recorded, tmp_path):
    path, recording = recorded
    span = ("--from-s", "0.3", "--to-s", "0.7")
    for form in ("csv", "candump", "uff58", "wav"):
        export(tmp_path, path, "--to", form, *span)
    samples = rows(tmp_path / "x-samples.csv")
    assert [int(row["sample"]) for row in samples] == list(range(300, 701))
    assert (columns(samples, SENSORS) == recording.samples[300:701]).all()
    values, _ = soundfile.read(tmp_path / "x-states.wav", dtype="float32")
    assert (values == recording.states[300:701].astype(np.float32)).all()
    force = pyuff.UFF(str(tmp_path / "x.uff")).read_sets()[-1]
    assert force["data"] == pytest.approx(recording.samples[300:701, 5], rel=5e-13, abs=0)
    assert force["x"][0] == pytest.approx(0.2975)
    frames = [frame for frame in recording.frames if 300 <= frame.step <= 700]
    assert len((tmp_path / "x.log").read_text().splitlines()) == len(frames)


def test_memory_does_not_grow_with_the_recording(tmp_path):
    peak_kib = []
    for seconds in (4, 40):
        path = tmp_path / f"{seconds}.mcap"
        run(RESONARM, "run", "--mode", "free", "--duration-s", seconds, "--record", path)
        peaks = []
        for form in ("csv", "blf", "uff58", "wav"):
            words = [RESONARM, "export", path, "--to", form, "--out", tmp_path / str(seconds)]
            child = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL)
            _, status, usage = os.wait4(child.pid, 0)
            assert status == 0
            peaks.append(usage.ru_maxrss)
        peak_kib.append(peaks)
    # Ten times as long, and only chunks and buffers are in memory at once.
    assert all(long < short + 2048 for short, long in zip(*peak_kib, strict=True)), peak_kib
