"""Holds the protocol to tools that know nothing of its code: cantools reads the DBC, autosar-e2e computes the CRC.

A receiver and a sender are built from the two, and must do what the golden frames say.
"""

import json
import math
import re
import zlib
from pathlib import Path

import cantools
import pytest
from e2e.p11 import e2e_p11_check, e2e_p11_protect

PROTOCOL = Path(__file__).parents[2] / "firmware-protocol"
DBC = cantools.database.load_file(PROTOCOL / "resonarm.dbc", strict=True)
VECTORS = json.loads((PROTOCOL / "vectors" / "classic.json").read_text())
PROTECTION = {"crc", "counter"}


def data_id(message):
    """The E2E data id, or None for a message without protection."""
    attribute = message.dbc.attributes.get("E2EDataId")
    return None if attribute is None else attribute.value


def crc(message, data):
    """The CRC of the content of a message."""
    protected = bytearray(data)
    e2e_p11_protect(protected, data_id(message), increment_counter=False)
    assert protected[1:] == data[1:]
    return protected[0]


def parse(text):
    """A frame as cansend writes it: identifier, is it 11 bits, format, data."""
    number, rest = text.split("#", 1)
    standard = len(number) == 3
    if rest.startswith("#"):
        return int(number, 16), standard, "fd", bytes.fromhex(rest[2:])
    if rest.startswith("R"):
        return int(number, 16), standard, "remote", b""
    return int(number, 16), standard, "classic", bytes.fromhex(rest)


def message_of(identifier, base):
    """The DBC's message of an identifier in a network at `base`."""
    if base <= identifier < base + 8:
        identifier += 0x200 - base
    elif 0x200 <= identifier < 0x208:
        return None
    return next((message for message in DBC.messages if message.frame_id == identifier), None)


def content_fault(message, data):
    """Why the content is refused, if it is."""
    word = int.from_bytes(data, "little")
    for signal in message.signals:
        word &= ~(((1 << signal.length) - 1) << signal.start)
    if word:
        return "reserved"
    raw = message.decode(data, decode_choices=False, scaling=False)
    for signal in message.signals:
        if signal.is_signed and raw[signal.name] == -32768:
            return "not available"
        named = signal.choices and not signal.is_signed
        low, high = round(signal.minimum / signal.scale), round(signal.maximum / signal.scale)
        if (named and raw[signal.name] not in signal.choices) or not low <= raw[signal.name] <= high:
            return "unknown value"
    return None


class Receiver:
    """The checks of SPEC.md, in their order."""

    def __init__(self, base):
        self.base, self.last, self.lost = base, {}, 0

    def sequence_fault(self, message, counter):
        if counter == 15:
            return "invalid counter"
        last, self.last[message.name] = self.last.get(message.name), counter
        step = 1 if last is None else (counter - last) % 15
        if step == 0:
            return "repeated"
        if step > DBC.dbc.attributes["E2EMaxDeltaCounter"].value:
            return "wrong sequence"
        self.lost += step - 1
        return None

    def fault(self, message, form, data):
        if form != "classic":
            return "format"
        if len(data) != message.length:
            return "length"
        if data_id(message) is not None:
            if crc(message, data) != data[0]:
                return "crc"
            assert e2e_p11_check(bytearray(data), data_id(message)) == (data[1] & 0xF != 15)
            if fault := self.sequence_fault(message, data[1] & 0xF):
                return fault
        return content_fault(message, data)

    def accept(self, text):
        """The outcome of a frame, as the vectors write it."""
        identifier, standard, form, data = parse(text)
        message = message_of(identifier, self.base) if standard else None
        if message is None:
            return {"result": "ignored"}
        if fault := self.fault(message, form, data):
            return {"result": "refused", "reason": fault}
        signals = message.decode(data, decode_choices=False)
        if signals.get("state") == 0:
            senders = {other.name for other in DBC.messages if other.senders == message.senders}
            self.last = {name: counter for name, counter in self.last.items() if name not in senders}
        signals = {name: pytest.approx(value, rel=1e-12) for name, value in signals.items() if name not in PROTECTION}
        return {"result": "accepted", "accepted": {"message": message.name, "signals": signals}}


def encode(name, signals, counter):
    """The identifier and the bytes of a message; None if a command can't be sent."""
    message = DBC.get_message_by_name(name)
    raw = dict(signals)
    for signal in message.signals:
        if not signal.is_signed:
            continue
        value = float(signals[signal.name])
        if not math.isfinite(value):
            return None
        count = round(value * round(1 / signal.scale))
        if abs(count) > 32767:
            flag = signal.name.split("_")[1] + "_saturated"
            if flag not in raw:
                return None
            raw[flag], count = 1, math.copysign(32767, count)
        raw[signal.name] = int(count)
    protected = data_id(message) is not None
    if protected:
        raw.update(crc=0, counter=counter)
    try:
        data = bytearray(message.encode(raw, scaling=False, strict=True))
    except cantools.database.errors.EncodeError:
        return None
    if protected:
        e2e_p11_protect(data, data_id(message), increment_counter=False)
    return message.frame_id, bytes(data)


@pytest.mark.parametrize("case", VECTORS["cases"], ids=lambda case: case["name"])
def test_a_case(case):
    receiver, counters = Receiver(case["base"]), {}
    for step in case["steps"]:
        if "send" in step:
            name = step["send"]["message"]
            identifier, data = encode(name, step["send"]["signals"], counters.get(name, 0))
            counters[name] = (counters.get(name, 0) + 1) % 15
            assert message_of(parse(step["frame"])[0], case["base"]).frame_id == identifier
            assert parse(step["frame"])[3] == data, step["frame"]
        if step["result"] != "lost":
            expected = {key: step[key] for key in ("result", "reason", "accepted") if key in step}
            assert receiver.accept(step["frame"]) == expected, step["frame"]
    assert receiver.lost == case["lost"]


@pytest.mark.parametrize("case", VECTORS["unsendable"], ids=lambda case: f"{case['message']} {case['reason']}")
def test_what_cannot_be_sent(case):
    assert encode(case["message"], case["signals"], 0) is None


def test_every_message_is_a_classical_frame_with_a_cycle_time():
    for message in DBC.messages:
        assert not message.is_fd and not message.is_extended_frame
        assert message.dbc.attributes["VFrameFormat"].value == 0
        assert "GenMsgCycleTime" in message.dbc.attributes
        assert message.comment and all(signal.comment for signal in message.signals)


def test_the_hellos_of_the_specification_carry_the_hash_of_this_dbc():
    expected = zlib.crc32((PROTOCOL / "resonarm.dbc").read_bytes()) & 0xFFFFFF
    stated = re.findall(r"dbc_hash=0x([0-9A-F]{6})", (PROTOCOL / "SPEC.md").read_text())
    assert stated and {int(text, 16) for text in stated} == {expected}


def test_profile_11_is_the_one_of_the_golden_values():
    """Both data id modes, eight zero bytes, data id 0x123, as AUTOSAR implementations agree on them."""
    data = bytearray(8)
    e2e_p11_protect(data, 0x123, increment_counter=False)
    assert data[:2] == bytes([0xCC, 0x00])
