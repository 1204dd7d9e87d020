"""Frames as candump logs them, decoded by the DBC and checked by the AUTOSAR E2E library."""

import re
from dataclasses import dataclass
from pathlib import Path

import cantools
import numpy as np
from e2e.p11 import e2e_p11_check

DBC = cantools.database.load_file(Path(__file__).parents[2] / "firmware-protocol" / "resonarm.dbc", strict=True)
LINE = re.compile(r"\((\d+\.\d+)\) \S+ ([0-9A-F]+)#([0-9A-F]*)$")


@dataclass(frozen=True)
class Frame:
    time_s: float
    id: int
    data: bytes

    @property
    def content(self):
        return self.id, self.data


def log(candump):
    """Everything that a `Programs.candump` has seen, after which it ends. Only classical data frames may be in it, and
    none may be missing: anything else that candump says is an error."""
    candump.settle()
    candump.stop()
    frames = []
    for line in candump.stdout.splitlines():
        match = LINE.match(line)
        assert match, line
        frames.append(Frame(float(match[1]), int(match[2], 16), bytes.fromhex(match[3])))
    return frames


def decode(frame):
    """Name and signals of a frame; cantools refuses what the DBC does not know, and values out of range are an
    error."""
    message = DBC.get_message_by_frame_id(frame.id)
    assert len(frame.data) == message.length, frame
    signals = message.decode(frame.data, decode_choices=False)
    for signal in message.signals:
        value = signals[signal.name]
        assert signal.minimum is None or signal.minimum <= value <= signal.maximum, (frame, signal.name, value)
    return message.name, signals


def check(frames):
    """Every frame decodes, passes the E2E check if it is protected, and its counter follows the one before."""
    counters = {}
    for frame in frames:
        name, signals = decode(frame)
        data_id = DBC.get_message_by_name(name).dbc.attributes.get("E2EDataId")
        if data_id is None:
            continue
        assert e2e_p11_check(bytearray(frame.data), data_id.value), frame
        expected = (counters[name] + 1) % 15 if name in counters else 0
        assert signals["counter"] == expected, (frame, expected)
        counters[name] = signals["counter"]


def messages(frames, name):
    """The signals of every frame of one message, in order."""
    wanted = DBC.get_message_by_name(name).frame_id
    return [decode(frame)[1] for frame in frames if frame.id == wanted]


def columns(frames, name, *signals):
    """Signals of one message as an array, a row a sample; the samples must follow each other from 0 without a gap."""
    found = messages(frames, name)
    assert [signal["sample"] for signal in found] == [k % 65536 for k in range(len(found))]
    return np.array([[signal[each] for each in signals] for signal in found])
