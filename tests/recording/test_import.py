"""BLF logs, written by python-can and by `resonarm export`, imported: the frames are those that python-can reads."""

import struct

import can
import pytest
from can.io import blf
from processes import RESONARM, run
from recordings import SENT, Recording

START_S = 1_785_000_000.123456


def messages(count=1):
    """Frames of all kinds, ten microseconds apart, repeated."""
    kinds = [
        {"arbitration_id": 0x201, "data": bytes(range(8)), "is_rx": True},
        {"arbitration_id": 0x0, "data": b"", "is_rx": False},
        {"arbitration_id": 0x1FFFFFFF, "is_extended_id": True, "data": b"\xab"},
        {"arbitration_id": 0x7FF, "is_remote_frame": True, "dlc": 5},
        {"arbitration_id": 0x202, "is_fd": True, "bitrate_switch": True, "data": bytes([9]) * 64},
        {"arbitration_id": 0x123, "is_extended_id": True, "is_fd": True, "error_state_indicator": True, "dlc": 12,
         "data": bytes(12)},
        {"arbitration_id": 0x203, "is_fd": True, "data": b"\x01\x02", "is_rx": False},
        {"is_error_frame": True},
    ]
    return [
        can.Message(**{"is_extended_id": False, **kind}, timestamp=START_S + 1e-5 * index)
        for index, kind in enumerate(count * kinds)
    ]


def content(message):
    flags = message.is_fd, message.bitrate_switch, message.error_state_indicator, message.is_remote_frame
    return message.arbitration_id, message.is_extended_id, flags, message.is_rx, bytes(message.data)


def imported(folder, log, *options):
    """The frames of a recording made from the log, and the output of `import`."""
    path = folder / "imported.mcap"
    said = run(RESONARM, "import", log, path, "--overwrite", *options)
    frames = Recording.whole(path).frames
    return [
        (frame.id, frame.extended, (frame.fd, frame.brs, frame.esi, frame.remote), frame.direction != SENT, frame.data)
        for frame in frames
    ], [frame.time_ns for frame in frames], said


def write(path, recorded, **options):
    with can.BLFWriter(path, **options) as writer:
        for message in recorded:
            writer(message)


@pytest.mark.parametrize(
    "options",
    [{}, {"compression_level": 0}, {"max_container_size": 150}, {"compression_level": 0, "max_container_size": 120}],
    ids=["compressed", "stored", "objects over two containers", "stored over two containers"],
)
def test_logs_of_python_can_are_read(tmp_path, options):
    log = tmp_path / "log.blf"
    write(log, messages(50), **options)
    expected = [message for message in can.BLFReader(log) if not message.is_error_frame]
    frames, times_ns, said = imported(tmp_path, log)
    assert frames == [content(message) for message in expected]
    # Of the eight kinds one is an error frame, which is no frame of a recording.
    assert len(frames) == 50 * 7 and "50 lines or objects that are no frames" in said
    since_first = [message.timestamp - expected[0].timestamp for message in expected]
    # python-can's times are floating-point numbers of the UNIX epoch, exact to a quarter of a microsecond.
    assert [time_ns * 1e-9 for time_ns in times_ns] == pytest.approx(since_first, abs=1e-6)


def test_objects_that_only_vector_writes_are_read(tmp_path):
    log = tmp_path / "log.blf"
    head = struct.Struct("<BBBBLLLLLLLHBBL")
    with can.BLFWriter(log) as writer:
        classic = blf.CAN_MSG_STRUCT.pack(1, 1, 3, 0x80000123, b"\x01\x02\x03" + bytes(5)) + bytes(8)
        writer._add_object(blf.CAN_MESSAGE2, classic, START_S)
        # A length of 64 with two bytes present; a classical and a remote frame on a CAN FD channel; a request to send.
        for dlc, length, flags, direction, data in [
            (15, 64, 0x3000, 0, b"\x07\x08"),
            (2, 2, 0x0000, 1, b"\x05\x06"),
            (4, 4, 0x0010, 0, b""),
            (1, 1, 0x1000, 2, b"\x01"),
        ]:
            fields = head.pack(1, dlc, length, 0, 0x345, 0, flags, 0, 0, 0, 0, 0, direction, 0, 0)
            writer._add_object(blf.CAN_FD_MESSAGE_64, fields + data, START_S)
    expected = list(can.BLFReader(log))
    frames, _, said = imported(tmp_path, log)
    assert frames[:3] == [content(message) for message in expected[:3]]
    assert frames[1][-1] == b"\x07\x08" + bytes(62)
    # python-can fills the data of a remote frame with zeros, and reads a request to send as a sent frame.
    assert frames[3][:3] == content(expected[3])[:3]
    assert len(frames) == len(expected) - 1 == 4 and "and 1 line or object that is no frame" in said


def test_an_exported_log_is_imported_and_replayed(tmp_path):
    recorded = tmp_path / "run.mcap"
    run(RESONARM, "run", "--mode", "free", "--duration-s", "0.5", "--record", recorded)
    run(RESONARM, "export", recorded, "--to", "blf", "--out", tmp_path)
    frames, times_ns, _ = imported(tmp_path, tmp_path / "run.blf")
    whole = Recording.whole(recorded).frames
    assert [(frame[0], frame[-1]) for frame in frames] == [(frame.id, frame.data) for frame in whole]
    assert times_ns == [frame.time_ns - whole[0].time_ns for frame in whole]


def test_one_channel_of_two(tmp_path):
    log = tmp_path / "log.blf"
    both = [can.Message(arbitration_id=0x100 + k, channel=k % 2, timestamp=k, is_extended_id=False) for k in range(6)]
    write(log, both)
    frames, _, _ = imported(tmp_path, log, "--interface", "2")
    assert [frame[0] for frame in frames] == [0x101, 0x103, 0x105]
