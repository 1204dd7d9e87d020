"""A recording in independent readers: the packages `mcap` and `mcap-protobuf-support`."""

import json
import math
import subprocess
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory
from recordings import unpacked

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = 1234


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A file of the example, and the example's output."""
    path = tmp_path_factory.mktemp("recording") / "run.mcap"
    # Built by `cargo test`, with the features of the tests.
    command = [ROOT / "target/debug/examples/recording", path, str(SAMPLES)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=True)
    return path, json.loads(run.stdout)


@pytest.fixture(scope="module")
def messages(recording):
    """All messages, decoded by the schemas in the file, by topic."""
    path, _ = recording
    topics = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topics[channel.topic].append((message, decoded))
    return topics


def alpha1_rad(sample):
    t = sample * 1e-3
    return 1e-3 * math.exp(-2 * t) * math.cos(2 * math.pi * 30 * t)


def test_every_record_passes_a_reader_that_checks_all_checksums(recording):
    path, _ = recording
    with path.open("rb") as stream:
        names = [type(record).__name__ for record in StreamReader(stream, validate_crcs=True).records]
    assert names[:3] == ["Header", "Metadata", "Metadata"]
    assert names[-1] == "Footer"
    assert names.count("Message") > 3 * SAMPLES / 10


def test_counts_are_those_of_the_summary(recording, messages):
    path, said = recording
    topics = said["summary"]["topics"]
    assert {topic: len(found) for topic, found in messages.items()} == {
        topic: content["messages"] for topic, content in topics.items()
    }
    with path.open("rb") as stream:
        statistics = make_reader(stream).get_summary().statistics
    assert statistics.message_count == sum(len(found) for found in messages.values())
    assert said["summary"]["file_bytes"] == path.stat().st_size
    assert said["summary"]["integrity"] == {"state": "complete"}


def test_states_are_what_was_simulated(messages):
    sample = 0
    for message, batch in messages["/plant/steps"]:
        assert batch.first_step == sample
        assert message.log_time == sample * 1_000_000
        assert batch.dt_s == 1e-3
        assert len(batch.force_y_n) == len(batch.alpha1_rad)
        for row, alpha in enumerate(batch.alpha1_rad):
            assert alpha == pytest.approx(alpha1_rad(sample), abs=1e-18)
            assert batch.alpha2_rad[row] == -0.5 * alpha
            sample += 1
    assert sample == SAMPLES


def filtered(values, every=10):
    """Every tenth value through the filter that docs/recording.md states; the series is continued beyond its ends by
    its end values."""
    half = 26 * every
    i = np.arange(-half, half + 1)
    # A Kaiser window for a stop band of A = 80 dB has β = 0.1102 (A − 8.7).
    taps = np.kaiser(2 * half + 1, 0.1102 * (80 - 8.7)) * np.sinc(0.9 * i / every)
    return np.convolve(np.pad(values, half, mode="edge"), taps / taps.sum(), mode="valid")[::every]


def test_plot_topics_are_every_tenth_sample_filtered(messages):
    for batches, topic, names in (
        ("/plant/steps", "/plant/state", ("alpha1_rad", "alpha2_dot_rad_s")),
        ("/plant/steps", "/plant/command", ("force_x_n",)),
        ("/plant/samples", "/plant/sensors", ("acceleration_c_y_m_s2", "head_force_x_n")),
    ):
        # Of 1234 samples every tenth from the first on.
        assert [message.log_time for message, _ in messages[topic]] == [k * 10_000_000 for k in range(124)]
        assert [plotted.step for _, plotted in messages[topic]] == list(range(0, SAMPLES, 10))
        for name in names:
            full = np.concatenate([getattr(batch, name) for _, batch in messages[batches]])
            plotted = np.array([getattr(plotted, name) for _, plotted in messages[topic]])
            assert np.abs(plotted - filtered(full)).max() <= 2**-24 * np.abs(full).max()  # rounded to 24 bits


def test_frames_are_whole(messages):
    frames = [frame for _, batch in messages["/can/frames"] for frame in unpacked(batch)]
    assert len(frames) == 2 * SAMPLES
    for index, frame in enumerate(frames):
        assert frame.step == index // 2
        assert frame.time_ns == frame.step * 1_000_000
        assert frame.data == frame.step.to_bytes(8, "little")
        assert (frame.id, frame.direction, frame.flags) == ((0x201, 1, 0), (0x203, 2, 0))[index % 2]
        assert frame.bus_timestamp_ns is None
    assert {batch.interface for _, batch in messages["/can/frames"]} == {"memory"}
    # A batch of half a second has the time of its first sample.
    log_times = [message.log_time for message, _ in messages["/can/frames"]]
    assert log_times == list(range(0, SAMPLES * 1_000_000, 500_000_000))


def test_ticks_and_events(messages):
    wakeups = [wakeup for _, batch in messages["/timing/ticks"] for wakeup in batch.wakeup_ns]
    assert wakeups == [1000 + sample for sample in range(SAMPLES)]
    assert [(event.name, event.value, event.step) for _, event in messages["/events"]] == [("run.end", -1, SAMPLES)]


def test_metadata_stands_at_both_ends(recording):
    path, _ = recording
    with path.open("rb") as stream:
        metadata = [(record.name, record.metadata) for record in make_reader(stream).iter_metadata()]
    names = [name for name, _ in metadata]
    head = ["resonarm.recording", "resonarm.configuration"]
    assert names == head + head + ["resonarm.statistics", "resonarm.lost"]
    assert metadata[:2] == metadata[2:4]
    assert metadata[1][1] == {"scenario": "frequency_hz = 30\n", "seed": "1"}
    assert dict(metadata)["resonarm.lost"] == {"plant": "0"}
