"""python-can on the bus and the files of this package, with its own tools."""

import os
import pty
import select
import subprocess
import sys
import time
from pathlib import Path

import can
import numpy as np
import pytest

import resonarm
from resonarm.can_bus import ResonarmBus

ROOT = Path(__file__).resolve().parents[2]
BENCH = ROOT / "scenarios/bench.toml"
SWEEP = ROOT / "recordings/free-sweep.mcap"
LOCKSTEP = ROOT / "recordings/lockstep-dwell.mcap"


# Holds an `asammdf` that can't be imported: no tool here is given MF4 files, for which python-can imports it, and with
# it pandas and pyarrow, in a second of processor time.
LEAN = os.pathsep.join(filter(None, [str(ROOT / "tests/vcan/lean"), os.environ.get("PYTHONPATH")]))


def tool(name, *words):
    command, environment = [sys.executable, "-m", f"can.{name}", *map(str, words)], os.environ | {"PYTHONPATH": LEAN}
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True, env=environment).stdout


def seen(messages):
    return [(m.arbitration_id, bytes(m.data), m.is_fd, m.is_rx) for m in messages]


@pytest.fixture
def buses(request):
    """Opens ends of one plant's bus."""
    opened = []

    def open_end(**options):
        bus = can.Bus(interface="resonarm", channel=request.node.name, **options)
        opened.append(bus)
        return bus

    yield open_end
    for bus in opened:
        bus.shutdown()


def test_a_bus_is_that_of_a_plant(buses, bench_scenario, tmp_path):
    listener = buses(scenario=bench_scenario, record=tmp_path / "plant.mcap")
    assert isinstance(listener, ResonarmBus)
    assert listener.protocol == can.CanProtocol.CAN_20
    exciter = resonarm.Node("exciter", bench_scenario, listener._bench.hub.end(), "lockstep")
    heard = []
    while (message := listener.recv(0.5 if exciter.is_running else 0.0)) is not None:
        heard.append(message)
    exciter.wait()
    assert listener.dropped == 0
    listener.shutdown()
    assert listener.report.plant["samples"] >= 1000
    decoder = resonarm.Decoder()
    assert {decoder.decode(message).verdict for message in heard} == {"taken"}
    recorded = can.LogReader(tmp_path / "plant.mcap")
    sent = {(m.arbitration_id, bytes(m.data)) for m in recorded}
    readings = {(m.arbitration_id, bytes(m.data)) for m in heard if 0x203 <= m.arbitration_id <= 0x205}
    assert readings <= sent
    assert len(heard) > 3000


def test_ends_hear_each_other_and_not_themselves(buses):
    first, second = buses(), buses()
    first.send(can.Message(arbitration_id=0x7E1, is_extended_id=False, data=b"hello"))
    first.send(can.Message(arbitration_id=0x1ABCDE, is_extended_id=True, data=bytes(48), is_fd=True))
    second.set_filters([{"can_id": 0x7E1, "can_mask": 0x7FF}, {"can_id": 0x1ABCDE, "can_mask": 0x1FFFFFFF}])
    assert seen([second.recv(5), second.recv(5)]) == [
        (0x7E1, b"hello", False, True),
        (0x1ABCDE, bytes(48), True, True),
    ]
    first.set_filters([{"can_id": 0x7E1, "can_mask": 0x7FF}, {"can_id": 0x1ABCDE, "can_mask": 0x1FFFFFFF}])
    assert first.recv(0.0) is None
    with pytest.raises(can.CanOperationError, match="no remote frames"):
        first.send(can.Message(arbitration_id=1, is_extended_id=False, is_remote_frame=True))
    with pytest.raises(can.CanInitializationError, match="join it without scenario"):
        buses(scenario=BENCH)
    second.shutdown()
    with pytest.raises(can.CanOperationError, match="the bus is closed"):
        second.recv(0)
    assert first.plant.is_running
    first.shutdown()
    assert not first.plant.is_running


def test_a_notifier_listens_while_others_send(buses):
    first, second = buses(), buses()
    reader = can.BufferedReader()
    second.set_filters([{"can_id": 0x7E1, "can_mask": 0x7FF}])
    notifier = can.Notifier(second, [reader])
    for k in range(200):
        first.send(can.Message(arbitration_id=0x7E1, is_extended_id=False, data=[k]))
    assert [reader.get_message(10).data[0] for _ in range(200)] == list(range(200))
    notifier.stop()


def test_a_wrong_scenario_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="can't read the scenario"):
        can.Bus(interface="resonarm", scenario=tmp_path / "none.toml")
    with pytest.raises(ValueError, match="unknown mode"):
        can.Bus(interface="resonarm", channel="modes", mode="quick")
    with pytest.raises(ValueError, match="the mode free has no bus"):
        can.Bus(interface="resonarm", channel="modes", mode="free")


def test_a_recording_is_read_as_the_program_exports_it(command, tmp_path):
    command("export", SWEEP, "--to", "candump", "--out", tmp_path / "sweep")
    tool("logconvert", SWEEP, tmp_path / "converted.log")
    ours, theirs = [list(can.LogReader(tmp_path / name)) for name in ("converted.log", "sweep.log")]
    assert seen(ours) == seen(theirs)
    assert len(ours) == len(resonarm.Recording(SWEEP).frames)
    times = [[m.timestamp for m in log] for log in (ours, theirs)]
    np.testing.assert_allclose(times[0], times[1], atol=2e-6)


def test_a_log_becomes_a_recording(tmp_path):
    messages = [
        can.Message(timestamp=1.8e9 + k / 1000, arbitration_id=0x203 + k % 3, is_extended_id=False, data=[k % 256] * 8)
        for k in range(2500)
    ]
    with can.Logger(tmp_path / "log.asc") as log:
        for message in messages:
            log(message)
    tool("logconvert", tmp_path / "log.asc", tmp_path / "log.mcap")
    frames = resonarm.Recording(tmp_path / "log.mcap").frames
    assert len(frames) == 2500
    np.testing.assert_array_equal(frames["data"][:, 0], np.arange(2500) % 256)
    again = list(can.LogReader(tmp_path / "log.mcap"))
    assert [m.arbitration_id for m in again] == [m.arbitration_id for m in messages]
    assert resonarm.Recording(tmp_path / "log.mcap").summary["integrity"]["state"] == "complete"


@pytest.mark.parametrize("ending", [".trc", ".csv", ".log"])
def test_logs_that_the_program_does_not_read_are_imported(tmp_path, ending):
    """TRC and CSV by python-can; without a scenario frames have the directions of the log."""
    messages = [
        can.Message(timestamp=1.8e9, arbitration_id=0x123, is_extended_id=False, data=[1, 2]),
        can.Message(timestamp=1.8e9 + 0.5, arbitration_id=0x1ABCDEF0, data=[3], is_rx=ending == ".csv"),
        can.Message(timestamp=1.8e9 + 1, arbitration_id=0x7FF, is_extended_id=False, is_remote_frame=True, dlc=4),
    ]
    if ending == ".trc":
        messages.pop()  # python-can writes no remote frames into TRC
    else:
        for message in messages:
            message.channel = 1
    with can.Logger(tmp_path / f"log{ending}") as log:
        for message in messages:
            log(message)
    imported = resonarm.import_log(tmp_path / f"log{ending}", tmp_path / "log.mcap")
    assert (imported["frames"], imported["unreadable"]) == (len(messages), 0)
    again = list(can.LogReader(tmp_path / "log.mcap"))
    assert [(m.arbitration_id, bytes(m.data), m.is_remote_frame) for m in again] == [
        (m.arbitration_id, bytes(m.data), m.is_remote_frame) for m in messages
    ]
    # python-can writes no length of a remote frame into candump's logs.
    assert [m.dlc for m in again] == [2, 1, 4 if ending == ".csv" else 0][: len(messages)]
    with pytest.raises(FileExistsError):
        resonarm.import_log(tmp_path / f"log{ending}", tmp_path / "log.mcap")
    with pytest.raises(ValueError, match="no frames of interface"):
        resonarm.import_log(tmp_path / f"log{ending}", tmp_path / "other.mcap", interface="none")


def test_frames_that_waited_in_a_queue_are_earlier_than_the_first(tmp_path):
    """For a plant that began after frames of the exciter had waited for some ms: from its recording, from a BLF log."""
    messages = list(can.LogReader(LOCKSTEP))
    assert min(message.timestamp for message in messages) < messages[0].timestamp - 0.005
    tool("logconvert", LOCKSTEP, tmp_path / "log.blf")
    for log in (LOCKSTEP, tmp_path / "log.blf"):
        tool("logconvert", log, tmp_path / "log.mcap")
        expected, got = list(can.LogReader(log)), list(can.LogReader(tmp_path / "log.mcap"))
        assert [(m.arbitration_id, m.data) for m in got] == [(m.arbitration_id, m.data) for m in expected]
        # As exact as a 64-bit float is for a time of this century.
        late_s = [m.timestamp - n.timestamp for m, n in zip(got, expected, strict=True)]
        assert len(got) == len(messages) and np.abs(late_s).max() < 1e-6


def test_a_log_whose_time_goes_back_is_refused(tmp_path):
    with can.Logger(tmp_path / "log.mcap") as log:
        log(can.Message(timestamp=2.0))
        with pytest.raises(ValueError, match="1000000000 ns earlier than the first"):
            log(can.Message(timestamp=1.0))
    with pytest.raises(ValueError, match="nothing can be appended"):
        can.Logger(tmp_path / "log.mcap", append=True)


def test_frames_are_played_to_a_plant(tmp_path):
    words = ["-i", "resonarm", "-c", "played", "--bus-kwargs", f"record={tmp_path / 'played.mcap'}"]
    tool("player", *words, "--ignore-timestamps", SWEEP)
    recorded = resonarm.Recording(tmp_path / "played.mcap")
    received = recorded.frames[recorded.frames["received"]]
    assert len(received) > 1000


def test_the_viewer_shows_a_plant():
    ended, terminal = pty.openpty()
    words = [sys.executable, "-m", "can.viewer", "-i", "resonarm", "-c", "viewed", "--bus-kwargs", f"scenario={BENCH}"]
    environment = os.environ | {"TERM": "xterm", "LINES": "40", "COLUMNS": "120"}
    with subprocess.Popen(words, stdin=terminal, stdout=terminal, stderr=terminal, env=environment) as viewer:
        os.close(terminal)
        shown, end = b"", time.monotonic() + 120
        # The heartbeat and the hello of the plant.
        while not (b"0x701" in shown and b"0x206" in shown) and time.monotonic() < end:
            if select.select([ended], [], [], 1)[0]:
                shown += os.read(ended, 65536)
        os.write(ended, b"q")
        while viewer.poll() is None and time.monotonic() < end:
            if select.select([ended], [], [], 0.1)[0]:
                try:
                    os.read(ended, 65536)
                except OSError:
                    break
        assert viewer.wait(60) == 0, shown
    os.close(ended)
    assert b"0x701" in shown
